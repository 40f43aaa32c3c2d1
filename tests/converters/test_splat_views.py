"""The CPU rasteriser: one ellipse exactly, order, colours by direction, what is not there."""

import numpy as np
import pytest
from autophyx_tet.converters.points.film import Shown, Stage, WebP, tracked
from autophyx_tet.converters.points.gaussians import SH_C0, standard_columns
from autophyx_tet.converters.points.table import PointTable
from autophyx_tet.converters.points.views import splat_view
from autophyx_tet.predictors.appearance.views import look_at
from PIL import Image

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
    """What moves along x is seen from y; all of its places are in the picture, and fill it."""
    base = splats([[0.0, 0, 0], [0, 0, 1]], np.full((2, 3), 0.05), [[1.0, 0, 0], [0, 0, 1]])
    way = np.linspace(0, 1, 3)[:, None, None] * [1.0, 0, 0]
    places = base.positions + way
    cameras = tracked(places, base, "z", 5)
    away = cameras[0].position - np.array([0.5, 0.0, 0.5])
    assert abs(away[1]) > 2 * abs(away[0])
    seen = np.stack([cameras[2 * i].project(places[i])[:, :2] / 512 for i in range(3)])
    assert (np.abs(seen - 0.5) < 0.5).all()
    assert np.ptp(seen.reshape(-1, 2), axis=0).max() > 0.7


def test_a_frame_follows_what_travels():
    """A ball that falls by ten of its sizes is as large as one that stands, in every frame."""
    rng = np.random.default_rng(0)
    base = splats(rng.normal(size=(500, 3)) * 0.1, np.full((500, 3), 0.02), np.full((500, 3), 0.3))
    fall = np.linspace(0, 1, 30)[:, None, None] ** 2 * [0, 0, -6.0]
    places = base.positions + fall
    for i, camera in enumerate(tracked(places, base, "z", 30)):
        pixels = camera.project(places[i])[:, :2]
        assert np.ptp(np.quantile(pixels, [0.01, 0.99], axis=0), axis=0).max() > 0.3 * 512
        assert (np.abs(np.median(pixels, axis=0) / 512 - 0.5) < 0.5).all()


def test_a_film_is_whole_after_every_frame_and_goes_on(tmp_path):
    """Frames come back in their colours; what was cut off amid a frame is as it was before it."""
    path = tmp_path / "film.webp"
    colours = [(200, 30, 30), (30, 200, 30), (30, 30, 200), (200, 200, 30)]
    film = WebP(path, (64, 48))
    for i, colour in enumerate(colours[:3], 1):
        film.add(Image.new("RGB", (64, 48), colour))
        with Image.open(path) as seen:
            assert (seen.n_frames, seen.size) == (i, (64, 48))
    whole = path.read_bytes()
    path.write_bytes(whole + b"ANMF\xff\xff\0\0 half of a frame")  # stopped while it was written
    with Image.open(path) as seen:
        assert seen.n_frames == 3
    again = WebP(path, (64, 48))
    assert again.frames == 3
    assert path.read_bytes() == whole
    again.add(Image.new("RGB", (64, 48), colours[3]))
    with Image.open(path) as seen:
        for i, colour in enumerate(colours):
            seen.seek(i)
            shown = np.asarray(seen.convert("RGB")).astype(int)
            assert np.abs(shown - colour).max() < 12  # it is lossy
    assert WebP(path, (32, 32)).frames == 0  # another film begins anew


def test_crumbs_that_fly_do_not_make_the_rest_small():
    """A twentieth of a ball flies far off: the rest is as large as a frame of two diagonals has it.

    A ball as long as it is wide is 1 / sqrt(12) of two diagonals; the rims and the sides that are
    seen of a box of such a frame leave half of that.
    """
    rng = np.random.default_rng(0)
    base = splats(rng.normal(size=(500, 3)) * 0.1, np.full((500, 3), 0.02), np.full((500, 3), 0.3))
    places = np.tile(base.positions, (10, 1, 1))
    places[:, :25] += np.linspace(0, 1, 10)[:, None, None] * rng.normal(size=(25, 3)) * 30.0
    sizes = []
    for camera, now in zip(tracked(places, base, "z", 10), places, strict=True):
        pixels = camera.project(now[25:])[:, :2]
        sizes.append(np.ptp(np.quantile(pixels, [0.01, 0.99], axis=0), axis=0).max() / 512)
    assert min(sizes) > 0.5 / np.sqrt(12)


def test_a_shadow_lies_where_the_sun_puts_it():
    """A ball above the ground darkens it at the foot of its ray, and nothing else."""
    n = 4000
    ball = splats(np.random.default_rng(0).normal(size=(n, 3)) * 0.05 + [0, 0, 0.5],
                  np.full((n, 3), 0.02), np.full((n, 3), 0.5))  # fmt: skip
    shown = Shown(ball)
    stage = Stage(np.array([0, 0, 0.5]), 1.0, "z", 0.0)
    camera = look_at(np.array([0.01, -4.0, 3.0]), np.zeros(3), pixels=256)
    lit = stage.behind(camera, shown.rest()._replace(opacity=np.zeros(n)))
    dark = (lit - stage.behind(camera, shown.rest())).sum(axis=2)
    foot = np.array([0, 0, 0.5]) - 0.5 * stage.sun / stage.sun[2]
    y, x = np.unravel_index(dark.argmax(), dark.shape)
    assert np.linalg.norm(camera.project(foot[None])[0, :2] - [x + 0.5, y + 0.5]) < 10
    assert dark.max() > 0.3
    assert dark.min() > -1e-9
