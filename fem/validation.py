"""Checks of given numbers at the border: one line that says what was wanted, not a wrong answer."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float

from .errors import InputError
from .note import Note


def checked_vector(name: str, given: Any, unit: str) -> Float[np.ndarray, "3"]:
    """Return ``given`` as three finite numbers [``unit``]; a scalar is no vector."""
    vector = np.array(given, dtype=np.float64)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise InputError("validation.wanted_three", name=name, given=given, unit=unit)
    return vector


def checked_direction(name: str, given: Any) -> Float[np.ndarray, "3"]:
    """Return ``given`` as a unit vector; ``InputError`` where it has no direction."""
    vector = checked_vector(name, given, "1")
    length = np.linalg.norm(vector)
    if not length > 0:
        raise InputError("validation.wanted_vector", name=name, given=given)
    return vector / length


def checked_number(name: str, given: Any, unit: str, *, least: float = -np.inf) -> float:
    """Return ``given`` as a finite number [``unit``] that is at least ``least``."""
    number = float(given)
    if not (np.isfinite(number) and number >= least):
        finite = Note("validation.finite_number")
        wanted = f"a number >= {least:g}" if np.isfinite(least) else finite
        raise InputError(f"{name} {given:g} {unit}: wanted {wanted}".replace("  ", " "))
    return number


def checked_positive(name: str, given: Any, unit: str) -> float:
    """Return ``given`` as a finite number above zero [``unit``]."""
    number = float(given)
    if not (np.isfinite(number) and number > 0):
        raise InputError(f"{name} {given:g} {unit}: wanted > 0")
    return number


def checked_count(name: str, given: int) -> int:
    """Return ``given`` as a whole number of at least one."""
    if given != int(given) or given < 1:
        raise InputError("validation.wanted_least", name=name, given=given)
    return int(given)


def checked_rows(
    name: str, given: Any, counts: dict[int, str], unit: str
) -> Float[np.ndarray, "rows 3"]:
    """Return ``given`` as finite rows x, y, z; ``counts`` names what so many rows stand for."""
    rows = np.array(given, dtype=np.float64)
    if rows.ndim != 2 or rows.shape[1:] != (3,) or len(rows) not in counts:
        wanted = " or ".join(f"({count}, 3): {what}" for count, what in counts.items())
        raise InputError("validation.shape_wanted", name=name, shape=rows.shape, wanted=wanted)
    bad = np.flatnonzero(~np.isfinite(rows).all(axis=1))
    if bad.size:
        raise InputError(
            "validation.wanted_finite",
            name=name,
            rows=rows[bad[0]],
            unit=unit,
            bad=bad[0],
            size=bad.size,
            count=len(rows),
        )
    return rows
