"""Many runs of one body: scaling laws of one material, and the full body's answers."""

import numpy as np
import pytest
from autophyx_tet.fem.errors import ConvergenceError, InputError
from autophyx_tet.fem.reduced import sweep
from autophyx_tet.fem.reduced.model import Subspace
from autophyx_tet.fem.reduced.sweep import WhatIf, what_if, what_if_error

from .bodies import clamped, linear, two_part_bar, whole

MESH = two_part_bar((6, 2, 2))


@pytest.fixture(scope="module")
def model():
    return whole(linear(MESH), Subspace.VECTOR)


def test_load_and_stiffness_scale_together(model):
    """All E times s and all loads times s leave the rest alone; frequencies rise by sqrt(s)."""
    s = np.array([0.5, 1.0, 4.0])
    loads = s[:, None] * model.weight([0, 0, -1.0])
    found = what_if(model, scales=np.repeat(s[:, None], 2, axis=1), loads=loads)
    assert found.largest == pytest.approx(found.largest[1], rel=1e-5)
    assert found.frequency / found.frequency[1] == pytest.approx(np.sqrt(s), rel=1e-9)


@pytest.mark.slow
def test_runs_are_the_full_body_s(model):
    """Parts twice softer or stiffer, weights any way: 2 % in rest and frequency."""
    rng = np.random.default_rng(0)
    scales = np.exp(rng.uniform(-0.7, 0.7, (20, 2)))
    ways = rng.normal(size=(20, 1, 3))
    forces = model.mass[:, None] * ways / np.linalg.norm(ways, axis=2, keepdims=True)
    loads = np.stack([model.pull_back(f) for f in forces])
    found = what_if(model, scales=scales, loads=loads)
    held = clamped(MESH)
    error = what_if_error(
        model, found, MESH, held, scales=scales, forces=forces.__getitem__, count=3
    )
    assert len(error.runs) == 3
    assert error.rest.max() < 0.02
    assert np.abs(error.frequency).max() < 0.02


def test_runs_without_a_rest_have_no_error(model):
    none = WhatIf(np.full((3, model.dofs), np.nan), np.full(3, np.nan), np.ones(3))
    given = {"scales": np.ones((3, 2)), "forces": lambda _run: np.zeros_like(MESH.points)}
    with pytest.raises(ConvergenceError, match="none of 3 runs"):
        what_if_error(model, none, MESH, clamped(MESH), **given)


def test_a_run_without_a_full_rest_keeps_the_others(model, monkeypatch):
    """Where the full body finds no rest of one run, the others are compared all the same."""
    loads = np.stack([model.weight([0, 0, g]) for g in (1.0, 2.0)])
    found = what_if(model, scales=np.ones((2, 2)), loads=loads)
    solve = sweep.solve_nonlinear

    def fails_far(body, supports, *, forces, **options):
        if np.abs(forces).sum() > 1.5 * model.mass.sum():
            raise ConvergenceError("sweep.none_runs", count=1)
        return solve(body, supports, forces=forces, **options)

    monkeypatch.setattr(sweep, "solve_nonlinear", fails_far)
    error = what_if_error(
        model, found, MESH, clamped(MESH), scales=np.ones((2, 2)),
        forces=lambda run: model.mass[:, None] * np.array([0, 0, run + 1.0]), count=2,
    )  # fmt: skip
    assert (error.runs.tolist(), error.unsolved) == ([0], 1)
    assert error.rest[0] < 0.02


def test_scales_of_other_parts_are_refused(model):
    with pytest.raises(InputError, match="2 part"):
        what_if(model, scales=np.ones((1, 3)), loads=model.weight([0, 0, 1.0])[None])
