"""Laws of seeing a grid: Beer and Lambert's opacity, occlusion, the same silhouettes as a mesh."""

import numpy as np
import pytest
import trimesh
from autophyx_tet.predictors.appearance.features import features_of_views, render_grid
from autophyx_tet.predictors.appearance.surface import opaque_density
from autophyx_tet.predictors.appearance.views import look_at, render_views
from autophyx_tet.predictors.asset import Asset, Part
from autophyx_tet.predictors.grid import Grid

GRID = Grid(np.full(3, -1.0), 0.125, (16, 16, 16))
CAMERAS = [look_at(np.array(at), np.zeros(3), pixels=48) for at in ((5.0, 1, 2), (1.0, -5, 3))]


def test_opacity_of_haze_is_beer_and_lamberts():
    """Through the middle of uniform haze the opacity is 1 - exp(-density x thickness)."""
    density = np.full(GRID.shape, 0.4)
    colour = np.full((*GRID.shape, 3), 0.3)
    above = look_at(np.array([0, 0, 50.0]), np.zeros(3), pixels=33, field_of_view=0.05)
    views = render_grid(density, colour, GRID, [above])
    assert np.isclose(views.opacity[0, 16, 16], 1 - np.exp(-0.4 * 2), atol=1e-3)
    assert np.allclose(views.colour[0, 16, 16], 0.3, atol=1e-5)
    assert np.allclose(views.images()[0, 16, 16, :3], 0.5 + views.opacity[0, 16, 16] * (0.3 - 0.5))


def test_a_box_looks_like_its_mesh():
    """Silhouette and colour of a box of cells are those of the mesh of the same box."""
    inside = np.abs(GRID.centers()).max(axis=-1) < 0.5
    colour = np.zeros((*GRID.shape, 3))
    colour[..., 1] = 0.8
    views = render_grid(opaque_density(inside, GRID), colour, GRID, CAMERAS)
    mesh = trimesh.creation.box((1, 1, 1))
    mesh.visual.vertex_colors = [0, 204, 0, 255]
    expected = render_views(Asset("box", (Part("box", mesh),)), CAMERAS)
    assert np.abs(views.opacity - expected.opacity).mean() < 0.01
    both = (views.opacity > 0.5) & (expected.opacity > 0.5)
    assert np.allclose(views.colour[both], expected.colour[both], atol=0.02)


@pytest.mark.slow
def test_what_a_grid_shows_is_lifted_back():
    """Colours seen of a grid return to the cells they came from, and not to those behind."""
    centers = GRID.centers()
    inside = np.abs(centers).max(axis=-1) < 0.6
    colour = np.where(centers[..., :1] > 0, [1.0, 0, 0], [0, 0, 1.0])
    density = opaque_density(inside, GRID)
    found = features_of_views(render_grid(density, colour, GRID), density, GRID, encoder="rgb")
    right = GRID.to_world(found.cells)[:, 0] > 0
    assert (found.values[:, 0] > found.values[:, 2])[found.seen & right].mean() > 0.98
    assert (found.values[:, 2] > found.values[:, 0])[found.seen & ~right].mean() > 0.98
