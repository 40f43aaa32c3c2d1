"""The mesher `stuffing`: solids in, a filling of tets out, the same one every time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache, lru_cache
from itertools import combinations, product
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ....converters.transfer import tets_of_cells
from ....fem.errors import UsageError
from ....fem.mesh import FACES, boundary_faces, face_areas, signed_volumes
from ....predictors.grid import Grid
from ...asset.cache import Runner
from ...asset.solids import INSIDE, Solids
from ...asset.surface import component_volumes, touching_places
from ...asset.triangles import (
    Places,
    Points,
    Tets,
    Triangles,
    closest,
    inside,
    linked_groups,
    winding_numbers,
)
from ..ftetwild import TETS_PER_CUBE, EngineTarget, Filling, LatticeFit, NoFilling, thicknesses
from ..guarantees import BLUNTEST, SHARPEST, bare_edges, separate
from ..pinches import manifold
from ..quality import corner_nodes, dihedral_angles, dihedral_cosines
from .lattice import (
    EDGES,
    MOST_NODES,
    NOWHERE,
    FeatureFinder,
    Lattice,
    NodeField,
    Offsets,
    SharpFeatures,
    ShellField,
    SolidField,
    edges_of,
    features_of,
    lattice_around,
    shared_edges,
    tets_around,
)
from .pieces import CRUMB_OF_BODY, BodyTets, came_off, loose_contacts, parted_places, pieces_of

DEPTH = 0.05  # long edges: on both sides of a visible feature at this depth are two regions
MOST_ADDED = 0.04  # of the volume: beads that leave the rest of its 5 % to the lattice
ROUNDS = 3  # of beads: what some have joined may show other pieces

_Filled = tuple[Filling, LatticeFit, np.ndarray]


def stuffed(solids: Solids, target: EngineTarget, runner: Runner) -> Filling:
    """Fill ``solids`` [m] with tets of a lattice with the edge that the ``target`` wants.

    It takes seconds, in this process: ``runner`` only hears of it. ``UsageError`` where the edge
    that was asked for gives more nodes than memory holds; one that was not asked for grows.
    """
    if runner.progress is not None:
        runner.progress("stuffing", 0.0)
    total = sum(shell.volume for shell in solids.shells)
    edge = target.lattice_edge(total)
    nodes = lattice_around((solids.bounds - solids.bounds[0]) / edge).node_count
    if nodes > MOST_NODES:
        if target.edge_is_given:
            raise UsageError(
                f"an edge of {edge:.3g} m gives a lattice of {nodes} nodes, the limit is "
                f"{MOST_NODES}: give a longer --edge-length, or --mesher ftetwild"
            )
        edge *= (nodes / MOST_NODES) ** (1 / 3)
    filling, fit, offsets = _unbeaded(solids, replace(target, beads=False), edge)
    if fit.parted_shares and not target.beads:
        return filling  # a finer lattice may keep it in one piece
    places = NOWHERE
    touch = touching_places(solids.surface, touching=target.epsilon, spacing=edge)
    for _ in range(ROUNDS):
        # Places [m] where the solids hang together and their tets do not
        tets = filling.mesh
        mesh = BodyTets(tets.points, tets.tets, filling.part, solids.surface)
        # Surfaces that are samples have thin places by their noise.
        thin = list(fit.thin_shares) if target.sharp else []
        parted = parted_places(mesh, thin, edge)  # it asks for whole bodies, which are kept
        more = np.concatenate([loose_contacts(mesh, touch, edge), parted])
        if not len(more):
            break
        places = np.concatenate([places, more])
        beaded = _filled(solids, target, edge, places, offsets)
        if beaded[1].beads > MOST_ADDED * total:
            break
        filling, fit, offsets = beaded
    return filling


@lru_cache(maxsize=1)  # an attempt with beads begins with what the one before it made
def _unbeaded(solids: Solids, target: EngineTarget, edge: float) -> _Filled:
    return _filled(solids, target, edge, NOWHERE)


def _filled(
    solids: Solids, target: EngineTarget, edge: float, beads: Places, offsets: Offsets | None = None
) -> _Filled:
    """Fill ``solids`` [m] by a lattice of long ``edge`` [m], with ``beads`` at places [m].

    Returns a filling, how it fits, and the offsets of its shells that gave their volumes.
    """
    field = SolidField(solids, origin=solids.bounds[0], edge=edge, beads=beads)
    found = stuff(field, sharp=target.sharp, offsets=offsets)
    tets, volumes = found.mesh.tets, found.mesh.volumes
    kept = carved(tets, volumes) if len(tets) else np.zeros(0, dtype=bool)
    if not kept.any():
        raise NoFilling(f"no part is as thick as the lattice's edge of {edge:.3g} m")
    points = solids.bounds[0] + edge * found.mesh.points
    kept[kept] = without_fragments(points, tets[kept], solids)
    mesh = manifold(points, tets[kept], reach=edge, worst=180 - BLUNTEST)
    part = field.part[found.mesh.region[kept]][mesh.origin]
    volumes = signed_volumes(mesh.points, mesh.tets)
    if (flat := int((volumes <= 0).sum())) > 0:
        raise NoFilling(f"{flat} tets are flat or inverted")
    errors: dict[int, float] = {}  # of parts that share a shell, that of the largest
    for shell, error in zip(field.shells, found.errors.tolist(), strict=True):
        for part_id in shell.parts.tolist():
            errors[part_id] = max(errors.get(part_id, 0.0), error, key=abs)
    fit = LatticeFit(
        errors,
        thin_shares(solids, edge),
        came_off(mesh.points, mesh.tets, part, solids, target.epsilon),
        closed_shares(solids, edge, Triangles(mesh.points, boundary_faces(mesh.tets).faces)),
        float(field.added.sum()) * edge**3,
    )
    rel = edge / target.diagonal
    used = replace(target, edge_length_rel=rel, epsilon_rel=rel, layers=1)
    return Filling(mesh, part, used, lattice=fit), fit, found.offsets


def stuff(field: SolidField, *, sharp: bool = True, offsets: Offsets | None = None) -> Matched:
    """Fill a field's shells, their volumes matched and their ``sharp`` edges kept.

    The search for offsets begins with ``offsets``, those of a lattice like it, if there are some.
    """
    lattice = lattice_around(field.bounds)
    nodes = NodeField(field, lattice.nodes(), lattice.together)
    features = [features_of(shell.triangles) for shell in field.shells]
    features = SharpFeatures(*(np.concatenate(values) for values in zip(*features, strict=True)))
    at_rest = np.zeros(len(field.shells))

    def visible(where: Places, normal: Places) -> np.ndarray:
        """Whether what is on both sides of a place differs."""
        sides = np.concatenate([where + DEPTH * normal, where - DEPTH * normal])
        out, inside = np.split(field.region_at(sides, at_rest), 2)
        return out != inside

    finder = FeatureFinder(features, visible) if sharp else None

    def build(offsets: Offsets) -> CutMesh:
        mesh = cut(lattice, nodes, offsets)
        if finder is None:
            return mesh
        mesh, on_edge = snapped(mesh, finder)
        return filled_ridges(mesh, on_edge, finder, lambda where: field.region_at(where, offsets))

    return matched(field, wanted_volumes(field), build, offsets)


# Volumes: how much of each shell is wanted, and offsets of the surfaces that give it.
#
# Cutting loses volume where a body is thin or convex, up to all of a rod of one long edge. A
# surface moved outward by the volume that lacks, over its area, gives it back. Lengths are in long
# edges.

SAMPLES = 32_000  # in the boxes of all shells; one of one volume in three is known to .5 %
FEWEST = 2_000  # in the box of one shell of many
HIDDEN = 0.01  # of its volume: a shell that keeps less beside smaller ones keeps but noise
CLOSED = 0.05  # relative: a shell whose exact volume is that near to the sampled one is closed
# Relative errors of volume with which the first passes and the later ones are content.
PASSES, MOST_PASSES = 2, 9
GOOD, GOOD_ENOUGH = 0.002, 0.009
# The volume of a part much thinner than a long edge jumps: so many passes that misplace more than
# this share of what the best one does are the last ones.
PATIENCE, NO_LESS = 3, 0.9
FARTHEST = 0.35  # largest offset: labels are known within a long edge of the surfaces
STEEPEST = 3.0  # how many times more or less than its area a volume may grow with the offset
SHORT = 0.02  # a shorter step tells of the neighbours' steps, not of a shell's own


class Matched(NamedTuple):
    """A mesh made with ``offsets``, its volume by shell and the one wanted: 0 where none is."""

    mesh: CutMesh
    offsets: np.ndarray
    volumes: np.ndarray
    wanted: np.ndarray

    @property
    def errors(self) -> Offsets:
        """Relative error of each shell's volume."""
        matters = self.wanted > 0
        return np.where(matters, self.volumes / np.where(matters, self.wanted, 1.0) - 1, 0.0)

    @property
    def error(self) -> float:
        """Largest relative error of a shell's volume."""
        return float(np.abs(self.errors).max())

    @property
    def misplaced(self) -> float:
        """Share of the wanted volume that is too much or too little, of all shells."""
        return float(np.abs(self.errors) @ self.wanted / self.wanted.sum())


