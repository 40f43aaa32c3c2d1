"""Further bodies of a scene: meshes beside the first, moved to where they are wanted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from ...fem.conditions.selection import numbers
from ...fem.errors import InputError
from ...fem.scene.mesh import TetMesh, join_meshes
from ..io.body_record import BodyRecord
from ..io.sidecar import read_known


class Bodies(NamedTuple):
    """All bodies as one ``mesh``, and the row of the table that each part is of."""

    mesh: TetMesh
    materials: dict[str, str]


def with_bodies(mesh: TetMesh, materials: Mapping[str, str], entries: Sequence[str]) -> Bodies:
    """Join the meshes of ``entries``, 'FILE' or 'FILE=x,y,z' [m], to ``mesh``.

    Raises
    ------
    InputError
        Where a file is no mesh with a material.
    """
    rows = dict(materials)
    for entry in entries:
        path, equals, place = entry.rpartition("=")
        shift = numbers(place, 3, f"--body {entry}") if equals else numbers("0,0,0", 3, entry)
        other, sidecar, *_ = read_known(path if equals else entry, None)
        if other.material is None:
            raise InputError(f"--body {entry}: it has no E, nu and rho: run `assign` on it first")
        known, before = BodyRecord.of(sidecar).materials, len(mesh.region_names)
        mesh = join_meshes(mesh, other, shift)
        renamed = zip(other.region_names, mesh.region_names[before:], strict=True)
        rows |= {new: known[old] for old, new in renamed if old in known}
    return Bodies(mesh, rows)
