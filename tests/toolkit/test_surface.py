"""What is asked of triangles before they are repaired: equal rows, their edges, caps of loops."""

import numpy as np
import pytest
import trimesh
from autophyx_tet.toolkit.asset.repair import cycle, least_area_cap
from autophyx_tet.toolkit.asset.surface import Surface, equal_rows, face_edges, touching_places
from autophyx_tet.toolkit.asset.triangles import edge_components


@pytest.mark.parametrize("largest", [5, 10**6, 2**61])
def test_equal_rows_are_those_of_numpy(largest):
    """Small numbers, and such that four of them are more than one number holds."""
    some = np.random.default_rng(0).integers(-largest, largest, 3)
    rows = np.random.default_rng(1).choice(some, (200, 4))
    first, group, count = equal_rows(rows)
    unique, index, inverse, times = np.unique(
        rows, axis=0, return_index=True, return_inverse=True, return_counts=True
    )
    assert np.array_equal(rows[first], unique)
    assert np.array_equal(first, index)
    assert np.array_equal(group, inverse.reshape(-1))
    assert np.array_equal(count, times)
    assert len(equal_rows(rows[:0]).first) == 0


def test_edges_of_a_tetrahedron():
    """Four faces, six edges, each on two of them and run once in both directions."""
    edges = face_edges(np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]))
    assert edges.count.tolist() == [2] * 6
    way = np.where(edges.directed[:, 0] < edges.directed[:, 1], 1, -1)
    assert not np.bincount(edges.edge, weights=way).any()


def test_a_cap_is_the_smallest():
    """A rim that follows three sides of a unit square tube: two ends and the lid, not a fan."""
    rim = [[0, 0, 1], [0, 0, 0], [0, 1, 0], [0, 1, 1], [4, 1, 1], [4, 1, 0], [4, 0, 0], [4, 0, 1]]
    cap = least_area_cap(np.array(rim, float))
    assert len(cap.faces) == len(rim) - 2
    assert cap.area == pytest.approx(1 + 1 + 4)


def test_a_cap_turns_with_its_loop():
    """A bent loop that is moved, turned and scaled has the same triangles."""
    turns = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    loop = np.stack([np.cos(turns), np.sin(turns), 0.5 * np.cos(2 * turns)], axis=1)
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    a, b = least_area_cap(loop), least_area_cap(3 * loop @ turn.T + 1)
    assert a.area == pytest.approx(b.area / 9)
    assert np.isclose(a.area, least_area_cap(np.roll(loop, 5, axis=0)).area)


def test_only_one_cycle_is_a_loop():
    ring = np.array([[0, 1], [1, 2], [2, 0]])
    assert cycle(ring).tolist() == [0, 1, 2]
    assert cycle(np.concatenate([ring, ring + 3])) is None
    assert cycle(np.concatenate([ring, [[0, 3], [3, 4], [4, 0]]])) is None
    assert cycle(np.array([[0, 1], [1, 2], [2, 3]])) is None


def test_places_of_contact_lie_where_bodies_touch():
    """Two boxes edge on edge, a third one apart: along that edge, none farther than the spacing."""
    boxes = [trimesh.creation.box((1, 1, 1)).apply_translation(at) for at in ((0, 0, 0), (1, 1, 0))]
    boxes.append(trimesh.creation.box((1, 1, 1)).apply_translation((0, 0, 1.2)))
    body = trimesh.util.concatenate(boxes)
    faces = np.asarray(body.faces)
    part = np.zeros(len(faces), dtype=np.int64)
    surface = Surface(np.asarray(body.vertices), faces, part, edge_components(faces))
    found = touching_places(surface, touching=0.01, spacing=0.1)
    assert (found.bodies == (0, 1)).all()
    assert (np.abs(found.where[:, :2] - 0.5) <= 0.01).all()
    places = np.sort(found.where[:, 2])
    assert places[[0, -1]] == pytest.approx((-0.5, 0.5))
    assert np.diff(places).max() < 0.25
