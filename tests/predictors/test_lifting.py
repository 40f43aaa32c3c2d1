"""Laws of lifting: transmittance, conservation, hidden cells, exact recovery."""

import numpy as np
import pytest
from autophyx_tet.fem.errors import InputError
from autophyx_tet.predictors.appearance.features import Rays, lift, pixel_rays, ray_weights
from autophyx_tet.predictors.appearance.surface import density_of_points, opaque_density
from autophyx_tet.predictors.appearance.views import hemisphere, look_at
from autophyx_tet.predictors.grid import Grid

GRID = Grid(np.array([-1.0, -1, -1]), 0.125, (16, 16, 16))


def along(axis, *, grid=GRID):
    """One ray down each column of cells along an axis, from outside."""
    a, b = np.meshgrid(*(np.arange(16),) * 2, indexing="ij")
    origins = np.insert(np.stack([a.ravel(), b.ravel()], axis=1), axis, -9, axis=1)
    directions = np.tile(np.eye(3)[axis], (256, 1))
    return Rays(grid.to_world(origins), directions, np.zeros((256, 1)))


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_light_is_conserved(axis):
    """Shares of a ray sum to 1 - exp(-integral of density), whatever the density."""
    density = np.random.default_rng(0).random(GRID.shape)
    matrix = ray_weights(along(axis), density, GRID)
    expected = 1 - np.exp(-density.sum(axis=axis).ravel() * GRID.h)
    assert np.allclose(np.asarray(matrix.sum(axis=1)).ravel(), expected, atol=1e-4)


def test_share_of_a_cell_is_light_times_opacity():
    """Down one column, cell i gets exp(-sum of depths before) (1 - exp(-own depth))."""
    density = np.full(GRID.shape, 2.0)
    matrix = ray_weights(along(2), density, GRID).toarray().reshape(16, 16, *GRID.shape)
    depth = 2.0 * GRID.h
    expected = np.exp(-depth * np.arange(16)) * (1 - np.exp(-depth))
    assert np.allclose(matrix[3, 5, 3, 5], expected, atol=1e-5)
    assert matrix[3, 5].sum() == pytest.approx(matrix[3, 5, 3, 5].sum())


def test_path_lengths_of_slanted_rays():
    """Through the whole grid the optical depth of any ray is density times its chord."""
    rng = np.random.default_rng(1)
    origins = rng.normal(size=(200, 3))
    origins *= 4 / np.linalg.norm(origins, axis=1, keepdims=True)
    directions = rng.uniform(-0.9, 0.9, (200, 3)) - origins
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    times = (np.array([[[-1.0]], [[1.0]]]) - origins) / directions
    chord = times.max(axis=0).min(axis=1) - times.min(axis=0).max(axis=1)
    matrix = ray_weights(Rays(origins, directions, origins), np.full(GRID.shape, 0.3), GRID)
    assert np.allclose(np.asarray(matrix.sum(axis=1)).ravel(), 1 - np.exp(-0.3 * chord), atol=1e-4)


def two_slabs():
    """A front slab that hides a back one from a camera above: feature (1, 0) over (0, 1)."""
    occupied = np.zeros(GRID.shape, dtype=bool)
    occupied[2:14, 2:14, 11:13] = occupied[4:12, 4:12, 4:6] = True
    cameras = [
        look_at(np.array([x, y, 6.0]), np.zeros(3), pixels=48) for x, y in ((0, 0), (0.5, 0.3))
    ]
    features = np.zeros((2, 48, 48, 2))
    features[..., 0] = 1
    return occupied, cameras, features


def test_hidden_slab_gets_nothing_of_the_front_one():
    """Cells that no ray reaches carry < 1 % of the occluder's feature; averaging gives them all."""
    occupied, cameras, features = two_slabs()
    density = opaque_density(occupied, GRID)
    lifted = lift(features, cameras, density, GRID)
    hidden = lifted.cells[:, 2] < 8
    assert np.abs(lifted.values[hidden, 0]).max() < 0.01
    assert not lifted.seen[hidden].any()
    front = lifted.seen & ~hidden
    assert np.allclose(lifted.values[front], [1, 0], atol=1e-3)
    averaged = lift(features, cameras, density, GRID, method="average")
    assert averaged.values[hidden, 0].min() > 0.5


