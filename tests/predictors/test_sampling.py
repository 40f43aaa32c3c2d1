"""Laws of the sampler: constant and linear fields, masks, parts, distances, invariance."""

import numpy as np
import pytest
from autophyx_tet.fem.errors import InputError
from autophyx_tet.predictors.field import ANY_PART, MaterialField, sample_field
from autophyx_tet.predictors.grid import Grid
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

SHAPE = (6, 5, 4)
GRID = Grid(np.array([-1.0, 2.0, 0.5]), 0.25, SHAPE)
masks = hnp.arrays(bool, SHAPE).filter(np.any)


def field_of(logE, nu, logrho, occupied=None, **labels):
    """A field from functions of the cell centres; cells that are not occupied hold NaN."""
    x = GRID.centers()
    occupied = np.ones(SHAPE, dtype=bool) if occupied is None else occupied
    values = [np.where(occupied, f(x), np.nan) for f in (logE, nu, logrho)]
    return MaterialField(GRID, occupied, 10 ** values[0], values[1], 10 ** values[2], **labels)


def inside_points(n, seed):
    """Points between the outermost cell centres, where no weight falls outside the grid."""
    low, high = GRID.lo + GRID.h / 2, GRID.hi - GRID.h / 2
    return np.random.default_rng(seed).uniform(low, high, (n, 3))


