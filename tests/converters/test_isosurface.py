"""Surfaces of splats and densities: closed, and of the volume of the body they came from."""

import numpy as np
import pytest
import trimesh
from autophyx_tet.converters.grids import DensityGrid, density_surface, isosurface
from autophyx_tet.converters.points.gaussians import standard_columns
from autophyx_tet.converters.points.table import PointTable
from autophyx_tet.converters.points.views import splat_surface
from autophyx_tet.fem.errors import NoVolumeError
from autophyx_tet.predictors.grid import Grid


def ball_of_splats(n=20_000, opacity=0.8):
    """Flat splats of 2 % of the radius on the unit sphere, as a trained scene has them."""
    rng = np.random.default_rng(0)
    x = rng.normal(size=(n, 3))
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    half = np.column_stack([1 + x[:, 2], -x[:, 1], x[:, 0], np.zeros(n)])  # turns z onto x
    columns = standard_columns(
        x, np.log(np.tile([0.02, 0.02, 0.002], (n, 1))), half, np.full(n, opacity),
        np.zeros((n, 3)),
    )  # fmt: skip
    return PointTable(columns)


@pytest.mark.slow
@pytest.mark.parametrize("cells", [48, 96])
def test_a_shell_of_splats_becomes_a_solid_ball(cells):
    """V = 4/3 pi r^3 within 3 %, watertight, one piece: the inside is not a cavity."""
    surface = splat_surface(ball_of_splats(), cells=cells)
    assert surface.is_watertight
    assert surface.body_count == 1
    assert surface.volume == pytest.approx(4 / 3 * np.pi, rel=0.03)
    radius = np.linalg.norm(surface.vertices, axis=1)
    np.testing.assert_allclose(radius, 1, atol=4 / cells)  # two voxels, in a gap of the shell


def splats_on(mesh, *, count, size, rough=0.0):
    """Round splats of one ``size`` [m] all over a mesh, off it by ``rough`` [m]."""
    x = trimesh.sample.sample_surface(mesh, count, seed=0)[0]
    x = x + np.random.default_rng(0).normal(0, rough, x.shape)
    turns = np.tile([1.0, 0, 0, 0], (count, 1))
    columns = standard_columns(
        x, np.log(np.full((count, 3), size)), turns, np.full(count, 0.9), np.zeros((count, 3))
    )
    return PointTable(columns)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("thin", "count"),
    [
        (trimesh.creation.cylinder(radius=0.01, height=1.0), 8_000),
        (trimesh.creation.box((0.5, 0.3, 0.012)), 8_000),
    ],
    ids=["rod", "plate"],
)
def test_a_body_as_thin_as_its_splats_keeps_its_volume(thin, count):
    """Both sides of it are one ridge of opacity: its crest is the middle, not the surface.

    Three and two standard deviations of the splats across: 10 % is what the cells resolve of that.
    """
    surface = splat_surface(splats_on(thin, count=count, size=0.006))
    assert surface.is_watertight
    assert surface.body_count == 1
    assert surface.volume == pytest.approx(thin.volume, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(
    "body",
    [trimesh.creation.box((0.4, 0.04, 0.45)), trimesh.creation.torus(0.15, 0.06)],
    ids=["board", "ring"],
)
def test_splats_of_a_rough_capture_enclose_its_volume(body):
    """Off the surface by a third of their spacing: their mean depth is it, the outermost are not.

    3 % are the cells, some four across the board; by the outermost it is 10 and 5 %.
    """
    apart = (body.area / 20_000) ** 0.5
    surface = splat_surface(splats_on(body, count=20_000, size=apart, rough=0.35 * apart))
    assert surface.volume == pytest.approx(body.volume, rel=0.03)


@pytest.mark.slow
def test_a_density_ball_keeps_its_radius_even_in_a_box_of_oblong_cells():
    """sigma = 20 (1.5 - r) cut at 10 is the unit ball: its volume within 1 %."""
    lo, hi = np.full(3, -1.4), np.full(3, 1.4)
    shape = (70, 50, 40)
    empty = DensityGrid(lo, hi, np.zeros(shape))
    r = np.linalg.norm(empty.centers(), axis=1).reshape(shape)
    surface = density_surface(DensityGrid(lo, hi, 20 * np.maximum(1.5 - r, 0), threshold=10.0))
    assert surface.is_watertight
    assert surface.volume == pytest.approx(4 / 3 * np.pi, rel=0.01)


def test_a_body_that_touches_the_border_is_closed():
    grid = Grid(np.zeros(3), 0.1, (8, 8, 8))
    surface = isosurface(np.ones(grid.shape), grid, level=0.5)
    assert surface.is_watertight
    assert surface.volume == pytest.approx(0.8**3, rel=0.05)


def test_nothing_to_see_is_told():
    with pytest.raises(NoVolumeError, match="none of 20000 splats has an opacity above"):
        splat_surface(ball_of_splats(opacity=0.01))
    with pytest.raises(NoVolumeError, match="the largest value is 0"):
        isosurface(np.zeros((4, 4, 4)), Grid(np.zeros(3), 1.0, (4, 4, 4)), level=1.0)
