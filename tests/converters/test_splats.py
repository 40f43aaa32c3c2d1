"""Splats of every shape read to their own precision; volumes and opacity against closed forms."""

import gzip
import struct
from itertools import product

import numpy as np
import pytest
from autophyx_tet.converters.points.gaussians import Gaussians, gaussians, standard_columns
from autophyx_tet.converters.points.table import PointTable, read_points, write_points
from autophyx_tet.converters.points.views import opacity_grid
from autophyx_tet.fem.errors import InputError
from autophyx_tet.predictors.grid import Grid
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from . import encoders

# Largest error of position, log scale, cosine of rotation, opacity share, f_dc and harmonics.
CASES = {
    "a.splat": (lambda v: encoders.splat(v), (2e-7, 2e-6, 1e-4, 2e-3, 7.2e-3, None)),
    "v1.spz": (lambda v: encoders.spz(v, 1), (1e-3, 0.032, 5e-3, 2e-3, 0.014, 4e-3)),
    "v2.spz": (lambda v: encoders.spz(v, 2), (1.3e-4, 0.032, 5e-3, 2e-3, 0.014, 4e-3)),
    "v3.spz": (lambda v: encoders.spz(v, 3), (1.3e-4, 0.032, 1e-5, 2e-3, 0.014, 4e-3)),
    "v4.spz": (lambda v: encoders.spz(v, 4), (1.3e-4, 0.032, 1e-5, 2e-3, 0.014, 4e-3)),
    "p.ply": (lambda v: encoders.packed_ply(v), (2.1e-3, 2.1e-3, 1e-5, 2e-3, 7.2e-3, 0.02)),
    "l0.ksplat": (lambda v: encoders.ksplat(v, 0), (2e-7, 2e-6, 1e-6, 2e-3, 7.2e-3, 1e-6)),
    "l1.ksplat": (lambda v: encoders.ksplat(v, 1), (5e-5, 1e-3, 1e-6, 2e-3, 7.2e-3, 5e-4)),
    "l2.ksplat": (lambda v: encoders.ksplat(v, 2), (5e-5, 1e-3, 1e-6, 2e-3, 7.2e-3, 6e-3)),
}
PLAIN = [f"{a}_{i}" for a, n in (("f_dc", 3), ("scale", 3), ("rot", 4)) for i in range(n)]


def test_read_only_formats_to_their_precision(tmp_path):
    """decode(encode(v)) = v within half a quantum of the format, in the order of the file."""
    for name in CASES:
        for k in (0,) if name == "a.splat" else (0, 3, 8, 15):
            assert_precise(name, k, tmp_path)


