"""Discretisation error of a body at rest, and meshes refined where it is; elements of motions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Int

from ..elements.assembly import discretise, node_supports
from ..elements.elastic import constrained_stiffness
from ..elements.space import EDGES, LARGEST_MOVING, LARGEST_P2, Space, affordable_order, p2_unknowns
from ..errors import ConvergenceError, InputError
from ..linalg.solver import rough_factor
from ..mesh import TetMesh, material_of
from ..note import Note
from ..scene.loads import WHOLE
from ..scene.scene import Scene
from ..scene.supports import Supports
from .mesh_error import MeshError, estimate_error
from .modal import QUICK, factor_fits, natural_modes
from .result import BENDS_ALIKE, LOCKING, SAFETY, DiscretisationError, StaticResult
from .statics import solve_static

# Unknowns of quadratic elements up to which a motion takes them where linear ones lock in bending.
FEW_UNKNOWNS = 20_000
LINEAR_TAKEN = Note("error.linear_elements", largest_p2=LARGEST_P2)


class MotionElements(NamedTuple):
    """Order of a motion's elements, and how many times too stiff they are: NaN, not known."""

    order: int
    stiffening: float = np.nan


def motion_order(mesh: TetMesh) -> int:
    """Linear elements for a motion, but quadratic ones where linear ones lock, if affordable."""
    locks = (material_of(mesh).nu > LOCKING).any()
    return affordable_order(mesh, LARGEST_MOVING) if locks else 1


def motion_elements(
    mesh: TetMesh, supports: Supports | None, order: int | None = None, *, most: int = FEW_UNKNOWNS
) -> MotionElements:
    """Elements of a motion: of ``order`` where it is given, else ``motion_order``'s.

    Quadratic ones too where linear ones lock in bending, while they have ``most`` unknowns.
    """
    if (used := order or motion_order(mesh)) == 2:
        return MotionElements(2)
    stiffening = linear_stiffening(mesh, supports)
    if order is None and stiffening > BENDS_ALIKE and p2_unknowns(mesh) <= most:
        return MotionElements(2)
    return MotionElements(used, stiffening)


def linear_stiffening(mesh: TetMesh, supports: Supports | None = None) -> float:
    """How many times as stiff [1] linear elements make ``mesh`` as quadratic ones do, as held.

    The ratio of the squares of the first frequencies, both with the consistent mass. Linear
    elements lock in bending where a part is few of them thick, whatever its nu. NaN where quadratic
    ones have no modes within seconds.
    """
    try:
        if not factor_fits(mesh, most=QUICK):
            return np.nan
        linear, quadratic = (
            float(natural_modes(mesh, 1, supports=supports, order=order).frequencies[0]) ** 2
            for order in (1, 2)
        )
    except (InputError, ConvergenceError):
        return np.nan
    return linear / quadratic if quadratic > 0 else np.nan


def find_discretisation_error(
    result: StaticResult, supports: Supports, solve: Callable[..., StaticResult], **loads: Any
) -> MeshError:
    """Error of the linear ``result`` under ``supports`` and ``loads`` as in ``solve_static``.

    ``solve(order=2)`` answers the same problem with quadratic elements, where linear ones were
    taken.
    """
    if result.order == 1:
        return MeshError(_error_of_linear(result, supports, solve))
    if (stiffness := result.cycle) is None:
        space = result.space
        held = node_supports(supports, space)
        known = {"points": space.nodes, "fixed": held.fixed, "edges": space.edges}
        stiffness = rough_factor(constrained_stiffness(result.body, held), **known)
    known = {name: loads.get(name) for name in ("gravity_vector", "traction", "forces")}
    return estimate_error(result, supports, stiffness, **known)


def _error_of_linear(
    result: StaticResult, supports: Supports, solve: Callable[..., StaticResult]
) -> DiscretisationError:
    """Error of linear elements, by the answer of quadratic ones where these are affordable."""
    if affordable_order(result.mesh) == 1:
        return DiscretisationError(np.nan, "", LINEAR_TAKEN)
    try:
        fine = solve(order=2)
    except ConvergenceError as error:
        return DiscretisationError(np.nan, "", Note("error.quadratic_elements", error=error))
    change = fine.displacement - result.displacement
    coarse, largest, off = (
        float(np.linalg.norm(u, axis=1).max())
        for u in (result.displacement, fine.displacement, change)
    )
    if not supports.values.any():  # else the largest may be prescribed
        off = abs(coarse - largest)
    return DiscretisationError(off / largest if largest > 0 else 0.0, "P1/P2")


# Tets are cut that have this much of the squared error together; so often at most.
CUT, MOST_ROUNDS = 0.7, 12
SIDES = np.array([[0, 1], [1, 2], [0, 2]])  # of a triangle


class Refined(NamedTuple):
    """A ``scene`` on a mesh of its own, the ``error`` told of it [1], and why no smaller, if so."""

    scene: Scene
    error: float
    why: str = ""


def largest_error(error: DiscretisationError) -> float:
    """What displacement and forces of the supports are off by at most [1]; NaN: not known."""
    known = [x for x in (error.value, error.reaction) if np.isfinite(x)]
    return SAFETY * max(known) if known else np.nan


