"""The mesher `stuffing`: solids in, a filling of tets out, the same one every time."""

from __future__ import annotations

import logging
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ....fem.errors import UsageError
from ....fem.scene.boundary import boundary_faces
from ....fem.scene.mesh import signed_volumes
from ...native.cache import Runner
from ...surfaces.solids import Solids
from ...surfaces.surface import TouchingPlaces, touching_places
from ...surfaces.triangles import Triangles
from ..engine_run import EngineTarget, Filling, LatticeFit, NoFilling
from ..manifold import separate
from .carve import carved, without_crumbs
from .cut import CutMesh, cut
from .features import FeatureFinder, features_of, gathered_features
from .field import NOWHERE, NodeField, SolidField
from .fit import closed_shares, thin_shares
from .lattice import MOST_NODES, lattice_around
from .match import Matched, matched, wanted_volumes
from .pieces import BodyTets, came_off, loose_contacts, parted_places
from .ridges import filled_ridges
from .snap import snapped

DEPTH = 0.05  # long edges: on both sides of a visible feature at this depth are two regions
MOST_ADDED = 0.04  # of the volume: beads that leave the rest of its 5 % to the lattice
ROUNDS = 3  # of beads: what some have joined may show other pieces

log = logging.getLogger(__name__)


class _Filled(NamedTuple):
    """A filling, and the offsets of its shells that gave their volumes."""

    filling: Filling
    offsets: np.ndarray


def stuffed(solids: Solids, target: EngineTarget, runner: Runner) -> Filling:
    """Fill ``solids`` [m] with tets of a lattice with the edge that the ``target`` wants.

    It takes seconds, in this process: ``runner`` only hears of it. ``UsageError`` where the edge
    that was asked for gives more nodes than memory holds; one that was not asked for grows.
    """
    if runner.progress is not None:
        runner.progress("stuffing", 0.0)
    edge, places = _edge(solids, target), NOWHERE
    best = _unbeaded(solids, replace(target, beads=False), edge)
    assert best.filling.lattice is not None
    if best.filling.lattice.parted_shares and not target.beads:
        return best.filling  # a finer lattice may keep it in one piece
    touch = touching_places(solids.surface, touching=target.epsilon, spacing=edge)
    for _ in range(ROUNDS):
        more = _apart(best.filling, solids, target, touch, edge)
        if not len(more):
            break
        places = np.concatenate([places, more])
        beaded = _filled(solids, target, edge, places, best.offsets)
        assert beaded.filling.lattice is not None
        if beaded.filling.lattice.beads > MOST_ADDED * sum(shell.volume for shell in solids.shells):
            break
        best = beaded
    return best.filling


@lru_cache(maxsize=1)  # an attempt with beads begins with what the one before it made
def _unbeaded(solids: Solids, target: EngineTarget, edge: float) -> _Filled:
    return _filled(solids, target, edge, NOWHERE)


def _apart(
    filling: Filling, solids: Solids, target: EngineTarget, touch: TouchingPlaces, edge: float
) -> Float[np.ndarray, "n 3"]:
    """Places [m] where the solids hang together and their tets do not."""
    assert filling.lattice is not None
    mesh = BodyTets(filling.mesh.points, filling.mesh.tets, filling.part, solids.surface)
    # Surfaces that are samples have thin places by their noise.
    thin = list(filling.lattice.thin_shares) if target.sharp else []
    parted = parted_places(mesh, thin, edge)  # it asks for whole bodies, which are kept
    return np.concatenate([loose_contacts(mesh, touch, edge), parted])


def _filled(
    solids: Solids,
    target: EngineTarget,
    edge: float,
    beads: Float[np.ndarray, "n 3"],
    offsets: Float[np.ndarray, "shells"] | None = None,
) -> _Filled:
    """Fill ``solids`` [m] by a lattice of long ``edge`` [m], with ``beads`` at places [m]."""
    field = SolidField(solids, origin=solids.bounds[0], edge=edge, beads=beads)
    found = stuff(field, sharp=target.sharp, offsets=offsets)
    tets, volumes = found.mesh.tets, found.mesh.volumes
    kept = carved(tets, volumes) if len(tets) else np.zeros(0, dtype=bool)
    if not kept.any():
        raise NoFilling(f"no part is as thick as the lattice's edge of {edge:.3g} m")
    points = solids.bounds[0] + edge * found.mesh.points
    kept[kept] = without_crumbs(points, tets[kept], solids)
    mesh = separate(points, tets[kept])
    part = field.part[found.mesh.region[kept]][mesh.origin]
    volumes = signed_volumes(mesh.points, mesh.tets)
    if (flat := int((volumes <= 0).sum())) > 0:
        raise NoFilling(f"{flat} tets are flat or inverted")
    off = came_off(mesh.points, mesh.tets, part, solids, target.epsilon)
    added = float(field.added.sum()) * edge**3
    skin = Triangles(mesh.points, boundary_faces(mesh.tets).faces)
    closed = closed_shares(solids, edge, skin)
    rel = edge / target.diagonal
    fit = LatticeFit(_errors(field, found), thin_shares(solids, edge), off, closed, added)
    used = replace(target, edge_length_rel=rel, epsilon_rel=rel, layers=1)
    return _Filled(Filling(mesh, part, used, lattice=fit), found.offsets)


def _edge(solids: Solids, target: EngineTarget) -> float:
    """Long edge [m] of the lattice."""
    edge = target.lattice_edge(sum(shell.volume for shell in solids.shells))
    lattice = lattice_around((solids.bounds - solids.bounds[0]) / edge)
    if lattice.node_count <= MOST_NODES:
        return edge
    if target.edge_is_given:
        raise UsageError(
            f"an edge of {edge:.3g} m gives a lattice of {lattice.node_count} nodes, the limit is "
            f"{MOST_NODES}: give a longer --edge-length, or --mesher ftetwild"
        )
    return edge * (lattice.node_count / MOST_NODES) ** (1 / 3)


def stuff(
    field: SolidField, *, sharp: bool = True, offsets: Float[np.ndarray, "shells"] | None = None
) -> Matched:
    """Fill a field's shells, their volumes matched and their ``sharp`` edges kept.

    The search for offsets begins with ``offsets``, those of a lattice like it, if there are some.
    """
    lattice = lattice_around(field.bounds)
    nodes = NodeField(field, lattice.nodes(), lattice.together)
    features = gathered_features([features_of(shell.triangles) for shell in field.shells])
    at_rest = np.zeros(len(field.shells))

    def visible(where: Float[np.ndarray, "n 3"], normal: Float[np.ndarray, "n 3"]) -> np.ndarray:
        """Whether what is on both sides of a place differs."""
        sides = np.concatenate([where + DEPTH * normal, where - DEPTH * normal])
        out, inside = np.split(field.region_at(sides, at_rest), 2)
        return out != inside

    finder = FeatureFinder(features, visible) if sharp else None

    def build(offsets: Float[np.ndarray, "shells"]) -> CutMesh:
        mesh = cut(lattice, nodes, offsets)
        if finder is None:
            return mesh
        mesh, on_edge = snapped(mesh, finder)
        return filled_ridges(mesh, on_edge, finder, lambda where: field.region_at(where, offsets))

    return matched(field, wanted_volumes(field), build, offsets)


def _errors(field: SolidField, found: Matched) -> dict[int, float]:
    """Relative error of each part's volume: where parts share a shell, that of the largest."""
    out: dict[int, float] = {}
    for shell, error in zip(field.shells, found.errors, strict=True):
        for part in shell.parts.tolist():
            out[part] = max(out.get(part, 0.0), float(error), key=abs)
    return out
