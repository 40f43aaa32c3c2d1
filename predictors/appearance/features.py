"""The features of an asset: seen, lifted onto voxels, filled inside; and what its names say.

Pictures are lifted through the volume rendering equation (AutoPhyX 3.1). With the density fixed,
F(r) = sum_i T_i alpha_i Phi(x_i) is linear in the features Phi: a sparse matrix of rays x cells,
solved for all channels at once. A cell that no ray sees has no weight, so that nothing of what
hides it reaches it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, cast

import numpy as np
from jaxtyping import Bool, Float, Int

from ...fem.errors import InputError
from ..asset import Asset, upright
from ..encoders import Encoder, ImageEncoder, TextEncoder, load_encoder
from ..grid import Grid, PartVoxels
from ..text.parts import bare_words
from .surface import gloss_of, opaque_density, random_points, skin_of, surface_voxels
from .views import PIXELS, Camera, Views, hemisphere, render_views

if TYPE_CHECKING:
    from scipy.sparse import csr_array


VIEWS, LOWER = 15, 0  # AutoPhyX 3.3: the upper hemisphere


@dataclass(frozen=True, eq=False)
class VoxelFeatures:
    """Features of the occupied cells of a grid.

    ``cells`` (n, 3) are their indices in C order; ``values`` (n, D) the features, of the nearest
    seen cell where a cell is inside or hidden; ``surface`` and ``seen`` (n,) say which cells those
    are not; ``part`` (n,) indexes ``part_names`` and ``names`` (parts, T), the embedding of what
    the asset calls each part, or None if the encoder reads no words. ``residual`` is the relative
    error with which the seen cells explain the pictures, ``encoder`` who made the features.
    """

    grid: Grid
    cells: Int[np.ndarray, "n 3"]
    values: Float[np.ndarray, "n D"]
    surface: Bool[np.ndarray, "n"]
    seen: Bool[np.ndarray, "n"]
    part: Int[np.ndarray, "n"]
    part_names: tuple[str, ...]
    names: Float[np.ndarray, "parts T"] | None
    residual: float
    encoder: str

    @property
    def occupied(self) -> Bool[np.ndarray, "nx ny nz"]:
        """Which cells of the grid have a feature."""
        out = np.zeros(self.grid.shape, dtype=bool)
        out[tuple(self.cells.T)] = True
        return out

    def arrays(self) -> dict[str, np.ndarray]:
        """Everything as named arrays, values and names in half precision; ``of`` reads them."""
        out = {name: getattr(self, name) for name in ("cells", "surface", "seen", "part")}
        if self.names is not None:
            out["names"] = self.names.astype(np.float16)
        return out | {
            "values": self.values.astype(np.float16),
            "part_names": np.array(self.part_names, dtype=str),
            "origin": self.grid.lo,
            "spacing": np.array(self.grid.h),
            "shape": np.array(self.grid.shape),
            "residual": np.array(self.residual),
            "encoder": np.array(self.encoder),
        }

    @classmethod
    def of(cls, arrays: Mapping[str, np.ndarray]) -> VoxelFeatures:
        """Features from their ``arrays``."""
        nx, ny, nz = (int(n) for n in arrays["shape"])
        names = arrays.get("names")
        return cls(
            grid=Grid(arrays["origin"], float(arrays["spacing"]), (nx, ny, nz)),
            values=arrays["values"].astype(np.float32),
            part_names=tuple(str(name) for name in arrays["part_names"]),
            names=None if names is None else names.astype(np.float32),
            residual=float(arrays["residual"]),
            encoder=str(arrays["encoder"]),
            **{name: arrays[name] for name in ("cells", "surface", "seen", "part")},
        )

    def picture(self) -> Float[np.ndarray, "n 3"]:
        """Colours in [0, 1] of the cells: the first three principal components, for the eye."""
        centered = self.values - self.values.mean(axis=0)
        _, axes = np.linalg.eigh(centered.T @ centered)
        shown = centered @ axes[:, ::-1][:, :3]
        if shown.shape[1] < 3:
            shown = np.repeat(shown[:, :1], 3, axis=1)
        low, high = np.percentile(shown, [2, 98], axis=0)
        return np.clip((shown - low) / np.maximum(high - low, 1e-9), 0, 1)


def features(
    asset: Asset,
    *,
    encoder: ImageEncoder | str = "embedded",
    cells: int = 64,
    views: int = VIEWS,
    lower: int = LOWER,
    pixels: int = PIXELS,
    method: Method = "solve",
) -> VoxelFeatures:
    """Return the features of every cell that an asset occupies.

    Parameters
    ----------
    asset
        The asset, in metres.
    encoder
        Encoder of the pictures, or its name.
    cells
        Cells along the asset's longest side.
    views, lower
        Cameras above and below the horizon.
    pixels
        Side of a picture.
    method
        How features are lifted; see ``lift``.
    """
    encoder = load_encoder(encoder) if isinstance(encoder, str) else encoder
    grid = Grid.around(asset.bounds, cells=cells)
    cameras = hemisphere(asset.bounds, count=views, lower=lower, up=asset.up, pixels=pixels)
    voxels = surface_voxels(asset, grid)
    density = opaque_density(voxels.occupied, grid)
    return features_of_views(
        render_views(asset, cameras), density, grid, encoder=encoder, voxels=voxels, method=method
    )


def features_of_views(
    pictures: Views,
    density: Float[np.ndarray, "nx ny nz"],
    grid: Grid,
    *,
    encoder: ImageEncoder | str = "embedded",
    voxels: PartVoxels | None = None,
    method: Method = "solve",
) -> VoxelFeatures:
    """Return features of a density [1/m] (mesh, cloud, splats, NeRF) seen by given pictures.

    ``voxels`` says which part is in every cell of the surface; None is one part without a name.
    """
    encoder = load_encoder(encoder) if isinstance(encoder, str) else encoder
    seen_by, cover = pictures.cameras, pictures.opacity
    vectors = encoder.dense(pictures.images())
    lifted = lift(vectors, seen_by, density, grid, opacity=cover, method=method)
    surface = density > 0
    if voxels is None:
        voxels = PartVoxels(grid, np.where(surface, 0, -1), ("object",), ((),))
    cells = np.argwhere(fill(surface))
    at = tuple(cells.T)
    row, seen = np.full(grid.shape, -1), np.zeros(grid.shape, dtype=bool)
    row[surface] = np.arange(len(lifted.cells))
    seen[surface] = lifted.seen
    outer = surface[at]
    part = voxels.part[at][nearest_known(cells, outer)]
    source = nearest_known(cells, seen[at], label=part)
    says = isinstance(encoder, Encoder)
    return VoxelFeatures(
        grid=grid,
        cells=cells,
        values=lifted.values[row[at][source]],
        surface=outer,
        seen=seen[at],
        part=part,
        part_names=voxels.part_names,
        names=name_embeddings(voxels.labels, encoder) if says else None,
        residual=lifted.residual,
        encoder=encoder.name,
    )


# What the asset itself says: its node, group and material names as vectors, per part and cell.


def name_embeddings(
    labels: Sequence[Sequence[str]], encoder: Encoder
) -> Float[np.ndarray, "parts dim"]:
    """Unit embedding of everything that is said of each part; 0 for a part without words.

    Names are read as people mean them: "Metal_Chrome.001" as "metal chrome".
    """
    sentences = [" ".join(dict.fromkeys(bare_words(" ".join(part)))) for part in labels]
    known = [number for number, sentence in enumerate(sentences) if sentence]
    out = np.zeros((len(sentences), encoder.dim), dtype=np.float32)
    if known:
        out[known] = encoder.text([sentences[number] for number in known])
    return out


# The inside of a voxelised surface: enclosure, even-odd parity, nearest-surface features.
#
# After AutoPhyX 3.1 and PhysGaussian: a cell is inside where the surface encloses it in the six
# directions of the axes (condition 1), and where rays along all of them cross the surface an odd
# number of times (condition 2). A ray that grazes the surface is miscounted, so the verdicts of all
# empty cells that hang together are pooled where they (nearly) agree.

# Of a connected region's cells with the same verdict so many, from which all of it follows them. In
# between the region leaks (a scan with a hole), and every cell keeps its own verdict.
SETTLED_OUT, SETTLED_IN = 0.2, 0.5


def fill(surface: Bool[np.ndarray, "nx ny nz"]) -> Bool[np.ndarray, "nx ny nz"]:
    """The cells that a surface touches, and those that it encloses."""
    from scipy.ndimage import label

    inside = ~surface
    for axis in range(3):
        for way in (1, -1):
            # How often a ray from each cell enters the surface on its way to infinity
            along = np.moveaxis(surface, axis, 0)[::way]
            entered = np.zeros(along.shape, dtype=np.int32)
            entered[:-1] = along[1:] & ~along[:-1]  # at cell i: the step to i + 1 enters
            count = entered[::-1].cumsum(axis=0, dtype=np.int32)[::-1]
            inside &= np.moveaxis(count[::way], 0, axis) % 2 == 1
    # One verdict for each region of empty cells that share faces; the one that reaches the border
    # of the grid is never inside as a whole.
    region, regions = cast(tuple[np.ndarray, int], label(~surface))
    size = np.bincount(region.ravel(), minlength=regions + 1)
    fraction = np.bincount(region.ravel(), weights=inside.ravel(), minlength=regions + 1)
    fraction = fraction / np.maximum(size, 1)
    border = np.zeros(regions + 1, dtype=bool)
    for axis in range(3):
        for end in (0, -1):
            border[np.unique(region.take(end, axis=axis))] = True
    settled_in, settled_out = (fraction >= SETTLED_IN) & ~border, fraction <= SETTLED_OUT
    leaky = ~settled_in & ~settled_out
    leaky[0] = settled_in[0] = False
    return surface | settled_in[region] | (leaky[region] & inside)


def nearest_known(
    cells: Int[np.ndarray, "n 3"],
    known: Bool[np.ndarray, "n"],
    *,
    label: Int[np.ndarray, "n"] | None = None,
) -> Int[np.ndarray, "n"]:
    """For each cell the row of the nearest one that is known; itself if it is.

    With labels, one of its own label where that label has any, so that a hidden trunk takes after
    the trunk and not after the leaves before it.
    """
    from scipy.spatial import KDTree

    if not known.any():
        raise InputError("features.cell_surface")
    label = np.zeros(len(cells), dtype=np.int64) if label is None else label
    own = np.isin(label, np.unique(label[known]))
    row = np.arange(len(cells))
    for value in [*np.unique(label[own]), None]:
        asking = ~known & (~own if value is None else label == value)
        sources = np.flatnonzero(known & (value is None or label == value))
        if asking.any():
            row[asking] = sources[KDTree(cells[sources]).query(cells[asking])[1]]
    return row


# What is seen of the cells of an asset.

# Opacity and ``surface_colour.Finish`` of what says none.
PLAIN_FINISH = (1.0, 0.0, 0.04, 0.6)


@dataclass(frozen=True, eq=False)
class Appearance:
    """What is seen of the cells: colours in [0, 1] (nx, ny, nz, 3), features (nx, ny, nz, D).

    ``words`` embeds clauses in the space of the features; ``finish`` (nx, ny, nz, 4) are opacity
    and ``surface_colour.Finish`` beside the colours; ``shell`` (nx, ny, nz) numbers the connected
    surfaces of a mesh. Any may be missing.
    """

    colours: np.ndarray | None = None
    features: np.ndarray | None = None
    words: TextEncoder | None = None
    finish: np.ndarray | None = None
    shell: np.ndarray | None = None

    def looks(self, inside: np.ndarray) -> np.ndarray | None:
        """Colour and finish (n, 7) of the cells ``inside``, None where no colour is known."""
        if self.colours is None:
            return None
        colours = self.colours[inside]
        if self.finish is not None:
            return np.concatenate([colours, self.finish[inside]], axis=1)
        return np.concatenate([colours, np.tile(PLAIN_FINISH, (len(colours), 1))], axis=1)


# What is seen of cells: colour, opacity, finish and shell of the surface that is nearest to each.

POINTS = 50_000  # on the surface: ten for each outer cell of a cube of 64
NEAREST = 4  # points of which the mean is taken
WELDED = 1e-5  # of the longest side: corners that are nearer are one


def cell_appearance(
    asset: Asset, centres: Float[np.ndarray, "n 3"], *, turned: bool = False
) -> tuple[Float[np.ndarray, "n 7"], Int[np.ndarray, "n"]]:
    """Return what lies nearest to each centre: how it looks, and its shell.

    Looks are red, green, blue, opacity and ``Finish``. A shell is a connected surface of all parts
    together, from 0, none empty. The centres lie where the asset does, or, ``turned``, where it
    would stand upright.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    rng = np.random.default_rng(0)
    area = sum(float(part.mesh.area) for part in asset.parts)
    corners = np.concatenate([part.mesh.triangles.reshape(-1, 3) for part in asset.parts])
    step = WELDED * float(asset.size.max())
    _, corner = np.unique(np.round(corners / step).astype(np.int64), axis=0, return_inverse=True)
    corner = corner.reshape(-1, 3)
    edges = np.concatenate([corner[:, :2], corner[:, 1:]])
    graph = coo_matrix(
        (np.ones(len(edges), dtype=bool), tuple(edges.T)), shape=(int(corner.max()) + 1,) * 2
    )
    of_face = connected_components(graph, directed=False)[1][corner[:, 0]]
    points, looks, shells, first = [], [], [], 0
    for part in asset.parts:
        count = max(NEAREST, round(POINTS * float(part.mesh.area) / area))
        faces, weights = random_points(part.mesh, count, rng)
        at = np.einsum("nc,nck->nk", weights, part.mesh.triangles[faces])
        points.append(upright(at, asset.up) if turned else at)
        seen = (skin_of(part.mesh)(faces, weights), gloss_of(part.mesh)(faces, weights))
        looks.append(np.concatenate(seen, axis=1))
        shells.append(of_face[first + faces])
        first += len(part.mesh.faces)
    nearest = np.asarray(KDTree(np.concatenate(points)).query(centres, k=NEAREST)[1])
    shell = np.unique(np.concatenate(shells)[nearest[:, 0]], return_inverse=True)[1]
    return np.concatenate(looks)[nearest].mean(axis=1), shell.ravel()


