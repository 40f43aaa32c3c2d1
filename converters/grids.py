"""The density grid of a radiance field.

``density`` is how much light a cell absorbs [1/m], never mass: the mass density of the material is
``rho``.
"""

from __future__ import annotations

import gzip
import logging
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from ..fem.device import start_warp
from ..fem.errors import InputError, NoVolumeError
from ..fem.note import Note
from ..predictors.grid import MAX_CELLS, Grid
from . import npz
from .files import reading, writing
from .registry import GRID_FORMATS, Format, Keeps, format_of, warn_of_losses, written

if TYPE_CHECKING:
    import trimesh
    from scipy.spatial import KDTree


@dataclass(frozen=True, eq=False)
class DensityGrid:
    """Density of a radiance field in the cells of a box, which are not always cubes.

    It is how much light a cell absorbs, never mass.

    Parameters
    ----------
    lo, hi
        Corners of the box [m], shape (3,). The centre of cell ``i`` is
        ``lo + (i + 1/2) (hi - lo) / shape``.
    density
        Density [1/m], shape (nx, ny, nz).
    threshold
        Density [1/m] of the surface.
    fields
        Further arrays of the same shape: E [Pa], nu [1], rho [kg/m^3].

    Raises
    ------
    InputError
        Where the box is none, a density is not finite, or an array has another shape.

    Examples
    --------
    >>> import numpy as np
    >>> from autophyx_tet.converters import DensityGrid
    >>> grid = DensityGrid(np.zeros(3), np.ones(3), np.zeros((2, 2, 2)))
    >>> grid.spacing.tolist(), grid.centers()[0].tolist()  # m
    ([0.5, 0.5, 0.5], [0.25, 0.25, 0.25])
    """

    lo: Float[np.ndarray, "3"]
    hi: Float[np.ndarray, "3"]
    density: Float[np.ndarray, "nx ny nz"]
    threshold: float = 0.0
    fields: Mapping[str, np.ndarray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not (np.isfinite([self.lo, self.hi]).all() and (self.hi > self.lo).all()):
            raise InputError("grids.density_grid", lo=self.lo, hi=self.hi)
        if self.density.size == 0 or self.density.size > MAX_CELLS:
            raise InputError("grids.density_shape", shape=self.density.shape, max_cells=MAX_CELLS)
        if not np.isfinite(self.density).all():
            raise InputError("grids.densities_finite", count=(~np.isfinite(self.density)).sum())
        for name, values in self.fields.items():
            if values.shape != self.density.shape:
                raise InputError(
                    "grids.shape_density", name=name, shape=values.shape, shape_2=self.density.shape
                )

    @property
    def spacing(self) -> Float[np.ndarray, "3"]:
        """Edges [m] of a cell."""
        return (self.hi - self.lo) / self.density.shape

    def centers(self) -> Float[np.ndarray, "n 3"]:
        """Centres [m] of all cells, the last axis fastest, shape (nx ny nz, 3)."""
        axes = [
            low + (np.arange(n) + 0.5) * h
            for low, h, n in zip(self.lo, self.spacing, self.density.shape, strict=True)
        ]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)

    def on_grid(self, grid: Grid) -> Float[np.ndarray, "nx ny nz"]:
        """Density at the centres of a grid of cubes, trilinear, 0 outside the box."""
        from scipy.ndimage import map_coordinates

        index = (grid.centers() - self.lo) / self.spacing - 0.5
        coordinates = np.moveaxis(index, -1, 0)
        inside = ((index >= -0.5) & (index <= np.array(self.density.shape) - 0.5)).all(axis=-1)
        values = map_coordinates(self.density, coordinates, order=1, mode="nearest")
        return np.where(inside, values, 0.0)

    def occupied_box(self) -> Float[np.ndarray, "2 3"]:
        """Lower and upper corner [m] of the box around the cells above the threshold."""
        cells = np.argwhere(self.density > self.threshold)
        if not len(cells):
            raise InputError("grids.cell_density", threshold=self.threshold)
        low, high = cells.min(axis=0), cells.max(axis=0) + 1
        return np.stack([self.lo + low * self.spacing, self.lo + high * self.spacing])


