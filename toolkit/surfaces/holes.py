"""Holes: loops of rim edges that caps close, unless they are the rim of a sheet or a seam."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from .caps import MOST_EDGES, cycle, least_area_cap
from .surface import Surface, bulky_components, component_areas
from .triangles import edge_components, winding_numbers

# A boundary loop closed by a fan of more than this share of its component's area is the rim of a
# sheet (1 for a flat one, 0.8 for a quilt on a bed, 0.71 for one folded by 90 degrees, 0.5 for a
# half sphere, 0.2 for a lidless box).
HOLE_SHARE = 0.69
# In the plane of a hole the winding number is a whole number and a half; where another piece goes
# on from the rim it is a whole one, but for this much. A cap would then cut that piece off.
CRISP, SEAM_SHARE = 0.15, 0.75
SMALL = 0.05  # of its area: the cap of a smaller hole cuts off nothing that matters
BENT = 0.98  # of the area of its fan: a loop that a smaller cap closes is not flat


class Closed(NamedTuple):
    """A surface with caps, and how many ``holes`` and ``faces`` those are."""

    surface: Surface
    holes: int = 0
    faces: int = 0


class _Loops(NamedTuple):
    """Of each rim edge its ``loop``; of each loop the ``centre`` (n, 3) [m] and ``fan`` [m^2]."""

    loop: np.ndarray
    centre: np.ndarray
    fan: np.ndarray


def close_holes(
    surface: Surface,
    edges: Int[np.ndarray, "rim 2"],
    owner: Int[np.ndarray, "rim"],
    *,
    largest: float = HOLE_SHARE,
    joint: bool = False,
) -> Closed:
    """Close loops of rim edges, except the rims of sheets.

    With a fan around their centre, or the cap of least area where they are bent. ``owner`` is the
    face that each directed edge is of, ``largest`` the share of its component's area that a fan may
    have. With ``joint``, a loop stays open too where the components enclose it together: it is a
    seam between them.
    """
    if not len(edges):
        return Closed(surface)
    loops = _loops(surface, edges, owner)
    share = _hole_share(surface, owner, loops)
    fill = share <= HOLE_SHARE
    if largest > HOLE_SHARE:  # but never a flat sheet onto itself
        thick = np.zeros(len(share), dtype=bool)
        thick[loops.loop] = bulky_components(surface)[surface.component[owner]]
        fill |= thick & (share <= largest)
    if joint and (fill & (share > SMALL)).any():
        fill &= (share <= SMALL) | ~_seams(surface, edges, loops)
    caps = _bent_caps(surface, edges, loops, fill)
    fan = fill.copy()
    fan[list(caps)] = False
    edge = fan[loops.loop]
    centre = len(surface.points) + (np.cumsum(fan) - 1)[loops.loop[edge]]
    first = np.unique(loops.loop, return_index=True)[1]
    added = [np.column_stack([edges[edge][:, ::-1], centre]), *caps.values()]
    part = surface.part[owner]
    parts = [part[edge], *(np.full(len(c), part[first[i]]) for i, c in caps.items())]
    faces = np.concatenate([surface.faces, *added])
    closed = Surface(
        np.concatenate([surface.points, loops.centre[fan]]),
        faces,
        np.concatenate([surface.part, *parts]),
        edge_components(faces),
    )
    return Closed(closed, int(fill.sum()), len(faces) - len(surface.faces))


def _bent_caps(
    surface: Surface, edges: np.ndarray, loops: _Loops, fill: Bool[np.ndarray, "loops"]
) -> dict[int, Int[np.ndarray, "faces 3"]]:
    """Caps of the loops to ``fill`` that are one bent cycle: a fan would cut through the body."""
    caps = {}
    length = np.bincount(loops.loop)
    for loop in np.flatnonzero(fill & (length > 3) & (length <= MOST_EDGES)):
        points = cycle(edges[loops.loop == loop])
        if points is not None:
            cap = least_area_cap(surface.points[points])
            if cap.area < BENT * loops.fan[loop]:
                caps[int(loop)] = points[cap.faces][:, ::-1]
    return caps


def _loops(surface: Surface, edges: np.ndarray, owner: np.ndarray) -> _Loops:
    """Rim edges that hang together; where loops of two components touch, each has its own."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    node = surface.component[owner][:, None] * len(surface.points) + edges
    node = np.unique(node, return_inverse=True)[1].reshape(-1, 2)
    graph = coo_matrix((np.ones(len(edges)), tuple(node.T)), shape=(node.max() + 1,) * 2)
    loop = connected_components(graph, directed=False)[1][node[:, 0]]
    start = surface.points[edges[:, 0]]
    sums = np.stack([np.bincount(loop, weights=start[:, k]) for k in range(3)], axis=1)
    centre = sums / np.bincount(loop)[:, None]
    a, b = (surface.points[edges[:, i]] - centre[loop] for i in (0, 1))
    return _Loops(
        loop, centre, np.bincount(loop, weights=np.linalg.norm(np.cross(a, b), axis=1) / 2)
    )


def _hole_share(surface: Surface, owner: np.ndarray, loops: _Loops) -> Float[np.ndarray, "loops"]:
    """Area of the fan that would close each boundary loop, as a share of that of its component."""
    mine = np.zeros(len(loops.centre))
    mine[loops.loop] = component_areas(surface)[surface.component[owner]]
    return loops.fan / mine


def _seams(surface: Surface, edges: np.ndarray, loops: _Loops) -> Bool[np.ndarray, "loops"]:
    """Loops on whose fan the whole surface has whole winding numbers: others go on from there."""
    fan = surface.points[edges].sum(axis=1) + loops.centre[loops.loop]
    where = np.concatenate([fan / 3, loops.centre])
    winding = winding_numbers(surface.points, surface.faces, where)
    crisp = np.abs(winding - np.round(winding)) < CRISP
    loop = np.concatenate([loops.loop, np.arange(len(loops.centre))])
    return np.bincount(loop, weights=crisp) >= SEAM_SHARE * np.bincount(loop)