# Pictures of matter on a grid: splats, point clouds and NeRF grids seen without photographs.
#
# Rays are marched through the cells with the transmittance that lifting uses, not rasterised: what
# a picture shows is then exactly what lifting explains, and any carrier that gives a density and a
# colour per cell can be seen. The price is the resolution of the grid.

BARE = 1e-3  # opacity below which a pixel has no colour of its own


def render_grid(
    density: Float[np.ndarray, "nx ny nz"],
    colour: Float[np.ndarray, "nx ny nz 3"],
    grid: Grid,
    cameras: Sequence[Camera] | None = None,
) -> Views:
    """Render cells of a density [1/m] and a colour (sRGB in [0, 1]).

    The default cameras are 15 on the upper hemisphere of the cells that have density.
    """
    cameras = tuple(cameras or hemisphere(matter_bounds(density, grid)))
    shown = colour[density > 0].astype(np.float64)
    colours, covers = [], []
    for camera in cameras:
        directions = camera.directions().reshape(-1, 3)
        origins = np.broadcast_to(camera.position, directions.shape)
        share = ray_weights(Rays(origins, directions, directions), density, grid)
        cover = np.asarray(share.sum(axis=1)).ravel()
        mean = (share @ shown) / np.maximum(cover, BARE)[:, None]
        colours.append((mean * (cover >= BARE)[:, None]).reshape(*camera.size, 3))
        covers.append(cover.reshape(camera.size))
    return Views(
        cameras,
        colour=np.stack(colours).clip(0, 1).astype(np.float32),
        opacity=np.stack(covers).clip(0, 1).astype(np.float32),
    )


