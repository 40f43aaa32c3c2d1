"""Finite differences of an elastic law, for every law that there is or comes."""

import numpy as np
import pytest
from autophyx_tet.fem.elements.assembly import discretise
from autophyx_tet.fem.elements.elastic import ElasticBody
from autophyx_tet.fem.laws.law import LAWS

from .bodies import shaken_box


def force(body, u):
    return body.response(u).force


def energy(body, u):
    return body.response(u).energy


def check_derivatives(law, order, seed):
    """Force and tangent are the central differences of energy and force, away from F = I."""
    rng = np.random.default_rng(seed)
    mesh = shaken_box(cells=(1, 1, 1), nu=0.4)
    grid = discretise(mesh, order)
    body, x = ElasticBody(grid, mesh.material, law), grid.space.nodes
    u = x @ (rng.normal(size=(3, 3)) * 0.2 + 0.4 * np.eye(3)) + rng.normal(size=x.shape) * 0.02
    d = rng.normal(size=x.shape)
    d /= np.linalg.norm(d)
    h = 1e-5
    slope = (energy(body, u + h * d) - energy(body, u - h * d)) / (2 * h)
    assert (force(body, u) * d).sum() == pytest.approx(slope, rel=1e-6, abs=1e-8)
    if LAWS[law].stress_change or LAWS[law].stiffness_block:  # else projected only
        K = body.tangent(u)
        change = (force(body, u + h * d) - force(body, u - h * d)) / (2 * h)
        assert K.times(d) == pytest.approx(change, rel=1e-5, abs=1e-8)
