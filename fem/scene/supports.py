"""Supports of a body: fixed displacement components, rollers and springs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from ..errors import InputError


@dataclass(frozen=True, eq=False)
class Supports:
    """What holds a body, one row a mesh point (or a node of the P2 space), in x, y, z.

    Parameters
    ----------
    fixed
        True where the displacement component is prescribed, shape (points, 3).
    values
        Prescribed displacement [m] where ``fixed``, shape (points, 3).
    springs
        Stiffness [N/m] of springs to the ground, shape (points, 3).
    assumed
        Share of the body's volume in pieces that touch nothing held, which are held where they
        are because nobody said by what.
    """

    fixed: Bool[np.ndarray, "points 3"]
    values: Float[np.ndarray, "points 3"]
    springs: Float[np.ndarray, "points 3"]
    assumed: float = 0.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.values).all() and np.isfinite(self.springs).all()):
            raise InputError("support values and springs must be finite numbers [m], [N/m]")
        if (self.springs < 0).any():
            raise InputError(f"spring stiffness {self.springs.min():g} N/m: wanted >= 0")

    @classmethod
    def none(cls, points: int) -> Supports:
        """Return no support at all."""
        return cls(np.zeros((points, 3), dtype=bool), np.zeros((points, 3)), np.zeros((points, 3)))

    @classmethod
    def clamp(cls, points: int, ids, values=0.0) -> Supports:
        """All three components of the points ``ids`` (ids or mask) prescribed to ``values`` [m]."""
        return cls.none(points).with_fixed(ids, (0, 1, 2), values)

    def with_fixed(self, ids, axes, values: float | np.ndarray = 0.0) -> Supports:
        """Prescribe components ``axes`` (0, 1, 2 or a tuple) to ``values`` [m] at ``ids``.

        ``values`` are one for all, or of shape (ids, axes).
        """
        fixed, prescribed = self.fixed.copy(), self.values.copy()
        index = np.arange(len(fixed))[ids]
        grid = np.ix_(index, np.atleast_1d(axes))
        fixed[grid] = True
        prescribed[grid] = values
        return replace(self, fixed=fixed, values=prescribed)

    def with_springs(self, ids, stiffness) -> Supports:
        """Add springs of ``stiffness`` [N/m] (scalar, or a value for each axis) at ``ids``."""
        springs = self.springs.copy()
        springs[ids] += stiffness
        return replace(self, springs=springs)
