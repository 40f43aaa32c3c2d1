"""Pieces of one look: the cells of a thing in one piece, grouped by colour, opacity and finish."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from .looks import lab

# Looks nearer than this are one, in units of CIE L*a*b*: some four times what eyes just tell apart.
# Of 5, 10, 15, 20 and 30 it bound most cells of the training sources (.73, .75, .73, .74, .73).
NEAR = 10.0
STEP = 4.0  # of a histogram, in the same units: a linkage of all cells would take their square
SPECK = 0.01  # of the cells: a smaller piece is given to the look that is nearest
MOST = 12  # pieces
_BINS = 1500  # at most, the fullest ones
# What opacity, metal, reflectance and roughness count, each from 0 to 1, in units of L*a*b*.
_WEIGHTS = np.array([50.0, 30.0, 30.0, 15.0])


def by_look(looks: Float[np.ndarray, "n look"]) -> Int[np.ndarray, "n"]:
    """Return the piece of every cell, from 0, none empty.

    Quick shift (Vedaldi & Soatto 2008) on a histogram of looks: each bin goes where the nearest
    denser one goes, a bin that has none within ``NEAR`` stays and is a piece.
    """
    seen = np.concatenate([lab(looks[:, :3]), looks[:, 3:] * _WEIGHTS], axis=1)
    _, of_bin, count = np.unique(
        np.round(seen / STEP).astype(np.int64), axis=0, return_inverse=True, return_counts=True
    )
    of_bin = of_bin.ravel()
    means = np.stack([np.bincount(of_bin, column) / count for column in seen.T], axis=1)
    full = np.argsort(-count, kind="stable")[:_BINS]
    root = _roots(means[full], count[full])
    size = np.bincount(root, count[full], minlength=len(full))
    large = np.argsort(-size, kind="stable")[:MOST]
    large = large[(size[large] >= SPECK * len(looks)) | (np.arange(len(large)) == 0)]
    piece = _square(means, means[full][large]).argmin(axis=1)
    for i, at in enumerate(large):
        piece[full[root == at]] = i
    return np.unique(piece[of_bin], return_inverse=True)[1].ravel()


def _roots(places: Float[np.ndarray, "n d"], count: Int[np.ndarray, "n"]) -> Int[np.ndarray, "n"]:
    """For each bin the one of greatest density that it climbs to."""
    square = _square(places, places)
    density = np.exp(-square / (2 * (NEAR / 2) ** 2)) @ count
    order = np.argsort(-density, kind="stable")
    root = np.arange(len(places))
    for i, at in enumerate(order[1:], start=1):
        denser = order[:i]
        nearest = denser[square[at, denser].argmin()]
        if square[at, nearest] <= NEAR**2:
            root[at] = root[nearest]
    return root


def _square(a: Float[np.ndarray, "n d"], b: Float[np.ndarray, "m d"]) -> Float[np.ndarray, "n m"]:
    """Squares of all distances."""
    return np.maximum(
        np.square(a).sum(axis=1)[:, None] + np.square(b).sum(axis=1) - 2 * a @ b.T, 0.0
    )
