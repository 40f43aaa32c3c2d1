"""Pictures of Gaussian splats on a CPU: projected ellipses (EWA), sorted by depth, blended.

After Zwicker et al. 2001 and Kerbl et al. 2023, whose rasterisers want CUDA.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ...fem.device import start_warp
from ...fem.errors import NoVolumeError
from ...fem.note import Note
from ...predictors.appearance.views import Camera
from ...predictors.grid import Grid
from ..grids import PAD, shell_surface
from .gaussians import BANDS, COUNTS, SH_C0, Gaussians, band_values, gaussians, matrices_of
from .table import PointTable

if TYPE_CHECKING:
    import trimesh
    from scipy.spatial import KDTree


# Every ellipse is widened by this variance [px^2], so that none falls between the pixels.
WIDENED = 0.3
# Splats nearer than this share of the camera's distance from the origin of depths are left out.
NEAREST = 0.01
# Standard deviations to which an ellipse is drawn: fainter than 1/255 beyond, if it is opaque.
DEVIATIONS = 3.33


class Ellipses(NamedTuple):
    """Splats in a picture, the nearest first.

    ``rows`` of the table, ``centre`` [px] (n, 2), ``conic`` (n, 3) the entries xx, xy, yy of the
    inverse covariance [1/px^2], ``reach`` (n, 2) half sides of the box [px].
    """

    rows: np.ndarray
    centre: np.ndarray
    conic: np.ndarray
    reach: np.ndarray


def splat_view(
    table: PointTable, camera: Camera, *, background: float = 1.0
) -> Float[np.ndarray, "height width 3"]:
    """Picture of splats as a camera sees them.

    Parameters
    ----------
    table
        Gaussian splats [m].
    camera
        Where it stands; ``hemisphere`` of the predictors makes some.
    background
        Grey in [0, 1] where no splat is.

    Returns
    -------
    array
        Red, green and blue in [0, 1], shape (height, width, 3).

    Raises
    ------
    InputError
        Where the table has no splats.
    """
    found = gaussians(table)
    roots = matrices_of(found.rotations) * found.sigmas[:, None, :]
    colours = Look.of(table).seen(found.means - camera.position)
    return blended(found.means, roots, found.opacity, colours, camera, background)


def blended(
    means: Float[np.ndarray, "n 3"],
    roots: Float[np.ndarray, "n 3 3"],
    opacity: Float[np.ndarray, "n"],
    colours: Float[np.ndarray, "n 3"],
    camera: Camera,
    background: float | Float[np.ndarray, "height width 3"] = 1.0,
) -> Float[np.ndarray, "height width 3"]:
    """Picture of splats at ``means`` [m] of covariances A A^T, A the ``roots`` [m].

    ``background`` is a grey, or a picture of what is behind them.
    """
    wp = start_warp()
    from ..kernels import blend

    drawn = _ellipses(means, roots, camera)
    image = np.zeros((*camera.size, 4), dtype=np.float32)
    image[..., 3] = 1.0
    canvas = wp.array(image, dtype=wp.vec4, device="cpu")
    if len(drawn.rows):
        given = [
            wp.array(np.ascontiguousarray(values, dtype=np.float32), dtype=kind, device="cpu")
            for values, kind in (
                (drawn.centre, wp.vec2),
                (drawn.conic, wp.vec3),
                (drawn.reach, wp.vec2),
                (opacity[drawn.rows], float),
                (colours[drawn.rows], wp.vec3),
            )
        ]
        wp.launch(blend, 1, [*given, canvas], device="cpu")
    seen = canvas.numpy().astype(np.float64)
    return np.clip(seen[..., :3] + background * seen[..., 3:], 0.0, 1.0)


def _ellipses(
    means: Float[np.ndarray, "n 3"], roots: Float[np.ndarray, "n 3 3"], camera: Camera
) -> Ellipses:
    """Project: J W Sigma W^T J^T of the camera's axes W and of the perspective's derivative J.

    ``roots`` are A of Sigma = A A^T.
    """
    seen = camera.project(means)
    depth = seen[:, 2]
    finite = np.isfinite(seen).all(axis=1) & np.isfinite(roots).all(axis=(1, 2))
    ahead = depth > NEAREST * np.median(np.abs(depth[finite])) if finite.any() else finite
    rows = np.flatnonzero(finite & ahead)
    rows = rows[np.argsort(depth[rows], kind="stable")]
    # Single precision from here on, as the picture's
    single, seen = (
        roots.astype(np.float32).transpose(1, 2, 0).reshape(3, -1),
        seen.astype(np.float32),
    )
    depth, turned = seen[:, 2], camera.pose[:3, :3].T.astype(np.float32) @ single
    right, above, behind = turned.reshape(3, 3, -1)  # by column of a root, and splat
    (fx, fy), (middle_x, middle_y) = np.array([camera.focal, camera.center], np.float32)
    with np.errstate(all="ignore"):  # of what is not in ``rows``
        across = (fx * right + (seen[:, 0] - middle_x) * behind) / depth
        up = ((seen[:, 1] - middle_y) * behind - fy * above) / depth
        a, c = (across**2).sum(axis=0) + WIDENED, (up**2).sum(axis=0) + WIDENED
        b = (across * up).sum(axis=0)
        conic = np.stack([c, -b, a]) / (a * c - b * b)
        reach = DEVIATIONS * np.sqrt(np.stack([a, c]))
    return Ellipses(rows, seen[rows, :2], conic[:, rows].T, reach[:, rows].T)


class Look(NamedTuple):
    """Colours of splats: ``base`` (n, 3), and harmonics ``rest`` (n, 3, k) above it, if any."""

    base: np.ndarray
    rest: np.ndarray | None

    @classmethod
    def of(cls, table: PointTable) -> Look:
        """Colours of a table; grey where it has none."""
        if "f_dc_0" not in table.columns:
            return cls(np.full((len(table), 3), 0.5), None)
        base = np.stack([np.float64(table.columns[f"f_dc_{i}"]) for i in range(3)], axis=1)
        count = sum(name.startswith("f_rest_") for name in table.columns) // 3
        if count not in COUNTS:
            return cls(0.5 + SH_C0 * base, None)
        rest = np.stack([table.columns[f"f_rest_{i}"] for i in range(3 * count)], axis=1)
        return cls(0.5 + SH_C0 * base, rest.reshape(len(table), 3, count))

    def seen(self, away: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        """Colours in [0, 1] as seen along ``away``, of any length, from the camera."""
        colours, start = self.base, 0
        if self.rest is not None:
            count = self.rest.shape[2]
            away = away / np.linalg.norm(away, axis=1, keepdims=True)
            for degree, width in enumerate(BANDS[: COUNTS.index(count) + 1], 1):
                values = band_values(degree, away)
                band = self.rest[:, :, start : start + width]
                colours = colours + np.einsum("nck,nk->nc", band, values)
                start += width
        return np.clip(colours, 0.0, 1.0)


# Splats as a body: those that are matter, their summed opacity on a grid, and the closed surface
# through them.

REACH = 3.0  # standard deviations at which a Gaussian ends: opacity 1 % of its peak
MAX_REACH = 8  # cells that a Gaussian covers at most on either side: bad fits are clamped
FAINT = 0.1  # opacity below which a splat is no part of a surface
LOOSE = 0.005  # of all opacity: a cloud with less, apart from the others, floats
_MIDDLE = (0.01, 0.99)  # quantiles of the places of splats, between which most of a body lies
_AROUND = 0.5  # of their distance: splats farther outside are strays
# Splats in neighbouring cells hang together: so many times as large as what one covers, and at
# most so many along the longest side.
_LINKED, _COARSE = 2.0, 64
_CUT = 0.2  # of the density at the splats' own centres: low, since a shell has thin places
_FINE = 0.75  # of what a splat covers: cells so large see a rod as thick as that
_WIDE = 90  # percentile of the sizes of splats that cells must hold, unclamped, for a whole shell
_FEWEST, _MOST = 32, 192  # cells along the longest side
_SURFACE = 30_000  # cells that a shell has: some 60,000 triangles, of which a lattice shows a tenth
_NEIGHBOURS, _ASKED = 4, 2_000  # the fourth nearest splat, of so many, tells how far they lie apart


class Pruning(NamedTuple):
    """Least ``opacity`` of a splat, and the box ``crop`` (2, 3) in its file's units, if any."""

    opacity: float = FAINT
    crop: np.ndarray | None = None


