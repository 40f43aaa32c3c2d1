"""Tets left out: crumbs, and those at a bare edge, which doubling of nodes cannot separate.

Halving such an edge, the other way, makes two flat tets of each good one.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from ....fem.scene.boundary import FACES
from ....fem.scene.mesh import signed_volumes
from ...surfaces.solids import Solids
from ...surfaces.surface import component_volumes
from ...surfaces.triangles import closest
from ..manifold import bare_edges
from ..quality import corner_nodes
from .lattice import edges_of
from .pieces import CRUMB_OF_BODY, pieces_of

ROUNDS = 8  # what is left out may bare another edge; after them halving is left
CRUMB = 1e-3  # of the volume: a smaller piece that is a crumb of its body is held by nothing
MOST = 0.005  # of the volume: a body that would lose more is too thin for its lattice


def carved(
    tets: Int[np.ndarray, "tets 4"], volumes: Float[np.ndarray, "tets"]
) -> Bool[np.ndarray, "tets"]:
    """Which tets to keep, so that few edges with several groups of them are left."""
    keep = np.ones(len(tets), dtype=bool)
    for _ in range(ROUNDS):
        alive = np.flatnonzero(keep)
        apart, _ = corner_nodes(tets[alive])
        bare = bare_edges(apart)
        if not len(bare):
            break
        out = alive[_lesser_groups(apart, bare, volumes[alive])]
        if volumes[out].sum() + volumes[~keep].sum() > MOST * volumes.sum():
            break
        keep[out] = False
    return keep


def without_crumbs(
    points: Float[np.ndarray, "points 3"], tets: Int[np.ndarray, "tets 4"], solids: Solids
) -> Bool[np.ndarray, "tets"]:
    """Which tets [m] to keep: all pieces but crumbs of the whole and of a body of the input."""
    volumes = signed_volumes(points, tets)
    pieces = pieces_of(tets)
    size = np.bincount(pieces, weights=volumes)
    kept = size >= CRUMB * size.sum()
    if not kept.all():
        surface = solids.surface
        small, first = np.unique(pieces, return_index=True)
        small, first = small[~kept], first[~kept]
        face = closest(points[tets[first]].mean(axis=1), surface.points, surface.faces).face
        body = np.abs(component_volumes(surface))[surface.component[face]]
        kept[small] = size[small] >= CRUMB_OF_BODY * body
    return kept[pieces]


def _lesser_groups(
    tets: Int[np.ndarray, "tets 4"],
    bare: Int[np.ndarray, "edges 2"],
    volumes: Float[np.ndarray, "tets"],
) -> Int[np.ndarray, "out"]:
    """Of the tets around each edge, those that do not hang together with the largest group."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    size = int(tets.max()) + 1
    ends = np.zeros(size, dtype=bool)
    ends[bare] = True
    near = np.flatnonzero(ends[tets].sum(axis=1) >= 2)
    edges, of_tet = edges_of(tets[near], size)
    wanted = np.isin(edges @ np.array([size, 1]), bare @ np.array([size, 1]))
    row, slot = np.nonzero(wanted[of_tet])
    tet, edge = near[row], of_tet[row, slot]
    # Two of them hang together where they share a face that has the edge.
    faces = np.sort(tets[tet][:, FACES], axis=-1)
    has = (faces[..., None] == edges[edge][:, None, None, :]).any(axis=2).all(axis=-1)
    item, face = np.nonzero(has)
    key = np.column_stack([edge[item], faces[item, face]])
    order = np.lexsort(key.T[::-1])
    same = (key[order][1:] == key[order][:-1]).all(axis=1)
    links = item[order[:-1][same]], item[order[1:][same]]
    graph = coo_matrix((np.ones(len(links[0])), links), shape=(len(tet), len(tet)))
    _, group = connected_components(graph, directed=False)
    weight = np.bincount(group, weights=volumes[tet])
    best = np.zeros(len(edges))
    np.maximum.at(best, edge, weight[group])
    return np.unique(tet[weight[group] < best[edge]])
