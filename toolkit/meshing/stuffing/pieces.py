"""Into what pieces a mesh falls, beside what touches in its input; pieces that hang in the air."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ....fem.errors import UsageError
from ....fem.mesh import boundary_faces, signed_volumes
from ....predictors.asset import Asset
from ...asset.solids import INSIDE, Solids
from ...asset.surface import Surface, TouchingPlaces, component_volumes, open_components
from ...asset.triangles import (
    ClosestTo,
    Places,
    Points,
    Tets,
    Triangles,
    closest,
    edge_components,
    facets,
    linked_groups,
    sample,
    winding_numbers,
)
from .lattice import BEAD, NOWHERE

CRUMB_OF_BODY = 0.02  # a smaller piece of a body of the input may be a crumb of a thin rim
FEW = 8  # tets: a smaller piece that is a crumb of its body lies in a gap between larger ones
WIDER = 0.25  # long edges that a gap within a body may be wider than where it is narrowest
LONGEST = 5.0  # long edges: a wider gap is none, and a longer tip without tets not joined
REACH = 2.0  # long edges from such a place to the tets that are joined
SAMPLES = 20_000  # of the surfaces, and their vertices: where a body may touch others


def came_off(
    points: Points, tets: Tets, part: Int[np.ndarray, "tets"], solids: Solids, touching: float
) -> dict[int, float]:
    """Share of each part's volume in pieces that have come off a larger one.

    Bodies of the input nearer than ``touching`` [m] hang together. What an open surface surrounds
    may be many bodies, like houses on one ground: a piece of it that has nodes within is a body of
    its own, one that has none is a crumb of what is thinner than the lattice's edge.
    """
    piece = pieces_of(tets)
    if not piece.any():
        return {}
    volumes, surface = signed_volumes(points, tets), solids.surface
    size = np.bincount(piece, weights=volumes)
    largest = np.empty(len(size), dtype=np.int64)  # tet of each piece
    order = np.argsort(volumes, kind="stable")
    largest[piece[order]] = order
    face = closest(points[tets[largest]].mean(axis=1), surface.points, surface.faces).face
    body = surface.component[face]
    # Group of each component: those within `distance` [m] of each other, or in each other
    points, faces = surface.points, surface.faces
    where, _ = sample(points, faces, rng=np.random.default_rng(0), count=SAMPLES)
    owner = surface.component[closest(where, points, faces).face]
    count = int(surface.component.max()) + 1
    links = []
    for number in np.unique(surface.component).tolist():
        own = faces[surface.component == number]
        lo, hi = points[own].min(axis=(0, 1)) - touching, points[own].max(axis=(0, 1)) + touching
        near = np.flatnonzero(((where >= lo) & (where <= hi)).all(axis=1) & (owner != number))
        apart = ClosestTo(points, own)(where[near]).distance > touching
        inside = np.abs(winding_numbers(points, own, where[near])) > INSIDE
        links += [(number, other) for other in np.unique(owner[near[~apart | inside]]).tolist()]
    ends = np.array(links, dtype=np.int64).reshape(-1, 2).T
    group = linked_groups(count, *ends)[body]
    most = np.zeros(group.max() + 1)
    np.maximum.at(most, group, size)
    within = np.ones(tets.max() + 1, dtype=bool)
    within[boundary_faces(tets).faces] = False
    single = open_components(surface)[body] & (
        np.bincount(piece, weights=within[tets].any(axis=1)) > 0
    )
    off = ((size < most[group]) & ~single)[piece]
    total = np.bincount(part, weights=volumes)
    gone = np.bincount(part[off], weights=volumes[off], minlength=len(total))
    return {int(p): float(gone[p] / total[p]) for p in np.flatnonzero(gone)}


class BodyTets:
    """Tets on points [m] with the ``part`` (m,) of each, and which lie in a body of a surface."""

    def __init__(
        self, points: Points, tets: Tets, part: Int[np.ndarray, "tets"], surface: Surface
    ) -> None:
        from scipy.spatial import KDTree

        self.tets, self.part, self.surface = tets, part, surface
        self.middles = points[tets].mean(axis=1)
        self._tree = KDTree(self.middles)
        self._of: dict[int, np.ndarray] = {}

    def triangles(self, body: int) -> Triangles:
        """Faces of a component of the surface."""
        return Triangles(self.surface.points, self.surface.faces[self.surface.component == body])

    def within(self, body: int, near: Int[np.ndarray, "m"]) -> Bool[np.ndarray, "m"]:
        """Which of some tets of a part of a body have their middles in it: all, if it is alone."""
        if body in self._of:
            return np.isin(near, self._of[body])
        own = self.surface.component == body
        parts, middles = np.unique(self.surface.part[own]), self.middles[near]
        held = np.isin(self.part[near], parts)
        if not own[np.isin(self.surface.part, parts)].all():
            skin = self.triangles(body)
            corners = skin.points[skin.faces]
            lo, hi = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
            held &= ((middles >= lo) & (middles <= hi)).all(axis=1)
            held[held] = np.abs(winding_numbers(*skin, middles[held])) > INSIDE
        return held

    def of(self, body: int) -> Int[np.ndarray, "m"]:
        """Tets with their middles in a body."""
        if body not in self._of:
            self._of[body] = np.flatnonzero(self.within(body, np.arange(len(self.tets))))
        return self._of[body]

    def around(self, places: Places, reach: float) -> Int[np.ndarray, "m"]:
        """Tets with their middles within ``reach`` [m] of any of the places."""
        from scipy.spatial import KDTree

        if not len(places):
            return np.zeros(0, dtype=np.int64)
        middle = places.mean(axis=0)
        ball = reach + np.linalg.norm(places - middle, axis=1).max()
        near = np.sort(self._tree.query_ball_point(middle, ball)).astype(np.int64)
        found, _ = KDTree(places).query(self.middles[near], distance_upper_bound=reach)
        return near[np.isfinite(found)]

    def samples(self, body: int) -> Places:
        """Places [m] on a body."""
        rng = np.random.default_rng(0)
        return sample(*self.triangles(body), rng=rng, count=SAMPLES).where


def parted_places(mesh: BodyTets, parts: Sequence[int], edge: float) -> Places:
    """Places [m] on closed bodies of some ``parts`` that are in pieces, where these are nearest.

    A gap wider than ``LONGEST`` long edges [m] of the lattice stays, as one that tets of other
    bodies reach around.
    """
    surface, found, is_open = mesh.surface, [NOWHERE], open_components(mesh.surface)
    for body in np.unique(surface.component[np.isin(surface.part, parts)]).tolist():
        held = mesh.of(body) if not is_open[body] else np.zeros(0, dtype=np.int64)
        piece = pieces_of(mesh.tets[held]) if len(held) else held
        if not piece.any():
            continue
        size = np.bincount(piece)
        large = (size >= min(FEW, CRUMB_OF_BODY * size.sum()))[piece]
        held, piece = held[large], np.unique(piece[large], return_inverse=True)[1].reshape(-1)
        of_all = np.full(len(mesh.tets), -1)
        of_all[held] = piece
        middles = mesh.middles[held[np.argsort(piece, kind="stable")]]
        pieces = np.split(middles, np.cumsum(np.bincount(piece))[:-1])
        for pair, where in narrowest(mesh.samples(body), pieces, edge):
            places = _gathered(where, BEAD * edge)
            around = mesh.around(places, REACH * edge)
            local = pieces_of(mesh.tets[around]) if len(around) else around
            here, there = (local[of_all[around] == one] for one in pair)
            if not np.isin(here, there).any():
                found.append(places)
    return np.concatenate(found)


def loose_contacts(mesh: BodyTets, found: TouchingPlaces, edge: float) -> Places:
    """Places [m] of contacts that are ``found``, but not in the mesh.

    There the tets of the one body and those of the other, within ``REACH`` long edges [m] of the
    lattice, do not hang together.
    """
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial.distance import cdist

    out, within = [NOWHERE], BEAD * edge
    for bodies in np.unique(found.bodies, axis=0):
        where = found.where[(found.bodies == bodies).all(axis=1)]
        # Groups of places [m] that are ``REACH`` apart, thinned to one a cell
        cells = np.floor(where / within)
        _, one, cell = np.unique(cells, axis=0, return_index=True, return_inverse=True)
        thinned = where[one]
        count, group = connected_components(cdist(thinned, thinned) <= REACH * edge, directed=False)
        of_all = group[cell.ravel()]
        for number in range(count):
            near = mesh.around(thinned[group == number], REACH * edge)
            if not len(near):
                continue
            piece = pieces_of(mesh.tets[near])
            ends = [np.bincount(piece[mesh.within(body, near)]) for body in bodies.tolist()]
            if all(len(end) for end in ends) and ends[0].argmax() == ends[1].argmax():
                continue
            places = _gathered(where[of_all == number], within)
            out.append(places)
            for body, end in zip(bodies.tolist(), ends, strict=True):
                if not len(end):  # the way on a body from the contact to the nearest of its tets
                    pair = [places, mesh.middles[mesh.of(body)]]
                    way = [at for _, at in narrowest(mesh.samples(body), pair, edge)]
                    out.append(_gathered(np.concatenate([NOWHERE, *way]), within))
    return np.concatenate(out)


def _gathered(where: Places, within: float) -> Float[np.ndarray, "fewer 3"]:
    """Means of groups of places [m], each ``within`` that distance [m] of its first one."""
    _, one = np.unique(np.floor(4 * where / within), axis=0, return_index=True)
    where, out = where[one], []
    while len(where):
        mine = np.linalg.norm(where - where[0], axis=1) <= within
        out.append(where[mine].mean(axis=0))
        where = where[~mine]
    return np.array(out).reshape(-1, 3)


def narrowest(
    where: Places, pieces: Sequence[np.ndarray], edge: float
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Pairs of pieces, and the places [m] at which the gap between them is narrowest.

    ``pieces`` are middles (tets, 3) [m]. A gap wider than ``LONGEST`` long edges [m] is none.
    """
    from scipy.spatial import KDTree

    # Distances [m] of the two nearest pieces, infinite from ``reach`` [m] on, and which they are
    reach = LONGEST * edge
    distance = np.full((len(where), 2), np.inf)
    which = np.zeros((len(where), 2), dtype=np.int64)
    for number, middles in enumerate(pieces):
        if not len(middles):
            continue
        lo, hi = middles.min(axis=0) - reach, middles.max(axis=0) + reach
        near = np.flatnonzero(((where > lo) & (where < hi)).all(axis=1))
        found = KDTree(middles).query(where[near], distance_upper_bound=reach)[0]
        three = np.column_stack([distance[near], found])
        order = np.argsort(three, axis=1, kind="stable")[:, :2]
        names = np.column_stack([which[near], np.full(len(near), number)])
        distance[near] = np.take_along_axis(three, order, axis=1)
        which[near] = np.take_along_axis(names, order, axis=1)
    which = np.sort(which, axis=1)
    near = np.flatnonzero(distance.sum(axis=1) <= reach)
    width = distance[near].sum(axis=1)
    pairs, pair = np.unique(which[near], axis=0, return_inverse=True)
    pair = pair.reshape(-1)
    least = np.full(len(pairs), np.inf)
    np.minimum.at(least, pair, width)
    narrow = width <= least[pair] + WIDER * edge
    for number, ends in enumerate(pairs):
        yield ends, where[near[narrow & (pair == number)]]


