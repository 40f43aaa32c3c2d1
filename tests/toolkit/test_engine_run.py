"""Which tets of the engine belong to a solid: laws that need no engine."""

import numpy as np
import pytest
import trimesh
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.predictors.asset import Part
from autophyx_tet.toolkit.asset.repair import repair
from autophyx_tet.toolkit.asset.solids import Solids
from autophyx_tet.toolkit.meshing.ftetwild import by_cells, conforming


def cube_in_a_grid():
    """A grid of 6, the solid of a cube of 2 in its middle, and the right label of every tet."""
    grid = box_mesh((6.0, 6.0, 6.0), (6, 6, 6))
    cube = trimesh.creation.box((2, 2, 2))
    cube.apply_translation((3, 3, 3))
    surface, _ = repair([Part("cube", cube)])
    solids = Solids.of(surface, 1, thinnest=1e-3)
    centres = grid.points[grid.tets].mean(axis=1)
    right = np.where((np.abs(centres - 3) < 1).all(axis=1), 0, -1)
    return grid, solids, right


@pytest.mark.parametrize("seed", range(3))
def test_wrong_labels_away_from_the_surface_are_mended(seed):
    """A cube of 2 in a grid of 6: wrong tets, which show boundary off its surface, are righted."""
    grid, solids, right = cube_in_a_grid()
    rng = np.random.default_rng(seed)
    off = np.abs(grid.points - 3).max(axis=1) != 1  # corners that are not on the cube
    wrong = rng.choice(np.flatnonzero(off[grid.tets].any(axis=1)), size=10, replace=False)
    given = right.copy()
    given[wrong] = -1 - given[wrong]
    assert (conforming(grid.points, grid.tets, given, solids, 0.1) == right).all()
    assert (conforming(grid.points, grid.tets, right, solids, 0.1) == right).all()


def test_cells_between_walls_have_one_label():
    """A cube of 2 in a grid of 6, a third of the labels wrong: the majority within it, and out."""
    grid, solids, right = cube_in_a_grid()
    wrong = np.random.default_rng(0).random(len(right)) < 0.33
    given = np.where(wrong, -1 - right, right)
    assert (by_cells(grid.points, grid.tets, given, solids, 0.1) == right).all()
