"""Which parts are thinner than the edge of a lattice, and over how much of their surface."""

from __future__ import annotations

import numpy as np

from ...surfaces.solids import Solids
from ..sizing import thicknesses

RAYS = 4000  # from the surfaces inward: shares to a few per cent
OUT = 0.05  # of the edge: how far beyond both walls it is asked whether the part has ended


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
