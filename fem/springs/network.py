"""The network: which anchors are joined, and how stiff each spring is.

After Spring-Gaus (Zhong et al. 2024): an anchor draws at its K nearest with weights of one number
eta. Here a pair is one spring, in SI, so that forces balance, and k follows from E: a spring of
stiffness s and length l gives the isotropic average E = sum s l^2 / 6 V at nu = 1/4 (Cauchy).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ..device import start_warp
from ..errors import InputError
from .anchors import Anchors
from .sight import Sight

# Poisson's ratio of a network of central forces that is alike in all directions.
CAUCHY_NU = 0.25
# Nearest neighbours that always count; eta weighs the others.
ALWAYS = 16
# Neighbours are sought among so many times as many anchors: what is not seen is left out.
CANDIDATES = 3
# Springs that join what would fall apart.
BRIDGES = 6


def neighbour_weights(eta: float, neighbours: int) -> Float[np.ndarray, "neighbours"]:
    """Weight of the neighbour of every rank: clip(2 - softplus(eta)^i, 0, 1), i = 0 ... 1."""
    rest = max(neighbours - ALWAYS, 0)
    power = np.arange(rest) / max(rest, 1)
    far = np.clip(2 - np.exp(np.log(np.logaddexp(0.0, eta)) * power), 0, 1)
    return np.concatenate([np.ones(min(ALWAYS, neighbours)), far])


@dataclass(frozen=True, eq=False, kw_only=True)
class SpringNetwork:
    """Springs between anchors, each once.

    Parameters
    ----------
    anchors
        What is joined.
    i, j
        Anchors at the ends of every spring, i < j, shape (springs,).
    rank_i, rank_j
        Rank of j among the neighbours of i, and of i among those of j; -1 where it is none of them.
    neighbours
        How many neighbours an anchor has at most.
    bridges
        Springs that leave the tets because something would fall apart without them.
    """

    anchors: Anchors
    i: Int[np.ndarray, "springs"]
    j: Int[np.ndarray, "springs"]
    rank_i: Int[np.ndarray, "springs"]
    rank_j: Int[np.ndarray, "springs"]
    neighbours: int
    bridges: int = 0

    @classmethod
    def of(cls, anchors: Anchors, neighbours: int, surface: Sight) -> SpringNetwork:
        """Join every anchor with its ``neighbours`` nearest ones that it sees inside the body."""
        count = len(anchors.x)
        if not 3 < neighbours < count:
            raise InputError(f"{neighbours} neighbours of {count} anchors: wanted 4 to {count - 1}")
        a, b, rank = _seen_neighbours(anchors, neighbours, surface)
        low, high = np.minimum(a, b), np.maximum(a, b)
        key, spring = np.unique(low * count + high, return_inverse=True)
        i, j = key // count, key % count
        ranks = np.full((2, len(key)), -1)
        ranks[(a > b).astype(int), spring] = rank
        bridge = _bridges(anchors, i, j)
        new = np.zeros((2, len(bridge)), dtype=ranks.dtype)  # as near as the nearest
        return cls(
            anchors=anchors,
            i=np.concatenate([i, bridge[:, 0]]),
            j=np.concatenate([j, bridge[:, 1]]),
            rank_i=np.concatenate([ranks[0], new[0]]),
            rank_j=np.concatenate([ranks[1], new[1]]),
            neighbours=neighbours,
            bridges=len(bridge),
        )

    @cached_property
    def length(self) -> Float[np.ndarray, "springs"]:
        """Lengths at rest [m]."""
        x = self.anchors.x
        return np.linalg.norm(x[self.j] - x[self.i], axis=1)

    @cached_property
    def direction(self) -> Float[np.ndarray, "springs 3"]:
        """Unit vectors from i to j at rest."""
        x = self.anchors.x
        return (x[self.j] - x[self.i]) / self.length[:, None]

    def _shares(self, eta: float) -> tuple[np.ndarray, np.ndarray]:
        weights = np.append(neighbour_weights(eta, self.neighbours), 0.0)
        return weights[self.rank_i], weights[self.rank_j]

    def calibrated(self, eta: float) -> Float[np.ndarray, "n"]:
        """Constant k [N] of every anchor: half its springs, k w l / 2 in sum, carry 6 V E."""
        own, other = self._shares(eta)
        count = len(self.anchors.x)
        reach = np.bincount(self.i, own * self.length, count)
        reach += np.bincount(self.j, other * self.length, count)
        carried = 6 * self.anchors.volume * self.anchors.E
        return carried / np.where(reach > 0, reach / 2, np.inf)

    def constants(self, eta: float = 0.0, surface: float = 0.0) -> Float[np.ndarray, "n"]:
        """Calibrated constants k [N] times exp(surface (skin - its mean)).

        The mean is that by volume, so that the mean of log k stays.
        """
        anchors = self.anchors
        outer = anchors.skin - np.average(anchors.skin, weights=anchors.volume)
        return self.calibrated(eta) * np.exp(surface * outer)

    def stiffness(
        self,
        eta: float = 0.0,
        *,
        surface: float = 0.0,
        k: Float[np.ndarray, "n"] | None = None,
    ) -> Float[np.ndarray, "springs"]:
        """Stiffness [N/m] of every spring: (k_i w + k_j w) / 2 l, across borders the harmonic mean.

        ``k`` [N] are the anchors' constants, by default those of ``eta`` and ``surface``.
        """
        k = self.constants(eta, surface) if k is None else k
        own, other = self._shares(eta)
        a, b = self.anchors.E[self.i], self.anchors.E[self.j]
        series = 4 * (a / (a + b)) * (b / (a + b))  # harmonic over arithmetic mean: halves in a row
        return series * (k[self.i] * own + k[self.j] * other) / (2 * self.length)

    @cached_property
    def pattern(self) -> BlockPattern:
        """Where the blocks of the stiffness matrix are; kept, and with it what is planned on it."""
        wp, count = start_warp(), len(self.anchors.x)
        own = np.arange(count)
        row = np.concatenate([own, self.i, self.j])
        keys, slot = np.unique(
            row * count + np.concatenate([own, self.j, self.i]), return_inverse=True
        )
        rows = np.concatenate([[0], np.cumsum(np.bincount(keys // count, minlength=count))])
        ends = (count, count + len(self.i))
        ints = (wp.array(a, dtype=wp.int32, device="cpu") for a in (rows, keys % count))
        return BlockPattern(*ints, *np.split(slot, ends))

    def blocks(self, stiffness: Float[np.ndarray, "springs"]) -> Float[np.ndarray, "blocks 3 3"]:
        """Blocks of the stiffness matrix [N/m] at rest, as ``pattern`` has them."""
        pattern, count = self.pattern, len(self.anchors.x)
        each = stiffness[:, None, None] * self.direction[:, :, None] * self.direction[:, None]
        out = np.empty((pattern.columns.shape[0], 3, 3))
        out[pattern.above] = out[pattern.below] = -each
        ends = np.concatenate([self.i, self.j])
        for k, m in np.ndindex(3, 3):
            out[pattern.own, k, m] = np.bincount(ends, np.tile(each[:, k, m], 2), count)
        return out

    def matrix(self, stiffness: Float[np.ndarray, "springs"]) -> Any:
        """Stiffness matrix [N/m] at rest, (3 n, 3 n) ``scipy.sparse.bsr_array``."""
        from scipy.sparse import bsr_array

        size = (3 * len(self.anchors.x),) * 2
        place = (self.pattern.columns.numpy(), self.pattern.rows.numpy())
        return bsr_array((self.blocks(stiffness), *place), shape=size)


class BlockPattern(NamedTuple):
    """Compressed ``rows`` and ``columns`` (warp) of blocks, and where those of springs stand.

    Places of the blocks of every anchor's ``own``, and ``above`` and ``below`` the diagonal of
    every spring.
    """

    rows: Any
    columns: Any
    own: np.ndarray
    above: np.ndarray
    below: np.ndarray


class _Neighbours(NamedTuple):
    """Anchors ``a``, neighbours ``b`` of theirs, and the ``rank`` of these, each (pairs,)."""

    a: np.ndarray
    b: np.ndarray
    rank: np.ndarray


def _seen_neighbours(anchors: Anchors, neighbours: int, surface: Sight) -> _Neighbours:
    """Nearest neighbours that are seen."""
    from scipy.spatial import KDTree

    count = len(anchors.x)
    wide = min(CANDIDATES * neighbours, count - 1)
    b = np.asarray(KDTree(anchors.x).query(anchors.x, wide + 1)[1])[:, 1:]
    a = np.repeat(np.arange(count), wide).reshape(b.shape)
    low, high = np.minimum(a, b), np.maximum(a, b)
    key, pair = np.unique(low * count + high, return_inverse=True)
    i, j = key // count, key % count
    good = (anchors.body[i] == anchors.body[j]) & ~surface.crossed(anchors.x[i], anchors.x[j])
    seen = good[pair].reshape(b.shape)
    rank = np.cumsum(seen, axis=1) - 1
    seen &= rank < neighbours
    return _Neighbours(a[seen], b[seen], rank[seen])


def _bridges(anchors: Anchors, i: np.ndarray, j: np.ndarray) -> Int[np.ndarray, "bridges 2"]:
    """Shortest pairs that join what the springs leave apart but tets hold together."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    found, count = [np.zeros((0, 2), dtype=np.int64)], len(anchors.x)
    ones = np.ones(len(i), dtype=np.int8)
    piece = connected_components(coo_array((ones, (i, j)), shape=(count, count)), directed=False)[1]
    for body in np.unique(anchors.body):
        while len(pieces := np.unique(piece[anchors.body == body])) > 1:
            sizes = np.bincount(piece, minlength=count)[pieces]
            inner = np.flatnonzero(piece == pieces[np.argmin(sizes)])
            outer = np.flatnonzero((anchors.body == body) & (piece != piece[inner[0]]))
            many = min(BRIDGES, len(outer))
            far, near = KDTree(anchors.x[outer]).query(anchors.x[inner], k=many)
            best = np.argsort(far.reshape(-1), kind="stable")[:BRIDGES]
            pairs = np.stack([inner.repeat(many)[best], outer[near.reshape(-1)[best]]], axis=1)
            found.append(np.sort(pairs, axis=1))
            piece[np.isin(piece, piece[outer[near.reshape(-1)[best]]])] = piece[inner[0]]
    return np.concatenate(found)