def matter_bounds(density: Float[np.ndarray, "nx ny nz"], grid: Grid) -> Float[np.ndarray, "2 3"]:
    """Box [m] around the cells that have density."""
    cells = np.argwhere(density > 0)
    low, high = grid.to_world(cells.min(axis=0)), grid.to_world(cells.max(axis=0))
    return np.stack([low - grid.h / 2, high + grid.h / 2])


Method = Literal["solve", "weighted", "average"]
SPENT = 1e-3  # share of light below which a ray is not followed further
FAINT = 1e-5  # a cell's share of a ray below which it is not stored
MET = 0.1  # a ray that lost less than this share of its light met nothing: not used
SEEN = 0.2  # rays (sum of their shares) that a cell needs to count as seen
# Cells seen less are solved for, since they explain part of what rays met, but their features are
# mostly noise and are not returned; those below this are left out altogether.
GLIMPSED = 1e-3
# Pull towards the weighted average, relative to a cell's own weight: it decides between cells that
# the rays cannot tell apart, and costs less than a per cent of the residual.
PULL = 1e-2
TOLERANCE = 1e-3  # of the normal equations, relative to their right-hand side
MAX_ITERATIONS = 60


class Lifted(NamedTuple):
    """Features on cells.

    ``cells`` (n, 3) are the cells with density, ``values`` (n, D) their features, 0 where not
    seen; ``weight`` (n,) is how many rays' worth of light each sent; ``residual`` is the RMS error
    of the rendered features relative to the RMS feature, over ``rays`` rays, before the features of
    cells that hardly anyone sees were dropped.
    """

    cells: np.ndarray
    values: np.ndarray
    weight: np.ndarray
    residual: float
    rays: int

    @property
    def seen(self) -> np.ndarray:
        """Whether each cell (n,) was seen."""
        return self.weight >= SEEN


