"""Splats and points that move with a mesh: turned exactly, stretched by F, found in their tets."""

import numpy as np
import pytest
from autophyx_tet.converters.embedding import STRETCH, Carried, Driven, embed
from autophyx_tet.converters.points.film import Moved, Shown, needles
from autophyx_tet.converters.points.gaussians import (
    BANDS,
    band_rotations,
    band_values,
    gaussians,
    matrices_of,
    polar,
    quaternions_of,
    standard_columns,
    stretched,
)
from autophyx_tet.converters.points.table import PointTable
from autophyx_tet.fem import box_mesh
from scipy.sparse import csr_matrix

from ..fem.bodies import random_rotation, shaken_box

N = 400


def splats(k=15, lo=0.0, hi=1.0, dtype=np.float64):
    """Splats in a box, in float64 so that the law is seen and not the type of the file."""
    rng = np.random.default_rng(1)
    turns = rng.normal(size=(N, 4))
    columns = standard_columns(
        rng.uniform(lo, hi, (N, 3)),
        rng.uniform(-8, -3, (N, 3)),
        turns / np.linalg.norm(turns, axis=1, keepdims=True),
        rng.uniform(0.1, 0.9, N),
        rng.normal(size=(N, 3)),
        rng.normal(size=(N, 3, k)),
    )
    return PointTable({name: values.astype(dtype) for name, values in columns.items()})


def covariances(table):
    found = gaussians(table)
    axes = matrices_of(found.rotations)
    return np.einsum("nij,nj,nkj->nik", axes, found.sigmas**2, axes)


def harmonics(table, k=15):
    return np.stack([table.columns[f"f_rest_{i}"] for i in range(3 * k)], axis=1).reshape(N, 3, k)


def seen(coefficients, directions):
    """What splats show above their mean colour in the given directions."""
    values = [band_values(degree, directions) for degree in (1, 2, 3)]
    return np.einsum("nck,nk->nc", coefficients, np.concatenate(values, axis=-1))


def moved(table, F, shift=0.0, mesh=None):
    mesh = mesh or shaken_box()
    (frame,) = Driven.of(table, mesh).frames([mesh.points @ F.T + shift - mesh.points])
    return frame


