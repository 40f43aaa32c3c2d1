"""Carriers seen as they are: splats, clouds and density grids of a painted ball."""

import numpy as np
import pytest
import trimesh
from autophyx_tet.converters.grids import DensityGrid, write_density
from autophyx_tet.converters.points.gaussians import SH_C0, standard_columns
from autophyx_tet.converters.points.table import PointTable, write_points
from autophyx_tet.fem.errors import InputError
from autophyx_tet.predictors.grid import Grid
from autophyx_tet.toolkit.features import features, is_carrier, read_coloured_grid
from autophyx_tet.toolkit.options import FeatureOptions

RED, BLUE = np.array([0.9, 0.1, 0.1]), np.array([0.1, 0.1, 0.9])
QUICK = FeatureOptions(encoder="rgb", cells=20, views=6, lower=2, no_cache=True)


def sphere(count=20_000):
    """Points on the unit sphere, and their colours: red above, blue below."""
    points = np.random.default_rng(0).normal(size=(count, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    return points, np.where(points[:, 2:] > 0, RED, BLUE)


def splats(path):
    points, colours = sphere()
    columns = standard_columns(
        points,
        np.full((len(points), 3), np.log(0.02)),
        np.tile([1.0, 0, 0, 0], (len(points), 1)),
        np.full(len(points), 0.9),
        (colours - 0.5) / SH_C0,
    )
    write_points(path, PointTable(columns))


def cloud(path):
    points, colours = sphere()
    bytes_ = (255 * colours).round().astype(np.uint8)
    columns = dict(zip("xyz", points.T, strict=True))
    colour = dict(zip(("red", "green", "blue"), bytes_.T, strict=True))
    write_points(path, PointTable(columns | colour))


def field(path):
    grid = Grid.around(np.array([[-1.2] * 3, [1.2] * 3]), cells=32)
    at = grid.centers()
    density = np.where(np.linalg.norm(at, axis=-1) < 1, 50.0, 0.0)
    colour = np.where(at[..., 2:] > 0, RED, BLUE)
    fields = {name: colour[..., k] for k, name in enumerate(("red", "green", "blue"))}
    write_density(path, DensityGrid(grid.lo, grid.hi, density, fields=fields))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "write"), [("splats.ply", splats), ("cloud.ply", cloud), ("field.npz", field)]
)
def test_carriers_have_features_inside_and_out(tmp_path, name, write):
    """The filled cells are the ball's; its upper half is red and its lower half blue."""
    path = tmp_path / name
    write(path)
    assert is_carrier(path)
    found = features(path, options=QUICK)
    voxels = found.voxels
    at = voxels.grid.to_world(voxels.cells)
    radius = np.linalg.norm(at, axis=1)
    assert radius.max() < 1 + 2 * voxels.grid.h
    inside = np.linalg.norm(voxels.grid.centers(), axis=-1) < 1 - 2 * voxels.grid.h
    assert voxels.occupied[inside].all()
    away = np.abs(at[:, 2]) > voxels.grid.h
    red = voxels.values[:, 0] > voxels.values[:, 2]
    assert (red == (at[:, 2] > 0))[away].mean() > 0.97
    assert found.asset is None
    assert found.document()["encoder"] == "rgb"


def test_meshes_are_no_carriers(tmp_path):
    """A PLY with triangles is a surface; one of points alone is looked at as it is."""
    trimesh.creation.box().export(tmp_path / "box.ply")
    cloud(tmp_path / "cloud.ply")
    assert not is_carrier(tmp_path / "box.ply")
    assert is_carrier(tmp_path / "cloud.ply")
    assert not is_carrier(tmp_path / "box.glb")


@pytest.mark.slow
def test_a_sparse_cloud_gets_cells_that_it_closes(tmp_path):
    """Of 2,000 points the cells are so large that the ball's inside is still enclosed."""
    points, _ = sphere(2_000)
    write_points(tmp_path / "c.ply", PointTable(dict(zip("xyz", points.T, strict=True))))
    matter = read_coloured_grid(tmp_path / "c.ply", cells=64)
    assert max(matter.grid.shape) < 40
    voxels = features(tmp_path / "c.ply", options=QUICK).voxels
    assert voxels.occupied[np.linalg.norm(voxels.grid.centers(), axis=-1) < 0.7].all()


def test_haze_is_told(tmp_path):
    """A density that stops no light has no features, and the message says what is missing."""
    haze = DensityGrid(np.zeros(3), np.ones(3), np.full((4, 4, 4), 1e-3))
    write_density(tmp_path / "haze.npz", haze)
    with pytest.raises(InputError, match="stops 30% of the light"):
        features(tmp_path / "haze.npz", options=QUICK)