class Pruned(NamedTuple):
    """Splats that are matter; how many are too ``faint``, ``outside`` of a crop, or ``loose``.

    The farthest of the loose ones is ``away`` [m] from the middle.
    """

    keep: np.ndarray
    faint: int
    outside: int
    loose: int
    away: float


def pruned(splats: Gaussians, by: Pruning) -> Pruned:
    """Find the splats that are a body: opaque, within the crop, in a cloud with some mass.

    Strays far outside of most splats, and clouds of less than ``LOOSE`` of all opacity, float.
    """
    from scipy.ndimage import label
    from scipy.spatial import KDTree

    means = splats.means
    finite = np.isfinite(means).all(axis=1)
    keep = finite & (splats.opacity > by.opacity)
    faint = int((~keep).sum())
    inside = keep.copy()
    if by.crop is not None:
        inside[keep] = ((means[keep] >= by.crop[0]) & (means[keep] <= by.crop[1])).all(axis=1)
        if keep.any() and not inside.any():
            raise NoVolumeError("views.nothing_within", crop=by.crop.ravel().tolist())
    if not inside.any():
        raise NoVolumeError("views.none_splats", count=len(keep), faint=by.opacity)
    low, high = np.quantile(means[inside], _MIDDLE, axis=0)
    room = _AROUND * (high - low).max()
    near = inside.copy()
    near[inside] = ((means[inside] >= low - room) & (means[inside] <= high + room)).all(axis=1)
    where = means[near]
    bounds = np.stack([where.min(axis=0), where.max(axis=0)])
    covered = _covered(splats.sigmas[near], where, KDTree(where))
    longest = float(np.ptp(bounds, axis=0).max())
    cells = int(np.clip(longest / max(_LINKED * covered, longest / _COARSE), 1, _COARSE))
    grid = Grid.around(bounds, cells=cells)
    cell = tuple(np.clip(grid.cell_of(where), 0, np.array(grid.shape) - 1).T)
    taken = np.zeros(grid.shape, dtype=bool)
    taken[cell] = True
    groups: Any = label  # its stubs know no pair
    cloud = groups(taken, structure=np.ones((3, 3, 3)))[0][cell]
    mass = np.bincount(cloud, weights=splats.opacity[near])
    found = near.copy()
    found[near] = (mass >= LOOSE * mass.sum())[cloud]
    count = [int(some.sum()) for some in (keep, inside, found)]
    away = np.linalg.norm(means[inside & ~found] - np.median(where, axis=0), axis=1)
    far = float(away.max(initial=0))
    return Pruned(found, faint, count[0] - count[1], count[1] - count[2], far)


