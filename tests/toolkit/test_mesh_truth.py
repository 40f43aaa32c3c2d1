"""What a mesh leaves of an answer, through the command with its defaults, beside exact values."""

import json

import numpy as np
import pytest
from autophyx_tet.converters.mesh.meshdata import write_mesh
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.fem.scene.scene import Scene
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.error import bisected
from autophyx_tet.fem.solve.result import SAFETY

from ..fem.bodies import with_uniform
from .command import run_here


def sagged(tmp_path, mesh, *words):
    """The ``sag`` of the document of the command, and its verdicts by name."""
    path = tmp_path / "body.msh"
    write_mesh(path, mesh)
    done = run_here("simulate", path, *words, "-o", tmp_path / "rest.vtu", "--json")
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)["sag"]
    return answer, {verdict["detail"]: verdict for verdict in answer["verdicts"]}


def halved(mesh, times=1):
    """The same body in edges 2 ** ``times`` shorter."""
    scene = Scene(mesh=mesh, supports=Supports.none(len(mesh.points)))
    for _ in range(3 * times):
        scene = bisected(scene, np.arange(len(scene.mesh.tets)))
    return scene.mesh


@pytest.mark.parametrize("cells", [(1, 1, 20), pytest.param((8, 8, 110), marks=pytest.mark.long)])
@pytest.mark.truth("buckling of a fine stem")
@pytest.mark.slow
def test_a_stem_past_its_own_weight(tmp_path, cells):
    """3.75 times what buckles it (Greenhill 1881); 42,240 tets, 190,000 unknowns, too."""
    L, a, E = 1.0, 0.01, 1e9
    rho = 3.75 * 7.837 * E * a**2 / 12 / L**3 / 9.81
    mesh = with_uniform(box_mesh((a, a, L), cells), E=E, nu=0.3, rho=rho)
    answer, found = sagged(tmp_path, mesh, "--fix", "plane:z<0")
    assert answer["order"] == 2
    assert answer["load_factor"] == pytest.approx(1 / 3.75, rel=0.02)
    assert found["holds shape"]["outcome"] == found["buckling"]["outcome"] == "failed"


@pytest.mark.truth("error of the elements in use")
@pytest.mark.slow
def test_a_tet_alone_tells_its_error(tmp_path):
    """It was told to be 1 % off, and is 16 %: beside 512 tets of the same body."""
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    mesh = with_uniform(TetMesh.oriented(points, [[0, 1, 2, 3]]), E=1e6, nu=0.3, rho=1000.0)
    one, fine = (sagged(tmp_path, m, "--fix", "plane:z<0")[0] for m in (mesh, halved(mesh, 3)))
    error = abs(fine["max_displacement"] / one["max_displacement"] - 1)
    assert 0.5 < one["gap"]["value"] / error < 2
    assert error < SAFETY * one["gap"]["value"]


@pytest.mark.parametrize("cells", [(3, 3, 2), (2, 4, 4)])
@pytest.mark.truth("error of the elements in use")
@pytest.mark.slow
def test_flat_cells_tell_their_error(tmp_path, cells):
    """Cells of 1:13 and 1:40 of a plate clamped at a side, beside edges half as long."""
    mesh = with_uniform(box_mesh((1.0, 1.0, 0.05), cells), E=1e9, nu=0.3, rho=1000.0)
    one, fine = (sagged(tmp_path, m, "--fix", "plane:x<0")[0] for m in (mesh, halved(mesh)))
    error = fine["max_displacement"] / one["max_displacement"] - 1
    assert error < SAFETY * one["gap"]["value"] < 3 * error


@pytest.mark.truth("error of the elements in use")
def test_a_bar_tells_the_error_of_its_own_elements(tmp_path):
    """P L^3 / 3 E I + P L / k G A (nu 0), 2 % off: not by what linear elements would be, 94 %."""
    E, a, force = 1e7, 0.1, 0.01
    mesh = with_uniform(box_mesh((1.0, a, a), (3, 1, 1)), E=E, nu=0.0, rho=1000.0)
    words = ("--fix", "plane:x<0", "--load", f"plane:x>1=0,0,{-force}", "--gravity", "0")
    answer, found = sagged(tmp_path, mesh, *words)
    exact = force / (3 * E * a**4 / 12) + force / (5 / 6 * E / 2 * a**2)
    error = 1 - answer["max_displacement"] / exact
    assert 0.015 < error < 0.025
    assert 0.5 < answer["gap"]["value"] / error < 2
    assert found["discretisation"]["outcome"] == "passed"
    assert "within about 4%" in found["discretisation"]["sentence"]


def strip(cells, length, height, thick=0.002):
    """A thin strip on its edge, and the force at its end that tips it aside by thin-strip theory.

    4.013 sqrt(E I G J) / L^2 (Michell, Prandtl 1899).
    """
    E, nu = 7e10, 0.3
    mesh = with_uniform(box_mesh((length, thick, height), cells), E=E, nu=nu, rho=2700.0)
    EI = E * height * thick**3 / 12
    GJ = E / 2 / (1 + nu) * height * thick**3 / 3 * (1 - 0.63 * thick / height)
    return mesh, 4.013 * np.sqrt(EI * GJ) / length**2


@pytest.mark.parametrize(
    ("cells", "length", "height", "of_theory"),
    [((20, 1, 1), 1.0, 0.05, 1.034), ((40, 1, 2), 1.0, 0.05, 1.034), ((10, 1, 2), 0.5, 0.1, 1.118)],
)
@pytest.mark.truth("error of a load factor")
def test_a_strip_that_tips_aside(tmp_path, cells, length, height, of_theory):
    """6 to 33 % too high by its mesh, which is told, and green at no load that tips it.

    CalculiX with C3D20, 80 x 1 x 6 and 50 x 1 x 10, has the factor ``of_theory``, whose strip is
    free to warp and to curve across at its clamp.
    """
    mesh, force = strip(cells, length, height)
    force *= of_theory * 1.02  # it has tipped
    words = ("--fix", "plane:x<0", "--load", f"plane:x>{length}=0,0,{-force}", "--gravity", "0")
    answer, found = sagged(tmp_path, mesh, *words)
    error = answer["load_factor"] * 1.02 - 1
    assert 0.05 < error < 0.4
    assert 0.7 < answer["load_factor_error"] / error < 1.5
    assert found["buckling"]["outcome"] == "doubtful"
    assert "too high by its mesh" in found["buckling"]["sentence"]
    assert found["holds shape"]["outcome"] == "doubtful"
