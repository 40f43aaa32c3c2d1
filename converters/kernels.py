# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels that blend splats into a picture, the nearest first: over the pixels of its box."""

import warp as wp  # noqa: TID253 - a kernel module, imported where it is used

wp.set_module_options({"enable_backward": False})

# What is fainter than an eighth bit, and light that is nearly gone, as in 3D Gaussian splatting.
FAINT = wp.constant(1.0 / 255.0)
SPENT = wp.constant(1.0e-4)
DENSEST = wp.constant(0.99)


@wp.kernel
def blend(
    centre: wp.array(dtype=wp.vec2),
    conic: wp.array(dtype=wp.vec3),
    reach: wp.array(dtype=wp.vec2),
    opacity: wp.array(dtype=float),
    colour: wp.array(dtype=wp.vec3),
    image: wp.array2d(dtype=wp.vec4),
):
    """Add splats, sorted by depth, to ``image``: colour, and the light that still comes through."""
    for i in range(centre.shape[0]):
        c = centre[i]
        e = reach[i]
        y0 = wp.max(int(wp.ceil(c[1] - e[1] - 0.5)), 0)
        y1 = wp.min(int(wp.floor(c[1] + e[1] - 0.5)) + 1, image.shape[0])
        x0 = wp.max(int(wp.ceil(c[0] - e[0] - 0.5)), 0)
        x1 = wp.min(int(wp.floor(c[0] + e[0] - 0.5)) + 1, image.shape[1])
        if y0 < y1 and x0 < x1:
            q = conic[i]
            most = opacity[i]
            own = colour[i]
            # Where most exp(-d^T q d / 2) is not faint: between the roots of a parabola in a row.
            level = 2.0 * wp.log(most / FAINT)
            for y in range(y0, y1):
                dy = float(y) + 0.5 - c[1]
                half = q[1] * dy
                inner = half * half - q[0] * (q[2] * dy * dy - level)
                if inner < 0.0:
                    continue
                width = wp.sqrt(inner)
                first = int(wp.ceil(c[0] - (half + width) / q[0] - 0.5))
                last = int(wp.floor(c[0] - (half - width) / q[0] - 0.5))
                for x in range(wp.max(first, x0), wp.min(last + 1, x1)):
                    p = image[y, x]
                    if p[3] > SPENT:
                        dx = float(x) + 0.5 - c[0]
                        power = -0.5 * (q[0] * dx * dx + q[2] * dy * dy) - q[1] * dx * dy
                        a = wp.min(DENSEST, most * wp.exp(power))
                        if a > FAINT:
                            t = p[3] * a
                            image[y, x] = wp.vec4(
                                p[0] + t * own[0], p[1] + t * own[1], p[2] + t * own[2], p[3] - t
                            )


# Warp kernels of pictures on a GPU: splats carried by particles, projected, listed by the square
# tiles that their boxes meet, the nearest first, and blended by a thread a pixel.

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


@wp.kernel
def lookup(volume: wp.uint64, cells: wp.array2d(dtype=wp.int32), out: wp.array(dtype=wp.float32)):
    """Value of a float volume at integer cells."""
    i = wp.tid()
    out[i] = wp.volume_lookup_f(volume, cells[i, 0], cells[i, 1], cells[i, 2])


@wp.kernel
def add_gaussians(
    mean: wp.array(dtype=wp.vec3d),
    whiten: wp.array(dtype=wp.mat33d),
    opacity: wp.array(dtype=wp.float64),
    lower: wp.array(dtype=wp.vec3i),
    upper: wp.array(dtype=wp.vec3i),
    reach: wp.float64,
    density: wp.array3d(dtype=wp.float64),
):
    """Add opacity exp(-|W (x - mean)|^2 / 2) to the cells from lower to upper.

    Lengths are in cells, so that a cell's centre is its index; it ends where |W d| > reach.
    """
    n = wp.tid()
    lo = lower[n]
    hi = upper[n]
    for i in range(lo[0], hi[0] + 1):
        for j in range(lo[1], hi[1] + 1):
            for k in range(lo[2], hi[2] + 1):
                d = wp.vec3d(wp.float64(i), wp.float64(j), wp.float64(k)) - mean[n]
                w = whiten[n] * d
                squared = wp.dot(w, w)
                if squared < reach * reach:
                    value = opacity[n] * wp.exp(-wp.float64(0.5) * squared)
                    wp.atomic_add(density, i, j, k, value)
