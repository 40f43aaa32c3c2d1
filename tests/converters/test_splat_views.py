"""The CPU rasteriser: one ellipse exactly, order, colours by direction, what is not there."""

import numpy as np
import pytest
from autophyx_tet.converters.points.gaussians import SH_C0, standard_columns
from autophyx_tet.converters.points.table import PointTable
from autophyx_tet.converters.points.views import chosen_camera, splat_view
from autophyx_tet.predictors.appearance.views import look_at

pytestmark = pytest.mark.slow  # the kernel is compiled once
EYE = look_at(np.array([0.0, -5.0, 0.0]), np.zeros(3), pixels=64)


def splats(means, sigmas, colours, opacity=0.8, rest=None):
    n = len(means)
    turns = np.tile([1.0, 0, 0, 0], (n, 1))
    base = (np.asarray(colours, dtype=float) - 0.5) / SH_C0
    full = np.broadcast_to(opacity, n).astype(float)
    return PointTable(
        standard_columns(np.asarray(means, float), np.log(sigmas), turns, full, base, rest)
    )


def test_one_splat_is_its_ellipse():
    """On the axis: alpha exp(-1/2 d^T (J Sigma J^T + 0.3)^-1 d) over the background, in float32."""
    sigmas = np.array([[0.3, 0.2, 0.1]])
    picture = splat_view(splats([[0.0, 0, 0]], sigmas, [[1.0, 0.5, 0.0]]), EYE)
    px = EYE.focal[0] / 5.0
    variance = (px * sigmas[0, [0, 2]]) ** 2 + 0.3  # seen along y: x across, z up
    d = np.arange(64) + 0.5 - 32
    alpha = 0.8 * np.exp(-0.5 * (d[None, :] ** 2 / variance[0] + d[:, None] ** 2 / variance[1]))
    alpha[alpha <= 1 / 255] = 0
    wanted = alpha[:, :, None] * [1.0, 0.5, 0.0] + (1 - alpha[:, :, None])
    assert np.abs(picture - wanted).max() < 1.1 / 255  # the box ends where it is that faint
    assert np.abs(picture - wanted).mean() < 1e-4


def test_what_is_near_hides_what_is_far_in_any_order():
    near, far = [0.0, -1.0, 0.0], [0.0, 1.0, 0.0]
    sizes, red, blue = np.full((2, 3), 0.3), [1.0, 0, 0], [0.0, 0, 1.0]
    one = splat_view(splats([near, far], sizes, [red, blue], 0.999), EYE)
    two = splat_view(splats([far, near], sizes, [blue, red], 0.999), EYE)
    assert np.array_equal(one, two)
    assert one[32, 32] == pytest.approx([0.99, 0, 0.0099 + 0.0001], abs=2e-3)


def test_harmonics_are_seen_from_where_the_camera_is():
    """The first band's y function: -0.4886 y of the way from the camera, plus or minus."""
    rest = np.zeros((1, 3, 3))
    rest[0, :, 0] = 0.5
    table = splats([[0.0, 0, 0]], np.full((1, 3), 0.4), [[0.5] * 3], 0.99, rest)
    back = look_at(np.array([0.0, 5.0, 0.0]), np.zeros(3), pixels=64)
    share = 0.5 * 0.4886025119029199
    assert splat_view(table, EYE)[32, 32] == pytest.approx([0.5 - share] * 3, abs=0.015)
    assert splat_view(table, back)[32, 32] == pytest.approx([0.5 + share] * 3, abs=0.015)


def test_splats_behind_the_camera_or_lost_are_left_out():
    table = splats([[0, -9.0, 0], [np.nan, 0, 0]], np.full((2, 3), 0.3), [[0.0] * 3] * 2)
    assert (splat_view(table, EYE, background=0.25) == 0.25).all()


def test_the_camera_of_a_film_sees_the_motion():
    """What moves along x is seen from y; all of its places are in the picture."""
    base = splats([[0.0, 0, 0], [0, 0, 1]], np.full((2, 3), 0.05), [[1.0, 0, 0], [0, 0, 1]])
    frames = [base.with_columns({"x": base.columns["x"] + t}) for t in (0.0, 0.5, 1.0)]
    camera = chosen_camera(frames, "z")
    away = camera.position - np.array([0.5, 0.0, 0.5])
    assert abs(away[1]) > 2 * abs(away[0])
    places = np.concatenate([frame.positions for frame in frames])
    seen = camera.project(places)[:, :2] / np.array(camera.size)
    assert (np.abs(seen - 0.5) < 0.5).all()
