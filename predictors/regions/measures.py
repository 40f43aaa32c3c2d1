"""What is measured of a region: colour, finish, size, place, thickness, symmetry, contacts."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ..matter import FEATURES, measure

# Beside those of ``matter.measure``; lengths over the longest side of the whole.
MEASURES = (
    *FEATURES, "own width", "own depth", "own height", "x offset", "y offset",
    "mean radius", "outer contact", "inner contact", "mirror x", "mirror y",
    "upright axis", "flat axis", "log copies", "log contact", "neighbours", "log whole fill",
    "log slenderness x", "log slenderness y", "log slenderness z",
)  # fmt: skip
_COPY = 0.15  # of the logarithm of sizes that differ by less, two regions are copies
_FACES = 5.0  # what brings logarithms of faces, and numbers of neighbours, near 1


class Measured(NamedTuple):
    """``values`` (regions, measures), and ``contact`` (regions, regions): common faces of cells."""

    values: np.ndarray
    contact: np.ndarray


def measured(
    cells: Int[np.ndarray, "n 3"], looks: Float[np.ndarray, "n look"], region: Int[np.ndarray, "n"]
) -> Measured:
    """Measure the regions of a thing.

    cells: Indices of its cells on an upright grid.
    looks: As ``matter.measure`` takes them.
    region: The region of each cell, from 0, none empty.
    """
    count, low, high = int(region.max()) + 1, cells.min(axis=0), cells.max(axis=0) + 1
    sides, longest = high - low, float((high - low).max())
    box = np.full(sides + 2, count)  # outside is a region too
    box[tuple((cells - low + 1).T)] = region
    touch = np.zeros((count + 1, count + 1))
    for axis in range(3):
        a, b = (np.moveaxis(box, axis, 0)[part] for part in (slice(1, None), slice(None, -1)))
        np.add.at(touch, (a[a != b], b[a != b]), 1)
    touch += touch.T
    size = np.bincount(region, minlength=count)
    whole = [np.log(len(cells) / np.prod(sides)), *np.log(sides / longest)]
    rows = []
    for k in range(count):
        own = cells[region == k]
        place = (own + 0.5 - (low + high) / 2) / longest
        spread = place - place.mean(axis=0)
        # 1e-5: as in ``matter.measure``
        axes = np.linalg.eigh(spread.T @ spread / len(own) + 1e-5 * np.eye(3))[1]
        mirrored = []
        for axis in range(2):
            across = own - low + 1
            across[:, axis] = sides[axis] + 1 - across[:, axis]
            mirrored.append((box[tuple(across.T)] == k).mean())
        outer, inner = touch[k, count], touch[k, :count].sum()
        rows.append([
            *((np.ptp(own, axis=0) + 1) / longest), *np.abs(place[:, :2].mean(axis=0)),
            np.hypot(*place[:, :2].T).mean(), outer / (outer + inner), inner / (outer + inner),
            *mirrored, abs(axes[2, 2]), abs(axes[2, 0]),
            np.log((np.abs(np.log(size / size[k])) < _COPY).sum()), np.log1p(inner) / _FACES,
            (touch[k, :count] > 0).sum() / _FACES, *whole,
        ])  # fmt: skip
    values = np.concatenate([measure(cells, looks, region), np.array(rows)], axis=1)
    return Measured(values.astype(np.float32), touch[:count, :count].astype(np.float32))
