"""The voxel grid: cell-centred, cubic cells, metres. One definition for the whole project."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Shaped

from ..fem.errors import InputError

# More cells than this is a request that no 24 GiB machine should try (2^28 float64 = 2 GiB).
MAX_CELLS = 2**28


@dataclass(frozen=True, eq=False)
class Grid:
    """A grid of cubic cells; the centre of cell ``i`` is ``lo + (i + 1/2) h``.

    Parameters
    ----------
    lo
        Lower corner [m] of cell (0, 0, 0), shape (3,).
    h
        Edge of a cell [m].
    shape
        Cells along x, y, z.
    """

    lo: Float[np.ndarray, "3"]
    h: float
    shape: tuple[int, int, int]

    def __post_init__(self) -> None:
        lo = np.asarray(self.lo, dtype=np.float64)
        shape = tuple(map(int, self.shape))
        if lo.shape != (3,) or not np.isfinite(lo).all():
            raise InputError(f"grid corner must be three finite numbers [m], got {lo}")
        if not (np.isfinite(self.h) and self.h > 0):
            raise InputError(f"grid cell must be > 0 m, got {self.h}")
        if len(shape) != 3 or min(shape) < 1 or np.prod(shape, dtype=np.float64) > MAX_CELLS:
            raise InputError(
                f"grid shape must be three sizes, at most {MAX_CELLS} cells, got {shape}"
            )
        object.__setattr__(self, "lo", lo)
        object.__setattr__(self, "h", float(self.h))
        object.__setattr__(self, "shape", shape)

    @classmethod
    def around(cls, bounds, *, cells: int = 64, pad: int = 1) -> Grid:
        """Return the grid with ``cells`` along the longest side of ``bounds`` (2, 3) [m].

        ``pad`` empty cells are added on every side.
        """
        lo, hi = np.asarray(bounds, dtype=np.float64)
        size = hi - lo
        if not (np.isfinite(size).all() and (size >= 0).all() and size.max() > 0):
            raise InputError(f"bounds must be finite with hi > lo, got {lo} .. {hi}")
        h = size.max() / cells
        counts = np.maximum(np.ceil(size / h - 1e-9), 1).astype(int)  # 1e-9: round-off of size / h
        slack = (counts * h - size) / 2
        nx, ny, nz = (int(n) for n in counts + 2 * pad)
        return cls(lo - slack - pad * h, h, (nx, ny, nz))

    @property
    def hi(self) -> Float[np.ndarray, "3"]:
        """Upper corner [m] of the last cell."""
        return self.lo + np.array(self.shape) * self.h

    def to_world(self, index: Shaped[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
        """World position [m] of a (fractional) cell index; integers give cell centres."""
        return self.lo + (np.asarray(index, dtype=np.float64) + 0.5) * self.h

    def to_index(self, points: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
        """Fractional cell index of world positions [m]; cell centres give integers."""
        return (np.asarray(points, dtype=np.float64) - self.lo) / self.h - 0.5

    def cell_of(self, points: Float[np.ndarray, "*n 3"]) -> Shaped[np.ndarray, "*n 3"]:
        """Integer index of the cell that contains each point [m]; may lie outside the grid."""
        return np.floor((np.asarray(points, dtype=np.float64) - self.lo) / self.h).astype(np.int64)

    def contains(self, cells: Shaped[np.ndarray, "*n 3"]) -> Bool[np.ndarray, "*n"]:
        """Whether integer cell indices lie inside the grid."""
        return np.all((cells >= 0) & (cells < np.array(self.shape)), axis=-1)  # type: ignore

    def centers(self) -> Float[np.ndarray, "nx ny nz 3"]:
        """Centres [m] of all cells."""
        return self.to_world(np.stack(np.meshgrid(*map(np.arange, self.shape), indexing="ij"), -1))
