"""Safety of a body at rest: what its parts stand, what its places carry, what pieces stand on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from .elements.elastic import von_mises
from .elements.space import Space
from .grain import is_of_row
from .mesh import material_of, point_components
from .scene.scene import Hold, Scene
from .scene.supports import find_supports
from .scene.up import up_vector
from .solve.result import StaticResult
from .solve.statics import corner_stresses
from .table import CrossStrength, Strength, load_cross_strengths, load_strengths


class Safety(NamedTuple):
    """Largest ``stress`` [Pa] of a ``part`` of ``material`` beside its lowest ``limit`` [Pa].

    ``kind`` is what happens at the limit, ``side`` whether it is pulled or pressed there (bent:
    the equivalent stress of a material that yields), or sheared; ``place`` (3,) [m] is where.
    ``direction`` is 'along' or 'across' the grain, or '' where none is known; there ``stress`` is
    the one that would do alone what all do together. ``estimated``: the limit is not a sourced one.
    """

    part: str
    material: str
    kind: str
    side: str
    stress: float
    limit: float
    place: tuple[float, ...]
    direction: str = ""
    estimated: bool = False

    @property
    def factor(self) -> float:
        """Safety factor [1]: below one the material gives way."""
        return self.limit / self.stress if self.stress > 0 else np.inf


class PartStresses(NamedTuple):
    """Cauchy ``stress`` (n, 3, 3) [Pa] at the places ``at`` (n, 3) [m] of a ``part``'s ``tets``.

    ``grain`` (n, 3) is a unit vector along the grain there, 0 where none is known.
    """

    part: str
    tets: np.ndarray
    stress: np.ndarray
    at: np.ndarray
    grain: np.ndarray

    @property
    def largest(self) -> float:
        """Largest of von Mises' stress [Pa]."""
        return float(von_mises(self.stress).max())


def part_safety(
    result: StaticResult,
    materials: Mapping[str, str],
    stresses: Sequence[PartStresses] | None = None,
) -> tuple[Safety, ...]:
    """Safety of every part whose row in ``materials`` (part -> row) has a strength.

    What yields is judged by von Mises' stress, what breaks by the principal stresses, the largest
    pull against the tensile and the largest push against the compressive limit, and what has a
    grain by ``tsai_hill``. Stresses are those
    at the points, where a bent part has its largest, means of the tets of the part there; of linear
    elements they are constant in a tet. At a sharp inner corner they grow with a finer mesh.
    ``stresses`` are the ``part_stresses`` of the result, where they are known.
    """
    strengths, judged, E = load_strengths(), [], material_of(result.mesh).E
    for here in part_stresses(result) if stresses is None else stresses:
        row = materials.get(here.part, "")
        if row in strengths and is_of_row(E[here.tets], row):
            strength = strengths[row]
            if row in load_cross_strengths() and here.grain.any(axis=1).all():
                judged.append(_grained_safety(here, row, strength))
                continue
            if strength.kind == "yield":
                cases = [("equivalent", von_mises(here.stress), strength.limit())]
            else:
                principal = np.linalg.eigvalsh(here.stress)
                cases = [
                    ("tension", principal[:, 2], strength.limit()),
                    ("compression", -principal[:, 0], strength.limit(compression=True)),
                ]
            side, values, limit = max(cases, key=lambda case: case[1].max() / case[2])
            worst = int(np.argmax(values))
            stress, place = max(float(values[worst]), 0.0), tuple(here.at[worst].tolist())
            judged.append(Safety(here.part, row, strength.kind, side, stress, limit, place))
    return tuple(judged)


class GrainStresses(NamedTuple):
    """``stress`` (n, 3) [Pa] along the grain, across it and in shear along it, and their ``limit``.

    ``square`` (n,) [1]: where it is one the material gives way.
    """

    stress: np.ndarray
    limit: np.ndarray
    square: np.ndarray


def tsai_hill(
    stress: Float[np.ndarray, "n 3 3"],
    grain: Float[np.ndarray, "n 3"],
    along: Strength,
    across: CrossStrength,
) -> GrainStresses:
    """Criterion of Tsai & Hill (Tsai 1968) for solids of ``stress`` [Pa] with a ``grain``.

    s1^2 / X^2 - s1 s2 / X^2 + s2^2 / Y^2 + t^2 / S^2, with X and Y of the side that s1 and s2 are
    on. Across the grain s2 is the principal stress nearest to its strength, of those in the plane
    that the grain stands on.
    """
    traction = np.einsum("nij,nj->ni", stress, grain)
    s1 = np.einsum("ni,ni->n", traction, grain)
    shear = np.linalg.norm(traction - s1[:, None] * grain, axis=1)
    flat = np.eye(3) - grain[:, :, None] * grain[:, None, :]
    sides = np.linalg.eigvalsh(flat @ stress @ flat)[:, [0, 2]]  # lowest and highest, or 0
    worst = np.abs(sides / _limits(sides, across.tension, across.compression)).argmax(axis=1)
    s2 = sides[np.arange(len(sides)), worst]
    X = _limits(s1, along.limit(), along.limit(compression=True))
    Y, S = _limits(s2, across.tension, across.compression), np.full(len(s1), across.shear)
    square = (s1 / X) ** 2 - s1 * s2 / X**2 + (s2 / Y) ** 2 + (shear / S) ** 2
    return GrainStresses(np.stack([s1, s2, shear], axis=1), np.stack([X, Y, S], axis=1), square)


def _limits(stress: np.ndarray, pulled: float, pressed: float) -> np.ndarray:
    return np.where(stress > 0, pulled, pressed)


