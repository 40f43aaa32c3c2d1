"""Contact of a body with itself and of its pieces with each other: the barrier of IPC."""

from __future__ import annotations

from functools import cache
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ..elements.assembly import BlockMatrix, GrownPattern, add_blocks
from ..elements.forces import edge_nodes
from ..elements.space import Space
from ..errors import InputError
from ..mesh import TetMesh, area_vectors, material_of, piece_names, point_components
from ..note import Note

# Barrier stiffness as a fraction of E, of the softest against itself: stiff against the body, which
# is a thousand barrier thicknesses wide, and soft enough for Newton.
STIFFNESS_SHARE = 0.1
# What is near is looked for this many thicknesses further than the barrier acts, so that the list
# holds until something has moved so far.
MARGIN = 2.0
# Where nothing is near, how far it is to the next is looked for within this fraction of an edge.
FAR = 0.5
# A list serves the body where it has turned to while it bent by no more than this fraction of it.
TURNED = 0.5
# A Newton step may use up this fraction of a gap.
GAP_SHARE = 0.9
# Additive steps of one pair's continuous detection; what has none left stops there.
ADVANCES = 1000
# Sliding slower than this fraction of the body's diagonal per second is sticking.
STICK_SHARE = 1e-3


class PieceForce(NamedTuple):
    """``force`` (3,) [N] on the piece ``on`` by the piece ``by``."""

    on: int
    by: int
    force: np.ndarray


class _Near(NamedTuple):
    """What may meet while nothing moves further than ``room`` from ``places`` (n, 3).

    ``candidates`` are None where nothing can.
    """

    places: np.ndarray
    room: float
    candidates: Any


