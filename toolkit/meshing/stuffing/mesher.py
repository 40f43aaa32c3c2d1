"""The mesher `stuffing`: solids in, a filling of tets out, the same one every time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from ...native.cache import Runner
from ...surfaces.solids import Solids
from ..engine_run import EngineTarget, Filling, NoFilling
from ..manifold import separate
from .cut import CutMesh, cut
from .features import features_of, joined
from .field import NodeField, SolidField
from .lattice import TETS_PER_CELL, lattice_around
from .match import Matched, matched, wanted_volumes
from .snap import DEPTH, snapped


def stuffed(solids: Solids, target: EngineTarget, runner: Runner) -> Filling:
    """Fill ``solids`` [m] with tets of a lattice, as many as ``target`` wants or of its edge [m].

    ``runner`` is not needed: it takes seconds, in this process.
    """
    edge = target.lattice_edge(sum(shell.volume for shell in solids.shells))
    origin = solids.bounds[0]
    found = stuff(SolidField(solids, origin=origin, edge=edge))
    if not len(found.mesh.tets):
        raise NoFilling(f"no part is as thick as the lattice's edge of {edge:.3g} m")
    mesh = separate(origin + edge * found.mesh.points, found.mesh.tets)
    part = SolidField(solids, origin=origin, edge=edge).part[found.mesh.region]
    aim = replace(target, edge_length_rel=edge / target.diagonal, epsilon_rel=edge / target.diagonal, layers=1)
    return Filling(mesh, part[mesh.origin], aim)


def stuff(field: SolidField) -> Matched:
    """Fill a field's shells, their volumes matched and their sharp edges snapped."""
    lattice = lattice_around(field.bounds)
    nodes = NodeField(field, lattice.nodes())
    features = joined([features_of(shell.triangles) for shell in field.shells])
    none = np.zeros(len(field.shells))

    def visible(where: Float[np.ndarray, "n 3"], normal: Float[np.ndarray, "n 3"]) -> np.ndarray:
        sides = np.concatenate([where + DEPTH * normal, where - DEPTH * normal])
        out, inside = np.split(field.region_at(sides, none), 2)
        return out != inside

    def build(offsets: Float[np.ndarray, "shells"]) -> CutMesh:
        return snapped(cut(lattice, nodes, offsets), features, visible)

    return matched(field, wanted_volumes(field), build)