def test_trunk_behind_leaves_keeps_its_own_feature():
    """Where leaves let a view through, the trunk gets its feature from that view alone."""
    occupied = np.zeros(GRID.shape, dtype=bool)
    occupied[6:10, 6:10, :] = True  # trunk along z
    occupied[13:15, :, 4:12] = True  # leaves in front of it along +x
    part = np.where(np.arange(16)[:, None, None] >= 13, 0, 1) * np.ones(GRID.shape, dtype=int)
    density = opaque_density(occupied, GRID)
    places = ((6.0, 0, 0.1), (4.0, 4.0, 0.2), (0.1, -6.0, 0.3), (-6, 0.2, 0.1), (5.5, -1.5, 0.1))
    cameras = [look_at(np.array(place), np.zeros(3), pixels=64) for place in places]
    features = np.eye(2)[_labels(cameras, density, part)]
    lifted = lift(features, cameras, density, GRID)
    trunk = part[tuple(lifted.cells.T)] == 1
    behind = trunk & lifted.seen
    leak = np.abs(lifted.values[trunk, 0])
    assert leak.max() < 0.05  # of border cells; on average far less:
    assert leak.mean() < 0.01
    assert lifted.values[behind, 1].mean() > 0.98
    averaged = lift(features, cameras, density, GRID, method="average")
    assert averaged.values[trunk, 0].mean() > 0.1


def _labels(cameras, density, part):
    """Part with the largest share in every pixel."""
    blank = np.zeros((len(cameras), 64, 64, 1))
    matrix = ray_weights(pixel_rays(blank, cameras, None), density, GRID)
    share = matrix @ np.eye(2)[part[density > 0]]
    return share.argmax(axis=1).reshape(len(cameras), 64, 64)


def test_rendered_features_are_recovered():
    """Pictures rendered from known features of a solid give those features back on its surface."""
    centers = GRID.centers()
    occupied = np.linalg.norm(centers, axis=-1) < 0.8
    density = opaque_density(occupied, GRID)
    cells = np.argwhere(occupied)
    truth = np.stack([np.sin(3 * centers[occupied][:, k]) for k in range(3)], axis=1)
    cameras = hemisphere(np.array([[-0.8] * 3, [0.8] * 3]), count=10, lower=6, pixels=48)
    blank = np.zeros((16, 48, 48, 1))
    matrix = ray_weights(pixel_rays(blank, cameras, None), density, GRID)
    total = np.asarray(matrix.sum(axis=1))
    pictures = (matrix @ truth / np.maximum(total, 1e-3)[:, None]).reshape(16, 48, 48, 3)
    opacity = total.reshape(16, 48, 48)
    results = {
        method: lift(
            pictures.reshape(16, 48, 48, 3), cameras, density, GRID, opacity=opacity, method=method
        )
        for method in ("solve", "weighted", "average")
    }
    assert (results["solve"].cells == cells).all()
    seen = results["solve"].weight > 2
    errors = {m: np.abs(r.values - truth)[seen].mean() for m, r in results.items()}
    assert errors["solve"] < 0.002
    assert errors["solve"] * 3 < errors["weighted"] < errors["average"] / 10
    residuals = [results[m].residual for m in ("solve", "weighted", "average")]
    assert residuals == sorted(residuals)
    assert residuals[0] < 0.01


def test_density_of_points():
    """Cells with a point are opaque, points outside the grid are ignored."""
    density = density_of_points(np.array([[0.01, 0.01, 0.01], [9.0, 0, 0]]), GRID)
    assert (density > 0).sum() == 1
    assert density[8, 8, 8] > 0


def test_cameras_that_look_away_are_an_error():
    """Rays that all miss the object name the likely reason."""
    camera = look_at(np.array([50.0, 0, 0]), np.array([60.0, 0, 0]), pixels=8)
    density = opaque_density(np.ones(GRID.shape, dtype=bool), GRID)
    with pytest.raises(InputError, match="metres"):
        lift(np.zeros((1, 8, 8, 2)), [camera], density, GRID)
