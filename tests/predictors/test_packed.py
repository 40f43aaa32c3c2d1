"""Weights kept as bytes: each number within half a step of what it was."""

import numpy as np
import pytest
from autophyx_tet.predictors.packed import packed, unpacked
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

NUMBERS = arrays(
    np.float32, array_shapes(min_dims=2, max_dims=3), elements=st.floats(-9, 9, width=32)
)


@given(NUMBERS)
def test_a_number_is_within_half_a_step(whole):
    found = unpacked(packed({"w": whole}))["w"]
    half = np.abs(whole).max(axis=-1, keepdims=True) / 254
    assert (np.abs(found - whole) <= half * (1 + 1e-5) + 1e-30).all()  # single precision


@pytest.mark.parametrize(("axes", "bytes_"), [(2, True), (3, False)])
def test_of_fewer_axes_halves_are_kept(axes, bytes_):
    stored = packed({"w": np.full((2, 3), 0.1)}, axes=axes)
    assert (stored["w"].dtype == np.int8) is bytes_
    assert unpacked(stored)["w"] == pytest.approx(np.full((2, 3), 0.1), rel=2**-11)  # of a half
