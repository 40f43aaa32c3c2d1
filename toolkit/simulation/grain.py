"""The grain of wood in a simulation: which way it is said to run, and who takes it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...fem.conditions.selection import numbers
from ...fem.errors import UsageError
from ...fem.grain import Grained, grained_parts, parts_of_grain, with_grains
from ...fem.scene.mesh import TetMesh, material_of
from ..options import SimulateOptions

METHODS_WITH_GRAIN = ("statics", "modal", "dynamics")


def grained(
    mesh: TetMesh, options: SimulateOptions, materials: Mapping[str, str], *, method: str
) -> Grained:
    """Give the parts of ``mesh`` their grain where the ``method`` knows one, or say so.

    ``materials`` are the rows of the table by part.

    Raises
    ------
    UsageError
        Where ``--grain`` is not understood, or cannot be followed.
    """
    stated = stated_grains(mesh, options.grain)
    if method in METHODS_WITH_GRAIN:
        return with_grains(mesh, materials, stated)
    if stated:
        raise UsageError("--grain: springs, particles and reduced bodies know none")
    note = "wood is taken as stiff across its grain as along it: this method knows no grain"
    known = grained_parts(mesh) or parts_of_grain(materials)
    return Grained(mesh.with_material(material_of(mesh).without_grain()), (note,) if known else ())


def stated_grains(mesh: TetMesh, entries: Sequence[str]) -> dict[str, np.ndarray]:
    """Directions by part of what ``--grain`` says; ``UsageError`` where it is not understood."""
    found = {}
    for entry in entries:
        place, equals, value = entry.rpartition("=")
        kind, _, part = place.strip().partition(":")
        if not equals or kind != "part" or part not in mesh.region_names:
            known = ", ".join(mesh.region_names)
            raise UsageError(f"--grain {entry!r}: wanted part:NAME=x,y,z; parts are {known}")
        found[part] = numbers(value, 3, f"--grain {entry}")
        if not found[part].any():
            raise UsageError(f"--grain {entry!r}: wanted a direction, not zero")
    return found
