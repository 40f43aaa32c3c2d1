"""Aggregates of nodes: boxes, split where the coupling is weak."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

# Neighbours couple strongly when |A_ij| >= this share of sqrt(|A_ii| |A_jj|). Within one material
# the ratio is 0.02 and more; across an interface it falls with the square root of the contrast.
STRENGTH = 5e-3
# A strongly coupled part of a box smaller than this joins the rest of its box: a motion of so few
# nodes is the smoother's work.
SMALLEST = 4


def boxes(points: Float[np.ndarray, "n 3"], count: int) -> Int[np.ndarray, "n"]:
    """Recursive coordinate bisection: box of every point, at least ``count`` equal boxes."""
    label = np.zeros(len(points), dtype=np.int64)
    parts = 1
    while parts < count:
        order = np.argsort(label, kind="stable")
        sizes = np.bincount(label, minlength=parts)
        start = np.cumsum(sizes) - sizes
        sorted_points = points[order]
        low = np.minimum.reduceat(sorted_points, start)
        high = np.maximum.reduceat(sorted_points, start)
        along = points[np.arange(len(points)), np.argmax(high - low, axis=1)[label]]
        order = np.lexsort((along, label))
        rank = np.empty_like(label)
        rank[order] = np.arange(len(points)) - np.repeat(start, sizes)
        label = 2 * label + (rank >= sizes[label] // 2)
        parts *= 2
    return label


def split_weak(
    label: Int[np.ndarray, "n"], rows: np.ndarray, columns: np.ndarray, strength: np.ndarray
) -> Int[np.ndarray, "n"]:
    """Split every box into its strongly coupled parts.

    ``rows``, ``columns`` and ``strength`` describe the couplings of nodes. A stiff and a soft
    material in one box must not share their rigid motions.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    count = len(label)
    keep = (strength >= STRENGTH) & (label[rows] == label[columns])
    ones = np.ones(int(keep.sum()), dtype=np.int8)
    graph = coo_array((ones, (rows[keep], columns[keep])), shape=(count, count))
    part = connected_components(graph, directed=False)[1].astype(np.int64)
    size = np.bincount(part)
    # The largest part of every box takes in the box's crumbs.
    owner = np.empty(len(size), dtype=np.int64)
    owner[part] = label
    by_box = np.lexsort((-size, owner))
    first = np.unique(owner[by_box], return_index=True)[1]
    largest = np.zeros(label.max() + 1, dtype=np.int64)
    largest[owner[by_box][first]] = by_box[first]
    part = np.where(size[part] < SMALLEST, largest[label], part)
    return np.unique(part, return_inverse=True)[1]
