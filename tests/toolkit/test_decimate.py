"""Decimation: fewer triangles of the same surface, within a distance, with walls left alone."""

import numpy as np
import pytest
import trimesh
from autophyx_tet.toolkit.asset.engines import decimated
from autophyx_tet.toolkit.asset.triangles import Triangles, closest


def _triangles(mesh):
    return Triangles(np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64))


def _volume(surface):
    return trimesh.Trimesh(*surface, process=False).volume


@pytest.mark.slow
@pytest.mark.parametrize("tolerance", [1e-3, 1e-2])
def test_a_ball_stays_within_its_tolerance(tolerance):
    """Both ways; the volume changes by at most area times tolerance."""
    ball = _triangles(trimesh.creation.icosphere(5))
    coarse = decimated(ball, tolerance).surface
    assert len(coarse.faces) < len(ball.faces) / 2
    for start, end in ((ball, coarse), (coarse, ball)):
        assert closest(start.points, *end).distance.max() <= tolerance
    assert _volume(coarse) == pytest.approx(_volume(ball), abs=4 * np.pi * tolerance)


def test_a_rim_that_pinches_at_a_point_is_left_alone():
    """A ball with two holes that meet at a vertex, which libigl refuses; the ball beside is not."""
    ball = trimesh.creation.icosphere(4)
    around = np.flatnonzero((ball.faces == 0).any(axis=1))
    first = ball.faces[around[0]]
    (other,) = [f for f in around if np.isin(ball.faces[f], first).sum() == 1][:1]
    pinched = np.delete(ball.faces, [around[0], other], axis=0)
    for beside in (False, True):
        points = np.concatenate([ball.vertices, ball.vertices + 3.0])
        faces = np.concatenate([pinched, ball.faces[: len(ball.faces) * beside] + len(points) // 2])
        found = decimated(Triangles(points, faces.astype(np.int64)), 1e-2)
        assert found.left_alone == len(pinched)
        assert (len(found.surface.faces) < len(faces) / 1.5) == beside


def test_a_finely_divided_box_keeps_its_edges():
    """Flat faces cost nothing: 12,288 triangles become few, the volume stays to round-off."""
    box = trimesh.creation.box((1, 2, 3))
    for _ in range(5):
        box = box.subdivide()
    coarse = decimated(_triangles(box), 1e-3).surface
    assert len(coarse.faces) <= 1000
    assert _volume(coarse) == pytest.approx(6, rel=1e-3)


def test_what_touches_is_left_alone():
    """Two finely divided boxes that share a wall, point by point, come back as they were."""
    box = trimesh.creation.box((1, 1, 1)).subdivide().subdivide().subdivide()
    other = box.copy()
    other.apply_translation((1, 0, 0))
    both = _triangles(trimesh.util.concatenate([box, other]))
    same = decimated(both, 1e-2)
    assert same.surface is both
    assert (same.pieces, same.left_alone) == (2, len(both.faces))
    other.apply_translation((1, 0, 0))
    apart = _triangles(trimesh.util.concatenate([box, other]))
    fewer = decimated(apart, 1e-2)
    assert len(fewer.surface.faces) < len(apart.faces)
    assert fewer.left_alone == 0


@pytest.mark.slow
def test_small_components_are_left_alone():
    """A crumb of 12 triangles beside a fine ball keeps every one of them, and its volume."""
    ball, crumb = trimesh.creation.icosphere(5), trimesh.creation.box((0.01,) * 3)
    crumb.apply_translation((2, 0, 0))
    coarse = decimated(_triangles(trimesh.util.concatenate([ball, crumb])), 5e-3).surface
    mine = (coarse.points[coarse.faces][:, :, 0] > 1.5).all(axis=1)
    assert mine.sum() == 12


def test_a_rough_piece_does_not_hold_back_a_flat_one():
    """A ball too rough to lose triangles beside a fine box: the box becomes a few all the same."""
    ball, box = trimesh.creation.icosphere(4), trimesh.creation.box((1, 1, 1))
    ball.vertices *= 1 + 0.1 * np.random.default_rng(0).random((len(ball.vertices), 1))
    for _ in range(4):
        box = box.subdivide()
    box.apply_translation((3, 0, 0))
    coarse = decimated(_triangles(trimesh.util.concatenate([ball, box])), 1e-4).surface
    of_box = (coarse.points[coarse.faces][:, :, 0] > 2).all(axis=1)
    assert of_box.sum() < len(box.faces) / 4
    assert (~of_box).sum() > 0.9 * len(ball.faces)


def test_a_surface_wound_both_ways_is_left_alone():
    """Collapsing its edges would never end: neighbours are not found from edges run twice."""
    ball = _triangles(trimesh.creation.icosphere(4))
    faces = np.where(np.arange(len(ball.faces))[:, None] % 7 == 0, ball.faces[:, ::-1], ball.faces)
    twisted = Triangles(ball.points, faces)
    assert decimated(twisted, 1e-2).surface is twisted