def test_a_rigid_motion_turns_everything_and_changes_nothing():
    """x' = R x + t, Sigma' = R Sigma R^T, scales as they were, colour seen from R d as from d.

    Ten digits for float64 columns; a splat outside moves with them.
    """
    table, R = splats(lo=-0.05), random_rotation()
    frame = moved(table, R, shift=np.array([3.0, -1.0, 2.0]))
    np.testing.assert_allclose(frame.positions, table.positions @ R.T + [3, -1, 2], atol=1e-10)
    np.testing.assert_allclose(covariances(frame), R @ covariances(table) @ R.T, atol=1e-12)
    np.testing.assert_allclose(gaussians(frame).sigmas, gaussians(table).sigmas, rtol=1e-9)
    d = np.random.default_rng(2).normal(size=(N, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    np.testing.assert_allclose(
        seen(harmonics(frame), d @ R.T), seen(harmonics(table), d), atol=1e-9
    )
    for name in ("opacity", "f_dc_0"):
        np.testing.assert_array_equal(frame.columns[name], table.columns[name])


def test_columns_of_float32_keep_a_millionth():
    """What files hold: a rigid motion to 1e-6 of the positions' size and of the covariance's."""
    table, R = splats(dtype=np.float32), random_rotation()
    frame = moved(table, R)
    assert frame.columns["x"].dtype == np.float32
    np.testing.assert_allclose(frame.positions, table.positions @ R.T, atol=1e-6)
    np.testing.assert_allclose(covariances(frame), R @ covariances(table) @ R.T, atol=1e-6)


def test_a_stretched_bar_stretches_its_splats():
    """Any affine F: Sigma' = F Sigma F^T, whatever tet a splat lies in."""
    F = np.array([[1.5, 0.2, 0.0], [0.0, 0.8, 0.0], [0.1, 0.0, 1.1]])
    table = splats()
    frame = moved(table, F)
    wanted = F @ covariances(table) @ F.T
    error = np.abs(covariances(frame) - wanted).max(axis=(1, 2)) / wanted.max(axis=(1, 2))
    assert error.max() < 1e-9
    np.testing.assert_allclose(frame.positions, table.positions @ F.T, atol=1e-12)


def test_a_harmonic_band_is_closed_under_rotation():
    """Y(d) . D c = Y(R^T d) . c in any direction; D is orthogonal, as real harmonics are."""
    R = np.stack([random_rotation(seed) for seed in range(3)])
    d = np.random.default_rng(3).normal(size=(50, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    for degree, width in enumerate(BANDS, 1):
        D = band_rotations(degree, R)
        unit = np.broadcast_to(np.eye(width), D.shape)
        np.testing.assert_allclose(D @ D.transpose(0, 2, 1), unit, atol=1e-12)
        for turn, matrix in zip(R, D, strict=True):
            there, here = band_values(degree, d) @ matrix, band_values(degree, d @ turn)
            np.testing.assert_allclose(there, here, atol=1e-12)


def test_polar_is_proper_for_any_matrix():
    """F = R U with a rotation, for inverted and flat tets too, and for none at all."""
    F = np.random.default_rng(4).normal(size=(200, 3, 3))
    F[0], F[1], F[2] = np.diag([1, 1, 0.0]), np.diag([1, 1, -1e-9]), np.eye(3)
    R, U = polar(F)
    np.testing.assert_allclose(np.linalg.det(R), 1, atol=1e-9)
    np.testing.assert_allclose(R @ U, F, atol=1e-9)
    np.testing.assert_allclose(U, U.transpose(0, 2, 1), atol=1e-9)
    np.testing.assert_allclose(matrices_of(quaternions_of(R)), R, atol=1e-9)


def test_a_flat_splat_stays_flat():
    """A standard deviation of zero is one under any rotation and stretch."""
    axes = np.eye(3)[None]
    found = stretched(np.array([[0.0, 1.0, 2.0]]), axes, axes, np.diag([2.0, 3.0, 1.0])[None])
    np.testing.assert_allclose(found.sigmas, [[0, 3, 2]], atol=1e-15)


def test_every_point_finds_its_tet_and_others_the_nearest():
    """Random points against all tets; graded meshes too; outside: nearest, and how far."""
    box = box_mesh((1.0, 1.0, 1.0), (6, 6, 6))
    mesh = type(box)(box.points**3, box.tets, box.region)  # tets of 1e-7 to .08 m^3
    x = np.random.default_rng(5).uniform(-0.1, 1.1, (3000, 3)) ** 3
    x = x[np.abs(x).min(axis=1) > 1e-8]  # nearer to a face than that is on it
    found = embed(mesh, x)
    inside = ((x > 0) & (x < 1)).all(axis=1)
    np.testing.assert_array_equal(found.outside, ~inside)
    assert found.weights[inside].min() > -1e-8
    np.testing.assert_allclose(found.carried(np.zeros_like(mesh.points)).positions, x, atol=1e-12)
    away = np.linalg.norm(np.maximum(np.maximum(-x, x - 1), 0), axis=1)
    assert found.away.max() == pytest.approx(away.max(), rel=1e-9)


def test_normals_follow_and_points_without_a_place_stay():
    """A sheared plane's normal is F^-T n; NaN stays NaN."""
    F = np.array([[1.0, 0.0, 0.7], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    columns = {"x": [0.5, np.nan], "y": [0.5, 0.0], "z": [0.5, 0.0]}
    columns |= {"nx": [1.0, 1.0], "ny": [0.0, 0.0], "nz": [0.0, 0.0]}
    table = PointTable({name: np.array(v) for name, v in columns.items()})
    frame = moved(table, F)
    wanted = np.linalg.inv(F).T @ [1, 0, 0]
    found = [frame.columns[name][0] for name in ("nx", "ny", "nz")]
    np.testing.assert_allclose(found, wanted / np.linalg.norm(wanted), atol=1e-12)
    assert np.isnan(frame.columns["x"][1])
    assert frame.columns["nx"][1] == 1.0


def test_a_coarse_mesh_carries_a_bend_smoothly():
    """u quadratic in x: every point has it, to what corners' means of G miss at the faces.

    Two tets along a side: linear elements would be off by (h/2)^2 / 2 = .031 of the curvature; the
    mean gradient of a corner on a face is off by h / 2 along it. In the interior it is exact.
    """
    mesh = box_mesh((1.0, 1.0, 1.0), (6, 6, 6))
    H = np.array([[0.2, 0.1, 0.0], [0.1, -0.1, 0.05], [0.0, 0.05, 0.3]])
    bend = lambda x: 0.5 * np.einsum("ni,ij,nj->n", x, H, x)[:, None] * [1.0, 0.5, -0.3]  # noqa: E731
    x = np.random.default_rng(0).uniform(0.35, 0.65, (500, 3))
    now = embed(mesh, x).carried(bend(mesh.points))
    # Corners' means over tets that lie evenly around are exact; Kuhn's tets around one do
    np.testing.assert_allclose(now.positions, x + bend(x), atol=1e-12)
    G = np.einsum("a,nj->naj", [1.0, 0.5, -0.3], x @ H)
    np.testing.assert_allclose(now.gradients, np.eye(3) + G, atol=1e-12)


def test_no_splat_becomes_a_needle():
    """Where a corner is torn off by ten edges; by the gradients of the tets there are some."""
    mesh = box_mesh((1.0, 1.0, 1.0), (6, 6, 6))
    u = np.zeros_like(mesh.points)
    u[np.linalg.norm(mesh.points - 0.5, axis=1).argmin()] = [1.6, 0.0, 0.0]
    table = splats()
    found, shown = embed(mesh, table.positions), Shown(table)
    now = found.carried(u)
    assert now.clamped.any()
    assert np.linalg.svd(now.gradients)[1].max() <= STRETCH * (1 + 1e-9)
    moved = Moved(now.positions, now.gradients @ shown.roots, shown.found.opacity)
    assert not needles(shown, moved).any()
    corners = (mesh.points + u)[mesh.tets[found.tet]], mesh.points[mesh.tets[found.tet]]
    now, rest = ((c[:, 1:] - c[:, :1]).transpose(0, 2, 1) for c in corners)
    rough = moved._replace(roots=now @ np.linalg.inv(rest) @ shown.roots)
    assert needles(shown, rough).sum() > 3


def test_the_mean_of_rotations_is_one():
    """Corners turned by up to a right angle about one axis: orthogonal to 1e-3, proper."""
    turns = np.stack([random_rotation(seed) for seed in range(3)])
    half = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    sources = np.concatenate([turns, turns @ half])
    near, weights = np.array([[0, 3], [1, 4], [2, 2]]), np.array([[0.5, 0.5], [0.9, 0.1], [1, 0]])
    none = np.zeros(3, bool)
    mixing = csr_matrix((weights.ravel(), near.ravel(), np.arange(0, weights.size + 1, 2)), (3, 6))
    R = Carried(np.zeros((3, 3)), sources, mixing, none, np.zeros(6, bool)).rotations
    np.testing.assert_allclose(R @ R.transpose(0, 2, 1), np.tile(np.eye(3), (3, 1, 1)), atol=1e-3)
    np.testing.assert_allclose(R[2], turns[2], atol=1e-9)
    assert (np.linalg.det(R) > 0).all()