def wanted_volumes(field: SolidField) -> Offsets:
    """Volume of each shell without what smaller shells take of it; 0 where they take all."""
    own = own_volumes(field.solids) / field.edge**3
    return np.where(own > 0, own + field.added, 0.0)


@lru_cache(maxsize=1)  # one body is filled by several lattices
def own_volumes(solids: Solids) -> Offsets:
    """Volume [m^3] of each shell, largest first, without what smaller ones take; 0 if it is all."""
    shells = [ShellField.of(one, solids.bounds[0], 1.0, 1) for one in solids.largest_first]
    rng = np.random.default_rng(0)
    count = max(SAMPLES // len(shells), FEWEST)
    samples, whole = [], np.zeros(len(shells))
    for rank, one in enumerate(shells):
        shell = one.shell
        # Labels tell how many more bodies share each point.
        held = inside(
            one.triangles,
            lambda where, shell=shell: shell.depth(where) - 1,
            one.bounds,
            rng=rng,
            count=count,
            crisp=shell.rimless,
        )
        # The exact volume of a closed shell without what its bodies share, else the sampled one
        exact = shell.volume - float(held.label @ held.cell)
        near = abs(exact - held.total) <= max(CLOSED, held.uncertainty) * held.total
        whole[rank] = exact if near else held.total
        samples.append(held)
    own = whole.copy()
    for rank, (where, _, cell, _) in enumerate(samples):
        taken = cell * whole[rank] / max(cell.sum(), np.finfo(float).tiny)
        for higher in shells[rank + 1 :]:
            free = ~higher.shell.contains(where)
            where, taken = where[free], taken[free]
        for lower in range(rank):
            own[lower] -= taken[shells[lower].shell.contains(where)].sum()
    return np.where(own > HIDDEN * whole, own, 0.0)


def matched(
    field: SolidField,
    wanted: Offsets,
    build: Callable[[Offsets], CutMesh],
    offsets: Offsets | None = None,
) -> Matched:
    """Build a mesh, and again with other offsets until the volumes are those ``wanted``.

    It begins with the ``offsets`` of a similar lattice, if there are some. The pass that misplaces
    the least volume counts: a bolt that no lattice holds does not decide over the seat.
    """
    idle = 0
    area = np.array([face_areas(*shell.triangles).sum() for shell in field.shells])
    search, best = Search(area), None
    offsets = np.zeros(len(area)) if offsets is None else offsets
    for number in range(MOST_PASSES):
        mesh = build(offsets)
        volumes = np.bincount(field.rank[mesh.region], mesh.volumes, len(field.shells))
        found = Matched(mesh, offsets, volumes.astype(np.float64), wanted)
        if best is None or found.misplaced < NO_LESS * best.misplaced:
            idle = 0
        else:
            idle += 1
        if best is None or found.misplaced < best.misplaced:
            best = found
        if idle == PATIENCE or found.error < (GOOD if number < PASSES else GOOD_ENOUGH):
            break
        lacks = np.where(wanted > 0, wanted - found.volumes, 0.0)
        offsets = search.next(offsets, lacks)
    assert best is not None
    return best


class Search:
    """Offsets at which several volumes lack nothing: secants within brackets, one for each."""

    def __init__(self, area: Offsets) -> None:
        """Begin with volumes that grow with the offset as fast as their ``area``."""
        self.area, self.slope = area, area
        self.low, self.high = np.full(len(area), -FARTHEST), np.full(len(area), FARTHEST)
        self.last: tuple[np.ndarray, np.ndarray] | None = None
        self.halved = np.zeros(len(area), dtype=bool)

    def next(self, offsets: Offsets, lacks: Offsets) -> Offsets:
        """Return offsets to try after these, which left volumes that lack so much."""
        if self.last is not None:
            step, grown = offsets - self.last[0], self.last[1] - lacks
            told = np.abs(step) >= SHORT
            steep = grown / np.where(told, step, 1.0)
            steep = np.clip(steep, self.area / STEEPEST, self.area * STEEPEST)
            self.slope = np.where(told, steep, self.slope)
            # Half the way to a bound and lacking still, or bounds that meet beside what is sought:
            # a neighbour's offset has moved the bound.
            stale = (self.halved & (lacks * self.last[1] > 0)) | (self.high - self.low < SHORT)
            self.low = np.where(stale & (lacks < 0), -FARTHEST, self.low)
            self.high = np.where(stale & (lacks > 0), FARTHEST, self.high)
        self.last = offsets, lacks
        # The volume of something thin jumps: a bracket keeps the search from jumping back.
        self.low = np.where(lacks > 0, np.maximum(self.low, offsets), self.low)
        self.high = np.where(lacks < 0, np.minimum(self.high, offsets), self.high)
        tried = offsets + lacks / self.slope
        self.halved = ((tried <= self.low) | (tried >= self.high)) & (lacks != 0)
        return np.where(self.halved, (self.low + self.high) / 2, tried)


# Tets left out: crumbs, and those at a bare edge, which doubling of nodes cannot separate.
#
# Halving such an edge, the other way, makes two flat tets of each good one.

CARVE_ROUNDS = 8  # what is left out may bare another edge; after them halving is left
CRUMB = 1e-3  # of the volume: a smaller piece that is a crumb of its body is held by nothing
MOST = 0.005  # of the volume: a body that would lose more is too thin for its lattice


def carved(tets: Tets, volumes: Float[np.ndarray, "tets"]) -> Bool[np.ndarray, "tets"]:
    """Which tets to keep, so that few edges with several groups of them are left."""
    keep = np.ones(len(tets), dtype=bool)
    for _ in range(CARVE_ROUNDS):
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


def without_fragments(points: Points, tets: Tets, solids: Solids) -> Bool[np.ndarray, "tets"]:
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
    tets: Tets, bare: Int[np.ndarray, "edges 2"], volumes: Float[np.ndarray, "tets"]
) -> Int[np.ndarray, "out"]:
    """Of the tets around each edge, those that do not hang together with the largest group."""
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
    group = linked_groups(len(tet), *links)
    weight = np.bincount(group, weights=volumes[tet])
    best = np.zeros(len(edges))
    np.maximum.at(best, edge, weight[group])
    return np.unique(tet[weight[group] < best[edge]])


