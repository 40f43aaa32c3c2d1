"""Contact with obstacles: a logarithmic barrier and lagged, smoothed Coulomb friction."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..discrete.forces import node_areas
from ..discrete.space import Space
from ..errors import InputError
from ..scene.mesh import TetMesh, material_of
from ..scene.obstacles import Obstacle, obstacle_size

# The barrier acts closer than this share of the body's diagonal.
BARRIER_SHARE = 1e-3
# Barrier stiffness as a share of the body's own E: stiff against the body, which is a thousand
# barrier thicknesses wide, and soft enough for Newton.
STIFFNESS_SHARE = 0.1
# A Newton step may use up this share of a gap.
GAP_SHARE = 0.9
# Advancement along a step that meets no obstacle within so many moves is stopped there.
ADVANCES = 60
# An obstacle may be this share of its size inside a face whose points are all outside.
THROUGH = 0.2
# Most cells along a face on which it is looked at.
MOST_CELLS = 40
# Sliding slower than this share of the body's diagonal per second is sticking.
STICK_SHARE = 1e-3


def barrier_thickness(mesh: TetMesh) -> float:
    """Distance [m] from an obstacle at which it begins to push ``mesh``."""
    return BARRIER_SHARE * float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))


class Lagged(NamedTuple):
    """Friction of one obstacle, frozen during a solve.

    ``force`` (n,) is the coefficient times the normal force [N], ``normal`` (n, 3) its direction,
    ``start`` (n, 3) [m] the displacement from which sliding is counted.
    """

    force: np.ndarray
    normal: np.ndarray
    start: np.ndarray


class Contact:
    """Barrier energy of the surface nodes of a body against rigid obstacles.

    For a node of area A at distance d < dhat the energy is k A dhat b(d / dhat) with the barrier
    b(s) = -(s - 1)^2 log s of IPC (Li et al. 2020): zero at dhat, infinite at contact.
    """

    def __init__(
        self,
        mesh: TetMesh,
        space: Space,
        obstacles: Sequence[Obstacle],
        friction: float,
        thickness: float | None = None,
    ) -> None:
        areas = node_areas(mesh, space)
        self.nodes = np.flatnonzero(areas > 0)
        self.rest = space.nodes[self.nodes]
        self.faces = mesh.boundary.faces
        self.corners = mesh.points[self.faces]
        diagonal = float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
        self.thickness = thickness or barrier_thickness(mesh)
        E = material_of(mesh).E
        share = np.bincount(space.elements.ravel(), minlength=len(space.nodes))
        size = space.elements.shape[1]
        mean = np.bincount(space.elements.ravel(), np.repeat(E, size), len(space.nodes))
        stiffness = STIFFNESS_SHARE * mean[self.nodes] / share[self.nodes]
        self.weight = stiffness * areas[self.nodes] * self.thickness  # [J]
        self.obstacles, self.friction = tuple(obstacles), friction
        self.stick = STICK_SHARE * diagonal
        self.time, self.step = 0.0, 1.0
        self.lagged: list[Lagged] = []

    def _distances(self, u: np.ndarray, nodes=slice(None)):
        x = self.rest[nodes] + u[self.nodes[nodes]]
        for obstacle in self.obstacles:
            yield obstacle.distance(x - self.time * np.asarray(obstacle.velocity))

    def gap(self, u: np.ndarray) -> float:
        """Smallest distance of any surface node from any obstacle [m]."""
        return min((float(d.gap.min()) for d in self._distances(u)), default=np.inf)

    def check_faces(self, u: np.ndarray) -> None:
        """Raise ``InputError`` where an obstacle went through a face between its points."""
        depth = self.face_depth(u)
        if depth > THROUGH:
            raise InputError(
                f"an obstacle went {depth:.0%} of its size through a face, between its points: "
                "the mesh is too coarse for so small an obstacle"
            )

    def face_depth(self, u: np.ndarray) -> float:
        """Deepest place of any face inside a bounded obstacle, as a share of that one's size.

        Faces are looked at on a grid finer than the obstacle; what pushes are their points alone.
        """
        deepest = 0.0
        corners = self.corners + u[self.faces]
        centre = corners.mean(axis=1)
        reach = np.linalg.norm(corners - centre[:, None], axis=2).max(axis=1)
        for obstacle in self.obstacles:
            size = obstacle_size(obstacle)
            if not np.isfinite(size):
                continue
            shift = self.time * np.asarray(obstacle.velocity)
            near = np.flatnonzero(obstacle.distance(centre - shift).gap < reach)
            if not near.size:
                continue
            cells = int(np.clip(np.ceil(2 * reach[near].max() / size), 1, MOST_CELLS))
            i, j = (k.ravel() for k in np.indices((cells + 1, cells + 1)))
            share = np.stack([i, j, cells - i - j], axis=1)[i + j <= cells] / cells
            x = np.einsum("sk,fkd->fsd", share, corners[near]).reshape(-1, 3)
            deepest = max(deepest, -float(obstacle.distance(x - shift).gap.min()) / size)
        return deepest

    def barrier(self, u: np.ndarray) -> float:
        """Energy of the barrier [J]; infinite on contact."""
        total = 0.0
        for d in self._distances(u):
            s = d.gap / self.thickness
            if not (s > 0).all():
                return np.inf
            near = s < 1
            total -= float((self.weight[near] * (s[near] - 1) ** 2 * np.log(s[near])).sum())
        return total

    def value(self, u: np.ndarray) -> float:
        """Barrier and friction energy [J]; infinite on contact."""
        total = self.barrier(u)
        return total + sum(float((lag.force * self._slip(u, lag)[2]).sum()) for lag in self.lagged)

    def add_gradient(self, u: np.ndarray, out: np.ndarray) -> None:
        """Add the gradient [N] of the energy to ``out`` (nodes, 3)."""
        for d in self._distances(u):
            out[self.nodes] += self._slope(d.gap)[:, None] * d.normal
        for lag in self.lagged:
            y, over, _ = self._slip(u, lag)
            out[self.nodes] += (lag.force * over)[:, None] * y

    def add_hessian(self, u: np.ndarray, out: np.ndarray, *, sharp: bool = False) -> None:
        """Add the positive part of the Hessian [N/m] to the blocks ``out`` (nodes, 3, 3).

        Of friction a bound, with which Newton creeps but never overshoots; ``sharp``: friction's
        own, with which it arrives at once from near by.
        """
        for d in self._distances(u):
            s = np.maximum(d.gap / self.thickness, 1e-300)
            bend = -2 * np.log(s) - 4 * (s - 1) / s + ((s - 1) / s) ** 2
            curve = np.where(s < 1, self.weight * bend, 0.0) / self.thickness**2
            out[self.nodes] += curve[:, None, None] * _outer(d.normal)
        for lag in self.lagged:
            y, over, _ = self._slip(u, lag)
            size = np.linalg.norm(y, axis=1)
            limit = self.stick * self.step
            along = y / np.where(size > 0, size, 1.0)[:, None]
            bend = np.where(size < limit, 2 * (1 - size / limit) / limit, 0.0) - over
            flat = over[:, None, None] * (np.eye(3) - _outer(lag.normal))
            if sharp:  # a slide is pushed back across its direction only
                flat += bend[:, None, None] * _outer(along)
            out[self.nodes] += lag.force[:, None, None] * flat

    def _slope(self, gap: np.ndarray) -> np.ndarray:
        """Derivative of the barrier energy by the distance [N], not positive."""
        s = np.maximum(gap / self.thickness, 1e-300)
        slope = -2 * (s - 1) * np.log(s) - (s - 1) ** 2 / s
        return np.where(s < 1, self.weight * slope, 0.0) / self.thickness

    def _slip(self, u: np.ndarray, lag: Lagged):
        """Tangential slip y (n, 3), f1(|y|)/|y| and f0(|y|) of IPC's smoothed friction."""
        y = u[self.nodes] - lag.start
        y = y - (y * lag.normal).sum(axis=1, keepdims=True) * lag.normal
        size, limit = np.linalg.norm(y, axis=1), self.stick * self.step
        inside = size < limit
        over = np.where(inside, (2 - size / limit) / limit, 1 / np.maximum(size, limit))
        potential = np.where(inside, size**2 / limit - size**3 / (3 * limit**2) + limit / 3, size)
        return y, over, potential

    def begin(self, u: np.ndarray, time: float, step: float) -> None:
        """Move the obstacles to ``time`` [s], the end of a ``step`` [s] that starts at ``u``."""
        self.time, self.step = time, step
        self.lagged = []
        self._start = u.copy()

    def lag_friction(self, u: np.ndarray) -> None:
        """Freeze normal forces and normals at ``u`` for the friction of the next solve."""
        if self.friction == 0:
            return
        self.lagged = [
            Lagged(
                -self.friction * self._slope(d.gap),
                d.normal,
                self._start[self.nodes] + self.step * np.asarray(obstacle.velocity),
            )
            for obstacle, d in zip(self.obstacles, self._distances(u), strict=True)
        ]

    def allowed(self, u: np.ndarray) -> np.ndarray:
        """``u`` with the nodes that a moving obstacle has reached carried along in front of it."""
        u = u.copy()
        for obstacle in self.obstacles:
            move = self.step * np.asarray(obstacle.velocity, dtype=float)
            if not move.any():
                continue
            x = self.rest + u[self.nodes]
            now = obstacle.distance(x - self.time * np.asarray(obstacle.velocity))
            before = obstacle.distance(x - self.time * np.asarray(obstacle.velocity) + move)
            wanted = np.minimum(before.gap, 0.5 * self.thickness)
            push = np.maximum(wanted - now.gap, 0.0)
            u[self.nodes] += push[:, None] * now.normal
        return u

    def longest_step(self, u: np.ndarray, step: np.ndarray) -> float:
        """Largest share of ``step`` that leaves a tenth of every gap, by safe advancement.

        Distance changes no faster than position, so a node may always move by its distance.
        """
        share = 1.0
        p = step[self.nodes]
        speed = np.linalg.norm(p, axis=1)
        for k, first in enumerate(self._distances(u)):
            at_risk = np.flatnonzero(GAP_SHARE * first.gap < speed)
            if not at_risk.size:
                continue
            done = np.zeros(len(at_risk))
            floor = (1 - GAP_SHARE) * first.gap[at_risk]
            for _ in range(ADVANCES):
                x = (self.rest + u[self.nodes])[at_risk] + done[:, None] * p[at_risk]
                obstacle = self.obstacles[k]
                d = obstacle.distance(x - self.time * np.asarray(obstacle.velocity))
                room = np.maximum(d.gap - floor, 0.0) / np.maximum(speed[at_risk], 1e-300)
                done = np.minimum(done + room, 1.0)
                if (room < 1e-3 * np.maximum(done, 1e-12)).all() or (done >= 1).all():
                    break
            share = min(share, float(done.min()))
        return share

    def obstacle_forces(self, u: np.ndarray) -> np.ndarray:
        """Force of every obstacle on the body [N], shape (obstacles, 3)."""
        total = np.zeros((len(self.obstacles), 3))
        for k, d in enumerate(self._distances(u)):
            total[k] = -(self._slope(d.gap)[:, None] * d.normal).sum(axis=0)
        for k, lag in enumerate(self.lagged):
            y, over, _ = self._slip(u, lag)
            total[k] -= ((lag.force * over)[:, None] * y).sum(axis=0)
        return total

    def forces(self, u: np.ndarray, count: int) -> np.ndarray:
        """Force of the obstacles on every node [N], shape (count, 3)."""
        out = np.zeros((count, 3))
        self.add_gradient(u, out)
        return -out


def _outer(n: np.ndarray) -> np.ndarray:
    return n[:, :, None] * n[:, None, :]
