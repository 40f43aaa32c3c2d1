"""Real furniture: dirty, multi-part objects convert with every guarantee and keep their parts."""

import numpy as np
import pytest
from autophyx_tet.research.datasets.sweethome3d import catalog, extract
from autophyx_tet.toolkit.asset.load import load_asset
from autophyx_tet.toolkit.asset.repair import repair
from autophyx_tet.toolkit.asset.solids import Solids, hollowed
from autophyx_tet.toolkit.asset.triangles import closest
from autophyx_tet.toolkit.meshing.convert import tetrahedralize

pytestmark = [pytest.mark.real, pytest.mark.slow]

# Coarser than the default, so that all of them take about two minutes.
OPTIONS = {"epsilon_rel": 6e-3, "edge_length_rel": 0.08, "stop_energy": 30.0}
OBJECTS = (
    "KatorLegaz/dining-chair",  # non-manifold edges
    "BlendSwap-CC-0/chair",  # four parts of one material, half of it inside out
    "Scopia/chair3",  # holes, and a rim that stays open
    "BlendSwap-CC-0/JapaneseLantern",  # a fifth of its surface is folded sheets
    "BlendSwap-CC-0/chair2",  # an open frame
)
HOLLOW = ("Scopia/medicoscopia_bottle2", "BlendSwap-CC-0/lowerCabinet", "KatorLegaz/fridge")


@pytest.fixture(scope="module")
def furniture():
    sources = {key.split("/")[0] for key in OBJECTS}
    return {item.key: item for source in sources for item in catalog(source)}


@pytest.mark.parametrize("key", OBJECTS)
def test_real_object_converts(key, furniture, tmp_path):
    """Watertight, no inverted tet, real size, a region for each part that has a volume."""
    item = furniture[key]
    asset = load_asset(extract(item, tmp_path), size=max(item.size), up="y")
    mesh, report = tetrahedralize(asset, **OPTIONS)
    assert report.ok, report.failed
    assert (mesh.volumes > 0).all()
    assert max(mesh.bounds[1] - mesh.bounds[0]) == pytest.approx(max(item.size), rel=0.02)
    accounted = {*mesh.region_names, *report.sheets, *report.lost}
    assert accounted == set(asset.part_names)
    assert not report.lost


@pytest.mark.parametrize("key", HOLLOW)
def test_real_object_is_hollowed(key, furniture, tmp_path):
    """A wall of 2 % of the size: as much as lies within that depth below each shell, within 2 %."""
    item = furniture[key]
    asset = load_asset(extract(item, tmp_path), size=1.0, up="y")
    surface, _ = repair(asset.parts)
    solids = Solids.of(surface, len(asset.parts), thinnest=1e-3)
    thin = hollowed(solids, dict.fromkeys(range(len(asset.parts)), 0.02))
    lo, hi = solids.bounds
    where = lo + (hi - lo) * np.random.default_rng(0).random((60_000, 3))
    skin = np.zeros(len(where), dtype=bool)
    for shell in solids.shells:
        inside = np.flatnonzero(shell.contains(where))
        depth = closest(where[inside], shell.points, shell.faces).distance
        skin[inside[depth <= 0.02]] = True
    left = thin.label(where) >= 0
    assert left.sum() == pytest.approx(skin.sum(), rel=0.02)
    assert left.sum() < 0.8 * (solids.label(where) >= 0).sum()
