"""Repair undoes known damage exactly, counts it, and leaves clean surfaces alone."""

import numpy as np
import pytest
import trimesh
from autophyx_tet.predictors.asset import Part
from autophyx_tet.toolkit import repair as repair_module
from autophyx_tet.toolkit.regions import Solids
from autophyx_tet.toolkit.repair import RepairReport, repair
from autophyx_tet.toolkit.surface import component_volumes, open_components
from hypothesis import given, settings
from hypothesis import strategies as st


def _part(points, faces, name="p"):
    return Part(name, trimesh.Trimesh(points, faces, process=False))


def _cube(name="p", lo=(0, 0, 0), size=1.0):
    box = trimesh.creation.box((size,) * 3)
    return _part(box.vertices + size / 2 + np.array(lo), box.faces, name)


def _volume(surface):
    return component_volumes(surface).sum()


@given(st.integers(0, 2**31), st.floats(1e-3, 1e3), st.floats(-1e3, 1e3))
@settings(max_examples=25)
def test_damaged_cube_is_restored(seed, size, place):
    """Torn vertices, random windings, repeated and null faces: volume a^3, closed, all counted."""
    rng = np.random.default_rng(seed)
    cube = _cube(size=size, lo=(place,) * 3).mesh
    points = cube.vertices[cube.faces].reshape(-1, 3)
    faces = np.arange(36).reshape(-1, 3)
    turned = rng.random(12) < 0.5
    faces[turned] = faces[turned][:, ::-1]
    damaged = np.concatenate([faces, faces[:3], [[0, 0, 1]]])
    surface, report = repair([_part(points, rng.permutation(damaged))])
    assert _volume(surface) == pytest.approx(size**3, rel=1e-6)
    assert not open_components(surface).any()
    assert (report.merged_vertices, report.null_faces) == (28, 1)
    assert report.duplicate_faces == 3
    assert report.flipped_faces in (turned.sum(), 12 - turned.sum())


def test_clean_surface_is_left_alone():
    surface, report = repair([_cube()])
    assert report == RepairReport()
    assert len(surface.faces) == 12


def test_crossing_faces_are_counted_and_left():
    """A small box through one triangle of a large one: its four walls cross it, none is changed.

    Each wall is two triangles; the half of the lid's triangle that is hit meets all eight.
    """
    lid = _cube()
    post = trimesh.creation.box((0.05, 0.05, 1), transform=np.eye(4))
    post.apply_translation((0.25, 0.6, 1))
    surface, report = repair([lid, _part(post.vertices, post.faces, "post")])
    assert report.crossing_faces == 8
    assert len(surface.faces) == 24


@pytest.mark.parametrize("axis", range(3))
def test_apart_nothing_crosses(axis):
    _, report = repair([_cube("a"), _cube("b", lo=2 * np.eye(3)[axis])])
    assert report.crossing_faces == 0


def test_holes_are_closed():
    """A cube without one triangle, and one without its lid, enclose the cube again."""
    for missing, loops in ((1, 1), (2, 1)):
        cube = _cube().mesh
        lid = np.flatnonzero((cube.vertices[cube.faces][:, :, 2] == 1).all(axis=1))
        faces = np.delete(cube.faces, lid[:missing], axis=0)
        surface, report = repair([_part(cube.vertices, faces)])
        assert _volume(surface) == pytest.approx(1)
        assert report.closed_holes == loops
        assert report.open_edges == 0


def test_sheets_are_not_closed():
    """A flat or gently curved sheet stays a sheet: no shell, named as such."""
    x, y = np.meshgrid(np.linspace(0, 1, 8), np.linspace(0, 1, 8))
    for height in (0 * x, 0.05 * np.sin(6 * x)):
        grid = np.stack([x, y, height], -1).reshape(-1, 3)
        i = (np.arange(7)[:, None] * 8 + np.arange(7)).reshape(-1)
        faces = np.concatenate([np.stack([i, i + 1, i + 8], 1), np.stack([i + 1, i + 9, i + 8], 1)])
        surface, report = repair([_part(grid, faces)])
        assert report.closed_holes == 0
        solids = Solids.of(surface, 1, thinnest=1e-6)
        assert not solids.shells
        assert solids.sheets == (0,)


def test_surface_exported_with_back_faces_keeps_one_side():
    cube = _cube().mesh
    faces = np.concatenate([cube.faces, cube.faces[:, ::-1]])
    surface, report = repair([_part(cube.vertices, faces)])
    assert report.duplicate_faces == 12
    assert _volume(surface) == pytest.approx(1)


def test_common_wall_of_touching_cubes_stays():
    """Two cubes welded face to face: both sides of the wall stay, the volume is 2."""
    a, b = _cube().mesh, _cube(lo=(1, 0, 0)).mesh
    points = np.concatenate([a.vertices, b.vertices])
    faces = np.concatenate([a.faces, b.faces + 8])
    surface, report = repair([_part(points, faces)])
    assert report.duplicate_faces == 0
    assert _volume(surface) == pytest.approx(2)