class Rays(NamedTuple):
    """What pictures say: origins (n, 3) [m], unit directions (n, 3), features (n, D)."""

    origins: np.ndarray
    directions: np.ndarray
    features: np.ndarray


def lift(
    features: Float[np.ndarray, "views height width D"],
    cameras: Sequence[Camera],
    density: Float[np.ndarray, "nx ny nz"],
    grid: Grid,
    *,
    opacity: Float[np.ndarray, "views rows columns"] | None = None,
    method: Method = "solve",
) -> Lifted:
    """Lift dense features of pictures onto the cells of a grid that have density.

    features: Features of every picture, shape (views, height, width, D), at any resolution.
    cameras: Camera of every picture.
    density: Density [1/m] of every cell.
    grid: The grid.
    opacity: Share of the object in every pixel, shape (views, rows, columns); only rays through
        pixels with at least half are used. None uses all.
    method: ``solve``: least squares; ``weighted``: the average weighted by visibility, its first
        step; ``average``: over all pictures, hidden or not (VoMP; the ablation).
    """
    from scipy.sparse import diags_array

    if density.shape != grid.shape or len(features) != len(cameras):
        given = {"shape": density.shape, "shape_2": grid.shape, "count": len(features)}
        raise InputError("lifting.density_grid", count_2=len(cameras), **given)
    rays = pixel_rays(features, cameras, opacity)
    cells = np.argwhere(density > 0)
    matrix = ray_weights(rays, density, grid)
    met = np.asarray(matrix.sum(axis=1)).ravel() >= MET
    if not met.any():
        raise InputError("lifting.none_rays", count=len(met))
    wanted = rays.features[met].astype(np.float32)
    # Rows of sum 1: the feature of a picture is that of what the ray met.
    matrix = matrix[met]
    scaled: Any = diags_array(1 / np.asarray(matrix.sum(axis=1)).ravel()) @ matrix
    matrix = scaled.tocsr().astype(np.float32)
    weight = np.asarray(matrix.sum(axis=0)).ravel()
    if method == "average":
        # Mean over the pictures of the feature at each point's pixel, hidden or not
        points = grid.to_world(cells)
        height, width = features.shape[1:3]
        total = np.zeros((len(points), features.shape[-1]), dtype=np.float32)
        count = np.zeros((len(points), 1), dtype=np.float32)
        for view, camera in enumerate(cameras):
            x, y, depth = camera.resized(height, width).project(points).T
            inside = (depth > 0) & (x >= 0) & (x < width) & (y >= 0) & (y < height)
            total[inside] += features[view, y[inside].astype(int), x[inside].astype(int)]
            count[inside] += 1
        values = total / np.maximum(count, 1)
    else:
        iterations = MAX_ITERATIONS if method == "solve" else 0
        values = _least_squares(matrix, wanted, iterations=iterations)
    error = matrix @ values - wanted
    residual = float(np.sqrt((error**2).mean() / (wanted**2).mean()))
    if method != "average":
        values[weight < SEEN] = 0
    return Lifted(cells, values, weight, residual, len(wanted))


