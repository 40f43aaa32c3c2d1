"""Laws of contact: small obstacles are kept out of faces, forces are those of an energy."""

import numpy as np
import pytest
from autophyx_tet.fem.elements.assembly import discretise, stiffness
from autophyx_tet.fem.elements.space import make_space
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.fem.scene.obstacles import Box, Capsule, Plane, Sphere
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.contact import Contact, face_lattice
from autophyx_tet.fem.solve.dynamics import Dynamics

from .bodies import lifted, merged, shaken_box, with_uniform

ORDERS = pytest.mark.parametrize("order", [1, 2])
DOWN = (0, 0, -1.0)
# All 0.1 m in size, 11 mm above a face of 0.5 m and away from its points.
SMALL = [
    Sphere((0.3, 0.2, 0.611), 0.1, DOWN),
    Capsule((0.2, 0.25, 0.611), (0.4, 0.2, 0.611), 0.1, DOWN),
    Box((0.3, 0.2, 0.611), (0.1, 0.1, 0.1), DOWN),
]


@ORDERS
@pytest.mark.parametrize("cells", [2, 5])
def test_places_of_a_face_move_with_it(order, cells):
    """Linear functions are exact; quadratic ones too where the nodes are those of a quadratic."""
    share = face_lattice(cells, 3 * order)
    xi = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]])[: 3 * order]
    places = share @ xi
    assert len(np.unique(np.round(places, 9), axis=0)) == (cells + 1) * (cells + 2) // 2
    f = lambda x: 1 + x @ [2, -3] + (order - 1) * x[:, 0] * x[:, 1]  # noqa: E731
    np.testing.assert_allclose(share @ f(xi), f(places), atol=1e-12)


@pytest.mark.slow
@ORDERS
@pytest.mark.parametrize("obstacle", SMALL, ids=lambda o: type(o).__name__)
def test_small_obstacles_press_into_faces(order, obstacle):
    """No place of a face is deeper inside than the lattice lets it: 1 % of R, 3 % at an edge."""
    mesh = with_uniform(box_mesh((1, 1, 0.5), (2, 2, 1)), E=1e5, nu=0.3, rho=1e3)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 2] == 0)
    body = Dynamics(mesh, supports=held, obstacles=[obstacle], order=order, tolerance=1e-6)
    states = body.run(0.01, 10)
    share = face_lattice(97, 3)
    for state in states[5:]:
        x = mesh.points + state.u[: len(mesh.points)]
        places = np.einsum("sk,fkd->fsd", share, x[mesh.boundary.faces]).reshape(-1, 3)
        if order == 1:
            gap = obstacle.distance(places - state.time * np.array(DOWN)).gap.min()
            assert gap > -(0.03 if isinstance(obstacle, Box) else 0.015) * 0.1
        assert state.gap > 0
        np.testing.assert_allclose(state.obstacle_force[0], state.contact_force.sum(axis=0))
    assert states[-1].obstacle_force[0, 2] < -50  # 1e5 Pa, a tenth of a metre deep in 0.5 m


@ORDERS
def test_contact_forces_are_derivatives(order):
    """Gradient and, where the barrier is convex and alone, Hessian by central differences."""
    mesh = shaken_box((1, 1, 0.5), (2, 2, 1), E=1e5, amount=0.0)
    grid = discretise(mesh, order)
    contact = Contact(mesh, grid.space, [Sphere((0.3, 0.2, 0.62), 0.1)], 0.0, thickness=0.025)
    rng = np.random.default_rng(0)
    u, d = 2e-3 * rng.normal(size=(2, *grid.space.nodes.shape))
    h = 1e-4
    out = []
    for sign in (1, -1):
        gradient = np.zeros_like(u)
        contact.add_gradient(u + sign * h * d, gradient)
        out.append((contact.value(u + sign * h * d), gradient))
    here = np.zeros_like(u)
    contact.add_gradient(u, here)
    slope = (out[0][0] - out[1][0]) / (2 * h)
    assert abs(slope) > 0
    assert (here * d).sum() == pytest.approx(slope, rel=1e-5)
    matrix = stiffness(grid, *np.zeros((2, len(mesh.tets))))
    matrix = contact.with_hessian(u, matrix)
    bent, change = matrix.times(d), (out[0][1] - out[1][1]) / (2 * h)
    # What is left out is the turning of the ball's normal: slope / radius, small against the bend.
    assert np.linalg.norm(bent - change) < 0.2 * np.linalg.norm(change)
    assert np.linalg.eigvalsh(matrix.to_scipy().toarray())[0] > -1e-9 * np.abs(bent).max()


@pytest.mark.long
def test_a_plate_rests_on_small_balls():
    """Three balls of 0.1 m under faces of 0.5 m carry m g to 1e-4, each its share."""
    mesh = with_uniform(box_mesh((1, 1, 0.2), (2, 2, 1)), E=1e6, nu=0.3, rho=1e3)
    mesh = lifted(mesh, 0.101)
    places = [(0.2, 0.3), (0.8, 0.3), (0.5, 0.9)]
    balls = [Sphere((x, y, 0.0), 0.1) for x, y in places]
    body = Dynamics(mesh, gravity_vector=(0, 0, -9.81), obstacles=balls, tolerance=1e-6)
    state = body.run(0.1, 8)[-1]
    weight = 9.81 * mesh.mass
    assert state.obstacle_force[:, 2].sum() == pytest.approx(weight, rel=1e-4)
    # Levers about the middle: the third ball carries (0.5 - 0.3) / (0.9 - 0.3) of the weight.
    assert state.obstacle_force[2, 2] == pytest.approx(weight / 3, rel=0.02)


def test_an_obstacle_far_smaller_than_a_face_is_refused():
    mesh = shaken_box((1, 1, 0.5), (1, 1, 1), E=1e5, amount=0.0)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 2] == 0)
    needle = Sphere((0.3, 0.2, 0.515), 0.01, DOWN)
    with pytest.raises(InputError, match="slip through; wanted a finer mesh"):
        Dynamics(mesh, supports=held, obstacles=[needle]).run(0.01, 3)


def test_gap_is_that_of_the_faces():
    """Above the middle of a coarse face, the distance is that to the face, not to its corners."""
    mesh = with_uniform(box_mesh((1, 1, 1), (1, 1, 1)), E=1.0, nu=0.3)
    contact = Contact(mesh, make_space(mesh, 1), [Sphere((0.6, 0.3, 2.0), 0.1)], 0.0)
    assert contact.gap(np.zeros_like(mesh.points)) == pytest.approx(0.9, abs=0.002)


@ORDERS
@pytest.mark.slow
def test_pressure_under_a_standing_block_is_its_weight_over_its_base(order):
    """Nothing across (nu = 0): m g / A everywhere, on the ground and on the block below.

    10 %: the own weight of nodes is that of their tets, not of their share of the base.
    """
    low = box_mesh((0.1, 0.1, 0.1), (2, 2, 2), lo=(0, 0, 1e-4))
    high = box_mesh((0.1, 0.1, 0.1), (2, 2, 2), lo=(0, 0, 0.1002))
    mesh = with_uniform(merged(low, high), E=1e6, nu=0.0, rho=1e3)
    known = {"gravity_vector": (0, 0, -9.81), "obstacles": [Plane()], "order": order}
    state = Dynamics(mesh, **known, tolerance=1e-6).run(0.1, 10)[-1]
    assert state.pressures.obstacles[0] == pytest.approx(2e3 * 9.81 * 0.1, rel=0.1)
    assert state.pressures.own == pytest.approx(1e3 * 9.81 * 0.1, rel=0.1)
