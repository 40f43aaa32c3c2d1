"""Old names keep working, and say once what they are called now."""

import warnings

import numpy as np
import pytest
from autophyx_tet.fem import drop, sag, solve_static
from autophyx_tet.fem.deprecation import renamed_options
from autophyx_tet.fem.scene.supports import Supports

from .bodies import shaken_box


def test_an_option_says_it_once():
    @renamed_options(old="new")
    def answer(*, new: int) -> int:
        return new

    with pytest.warns(DeprecationWarning, match="'old' is now called 'new'"):
        assert answer(old=1) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert answer(old=2) == answer(new=2) == 2


def test_old_names_of_this_room():
    """Vectors of gravity, callbacks of frames, the error of the elements."""
    mesh = shaken_box((0.1,) * 3, (1, 1, 1), E=1e6, nu=0.3, rho=1000)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 2] == 0)
    with pytest.warns(DeprecationWarning, match="gravity_vector"):
        old = solve_static(mesh, held, gravity=(0, 0, -9.81))
    new = solve_static(mesh, held, gravity_vector=(0, 0, -9.81))
    assert np.array_equal(old.displacement, new.displacement)
    heard = []
    with pytest.warns(DeprecationWarning, match="progress"):
        drop(mesh, height=0.01, frames=2, tell=lambda *frame: heard.append(frame))
    assert heard == [(1, 2), (2, 2)]
    result = sag(mesh)
    with pytest.warns(DeprecationWarning, match="discretisation_error"):
        error = result.gap
    assert error == result.discretisation_error
