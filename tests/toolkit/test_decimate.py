"""Decimation: fewer triangles of the same surface, within a distance, with walls left alone."""

import numpy as np
import pytest
import trimesh
from autophyx_tet.toolkit.decimate import decimated
from autophyx_tet.toolkit.triangles import Triangles, closest


def _triangles(mesh):
    return Triangles(np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64))


def _volume(surface):
    return trimesh.Trimesh(*surface, process=False).volume


@pytest.mark.parametrize("tolerance", [1e-3, 1e-2])
def test_a_ball_stays_within_its_tolerance(tolerance):
    """Both ways; the volume changes by at most area times tolerance."""
    ball = _triangles(trimesh.creation.icosphere(5))
    coarse = decimated(ball, tolerance).surface
    assert len(coarse.faces) < len(ball.faces) / 2
    for start, end in ((ball, coarse), (coarse, ball)):
        assert closest(start.points, *end).distance.max() <= tolerance
    assert _volume(coarse) == pytest.approx(_volume(ball), abs=4 * np.pi * tolerance)


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
    same, left_alone = decimated(both, 1e-2)
    assert same.faces is both.faces
    assert left_alone == len(both.faces)
    other.apply_translation((1, 0, 0))
    apart = _triangles(trimesh.util.concatenate([box, other]))
    fewer, left_alone = decimated(apart, 1e-2)
    assert len(fewer.faces) < len(apart.faces)
    assert left_alone == 0


def test_small_components_are_left_alone():
    """A crumb of 12 triangles beside a fine ball keeps every one of them, and its volume."""
    ball, crumb = trimesh.creation.icosphere(5), trimesh.creation.box((0.01,) * 3)
    crumb.apply_translation((2, 0, 0))
    coarse = decimated(_triangles(trimesh.util.concatenate([ball, crumb])), 5e-3).surface
    mine = (coarse.points[coarse.faces][:, :, 0] > 1.5).all(axis=1)
    assert mine.sum() == 12