# Chamfers along sharp edges, which snapping leaves between two nodes on an edge: filled by tets.
#
# Where a chamfer has nodes p, r on the sharp edge and the mesh has an edge qs across, the tet p,
# q, r, s is all that it lacks. Where no node came near, one is added on the sharp edge above qs,
# with a tet on either face at qs.
FLAT = 1e-3  # cubes of a long edge: a tet with less volume is flat
NEAR = 1.0  # long edges: farther from sharp edges no chamfer has an end
REACH = 0.7  # long edges: how far above an edge of the mesh a node is added

RegionAt = Callable[[Places], np.ndarray]


class Ridge(NamedTuple):
    """Edges (n, 2) of the boundary: the ``faces`` (n, 2, 3) at each, their ``tips``, the region."""

    edges: np.ndarray
    faces: np.ndarray
    tips: np.ndarray
    region: np.ndarray


def filled_ridges(
    mesh: CutMesh, on_edge: Bool[np.ndarray, "points"], features: FeatureFinder, region: RegionAt
) -> CutMesh:
    """Add the tets that chamfers lack, where they are good and lie in the ``region`` beside them.

    ``on_edge`` tells the points that lie on sharp edges.
    """
    near = np.flatnonzero(~mesh.free)
    near = near[features.on_edges(mesh.points[near], NEAR)[0]]
    for _ in range(ROUNDS):
        before = len(mesh.tets)
        # Tets on edges that run across between two points on a sharp edge which are not linked
        ridge = _ridges(mesh, near)
        key = np.array([len(mesh.points), 1])
        new = np.flatnonzero(on_edge[ridge.tips].all(axis=1))
        along = mesh.tets[on_edge[mesh.tets].sum(axis=1) > 1]
        known = edges_of(along, len(mesh.points))[0]
        new = new[~np.isin(np.sort(ridge.tips[new], axis=1) @ key, known @ key)]
        tets = np.column_stack([ridge.faces[new, 0], ridge.tips[new, 1]])
        mesh = _added(mesh, *(tets[:, None], ridge.region[new]), region)
        # Pairs of tets on edges across to new points on the sharp edge above them
        ridge = _ridges(mesh, near)
        across = np.flatnonzero(~on_edge[ridge.edges].any(axis=1))
        middle = mesh.points[ridge.edges[across]].mean(axis=1)
        above, where = features.on_edges(middle, REACH)
        across, where = across[above], where[above]
        number = len(mesh.points) + np.arange(len(across))
        tips = np.repeat(number[:, None, None], 2, axis=1)
        tets = np.concatenate([ridge.faces[across], tips], axis=-1)
        mesh = mesh._replace(
            points=np.concatenate([mesh.points, where]),
            free=np.concatenate([mesh.free, np.zeros(len(where), dtype=bool)]),
        )
        mesh = _added(mesh, tets, ridge.region[across], region)
        on_edge = np.r_[on_edge, np.ones(len(mesh.points) - len(on_edge), dtype=bool)]
        near = np.unique(mesh.tets[before:])  # what was refused elsewhere is refused again
        if not len(near):
            break
    return mesh


