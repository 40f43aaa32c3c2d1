"""Splats that follow particles on the device of these, and their pictures: a film as it happens."""

from functools import cache
from typing import Any

import numpy as np
import warp as wp
from autophyx_tet.converters.embedding import STRETCH
from autophyx_tet.converters.kernels import DENSEST, FAINT, SPENT
from autophyx_tet.converters.points.gaussians import gaussians, matrices_of
from autophyx_tet.converters.points.table import PointTable
from autophyx_tet.converters.points.views import DEVIATIONS, NEAREST, WIDENED, Look
from autophyx_tet.fem.device import start_warp
from autophyx_tet.fem.mpm.kernels_transfer import types_of
from autophyx_tet.fem.mpm.particles import Followers
from autophyx_tet.fem.mpm.solver import MpmSolver
from autophyx_tet.predictors.appearance.views import Camera
from jaxtyping import Float, UInt8

wp.set_module_options({"enable_backward": False})

# Splats carried by particles, projected, listed by the square tiles that their boxes meet, the
# nearest first, and blended by a thread a pixel.

TILE = wp.constant(16)


@wp.struct
class Follow:
    """Splats at rest and their ``count`` particles each, in rows: numbers, weights, arms [m]."""

    count: int
    near: wp.array(dtype=int)
    weight: wp.array(dtype=float)
    arm: wp.array(dtype=wp.vec3)
    root: wp.array(dtype=wp.mat33)


@wp.struct
class View:
    """A camera: axes of the world in its own, position, focal lengths, middle; least depth."""

    turn: wp.mat33
    position: wp.vec3
    focal: wp.vec2
    middle: wp.vec2
    near: float
    columns: int
    rows: int


@wp.struct
class Drawn:
    """Splats in a picture: centre, entries of the conic and half sides of the box [px], depth."""

    centre: wp.array(dtype=wp.vec2)
    conic: wp.array(dtype=wp.vec3)
    reach: wp.array(dtype=wp.vec2)
    depth: wp.array(dtype=float)


@wp.kernel
def carry(
    follow: Follow,
    x: wp.array(dtype=wp.vec3),
    F: wp.array(dtype=wp.mat33),
    most: float,
    means: wp.array(dtype=wp.vec3),
    roots: wp.array(dtype=wp.mat33),
):
    """Places and roots of splats after particles at ``x`` with gradients ``F``.

    As ``Followers`` has it: a particle that comes off the nearest one as far as it was away from it
    loses its weight. No root is stretched by more than ``most``.
    """
    i = wp.tid()
    start = i * follow.count
    first = follow.near[start]
    total = float(0.0)  # noqa: UP018 (a plain number is a constant to warp)
    even = float(0.0)  # noqa: UP018
    place = wp.vec3()
    G = wp.mat33()
    for k in range(start, start + follow.count):
        j = follow.near[k]
        across = follow.arm[start] - follow.arm[k]
        off = x[j] - x[first] - 0.5 * ((F[first] + F[j]) * across)
        away = wp.length(across)
        opening = wp.length(off) / wp.where(away > 0.0, away, 1.0)
        w = follow.weight[k] * wp.clamp(1.0 - opening, 0.0, 1.0)
        total += w
        place += w * (x[j] + F[j] * follow.arm[k])
        own = F[j]
        if wp.ddot(own, own) > most * most:
            U = wp.mat33()
            S = wp.vec3()
            V = wp.mat33()
            wp.svd3(own, U, S, V)
            own = U * wp.diag(wp.min(S, wp.vec3(most))) * wp.transpose(V)
        even += wp.sqrt(w)
        G += wp.sqrt(w) * own
    means[i] = place / total
    roots[i] = (G / even) * follow.root[i]


@wp.func
def tiles_of(centre: wp.vec2, reach: wp.vec2, view: View):
    """Tiles that a box meets: first and last row, first and last column."""
    side = float(TILE)
    top = wp.clamp(int(wp.floor((centre[1] - reach[1]) / side)), 0, view.rows)
    left = wp.clamp(int(wp.floor((centre[0] - reach[0]) / side)), 0, view.columns)
    bottom = wp.clamp(int(wp.floor((centre[1] + reach[1]) / side)) + 1, top, view.rows)
    right = wp.clamp(int(wp.floor((centre[0] + reach[0]) / side)) + 1, left, view.columns)
    return wp.vec4i(top, bottom, left, right)


