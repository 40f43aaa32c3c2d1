"""Repair undoes known damage exactly, counts it, and leaves clean surfaces alone."""

import numpy as np
import pytest
import trimesh
from autophyx_tet.predictors.asset import Part
from autophyx_tet.toolkit.asset import repair as repair_module
from autophyx_tet.toolkit.asset.repair import WELD_REL, RepairReport, near_pairs, repair
from autophyx_tet.toolkit.asset.solids import Solids
from autophyx_tet.toolkit.asset.surface import (
    Surface,
    component_volumes,
    open_components,
    unbalanced_edges,
)
from autophyx_tet.toolkit.asset.triangles import winding_numbers
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import KDTree

from .bodies import cube_part, part_of


def _volume(surface):
    return component_volumes(surface).sum()


@given(st.integers(0, 2**31), st.floats(1e-3, 1e3), st.floats(-1e3, 1e3))
@settings(max_examples=25)
def test_damaged_cube_is_restored(seed, size, place):
    """Torn vertices, random windings, repeated and null faces: volume a^3, closed, all counted."""
    rng = np.random.default_rng(seed)
    cube = cube_part(size=size, lo=(place,) * 3).mesh
    points = cube.vertices[cube.faces].reshape(-1, 3)
    faces = np.arange(36).reshape(-1, 3)
    turned = rng.random(12) < 0.5
    faces[turned] = faces[turned][:, ::-1]
    damaged = np.concatenate([faces, faces[:3], [[0, 0, 1]]])
    surface, report = repair([part_of(points, rng.permutation(damaged))])
    assert _volume(surface) == pytest.approx(size**3, rel=1e-6)
    assert not open_components(surface).any()
    assert (report.merged_vertices, report.null_faces) == (28, 1)
    assert report.duplicate_faces == 3
    assert report.flipped_faces in (turned.sum(), 12 - turned.sum())


def test_clean_surface_is_left_alone():
    surface, report = repair([cube_part()])
    assert report == RepairReport()
    assert len(surface.faces) == 12


def test_crossing_faces_are_counted_and_left():
    """A small box through one triangle of a large one: its four walls cross it, none is changed.

    Each wall is two triangles; the half of the lid's triangle that is hit meets all eight.
    """
    lid = cube_part()
    post = trimesh.creation.box((0.05, 0.05, 1), transform=np.eye(4))
    post.apply_translation((0.25, 0.6, 1))
    surface, report = repair([lid, part_of(post.vertices, post.faces, "post")])
    assert report.crossing_faces == 8
    assert len(surface.faces) == 24


def test_apart_nothing_crosses():
    for axis in np.eye(3):
        _, report = repair([cube_part("a"), cube_part("b", lo=2 * axis)])
        assert report.crossing_faces == 0, axis


def test_holes_are_closed():
    """A cube without one triangle, and one without its lid, enclose the cube again."""
    for missing, loops in ((1, 1), (2, 1)):
        cube = cube_part().mesh
        lid = np.flatnonzero((cube.vertices[cube.faces][:, :, 2] == 1).all(axis=1))
        faces = np.delete(cube.faces, lid[:missing], axis=0)
        surface, report = repair([part_of(cube.vertices, faces)])
        assert _volume(surface) == pytest.approx(1)
        assert report.closed_holes == loops
        assert report.open_edges == 0


def test_surface_exported_with_back_faces_keeps_one_side():
    cube = cube_part().mesh
    faces = np.concatenate([cube.faces, cube.faces[:, ::-1]])
    surface, report = repair([part_of(cube.vertices, faces)])
    assert report.duplicate_faces == 12
    assert _volume(surface) == pytest.approx(1)


def test_touching_cubes_of_one_part_are_one_solid():
    """Two cubes welded face to face: both sides of the wall go, counted, the volume is 2."""
    a, b = cube_part().mesh, cube_part(lo=(1, 0, 0)).mesh
    points = np.concatenate([a.vertices, b.vertices])
    faces = np.concatenate([a.faces, b.faces + 8])
    surface, report = repair([part_of(points, faces)])
    assert (report.duplicate_faces, report.loose_faces, report.non_manifold_edges) == (0, 4, 0)
    assert _volume(surface) == pytest.approx(2)


@pytest.mark.parametrize("seed", range(5))
def test_vertices_nearer_than_the_tolerance_are_one(seed):
    """Torn and shaken by less than half the tolerance, a box has 8 vertices wherever they lie."""
    rng = np.random.default_rng(seed)
    box = trimesh.creation.box(rng.random(3) + 0.5)
    points = box.vertices[box.faces].reshape(-1, 3)
    points = points + rng.uniform(-0.25, 0.25, points.shape) * WELD_REL * box.scale
    surface, report = repair([part_of(points, np.arange(36).reshape(-1, 3))])
    assert report.merged_vertices == 28
    assert not open_components(surface).any()


