"""Rates of convergence against a manufactured solution, on a cube."""

import numpy as np
import pytest
from autophyx_tet.fem.elements.assembly import discretise
from autophyx_tet.fem.elements.elastic import displacement_gradients
from autophyx_tet.fem.elements.space import TET_POINTS, make_space, shape_functions
from autophyx_tet.fem.material import ElementMaterial, lame_parameters
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.statics import solve_static

# u_i = sin(WAVE_i . x + PHASE_i), and E(x) = exp(SLOPE . x).
WAVE = np.array([[1.0, 2.0, 0.5], [0.3, 1.0, 1.5], [2.0, 0.4, 1.0]])
PHASE = np.array([0.3, 0.9, 0.1])
NU = 0.3


def u_exact(x):
    return np.sin(x @ WAVE.T + PHASE)


def gradient_exact(x):
    return np.cos(x @ WAVE.T + PHASE)[:, :, None] * WAVE


def body(x, slope):
    """-div sigma for sigma = E(x) s(x), with s the stress of E = 1."""
    lam, mu = lame_parameters(1.0, NU)
    s = np.sin(x @ WAVE.T + PHASE)
    laplace = -(WAVE**2).sum(axis=1) * s
    grad_div = -(np.diag(WAVE) * s) @ WAVE
    H = gradient_exact(x)
    stress = lam * np.trace(H, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    stress = stress + mu * (H + H.transpose(0, 2, 1))
    E = np.exp(x @ slope)[:, None]
    return -E * (mu * laplace + (lam + mu) * grad_div) - E * (stress @ slope)


def errors(order, n, slope):
    """L2 error of u and of its gradient."""
    mesh = box_mesh((1, 1, 1), (n, n, n))
    E = np.exp(mesh.centroids @ slope)
    mesh = mesh.with_material(ElementMaterial(E, np.full_like(E, NU), np.ones_like(E)))
    x = make_space(mesh, order).nodes
    edge = (np.isclose(x, 0) | np.isclose(x, 1)).any(axis=1)
    held = Supports.clamp(len(x), edge, u_exact(x)[edge])
    result = solve_static(mesh, held, body=lambda p: body(p, slope), order=order, tolerance=1e-10)
    u, grid = result.node_displacement, discretise(mesh, order)
    where = np.einsum("qk,tkd->tqd", TET_POINTS, mesh.points[mesh.tets])
    N = shape_functions(order, TET_POINTS)
    ours = np.einsum("qi,tid->tqd", N, u[grid.space.elements])
    flat = where.reshape(-1, 3)
    du = ours - u_exact(flat).reshape(ours.shape)
    H = displacement_gradients(grid, u, TET_POINTS)
    dH = H - gradient_exact(flat).reshape(H.shape)
    weight = mesh.volumes[:, None] / 4
    return np.sqrt([(weight * (du**2).sum(-1)).sum(), (weight * (dH**2).sum((-1, -2))).sum()])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("order", "cells", "slope"),
    [(1, (8, 16), np.array([1.0, -0.5, 0.7])), (2, (4, 8), np.zeros(3))],
    ids=["P1, smooth E(x)", "P2"],
)
def test_order(order, cells, slope):
    """L2 error O(h^(k+1)), H1 error O(h^k), within 0.1."""
    coarse, fine = (errors(order, n, slope) for n in cells)
    rate = np.log2(coarse / fine)
    assert rate == pytest.approx([order + 1, order], abs=0.1)