@wp.kernel
def project(
    means: wp.array(dtype=wp.vec3),
    roots: wp.array(dtype=wp.mat33),
    view: View,
    widened: float,
    deviations: float,
    drawn: Drawn,
    count: wp.array(dtype=int),
):
    """Ellipses of splats, and how many tiles the box of each meets."""
    i = wp.tid()
    count[i] = 0
    at = view.turn * (means[i] - view.position)
    depth = -at[2]
    A = view.turn * roots[i]
    if not (wp.isfinite(wp.dot(at, at) + wp.ddot(A, A)) and depth > view.near):
        return
    x = view.focal[0] * at[0] / depth
    y = -view.focal[1] * at[1] / depth
    across = wp.vec3()
    up = wp.vec3()
    for k in range(3):
        across[k] = (view.focal[0] * A[0, k] + x * A[2, k]) / depth
        up[k] = (y * A[2, k] - view.focal[1] * A[1, k]) / depth
    a = wp.dot(across, across) + widened
    b = wp.dot(across, up)
    c = wp.dot(up, up) + widened
    inverse = 1.0 / (a * c - b * b)
    centre = view.middle + wp.vec2(x, y)
    reach = deviations * wp.vec2(wp.sqrt(a), wp.sqrt(c))
    drawn.centre[i] = centre
    drawn.conic[i] = wp.vec3(c * inverse, -b * inverse, a * inverse)
    drawn.reach[i] = reach
    drawn.depth[i] = depth
    tiles = tiles_of(centre, reach, view)
    count[i] = (tiles[1] - tiles[0]) * (tiles[3] - tiles[2])


@wp.kernel
def list_tiles(
    drawn: Drawn,
    sums: wp.array(dtype=int),
    view: View,
    keys: wp.array(dtype=wp.int64),
    rows: wp.array(dtype=int),
):
    """Entries of every splat: tile and depth in a key, its row; ``sums`` are of the counts."""
    i = wp.tid()
    slot = int(0)  # noqa: RUF046, UP018
    if i > 0:
        slot = sums[i - 1]
    if sums[i] > slot:
        depth = wp.int64(wp.cast(drawn.depth[i], wp.int32))  # bits of a positive number ascend
        tiles = tiles_of(drawn.centre[i], drawn.reach[i], view)
        for row in range(tiles[0], tiles[1]):
            for column in range(tiles[2], tiles[3]):
                tile = wp.int64(row * view.columns + column)
                keys[slot] = (tile << wp.int64(32)) | depth
                rows[slot] = i
                slot += 1


@wp.kernel
def find_tiles(keys: wp.array(dtype=wp.int64), total: int, first: wp.array(dtype=int)):
    """Where the entries of every tile begin, and after the last one where they end."""
    s = wp.tid()
    tile = int(keys[s] >> wp.int64(32))
    before = int(-1)  # noqa: RUF046, UP018
    if s > 0:
        before = int(keys[s - 1] >> wp.int64(32))
    for t in range(before + 1, tile + 1):
        first[t] = s
    if s == total - 1:
        for t in range(tile + 1, first.shape[0]):
            first[t] = total


