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
    "log slenderness x", "log slenderness y", "log slenderness z", "log relative", "rank",
    "log count", "log copied share", "log like share", "contrast", "whole contrast",
    "closest contact",
)  # fmt: skip
# Of two regions: the share of the first one's common faces, how like their looks and sizes are,
# and whether the first is higher.
PAIRS = ("contact", "like look", "like size", "higher")
# Measures that change places where the thing makes a quarter turn about its upright axis.
_TURNED = (
    ("width", "depth"), ("own width", "own depth"), ("x offset", "y offset"),
    ("mirror x", "mirror y"), ("log slenderness x", "log slenderness y"),
)  # fmt: skip
_COPY = 0.15  # of the logarithm of sizes that differ by less, two regions are copies
_FACES = 5.0  # what brings logarithms of faces, and numbers of neighbours, near 1
_LIKE = 12.0  # of CIE L*a*b*: looks that differ by less are one
_HIGHER = 0.2  # of the whole's height


class Measured(NamedTuple):
    """What is measured of a thing's regions.

    values: ``MEASURES`` of each (regions, measures).
    contact: Fraction of its common faces that each has with each other one (regions, regions).
    """

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
    values = measure(cells, looks, region)
    size = np.bincount(region, minlength=count)
    colours = values[:, :3]
    apart = np.linalg.norm(colours[:, None] - colours, axis=2)
    copied = (np.abs(np.log(size / size[:, None])) < _COPY) & (apart < _LIKE)
    spread = np.sqrt((size / len(cells)) @ np.square(colours - size @ colours / len(cells)))
    whole = [np.log(len(cells) / np.prod(sides)), *np.log(sides / longest)]
    rows = []
    for k in range(count):
        own = cells[region == k]
        place = (own + 0.5 - (low + high) / 2) / longest
        spread_of = place - place.mean(axis=0)
        # 1e-5: as in ``matter.measure``
        axes = np.linalg.eigh(spread_of.T @ spread_of / len(own) + 1e-5 * np.eye(3))[1]
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
            (touch[k, :count] > 0).sum() / _FACES, *whole, np.log(size[k] / size.max()),
            (size > size[k]).sum() / count, np.log(count),
            np.log(size[copied[k]].sum() / len(cells)),
            np.log(size[apart[k] < _LIKE].sum() / len(cells)),
            touch[k, :count] @ apart[k] / (inner + 1), np.linalg.norm(spread),
            touch[k, :count].max() / (inner + 1),
        ])  # fmt: skip
    values = np.concatenate([values, np.array(rows)], axis=1)
    share = touch[:count, :count] / (touch[:count, :count].sum(axis=1, keepdims=True) + 1)
    return Measured(values.astype(np.float32), share.astype(np.float32))


def quarter_turned(found: Measured) -> Measured:
    """What is measured of the thing after a quarter turn about its upright axis."""
    order: list[str] = list(MEASURES)
    for one, other in _TURNED:
        i, j = order.index(one), order.index(other)
        order[i], order[j] = other, one
    return found._replace(values=found.values[:, [MEASURES.index(name) for name in order]])


def pairs_of(found: Measured) -> Float[np.ndarray, "regions regions pairs"]:
    """``PAIRS`` of measured regions."""
    values, look = found.values, found.values[:, :3]
    apart = np.linalg.norm(look[:, None] - look, axis=2)
    size, height = (values[:, FEATURES.index(name)] for name in ("log share", "height"))
    each = [
        found.contact,
        np.exp(-apart / _LIKE),
        np.exp(-np.abs(size[:, None] - size) / _COPY),
        np.tanh((height[:, None] - height) / _HIGHER),
    ]
    return np.stack(each, axis=-1).astype(np.float32)
