"""Real furniture: dirty, multi-part objects convert with every guarantee and keep their parts."""

import pytest
from autophyx_tet.toolkit.load import load_asset
from autophyx_tet.toolkit.sweethome3d import catalog, extract
from autophyx_tet.toolkit.tetrahedralize import tetrahedralize

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
