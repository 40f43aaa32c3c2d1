"""Grid: index to world and back is exact."""

import numpy as np
from autophyx_tet.predictors.grid import Grid
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

corners = hnp.arrays(np.float64, 3, elements=st.floats(-10, 10))


@given(corners, st.floats(1e-3, 1.0), hnp.arrays(np.int64, (5, 3), elements=st.integers(0, 200)))
def test_index_world_index_is_exact(lo, h, cells):
    grid = Grid(lo, h, (201, 201, 201))
    world = grid.to_world(cells)
    np.testing.assert_array_equal(np.rint(grid.to_index(world)), cells)
    np.testing.assert_allclose(grid.to_index(world), cells, atol=1e-9)  # |lo| / h * eps
    np.testing.assert_array_equal(grid.cell_of(world), cells)


@given(corners, hnp.arrays(np.float64, 3, elements=st.floats(0.01, 5)), st.integers(4, 64))
def test_grid_around_bounds_contains_them(lo, size, cells):
    grid = Grid.around(np.stack([lo, lo + size]), cells=cells)
    assert (grid.lo <= lo).all()
    assert (grid.hi >= lo + size).all()
    assert max(grid.shape) == cells + 2
