"""Laws of filling: exact on analytic solids, both conditions, nearest features, winding number."""

import igl
import numpy as np
import pytest
import trimesh
from autophyx_tet.fem.errors import InputError
from autophyx_tet.predictors.appearance.features import fill, nearest_known
from autophyx_tet.predictors.appearance.surface import surface_voxels
from autophyx_tet.predictors.asset import Asset, Part
from autophyx_tet.predictors.grid import Grid
from scipy.ndimage import binary_dilation

GRID = Grid.around(np.array([[-1.0] * 3, [1.0] * 3]), cells=48)
X, Y, Z = np.moveaxis(GRID.centers(), -1, 0)
RADIUS = np.sqrt(X**2 + Y**2 + Z**2)
BOX = np.maximum(np.maximum(np.abs(X), np.abs(Y)), np.abs(Z))
# Signed distances, or what is negative inside and steep at the border, in metres.
SOLIDS = {
    "ball": RADIUS - 0.9,
    "torus": np.hypot(np.hypot(X, Y) - 0.6, Z) - 0.3,
    "nested spheres": np.maximum(RADIUS - 0.9, 0.45 - RADIUS),
    "bowl": np.maximum(np.maximum(RADIUS - 0.9, 0.6 - RADIUS), Z),
    "open box": np.maximum(
        BOX - 0.9, -np.maximum(np.maximum(np.abs(X), np.abs(Y)) - 0.5, -0.5 - Z)
    ),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_exact_on_analytic_solids(name):
    """Away from one voxel of the surface the filled cells are those of the inside function."""
    distance = SOLIDS[name]
    surface = np.abs(distance) < 0.9 * GRID.h  # a closed shell one to two cells thick
    filled = fill(surface)
    clear = ~binary_dilation(surface, np.ones((3, 3, 3)))
    assert (filled == (distance < 0))[clear].all()
    assert filled[surface].all()


def test_what_a_shell_without_its_cap_holds_is_outside():
    """Condition 1: nothing encloses it from above."""
    shell = np.abs(SOLIDS["ball"]) < 0.9 * GRID.h
    filled = fill(shell & ~(Z > 0.6))
    assert not filled[GRID.shape[0] // 2, GRID.shape[1] // 2, GRID.shape[2] // 2]
    assert not filled[RADIUS > 1].any()


def test_invariant_under_axes():
    """Swapping and mirroring axes swaps and mirrors the result."""
    surface = np.abs(SOLIDS["bowl"]) < 0.9 * GRID.h
    turned = fill(surface.transpose(2, 0, 1)[:, ::-1])
    assert (turned == fill(surface).transpose(2, 0, 1)[:, ::-1]).all()


def test_nearest_known_is_the_nearest():
    """Brute force over all pairs gives the same distances; known cells map to themselves."""
    rng = np.random.default_rng(0)
    cells = np.argwhere(rng.random((9, 8, 7)) < 0.6)
    known = rng.random(len(cells)) < 0.2
    row = nearest_known(cells, known)
    best = np.linalg.norm(cells[:, None] - cells[known], axis=2).min(axis=1)
    assert np.allclose(np.linalg.norm(cells[row] - cells, axis=1), best)
    assert known[row].all()
    assert (row[known] == np.flatnonzero(known)).all()
    with pytest.raises(InputError, match="known"):
        nearest_known(cells, np.zeros_like(known))


def test_nearest_known_stays_in_its_part():
    """A cell takes after the nearest known cell of its own part; a part never seen, after any."""
    cells = np.stack([np.arange(6), np.zeros(6, int), np.zeros(6, int)], axis=1)
    label = np.array([0, 1, 0, 1, 1, 2])
    known = np.array([True, False, False, True, False, False])
    assert nearest_known(cells, known, label=label).tolist() == [0, 3, 0, 3, 3, 3]


@pytest.mark.slow
@pytest.mark.parametrize(
    "mesh",
    [
        trimesh.creation.icosphere(subdivisions=4),
        trimesh.creation.torus(0.7, 0.25),
        trimesh.creation.annulus(0.3, 0.9, 1.0),
        trimesh.creation.capsule(1.0, 0.4),
    ],
    ids=["ball", "torus", "annulus", "capsule"],
)
def test_agrees_with_the_winding_number(mesh):
    """On watertight meshes the filled empty cells are those of winding number one, exactly."""
    grid = Grid.around(mesh.bounds, cells=40)
    surface = surface_voxels(Asset("a", (Part("a", mesh),)), grid).occupied
    points, faces = np.ascontiguousarray(mesh.vertices), np.ascontiguousarray(mesh.faces)
    empty = grid.centers()[~surface]
    winding = np.asarray(igl.fast_winding_number(points, faces, empty)).ravel()
    np.testing.assert_array_equal(fill(surface)[~surface], winding > 0.5)


def test_surface_voxels_are_those_the_triangles_touch():
    """A cell is marked where a triangle passes within it: no gap between inside and outside."""
    mesh = trimesh.creation.icosphere(subdivisions=2, radius=0.9)
    voxels = surface_voxels(Asset("a", (Part("a", mesh, ("skin", "red")),)), GRID)
    assert voxels.labels == (("skin", "red"),)
    centers = GRID.centers().reshape(-1, 3)
    squared, *_ = igl.point_mesh_squared_distance(centers, mesh.vertices, mesh.faces)
    distance = np.sqrt(squared).reshape(GRID.shape)
    assert distance[voxels.occupied].max() <= GRID.h * np.sqrt(3) / 2
    assert voxels.occupied[distance < 0.4 * GRID.h].all()
