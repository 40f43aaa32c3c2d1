"""The surface of a body as the IPC toolkit wants it: flat faces, pieces, and who may meet whom."""

from __future__ import annotations

from functools import cache
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ..discrete.forces import edge_nodes
from ..discrete.space import Space
from ..errors import InputError
from ..scene.components import piece_names, point_components
from ..scene.mesh import TetMesh

# Faces of one piece that are closer than so many thicknesses of the barrier at rest are the two
# sides of a wall: they cannot meet without crushing it.
WALL = 2.0
# Pieces closer than this share of the thickness touch: a barrier between them would blow them up.
TOUCH = 0.01


@cache
def ipc_toolkit() -> ModuleType:
    """The module ``ipctk`` (Ferguson et al.), silent and with one thread.

    Raises
    ------
    InputError
        Where it is not installed.
    """
    try:
        import ipctk
    except ImportError as error:
        raise InputError(
            "contact of a body with itself and of its pieces needs the package ipctk: "
            "pip install ipctk, or leave it out by --no-self-contact (self_contact=False)"
        ) from error
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


def flat_faces(mesh: TetMesh, space: Space) -> Int[np.ndarray, "faces 3"]:
    """Nodes of the outward faces; a quadratic one is four flat ones between its six nodes."""
    faces = mesh.boundary.faces
    if space.order == 1:
        return faces
    a, b, c = faces.T
    ab, bc, ca = edge_nodes(space, faces[:, [[0, 1], [1, 2], [2, 0]]]).T
    flat = [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
    return np.concatenate([np.stack(corners, axis=1) for corners in flat])


def collision_surface(
    mesh: TetMesh, space: Space, unit: float, thickness: float
) -> CollisionSurface:
    """Surface of ``mesh`` in lengths of ``unit`` [m]; ``thickness`` is the barrier's, in these."""
    ipc = ipc_toolkit()
    nodes, local = np.unique(flat_faces(mesh, space), return_inverse=True)
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
    walls = _walls(surface, thickness)
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
            f"{' and '.join(known[k] for k in joint)} overlap or touch at the start: "
            "they are not kept apart, nor kept from themselves"
        )
    if walled:
        notes.append(
            f"{' and '.join(known[k] for k in walled)}: faces nearer than "
            f"{WALL * thickness * unit:.2g} m to each other at the start are taken as the two "
            "sides of a wall and not kept apart"
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
    found = {int(k) for ids in touching for k in surface.piece[ids]}
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
                if meet and _cross(surface, a, b):
                    found |= {a, b}
    return sorted(found)


def _cross(surface: CollisionSurface, a: int, b: int) -> bool:
    """Whether the piece ``a`` goes through the piece ``b``, or through itself."""
    ipc, rest = ipc_toolkit(), surface.rest
    faces = surface.faces[np.isin(surface.piece[surface.faces[:, 0]], (a, b))]
    mesh = ipc.CollisionMesh(rest, ipc.edges(faces), np.asfortranarray(faces))
    if a != b:
        mesh.can_collide = ipc.make_vertex_patches_filter(surface.piece)
    return ipc.has_intersections(mesh, rest)


def _walls(surface: CollisionSurface, thickness: float) -> set[tuple[int, int]]:
    """Pairs of vertices of one piece whose faces or edges are close at rest."""
    surface.mesh.can_collide = ipc_toolkit().CollisionFilter()
    pairs = set()
    for ids in _close(surface, WALL * thickness):
        if (surface.piece[ids] == surface.piece[ids[0]]).all():
            pairs |= {(i, j) for i in ids for j in ids if i < j}
    return pairs


def _close(surface: CollisionSurface, reach: float) -> list[list[int]]:
    """Vertices of all pairs of faces and edges that are closer than ``reach`` at rest."""
    ipc, given = ipc_toolkit(), (surface.rest, surface.edges, surface.faces)
    candidates, near = ipc.Candidates(), ipc.NormalCollisions()
    candidates.build(surface.mesh, surface.rest, reach / 2)
    near.build(candidates, surface.mesh, surface.rest, reach)
    if not len(near):
        return []
    return [
        [i for i in pair.vertex_ids(*given[1:]) if i >= 0]
        for pairs in (candidates.fv_candidates, candidates.ee_candidates)
        for pair in pairs
        if pair.compute_distance(*given) < reach**2
    ]
