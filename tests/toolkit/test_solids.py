"""What encloses a volume, and which part a point lies in."""

import numpy as np
import pytest
import trimesh
from autophyx_tet.predictors.asset import Part
from autophyx_tet.toolkit.asset.repair import repair
from autophyx_tet.toolkit.asset.solids import Solids, _asked
from hypothesis import given, settings
from hypothesis import strategies as st

from .bodies import cube_part, part_of


def test_sheets_are_not_closed():
    """A flat or gently curved sheet stays a sheet: no shell, named as such."""
    x, y = np.meshgrid(np.linspace(0, 1, 8), np.linspace(0, 1, 8))
    for height in (0 * x, 0.05 * np.sin(6 * x)):
        grid = np.stack([x, y, height], -1).reshape(-1, 3)
        i = (np.arange(7)[:, None] * 8 + np.arange(7)).reshape(-1)
        faces = np.concatenate([np.stack([i, i + 1, i + 8], 1), np.stack([i + 1, i + 9, i + 8], 1)])
        surface, report = repair([part_of(grid, faces)])
        assert report.closed_holes == 0
        solids = Solids.of(surface, 1, thinnest=1e-6)
        assert not solids.shells
        assert solids.sheets == (0,)


def test_open_pieces_enclose_only_with_others_that_do():
    """A lid on a tray with a wide brim: the tray is a sheet by its area, and so is the lid."""
    tray = trimesh.creation.box(bounds=[[-1, -1, -0.5], [1, 1, 0]])
    top = (tray.vertices[tray.faces][:, :, 2] == 0).all(axis=1)
    inner, outer = ([-1, -1], [1, -1], [1, 1], [-1, 1]), ([-3, -3], [3, -3], [3, 3], [-3, 3])
    brim = np.column_stack([np.array(inner + outer, float), np.zeros(8)])
    around = [[i, 4 + i, (i + 1) % 4] for i in range(4)]
    around += [[4 + i, 4 + (i + 1) % 4, (i + 1) % 4] for i in range(4)]
    points = np.concatenate([tray.vertices, brim])
    parts = [
        part_of(points, np.concatenate([tray.faces[~top], np.array(around) + 8]), "tray"),
        part_of(0.98 * tray.vertices, tray.faces[top], "lid"),
    ]
    assert Solids.of(repair(parts)[0], 2, thinnest=1e-6).sheets == (0, 1)


def test_skin_cut_up_by_material_is_one_solid():
    """The six sides of a cube as six parts: one closed shell, and every point goes to a side."""
    cube = cube_part().mesh
    sides = [part_of(cube.vertices, cube.faces[i : i + 2], f"side {i}") for i in range(0, 12, 2)]
    surface, report = repair(sides)
    assert report.open_edges == 0
    solids = Solids.of(surface, 6, thinnest=1e-6)
    assert len(solids.shells) == 1
    where = np.array([[0.5, 0.5, 0.9], [0.5, 0.5, 0.1], [2.0, 0.5, 0.5]])
    label = solids.label(where)
    assert label[2] == -1
    assert label[0] != label[1]


def test_nested_part_wins():
    """A small cube within a large one keeps its name, whichever comes first."""
    large, small = cube_part("large"), cube_part("small", (0.25,) * 3, 0.5)
    rng = np.random.default_rng(0)
    where = rng.random((2000, 3))
    inside = (np.abs(where - 0.5) < 0.25).all(axis=1)
    for parts, name in (((large, small), 1), ((small, large), 0)):
        label = Solids.of(repair(parts)[0], 2, thinnest=1e-6).label(where)
        assert ((label == name) == inside).all()
        assert (label >= 0).all()


def test_sides_with_cracks_enclose_together_and_foliage_does_not():
    """Six quads that miss each other by 0.1 % are a cube; random triangles are sheets."""
    cube = cube_part().mesh
    sides = [
        trimesh.Trimesh(cube.vertices[cube.faces[i : i + 2]].reshape(-1, 3), [[0, 1, 2], [3, 4, 5]])
        for i in range(0, 12, 2)
    ]
    for side in sides:
        side.vertices = side.centroid + 0.999 * (side.vertices - side.centroid)
    joined = trimesh.util.concatenate(sides)
    solids = Solids.of(repair([Part("cube", joined)])[0], 1, thinnest=1e-6)
    where = np.array([[0.5, 0.5, 0.5], [0.5, 0.5, 1.5]])
    assert solids.label(where).tolist() == [0, -1]
    rng = np.random.default_rng(0)
    leaves = rng.random((300, 1, 3)) + 0.1 * rng.normal(size=(300, 3, 3))
    foliage = part_of(leaves.reshape(-1, 3), np.arange(900).reshape(-1, 3))
    assert not Solids.of(repair([foliage])[0], 1, thinnest=1e-6).shells


@pytest.mark.slow
@given(st.integers(0, 2**31), st.booleans())
@settings(max_examples=20)
def test_the_part_of_a_point_does_not_depend_on_the_others(seed, inner_first):
    """Nested and overlapping cubes: every point has alone the label that it has among many."""
    rng = np.random.default_rng(seed)
    parts = [
        cube_part("large"),
        cube_part("small", rng.uniform(0.1, 0.6, 3), rng.uniform(0.2, 0.6)),
    ]
    solids = Solids.of(repair(parts[::-1] if inner_first else parts)[0], 2, thinnest=1e-6)
    where = rng.uniform(-0.1, 1.3, (60, 3))
    together = solids.label(where)
    assert (solids.label(where[:7]) == together[:7]).all()
    assert [solids.label(point[None])[0] for point in where] == together.tolist()


def test_of_many_components_few_faces_are_asked():
    """64 of each of a hundred balls; of ten thousand boxes two, which stand for all of the area."""
    for bodies, faces, each in ((100, 320, 64), (10_000, 12, 2)):
        component = np.repeat(np.arange(bodies), faces)
        area = np.random.default_rng(0).uniform(0.9, 1.1, len(component))
        asked, weight = _asked(component, area)
        assert np.bincount(component[asked]).tolist() == [each] * bodies
        assert weight.sum() == pytest.approx(area.sum())