def pieces_of(tets: Tets) -> Int[np.ndarray, "tets"]:
    """Piece that each tet belongs to: those that hang together by faces."""
    _, left, right = facets(tets)
    return linked_groups(len(tets), left, right)


SPECK = 0.005  # of the volume: a loose piece with less is left out if nothing is said
# Of the volume: where specks have more together, as leaves or gravel, they are what the body is.
MANY = 0.025
ALL, LARGEST = "all", "largest"
TOUCHING = 2e-3  # of the diagonal: a nearer piece is no loose one
ASKED = 50  # faces of a piece that are asked how far they are from the others


class Kept(NamedTuple):
    """An asset without its floaters, how many these are and their share of the volume."""

    asset: Asset
    left_out: int = 0
    share: float = 0.0


def without_floaters(asset: Asset, keep: str | None) -> Kept:
    """Leave closed pieces out that touch no other: all smaller than ``SPECK`` by default.

    asset: Surfaces [m].
    keep: "all", "largest", so many of the largest ("3"), or the least share of the volume (".01").
    Raises UsageError: Where ``keep`` is none of these.
    """
    most, least = np.inf, SPECK
    if keep == ALL:
        return Kept(asset)
    if keep is not None:
        try:
            number = 1.0 if keep == LARGEST else float(keep)
        except ValueError:
            number = 0.0
        if not (0 < number < 1 or (number >= 1 and number.is_integer())):
            raise UsageError("floaters.keep", keep=keep)
        most, least = (number, 0.0) if number >= 1 else (np.inf, number)
    meshes = [part.mesh for part in asset.parts]
    start = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    points = np.concatenate([np.asarray(mesh.vertices, np.float64) for mesh in meshes])
    faces = np.concatenate([np.asarray(m.faces) + s for m, s in zip(meshes, start, strict=False)])
    part = np.repeat(np.arange(len(meshes)), [len(mesh.faces) for mesh in meshes])
    # Vertices at one place are one: a file may have each triangle's own
    place, of_all = np.unique(points, axis=0, return_inverse=True)
    faces = of_all.reshape(-1)[faces]
    surface = Surface(place, faces, part, edge_components(faces))
    volume = np.abs(component_volumes(surface)) * ~open_components(surface)
    rank = np.argsort(np.argsort(-volume, kind="stable"))
    loose = (volume > 0) & ((volume < least * volume.sum()) | (rank >= most))
    if keep is None and loose.any() and not loose.all():
        loose &= _apart(surface, loose)
        loose &= asset.sampled or bool(volume[loose].sum() <= MANY * volume.sum())
        # A part that is nothing but specks is one by intention
        named = np.ones(len(meshes), dtype=bool)
        named[part[~loose[surface.component]]] = False
        loose[surface.component[named[part]]] = False
    if not loose.any() or loose.all():
        return Kept(asset)
    parts, left = [], ~loose[surface.component]
    for number, one in enumerate(asset.parts):
        mine = left[part == number]
        if mine.any():
            mesh = one.mesh if mine.all() else one.mesh.copy()
            mesh.update_faces(mine)
            mesh.remove_unreferenced_vertices()
            parts.append(replace(one, mesh=mesh))
    share = float(volume[loose].sum() / volume.sum())
    return Kept(replace(asset, parts=tuple(parts)), int(loose.sum()), share)


def _apart(
    surface: Surface, small: Bool[np.ndarray, "components"]
) -> Bool[np.ndarray, "components"]:
    """Which of the small pieces are inside no large one and touch none."""
    points, faces, _, component = surface
    large = faces[~small[component]]
    near = TOUCHING * float(np.linalg.norm(np.ptp(points, axis=0)))
    mine = np.flatnonzero(small[component])
    some = mine[np.argsort(component[mine], kind="stable")]
    # At most so many faces of each, evenly
    first = np.searchsorted(component[some], np.arange(len(small) + 1))
    rank = np.arange(len(some)) - first[component[some]]
    some = some[rank % np.maximum(np.diff(first) // ASKED, 1)[component[some]] == 0]
    where = points[faces[some]].mean(axis=1)
    free = closest(where, points, large).distance > near
    free &= np.abs(winding_numbers(points, large, where)) < INSIDE
    out = small.copy()
    out[component[some[~free]]] = False
    return out