class SelfContact:
    """Barrier energy of the surface of a body against itself.

    Faces and edges that are no neighbours keep out of each other: for a pair of area A at distance
    d < dhat the energy is k A dhat b(d^2 / dhat^2), b(s) = -(s - 1)^2 log s (Li et al. 2020, IPC;
    areas as in Li et al. 2023), by the IPC toolkit, as are its distances and continuous collision
    detection. Lengths inside are in units of the body's diagonal. Quadratic faces count as four
    flat ones.

    mesh, space: The body and its nodes.
    thickness: Distance [m] at which faces begin to push.
    friction: Coefficient of Coulomb friction [1].
    """

    def __init__(self, mesh: TetMesh, space: Space, thickness: float, friction: float) -> None:
        ipc = ipc_toolkit()
        self.unit = float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
        self.thickness, self.friction = thickness / self.unit, friction
        self.surface = collision_surface(mesh, space, self.unit, self.thickness)
        self.notes, self.piece = self.surface.notes, self.surface.piece
        ends = self.surface.rest[self.surface.edges]
        self.reach = FAR * float(np.median(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)))
        E = material_of(mesh).E[mesh.boundary.tet].min()
        self.stiffness = STIFFNESS_SHARE * float(E) * self.thickness * self.unit**3
        self.origin, self.steps = mesh.bounds[0], ipc.AdditiveCCD(ADVANCES, GAP_SHARE)
        self._near: _Near | None = None
        self._at: tuple[np.ndarray | None, Any] = (None, None)
        self._pattern, self._sliding = GrownPattern(), None
        self.nodes, self._rest = self.surface.nodes, self.surface.rest
        # Begin to push no earlier than what starts that close, so that nothing is pushed yet
        near = self._collisions(self._rest, self._find(self._rest).candidates)
        if near is not None and len(near):
            closest = float(np.sqrt(near.compute_minimum_distance(self.surface.mesh, self._rest)))
            self.stiffness *= closest / self.thickness
            self.thickness = closest
            self._near = None
        self.potential = ipc.BarrierPotential(
            ipc.NormalizedClampedLogBarrier(), self.thickness, self.stiffness
        )

    def _places(self, u: np.ndarray) -> Float[np.ndarray, "n 3"]:
        return np.asfortranarray(self._rest + u[self.nodes] / self.unit)

    def _collisions(self, x: np.ndarray, candidates: Any) -> Any:
        """Pairs of ``candidates`` that push each other; None where there are none."""
        if candidates is None:
            return None
        pairs = ipc_toolkit().NormalCollisions()
        pairs.use_area_weighting = True
        pairs.build(candidates, self.surface.mesh, x, self.thickness)
        return pairs if len(pairs) else None

    def _find(self, x: np.ndarray) -> _Near:
        """What may meet around ``x``, the last list while it holds."""
        if self._near is not None:
            if _moved(self._near.places, x) <= self._near.room:
                return self._near
            # How far any place has moved beside the nearest rigid motion of all (Kabsch 1976)
            before = self._near.places
            a, b = before - before.mean(axis=0), x - x.mean(axis=0)
            U, _, V = np.linalg.svd(a.T @ b)
            U[:, 2] *= np.sign(np.linalg.det(U) * np.linalg.det(V))
            bent = float(np.sqrt(np.square(a @ (U @ V) - b).sum(axis=1).max()))
            if bent <= TURNED * self._near.room:  # as far apart as before, where it has turned to
                self._near = self._near._replace(places=x, room=self._near.room - bent)
                return self._near
        ipc, mesh = ipc_toolkit(), self.surface.mesh
        candidates, near = ipc.Candidates(), ipc.NormalCollisions()
        reach = max(self.reach, (1 + 2 * MARGIN) * self.thickness)
        candidates.build(mesh, x, reach / 2)
        near.build(candidates, mesh, x, reach)
        free = np.sqrt(near.compute_minimum_distance(mesh, x)) if len(near) else reach
        room = (float(free) - self.thickness) / 2
        if room < MARGIN * self.thickness:
            room = MARGIN * self.thickness
            candidates.build(mesh, x, self.thickness / 2 + room)
        else:
            candidates = None
        self._near = _Near(x, room, candidates)
        return self._near

    def _here(self, u: np.ndarray) -> tuple[np.ndarray, Any]:
        """Places at ``u`` and the pairs that push there; the last ones are remembered."""
        if self._at[0] is not u:
            x = self._places(u)
            self._at = (u, (x, self._collisions(x, self._find(x).candidates)))
        return self._at[1]

    def gap(self, u: np.ndarray) -> float:
        """Smallest distance [m] of what is near; infinite where nothing pushes."""
        x, pairs = self._here(u)
        if pairs is None:
            return np.inf
        return self.unit * float(np.sqrt(pairs.compute_minimum_distance(self.surface.mesh, x)))

    def barrier(self, u: np.ndarray) -> float:
        """Energy of the barrier [J]."""
        x, pairs = self._here(u)
        return 0.0 if pairs is None else float(self.potential(pairs, self.surface.mesh, x))

    def friction_energy(self, u: np.ndarray) -> float:
        """Potential of friction [J]."""
        if self._sliding is None:
            return 0.0
        rubbed, potential = self._sliding
        return float(potential(rubbed, self.surface.mesh, self._slip(u)))

    def rubbed(self, u: np.ndarray) -> float:
        """Energy [J] that friction took in the step that ends at ``u``."""
        if self._sliding is None:
            return 0.0
        rubbed, potential = self._sliding
        slip = self._slip(u)
        return float(potential.gradient(rubbed, self.surface.mesh, slip) @ slip.reshape(-1))

    def push(self, u: np.ndarray) -> Float[np.ndarray, "n 3"]:
        """Gradient [N] of the barrier at the nodes of the surface."""
        x, pairs = self._here(u)
        if pairs is None:
            return np.zeros_like(x)
        return self.potential.gradient(pairs, self.surface.mesh, x).reshape(-1, 3) / self.unit

    def add_gradient(self, u: np.ndarray, out: np.ndarray) -> None:
        """Add the gradient [N] of the energy to ``out`` (nodes, 3)."""
        rub = 0.0
        if self._sliding is not None:
            rubbed, potential = self._sliding
            slope = potential.gradient(rubbed, self.surface.mesh, self._slip(u))
            rub = slope.reshape(-1, 3) / self.unit
        if self._here(u)[1] is not None or self._sliding is not None:
            out[self.nodes] += self.push(u) + rub

    def with_hessian(self, u: np.ndarray, matrix: BlockMatrix) -> BlockMatrix:
        """``matrix`` with the positive part of the Hessian [N/m], grown by the pairs that meet."""
        ipc, mesh, (x, pairs) = ipc_toolkit(), self.surface.mesh, self._here(u)
        positive, parts = ipc.PSDProjectionMethod.CLAMP, []
        if pairs is not None:
            parts.append(self.potential.hessian(pairs, mesh, x, positive))
        if self._sliding is not None:
            rubbed, potential = self._sliding
            parts.append(potential.hessian(rubbed, mesh, self._slip(u), positive))
        if not parts:
            return matrix
        blocks = sum(parts[1:], parts[0]).tobsr((3, 3))
        i = self.nodes[np.repeat(np.arange(len(x)), np.diff(blocks.indptr))]
        j = self.nodes[blocks.indices]
        matrix = self._pattern.room(matrix, i, j)
        add_blocks(matrix, i, j, blocks.data / self.unit**2)
        return matrix

    def begin(self, u: np.ndarray, step: float) -> None:
        """Start a ``step`` [s] at ``u``: sliding is counted from there."""
        self._start, self._step, self._sliding = self._places(u), step, None

    def _slip(self, u: np.ndarray) -> np.ndarray:
        return np.asfortranarray(self._places(u) - self._start)

    def lag_friction(self, u: np.ndarray) -> None:
        """Freeze normal forces and tangents at ``u`` for the friction of the next solve."""
        ipc, (x, pairs) = ipc_toolkit(), self._here(u)
        self._sliding = None
        if self.friction and pairs is not None:
            rubbed = ipc.TangentialCollisions()
            rubbed.build(self.surface.mesh, x, pairs, self.potential, self.friction)
            self._sliding = (rubbed, ipc.FrictionPotential(STICK_SHARE * self._step))

    def longest_step(self, u: np.ndarray, step: np.ndarray) -> float:
        """Share of ``step`` [m] on which nothing meets, leaving a tenth of every gap."""
        ipc, mesh = ipc_toolkit(), self.surface.mesh
        start, end = self._places(u), self._places(u + step)
        before, after = self._find(start), self._find(end)
        candidates = before.candidates
        if before.candidates is None and after.candidates is None:
            if _moved(before.places, end) <= before.room + after.room:
                return 1.0
        if _moved(before.places, end) > before.room:
            end = np.asfortranarray(end - (end - start).mean(axis=0))  # together they do not meet
            candidates = ipc.Candidates()
            candidates.build(mesh, start, end, self.thickness / 2)
        if candidates is None:
            return 1.0
        return candidates.compute_collision_free_stepsize(mesh, start, end, 0.0, self.steps)

    def piece_forces(self, u: np.ndarray) -> tuple[PieceForce, ...]:
        """Force of every piece on every other that it touches."""
        x, pairs = self._here(u)
        if self.piece.max() == 0 or pairs is None:
            return ()
        pushing = [(pairs, self.potential, x)]
        if self._sliding is not None:
            pushing.append((*self._sliding, self._slip(u)))
        edges, faces = self.surface.edges, self.surface.faces
        total: dict[tuple[int, int], np.ndarray] = {}
        for collisions, potential, at in pushing:
            for k in range(len(collisions)):
                pair = collisions[k]
                ids = [i for i in pair.vertex_ids(edges, faces) if i >= 0]
                slope = potential.gradient(pair, at[ids].reshape(-1)).reshape(-1, 3)
                piece = self.piece[ids]
                a, b = int(piece.min()), int(piece.max())
                if a != b:
                    force = -slope[piece == b].sum(axis=0) / self.unit
                    total[a, b] = total.get((a, b), 0.0) + force
        return tuple(
            piece_force
            for (a, b), force in sorted(total.items())
            for piece_force in (PieceForce(b, a, force), PieceForce(a, b, -force))
        )


