"""The error that is told of a quadratic answer, beside that of refined answers."""

from typing import NamedTuple

import numpy as np
import pytest
from autophyx_tet.fem.elements.assembly import node_supports
from autophyx_tet.fem.elements.space import make_space
from autophyx_tet.fem.material import OrthotropicConstants
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.fem.scenarios import hang
from autophyx_tet.fem.scene.loads import spread_force
from autophyx_tet.fem.scene.scene import Scene
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.equilibrium import StaticMethod
from autophyx_tet.toolkit.verdict.checks import discretisation

from .bodies import faces_at, with_uniform

# Children of a quadratic tet: its corners, and the octahedron within, cut along one diagonal.
CHILDREN = [
    [0, 4, 6, 7], [4, 1, 5, 8], [6, 5, 2, 9], [7, 8, 9, 3],
    [4, 6, 7, 8], [4, 5, 6, 8], [6, 7, 8, 9], [5, 6, 9, 8],
]  # fmt: skip


class Body(NamedTuple):
    """Sides [m] and cells of a box, its nu, the axis along whose start it is clamped; ``pushed``:

    by a force on the face at the other end, else by its weight.
    """

    size: tuple[float, float, float]
    cells: tuple[int, int, int]
    nu: float = 0.3
    axis: int = 0
    pushed: bool = False


BODIES = {
    "a beam one cell thick": Body((1, 0.1, 0.1), (10, 1, 1)),
    "a beam of long cells": Body((1, 0.05, 0.05), (4, 1, 1)),
    "a beam of two cells": Body((1, 0.2, 0.2), (10, 2, 2), pushed=True),
    "a plate one cell thick": Body((1, 1, 0.02), (8, 8, 1)),
    "a block": Body((1, 1, 1), (4, 4, 4), axis=2),
    "a rubber pad": Body((1, 1, 0.25), (4, 4, 1), nu=0.49, axis=2, pushed=True),
}


def scene(body, levels):
    """The body, each tet cut in eight ``levels`` times."""
    mesh = with_uniform(box_mesh(body.size, body.cells), E=1e9, nu=body.nu, rho=1000.0)
    held = Supports.clamp(len(mesh.points), mesh.points[:, body.axis] < 1e-9)
    for _ in range(levels):
        space = make_space(mesh, 2)
        held = node_supports(held, space)
        fine = TetMesh.oriented(space.nodes, space.elements[:, CHILDREN].reshape(-1, 4))
        mesh = with_uniform(fine, E=1e9, nu=body.nu, rho=1000.0)
    if not body.pushed:
        return Scene(mesh=mesh, supports=held, gravity_vector=(0, 0, -9.81))
    end = faces_at(mesh, body.axis, body.size[body.axis])
    return Scene(mesh=mesh, supports=held, tractions=(spread_force(mesh, end, (0, 0, -1e3)),))


def rest(body, levels=0):
    return StaticMethod().solve(scene(body, levels), law="linear")


@pytest.mark.blockers
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.slow if np.prod(body.cells) < 50 else pytest.mark.long)
        for name, body in BODIES.items()
    ],
)
def test_the_estimate_is_near_the_error(name):
    """.5 to 3 times the error of quadratic elements; 20 and more times it linear ones are off."""
    result = rest(BODIES[name])
    point = np.linalg.norm(result.displacement, axis=1).argmax()
    u = [r.displacement[point] for r in (result, *(rest(BODIES[name], n) for n in (1, 2)))]
    steps = np.linalg.norm(np.diff(u, axis=0), axis=1)
    left = min(steps[1] / steps[0], 0.6)  # a geometric series; .6 of a sharp corner, at most
    error = np.linalg.norm(u[2] - u[0] + (u[2] - u[1]) * left / (1 - left)) / np.linalg.norm(u[0])
    told = result.discretisation_error
    assert told.kind == "cubic surplus"
    assert 0.5 < told.value / error < 3
    assert error < told.bound


def test_an_exact_answer_has_no_error():
    """A hanging bar is quadratic: cubic elements add nothing to it, and a percent is told."""
    mesh = with_uniform(box_mesh((0.2, 0.2, 1.0), (2, 2, 5)), E=1e8, nu=0.0, rho=1000.0)
    error = hang(mesh, law="linear").discretisation_error
    assert error.value < 1e-8
    assert error.bound == 0.01


def test_without_a_factor_cg_finds_the_same(monkeypatch):
    """The error and the load factor, on the very body whose stiffness is kept."""
    body = scene(BODIES["a block"], 0)
    by_factor = StaticMethod().solve(body, law="linear")
    monkeypatch.setattr("autophyx_tet.fem.solve.modal.MOST_ENTRIES", 0)
    by_cg = StaticMethod().solve(body, law="linear")
    errors = [r.discretisation_error.value for r in (by_factor, by_cg)]
    assert errors[1] == pytest.approx(errors[0], rel=0.02)  # thousandths add up over the steps
    assert by_cg.load_factor.value == pytest.approx(by_factor.load_factor.value, rel=1e-3)


def test_along_the_grain():
    """A solid that is told as one with a grain, but isotropic, has the same error."""
    body = scene(BODIES["a beam one cell thick"], 0)
    plain = StaticMethod().solve(body, law="linear").discretisation_error.value
    shear = 1e9 / 2.6
    alike = OrthotropicConstants(1e9, 1e9, 1e9, shear, shear, shear, 0.3, 0.3, 0.3)
    every = np.ones(len(body.mesh.tets), dtype=bool)
    material = body.mesh.material.with_grain(every, alike, np.eye(3))
    grained = Scene(
        mesh=body.mesh.with_material(material),
        supports=body.supports,
        gravity_vector=body.gravity_vector,
    )
    error = StaticMethod().solve(grained, law="linear").discretisation_error.value
    assert error == pytest.approx(plain, rel=0.03)  # other steps of CG, to as little


def test_the_sentence_names_what_the_number_is_of():
    said = discretisation(rest(BODIES["a beam of long cells"])).sentence
    assert "largest displacement within about" in said
    assert "cubic elements would add" in said
