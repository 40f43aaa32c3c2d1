"""How a lattice fits: where parts are thinner than its edge, and into what pieces they fall."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from ...surfaces.samples import Facets, facets
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
    pieces = _pieces(facets(tets), np.zeros(len(tets), dtype=np.int64))
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
    """Share of each part's volume in more pieces than its surface has: it has fallen apart.

    Parts that share a shell are one body: where they meet in it is but the nearest face's matter.
    A piece that touches another body was cut off by it, and hangs on it.
    """
    body, between = _bodies(solids), facets(tets)
    pieces = _pieces(between, body[part])
    size = np.bincount(pieces, weights=volumes)
    owner = np.zeros(len(size), dtype=np.int64)
    owner[pieces] = body[part]
    hangs = np.zeros(len(size), dtype=bool)
    for side, other in ((between.left, between.right), (between.right, between.left)):
        hangs[pieces[side[body[part[side]] != body[part[other]]]]] = True
    of_face, present = body[solids.surface.part], np.unique(part)
    out = {}
    for number in np.unique(owner).tolist():
        mine = owner == number
        whole = len(np.unique(solids.surface.component[of_face == number]))
        free = np.sort(size[mine & ~hangs])[::-1][max(whole - (mine & hangs).any(), 0) :]
        if len(free):
            share = float(free.sum() / size[mine].sum())
            out |= {int(p): share for p in present[body[present] == number]}
    return out


def _bodies(solids: Solids) -> Int[np.ndarray, "parts"]:
    """Number of the body that each part belongs to: the first part that it shares shells with."""
    body = np.arange(int(solids.surface.part.max()) + 1)
    for shell in solids.shells:
        joined = np.isin(body, body[np.unique(shell.part)])
        body[joined] = body[joined].min()
    return body


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


def _pieces(between: Facets, kind: Int[np.ndarray, "tets"]) -> Int[np.ndarray, "tets"]:
    """Piece that each tet belongs to: tets of one kind that hang together by faces."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    same = kind[between.left] == kind[between.right]
    links = (np.ones(int(same.sum())), (between.left[same], between.right[same]))
    return connected_components(coo_matrix(links, shape=(len(kind),) * 2), directed=False)[1]
