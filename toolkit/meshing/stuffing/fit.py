"""How a lattice fits: parts that are thinner than its edge, and gaps that are narrower."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...surfaces.solids import INSIDE, Solids
from ...surfaces.triangles import Triangles, winding_numbers
from ..engine_run import EngineTarget
from ..sizing import thicknesses

RAYS = 4000  # from the surfaces inward: shares to a few per cent
OUT = 0.05  # of the edge: how far beyond both walls it is asked whether the part has ended
CONTACT = 0.02  # of the edge: walls nearer than that touch
ACROSS = (0.5, 0.1, 0.9)  # where on the way over a gap it is asked for tets
# Of the edge: a plate of 1 keeps its shape in the lattice, of .7 it is holes for the most part.
RESOLVED = 0.75
THIN_SHARE = 0.05  # of the surface that may be thinner: rims and ornaments that carry little


class RaysThrough(NamedTuple):
    """Rays through parts: the ``part`` of each, and its ``thickness`` [m] there if below an edge.

    Where it is thicker, or the wall opposite is one inside the part, that is infinite.
    """

    part: np.ndarray
    thickness: np.ndarray


def thin_walls(solids: Solids, edge: float) -> RaysThrough:
    """Thickness of the parts where their walls are nearer than ``edge`` [m].

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
    found = np.full(len(part), np.inf)
    found[thin] = thickness[thin]
    return RaysThrough(part[part >= 0], found[part >= 0])


def thin_shares(solids: Solids, edge: float) -> dict[int, float]:
    """Share of the surface of each part where its walls are nearer than ``edge`` [m]."""
    part, thickness = thin_walls(solids, edge)
    total = np.bincount(part)
    found = np.bincount(part[thickness < edge], minlength=len(total))
    return {int(p): float(found[p] / total[p]) for p in np.flatnonzero(found)}


def resolving(solids: Solids, target: EngineTarget, *, most: int) -> EngineTarget:
    """Return the target with tets enough for what is thin, ``most`` at most.

    All but ``THIN_SHARE`` of the surface is then at least ``RESOLVED`` edges thick.
    """
    edge = target.lattice_edge(sum(shell.volume for shell in solids.shells))
    thickness = np.sort(thin_walls(solids, RESOLVED * edge).thickness)
    if not len(thickness):
        return target
    wanted = thickness[int(THIN_SHARE * len(thickness))] / RESOLVED
    more = (edge / wanted) ** 3 if wanted > 0 else np.inf
    return replace(target, tets=int(np.clip(more * target.tets, target.tets, most)))


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
