"""A TOML file of boundary conditions: what `--scene` reads."""

from __future__ import annotations

import difflib
import tomllib
from pathlib import Path
from typing import Any, NamedTuple

from ..errors import InputError, UsageError
from .boundary_conditions import COUNTS, KINDS, BoundaryConditions, entries

SCALARS = ("gravity", "gravity_dir")


class ConditionsFile(NamedTuple):
    """``conditions`` of a file, ``gravity`` [m/s^2] where it says it, and further ``bodies``.

    A body is a mesh file, 'FILE' or 'FILE=x,y,z' with how far it is moved [m].
    """

    conditions: BoundaryConditions
    gravity: float | None
    bodies: tuple[str, ...] = ()


def read_conditions(path: Path) -> ConditionsFile:
    """Read boundary conditions from TOML.

    For example ::

        fix = ["part:handle"]
        obstacle = ["sphere:0,0,1,0.1=0,0,-2"]
        gravity = 1.62
        gravity_dir = [0, 0, -1]
        [load]
        "part:head" = [0, 0, -10]
        [body]
        "anvil.msh" = [0, 0, -0.2]

    Files of bodies are beside this one, or given by their whole path. Every kind is a list of
    entries as on the command line, or a table of numbers by selection.

    Raises
    ------
    InputError
        Where the file cannot be read or is no TOML.
    UsageError
        For a key or a value that is none of ours.
    """
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"cannot read the scene {path}: {error}") from error
    known = (*KINDS, "body", *SCALARS)
    for key in document:
        if key not in known:
            near = difflib.get_close_matches(key, known, n=1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise UsageError(f"{path}: unknown key {key!r}: known are {', '.join(known)}{hint}")
    given: dict[str, Any] = {kind: _entries(path, kind, document) for kind in KINDS}
    gravity, way = document.get("gravity"), document.get("gravity_dir")
    if gravity is not None and not _is_number(gravity):
        raise UsageError(f"{path}: gravity = {gravity!r}, wanted a number [m/s^2]")
    if way is not None:
        if not (isinstance(way, list) and len(way) == 3 and all(map(_is_number, way))):
            raise UsageError(f"{path}: gravity_dir = {way!r}, wanted three numbers")
        given["gravity_dir"] = tuple(map(float, way))
    bodies = tuple(str(path.parent / body) for body in _entries(path, "body", document))
    return ConditionsFile(BoundaryConditions(**given), gravity, bodies)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _entries(path: Path, kind: str, document: dict[str, Any]) -> tuple[str, ...]:
    value = document.get(kind, ())
    words = [value] if isinstance(value, str) else value
    try:
        if isinstance(value, dict) and kind in (*COUNTS, "body"):
            return entries(value)
        if isinstance(words, list | tuple) and all(isinstance(item, str) for item in words):
            return entries(words)
    except (TypeError, ValueError):  # of a table whose values are no numbers
        pass
    wanted = 'a table "SELECTION" = numbers' if kind in COUNTS else "selections"
    raise UsageError(f"{path}: {kind} = {value!r}, wanted a list of strings or {wanted}")