# Our own archive of a density grid, .npz: density, box [m], threshold, further arrays.


def read_density_archive(path: str | os.PathLike) -> DensityGrid:
    """Read the arrays density, aabb_min, aabb_max and, where there, order and threshold."""
    arrays = npz.load_npz(path)
    with reading(path, Note("grids.npz_density")):
        missing = {"density", "aabb_min", "aabb_max"} - arrays.keys()
        if missing:
            raise InputError(f"{path} lacks {sorted(missing)}, got {sorted(arrays)}")
        if str(arrays.pop("order", "xyz")) != "xyz":
            raise InputError("grids.axes_must", path=path)
        return DensityGrid(
            np.asarray(arrays.pop("aabb_min"), dtype=np.float64),
            np.asarray(arrays.pop("aabb_max"), dtype=np.float64),
            arrays.pop("density"),
            float(arrays.pop("threshold", 0.0)),
            arrays,
        )


def write_density_archive(path: Path, grid: DensityGrid) -> list[Path]:
    """Write one file with all arrays."""
    npz.save_npz(
        path, density=grid.density, aabb_min=grid.lo, aabb_max=grid.hi, order=np.array("xyz"),
        threshold=np.array(grid.threshold), **grid.fields,
    )  # fmt: skip
    return [path]


DENSITY_ARCHIVE = Format(
    "own archive",
    (".npz",),
    read_density_archive,
    write_density_archive,
    keeps=frozenset({Keeps.ARRAYS, Keeps.THRESHOLD}),
)


# A density grid's file by its suffix: read and written with all that its format keeps.

log = logging.getLogger(__name__)


def read_density(path: str | os.PathLike) -> DensityGrid:
    """Read a density grid by suffix.

    Parameters
    ----------
    path
        File: .npz, .nvdb, or a checkpoint of nerfacc or Instant-NGP.

    Returns
    -------
    DensityGrid
        Density [1/m] in the cells of a box [m].

    Raises
    ------
    InputError
        Where the suffix is unknown, or the file cannot be read.

    Examples
    --------
    >>> import numpy as np
    >>> from autophyx_tet.converters import DensityGrid, read_density, write_density
    >>> box = DensityGrid(np.zeros(3), np.ones(3), np.full((2, 2, 2), 50.0), threshold=10.0)
    >>> files = write_density("box.npz", box)
    >>> float(read_density("box.npz").density.max())  # 1/m
    50.0
    """
    reader = format_of(path, GRID_FORMATS).read
    if reader is None:
        raise InputError("grids.written_only", path=path, suffix=Path(path).suffix)
    return reader(path)


def write_density(path: str | os.PathLike, grid: DensityGrid) -> list[Path]:
    """Write a grid with its further arrays; what is lost is logged.

    Parameters
    ----------
    path
        File to write: .npz or .nvdb.
    grid
        Density [1/m] in the cells of a box [m].

    Returns
    -------
    list[Path]
        The files.

    Raises
    ------
    InputError
        Where the suffix is unknown or cannot be written.

    Examples
    --------
    >>> import numpy as np
    >>> from autophyx_tet.converters import DensityGrid, read_density, write_density
    >>> cells, rho = np.full((2, 2, 2), 50.0), np.full((2, 2, 2), 700.0)  # 1/m, kg/m^3
    >>> grid = DensityGrid(np.zeros(3), np.ones(3), cells, fields={"rho": rho})
    >>> files = write_density("oak.npz", grid)
    >>> float(read_density("oak.npz").fields["rho"].max())
    700.0
    """
    path = Path(path)
    suffix = path.suffix.lower()
    writer = GRID_FORMATS[suffix].write if suffix in GRID_FORMATS else None
    if writer is None:
        raise InputError(
            "grids.density_grids", path=path, written=" or ".join(written(GRID_FORMATS))
        )
    files = writer(path, grid)
    if lost := density_losses(path, grid):
        log.warning(warn_of_losses(path, GRID_FORMATS[suffix], lost))
    return files