def _ridges(mesh: CutMesh, near: Int[np.ndarray, "near"]) -> Ridge:
    """Edges of the boundary between two faces of one region, at the points ``near``."""
    at = np.zeros(len(mesh.points), dtype=bool)
    at[near] = True
    some = np.flatnonzero(at[mesh.tets].any(axis=1))
    faces, owner = boundary_faces(mesh.tets[some])
    true = at[faces].any(axis=1)  # others only bound the chosen tets
    faces, owner = faces[true], some[owner[true]]
    edges, left, right = shared_edges(faces)
    same = at[edges].any(axis=1) & (mesh.region[owner[left]] == mesh.region[owner[right]])
    edges, sides = edges[same], np.stack([left[same], right[same]], axis=1)
    tips = faces[sides].sum(axis=-1) - edges.sum(axis=1, keepdims=True)
    return Ridge(edges, faces[sides], tips, mesh.region[owner[sides[:, 0]]])


def _added(
    mesh: CutMesh, groups: Int[np.ndarray, "n k 4"], regions: Int[np.ndarray, "n"], region: RegionAt
) -> CutMesh:
    """Add the groups of tets that are good all together, the fattest of those in each other's way.

    A face of the boundary that comes first gives positive volume where the fourth point is above.
    """
    count, size = groups.shape[:2]
    tets = groups.reshape(-1, 4)
    solid = (signed_volumes(mesh.points, tets) > FLAT).reshape(count, size).all(axis=1)
    groups, regions = groups[solid], regions[solid]
    angles = dihedral_angles(mesh.points, groups.reshape(-1, 4)).reshape(len(groups), 6 * size)
    good = (angles.min(axis=1) >= SHARPEST) & (angles.max(axis=1) <= BLUNTEST)
    groups, regions, fatness = groups[good], regions[good], angles[good].min(axis=1)
    middle = mesh.points[groups.reshape(-1, 4)].mean(axis=1)
    inside = (region(middle).reshape(-1, size) == regions[:, None]).all(axis=1)
    groups, regions = groups[inside], regions[inside]
    # Of groups that share a face, the fattest
    taken: set[tuple[int, ...]] = set()
    kept = []
    for number in np.argsort(-fatness[inside], kind="stable").tolist():
        faces = {
            face
            for tet in np.sort(groups[number], axis=1).tolist()
            for face in combinations(tet, 3)
        }
        if not faces & taken:
            taken |= faces
            kept.append(number)
    tets = np.concatenate([mesh.tets, groups[kept].reshape(-1, 4).astype(np.int32)])
    number = np.concatenate([mesh.region, np.repeat(regions[kept], size)])
    return on_used(mesh.points, tets, number, mesh.free)


# Nodes moved onto sharp edges and corners, as far as the tets around them stay good.

CORNER_REACH, CORNER_NODES = 0.9, 12  # long edges; how many nodes are tried for a corner
EDGE_REACHES = (0.175, 0.3, 0.65)  # long edges, the sure ones first


def snapped(mesh: CutMesh, features: FeatureFinder) -> tuple[CutMesh, Bool[np.ndarray, "points"]]:
    """Move nodes of the surfaces to ``features``; also which points lie on these then."""
    from scipy.spatial import KDTree

    guard = Guard(mesh)
    taken, corners = mesh.free.copy(), features.corners
    # For each corner the nearest nodes one after the other, until one may move there
    nodes = np.flatnonzero(~taken)
    if len(corners) and len(nodes):
        ranks: Any = np.arange(1, min(CORNER_NODES, len(nodes)) + 1)  # an array keeps the shape
        distance, index = KDTree(guard.points[nodes]).query(corners, k=ranks)
        open_ = np.ones(len(corners), dtype=bool)
        for distances, tried in zip(distance.T, nodes[index.T], strict=True):
            ask = np.flatnonzero(open_ & (distances < CORNER_REACH) & ~taken[tried])
            ask = ask[np.unique(tried[ask], return_index=True)[1]]
            moved = guard.move(tried[ask], corners[ask])
            taken[moved] = True
            open_[ask[np.isin(tried[ask], moved)]] = False
    for reach in EDGE_REACHES:
        nodes = np.flatnonzero(~taken)
        near, where = features.on_edges(guard.points[nodes], reach)
        taken[guard.move(nodes[near], where[near])] = True
    return mesh._replace(points=guard.points), taken & ~mesh.free


