"""How a lattice fits: where parts are thinner than its edge, and into what pieces they fall."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from ...surfaces.samples import facets
from ...surfaces.solids import Solids
from ..sizing import thicknesses

# Of the volume: a piece that is smaller, and one too many, is a crumb of a thin rim and is dropped:
# nothing would hold it.
CRUMB = 1e-3
RAYS = 4000  # from the surfaces inward: shares to a few per cent
OUT = 0.05  # of the edge: how far beyond both walls it is asked whether the part has ended


def without_crumbs(
    tets: Int[np.ndarray, "tets 4"], volumes: Float[np.ndarray, "tets"], solids: Solids
) -> Bool[np.ndarray, "tets"]:
    """Which tets to keep: all pieces as large as those that the solids may have, and no crumb."""
    pieces = _pieces(tets, np.zeros(len(tets), dtype=np.int64))
    size = np.bincount(pieces, weights=volumes)
    rank = np.empty(len(size), dtype=np.int64)
    rank[np.argsort(-size, kind="stable")] = np.arange(len(size))
    bodies = len(np.unique(solids.surface.component))
    return ((rank < bodies) | (size >= CRUMB * size.sum()))[pieces]


def loose_shares(
    tets: Int[np.ndarray, "tets 4"],
    volumes: Float[np.ndarray, "tets"],
    part: Int[np.ndarray, "tets"],
    solids: Solids,
) -> dict[int, float]:
    """Share of each part's volume in more pieces than its surface has: it has fallen apart."""
    pieces = _pieces(tets, part)
    size = np.bincount(pieces, weights=volumes)
    owner = np.zeros(len(size), dtype=np.int64)
    owner[pieces] = part
    out = {}
    for number in np.unique(part).tolist():
        mine = np.sort(size[owner == number])[::-1]
        bodies = len(np.unique(solids.surface.component[solids.surface.part == number]))
        if len(mine) > bodies:
            out[number] = float(mine[bodies:].sum() / mine.sum())
    return out


def thin_shares(solids: Solids, edge: float) -> dict[int, float]:
    """Share of the surface of each part where its walls are nearer than ``edge`` [m].

    A ray from a wall finds the wall opposite; beyond both must be another part or air, else it is
    a wall inside.
    """
    rng = np.random.default_rng(0)
    start, end, thickness = thicknesses(solids.clean_triangles(), edge=edge, rng=rng, count=RAYS)
    part = solids.label((start + end) / 2)
    thin = np.flatnonzero((part >= 0) & (thickness < edge))
    along = (end - start)[thin] / np.maximum(thickness[thin], np.finfo(float).tiny)[:, None]
    beyond = np.concatenate([start[thin] - OUT * edge * along, end[thin] + OUT * edge * along])
    before, after = np.split(solids.label(beyond), 2)
    thin = thin[(before != part[thin]) & (after != part[thin])]
    total, found = (np.bincount(part[rays], minlength=part.max(initial=0) + 1)
                    for rays in (np.flatnonzero(part >= 0), thin))  # fmt: skip
    return {int(p): float(found[p] / total[p]) for p in np.flatnonzero(found)}


def _pieces(tets: Int[np.ndarray, "tets 4"], kind: Int[np.ndarray, "tets"]) -> np.ndarray:
    """Piece that each tet belongs to: tets of one kind that hang together by faces."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    _, left, right = facets(tets)
    same = kind[left] == kind[right]
    links = (np.ones(int(same.sum())), (left[same], right[same]))
    return connected_components(coo_matrix(links, shape=(len(tets),) * 2), directed=False)[1]