def test_cavity_stays_a_cavity_and_a_stray_shell_is_turned():
    """A ball with an inward inner shell is hollow; inside out it is the same body."""
    outer, inner = trimesh.creation.icosphere(2), trimesh.creation.icosphere(2, radius=0.5)
    hollow = outer.volume - inner.volume
    points = np.concatenate([outer.vertices, inner.vertices])
    faces = np.concatenate([outer.faces, inner.faces[:, ::-1] + len(outer.vertices)])
    for winding in (faces, faces[:, ::-1]):
        surface, _ = repair([_part(points, winding)])
        assert _volume(surface) == pytest.approx(hollow)
    apart = np.concatenate([outer.vertices, inner.vertices + 5])
    surface, _ = repair([_part(apart, faces)])
    assert _volume(surface) == pytest.approx(outer.volume + inner.volume)


def test_skin_cut_up_by_material_is_one_solid():
    """The six sides of a cube as six parts: one closed shell, and every point goes to a side."""
    cube = _cube().mesh
    sides = [_part(cube.vertices, cube.faces[i : i + 2], f"side {i}") for i in range(0, 12, 2)]
    surface, report = repair(sides)
    assert report.open_edges == 0
    solids = Solids.of(surface, 6, thinnest=1e-6)
    assert len(solids.shells) == 1
    where = np.array([[0.5, 0.5, 0.9], [0.5, 0.5, 0.1], [2.0, 0.5, 0.5]])
    label = solids.label(where, np.ones(3))
    assert label[2] == -1
    assert label[0] != label[1]


def test_nested_part_wins():
    """A small cube within a large one keeps its name, whichever comes first."""
    large, small = _cube("large"), _cube("small", (0.25,) * 3, 0.5)
    rng = np.random.default_rng(0)
    where = rng.random((2000, 3))
    inside = (np.abs(where - 0.5) < 0.25).all(axis=1)
    for parts, name in (((large, small), 1), ((small, large), 0)):
        label = Solids.of(repair(parts)[0], 2, thinnest=1e-6).label(where, np.ones(2000))
        assert ((label == name) == inside).all()
        assert (label >= 0).all()


def test_cubes_that_share_edges_are_turned_outward():
    """A checkerboard of cubes, welded at their edges and wound at random: volume of the cubes."""
    rng = np.random.default_rng(1)
    corners = [(i, j, k) for i in range(3) for j in range(3) for k in range(3) if (i + j + k) % 2]
    cubes = [_cube(lo=corner).mesh for corner in corners]
    points = np.concatenate([cube.vertices for cube in cubes])
    faces = np.concatenate([cube.faces + 8 * i for i, cube in enumerate(cubes)])
    turned = rng.random(len(faces)) < 0.5
    faces[turned] = faces[turned][:, ::-1]
    surface, report = repair([_part(points, faces)])
    assert report.non_manifold_edges > 0
    assert _volume(surface) == pytest.approx(len(corners))


def test_fin_and_inner_wall_are_loose():
    """A cube cut in two by a wall, with a fin on one edge: both go, counted, the volume stays."""
    a, b = _cube().mesh, _cube(lo=(1, 0, 0)).mesh
    wall = (b.vertices[b.faces][:, :, 0] == 1).all(axis=1)
    fin = np.array([[0, 0, 0], [0, 1, 0], [-1, 0.5, -0.5]], float)
    points = np.concatenate([a.vertices, b.vertices, fin])
    faces = np.concatenate([a.faces, b.faces[~wall] + 8, [[16, 17, 18]]])
    surface, report = repair([_part(points, faces)])
    assert report.loose_faces == 3
    assert _volume(surface) == pytest.approx(2)


def test_sides_with_cracks_enclose_together_and_foliage_does_not():
    """Six quads that miss each other by 0.1 % are a cube; random triangles are sheets."""
    cube = _cube().mesh
    sides = [
        trimesh.Trimesh(cube.vertices[cube.faces[i : i + 2]].reshape(-1, 3), [[0, 1, 2], [3, 4, 5]])
        for i in range(0, 12, 2)
    ]
    for side in sides:
        side.vertices = side.centroid + 0.999 * (side.vertices - side.centroid)
    joined = trimesh.util.concatenate(sides)
    solids = Solids.of(repair([Part("cube", joined)])[0], 1, thinnest=1e-6)
    where = np.array([[0.5, 0.5, 0.5], [0.5, 0.5, 1.5]])
    assert solids.label(where, np.ones(2)).tolist() == [0, -1]
    rng = np.random.default_rng(0)
    leaves = rng.random((300, 1, 3)) + 0.1 * rng.normal(size=(300, 3, 3))
    foliage = _part(leaves.reshape(-1, 3), np.arange(900).reshape(-1, 3))
    assert not Solids.of(repair([foliage])[0], 1, thinnest=1e-6).shells


def test_crossings_of_a_large_surface_are_not_counted(monkeypatch):
    """Two crossed boxes have crossings; above the bound there is None, which is not zero."""
    box = trimesh.creation.box((1, 1, 1))
    crossed = trimesh.util.concatenate([box, box.copy().apply_translation((0.3, 0.4, 0.5))])
    assert repair_module.repair([Part("boxes", crossed)])[1].crossing_faces > 0
    monkeypatch.setattr(repair_module, "MOST_CROSSED", 20)
    assert repair_module.repair([Part("boxes", crossed)])[1].crossing_faces is None
