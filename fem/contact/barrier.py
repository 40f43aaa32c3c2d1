"""Contact with obstacles and itself: a logarithmic barrier, lagged smoothed Coulomb friction."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ..discrete.block_matrix import BlockMatrix, add_blocks, add_diagonal
from ..discrete.space import Space
from ..errors import InputError
from ..scene.mesh import TetMesh, material_of
from ..scene.obstacles import Distance, Obstacle, obstacle_size
from .friction import Lagged, outer
from .pressure import ContactPressures, largest_pressure
from .self_contact import PieceForce, SelfContact
from .sites import MOST_CELLS, SPACING, Sites, SurfaceSites

# The barrier acts closer than this share of the body's diagonal.
BARRIER_SHARE = 1e-3
# Barrier stiffness as a share of the body's own E: stiff against the body, which is a thousand
# barrier thicknesses wide, and soft enough for Newton.
STIFFNESS_SHARE = 0.1
# A Newton step may use up this share of a gap.
GAP_SHARE = 0.9
# Advancement along a step that meets no obstacle within so many moves is stopped there.
ADVANCES = 60
# Sliding slower than this share of the body's diagonal per second is sticking.
STICK_SHARE = 1e-3


def barrier_thickness(mesh: TetMesh) -> float:
    """Distance [m] from an obstacle at which it begins to push ``mesh``."""
    return BARRIER_SHARE * float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))


class Nearness(NamedTuple):
    """Sites of the body and their ``distance`` from the obstacle of that number."""

    obstacle: int
    sites: Sites
    distance: Distance


class Contact:
    """Barrier energy of the surface of a body against rigid obstacles, and against itself.

    For a site of area A at distance d < dhat the energy is k A dhat b(d / dhat) with the barrier
    b(s) = -(s - 1)^2 log s of IPC (Li et al. 2020): zero at dhat, infinite at contact.

    Raises
    ------
    InputError
        Where an obstacle is far smaller than a face of the body.
    """

    def __init__(
        self,
        mesh: TetMesh,
        space: Space,
        obstacles: Sequence[Obstacle],
        friction: float,
        thickness: float | None = None,
        *,
        self_contact: bool = False,
    ) -> None:
        diagonal = float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
        self.thickness = thickness or barrier_thickness(mesh)
        size = space.elements.shape[1]
        E, ids = np.repeat(material_of(mesh).E, size), space.elements.ravel()
        around = np.maximum(np.bincount(ids, minlength=len(space.nodes)), 1)
        stiffness = STIFFNESS_SHARE * np.bincount(ids, E, len(space.nodes)) / around
        self.obstacles, self.friction = tuple(obstacles), friction
        self.surfaces = [
            SurfaceSites(mesh, space, stiffness * self.thickness, obstacle)
            for obstacle in self.obstacles
        ]
        self.time, self.step, self.stick = 0.0, 1.0, STICK_SHARE * diagonal
        self.lagged: list[Lagged] = []
        self.mesh, self.space = mesh, space
        self.own = SelfContact(mesh, space, self.thickness, friction) if self_contact else None
        self.acts = bool(self.surfaces) or self_contact

    @property
    def notes(self) -> tuple[str, ...]:
        """What is not kept apart."""
        return self.own.notes if self.own else ()

    def _shift(self, obstacle: int) -> np.ndarray:
        return self.time * np.asarray(self.obstacles[obstacle].velocity, dtype=float)

    def _touching(self, u: np.ndarray, margin: float) -> Iterator[Nearness]:
        """Sites with their distances: all that are closer than ``margin`` [m], and more."""
        for k, surface in enumerate(self.surfaces):
            shift = self._shift(k)
            for sites in surface.near(u, shift, margin):
                x = sites.rest + sites.moved(u) - shift
                yield Nearness(k, sites, self.obstacles[k].distance(x))

    def gap(self, u: np.ndarray) -> float:
        """Smallest distance [m] of any site from any obstacle, and of what touches itself."""
        smallest = self.own.gap(u) if self.own else np.inf
        for k, surface in enumerate(self.surfaces):
            shift, obstacle = self._shift(k), self.obstacles[k]
            x = surface.rest[surface.corners] + u[surface.corners] - shift
            known = float(obstacle.distance(x).gap.min())
            for sites in surface.near(u, shift, known):
                x = sites.rest + sites.moved(u) - shift
                known = min(known, float(obstacle.distance(x).gap.min()))
            smallest = min(smallest, known)
        return smallest

    def check_sizes(self, u: np.ndarray) -> None:
        """Raise ``InputError`` where an obstacle touches a face far larger than itself."""
        for k, surface in enumerate(self.surfaces):
            if surface.touches_too_large(u, self._shift(k), self.thickness):
                raise InputError(
                    f"obstacle {k + 1} is {obstacle_size(self.obstacles[k]):.3g} m in size, less "
                    f"than a {MOST_CELLS * 2 * SPACING:.0f}th of a face that it touches: it would "
                    "slip through; wanted a finer mesh"
                )

    def barrier(self, u: np.ndarray) -> float:
        """Energy of the barrier [J]; infinite on contact."""
        total = self.own.barrier(u) if self.own else 0.0
        for _, sites, d in self._touching(u, self.thickness):
            s = d.gap / self.thickness
            if not (s > 0).all():
                return np.inf
            near = s < 1
            total -= float((sites.weight[near] * (s[near] - 1) ** 2 * np.log(s[near])).sum())
        return total

    def value(self, u: np.ndarray) -> float:
        """Barrier and friction energy [J]; infinite on contact."""
        rubbed = self.own.friction_energy(u) if self.own else 0.0
        return self.barrier(u) + rubbed + sum(lag.energy(u) for lag in self.lagged)

    def add_gradient(self, u: np.ndarray, out: np.ndarray) -> None:
        """Add the gradient [N] of the energy to ``out`` (nodes, 3)."""
        for _, sites, d in self._touching(u, self.thickness):
            sites.spread(self._slope(sites, d.gap)[:, None] * d.normal, out)
        for lag in self.lagged:
            lag.sites.spread(lag.gradient(u), out)
        if self.own:
            self.own.add_gradient(u, out)

    def hessian_blocks(self, u: np.ndarray, *, sharp: bool = False) -> tuple[np.ndarray, list]:
        """Of obstacles: ``Sites.spread_blocks`` of the Hessian [N/m]; ``sharp`` as ``Lagged``."""
        diagonal, pairs = np.zeros((len(u), 3, 3)), []
        for _, sites, d in self._touching(u, self.thickness):
            s = np.maximum(d.gap / self.thickness, 1e-300)
            bend = -2 * np.log(s) - 4 * (s - 1) / s + ((s - 1) / s) ** 2
            curve = np.where(s < 1, sites.weight * bend, 0.0) / self.thickness**2
            sites.spread_blocks(curve[:, None, None] * outer(d.normal), diagonal, pairs)
        for lag in self.lagged:
            lag.sites.spread_blocks(lag.hessian(u, sharp=sharp), diagonal, pairs)
        return diagonal, pairs

    def with_hessian(
        self, u: np.ndarray, matrix: BlockMatrix, *, sharp: bool = False
    ) -> BlockMatrix:
        """``matrix`` [N/m] and the positive part of the Hessian; ``sharp`` as for ``Lagged``.

        It is added in place but for pairs of nodes that share no tet: there the matrix grows.
        """
        if self.surfaces:
            diagonal, pairs = self.hessian_blocks(u, sharp=sharp)
            add_diagonal(matrix, diagonal)
            for i, j, blocks in pairs:
                add_blocks(matrix, i.ravel(), j.ravel(), blocks.reshape(-1, 3, 3))
        return self.own.with_hessian(u, matrix) if self.own else matrix

    def _slope(self, sites: Sites, gap: np.ndarray) -> np.ndarray:
        """Derivative of the barrier energy by the distance [N], not positive."""
        s = np.maximum(gap / self.thickness, 1e-300)
        slope = -2 * (s - 1) * np.log(s) - (s - 1) ** 2 / s
        return np.where(s < 1, sites.weight * slope, 0.0) / self.thickness

    def begin(self, u: np.ndarray, time: float, step: float) -> None:
        """Move the obstacles to ``time`` [s], the end of a ``step`` [s] that starts at ``u``."""
        self.time, self.step, self.lagged = time, step, []
        self._start = u.copy()
        if self.own:
            self.own.begin(u, step)

    def lag_friction(self, u: np.ndarray) -> None:
        """Freeze normal forces and normals at ``u`` for the friction of the next solve."""
        if self.friction == 0:
            return
        if self.own:
            self.own.lag_friction(u)
        self.lagged = [
            Lagged(
                k,
                sites,
                -self.friction * self._slope(sites, d.gap),
                d.normal,
                sites.moved(self._start) + self.step * np.asarray(self.obstacles[k].velocity),
                self.stick * self.step,
            )
            for k, sites, d in self._touching(u, self.thickness)
        ]

    def allowed(self, u: np.ndarray) -> np.ndarray:
        """``u`` with the nodes that a moving obstacle has reached carried along in front of it."""
        u = u.copy()
        for k, obstacle in enumerate(self.obstacles):
            move = self.step * np.asarray(obstacle.velocity, dtype=float)
            if not move.any():
                continue
            shift, reach = self._shift(k), self.thickness + float(np.linalg.norm(move))
            near = [*self.surfaces[k].near(u, shift, reach)]
            wanted = []
            for sites in near:
                x = sites.rest + sites.moved(u) - shift
                now, before = obstacle.distance(x), obstacle.distance(x + move)
                wanted.append(np.minimum(before.gap, 0.5 * self.thickness))
                if sites.alone:
                    push = np.maximum(wanted[-1] - now.gap, 0.0)
                    sites.spread(push[:, None] * now.normal, u)
            self._carry(k, u, move, near, wanted)
        return u

    def _carry(self, k: int, u: np.ndarray, move: np.ndarray, near: list, wanted: list) -> None:
        """Carry whole faces by ``move`` (3,) [m] until half the ``wanted`` gaps are there.

        A face that moves as the obstacle does keeps its gap; its neighbours may then have to move.
        """
        start, carried = u.copy(), np.zeros(len(u), dtype=bool)
        while True:
            before = carried.sum()
            for sites, gap in zip(near, wanted, strict=True):
                x = sites.rest + sites.moved(u) - self._shift(k)
                tight = self.obstacles[k].distance(x).gap < 0.5 * gap
                carried[sites.nodes[tight]] = True
            if carried.sum() == before:
                return
            u[carried] = start[carried] + move

    def longest_step(self, u: np.ndarray, step: np.ndarray) -> float:
        """Largest share of ``step`` that leaves a tenth of every gap, by safe advancement.

        Distance changes no faster than position, so a site may always move by its distance.
        """
        share = self.own.longest_step(u, step) if self.own else 1.0
        farthest = np.linalg.norm(step, axis=1).max() / GAP_SHARE if self.surfaces else 0.0
        for k, sites, first in self._touching(u, farthest):
            p = sites.moved(step)
            speed = np.linalg.norm(p, axis=1)
            at_risk = np.flatnonzero(GAP_SHARE * first.gap < speed)
            if not at_risk.size:
                continue
            done = np.zeros(len(at_risk))
            floor = (1 - GAP_SHARE) * first.gap[at_risk]
            here = (sites.rest + sites.moved(u) - self._shift(k))[at_risk]
            for _ in range(ADVANCES):
                d = self.obstacles[k].distance(here + done[:, None] * p[at_risk])
                room = np.maximum(d.gap - floor, 0.0) / np.maximum(speed[at_risk], 1e-300)
                done = np.minimum(done + room, 1.0)
                if (room < 1e-3 * np.maximum(done, 1e-12)).all() or (done >= 1).all():
                    break
            share = min(share, float(done.min()))
        return share

    def obstacle_forces(self, u: np.ndarray) -> np.ndarray:
        """Force of every obstacle on the body [N], shape (obstacles, 3)."""
        total = np.zeros((len(self.obstacles), 3))
        for k, sites, d in self._touching(u, self.thickness):
            total[k] -= (self._slope(sites, d.gap)[:, None] * d.normal).sum(axis=0)
        for lag in self.lagged:
            total[lag.obstacle] -= lag.gradient(u).sum(axis=0)
        return total

    def pressures(self, u: np.ndarray) -> ContactPressures:
        """Largest contact pressures [Pa] at ``u``, without friction."""
        pushes = np.zeros((len(self.obstacles) + 1, *u.shape))
        for k, sites, d in self._touching(u, self.thickness):
            sites.spread(-self._slope(sites, d.gap)[:, None] * d.normal, pushes[k])
        if self.own:
            pushes[-1, self.own.nodes] = -self.own.push(u)
        largest = np.array(
            [largest_pressure(self.mesh, self.space, u, pushes[k]) for k in range(len(pushes))]
        )
        return ContactPressures(largest[:-1], float(largest[-1]))

    def passes(self, u: np.ndarray, after: np.ndarray) -> bool:
        """Whether the body can go from ``u`` to ``after`` without meeting itself."""
        return self.own is None or self.own.longest_step(u, after - u) == 1

    def piece_forces(self, u: np.ndarray) -> tuple[PieceForce, ...]:
        """Force of every piece on every other that it touches."""
        return self.own.piece_forces(u) if self.own else ()

    def forces(self, u: np.ndarray, count: int) -> np.ndarray:
        """Force of obstacles and other faces on every node [N], shape (count, 3)."""
        out = np.zeros((count, 3))
        self.add_gradient(u, out)
        return -out