def assert_precise(name, k, tmp_path):
    """One file of 300 splats with ``k`` harmonics a channel."""
    encode, errors = CASES[name]
    v = encoders.standard(300, k)
    (tmp_path / name).write_bytes(encode(v))
    columns = read_points(tmp_path / name).columns

    def stack(prefix, n):
        return np.stack([columns[f"{prefix}{i}"] for i in range(n)], axis=1).astype(float)

    position, scale, rotation, opacity, colour, harmonics = errors
    np.testing.assert_allclose(
        np.stack([columns[a] for a in "xyz"], 1), v["means"], atol=position, err_msg=name
    )
    np.testing.assert_allclose(stack("scale_", 3), v["log_scales"], atol=scale)
    turned = gaussians(PointTable(columns)).rotations
    cosine = np.abs((turned * v["rotations"]).sum(axis=1))  # of half the angle between the two
    np.testing.assert_allclose(cosine, 1, atol=rotation)
    alpha = 1 / (1 + np.exp(-columns["opacity"].astype(float)))
    np.testing.assert_allclose(alpha, v["opacity"], atol=opacity)
    np.testing.assert_allclose(stack("f_dc_", 3), v["f_dc"], atol=colour)
    if k:
        rest = stack("f_rest_", 3 * k).reshape(-1, 3, k)
        np.testing.assert_allclose(rest, v["f_rest"], atol=harmonics)
    assert ("f_rest_0" in columns) == bool(k), name


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
@settings(
    max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(cut=st.floats(0, 0.99))
def test_cut_splat_files_are_refused(name, cut, tmp_path):
    """A file cut anywhere ends in an InputError (32-byte rows: in one, or in fewer splats)."""
    content = CASES[name][0](encoders.standard(40, 0 if name == "a.splat" else 3))
    path = tmp_path / name
    path.write_bytes(content[: int(cut * len(content))])
    try:
        table = read_points(path)
    except InputError:
        return
    assert name == "a.splat"
    assert len(table) == int(cut * len(content)) // 32


def test_a_splat_bomb_is_refused_by_its_header(tmp_path):
    """4,000,000,000 announced splats in a tiny .spz: an error before any allocation."""
    path = tmp_path / "bomb.spz"
    head = struct.pack("<4sIIBBBB", b"NGSP", 2, 4_000_000_000, 0, 12, 0, 0)
    path.write_bytes(gzip.compress(head + b"\0" * 1000))
    with pytest.raises(InputError, match="4000000000 splats of 19 bytes announced"):
        read_points(path)


def test_plain_ply_of_every_shape_comes_back_bit_exact(tmp_path):
    """SH 0 to 3, with or without normals, with an unknown property in the middle."""
    for k, normals in product((0, 3, 8, 15), (False, True)):
        columns = standard_columns(**encoders.standard(50, k))
        if normals:
            columns |= {name: np.zeros(50, dtype="f4") for name in ("nx", "ny", "nz")}
        columns = {"x": columns["x"], "segment_id": np.arange(50, dtype=np.uint8), **columns}
        write_points(tmp_path / "s.ply", PointTable(columns, ("made by someone",)))
        back = read_points(tmp_path / "s.ply")
        assert list(back.columns) == list(columns)
        assert back.comments == ("made by someone",)
        for name, values in columns.items():
            assert back.columns[name].dtype == values.dtype
            np.testing.assert_array_equal(back.columns[name], values, err_msg=f"{k} {name}")


def one(mean, sigma, rotation=(1.0, 0, 0, 0), opacity=0.7):
    return Gaussians(np.array([mean]), np.array([sigma]), np.array([rotation]), np.array([opacity]))


def test_opacity_weighted_volume():
    """Integral of a exp(-x^T S^-1 x / 2) = a (2 pi)^(3/2) s1 s2 s3."""
    splat = one((0.0, 0, 0), (0.1, 0.2, 0.3))
    expected = 0.7 * (2 * np.pi) ** 1.5 * 0.006
    np.testing.assert_allclose(splat.volumes, expected)
    columns = standard_columns(np.zeros((1, 3)), np.log([[0.1, 0.2, 0.3]]), np.eye(4)[:1],
                               np.array([0.7]), np.zeros((1, 3)))  # fmt: skip
    np.testing.assert_allclose(gaussians(PointTable(columns)).volumes, expected, rtol=1e-6)


def test_opacity_grid_integrates_to_the_volume():
    """Sum of the grid x h^3 = opacity-weighted volume of the widened Gaussian, less its tails."""
    grid = Grid(np.full(3, -2.0), 0.05, (80, 80, 80))
    sigma = np.hypot([0.06, 0.08, 0.1], 0.025)
    inside_three_sigma = 0.970709  # of a Gaussian in 3D: erf(3/sqrt 2) - sqrt(2/pi) 3 exp(-9/2)
    density = opacity_grid(one((0.1, 0.0, -0.1), (0.06, 0.08, 0.1)), grid)
    expected = 0.7 * (2 * np.pi) ** 1.5 * sigma.prod() * inside_three_sigma
    np.testing.assert_allclose(density.sum() * grid.h**3, expected, rtol=2e-3)


def test_opacity_grid_turns_with_the_splat():
    """A quarter turn about z swaps the x and y axes of the grid."""
    grid = Grid(np.full(3, -1.0), 0.1, (20, 20, 20))
    half = 0.5**0.5
    straight = opacity_grid(one((0.0, 0, 0), (0.1, 0.2, 0.3)), grid)
    turned = opacity_grid(one((0.0, 0, 0), (0.1, 0.2, 0.3), (half, 0, 0, half)), grid)
    np.testing.assert_allclose(turned, straight.transpose(1, 0, 2), atol=1e-12)


def test_a_splat_of_absurd_size_is_clamped():
    """Radius 1e6 m reaches eight cells, not the whole grid: no hang."""
    grid = Grid(np.full(3, -1.0), 2 / 64, (64, 64, 64))
    density = opacity_grid(one((0.0, 0, 0), (1e6, 1e6, 1e6)), grid)
    assert 0 < (density > 0).sum() <= 17**3


def test_splats_thinner_than_a_cell_are_still_seen():
    grid = Grid(np.full(3, -1.0), 0.1, (20, 20, 20))
    density = opacity_grid(one((0.033, 0.05, 0.021), (1e-6, 1e-6, 1e-6)), grid)
    assert density.max() > 0.1
