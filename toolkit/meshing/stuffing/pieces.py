"""Into what pieces a mesh falls, beside what touches in its input."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from ....fem.scene.boundary import boundary_faces
from ....fem.scene.mesh import signed_volumes
from ...surfaces.samples import facets, sample
from ...surfaces.solids import INSIDE, Solids
from ...surfaces.surface import Surface, component_volumes, open_components
from ...surfaces.triangles import ClosestTo, closest, winding_numbers

# Of the volume, and of the body of the input that it comes from: a piece that is smaller than both
# is a crumb of a thin rim and is dropped, as nothing would hold it.
CRUMB, CRUMB_OF_BODY = 1e-3, 0.02
SAMPLES = 20_000  # of the surfaces, and their vertices: where a body may touch others


def without_crumbs(
    points: Float[np.ndarray, "points 3"], tets: Int[np.ndarray, "tets 4"], solids: Solids
) -> Bool[np.ndarray, "tets"]:
    """Which tets [m] to keep: all pieces but crumbs of the whole and of a body of the input."""
    volumes = signed_volumes(points, tets)
    pieces = _pieces(tets)
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


def came_off(
    points: Float[np.ndarray, "points 3"],
    tets: Int[np.ndarray, "tets 4"],
    part: Int[np.ndarray, "tets"],
    solids: Solids,
    touching: float,
) -> dict[int, float]:
    """Share of each part's volume in pieces that have come off a larger one.

    Bodies of the input nearer than ``touching`` [m] hang together. What an open surface surrounds
    may be many bodies, like houses on one ground: a piece of it that has nodes within is a body of
    its own, one that has none is a crumb of what is thinner than the lattice's edge.
    """
    piece = _pieces(tets)
    if not piece.any():
        return {}
    volumes, surface = signed_volumes(points, tets), solids.surface
    size = np.bincount(piece, weights=volumes)
    largest = np.empty(len(size), dtype=np.int64)  # tet of each piece
    order = np.argsort(volumes, kind="stable")
    largest[piece[order]] = order
    face = closest(points[tets[largest]].mean(axis=1), surface.points, surface.faces).face
    body = surface.component[face]
    group = _touching(surface, touching)[body]
    most = np.zeros(group.max() + 1)
    np.maximum.at(most, group, size)
    single = open_components(surface)[body] & _have_nodes_within(tets, piece)
    off = ((size < most[group]) & ~single)[piece]
    total = np.bincount(part, weights=volumes)
    gone = np.bincount(part[off], weights=volumes[off], minlength=len(total))
    return {int(p): float(gone[p] / total[p]) for p in np.flatnonzero(gone)}


def _have_nodes_within(
    tets: Int[np.ndarray, "tets 4"], piece: Int[np.ndarray, "tets"]
) -> Bool[np.ndarray, "pieces"]:
    """Whether each piece has a node that is not on its boundary."""
    within = np.ones(tets.max() + 1, dtype=bool)
    within[boundary_faces(tets).faces] = False
    return np.bincount(piece, weights=within[tets].any(axis=1)) > 0


def _touching(surface: Surface, distance: float) -> Int[np.ndarray, "components"]:
    """Group of each component: those within ``distance`` [m] of each other, or in each other."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    points, faces = surface.points, surface.faces
    where, _ = sample(points, faces, rng=np.random.default_rng(0), count=SAMPLES)
    owner = surface.component[closest(where, points, faces).face]
    count = int(surface.component.max()) + 1
    links = []
    for number in np.unique(surface.component).tolist():
        own = faces[surface.component == number]
        lo, hi = points[own].min(axis=(0, 1)) - distance, points[own].max(axis=(0, 1)) + distance
        near = np.flatnonzero(((where >= lo) & (where <= hi)).all(axis=1) & (owner != number))
        apart = ClosestTo(points, own)(where[near]).distance > distance
        inside = np.abs(winding_numbers(points, own, where[near])) > INSIDE
        links += [(number, other) for other in np.unique(owner[near[~apart | inside]]).tolist()]
    ends = np.array(links, dtype=np.int64).reshape(-1, 2).T
    graph = coo_matrix((np.ones(ends.shape[1]), (ends[0], ends[1])), shape=(count, count))
    return connected_components(graph, directed=False)[1]


def _pieces(tets: Int[np.ndarray, "tets 4"]) -> Int[np.ndarray, "tets"]:
    """Piece that each tet belongs to: those that hang together by faces."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    _, left, right = facets(tets)
    links = (np.ones(len(left)), (left, right))
    return connected_components(coo_matrix(links, shape=(len(tets),) * 2), directed=False)[1]
