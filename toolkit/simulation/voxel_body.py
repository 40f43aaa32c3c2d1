"""A body of voxels: fields, and splats or points that carry E, nu and rho, without a mesher."""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...converters.points.table import PointTable
from ...converters.registry import POINT_FORMATS
from ...fem.errors import UsageError
from ...fem.scene.mesh import TetMesh
from ...predictors.field import MaterialField


class VoxelBody(NamedTuple):
    """Tets of voxels, how they came about, and the splats or points that can follow, if any.

    ``materials`` are the rows of the table by part, where a field has them.
    """

    mesh: TetMesh
    notes: tuple[str, ...]
    carrier: Path | None
    materials: dict[str, str]


def voxel_body(path: Path, *, cells: int, scale: float = 1.0) -> VoxelBody | None:
    """Body of a field (.npz), or of splats or points with E, nu, rho; None for other files.

    Splats and points are filled on a grid of ``cells`` along their longest side; their unit is
    ``scale`` metres.
    """
    from ...converters import npz
    from ...converters.field_sources import field_from_points
    from ...converters.particles import tets_of_field
    from ...converters.points.point_file import read_points

    suffix = path.suffix.lower()
    if suffix == ".npz" and path.is_file() and "meta" in npz.load_npz(path):
        found = npz.load(path)
        is_field = isinstance(found, MaterialField)
        return VoxelBody(tets_of_field(found), (), None, rows_of_field(found)) if is_field else None
    if suffix not in POINT_FORMATS or not path.is_file():
        return None
    table = read_points(path)
    if not _has_material(table):
        return None
    places = {name: scale * np.asarray(table.columns[name], dtype=np.float64) for name in "xyz"}
    names = _part_names(table)
    field = field_from_points(table.with_columns(places), cells=cells, part_names=names)
    return VoxelBody(tets_of_field(field), (_filled(field),), path, {})


def rows_of_field(field: MaterialField) -> dict[str, str]:
    """The material that most cells of a part are of, by name of part."""
    if field.part is None or field.material is None:
        return {}
    rows = {}
    for part in np.unique(field.part[field.occupied]):
        own = field.material[field.occupied & (field.part == part)]
        rows[field.part_names[part]] = field.material_names[np.bincount(own).argmax()]
    return rows


def check_particles(path: Path, *, particles: bool) -> None:
    """A body of voxels has a surface in steps: ``UsageError`` where elements would solve it."""
    if not particles:
        raise UsageError(f"{path} is no mesh: --solver mpm makes particles of it, or `convert` it")


def _has_material(table: PointTable) -> bool:
    return all(name in table.columns for name in ("E", "nu", "rho"))


def _part_names(table: PointTable) -> tuple[str, ...]:
    """Names of the parts from the remark that ``transfer`` leaves."""
    for comment in table.comments:
        try:
            known = json.loads(comment)
        except ValueError:
            continue
        if isinstance(known, dict) and "part" in known:
            return tuple(map(str, known["part"]))
    return ()


def _filled(field: MaterialField) -> str:
    from scipy.ndimage import binary_erosion

    solid = np.asarray(field.occupied)
    outer = 1 - binary_erosion(solid).sum() / solid.sum()
    return (
        f"filled: {solid.sum():,} voxels of {field.grid.h:.3g} m; the {outer:.0%} at the surface "
        "are taken as full: mass and thickness may be half of that too large"
    )
