"""What every place that holds a body carries, and every piece of it that stands."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from .elements.space import Space
from .mesh import material_of, point_components
from .scene.scene import Hold, Scene
from .scene.supports import find_supports
from .scene.up import up_vector
from .solve.result import StaticResult


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
