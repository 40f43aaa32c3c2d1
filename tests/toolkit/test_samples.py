"""Volumes from random points: known as well as they say, of what is scattered too."""

import numpy as np
import pytest
import trimesh
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.toolkit.asset.triangles import COARSE, Triangles, inside
from autophyx_tet.toolkit.meshing.guarantees import InputVolume, input_volume, lattice_guarantees
from autophyx_tet.toolkit.meshing.quality import quality

from .test_stuffing import solids_of

SIDE = 0.02


def places(seed: int) -> np.ndarray:
    """Sixty corners in a box of a metre, no two of them within a cube's side."""
    grid = np.stack(np.meshgrid(*[np.arange(0.0, 1.0, 0.1)] * 3), axis=-1).reshape(-1, 3)
    return np.random.default_rng(seed).permutation(grid)[:60]


def crumbs(seed: int) -> InputVolume:
    """Volume of cubes that are together half a thousandth of their box."""
    cube = trimesh.creation.box((SIDE,) * 3)
    cubes = [cube.copy().apply_translation(at) for at in places(seed)]
    return input_volume(solids_of(trimesh.util.concatenate(cubes)), 1, rng=np.random.default_rng(0))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_the_volume_of_what_is_scattered_is_known(seed):
    """Some thirty points of the first look are inside: a volume to 70 %, then to a few per cent."""
    found = crumbs(seed)
    assert found.uncertainty <= COARSE
    assert found.total == pytest.approx(60 * SIDE**3, rel=found.uncertainty)


@pytest.mark.slow
def test_half_of_what_is_scattered_is_no_mesh_of_it():
    """With all cubes the promised volume is kept, with half of them it is not."""
    for count, kept in ((60, True), (30, False)):
        boxes = [box_mesh((SIDE,) * 3, (1, 1, 1), lo=tuple(at)) for at in places(0)[:count]]
        points = np.concatenate([box.points for box in boxes])
        tets = np.concatenate([box.tets + 8 * i for i, box in enumerate(boxes)])
        mesh = TetMesh(points, tets, np.zeros(len(tets), dtype=np.int32))
        (volume,) = (
            one
            for one in lattice_guarantees(mesh, quality(mesh), crumbs(0), 0.0)
            if one.name == "relative error of volume"
        )
        assert volume.ok == kept


@pytest.mark.slow
def test_one_point_is_asked_for_all_on_its_side():
    """A thin ring and a ball in it: the same points with the same labels, of half the questions."""
    ring = trimesh.creation.torus(1.0, 0.1)
    ring.apply_transform(trimesh.transformations.rotation_matrix(0.7, [1, 2, 3]))
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.15)
    ball.apply_translation(ring.vertices[0])
    (shell,) = solids_of(trimesh.util.concatenate([ring, ball])).shells
    skin, found, asked = Triangles(shell.points, shell.faces), [], []
    for crisp in (False, True):
        count = []

        def label(where, count=count):
            count.append(len(where))
            return shell.depth(where) - 1

        rng = np.random.default_rng(0)
        bounds = (
            shell.points[shell.faces].min(axis=(0, 1)),
            shell.points[shell.faces].max(axis=(0, 1)),
        )
        found.append(inside(skin, label, np.stack(bounds), rng=rng, count=2000, crisp=crisp))
        asked.append(sum(count))
    for one, other in zip(*found, strict=True):
        np.testing.assert_array_equal(one, other)
    assert set(np.unique(found[0].label)) == {0, 1}  # what both hold is 1
    assert asked[1] < asked[0] / 1.5


def test_bodies_apart_are_known_exactly_and_others_sampled():
    """Balls and a box apart: their volume to round-off. Where boxes overlap it is asked for."""
    ball, box = trimesh.creation.icosphere(subdivisions=2), trimesh.creation.box((1, 2, 3))
    rng, wanted = np.random.default_rng(0), ball.volume + box.volume
    apart = solids_of(trimesh.util.concatenate([ball, box.copy().apply_translation([3, 0, 0])]))
    found = input_volume(apart, 1, rng=rng, crossing=False)
    assert found.uncertainty == 0
    assert found.total == pytest.approx(wanted, rel=1e-12)
    near = solids_of(trimesh.util.concatenate([ball, box.copy().apply_translation([1.2, 1.5, 0])]))
    for solids, crossing in ((apart, True), (near, False)):
        sampled = input_volume(solids, 1, rng=rng, crossing=crossing)
        assert 0 < sampled.uncertainty
        assert sampled.total <= wanted * (1 + sampled.uncertainty)


def test_a_ball_within_a_ball_is_not_counted_twice():
    """Two closed shells wound alike, one in the other: the volume is that of the outer one."""
    ball = trimesh.creation.icosphere(subdivisions=2)
    both = trimesh.util.concatenate([ball, ball.copy().apply_scale(0.5)])
    found = input_volume(solids_of(both), 1, rng=np.random.default_rng(0), crossing=False)
    assert found.total == pytest.approx(ball.volume, rel=found.uncertainty)