def test_sheet_doubled_in_places_keeps_one_side():
    """A sheet of 10 x 10 squares, a patch of it with back faces: those go, and it stays a sheet."""
    x, y = np.meshgrid(np.arange(11.0), np.arange(11.0), indexing="ij")
    corner = (11 * np.arange(10)[:, None] + np.arange(10)).reshape(-1)
    quads = corner[:, None] + np.array([0, 11, 12, 1])
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    points = np.column_stack([x.reshape(-1), y.reshape(-1), np.sin(x + y).reshape(-1)])
    middle = points[faces].mean(axis=1)
    doubled = (np.abs(middle[:, :2] - 5) < 2).all(axis=1)
    part = part_of(points, np.concatenate([faces, faces[doubled][:, ::-1]]))
    surface, report = repair([part])
    assert (report.duplicate_faces, report.loose_faces) == (doubled.sum(), 0)
    assert (len(surface.faces), report.non_manifold_edges) == (200, 0)
    assert Solids.of(surface, 1, thinnest=1e-6).sheets == (0,)


def test_inner_and_outer_side_of_one_sheet_as_two_parts_are_one_solid():
    """A pipe without lids, once in each of two materials and the other way round: one cylinder."""
    pipe = trimesh.creation.cylinder(1, 2, sections=32)
    side = pipe.faces[np.abs(pipe.face_normals[:, 2]) < 0.5]
    outer, inner = part_of(pipe.vertices, side, "out"), part_of(pipe.vertices, side[:, ::-1], "in")
    surface, report = repair([outer, inner])
    assert report.duplicate_faces == len(side)
    assert _volume(surface) == pytest.approx(pipe.volume)


@pytest.mark.parametrize("seed", range(3))
def test_of_three_walls_that_meet_in_an_edge_the_inner_one_is_loose(seed):
    """A block of 3 with a pit of 1 x 1 x 2 under a pane in its lid, wound at random: volume 27."""
    pit = trimesh.creation.box(bounds=[[1, 1, 1], [2, 2, 3]])
    pane = (pit.vertices[pit.faces][:, :, 2] == 3).all(axis=1)
    block = trimesh.creation.box(bounds=[[0, 0, 0], [3, 3, 3]])
    lid = (block.vertices[block.faces][:, :, 2] == 3).all(axis=1)
    rim, hole = ([0, 0], [3, 0], [3, 3], [0, 3]), ([1, 1], [2, 1], [2, 2], [1, 2])
    around = np.array([[i, (i + 1) % 4, 4 + i] for i in range(4)])
    around = np.concatenate([around, [[(i + 1) % 4, 4 + (i + 1) % 4, 4 + i] for i in range(4)]])
    frame = np.column_stack([np.array(rim + hole, float), np.full(8, 3.0)])
    points = np.concatenate([block.vertices, pit.vertices, frame])
    faces = np.concatenate([block.faces[~lid], pit.faces + 8, around + 16])
    rng = np.random.default_rng(seed)
    turned = rng.random(len(faces)) < 0.5
    faces[turned] = faces[turned][:, ::-1]
    surface, report = repair([part_of(points, rng.permutation(faces))])
    assert report.loose_faces == (~pane).sum()
    assert (report.open_edges, report.non_manifold_edges) == (0, 0)
    assert _volume(surface) == pytest.approx(27)


def test_holes_of_two_pieces_that_touch_are_closed_one_by_one():
    """Two cubes, one without lid, one without floor, share a corner there: both are closed."""
    cubes = [cube_part().mesh, cube_part(lo=(1, 1, 1)).mesh]
    sides = [c.faces[~(c.vertices[c.faces][:, :, 2] == 1).all(axis=1)] for c in cubes]
    points = np.concatenate([c.vertices for c in cubes])
    surface, report = repair([part_of(points, np.concatenate([sides[0], sides[1] + 8]))])
    assert report.closed_holes == 2
    assert _volume(surface) == pytest.approx(2)


def test_the_rim_of_a_tub_that_hangs_on_a_ring_is_unbalanced():
    """A pool below its border: the rim lies on an edge of the ring, so that no edge is open.

    A fan over the unbalanced edges makes every winding number whole, and volumes add up.
    """
    ring = trimesh.creation.annulus(r_min=1, r_max=2, height=0.5, sections=32)
    ring.apply_translation((0, 0, 0.25))
    tub = trimesh.creation.cylinder(radius=1, height=2, sections=32)
    tub.apply_translation((0, 0, -1))
    volume = ring.volume + tub.volume
    tub.update_faces(tub.triangles_center[:, 2] < -1e-9)
    hung = trimesh.util.concatenate([ring, tub])
    hung.merge_vertices()
    none = np.zeros(len(hung.faces), np.int64)
    surface = Surface(np.asarray(hung.vertices), np.asarray(hung.faces, np.int64), none, none)
    assert not open_components(surface).any()
    edges, _ = unbalanced_edges(surface)
    assert len(edges) == 32
    assert np.array_equal(np.sort(edges[:, 0]), np.sort(edges[:, 1]))
    fan = np.column_stack([edges[:, ::-1], np.full(32, len(surface.points))])
    points = np.concatenate([surface.points, [[0, 0, 0]]])
    closed = trimesh.Trimesh(points, np.concatenate([surface.faces, fan]), process=False)
    where = np.random.default_rng(0).uniform((-2, -2, -2), (2, 2, 0.5), (2000, 3))
    winding = winding_numbers(points, closed.faces, where)
    assert np.abs(winding - winding.round()).max() < 0.05  # the fast sum is good to 1e-2
    assert closed.volume == pytest.approx(volume)