def pixel_rays(
    features: Float[np.ndarray, "views height width D"],
    cameras: Sequence[Camera],
    opacity: Float[np.ndarray, "views rows columns"] | None,
) -> Rays:
    """One ray through the middle of every feature cell that shows the object."""
    height, width = features.shape[1:3]
    origins, directions, values = [], [], []
    for view, camera in enumerate(cameras):
        shown = np.ones((height, width), dtype=bool)
        if opacity is not None:
            rows = ((np.arange(height) + 0.5) * opacity.shape[1] / height).astype(int)
            columns = ((np.arange(width) + 0.5) * opacity.shape[2] / width).astype(int)
            shown = opacity[view][np.ix_(rows, columns)] >= 0.5
        directions.append(camera.resized(height, width).directions()[shown])
        origins.append(np.broadcast_to(camera.position, directions[-1].shape))
        values.append(features[view][shown])
    return Rays(*map(np.concatenate, (origins, directions, values)))


def ray_weights(rays: Rays, density: Float[np.ndarray, "nx ny nz"], grid: Grid) -> csr_array:
    """Share T_i alpha_i of every cell with density in what each ray sees, rays x cells.

    Cells are walked one by one with their exact path lengths (Amanatides and Woo 1987), all rays
    at once, until a ray leaves the grid or its light is spent.
    """
    from scipy.sparse import csr_array

    column = np.full(grid.shape, -1, dtype=np.int32)
    column[density > 0] = np.arange((density > 0).sum(), dtype=np.int32)
    shape = np.array(grid.shape)
    # Every ray that meets the grid, at the point where it enters: its cell, and the lengths [m] so
    # far, to the next border along each axis, and between two borders
    directions = np.where(np.abs(rays.directions) < 1e-12, 1e-12, rays.directions)  # never parallel
    times = (np.stack([grid.lo, grid.hi])[:, None] - rays.origins) / directions
    here = np.maximum(times.min(axis=0).max(axis=1), 0)
    ray = np.flatnonzero(times.max(axis=0).min(axis=1) > here + np.finfo(float).tiny)
    origin, direction, here = rays.origins[ray], directions[ray], here[ray]
    cell = np.clip(grid.cell_of(origin + here[:, None] * direction), 0, shape - 1)
    step = np.sign(direction).astype(np.int64)
    border = (grid.lo + (cell + (step > 0)) * grid.h - origin) / direction
    border, pitch = np.maximum(border, here[:, None]), grid.h / np.abs(direction)
    light = np.ones(len(ray))
    none = np.zeros(0, dtype=np.int64)
    found: list[tuple[np.ndarray, ...]] = [(none, none.astype(np.int32), none.astype(np.float64))]
    while ray.size:
        axis = border.argmin(axis=1)
        row = np.arange(len(axis))
        leave = border[row, axis]
        at = tuple(cell.T)
        alpha = 1 - np.exp(-density[at] * (leave - here))
        share = light * alpha
        keep = share > FAINT
        found.append((ray[keep], column[at][keep], share[keep]))
        light, here = light * (1 - alpha), leave
        border[row, axis] += pitch[row, axis]
        cell[row, axis] += step[row, axis]
        coordinate = cell[row, axis]
        alive = (light > SPENT) & (coordinate >= 0) & (coordinate < shape[axis])
        if not alive.all():
            walk = (ray, cell, here, border, pitch, step, light)
            ray, cell, here, border, pitch, step, light = (a[alive] for a in walk)
    ray, cell, share = (np.concatenate(group) for group in zip(*found, strict=True))
    size = (len(rays.origins), int(column.max()) + 1)
    return csr_array((share.astype(np.float32), (ray, cell)), shape=size)


