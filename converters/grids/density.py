"""Radiance-field density grids: our .npz contract, NanoVDB, nerfacc, instant-ngp snapshots.

``density`` is how much light a cell absorbs [1/m], never mass: the mass density of the material is
``rho``.
"""

from __future__ import annotations

import gzip
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ...fem.device import start_warp
from ...fem.errors import InputError
from ...predictors.grid import MAX_CELLS, Grid
from .. import npz
from ..files import reading, writing

WANTED = "a density grid"
# instant-ngp stores density times its smallest step through the unit cube.
_NGP_STEP = 3**0.5 / 1024
_NGP_THRESHOLD = 0.01  # of that product: instant-ngp's own for an occupied cell
_PIECE = 1 << 20  # bytes unpacked at a time
_MAX_BYTES = 1 << 32  # unpacked snapshot


@dataclass(frozen=True, eq=False)
class DensityGrid:
    """Density [1/m] in the cells of the box ``lo`` .. ``hi`` [m], cells not always cubes.

    The centre of cell ``i`` is ``lo + (i + 1/2) (hi - lo) / shape``. ``fields`` are further arrays
    of the same shape (E, nu, rho); ``threshold`` is the density of the surface.
    """

    lo: Float[np.ndarray, "3"]
    hi: Float[np.ndarray, "3"]
    density: Float[np.ndarray, "nx ny nz"]
    threshold: float = 0.0
    fields: Mapping[str, np.ndarray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not (np.isfinite([self.lo, self.hi]).all() and (self.hi > self.lo).all()):
            raise InputError(f"a density grid needs a box with hi > lo, got {self.lo} .. {self.hi}")
        if self.density.size == 0 or self.density.size > MAX_CELLS:
            raise InputError(
                f"density of shape {self.density.shape}: 1 to {MAX_CELLS} cells wanted"
            )
        if not np.isfinite(self.density).all():
            raise InputError(f"{(~np.isfinite(self.density)).sum()} densities are not finite")
        for name, values in self.fields.items():
            if values.shape != self.density.shape:
                raise InputError(
                    f"{name} has shape {values.shape}, density {self.density.shape}: one a cell"
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
            raise InputError(f"no cell has a density above {self.threshold:g}")
        low, high = cells.min(axis=0), cells.max(axis=0) + 1
        return np.stack([self.lo + low * self.spacing, self.lo + high * self.spacing])


class DensityFormat(NamedTuple):
    """Reader of a density format."""

    title: str
    read: Callable[[str | os.PathLike], DensityGrid]


def read_density(path: str | os.PathLike) -> DensityGrid:
    """Read a density grid by suffix."""
    suffix = Path(path).suffix.lower()
    if suffix not in FORMATS:
        known = ", ".join(f"{s} ({f.title})" for s, f in FORMATS.items())
        raise InputError(f"{path}: unknown density suffix {suffix!r}; known are {known}")
    return FORMATS[suffix].read(path)


def write_density(path: str | os.PathLike, grid: DensityGrid) -> list[Path]:
    """Write .npz (one file with all fields) or .nvdb (one file an array: STEM.E.nvdb ...)."""
    path = Path(path)
    if path.suffix.lower() == ".npz":
        npz.save_npz(
            path, density=grid.density, aabb_min=grid.lo, aabb_max=grid.hi, order=np.array("xyz"),
            threshold=np.array(grid.threshold), **grid.fields,
        )  # fmt: skip
        return [path]
    if path.suffix.lower() == ".nvdb":
        arrays = {"": grid.density, **{f".{name}": a for name, a in grid.fields.items()}}
        files = [path.with_name(f"{path.stem}{name}.nvdb") for name in arrays]
        for file, array in zip(files, arrays.values(), strict=True):
            _write_nvdb(file, grid, array)
        return files
    raise InputError(f"{path}: density grids are written as .npz or .nvdb")


def _read_npz(path: str | os.PathLike) -> DensityGrid:
    arrays = npz.load_npz(path)
    with reading(path, "an .npz with density, aabb_min, aabb_max"):
        missing = {"density", "aabb_min", "aabb_max"} - arrays.keys()
        if missing:
            raise InputError(f"{path} lacks {sorted(missing)}, got {sorted(arrays)}")
        if str(arrays.pop("order", "xyz")) != "xyz":
            raise InputError(f"{path}: axes must be in the order 'xyz'")
        return DensityGrid(
            np.asarray(arrays.pop("aabb_min"), dtype=np.float64),
            np.asarray(arrays.pop("aabb_max"), dtype=np.float64),
            arrays.pop("density"),
            float(arrays.pop("threshold", 0.0)),
            arrays,
        )


def _write_nvdb(path: Path, grid: DensityGrid, array: np.ndarray) -> None:
    warp = start_warp()
    with writing(path) as target:
        # NanoVDB counts voxel centres: cell (0, 0, 0) sits half a cell inside the box.
        warp.Volume.load_from_numpy(
            np.ascontiguousarray(array, dtype=np.float32),
            tuple((grid.lo + grid.spacing / 2).tolist()),
            tuple(grid.spacing.tolist()),
            0.0,
            device="cpu",
        ).save_to_nvdb(str(target))


def _read_nvdb(path: str | os.PathLike) -> DensityGrid:
    with reading(path, "a NanoVDB file with a float grid") as source:
        from .kernels_volume import lookup

        warp = start_warp()
        with source.open("rb") as file:
            volume = warp.Volume.load_from_nvdb(file, device="cpu")
        info = volume.get_grid_info()
        if info.type_str != "float":
            raise InputError(f"{path} holds a grid of {info.type_str}, wanted float")
        cells = volume.get_voxels()
        values = warp.zeros(len(cells), dtype=warp.float32, device="cpu")
        warp.launch(lookup, len(cells), [volume.id, cells], [values], device="cpu")
        cells, values = cells.numpy(), values.numpy()
        low, shape = cells.min(axis=0), np.ptp(cells, axis=0) + 1
        if np.prod(shape, dtype=np.float64) > MAX_CELLS:
            raise InputError(f"{path} spans {shape} cells, at most {MAX_CELLS} in all are taken")
        density = np.zeros(shape, dtype=np.float32)
        density[tuple((cells - low).T)] = values
        spacing = np.array([*volume.get_voxel_size()], dtype=np.float64)
        lo = np.array([*info.translation]) + (low - 0.5) * spacing
        return DensityGrid(lo, lo + shape * spacing, density)


def _read_nerfacc(path: str | os.PathLike) -> DensityGrid:
    """Occupancy of a nerfacc estimator, finest level, from a state dict (tensors only)."""
    with reading(path, "a state dict with nerfacc's occs, aabbs and resolution") as source:
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
                raise InputError(f"{path}: one tensor named {want} wanted, got {names}")
            found[want] = state[names[0]].numpy()
        shape = tuple(int(n) for n in found["resolution"].ravel())
        finest = found["occs"].reshape(-1, int(np.prod(shape)))[0].reshape(shape)
        box = found["aabbs"].reshape(-1, 6)[0].astype(np.float64)
        return DensityGrid(box[:3], box[3:], finest)


def _read_ngp(path: str | os.PathLike) -> DensityGrid:
    """Density of an instant-ngp snapshot, finest cascade, in the axes of its dataset."""
    with reading(path, "an instant-ngp snapshot (.ingp, .msgpack)") as source:
        try:
            import msgpack
        except ImportError as error:
            raise InputError("snapshots need msgpack: pip install 'autophyx-tet[nerf]'") from error
        content = source.read_bytes()
        if content[:2] == b"\x1f\x8b":
            with gzip.open(source) as file:  # a read of all would set the whole bound aside
                pieces = iter(partial(file.read, _PIECE), b"")
                content = b"".join(islice(pieces, _MAX_BYTES // _PIECE))
        snapshot = msgpack.unpackb(content, strict_map_key=False)["snapshot"]
        n = int(snapshot["density_grid_size"])
        raw = np.frombuffer(snapshot["density_grid_binary"], dtype="<f2")
        if n < 1 or n & (n - 1) or raw.size < n**3:
            raise InputError(f"{raw.size} densities of a grid of {n}^3; wanted a power of two")
        cube = raw[_morton(n)].astype(np.float32) / np.float32(_NGP_STEP)
        dataset = snapshot.get("nerf", {}).get("dataset", {})
        scale, offset = float(dataset.get("scale", 1.0)), np.array(dataset.get("offset", [0.0] * 3))
        # The snapshot's axes are the dataset's y, z, x; its unit cube is scale x + offset.
        return DensityGrid(
            (0.0 - offset) / scale,
            (1.0 - offset) / scale,
            np.ascontiguousarray(cube.transpose(2, 0, 1)) * np.float32(scale),
            threshold=_NGP_THRESHOLD / _NGP_STEP * scale,
        )


def _morton(n: int) -> np.ndarray:
    """Place of cell (x, y, z) in Morton order, x the lowest bit, shape (n, n, n)."""
    axis = np.arange(n)
    spread = np.zeros(n, dtype=np.int64)
    for bit in range(n.bit_length()):
        spread |= (axis >> bit & 1) << 3 * bit
    return spread[:, None, None] | spread[None, :, None] << 1 | spread[None, None, :] << 2


FORMATS: dict[str, DensityFormat] = {
    ".npz": DensityFormat("own archive", _read_npz),
    ".nvdb": DensityFormat("NanoVDB", _read_nvdb),
    ".pt": DensityFormat("nerfacc state", _read_nerfacc),
    ".pth": DensityFormat("nerfacc state", _read_nerfacc),
    ".ckpt": DensityFormat("nerfacc state", _read_nerfacc),
    ".safetensors": DensityFormat("nerfacc state", _read_nerfacc),
    ".ingp": DensityFormat("instant-ngp snapshot", _read_ngp),
    ".msgpack": DensityFormat("instant-ngp snapshot", _read_ngp),
}