@settings(max_examples=30, deadline=None)
@given(masks, st.floats(3, 12), st.floats(0, 0.495), st.integers(0, 99))
def test_constant_field_is_reproduced_anywhere(occupied, logE, nu, seed):
    """f = c on any set of voxels -> c at every point, in the grid or far from it."""
    field = field_of(lambda x: logE + 0 * x[..., 0], lambda x: nu + 0 * x[..., 0],
                     lambda x: 3 + 0 * x[..., 0], occupied)  # fmt: skip
    points = np.random.default_rng(seed).uniform(GRID.lo - 1, GRID.hi + 1, (200, 3))
    sample = sample_field(field, points)
    np.testing.assert_allclose(sample.E, 10**logE, rtol=1e-12)
    np.testing.assert_allclose(sample.nu, nu, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(sample.rho, 1000, rtol=1e-12)


@settings(max_examples=30, deadline=None)
@given(hnp.arrays(float, 3, elements=st.floats(-1, 1)), st.integers(0, 99))
def test_linear_field_is_reproduced(slope, seed):
    """log10 E = 6 + g.x, nu and log10 rho likewise -> the same at any interior point."""
    field = field_of(
        lambda x: 6 + x @ slope, lambda x: 0.2 + 0.01 * x @ slope, lambda x: 3 - 0.1 * x @ slope
    )
    points = inside_points(300, seed)
    sample = sample_field(field, points)
    np.testing.assert_allclose(np.log10(sample.E), 6 + points @ slope, rtol=1e-6)
    np.testing.assert_allclose(sample.nu, 0.2 + 0.01 * points @ slope, rtol=1e-6)
    np.testing.assert_allclose(np.log10(sample.rho), 3 - 0.1 * points @ slope, rtol=1e-6)
    assert sample.n_fallback == 0


@settings(max_examples=30, deadline=None)
@given(masks, st.integers(0, 99))
def test_values_stay_between_those_of_the_occupied_voxels(occupied, seed):
    """A convex mean: no value leaves the range of the occupied voxels; cell centres are exact."""
    logE = np.random.default_rng(seed).uniform(3, 12, SHAPE)
    field = field_of(lambda _: logE, lambda x: 0.3 + 0 * x[..., 0],
                     lambda x: 3 + 0 * x[..., 0], occupied)  # fmt: skip
    points = np.random.default_rng(seed).uniform(GRID.lo - 1, GRID.hi + 1, (200, 3))
    got = np.log10(sample_field(field, points).E)
    assert got.min() >= logE[occupied].min() - 1e-9
    assert got.max() <= logE[occupied].max() + 1e-9
    centres = GRID.centers()[occupied]
    np.testing.assert_allclose(np.log10(sample_field(field, centres).E), logE[occupied], rtol=1e-9)


@settings(max_examples=30, deadline=None)
@given(masks, st.integers(0, 99))
def test_parts_never_mix(occupied, seed):
    """E = 10^(4 + 2 part): every sample is exactly the value of one part, its own if labelled."""
    part = np.random.default_rng(seed).integers(0, 3, SHAPE)
    field = field_of(lambda _: 4.0 + 2 * part, lambda x: 0.3 + 0 * x[..., 0],
                     lambda x: 3 + 0 * x[..., 0], occupied,
                     part=np.where(occupied, part, -1), part_names=("a", "b", "c"))  # fmt: skip
    points = np.random.default_rng(seed).uniform(GRID.lo - 0.5, GRID.hi + 0.5, (200, 3))
    free = sample_field(field, points)
    np.testing.assert_allclose(np.log10(free.E), 4 + 2 * free.part, rtol=1e-12)
    wanted = np.random.default_rng(seed).choice([*np.unique(part[occupied]), ANY_PART], len(points))
    told = sample_field(field, points, part=wanted)
    assert (told.part == wanted)[wanted != ANY_PART].all()
    np.testing.assert_allclose(np.log10(told.E), 4 + 2 * told.part, rtol=1e-12)
    np.testing.assert_array_equal(told.part[wanted == ANY_PART], free.part[wanted == ANY_PART])


@settings(max_examples=20, deadline=None)
@given(masks, st.integers(0, 99))
def test_fallback_takes_the_nearest_voxel(occupied, seed):
    """Far points get the voxel at the least Euclidean distance, which brute force confirms."""
    label = np.arange(np.prod(SHAPE)).reshape(SHAPE)
    field = field_of(lambda x: 6 + 0 * x[..., 0], lambda x: 0.3 + 0 * x[..., 0],
                     lambda x: 3 + 0 * x[..., 0], occupied, material=label)  # fmt: skip
    points = np.random.default_rng(seed).uniform(GRID.hi + 1, GRID.hi + 2, (20, 3))
    sample = sample_field(field, points)
    centres = GRID.centers()[occupied]
    distance = np.linalg.norm(points[:, None] - centres, axis=-1)
    chosen = np.linalg.norm(points - GRID.centers().reshape(-1, 3)[sample.material], axis=-1)
    np.testing.assert_allclose(chosen, distance.min(axis=1))
    assert sample.n_fallback == 20
    assert sample.max_fallback_distance == pytest.approx(distance.min(axis=1).max())


def test_labels_at_cell_centres_are_those_of_the_cell():
    """Nearest for classes: at a centre the label is the cell's own."""
    material = np.arange(np.prod(SHAPE)).reshape(SHAPE)
    field = field_of(lambda x: 6 + 0 * x[..., 0], lambda x: 0.3 + 0 * x[..., 0],
                     lambda x: 3 + 0 * x[..., 0], material=material)  # fmt: skip
    shifted = GRID.centers().reshape(-1, 3) + 0.3 * GRID.h
    assert (sample_field(field, shifted).material == material.ravel()).all()


def test_order_and_chunks_do_not_matter():
    """The sample of a permuted, larger set is the permuted sample."""
    field = field_of(lambda x: 6 + x[..., 0], lambda x: 0.3 + 0 * x[..., 0],
                     lambda x: 3 + 0 * x[..., 0])  # fmt: skip
    points = inside_points(150_000, 1)
    order = np.random.default_rng(2).permutation(len(points))
    np.testing.assert_array_equal(
        sample_field(field, points[order]).E, sample_field(field, points).E[order]
    )


def test_no_points_give_an_empty_sample():
    field = field_of(lambda x: 6 + x[..., 0], lambda x: 0 * x[..., 0], lambda x: 3 + 0 * x[..., 0])
    assert sample_field(field, np.empty((0, 3))).E.shape == (0,)


def test_bad_points_and_labels_are_told():
    field = field_of(lambda x: 6 + x[..., 0], lambda x: 0 * x[..., 0], lambda x: 3 + 0 * x[..., 0],
                     part=np.zeros(SHAPE, dtype=int), part_names=("a", "b"))  # fmt: skip
    with pytest.raises(InputError, match="point 1 is not finite"):
        sample_field(field, np.array([[0, 0, 0], [0, np.nan, 0.0]]))
    with pytest.raises(InputError, match=r"part labels \[1\] have no voxel"):
        sample_field(field, np.zeros((2, 3)), part=np.array([0, 1]))
