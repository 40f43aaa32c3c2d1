"""The cells of a grid inside many boxes at once: what tets and Gaussians reach."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

_PAIRS = 1 << 21  # pairs of a box and a cell at a time: about 200 MB of temporaries


def cell_boxes(
    lower: np.ndarray, upper: np.ndarray, shape: tuple[int, int, int]
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Pairs (box, cell) of every cell whose centre lies in a box, in bounded portions.

    ``lower`` and ``upper`` (n, 3) are fractional cell indices, centres are whole numbers; cells
    outside the grid of ``shape`` are left out.
    """
    lo = np.maximum(np.ceil(lower), 0).astype(np.int64)
    hi = np.minimum(np.floor(upper), np.array(shape) - 1).astype(np.int64)
    counts = np.maximum(hi - lo + 1, 0)
    sizes = counts.prod(axis=1)
    ends = np.cumsum(sizes)
    total = int(ends[-1]) if len(ends) else 0
    for start in range(0, total, _PAIRS):
        pair = np.arange(start, min(start + _PAIRS, total))
        box = np.searchsorted(ends, pair, side="right")
        rest = pair - (ends - sizes)[box]
        ny, nz = counts[box, 1], counts[box, 2]
        yield box, lo[box] + np.stack([rest // (ny * nz), rest // nz % ny, rest % nz], axis=1)