def _grained_safety(here: PartStresses, row: str, along: Strength) -> Safety:
    """Safety of a part with a grain, named by the stress that is nearest to its limit."""
    across = load_cross_strengths()[row]
    stress, limit, square = tsai_hill(here.stress, here.grain, along, across)
    worst = int(np.argmax(square))
    which = int(np.argmax(np.abs(stress[worst] / limit[worst])))
    side = "shear" if which == 2 else "tension" if stress[worst, which] > 0 else "compression"
    alone = float(np.sqrt(max(square[worst], 0.0)) * limit[worst, which])
    place, direction = tuple(here.at[worst].tolist()), "across" if which == 1 else "along"
    return Safety(
        here.part,
        row,
        along.kind,
        side,
        alone,
        float(limit[worst, which]),
        place,
        direction,
        estimated=which > 0 and side in across.estimated,
    )


def part_stresses(result: StaticResult) -> tuple[PartStresses, ...]:
    """Stresses at the points of every part that has tets; of linear elements by tet."""
    mesh, stresses, axes = result.mesh, [], material_of(result.mesh).axes
    grain = np.zeros((len(mesh.tets), 3)) if axes is None else axes[:, 0]
    corners = corner_stresses(result) if result.order == 2 else None
    for region, part in enumerate(mesh.region_names):
        tets = np.flatnonzero(mesh.region == region)
        if not tets.size:
            continue
        if corners is None:
            stress, at, along = result.stress[tets], mesh.centroids[tets], grain[tets]
        else:  # the mean of its own tets at every point
            ids, index = np.unique(mesh.tets[tets], return_inverse=True)
            weight = np.repeat(mesh.volumes[tets], 4)
            flat = corners[tets].reshape(-1, 9) * weight[:, None]
            total = np.stack([np.bincount(index.ravel(), column) for column in flat.T], axis=1)
            mean = total / np.bincount(index.ravel(), weight)[:, None]
            stress, at, along = mean.reshape(-1, 3, 3), mesh.points[ids], np.zeros((len(ids), 3))
            along[index.reshape(-1, 4)] = grain[tets, None]  # that of one of the tets there
        stresses.append(PartStresses(part, tets, stress, at, along))
    return tuple(stresses)


class Reaction(NamedTuple):
    """``force`` (3,) [N] of a support on the body, and its ``torque`` (3,) [N m] about ``centre``.

    Of a motion they have a row a frame. ``place`` is what a user called it, '' for what the
    scenario holds; ``centre`` (3,) [m] is the mean of its points at rest.
    """

    place: str
    force: Float[np.ndarray, "*frames 3"]
    torque: Float[np.ndarray, "*frames 3"]
    centre: np.ndarray


def reactions(
    scene: Scene, space: Space, forces: Float[np.ndarray, "*frames nodes 3"]
) -> tuple[Reaction, ...]:
    """Force and torque of every place that holds; their sum is that of all supports.

    ``forces`` [N] are those of supports on the nodes of ``space``, at rest or in every frame. A
    node that two places hold in one direction counts for the first of them.
    """
    points, mesh = len(scene.mesh.points), scene.mesh
    ends, left = space.edges, np.ones(forces.shape[-2:], dtype=bool)
    whole = Hold("", np.flatnonzero(scene.held.fixed.any(axis=1)))
    found = []
    for hold in (*scene.holds, whole):
        inside = np.isin(np.arange(points), hold.points)
        nodes = np.concatenate([inside, inside[ends].all(axis=1)])[: len(left)]
        mine = left & nodes[:, None] & np.isin(np.arange(3), hold.axes)
        left &= ~mine
        force = np.where(mine, forces, 0.0)
        if hold is whole and not force.any():
            continue
        centre = mesh.points[hold.points].mean(axis=0)
        torque = np.cross(space.nodes - centre, force).sum(axis=-2)
        found.append(Reaction(hold.name, force.sum(axis=-2), torque, centre))
    return tuple(found)


class Standing(NamedTuple):
    """What a separate piece presses the ground with, and the points (n, 3) [m] that it stands on.

    ``force`` (3,) [N] and ``moment`` (3,) [N m] about the origin.
    """

    feet: np.ndarray
    force: np.ndarray
    moment: np.ndarray


def standing_pieces(scene: Scene, rest: StaticResult, gravity: float) -> tuple[Standing, ...]:
    """Every piece of the body that is held; with its weight under ``gravity`` [m/s^2] in any case.

    Pieces share no point: each stands on its own feet, all that reach the ground, however few of
    them hold it.
    """
    mesh, up = rest.mesh, up_vector(scene.up)
    piece, held = point_components(mesh), scene.held.fixed.any(axis=1)
    of_node = np.concatenate([piece, piece[rest.space.edges[:, 0]]])[: len(rest.reaction)]
    mass = mesh.volumes * material_of(mesh).rho
    if np.any(scene.gravity_vector):
        mass = np.zeros_like(mass)  # the supports carry it already
    found, base = [], find_supports(mesh, scene.up)[0].fixed.any(axis=1)
    for number in np.unique(piece[held]):
        reaction = rest.reaction[of_node == number]
        force, nodes = -reaction.sum(axis=0), rest.space.nodes[of_node == number]
        own = piece[mesh.tets[:, 0]] == number
        weight = -gravity * up * mass[own].sum()
        turn = np.cross(mass[own] @ mesh.centroids[own], -gravity * up)
        moment = turn - np.cross(nodes, reaction).sum(axis=0)
        feet = mesh.points[(held | base) & (piece == number)]
        found.append(Standing(feet, force + weight, moment))
    return tuple(found)
