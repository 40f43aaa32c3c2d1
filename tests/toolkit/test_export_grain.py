"""The grain of wood leaves for other programs, or is missed by name."""

from dataclasses import replace

import numpy as np
import pytest
from autophyx_tet.converters.mesh.meshdata import write_mesh
from autophyx_tet.converters.points.table import PointTable, write_points
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.toolkit.asset.document import Sidecar
from autophyx_tet.toolkit.options import ExportOptions
from autophyx_tet.toolkit.transfer import export, transfer


@pytest.fixture
def bar(tmp_path):
    """A bar along x, its lower half of oak by the sidecar's rows, the upper one of steel."""
    mesh = box_mesh((0.6, 0.2, 0.2), (3, 1, 2))
    region = (mesh.centroids[:, 2] > 0.1).astype(int)
    material = ElementMaterial.uniform(len(mesh.tets), E=1.1e10, nu=0.35, rho=700.0)
    mesh = replace(mesh, region=region, region_names=("leg", "top"), material=material)
    write_mesh(tmp_path / "bar.msh", mesh)
    rows = {"leg": "white oak (along grain)", "top": "steel"}
    parts = [{"name": name, "material": row} for name, row in rows.items()]
    Sidecar("z").with_record(assign={"parts": parts}).write(tmp_path / "bar.msh")
    return tmp_path / "bar.msh"


def test_a_deck_has_the_grain_along_the_longest_side_or_as_said(bar):
    done = export(bar, "calculix", output=bar.with_name("bar.inp"))
    (said,) = done.warnings
    assert said.startswith("the grain is taken along leg (")
    assert said.endswith("--grain says otherwise")
    deck = bar.with_name("bar.inp").read_text()
    assert deck.count("ENGINEERING CONSTANTS") == 1
    along = deck.partition("SYSTEM=RECTANGULAR\n")[2].split(",")[:3]
    np.testing.assert_allclose(np.array(along, dtype=float), (1, 0, 0), atol=0.1)
    options = ExportOptions(grain=("part:leg=0,2,0",))
    export(bar, "calculix", output=bar.with_name("bar.inp"), options=options)
    assert "SYSTEM=RECTANGULAR\n0, 1, 0," in bar.with_name("bar.inp").read_text()


def test_what_knows_no_grain_names_the_parts_once(bar):
    for target in ("newton", "mujoco", "usd", "sofa"):
        found = export(bar, target, output=bar.with_name("out")).warnings
        (said,) = [warning for warning in found if "grain" in warning]
        assert "the grain of leg" in said, target
    points = np.linspace(0.05, 0.15, 5).astype("f4")
    write_points(bar.with_name("p.ply"), PointTable(dict.fromkeys("xyz", points)))
    found = transfer(bar, bar.with_name("p.ply"), output=bar.with_name("q.ply"))
    assert "not kept in q.ply: the grain of leg" in found.warnings