class Guard:
    """Points of a mesh that move only as far as no tet around them becomes bad."""

    def __init__(self, mesh: CutMesh) -> None:
        self.points = mesh.points.copy()
        self.tets = mesh.tets[~mesh.free[mesh.tets].all(axis=1)]
        _, sharp, blunt = _shape(self.points, self.tets)
        # Where a tet is worse than that already, it must not become worse still.
        self.sharpest = np.maximum(sharp, np.cos(np.radians(SHARPEST)))
        self.blunt = np.minimum(blunt, np.cos(np.radians(BLUNTEST)))

    def move(self, nodes: Int[np.ndarray, "n"], targets: Places) -> Int[np.ndarray, "moved"]:
        """Move ``nodes`` to their ``targets``, and undo the longest move of each bad tet.

        Returns the nodes that stay moved.
        """
        there = self.points.copy()
        there[nodes] = targets
        length = np.zeros(len(there))
        length[nodes] = np.linalg.norm(targets - self.points[nodes], axis=1)
        on = np.zeros(len(there), dtype=bool)
        on[nodes] = True
        touched = asked = np.flatnonzero(on[self.tets].any(axis=1))
        while asked.size:
            tets = self.tets[asked]
            volume, sharp, blunt = _shape(there, self.tets[asked])
            bad = (
                (volume <= 0) | (sharp > self.sharpest[asked]) | (blunt < self.blunt[asked])
            ) & on[tets].any(axis=1)
            worst = tets[bad]
            moves = np.where(on[worst], length[worst], -1.0)
            undone = np.unique(worst[np.arange(len(worst)), moves.argmax(axis=1)])
            on[undone] = False
            there[undone] = self.points[undone]
            changed = np.zeros(len(there), dtype=bool)
            changed[undone] = True
            asked = touched[changed[self.tets[touched]].any(axis=1)]
        self.points = there
        return nodes[on[nodes]]


def _shape(points: Points, tets: Tets) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Volume, and the cosines of the sharpest and the bluntest dihedral angle, of every tet."""
    cosine = dihedral_cosines(points, tets)
    return signed_volumes(points, tets), cosine.max(axis=0), cosine.min(axis=0)


# How a lattice fits: parts that are thinner than its edge, and gaps that are narrower.

RAYS = 4000  # from the surfaces inward: shares to a few per cent
OUT = 0.05  # of the edge: how far beyond both walls it is asked whether the part has ended
CONTACT = 0.02  # of the edge: walls nearer than that touch
ACROSS = (0.5, 0.1, 0.9)  # where on the way over a gap it is asked for tets
# Of the edge: a plate of 1 keeps its shape in the lattice, of .7 it is holes for the most part.
RESOLVED = 0.75
THIN_SHARE = 0.05  # of the surface that may be thinner: rims and ornaments that carry little


def thin_walls(solids: Solids, edge: float) -> tuple[np.ndarray, np.ndarray]:
    """Of rays through parts the part, and the thickness [m] there where it is below ``edge`` [m].

    A ray from a wall finds the wall opposite; beyond both must be another part or air, else it is
    a wall inside. There, and where it is thicker, that is infinite.
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
    return part[part >= 0], found[part >= 0]


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
    thickness = np.sort(thin_walls(solids, RESOLVED * edge)[1])
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


TETS_PER_CELL = 6
ASKED = 8  # places of a cell, one in each of its octants, that are asked for their part
MOST_CELLS = 500_000  # of the box: some seconds of questions


