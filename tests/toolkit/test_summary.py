"""At a prompt and in a notebook: options by name; results as a line and a table, no arrays."""

import autophyx_tet as apx
import numpy as np
import pytest
from autophyx_tet.fem.scene.box import box_mesh
from autophyx_tet.fem.scene.mesh import TetMesh


@pytest.fixture(scope="module")
def assigned():
    mesh = box_mesh((0.1, 0.1, 0.2), (1, 1, 2))
    names = ("<seat>", "legs")
    region = (mesh.centroids[:, 2] < 0.1).astype(np.int32)
    return apx.assign(TetMesh(mesh.points, mesh.tets, region, names), "steel")


def test_options_are_given_by_name(assigned):
    """As keywords of the verbs; what is no option names the nearest one."""
    soft, stiff = (apx.assign(assigned.mesh, "steel", alpha=a) for a in (0.0, 1.0))
    assert (soft.mesh.material.E < stiff.mesh.material.E).all()
    with pytest.raises(apx.AutophyxError, match="assign has no option 'alpa'; did you mean 'al"):
        apx.assign(assigned.mesh, "steel", alpa=0.1)
    with pytest.raises(apx.AutophyxError, match="convert has no option 'sizes'"):
        apx.convert("nowhere.glb", sizes=3)


def test_a_mesh_is_a_line(assigned):
    line = repr(assigned.mesh)
    assert line == "<TetMesh: 12 tets, 12 points, <seat>, legs, with E, nu and rho>"


def test_a_result_is_a_line_and_a_table(assigned):
    """Two parts of 1e-3 m^3 of steel weigh 15.7 kg; names cannot write HTML."""
    line, table = repr(assigned), assigned._repr_html_()
    assert line.startswith("<Assignment: 2 parts, 12 tets, 15.")
    assert "\n" not in line
    assert table.count("<tr>") == 3
    assert "&lt;seat&gt;" in table
    assert "<seat>" not in table


def test_a_simulation_tells_its_verdicts(assigned):
    found = apx.simulate(assigned.mesh)
    assert repr(found).startswith("<Settled: 2 parts, 12 tets, 15.")
    assert "It holds its shape" in found._repr_html_()
