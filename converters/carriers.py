"""Carriers written again with E, nu, rho: splats, point clouds and density grids."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..fem.errors import InputError
from ..fem.mesh import TetMesh
from ..predictors.field import FieldSample, MaterialField, sample_field
from . import npz
from .files import writing
from .grids import DensityGrid, density_losses, read_density, write_density
from .points.gaussians import gaussians
from .points.table import point_losses, read_points, write_points
from .registry import GRID_FORMATS, POINT_FORMATS, Keeps, format_of
from .transfer import field_from_tets

_UNITS = {name: npz.UNITS[name] for name in ("E", "nu", "rho")}


@dataclass(frozen=True)
class Transferred:
    """What a transfer did.

    ``points`` are the splats, points or cells; ``n_fallback`` of them found no voxel around them
    and took the nearest, at most ``max_fallback_distance`` [m] away; ``n_invalid`` have no finite
    position and got NaN. ``volume`` [m^3] and ``mass`` [kg] of splats are weighted by opacity.
    ``lost`` is what the files do not keep of the target.
    """

    files: tuple[Path, ...]
    points: int
    n_fallback: int
    max_fallback_distance: float
    n_invalid: int = 0
    volume: float | None = None
    mass: float | None = None
    lost: tuple[str, ...] = ()


def append_material(
    source: MaterialField | TetMesh,
    target_path: str | os.PathLike,
    out_path: str | os.PathLike,
    *,
    cells: int = 64,
) -> Transferred:
    """Write the target again with E, nu, rho (and part, material where known) appended.

    Every property of the target and its order is kept. A target without room for more columns
    (.splat, .spz, .ksplat, .xyz) is copied to an ``out_path`` of its own suffix, with the values
    in ``STEM.npz`` beside it in the same order; it may also be written as .ply or .npz.

    source: The field; a mesh is first turned into one of ``cells`` voxels along its longest side.
    target_path: Splats, a point cloud or a density grid, in the metres and axes of the source.
    out_path: Where to write.
    """
    field = field_from_tets(source, cells=cells) if isinstance(source, TetMesh) else source
    target_path, out_path = Path(target_path), Path(out_path)
    if is_density(target_path):
        # Values in the cells above the threshold; 0 in empty ones, where there is no material
        grid = read_density(target_path)
        full = grid.density.ravel() > grid.threshold
        sample = sample_field(field, grid.centers()[full])
        arrays = {}
        for name, values in sample_columns(field, sample, real="f4").items():
            array = np.full(grid.density.size, -1 if values.dtype.kind == "i" else 0, values.dtype)
            array[full] = values
            arrays[name] = array.reshape(grid.density.shape)
        written = DensityGrid(
            grid.lo, grid.hi, grid.density, grid.threshold, {**grid.fields, **arrays}
        )
        files = write_density(out_path, written)
        return Transferred(
            tuple(files), int(full.sum()), sample.n_fallback, sample.max_fallback_distance,
            lost=density_losses(out_path, written),
        )  # fmt: skip
    roomless = format_of(out_path, POINT_FORMATS).write is None
    if roomless and target_path.suffix.lower() != out_path.suffix.lower():
        raise InputError(
            "carriers.converted",
            out_path=out_path,
            suffix=target_path.suffix,
            suffix_2=out_path.suffix,
        )
    table = read_points(target_path)
    positions = table.positions
    valid = np.asarray(np.isfinite(positions).all(axis=1))
    sample = sample_field(field, positions[valid])
    columns = {}  # NaN or -1 where a point is not valid
    real = "f4" if table.is_splat else "f8"
    for name, values in sample_columns(field, sample, real=real).items():
        empty = -1 if values.dtype.kind == "i" else np.nan
        columns[name] = np.full(len(valid), empty, dtype=values.dtype)
        columns[name][valid] = values
    # One line of ASCII that says what the columns mean
    names = {"part": field.part_names, "material": field.material_names}
    remark = json.dumps({**_UNITS, **{key: value for key, value in names.items() if value}})
    files, lost = [out_path], []
    if roomless:
        files.append(out_path.with_suffix(".npz"))
        npz.save_npz(files[1], **columns, comments=np.array(remark))
        with writing(out_path) as copy:
            copy.write_bytes(target_path.read_bytes())
    else:
        table = table.with_columns(columns, comment=remark)
        write_points(out_path, table)
        for item in point_losses(out_path, table):
            lost += table.others.names if item is Keeps.OTHERS and table.others else [item]
    volume = mass = None
    if table.is_splat:
        volumes = gaussians(table).volumes[valid]
        volume, mass = float(volumes.sum()), float(volumes @ sample.rho)
    return Transferred(
        tuple(files), len(table), sample.n_fallback, sample.max_fallback_distance,
        int((~valid).sum()), volume, mass, tuple(lost),
    )  # fmt: skip


def is_density(path: Path) -> bool:
    """Whether a path is a density grid; an .npz is one when it says so."""
    suffix = path.suffix.lower()
    if suffix == ".npz":
        return "aabb_min" in npz.load_npz(path)
    if suffix in GRID_FORMATS:
        return True
    if suffix in POINT_FORMATS:
        return False
    known = ", ".join(sorted({*GRID_FORMATS, *POINT_FORMATS}))
    raise InputError("carriers.cannot_transfer", path=path, suffix=suffix, known=known)


def sample_columns(field: MaterialField, sample: FieldSample, *, real: str) -> dict:
    """Columns E, nu, rho of type ``real``, and part, material as int32 where they are known."""
    columns = {name: getattr(sample, name).astype(real) for name in _UNITS}
    for name in ("part", "material"):
        if getattr(sample, name) is not None:
            columns[name] = getattr(sample, name).astype(np.int32)
    return columns