def density_losses(path: str | os.PathLike, grid: DensityGrid) -> tuple[Keeps, ...]:
    """What of the grid a file of that suffix does not keep."""
    given = [Keeps.ARRAYS] * bool(grid.fields) + [Keeps.THRESHOLD] * bool(grid.threshold)
    return format_of(path, GRID_FORMATS).loses(given)


# The density of an instant-ngp snapshot, in the axes of its dataset.

# instant-ngp stores density times its smallest step through the unit cube.
_NGP_STEP = 3**0.5 / 1024
_NGP_THRESHOLD = 0.01  # of that product: instant-ngp's own for an occupied cell
_PIECE = 1 << 20  # bytes unpacked at a time
_MAX_BYTES = 1 << 32  # unpacked snapshot


def read_instant_ngp(path: str | os.PathLike) -> DensityGrid:
    """Read the density of an instant-ngp snapshot, finest cascade, in the axes of its dataset."""
    with reading(path, Note("grids.instant_ngp")) as source:
        import msgpack

        content = source.read_bytes()
        if content[:2] == b"\x1f\x8b":
            with gzip.open(source) as file:  # a read of all would set the whole bound aside
                pieces = iter(partial(file.read, _PIECE), b"")
                content = b"".join(islice(pieces, _MAX_BYTES // _PIECE))
        snapshot = msgpack.unpackb(content, strict_map_key=False)["snapshot"]
        n = int(snapshot["density_grid_size"])
        raw = np.frombuffer(snapshot["density_grid_binary"], dtype="<f2")
        if n < 1 or n & (n - 1) or raw.size < n**3:
            raise InputError("grids.densities_grid", size=raw.size, n=n)
        # Place of cell (x, y, z) in Morton order, x the lowest bit, shape (n, n, n)
        axis = np.arange(n)
        spread = np.zeros(n, dtype=np.int64)
        for bit in range(n.bit_length()):
            spread |= (axis >> bit & 1) << 3 * bit
        cube = raw[
            (spread[:, None, None] | spread[None, :, None] << 1 | spread[None, None, :] << 2)
        ].astype(np.float32) / np.float32(_NGP_STEP)
        dataset = snapshot.get("nerf", {}).get("dataset", {})
        scale, offset = float(dataset.get("scale", 1.0)), np.array(dataset.get("offset", [0.0] * 3))
        # The snapshot's axes are the dataset's y, z, x; its unit cube is scale x + offset.
        return DensityGrid(
            (0.0 - offset) / scale,
            (1.0 - offset) / scale,
            np.ascontiguousarray(cube.transpose(2, 0, 1)) * np.float32(scale),
            threshold=_NGP_THRESHOLD / _NGP_STEP * scale,
        )


INSTANT_NGP = Format("instant-ngp snapshot", (".ingp", ".msgpack"), read_instant_ngp)


# The occupancy of a nerfacc estimator, in a state dict of torch or safetensors.


def read_nerfacc(path: str | os.PathLike) -> DensityGrid:
    """Read the finest level of an estimator's occupancy; of a state dict, tensors only."""
    with reading(path, Note("grids.state_dict")) as source:
        if source.suffix.lower() == ".safetensors":
            from safetensors.torch import load_file

            state = load_file(source)
        else:
            import torch

            state = torch.load(source, map_location="cpu", weights_only=True)
            state = state.get("state_dict", state)
        found = {}
        for want in ("occs", "aabbs", "resolution"):
            names = [name for name in state if name.split(".")[-1] == want]
            if len(names) != 1:
                raise InputError("grids.tensor_named", path=path, want=want, names=names)
            found[want] = state[names[0]].numpy()
        shape = tuple(int(n) for n in found["resolution"].ravel())
        finest = found["occs"].reshape(-1, int(np.prod(shape)))[0].reshape(shape)
        box = found["aabbs"].reshape(-1, 6)[0].astype(np.float64)
        return DensityGrid(box[:3], box[3:], finest)


NERFACC = Format("nerfacc state", (".pt", ".pth", ".ckpt", ".safetensors"), read_nerfacc)


# Closed surfaces where a density falls below a level, their insides solid.

CELLS = 96  # along the longest side
PAD = 4  # empty cells around, for the closing of holes
_HALF = 0.5  # of a radiance field's median density, where it states no threshold
_GAP = 3  # cells: holes of a shell up to twice this wide are bridged, if that encloses something
_BAND = 2.0  # cells about a level in which distances are those to the triangles
_ENCLOSED = 0.9  # of the largest volume that any bridging encloses is as good as all of it
_NEXT = 16  # places of a shell that tell how deep below its outer surface they lie


def density_surface(source: DensityGrid) -> trimesh.Trimesh:
    """Closed surface [m] of a density grid at its threshold, its inside solid."""
    grid = Grid.around(source.occupied_box(), cells=CELLS, pad=PAD)
    level = max(source.threshold, _HALF * float(np.median(source.density[source.density > 0])))
    return isosurface(source.on_grid(grid), grid, level=level)


def isosurface(
    density: Float[np.ndarray, "nx ny nz"], grid: Grid, *, level: float
) -> trimesh.Trimesh:
    """Outer surface [m] where the density falls below ``level``; holes inside are solid."""
    return _cut(density, _solid(density >= level), grid, level)


def shell_surface(
    density: Float[np.ndarray, "nx ny nz"], grid: Grid, *, level: float, through: KDTree
) -> trimesh.Trimesh:
    """Surface [m] as far below the outer one as places [m] lie; what is enclosed is solid.

    A level of the distance and not moved vertices: these would fold where a body is thin. The
    distances of the places that lie next to the outer surface differ, by its bumps and edges; of
    all levels their mean over its area has, to first order, the volume that the places enclose. The
    nearest place alone would be the outermost of a layer that is as rough as captures are.
    """
    import igl
    from scipy.ndimage import distance_transform_edt

    solid = _solid(density >= level)
    outer = _cut(density, solid, grid, level)
    away = np.asarray(distance_transform_edt(np.pad(solid, 1)))[1:-1, 1:-1, 1:-1] * grid.h
    triangles = np.ascontiguousarray(outer.vertices), np.ascontiguousarray(outer.faces)
    places = np.asarray(through.data)
    depth = np.sqrt(igl.point_mesh_squared_distance(places, *triangles)[0])
    ranks: Any = np.arange(1, min(_NEXT, len(places)) + 1)  # an array keeps the shape
    below = float(depth[through.query(triangles[0], k=ranks)[1]].mean())
    near = solid & (np.abs(away - below) < _BAND * grid.h)
    away[near] = np.sqrt(igl.point_mesh_squared_distance(grid.centers()[near], *triangles)[0])
    # A body that is thinner than that all over stays as its cut is.
    return _marched(away, grid, below) if 0 < below < away.max() else outer


def _cut(density: np.ndarray, solid: np.ndarray, grid: Grid, level: float) -> trimesh.Trimesh:
    """Surface of the solid cells, where it is that of the dense ones as the density falls."""
    values = np.where(solid, np.maximum(density, 1.5 * level), np.minimum(density, level))
    values = np.where(density >= level, density, values)  # the cut itself stays between cells
    return _marched(values, grid, level)


def _marched(values: Float[np.ndarray, "nx ny nz"], grid: Grid, level: float) -> trimesh.Trimesh:
    """Where the values pass ``level``, between the cells; closed at the border of the grid."""
    import igl
    import trimesh

    values = np.pad(values, 1)
    outer = Grid(grid.lo - grid.h, grid.h, (values.shape[0], values.shape[1], values.shape[2]))
    order = (2, 1, 0)  # the library counts x fastest
    points = outer.centers().transpose(*order, 3).reshape(-1, 3)
    flat = np.ascontiguousarray(values.transpose(order).ravel())
    nx, ny, nz = values.shape
    vertices, faces = igl.marching_cubes(flat, points, nx, ny, nz, level)[:2]
    if np.size(faces) == 0:
        raise NoVolumeError("grids.surface_largest", max=values.max(), level=level)
    surface = trimesh.Trimesh(vertices, faces, process=True)
    if surface.volume < 0:
        surface.invert()
    return surface


def _solid(dense: np.ndarray) -> np.ndarray:
    """Dense cells and all they enclose, holes bridged no wider than it takes.

    Bridging is to grow, fill and shrink again: closing alone leaves every hole of a thin sheet.
    """
    from scipy.ndimage import binary_dilation, binary_erosion, binary_fill_holes

    dense = np.pad(dense, _GAP + 1)
    tries = [np.asarray(binary_fill_holes(dense))]
    for k in range(1, _GAP + 1):
        grown = binary_fill_holes(binary_dilation(dense, iterations=k))
        tries.append(np.asarray(binary_erosion(grown, iterations=k)) | dense)
    counts = np.array([solid.sum() for solid in tries])
    inner = slice(_GAP + 1, -_GAP - 1)
    return tries[int(np.argmax(counts >= _ENCLOSED * counts.max()))][inner, inner, inner]


# NanoVDB through warp: one file an array, values in float32.


def read_nanovdb(path: str | os.PathLike) -> DensityGrid:
    """Read a float grid over the box of its voxels; its threshold is 0."""
    with reading(path, Note("grids.nanovdb_file")) as source:
        from .kernels import lookup

        warp = start_warp()
        with source.open("rb") as file:
            volume = warp.Volume.load_from_nvdb(file, device="cpu")
        info = volume.get_grid_info()
        if info.type_str != "float":
            raise InputError("grids.holds_grid", path=path, type_str=info.type_str)
        cells = volume.get_voxels()
        values = warp.zeros(len(cells), dtype=warp.float32, device="cpu")
        warp.launch(lookup, len(cells), [volume.id, cells], [values], device="cpu")
        cells, values = cells.numpy(), values.numpy()
        low, shape = cells.min(axis=0), np.ptp(cells, axis=0) + 1
        if np.prod(shape, dtype=np.float64) > MAX_CELLS:
            raise InputError("grids.spans_cells", path=path, shape=shape, max_cells=MAX_CELLS)
        density = np.zeros(shape, dtype=np.float32)
        density[tuple((cells - low).T)] = values
        spacing = np.array([*volume.get_voxel_size()], dtype=np.float64)
        lo = np.array([*info.translation]) + (low - 0.5) * spacing
        return DensityGrid(lo, lo + shape * spacing, density)


def write_nanovdb(path: Path, grid: DensityGrid) -> list[Path]:
    """Write STEM.nvdb of the density and STEM.NAME.nvdb of every further array."""
    arrays = {"": grid.density, **{f".{name}": a for name, a in grid.fields.items()}}
    files = [path.with_name(f"{path.stem}{name}.nvdb") for name in arrays]
    for file, array in zip(files, arrays.values(), strict=True):
        warp = start_warp()
        with writing(file) as target:
            # NanoVDB counts voxel centres: cell (0, 0, 0) sits half a cell inside the box.
            warp.Volume.load_from_numpy(
                np.ascontiguousarray(array, dtype=np.float32),
                tuple((grid.lo + grid.spacing / 2).tolist()),
                tuple(grid.spacing.tolist()),
                0.0,
                device="cpu",
            ).save_to_nvdb(str(target))
    return files


NANOVDB = Format(
    "NanoVDB", (".nvdb",), read_nanovdb, write_nanovdb, keeps=frozenset({Keeps.ARRAYS})
)