def splat_body(
    table: PointTable,
    by: Pruning = Pruning(),  # noqa: B008 - a tuple does not change
) -> tuple[trimesh.Trimesh, list[Note]]:
    """Closed surface [m] of the splats that are matter, and notes on those that float."""
    found = pruned(gaussians(table), by)
    kept = PointTable({name: np.asarray(v)[found.keep] for name, v in table.columns.items()})
    told = []
    if found.loose:
        told.append(Note("views.loose", loose=found.loose, count=len(table), away=found.away))
    return splat_surface(kept, least=0.0), told


def splat_surface(
    table: PointTable, *, cells: int | None = None, least: float = FAINT
) -> trimesh.Trimesh:
    """Closed surface [m] through the centres of splats above an opacity, its inside solid.

    The opacity grid of a shell of splats is a ridge. It is cut on its outer side, its inside
    filled, and the cut moved in to the splats: their own places, since in a thin body the ridges
    of both sides are one. By default cells are as large as what a splat covers. Vertices have the
    colour of the splats around.
    """
    from scipy.spatial import KDTree

    splats = gaussians(table)
    keep = (splats.opacity > least) & np.isfinite(splats.means).all(axis=1)
    if not keep.any():
        raise NoVolumeError("views.none_splats", count=len(table), faint=least)
    splats = Gaussians(*(values[keep] for values in splats))
    tree = KDTree(splats.means)
    bounds = np.stack([splats.means.min(axis=0), splats.means.max(axis=0)])
    grid = Grid.around(bounds, cells=cells or _cells(splats, tree), pad=PAD)
    density = opacity_grid(splats, grid)
    here = density[tuple(grid.cell_of(splats.means).T)]
    surface = shell_surface(density, grid, level=_CUT * float(np.median(here)), through=tree)
    if all(f"f_dc_{i}" in table.columns for i in range(3)):
        base = np.stack([table.columns[f"f_dc_{i}"][keep] for i in range(3)], axis=1)
        ranks: Any = np.arange(1, min(_NEIGHBOURS, len(base)) + 1)  # an array keeps the shape
        nearest = np.asarray(tree.query(surface.vertices, k=ranks)[1])
        weight = splats.opacity[nearest]
        mean = np.einsum("nk,nkc->nc", weight, base[nearest]) / weight.sum(axis=1)[:, None]
        colour = np.clip(0.5 + SH_C0 * mean, 0.0, 1.0)
        surface.visual.vertex_colors = (255 * colour).round().astype(np.uint8)  # type: ignore
    return surface