def filled(solids: Solids, target: EngineTarget, runner: Runner) -> Filling:
    """Fill ``solids`` [m] with cubes of a grid, six tets in each.

    Nothing is cut, so that nothing can fail; the surface is one of steps. A part gets as many
    cubes as its volume, those that it fills most: what is thinner than a cube keeps its volume and
    may come apart. ``runner`` only hears of it. ``NoFilling`` where no part is as large as a cube.
    """
    if runner.progress is not None:
        runner.progress("particles", 0.0)
    total, box = sum(shell.volume for shell in solids.shells), np.ptp(solids.bounds, axis=0)
    size = target.lattice_edge(total)
    if not target.edge_is_given:
        size *= (TETS_PER_CELL / TETS_PER_CUBE) ** (1 / 3)
    size = max(size, float(np.prod(box) / MOST_CELLS) ** (1 / 3))
    grid = Grid.around(solids.bounds, cells=int(np.ceil(box.max() / size)))
    rng = np.random.default_rng(0)
    cells = rng.permutation(np.argwhere(np.ones(grid.shape, dtype=bool)))  # of equals any
    octants = (np.array(list(np.ndindex(2, 2, 2))) + rng.random((len(cells), ASKED, 3))) / 2 - 0.5
    asked = solids.label(grid.to_world(cells[:, None] + octants).reshape(-1, 3)).reshape(-1, ASKED)
    parts, counts = np.unique(asked[asked >= 0], return_counts=True)
    part = np.full(len(cells), -1)
    for one in parts[np.argsort(counts, kind="stable")]:  # the smallest choose first
        held = np.where(part < 0, (asked == one).sum(axis=1), 0)
        most = np.argsort(-held, kind="stable")[: round((asked == one).sum() / ASKED)]
        part[most[held[most] > 0]] = one
    if not (part >= 0).any():
        raise NoFilling(f"no part is as large as a cube of {grid.h:.3g} m")
    cells, part = cells[part >= 0], part[part >= 0]
    mesh = separate(*tets_of_cells(grid, cells))
    rel = grid.h / target.diagonal
    used = EngineTarget(target.diagonal, rel, rel, tets=len(mesh.tets))
    fit = LatticeFit({}, thin_shares(solids, grid.h), {}, {})
    return Filling(mesh, part[mesh.origin // TETS_PER_CELL], used, lattice=fit)


# A cut nearer than this share of an edge moves the node onto the surface. Labelle and Schewchuk,
# table 1: safe for dihedral angles of 10.7 to 164.8 degrees; just below, as equality is not.
SAFE_LONG, SAFE_SHORT = 0.24999, 0.41189
WILD = -1  # the region of a node on the surface
# Degrees; tets between nodes that all moved onto surfaces are outside the guarantee, and are kept
# where they are as good as what is inside it.
WILD_ANGLES = 10.8, 164.7


class CutMesh(NamedTuple):
    """``points`` (n, 3), positive ``tets`` (m, 4), the ``region`` (m,) of each.

    ``free`` (n,) are the points that are nodes of the lattice still, not on any surface.
    """

    points: np.ndarray
    tets: np.ndarray
    region: np.ndarray
    free: np.ndarray

    @property
    def volumes(self) -> Float[np.ndarray, "tets"]:
        """Volume of every tet."""
        return signed_volumes(self.points, self.tets)


class DividedTets(NamedTuple):
    """Tets of positive or, where ``mirrored``, negative orientation, each of one region."""

    tets: np.ndarray
    region: np.ndarray
    mirrored: np.ndarray


def cut(lattice: Lattice, field: NodeField, offsets: Offsets) -> CutMesh:
    """Fill the regions with tets; the surface of each shell is moved outward by its offset."""
    nodes, region = field.where, field.regions(offsets)
    tets, mirrored = tets_around(lattice, region > 0)
    mixed = (region[tets] != region[tets[:, :1]]).any(axis=1)
    ends, edges = edges_of(tets[mixed], len(nodes))
    split = region[ends[:, 0]] != region[ends[:, 1]]
    share = np.full(len(ends), np.nan)
    share[split] = field.crossings(ends[split], region[ends[split]], offsets)
    points, wild = _warped(nodes, ends, share, lattice.even_count)
    region = np.where(wild, WILD, region)
    whole = DividedTets(tets[~mixed], region[tets[~mixed]].max(axis=1), mirrored[~mixed])
    a, b = region[ends].T
    cuts = np.flatnonzero((a != b) & (a != WILD) & (b != WILD))
    number = np.full(len(ends), -1)
    number[cuts] = len(nodes) + np.arange(len(cuts))
    start, end = nodes[ends[cuts, 0]], nodes[ends[cuts, 1]]
    points = np.concatenate([points, start + share[cuts, None] * (end - start)])
    local = np.concatenate([tets[mixed], number[edges]], axis=1)
    pieces, many = _divided(local, region[tets[mixed]], mirrored[mixed])
    kept = _wild_tets(lattice, field, points, wild, offsets)
    inner, points = junction_tets(local[many], region[tets[mixed][many]], points)
    # All pieces, positively oriented, on the points that they use
    pieces = [whole, *pieces, inner, kept]
    tets = np.concatenate([_positive(piece.tets, piece.mirrored) for piece in pieces])
    region = np.concatenate([piece.region for piece in pieces])
    inside = region > 0
    free = np.zeros(len(points), dtype=bool)
    free[: len(wild)] = ~wild
    return on_used(points, tets[inside], region[inside], free)


def on_used(
    points: Points, tets: Tets, region: Int[np.ndarray, "tets"], free: Bool[np.ndarray, "points"]
) -> CutMesh:
    """Return tets without the points that none of them uses."""
    used = np.zeros(len(points), dtype=bool)
    used[tets] = True
    tets = (np.cumsum(used) - 1).astype(np.int32)[tets]
    return CutMesh(points[used], tets, region, free[used])


def _warped(
    nodes: Float[np.ndarray, "nodes 3"],
    ends: Int[np.ndarray, "edges 2"],
    share: Float[np.ndarray, "edges"],
    even_count: int,
) -> tuple[Float[np.ndarray, "nodes 3"], Bool[np.ndarray, "nodes"]]:
    """Move nodes to the nearest cut that is too near, all at once; also which ones moved."""
    is_long = (ends[:, 0] < even_count) == (ends[:, 1] < even_count)
    safe = np.where(is_long, SAFE_LONG, SAFE_SHORT)
    length = np.where(is_long, 1.0, 0.75**0.5)
    close = [np.flatnonzero(s < safe) for s in (share, 1 - share)]  # no cut is NaN, never close
    node = np.concatenate([ends[c, k] for k, c in enumerate(close)])
    edge = np.concatenate(close)
    distance = np.concatenate([(share * length)[close[0]], ((1 - share) * length)[close[1]]])
    order = np.lexsort((distance, node))
    node, first = np.unique(node[order], return_index=True)
    edge = edge[order][first]
    start, end = nodes[ends[edge, 0]], nodes[ends[edge, 1]]
    moved = nodes.copy()
    moved[node] = start + share[edge, None] * (end - start)
    wild = np.zeros(len(nodes), dtype=bool)
    wild[node] = True
    return moved, wild


def _divided(
    local: Int[np.ndarray, "tets 10"], region: Tets, mirrored: Bool[np.ndarray, "tets"]
) -> tuple[list[DividedTets], Bool[np.ndarray, "tets"]]:
    """Cut the tets of one or two regions; say which have more."""
    high = region.max(axis=1)
    low = np.where(region == WILD, np.iinfo(region.dtype).max, region).min(axis=1)
    is_low, is_high = region == low[:, None], region == high[:, None]
    many = ~(is_low | is_high | (region == WILD)).all(axis=1)
    table, count = _table()
    pieces = []
    for mine, is_mine, other, asked in (
        (high, is_high, is_low & ~is_high, ~many & (high > 0)),
        (low, is_low, is_high, ~many & (low > 0) & (low < high)),
    ):
        asked = np.flatnonzero(asked)
        signs = np.where(is_mine[asked], 1, np.where(other[asked], -1, 0))
        code = (signs + 1) @ np.array([27, 9, 3, 1])  # the pattern's place in ``patterns``
        which, slot = np.nonzero(np.arange(table.shape[1]) < count[code][:, None])
        tets = np.take_along_axis(local[asked][which], table[code[which], slot], axis=1)
        pieces.append(DividedTets(tets, mine[asked][which], mirrored[asked][which]))
    return pieces, many


@cache
def _table() -> tuple[Int[np.ndarray, "81 3 4"], Int[np.ndarray, "81"]]:
    """The stencils of all patterns, and how many tets each has."""
    found = [stencil(pattern) for pattern in patterns()]
    count = np.array([len(tets) for tets in found])
    table = np.zeros((len(found), count.max(), 4), dtype=np.int64)
    for row, tets in zip(table, found, strict=True):
        row[: len(tets)] = np.array(tets).reshape(-1, 4)
    return table, count


def _wild_tets(
    lattice: Lattice,
    field: NodeField,
    points: Points,
    wild: Bool[np.ndarray, "nodes"],
    offsets: Offsets,
) -> DividedTets:
    """Tets whose four nodes all moved onto surfaces: kept where they lie inside and are good.

    Without them a plate thinner than a long edge falls apart.
    """
    tets, mirrored = tets_around(lattice, wild)
    all_wild = wild[tets].all(axis=1)
    tets, mirrored = tets[all_wild], mirrored[all_wild]
    region = field.region_at(points[tets].mean(axis=1), offsets)
    volume = signed_volumes(points, tets) * np.where(mirrored, -1, 1)
    good = (region > 0) & (volume > 0)
    tets, region, mirrored = tets[good], region[good], mirrored[good]
    angle = dihedral_angles(points, _positive(tets, mirrored))
    good = (angle.min(axis=1) > WILD_ANGLES[0]) & (angle.max(axis=1) < WILD_ANGLES[1])
    return DividedTets(tets[good], region[good], mirrored[good])


def _positive(tets: Tets, mirrored: Bool[np.ndarray, "tets"]) -> np.ndarray:
    return np.where(mirrored[:, None], tets[:, [0, 1, 3, 2]], tets)


# Tets in which three or four regions meet: cones from a point in their middle.

TRIPLES = ((1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2))
FACE_CENTRE, CENTRE = 10, 14  # after the corners and the cuts: points of the four faces and the tet


@cache
def cone(regions: tuple[int, ...]) -> tuple[tuple[tuple[int, ...], int], ...]:
    """Tets with their region for at least three regions at A, B, C, D, -1 on a surface.

    Each face is divided as its other tet divides it: where it has two regions by the rule of the
    stencils, where three around its centre.
    """
    out = []
    for number, face in enumerate(TRIPLES):
        mine = [regions[i] for i in face]
        if min(mine) < 0:
            wild = face[mine.index(-1)]
            a, b = (i for i in face if i != wild)
            parts = [((end, CUT[a, b], wild), regions[end]) for end in (a, b)]
        elif len(set(mine)) == 3:
            centre = FACE_CENTRE + number
            pairs = ((i, j) for i in face for j in face if i != j)
            parts = [((i, CUT[i, j], centre), regions[i]) for i, j in pairs]
        else:
            tip = next(i for i in face if mine.count(regions[i]) == 1)
            a, b = (i for i in face if i != tip)
            parts = [((tip, CUT[tip, a], CUT[tip, b]), regions[tip])]
            parts += [(triangle, regions[a]) for triangle in cut_face(tip, a, b)]  # type: ignore
        out += [((*triangle, CENTRE), region) for triangle, region in parts]
    return tuple(out)


def junction_tets(
    local: Int[np.ndarray, "tets 10"], regions: Int[np.ndarray, "tets 4"], points: Points
) -> tuple[DividedTets, np.ndarray]:
    """Divide tets by their corners' ``regions``; also the points with those in the middles.

    ``local`` are the tets' points, -1 where none is. One is added in every face of three regions,
    one for both its tets, and one in every tet.
    """
    faces = np.full((len(local), 4), -1)
    corners = local[:, TRIPLES]
    mine = np.sort(regions[:, TRIPLES], axis=-1)
    three = (mine[..., 0] >= 0) & (np.diff(mine, axis=-1) > 0).all(axis=-1)
    found, number = np.unique(np.sort(corners[three], axis=-1), axis=0, return_inverse=True)
    faces[three] = len(points) + number.reshape(-1)
    cuts = np.stack([local[:, [CUT[a, b], CUT[b, c], CUT[a, c]]] for a, b, c in TRIPLES], axis=1)
    middle = np.zeros((len(found), 3))
    middle[number.reshape(-1)] = points[cuts[three]].mean(axis=1)
    points = np.concatenate([points, middle])
    on = np.concatenate([regions < 0, local[:, 4:] >= 0], axis=1)
    weight = on / np.maximum(on.sum(axis=1), 1)[:, None]
    inner = np.einsum("tk,tki->ti", weight, points[local])
    local = np.column_stack([local, faces, len(points) + np.arange(len(local))])
    points = np.concatenate([points, inner])
    rows, group = np.unique(regions, axis=0, return_inverse=True)
    tets, region = [np.zeros((0, 4), np.int64)], [np.zeros(0, np.int64)]
    for number, row in enumerate(rows.tolist()):
        mine = local[group.reshape(-1) == number]
        for tet, within in cone(tuple(row)):
            tets.append(mine[:, tet])
            region.append(np.full(len(mine), within))
    found = np.concatenate(tets)
    mirrored = signed_volumes(points, found) < 0
    return DividedTets(found, np.concatenate(region), mirrored), points


# How a tet is divided by the signs of its four corners: one table for all 81 patterns.
#
# A corner is inside (+), outside (-) or on the surface (0); where two corners have opposite signs
# their edge is cut. Labelle and Shewchuk, "Isosurface stuffing" (SIGGRAPH 2007), section 3: where
# a face has two cuts, the diagonal of what they leave goes through the cut of a long edge, and
# where both are on short ones to the end of the long edge that the parity of the coordinates
# names, so that both tets at a face choose the same.

Pattern = tuple[int, ...]  # signs of A, B, C, D
Tet = tuple[int, ...]  # four points: 0 to 3 are the corners, 4 to 9 the cuts of the edges

CUT = {pair: 4 + k for k, edge in enumerate(EDGES) for pair in (edge, edge[::-1])}
LONG = (CUT[0, 1], CUT[2, 3])
# Of the faces at a long edge: its end that exceeds the tip in an even number of coordinates for
# odd edges, in an odd number for even ones. (Even on all faces, or odd, is one-sided: the tets
# inside and outside of a surface would choose other diagonals.)
END = {(0, 1, 2): 0, (0, 1, 3): 1, (2, 3, 0): 2, (2, 3, 1): 3}
# One tet of the lattice, A exceeding C in an even number of coordinates, positively oriented.
CORNERS = np.array([[0.5, 0.5, -0.5], [0.5, 0.5, 0.5], [0, 0, 0], [1, 0, 0]])
CORNERS = np.concatenate([CORNERS, [(CORNERS[i] + CORNERS[j]) / 2 for i, j in EDGES]])


def patterns() -> Iterator[Pattern]:
    """All 81 patterns of signs of A, B, C, D, in the order of their codes."""
    yield from product((-1, 0, 1), repeat=4)


@cache
def stencil(signs: Pattern) -> tuple[Tet, ...]:
    """Positively oriented tets that fill the inside of a tet with these signs of A, B, C, D."""
    inside, outside, surface = ([i for i in range(4) if signs[i] == s] for s in (1, -1, 0))
    if not inside:
        tets: list[Tet] = []
    elif not outside:
        tets = [(0, 1, 2, 3)]
    elif len(inside) == 1:
        tets = [(inside[0], *(CUT[inside[0], n] for n in outside), *surface)]
    elif len(inside) == 2 and surface:
        quad = cut_face(outside[0], inside[0], inside[1])
        tets = [(*triangle, *surface) for triangle in quad]
    elif len(inside) == 3:
        tets = _prism(inside, [CUT[p, outside[0]] for p in inside], outside, inside)
    else:
        one, two = ([p, *(CUT[p, n] for n in outside)] for p in inside)
        tets = _prism(one, two, outside, inside)
    # Of positive volume
    edges = [CORNERS[list(tet[1:])] - CORNERS[tet[0]] for tet in tets]
    return tuple(
        tet if np.linalg.det(edge) > 0 else (*tet[:2], tet[3], tet[2])
        for tet, edge in zip(tets, edges, strict=True)
    )


def face_diagonal(tip: int, first: int, second: int) -> set[int]:
    """Diagonal of the quadrilateral that cuts of both edges at ``tip`` leave of a face."""
    for end, other in ((first, second), (second, first)):
        if CUT[tip, end] in LONG:
            return {CUT[tip, end], other}
    end = END[min(first, second), max(first, second), tip]
    return {end, CUT[tip, second if end == first else first]}


def cut_face(tip: int, first: int, second: int) -> list[Tet]:
    """Return the two triangles of that quadrilateral."""
    near, far = CUT[tip, first], CUT[tip, second]
    if face_diagonal(tip, first, second) == {second, near}:
        return [(first, second, near), (second, near, far)]
    return [(first, second, far), (first, near, far)]


def _prism(
    top: Sequence[int], bottom: Sequence[int], outside: Sequence[int], inside: Sequence[int]
) -> list[Tet]:
    """Three tets of a prism that keep the diagonals of its cut faces; the fattest way."""
    fixed = [face_diagonal(tip, *ends) for tip in outside for ends in combinations(inside, 2)]
    sides = [(k, (k + 1) % 3) for k in range(3)]
    rims = [{s[i], s[j]} for s in (top, bottom) for i, j in sides]
    rims += [{top[k], bottom[k]} for k in range(3)]
    ways = []
    for leaning in product((False, True), repeat=3):
        diagonals = [
            {top[j], bottom[i]} if lean else {top[i], bottom[j]}
            for lean, (i, j) in zip(leaning, sides, strict=True)
        ]
        edges = [*rims, *diagonals]
        tets = [
            tet
            for tet in combinations([*top, *bottom], 4)
            if all(set(pair) in edges for pair in combinations(tet, 2))
        ]
        if len(tets) == 3 and all(diagonal in diagonals for diagonal in fixed):
            corners = CORNERS[tets]
            edges = corners[:, :, None] - corners[:, None]
            longest = np.linalg.norm(edges, axis=-1).max(axis=(1, 2))
            volume = np.abs(np.linalg.det(edges[:, 1:, 0]))
            ways.append((float((volume / longest**3).min()), tets))
    return max(ways)[1]  # type: ignore
