"""Up with a minus: every scene is that of the body turned over, with the same answers."""

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.mpm.boundaries import scene_room
from autophyx_tet.fem.scenarios import sag
from autophyx_tet.fem.scene.obstacles import Plane
from autophyx_tet.fem.scene.supports import ground_under
from autophyx_tet.fem.scene.up import UpAxis, half_turn, up_index, up_vector
from autophyx_tet.fem.solve.contact import support_polygon
from autophyx_tet.fem.solve.method import SCENARIOS
from autophyx_tet.toolkit.verdict.checks import stays_upright

from .bodies import shaken_box

pytestmark = pytest.mark.blockers
DOWNWARDS = ("-x", "-y", "-z")


def cone():
    """A body that narrows along each axis in another way, so that its ends differ."""
    mesh = shaken_box((0.3, 0.4, 0.5), (3, 4, 4), E=1e6, nu=0.3, rho=1000)
    share = mesh.points / [0.3, 0.4, 0.5]
    points = mesh.points * (1 - np.roll(share, 1, axis=1) * [0.2, 0.3, 0.25])
    return replace(mesh, points=points)


def turned(mesh, up):
    return replace(mesh, points=mesh.points * half_turn(up))


@pytest.mark.parametrize("up", get_args(UpAxis))
def test_the_half_turn_is_a_rotation_onto_the_plain_axis(up):
    np.testing.assert_array_equal(half_turn(up) * up_vector(up), up_vector(up[-1]))
    assert np.prod(half_turn(up)) == 1
    mesh = cone()
    assert ground_under(mesh, up).point @ up_vector(up) == (mesh.points @ up_vector(up)).min()


def test_what_is_no_axis_is_said():
    with pytest.raises(InputError, match=r"up axis 'w'.*-y"):
        up_index("w")


@pytest.mark.parametrize("up", DOWNWARDS)
@pytest.mark.parametrize("name", SCENARIOS.names)
def test_a_scene_is_that_of_the_body_turned_over(name, up):
    """Weight, supports, ground, obstacles and loads turn with the body."""
    mesh, turn = cone(), half_turn(up)
    ours = SCENARIOS[name]().scene(mesh, up=up)
    theirs = SCENARIOS[name]().scene(turned(mesh, up), up=up[-1])
    assert ours.height == pytest.approx(theirs.height)
    assert turn * ours.gravity_vector == pytest.approx(np.asarray(theirs.gravity_vector))
    np.testing.assert_array_equal(ours.held.fixed, theirs.held.fixed)
    assert len(ours.tractions) == len(theirs.tractions)
    for our, their in zip(ours.tractions, theirs.tractions, strict=True):
        np.testing.assert_array_equal(our.faces, their.faces)
        assert turn * our.value == pytest.approx(their.value)
    planes = zip(
        [ours.ground, *(o for o in ours.obstacles if isinstance(o, Plane))],
        [theirs.ground, *(o for o in theirs.obstacles if isinstance(o, Plane))],
        strict=True,
    )
    for our, their in planes if name != "squeeze" else ():  # its plates come in another order
        if our is None:
            continue
        assert turn * np.array(our.normal) == pytest.approx(np.array(their.normal))
        level = np.array(our.point) @ np.array(our.normal)
        assert level == pytest.approx(np.array(their.point) @ np.array(their.normal))
        heights = mesh.points @ np.array(our.normal) - level
        assert heights.min() >= -1e-12  # the ground is below the body


@pytest.mark.slow
@pytest.mark.parametrize("up", DOWNWARDS)
def test_it_sags_as_the_body_turned_over(up):
    """And it stands as firmly; the particles' room reaches the ground."""
    mesh, turn = cone(), half_turn(up)
    ours, theirs = sag(mesh, up=up, order=1), sag(turned(mesh, up), up=up[-1], order=1)
    assert ours.displacement * turn == pytest.approx(theirs.displacement, rel=1e-6, abs=1e-12)
    assert not np.allclose(ours.displacement, sag(mesh, up=up[-1], order=1).displacement)
    scenes = [
        SCENARIOS["sag"]().scene(mesh, up=up),
        SCENARIOS["sag"]().scene(turned(mesh, up), up=up[-1]),
    ]
    verdicts = [
        stays_upright(answer, scene)[0].value
        for answer, scene in zip((ours, theirs), scenes, strict=True)
    ]
    assert verdicts[0] == pytest.approx(verdicts[1], rel=1e-6)
    fall = SCENARIOS["fall"]().scene(mesh, up=up)
    room = scene_room(fall, 20)
    low, high = room.origin, room.origin + room.spacing * (np.array(room.shape) - 1)
    (ground,) = fall.obstacles
    level = np.array(ground.point) @ up_vector(up)
    assert min(low @ up_vector(up), high @ up_vector(up)) <= level


def test_feet_of_a_body_upside_down():
    """A load in the middle of four feet at the top end of the axis."""
    square = np.array([[0.0, 1, 0], [1, 1, 0], [0, 1, 1], [1, 1, 1]])
    force = np.array([0.0, 2.0, 0])
    held = support_polygon(square, force, np.cross([0.5, 0.0, 0.5], force), "-y")
    assert held == pytest.approx((0.5, 0.0))