def _moved(before: np.ndarray, after: np.ndarray) -> float:
    """How far any place has moved beside the mean of all."""
    move = after - before
    move -= move.mean(axis=0)
    return float(np.sqrt(np.einsum("nd,nd->n", move, move).max()))


# Faces of one piece that are closer than so many thicknesses of the barrier at rest are the two
# sides of a wall: they cannot meet without crushing it.
WALL = 2.0
# Pieces closer than this share of the thickness touch: a barrier between them would blow them up.
TOUCH = 0.01


@cache
def ipc_toolkit() -> ModuleType:
    """The module ``ipctk`` (Ferguson et al.), silent and with one thread.

    Raises InputError: Where it is not installed.
    """
    try:
        import ipctk
    except ImportError as error:
        raise InputError("self_contact.contact_body") from error
    ipctk.set_logger_level(ipctk.LoggerLevel.off)
    ipctk.set_num_threads(1)
    return ipctk


class CollisionSurface(NamedTuple):
    """Surface of a body in units of its diagonal.

    ``nodes`` (n,) are those of the space, ``rest`` (n, 3) their places, ``edges`` and ``faces``
    local, ``piece`` (n,) the number of the piece that each is of, ``mesh`` the toolkit's own;
    ``notes`` say what is not kept apart.
    """

    nodes: Int[np.ndarray, "n"]
    rest: Float[np.ndarray, "n 3"]
    edges: Int[np.ndarray, "edges 2"]
    faces: Int[np.ndarray, "faces 3"]
    piece: Int[np.ndarray, "n"]
    mesh: Any
    notes: tuple[str, ...]