def _cells(splats: Gaussians, tree: KDTree) -> int:
    """Cells along the longest side that are no smaller than splats, nor than the gaps between.

    Nor so small that the larger splats are clamped to ``MAX_REACH`` of them: these would leave
    holes in a shell that they cover. Their number grows with the square, of a shell's surface.
    """
    size = splats.sigmas.max(axis=1)
    covered = _covered(splats.sigmas, splats.means, tree) * _FINE
    covered = max(covered, REACH / MAX_REACH * float(np.percentile(size, _WIDE)))
    longest = float(np.ptp(splats.means, axis=0).max())
    if not covered:
        return _FEWEST
    places = np.floor((splats.means - splats.means.min(axis=0)) * (_COARSE / longest)).astype(int)
    taken = len(np.unique(places, axis=0))
    most = min(_MOST, int(_COARSE * (_SURFACE / taken) ** 0.5))
    return int(np.clip(longest / covered, _FEWEST, max(most, _FEWEST)))


def _covered(sigmas: np.ndarray, means: np.ndarray, tree: KDTree) -> float:
    """Length [m] of what a splat covers, or of the gaps between them where these are wider."""
    nearest = min(_NEIGHBOURS, len(means) - 1)
    ranks: Any = np.array([nearest + 1])
    apart = float(np.median(tree.query(means[:: max(1, len(means) // _ASKED)], k=ranks)[0]))
    return max(apart, float(np.median(sigmas.max(axis=1))))


def opacity_grid(splats: Gaussians, grid: Grid) -> Float[np.ndarray, "nx ny nz"]:
    """Summed opacity at the centre of every cell: sum of opacity exp(-d^T S^-1 d / 2).

    Each Gaussian is widened by half a cell, so that none falls between centres, and ends at three
    standard deviations or ``MAX_REACH`` cells.
    """
    from ..kernels import add_gaussians

    warp = start_warp()
    sigmas = np.clip(np.hypot(splats.sigmas / grid.h, 0.5), None, MAX_REACH / REACH)  # in cells
    axes = matrices_of(splats.rotations)
    means = grid.to_index(splats.means)
    reach = REACH * np.sqrt(np.einsum("nij,nj->ni", axes**2, sigmas**2))  # of the box around each
    lower = np.clip(np.ceil(means - reach), 0, grid.shape)
    upper = np.clip(np.floor(means + reach), -1, np.array(grid.shape) - 1)
    whiten = axes.transpose(0, 2, 1) / sigmas[:, :, None]
    density = warp.zeros(grid.shape, dtype=warp.float64, device="cpu")
    warp.launch(
        add_gaussians,
        len(means),
        [
            warp.array(means, dtype=warp.vec3d, device="cpu"),
            warp.array(whiten, dtype=warp.mat33d, device="cpu"),
            warp.array(splats.opacity, dtype=warp.float64, device="cpu"),
            warp.array(lower.astype(np.int32), dtype=warp.vec3i, device="cpu"),
            warp.array(upper.astype(np.int32), dtype=warp.vec3i, device="cpu"),
            warp.float64(REACH),
        ],
        [density],
        device="cpu",
    )
    return density.numpy()