def test_a_bent_sheet_is_not_closed():
    """A U of three squares: caps of its rim would be as large as itself, so it is a sheet."""
    cube = cube_part().mesh
    corners = cube.vertices[cube.faces]
    kept = (np.ptp(corners[:, :, 0], axis=1) > 0) & ~(corners[:, :, 2] == 1).all(axis=1)
    surface, report = repair([part_of(cube.vertices, cube.faces[kept])])
    assert (len(surface.faces), report.closed_holes) == (6, 0)
    assert Solids.of(surface, 1, thinnest=1e-6).sheets == (0,)


def test_cavity_stays_a_cavity_and_a_stray_shell_is_turned():
    """A ball with an inward inner shell is hollow; inside out it is the same body."""
    outer, inner = trimesh.creation.icosphere(2), trimesh.creation.icosphere(2, radius=0.5)
    hollow = outer.volume - inner.volume
    points = np.concatenate([outer.vertices, inner.vertices])
    faces = np.concatenate([outer.faces, inner.faces[:, ::-1] + len(outer.vertices)])
    for winding in (faces, faces[:, ::-1]):
        surface, _ = repair([part_of(points, winding)])
        assert _volume(surface) == pytest.approx(hollow)
    apart = np.concatenate([outer.vertices, inner.vertices + 5])
    surface, _ = repair([part_of(apart, faces)])
    assert _volume(surface) == pytest.approx(outer.volume + inner.volume)


def test_cubes_that_share_edges_are_turned_outward():
    """A checkerboard of cubes, welded at their edges and wound at random: volume of the cubes."""
    rng = np.random.default_rng(1)
    corners = [(i, j, k) for i in range(3) for j in range(3) for k in range(3) if (i + j + k) % 2]
    cubes = [cube_part(lo=corner).mesh for corner in corners]
    points = np.concatenate([cube.vertices for cube in cubes])
    faces = np.concatenate([cube.faces + 8 * i for i, cube in enumerate(cubes)])
    turned = rng.random(len(faces)) < 0.5
    faces[turned] = faces[turned][:, ::-1]
    surface, report = repair([part_of(points, faces)])
    assert report.non_manifold_edges > 0
    assert _volume(surface) == pytest.approx(len(corners))


def test_fin_and_inner_wall_are_loose():
    """A cube cut in two by a wall, with a fin on one edge: both go, counted, the volume stays."""
    a, b = cube_part().mesh, cube_part(lo=(1, 0, 0)).mesh
    wall = (b.vertices[b.faces][:, :, 0] == 1).all(axis=1)
    fin = np.array([[0, 0, 0], [0, 1, 0], [-1, 0.5, -0.5]], float)
    points = np.concatenate([a.vertices, b.vertices, fin])
    faces = np.concatenate([a.faces, b.faces[~wall] + 8, [[16, 17, 18]]])
    surface, report = repair([part_of(points, faces)])
    assert report.loose_faces == 3
    assert _volume(surface) == pytest.approx(2)


def test_crossings_of_a_large_surface_are_not_counted(monkeypatch):
    """Two crossed boxes have crossings; above the bound there is None, which is not zero."""
    box = trimesh.creation.box((1, 1, 1))
    crossed = trimesh.util.concatenate([box, box.copy().apply_translation((0.3, 0.4, 0.5))])
    assert repair_module.repair([Part("boxes", crossed)])[1].crossing_faces > 0
    monkeypatch.setattr(repair_module, "MOST_CROSSED", 20)
    assert repair_module.repair([Part("boxes", crossed)])[1].crossing_faces is None


@given(st.integers(0, 2**31), st.floats(1e-3, 0.3))
@settings(max_examples=25)
def test_near_pairs_are_those_of_a_tree(seed, distance):
    """Points in a box, on a plane of it, and some of them twice."""
    points = np.random.default_rng(seed).random((60, 3))
    points[:20, 2] = 0.5
    points[50:] = points[:10]
    found = {frozenset(pair) for pair in near_pairs(points, distance).tolist()}
    assert found == {frozenset(pair) for pair in KDTree(points).query_pairs(distance)}