def collision_surface(
    mesh: TetMesh, space: Space, unit: float, thickness: float
) -> CollisionSurface:
    """Surface of ``mesh`` in lengths of ``unit`` [m]; ``thickness`` is the barrier's, in these."""
    ipc, flat = ipc_toolkit(), mesh.boundary.faces
    if space.order == 2:  # a quadratic face is four flat ones between its six nodes
        a, b, c = flat.T
        ab, bc, ca = edge_nodes(space, flat[:, [[0, 1], [1, 2], [2, 0]]]).T
        four = [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
        flat = np.concatenate([np.stack(corners, axis=1) for corners in four])
    nodes, local = np.unique(flat, return_inverse=True)
    faces = np.asfortranarray(local.reshape(-1, 3), dtype=np.int32)
    rest = np.asfortranarray((space.nodes[nodes] - mesh.bounds[0]) / unit)
    edges = ipc.edges(faces)
    owner = np.zeros(len(space.nodes), dtype=np.int64)
    owner[space.elements] = point_components(mesh)[mesh.tets[:, :1]]
    piece = owner[nodes]
    surface = CollisionSurface(
        nodes, rest, edges, faces, piece, ipc.CollisionMesh(rest, edges, faces), ()
    )
    joint = _overlapping(surface, thickness)
    # Pairs of vertices of one piece whose faces or edges are close at rest
    surface.mesh.can_collide = ipc_toolkit().CollisionFilter()
    walls = set()
    for ids in _close(surface, WALL * thickness):
        if (surface.piece[ids] == surface.piece[ids[0]]).all():
            walls |= {(i, j) for i in ids for j in ids if i < j}
    patch = np.where(np.isin(piece, joint), piece.max() + 1, piece.max() + 2 + np.arange(len(rest)))
    surface.mesh.can_collide = ipc.make_vertex_patches_filter(patch) & ipc.make_sparse_filter(
        dict.fromkeys(walls, False), True
    )
    walled = sorted({int(piece[i]) for pair in walls for i in pair} - {*joint})
    if not (joint or walled):
        return surface
    known, notes = piece_names(mesh), []
    if joint:
        notes.append(
            Note("self_contact.overlap_touch", known=" and ".join(known[k] for k in joint))
        )
    if walled:
        notes.append(
            Note(
                "self_contact.faces_nearer",
                known=" and ".join(known[k] for k in walled),
                wall=WALL * thickness * unit,
            )
        )
    return surface._replace(notes=tuple(notes))


def _overlapping(surface: CollisionSurface, thickness: float) -> list[int]:
    """Pieces that cross or touch themselves or another at rest."""
    ipc, mesh, rest = ipc_toolkit(), surface.mesh, surface.rest
    count = int(surface.piece.max()) + 1
    crossed = ipc.has_intersections(mesh, rest)
    if count == 1:
        return [0] if crossed else []
    mesh.can_collide = ipc.make_vertex_patches_filter(surface.piece)
    touching = _close(surface, TOUCH * thickness)
    joint = {int(k) for ids in touching for k in surface.piece[ids]}
    if crossed:
        boxes = np.array(
            [
                (x.min(axis=0), x.max(axis=0))
                for x in (rest[surface.piece == k] for k in range(count))
            ]
        )
        for a in range(count):
            for b in range(a, count):
                meet = (boxes[a, 0] <= boxes[b, 1]).all() and (boxes[b, 0] <= boxes[a, 1]).all()
                if not meet:
                    continue
                faces = surface.faces[np.isin(surface.piece[surface.faces[:, 0]], (a, b))]
                both = ipc.CollisionMesh(rest, ipc.edges(faces), np.asfortranarray(faces))
                if a != b:
                    both.can_collide = ipc.make_vertex_patches_filter(surface.piece)
                if ipc.has_intersections(both, rest):
                    joint |= {a, b}
    return sorted(joint)


def _close(surface: CollisionSurface, reach: float) -> list[list[int]]:
    """Vertices of all pairs of faces and edges that are closer than ``reach`` at rest."""
    ipc, surfaces = ipc_toolkit(), (surface.rest, surface.edges, surface.faces)
    candidates, near = ipc.Candidates(), ipc.NormalCollisions()
    candidates.build(surface.mesh, surface.rest, reach / 2)
    near.build(candidates, surface.mesh, surface.rest, reach)
    if not len(near):
        return []
    return [
        [i for i in pair.vertex_ids(*surfaces[1:]) if i >= 0]
        for pairs in (candidates.fv_candidates, candidates.ee_candidates)
        for pair in pairs
        if pair.compute_distance(*surfaces) < reach**2
    ]


class ContactPressures(NamedTuple):
    """Largest contact pressures [Pa]: by every one of the ``obstacles``, by the body's ``own``."""

    obstacles: Float[np.ndarray, "obstacles"]
    own: float


def largest_pressure(
    mesh: TetMesh,
    space: Space,
    u: Float[np.ndarray, "nodes 3"],
    force: Float[np.ndarray, "nodes 3"],
) -> float:
    """Largest pressure [Pa] of nodal contact forces [N] at the displacement ``u`` [m].

    Over a third of the area of the faces around a point, as seen along its force: a side wall
    carries nothing of what presses the base. Forces in the middle of quadratic edges are halved
    between their ends, which leaves a uniform pressure uniform.
    """
    if not force.any():
        return 0.0
    points = force[: space.points].copy()
    np.add.at(points, space.edges, 0.5 * force[space.points :, None])
    size = np.linalg.norm(points, axis=1)
    faces = mesh.boundary.faces
    way = points / np.where(size > 0, size, 1.0)[:, None]
    vectors = area_vectors(mesh.points + u[: space.points], faces)
    seen = np.maximum(-np.einsum("fd,fkd->fk", vectors, way[faces]), 0.0) / 3
    area = np.bincount(faces.ravel(), seen.ravel(), minlength=len(size))
    return float((size[area > 0] / area[area > 0]).max(initial=0.0))