@wp.kernel
def blend_tiles(
    drawn: Drawn,
    opacity: wp.array(dtype=float),
    colour: wp.array(dtype=wp.vec3),
    first: wp.array(dtype=int),
    rows: wp.array(dtype=int),
    view: View,
    behind: wp.array2d(dtype=wp.vec3),
    image: wp.array3d(dtype=wp.uint8),
):
    """Blend the splats of its tile before what is ``behind``, a thread a pixel."""
    tile, inner = wp.tid()
    y = (tile // view.columns) * TILE + inner // TILE
    x = (tile % view.columns) * TILE + inner % TILE
    if y >= image.shape[0] or x >= image.shape[1]:
        return
    at = wp.vec2(float(x) + 0.5, float(y) + 0.5)
    light = float(1.0)  # noqa: UP018
    total = wp.vec3()
    for s in range(first[tile], first[tile + 1]):
        if light <= SPENT:
            break
        i = rows[s]
        d = at - drawn.centre[i]
        q = drawn.conic[i]
        power = -0.5 * (q[0] * d[0] * d[0] + q[2] * d[1] * d[1]) - q[1] * d[0] * d[1]
        a = wp.min(DENSEST, opacity[i] * wp.exp(power))
        if a > FAINT:
            total += (light * a) * colour[i]
            light -= light * a
    seen = total + light * behind[y, x]
    for c in range(3):
        image[y, x, c] = wp.uint8(wp.clamp(255.0 * seen[c] + 0.5, 0.0, 255.0))


# Warp kernels on voxels: reading a NanoVDB volume, adding Gaussians to a grid.

wp.set_module_options({"enable_backward": False})


@cache
def tell_kernel(real: Any) -> Any:
    """Kernel that writes a state down: (first, carries, cloud, order, x, F)."""
    Cloud = types_of(real).Cloud

    @wp.kernel(module="unique", enable_backward=False)
    def tell(
        first: int,
        carries: bool,
        cloud: Cloud,
        order: wp.array(dtype=int),
        x: wp.array(dtype=wp.vec3),
        F: wp.array(dtype=wp.mat33),
    ):
        """Places and total gradients in the order of the particles, in single precision."""
        p = first + wp.tid()
        H = cloud.H[p]
        if carries:
            H = cloud.total[p]
        x[order[p]] = wp.vec3(cloud.x[p])
        F[order[p]] = wp.mat33(wp.identity(n=3, dtype=real) + H)

    return tell


class LiveSplats:
    """Splats of a ``table`` that follow the particles of a ``solver``, from where both are now.

    Places, shapes and pictures stay on the solver's device; a finished picture alone leaves it.
    Colours are those without harmonics, which do not turn.

    Parameters
    ----------
    table
        Gaussian splats [m], with finite positions.
    solver
        What moves them.
    """

    def __init__(self, table: PointTable, solver: MpmSolver) -> None:
        start_warp()
        device, found = solver.cloud.device, gaussians(table)
        self.solver, self.device = solver, device
        now, free = solver.state.x, solver.free
        x = np.concatenate([now[free], now[~free]])  # in the order that the solver tells
        labels = np.zeros(len(found.means), dtype=np.int64)
        parts = np.zeros(len(x), dtype=np.int64)
        after = Followers.of(found.means, x, labels=labels, parts=parts)
        roots = matrices_of(found.rotations) * found.sigmas[:, None, :]

        def array(values: np.ndarray, dtype: type) -> Any:
            kind = np.int32 if dtype is int else np.float32
            return wp.array(np.ascontiguousarray(values, kind), dtype=dtype, device=device)

        self.follow = Follow()
        self.follow.count = after.near.shape[1]
        self.follow.near = array(after.near.ravel(), int)
        self.follow.weight = array(after.weights.ravel(), float)
        arms = after.points[:, None] - after.rest[after.near]
        self.follow.arm = array(arms.reshape(-1, 3), wp.vec3)
        self.follow.root = array(roots, wp.mat33)
        self.opacity = array(found.opacity, float)
        self.colour = array(np.clip(Look.of(table).base, 0, 1), wp.vec3)
        self.x = array(x, wp.vec3)
        self.F = array(np.broadcast_to(np.eye(3), (len(x), 3, 3)), wp.mat33)
        count = len(found.means)
        self.means = wp.empty(count, dtype=wp.vec3, device=device)
        self.roots = wp.empty(count, dtype=wp.mat33, device=device)
        self.drawn = Drawn()
        kinds = {"centre": wp.vec2, "conic": wp.vec3, "reach": wp.vec2, "depth": float}
        for name, kind in kinds.items():
            setattr(self.drawn, name, wp.empty(count, dtype=kind, device=device))
        self.sums = wp.empty(count, dtype=int, device=device)
        self._lists = [wp.empty(0, dtype=kind, device=device) for kind in (wp.int64, int)]
        self.behind: tuple[np.ndarray, Any] | None = None
        self.image: Any = None

    def carry(self) -> None:
        """Move the splats to where the particles are."""
        cloud = self.solver.cloud
        for span in cloud.spans:
            inputs = [span.first, span.carries, cloud.struct, cloud._order, self.x, self.F]
            wp.launch(tell_kernel(cloud.real), span.count, inputs, device=self.device)
        inputs = [self.follow, self.x, self.F, STRETCH, self.means, self.roots]
        wp.launch(carry, len(self.means), inputs, device=self.device)

    def picture(
        self, camera: Camera, background: Float[np.ndarray, "height width 3"]
    ) -> UInt8[np.ndarray, "height width 3"]:
        """The splats as ``camera`` sees them, before a ``background`` of colours in [0, 1]."""
        side = int(TILE)
        height, width = camera.size
        if self.behind is None or self.behind[0] is not background:
            values = np.ascontiguousarray(background, dtype=np.float32)
            self.behind = background, wp.array(values, dtype=wp.vec3, device=self.device)
            self.image = wp.empty((height, width, 3), dtype=wp.uint8, device=self.device)
        view = View()
        view.turn = wp.mat33(*camera.pose[:3, :3].T.ravel().tolist())
        view.position = wp.vec3(*camera.position.tolist())
        view.focal, view.middle = wp.vec2(*camera.focal), wp.vec2(*camera.center)
        view.near = NEAREST * float(np.linalg.norm(camera.position))
        view.columns, view.rows = -(-width // side), -(-height // side)
        tiles = view.columns * view.rows

        def launch(kernel: Any, size: int | tuple, *inputs: Any) -> None:
            wp.launch(kernel, size, list(inputs), device=self.device, block_dim=side * side)

        places = (self.means, self.roots, view, WIDENED, DEVIATIONS)
        launch(project, len(self.means), *places, self.drawn, self.sums)
        wp.utils.array_scan(self.sums, self.sums, inclusive=True)
        total = int(self.sums[-1:].numpy()[0])
        if 2 * total > len(self._lists[0]):  # twice as long: radix sort wants room
            kinds = (wp.int64, int)
            self._lists = [wp.empty(3 * total, dtype=t, device=self.device) for t in kinds]
        keys, rows = self._lists
        launch(list_tiles, len(self.means), self.drawn, self.sums, view, keys, rows)
        wp.utils.radix_sort_pairs(keys, rows, total)
        first = wp.zeros(tiles + 1, dtype=int, device=self.device)
        if total:
            launch(find_tiles, total, keys, total, first)
        given = (self.drawn, self.opacity, self.colour, first, rows, view, self.behind[1])
        launch(blend_tiles, (tiles, side * side), *given, self.image)
        return self.image.numpy()
