"""How a lattice fits: parts that are thinner than its edge, and gaps that are narrower."""

from __future__ import annotations

import numpy as np

from ...surfaces.solids import INSIDE, Solids
from ...surfaces.triangles import Triangles, winding_numbers
from ..sizing import thicknesses

RAYS = 4000  # from the surfaces inward: shares to a few per cent
OUT = 0.05  # of the edge: how far beyond both walls it is asked whether the part has ended
CONTACT = 0.02  # of the edge: walls nearer than that touch
ACROSS = (0.5, 0.1, 0.9)  # where on the way over a gap it is asked for tets


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


def closed_shares(solids: Solids, edge: float, boundary: Triangles) -> dict[int, float]:
    """Share of the surface of each part from which tets reach over a gap to another wall.

    A ray from a wall outward finds the wall opposite, nearer than ``edge`` [m], and the air between
    is all inside the mesh's ``boundary`` [m]: what is apart there has become one body.
    """
    points, faces = solids.clean_triangles()
    outward = Triangles(points, faces[:, ::-1])
    rng = np.random.default_rng(0)
    start, end, width = thicknesses(outward, edge=edge, rng=rng, count=RAYS)
    narrow = np.flatnonzero((width > CONTACT * edge) & (width < edge))
    start, way = start[narrow], (end - start)[narrow]
    part = solids.label(start - OUT * way)
    gap = (part >= 0) & (solids.label(start + way / 2) < 0)
    for share in ACROSS:
        winding = winding_numbers(*boundary, (start + share * way)[gap])
        gap[gap] = np.abs(winding) > INSIDE
    found = np.bincount(part[gap])
    return {int(p): float(found[p] / RAYS) for p in np.flatnonzero(found)}
