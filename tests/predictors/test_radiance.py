"""Laws of the radiance field: photographs of a known solid give its shape and colours back."""

import json

import numpy as np
import pytest
import trimesh
from autophyx_tet.fem.errors import InputError
from autophyx_tet.predictors.appearance.features import features_of_views, fill
from autophyx_tet.predictors.appearance.radiance import (
    FitOptions,
    fit_radiance,
    focus,
    silhouette_bounds,
    silhouette_hull,
)
from autophyx_tet.predictors.appearance.views import (
    Views,
    hemisphere,
    load_photographs,
    render_views,
)
from autophyx_tet.predictors.asset import Asset, Part
from autophyx_tet.predictors.grid import Grid
from PIL import Image

QUICK = FitOptions(steps=60, rays=1024)
GRID = Grid.around(np.array([[-0.7, -0.7, -0.7], [0.7, 0.7, 1.3]]), cells=26)


pytestmark = pytest.mark.usefixtures("one_thread")


@pytest.fixture(scope="module")
def photographs():
    """Pictures, without depth or parts, of a red box with a green one on top."""
    low, high = trimesh.creation.box((1.0, 1, 1)), trimesh.creation.box((0.6, 0.6, 0.6))
    high.apply_translation([0, 0, 0.8])
    for mesh, colour in ((low, (255, 0, 0, 255)), (high, (0, 255, 0, 255))):
        mesh.visual.vertex_colors = colour
    asset = Asset("boxes", (Part("low", low), Part("high", high)), up="z")
    cameras = hemisphere(asset.bounds, count=12, lower=4, up="z", pixels=64)
    views = render_views(asset, cameras)
    return Views(views.cameras, colour=views.colour, opacity=views.opacity)


def depth_inside(points):
    """Distance to the surface of the boxes, along the axes; positive inside."""
    low = (0.5 - np.abs(points)).min(axis=-1)
    high = (0.3 - np.abs(points - [0, 0, 0.8])).min(axis=-1)
    return np.maximum(low, high)


@pytest.mark.slow
def test_photographs_give_the_solid_back(photographs):
    """Filled, the field is the solid farther than a cell from its surface, but for one in 100."""
    found = fit_radiance(photographs, GRID, options=QUICK)
    solid = fill(found.density > 0)
    depth = depth_inside(GRID.centers())
    away = np.abs(depth) > GRID.h
    assert (solid == (depth > 0))[away].mean() > 0.99
    assert found.error < 0.1
    full = found.density > 0
    above = GRID.centers()[..., 2] > 0.6
    assert np.allclose(found.colour[full & above].mean(axis=0), [0, 1, 0], atol=0.1)
    assert np.allclose(found.colour[full & ~above].mean(axis=0), [1, 0, 0], atol=0.1)


@pytest.mark.slow
def test_a_plain_background_does_without_alpha(photographs):
    """Photographs before one grey wall: the wall is no matter, the boxes are."""
    cover = photographs.opacity[..., None]
    colour = photographs.colour * cover + 0.4 * (1 - cover)
    opaque = np.ones_like(photographs.opacity)
    views = Views(photographs.cameras, colour.astype(np.float32), opaque)
    found = fit_radiance(views, GRID, options=QUICK)
    solid = fill(found.density > 0)
    depth = depth_inside(GRID.centers())
    assert solid[depth < -2 * GRID.h].mean() < 0.01
    assert solid[depth > GRID.h].mean() > 0.8  # the short fit leaves thin places


def test_hull_holds_the_object_and_bounds_hold_the_hull(photographs):
    """No silhouette removes a cell of the object; the box is at most half as long again."""
    hull = silhouette_hull(photographs, GRID)
    depth = depth_inside(GRID.centers())
    assert hull[depth > 0].all()
    assert not hull.all()
    low, high = silhouette_bounds(photographs)
    assert (low <= [-0.5, -0.5, -0.5]).all()
    assert (high >= [0.5, 0.5, 1.1]).all()
    assert (high - low).max() < 1.5 * 1.6


def test_focus_is_where_the_cameras_look(photographs):
    """Optical axes through one point meet in it."""
    assert np.allclose(focus(photographs.cameras), [0, 0, 0.3], atol=1e-6)


def test_silhouettes_without_a_common_point_are_told(photographs):
    """Empty pictures leave no room for an object."""
    nothing = np.zeros_like(photographs.opacity)
    with pytest.raises(InputError, match="nothing in common"):
        silhouette_bounds(Views(photographs.cameras, photographs.colour, nothing))


@pytest.mark.slow
def test_from_a_folder_of_photographs_to_features(photographs, tmp_path):
    """transforms.json and PNGs alone: the density is fitted, and the colours lifted onto it."""
    frames = []
    for i, camera in enumerate(photographs.cameras):
        pixels = np.concatenate([photographs.colour[i], photographs.opacity[i][..., None]], axis=-1)
        Image.fromarray((255 * pixels).round().astype(np.uint8)).save(tmp_path / f"{i}.png")
        frames.append({"file_path": f"{i}.png", "transform_matrix": camera.pose.tolist()})
    angle = float(2 * np.arctan(64 / 2 / photographs.cameras[0].focal[0]))
    document = {"camera_angle_x": angle, "frames": frames}
    (tmp_path / "transforms.json").write_text(json.dumps(document))
    views = load_photographs(tmp_path / "transforms.json")
    field = fit_radiance(views, cells=20, options=QUICK)
    found = features_of_views(views, field.density, field.grid, encoder="rgb")
    above = field.grid.to_world(found.cells)[:, 2] > 0.55
    assert (found.values[:, 1] > found.values[:, 0])[above].mean() > 0.9
    assert (found.values[:, 0] > found.values[:, 1])[~above].mean() > 0.85  # less its upper cells
