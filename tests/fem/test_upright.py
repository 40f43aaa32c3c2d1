"""Whether a body would stand if its base were not held: where its load meets the ground."""

from dataclasses import replace

import numpy as np
import pytest
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.fem.scenarios import Poke, Sag
from autophyx_tet.fem.scene.scene import Hold
from autophyx_tet.fem.solve.contact import support_polygon
from autophyx_tet.fem.solve.equilibrium import StaticMethod
from autophyx_tet.toolkit.verdict.checks import stays_upright

from .bodies import with_uniform

SIDE, HEIGHT, RHO = 0.2, 1.0, 500.0
WEIGHT = RHO * SIDE**2 * HEIGHT * 9.81


def block():
    return with_uniform(box_mesh((SIDE, SIDE, HEIGHT), (2, 2, 8)), E=1e9, nu=0.3, rho=RHO)


def pushed(mesh, force, height=HEIGHT):
    """Scene of a block on the ground with a force [N] on it at a height [m]."""
    scene = Sag().scene(mesh)
    forces = np.zeros((len(mesh.points), 3))
    top = np.flatnonzero(np.isclose(mesh.points[:, 2], height))
    forces[top] = np.asarray(force) / len(top)
    return replace(scene, forces=forces)


def found(scene):
    (check,) = stays_upright(StaticMethod().solve(scene, order=1), scene)
    return check


@pytest.mark.parametrize("share", [0.0, 0.9, 1.1])
def test_a_block_tips_where_the_push_at_its_top_outdoes_its_weight(share):
    """F h = W b / 2, to the digit: b / 2 - F h / W is how far within its feet the load is."""
    push = share * WEIGHT * SIDE / 2 / HEIGHT
    check = found(pushed(block(), (push, 0, 0)))
    assert (check.outcome == "passed") == (share < 1)
    assert check.value == pytest.approx((1 - share) * SIDE / 2, abs=1e-9)
    assert ("friction is below 0.09" in check.sentence) == (share == 0.9)
    assert ("would tip over" in check.sentence) == (share > 1)


def test_a_corner_is_nearer_than_a_side():
    """Pushed along the diagonal it still tips over its nearest side."""
    check = found(pushed(block(), WEIGHT * SIDE / 2 / HEIGHT * np.array([0.9, 0.5, 0.0])))
    assert check.value == pytest.approx(0.1 * SIDE / 2, abs=1e-9)


def test_what_leans_tips_by_its_own_weight():
    """A sheared block: its middle moves aside by half of its shear, over a foot .1 m to a side."""
    mesh = block()
    for shear, stands in ((0.15, True), (0.25, False)):
        points = mesh.points + shear * mesh.points[:, [2]] * [1.0, 0, 0]
        check = found(Sag().scene(replace(mesh, points=points)))
        assert (check.outcome == "passed") == stands
        # Nodes up to 2 % of the height are feet: the lowest layer alone here.
        assert check.value == pytest.approx(SIDE / 2 - shear * HEIGHT / 2, abs=1e-9)


def test_a_scene_that_leaves_the_weight_out_has_it_here():
    """A finger near the top: the same law, though the scene of a poke has no gravity."""
    for share in (0.8, 1.25):  # its patch reaches some 5 % of the height down
        push = share * WEIGHT * SIDE / 2 / HEIGHT
        scene = Poke(push, (SIDE, SIDE / 2, HEIGHT), (-1, 0, 0)).scene(block())
        assert not np.any(scene.gravity_vector)
        assert (found(scene).outcome == "passed") == (share < 1)


def test_lifted_off_and_not_asked():
    """More pull than weight lifts it; what a user fixed need not stand by itself."""
    scene = pushed(block(), (0, 0, 2 * WEIGHT))
    assert "lift off" in found(scene).sentence
    result = StaticMethod().solve(scene, order=1)
    assert stays_upright(result, replace(scene, ground=None)) == ()
    assert stays_upright(result, replace(scene, holds=(Hold("base", np.arange(4)),))) == ()


def test_feet_on_a_line_hold_nothing():
    """And a load right above a corner is on the edge, up being any axis."""
    line = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    down = np.array([0, 0, -1.0])
    assert support_polygon(line, down, np.cross([1, 0.1, 1], down), "z").inside < 0
    square = np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, 1], [1, 0, 1]])
    force = np.array([0.5, -1.0, 0])
    held = support_polygon(square, force, np.cross([0.5, 1.0, 0.5], force), "y")
    assert held == pytest.approx((0.0, 0.5))
