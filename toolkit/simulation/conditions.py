"""What the options of a simulation state of supports, loads and gravity."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...fem.conditions.boundary_conditions import KINDS, BoundaryConditions, entries
from ...fem.conditions.conditions_file import ConditionsFile, read_conditions
from ...fem.conditions.selection import numbers
from ...fem.errors import UsageError
from ..config import with_given
from ..options import SimulateOptions


def stated_conditions(options: SimulateOptions) -> ConditionsFile:
    """Conditions of the file of ``--scene`` and then of the options, and gravity [m/s^2] if said.

    Raises
    ------
    UsageError
        Where gravity is negative, or a number is none.
    """
    read = ConditionsFile(BoundaryConditions(), None)
    if options.scene is not None:
        read = read_conditions(Path(options.scene))
    both: dict[str, Any] = {
        kind: (*getattr(read.conditions, kind), *getattr(options, kind)) for kind in KINDS
    }
    if options.gravity_dir is not None:
        way = numbers(options.gravity_dir, 3, f"--gravity-dir {options.gravity_dir}")
        both["gravity_dir"] = tuple(way.tolist())
    gravity = read.gravity if options.gravity is None else options.gravity
    if gravity is not None and not gravity >= 0:
        raise UsageError(f"--gravity {gravity:g}: wanted >= 0; --gravity-dir says where it pulls")
    bodies = (*read.bodies, *options.body)
    return ConditionsFile(replace(read.conditions, **both), gravity, bodies)


def changed_options(options: SimulateOptions, given: Mapping[str, Any]) -> SimulateOptions:
    """Return the options with those ``given`` by name, as Python users write them."""
    repeated = (*KINDS, "body", "grain")
    plain = {name: entries(value) if name in repeated else value for name, value in given.items()}
    way = plain.get("gravity_dir")
    if way is not None and not isinstance(way, str):
        plain["gravity_dir"] = ",".join(repr(float(x)) for x in way)
    return with_given(options, plain, verb="simulate")