def _least_squares(
    matrix: csr_array, wanted: Float[np.ndarray, "rays D"], *, iterations: int
) -> Float[np.ndarray, "cells D"]:
    """Least squares features of the glimpsed cells by conjugate gradients, all channels at once.

    The start is the average weighted by visibility, W^T F / W^T 1, and the system, scaled by
    W^T 1, is (W^T W + pull W^T 1) Phi = W^T F + pull W^T 1 Phi_0.
    """
    weight = np.asarray(matrix.sum(axis=0)).ravel()
    met = weight >= GLIMPSED
    narrow = matrix[:, met].tocsr()
    across = narrow.T.tocsr()
    root = np.sqrt(weight[met]).astype(np.float32)[:, None]

    def normal(x: np.ndarray) -> np.ndarray:
        """Left side of the scaled system: (D^-1/2 W^T W D^-1/2 + pull) x with D = W^T 1."""
        return (across @ (narrow @ (x / root))) / root + np.float32(PULL) * x

    x = (across @ wanted) / root  # of the scaled unknowns root * Phi
    right = x * (1 + PULL)
    residual = right - normal(x)
    direction, square = residual.copy(), (residual**2).sum(axis=0)
    limit = TOLERANCE**2 * (right**2).sum(axis=0)
    for _ in range(iterations):
        if (square <= limit).all():
            break
        image = normal(direction)
        length = square / np.maximum((direction * image).sum(axis=0), np.finfo(np.float32).tiny)
        x += length * direction
        residual -= length * image
        before, square = square, (residual**2).sum(axis=0)
        direction *= square / np.maximum(before, np.finfo(np.float32).tiny)
        direction += residual
    values = np.zeros((len(weight), wanted.shape[1]), dtype=np.float32)
    values[met] = x / root
    return values
