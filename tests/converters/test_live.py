"""Splats that follow particles on a device: as those of a film that is made afterwards."""

import importlib.util
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from autophyx_tet.converters.embedding import bounded
from autophyx_tet.converters.points.gaussians import gaussians, matrices_of
from autophyx_tet.converters.points.table import PointTable
from autophyx_tet.converters.points.views import blended
from autophyx_tet.fem.device import start_warp
from autophyx_tet.fem.mpm.boundaries import grid_around
from autophyx_tet.fem.mpm.particles import Followers, Particles, block_places
from autophyx_tet.fem.mpm.solver import MpmSolver
from autophyx_tet.predictors.appearance.views import ring

_FILE = Path(__file__).resolve().parents[2] / "benchmarks" / "live_splats.py"
_SPEC = importlib.util.spec_from_file_location("live_splats", _FILE)
_LIVE = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(_LIVE)
LiveSplats = _LIVE.LiveSplats
DX = 0.125
DEVICES = ["cpu", *(["cuda"] if start_warp().is_cuda_available() else [])]


def splats(count: int) -> PointTable:
    """Splats of all sizes and colours in a cube of 1 m, some of them nearly clear."""
    rng = np.random.default_rng(0)
    turn = rng.normal(size=(4, count))
    columns = dict(zip("xyz", rng.random((3, count)), strict=True))
    columns |= {f"scale_{i}": rng.normal(-3.5, 0.7, count) for i in range(3)}
    columns |= {f"rot_{i}": turn[i] / np.linalg.norm(turn, axis=0) for i in range(4)}
    columns |= {f"f_dc_{i}": rng.normal(size=count) for i in range(3)}
    return PointTable({**columns, "opacity": rng.normal(1.0, 3.0, count)})


def solver(device: str) -> MpmSolver:
    """A cube that turns and is stretched more than a splat may be, and is soft."""
    x = block_places((0.0,) * 3, (1.0,) * 3, DX)
    spin = np.cross([0.0, 2.0, 4.0], x - 0.5) + np.outer(x[:, 0] - 0.5, [30.0, 0.0, 0.0])
    body = Particles.of(x, (DX / 2) ** 3, E=100.0, nu=0.3, rho=1000.0, velocity=spin)
    room = grid_around([-4.0, -0.5, -0.5], [5.0, 1.5, 1.5], DX)
    return MpmSolver(body, room, device=device, gravity_vector=(0, 0, 0))


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.slow
def test_splats_and_pictures_are_those_of_a_film(device):
    """Places and roots as ``Followers`` and ``bounded`` tell, the picture as ``blended`` does."""
    table, body = splats(400), solver(device)
    rest, found = body.state.x, gaussians(table)
    live = LiveSplats(table, body)
    assert body.advance(0.1)
    live.carry()
    none = np.zeros(len(rest), dtype=int)
    after = Followers.of(found.means, rest, labels=none[:400], parts=none)
    state = body.state
    even = np.sqrt(after.weights_in(state))
    even /= even.sum(axis=1, keepdims=True)
    F, clamped = bounded(state.F)
    assert clamped.any()
    roots = np.einsum("nk,nkij->nij", even, F[after.near])
    roots = roots @ (matrices_of(found.rotations) * found.sigmas[:, None, :])
    # Single precision of places of 5 m, and of weights that are small differences of them
    np.testing.assert_allclose(live.means.numpy(), after.positions(state), atol=2e-5)
    np.testing.assert_allclose(live.roots.numpy(), roots, atol=1e-4 * np.abs(roots).max())

    bounds = np.stack([state.x.min(axis=0), state.x.max(axis=0)])
    camera = ring(bounds, count=3, up="z", pixels=70)[1]  # not a whole number of tiles
    behind = np.random.default_rng(1).random((70, 70, 3))
    colours = live.colour.numpy()
    drawn = blended(live.means.numpy(), live.roots.numpy(), found.opacity, colours, camera, behind)
    picture = live.picture(camera, behind)
    assert 0.02 < np.abs(drawn - behind).mean()
    np.testing.assert_allclose(picture, 255 * drawn, atol=1.0)  # what an eighth bit rounds


def test_a_camera_that_turns_away_sees_what_is_behind():
    """No splat is in its picture, and no tile has an entry."""
    live = LiveSplats(splats(10), solver("cpu"))
    live.carry()
    towards = ring(np.array([[0.0] * 3, [1.0] * 3]), count=1, up="z", pixels=40)[0]
    turned = towards.pose @ np.diag([-1.0, 1.0, -1.0, 1.0])
    grey, camera = np.full((40, 40, 3), 0.6), replace(towards, pose=turned)
    assert not (live.picture(towards, grey) == 153).all()
    assert (live.picture(camera, grey) == 153).all()
