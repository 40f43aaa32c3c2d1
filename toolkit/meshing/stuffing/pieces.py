"""Into what pieces a mesh falls, beside what touches in its input."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from ....fem.scene.mesh import signed_volumes
from ...surfaces.samples import Facets, facets, sample
from ...surfaces.solids import INSIDE, Solids
from ...surfaces.surface import Surface, component_volumes
from ...surfaces.triangles import ClosestTo, closest, winding_numbers

# Of the volume: a piece that is smaller, and less than half of a body of the input, is a crumb of a
# thin rim and is dropped: nothing would hold it.
CRUMB, WHOLE = 1e-3, 0.5
SAMPLES = 20_000  # of the surfaces, and their vertices: where a body may touch others


def without_crumbs(
    points: Float[np.ndarray, "points 3"], tets: Int[np.ndarray, "tets 4"], solids: Solids
) -> Bool[np.ndarray, "tets"]:
    """Which tets [m] to keep: all pieces but crumbs, small ones that are no body of the input."""
    volumes = signed_volumes(points, tets)
    pieces = _pieces(facets(tets), np.zeros(len(tets), dtype=np.int64))
    size = np.bincount(pieces, weights=volumes)
    kept = size >= CRUMB * size.sum()
    if not kept.all():
        surface = solids.surface
        small, first = np.unique(pieces, return_index=True)
        small, first = small[~kept], first[~kept]
        face = closest(points[tets[first]].mean(axis=1), surface.points, surface.faces).face
        body = np.abs(component_volumes(surface))[surface.component[face]]
        kept[small] = size[small] >= WHOLE * body
    return kept[pieces]


def loose_shares(
    points: Float[np.ndarray, "points 3"],
    tets: Int[np.ndarray, "tets 4"],
    part: Int[np.ndarray, "tets"],
    solids: Solids,
    touching: float,
) -> dict[int, float]:
    """Share of each part's volume in pieces that have lost touch with what they belong to.

    Bodies of the input nearer than ``touching`` [m] are one; its largest piece is what is left of
    it, and the others have come off.
    """
    piece = _pieces(facets(tets), np.zeros(len(tets), dtype=np.int64))
    if not piece.any():
        return {}
    volumes = signed_volumes(points, tets)
    size = np.bincount(piece, weights=volumes)
    largest = np.empty(len(size), dtype=np.int64)  # tet of each piece
    order = np.argsort(volumes, kind="stable")
    largest[piece[order]] = order
    surface = solids.surface
    face = closest(points[tets[largest]].mean(axis=1), surface.points, surface.faces).face
    group = _touching(surface, touching)[surface.component[face]]
    most = np.zeros(group.max() + 1)
    np.maximum.at(most, group, size)
    loose = (size < most[group])[piece]
    total, off = (np.bincount(part[some], weights=volumes[some], minlength=part.max() + 1)
                  for some in (slice(None), loose))  # fmt: skip
    return {int(p): float(off[p] / total[p]) for p in np.flatnonzero(off)}


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


def _pieces(between: Facets, kind: Int[np.ndarray, "tets"]) -> Int[np.ndarray, "tets"]:
    """Piece that each tet belongs to: tets of one kind that hang together by faces."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    same = kind[between.left] == kind[between.right]
    links = (np.ones(int(same.sum())), (between.left[same], between.right[same]))
    return connected_components(coo_matrix(links, shape=(len(kind),) * 2), directed=False)[1]
