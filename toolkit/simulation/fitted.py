"""What a match has found between a soft and a stiff motion: moduli at an alpha in between."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from ...fem.errors import UsageError
from ...fem.matching import MotionFit

# Where nothing is said.
MIDDLE = 0.5


class Moduli(NamedTuple):
    """What E of all cells is multiplied by [1], and their Poisson's ratio [1] where it is known."""

    scale: float
    nu: float | None


def checked_alpha(alpha: float | None, ends: int) -> float:
    """Where between a soft end (0) and a stiff one (1), by default the middle; of one end, 0."""
    if alpha is not None and (ends < 2 or not 0 <= alpha <= 1):
        raise UsageError(
            f"--parameters-alpha {alpha:g}: wanted 0 to 1, with --parameters of `match --to-stiff`"
        )
    return 0.0 if ends < 2 else MIDDLE if alpha is None else alpha


def moduli_between(ends: Sequence[MotionFit], alpha: float | None = None) -> Moduli:
    """Moduli at ``alpha`` between fits to a soft and to a stiff motion: even in log E, and in nu.

    Raises
    ------
    UsageError
        Where there is one end only, or ``alpha`` lies beyond them.
    """
    share = checked_alpha(alpha, len(ends))
    soft, stiff = ends[0], ends[-1]
    scale = float(soft.scale ** (1 - share) * stiff.scale**share)
    if soft.nu is None or stiff.nu is None:
        return Moduli(scale, None)
    return Moduli(scale, (1 - share) * soft.nu + share * stiff.nu)