def refine_scene(scene: Scene, goal: float, *, device: str = "cpu") -> Refined:
    """Cut tets of a body at rest in two until it is told to be off by ``goal`` [1] at most.

    Raises ConvergenceError: If a body of the series is not held.
    """
    for _ in range(MOST_ROUNDS):
        loads = scene.loads
        rest = solve_static(scene.mesh, scene.held, order=2, device=device, **loads)
        found = find_discretisation_error(rest, scene.held, solve_static, **loads)
        error = largest_error(found.relative)
        if error <= goal or found.shares is None:
            return Refined(scene, error)
        order = np.argsort(-found.shares)
        marked = order[: 1 + int(np.searchsorted(np.cumsum(found.shares[order]), CUT))]
        finer = bisected(scene, marked)
        if (unknowns := p2_unknowns(finer.mesh)) > LARGEST_P2:
            why = Note("refinement.too_large", unknowns=unknowns, largest_p2=LARGEST_P2)
            return Refined(scene, error, why)
        scene = finer
    return Refined(scene, error, Note("refinement.too_often", rounds=MOST_ROUNDS))


def bisected(scene: Scene, marked: Int[np.ndarray, "some"]) -> Scene:
    """The scene with the tets ``marked`` cut in two, and their neighbours as far as they must.

    Tets are cut at their longest edges (Rivara 1984), so that they stay as good as they are; what
    is held and loaded stays the same.
    """
    mesh = scene.mesh
    space = discretise(mesh, 2).space
    edges, count = space.elements[:, 4:] - space.points, space.points
    ends = mesh.points[space.edges]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    # Longest first, alike in all tets: lengths that differ by round-off are equal
    order = np.lexsort((np.arange(len(length)), np.round(length / length.max(), 9)))
    rank = np.empty(len(length), dtype=np.int64)
    rank[order] = np.arange(len(length))
    longest = np.take_along_axis(edges, rank[edges].argmax(axis=1)[:, None], axis=1)[:, 0]
    cut = np.zeros(len(length), dtype=bool)
    cut[longest[marked]] = True
    while not cut[more := longest[cut[edges].any(axis=1)]].all():
        cut[more] = True
    tets, parent = _divided(mesh.tets, EDGES, space, cut, rank)
    finer = TetMesh(
        np.concatenate([mesh.points, ends[cut].mean(axis=1)]),
        tets.astype(mesh.tets.dtype),
        mesh.region[parent],
        region_names=mesh.region_names,
        material=material_of(mesh).of_tets(parent),
    )
    kept = np.concatenate([np.arange(count), count + np.flatnonzero(cut)])  # of the nodes
    held = node_supports(scene.held, space)
    loads = []
    for load in scene.tractions:
        faces, face = _divided(load.faces, SIDES, space, cut, rank)
        value = np.broadcast_to(load.value, load.faces.shape)[face]
        parts = None if load.shares is None else load.shares[face, None] * WHOLE
        loads.append(load._replace(faces=faces, value=value, parts=parts))
    forces = scene.forces
    if forces is not None:
        forces = np.concatenate([forces[:count], np.zeros((int(cut.sum()), 3))])
    holds = []
    for hold in scene.holds:
        inside = np.isin(np.arange(count), hold.points)
        middles = inside[space.edges].all(axis=1) & space.outer_edges
        nodes = np.concatenate([inside, middles])[kept]
        holds.append(hold._replace(points=np.flatnonzero(nodes)))
    return replace(
        scene,
        mesh=finer,
        supports=Supports(
            held.fixed[kept],
            held.values[kept],
            held.springs[kept],
            held.assumed,
            tuple(place[kept] for place in held.places),
        ),
        holds=tuple(holds),
        tractions=tuple(loads),
        forces=forces,
    )


def _divided(
    cells: Int[np.ndarray, "cells k"],
    sides: Int[np.ndarray, "sides 2"],
    space: Space,
    cut: Bool[np.ndarray, "edges"],
    rank: Int[np.ndarray, "edges"],
) -> tuple[Int[np.ndarray, "more k"], Int[np.ndarray, "more"]]:
    """Cells cut at the middles of their edges that are ``cut``, and the old cell of each.

    The longest first: two neighbours then cut the face between them alike.
    """
    count = space.points
    a, b = space.edges[cut].astype(np.int64).T
    keys, own = a * count + b, rank[cut]  # ascending, as the edges of a space are
    parent = np.arange(len(cells))
    cells = cells.astype(np.int64)
    while True:
        ends = np.sort(cells[:, sides], axis=2)
        key = np.where(ends[..., 1] < count, ends[..., 0] * count + ends[..., 1], -1)
        at = np.minimum(np.searchsorted(keys, key), len(keys) - 1)
        hit = np.where(keys[at] == key, own[at], -1)
        first = hit.argmax(axis=1)
        rows = np.flatnonzero(hit.max(axis=1) >= 0)
        if not len(rows):
            return cells, parent
        middle = count + at[rows, first[rows]]
        one, two = cells[rows], cells[rows]
        one[np.arange(len(rows)), sides[first[rows], 0]] = middle
        two[np.arange(len(rows)), sides[first[rows], 1]] = middle
        rest = np.ones(len(cells), dtype=bool)
        rest[rows] = False
        cells = np.concatenate([cells[rest], one, two])
        parent = np.concatenate([parent[rest], parent[rows], parent[rows]])
