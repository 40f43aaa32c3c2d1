"""What holds, grips, twists or stops particles on the nodes of the grid, and what pushes them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ..errors import InputError
from ..scene.obstacles import Box, Obstacle, Plane
from .background import BackgroundGrid
from .particles import Particles


class Touch(IntEnum):
    """What a wall does: it lets slide, holds altogether, or lets go and brakes by friction."""

    SLIP = 0
    STICKY = 1
    SEPARATE = 2


@dataclass(frozen=True, kw_only=True)
class Wall:
    """A rigid thing in the grid: nodes inside its ``shape`` follow it.

    Parameters
    ----------
    shape
        Plane, box, ball, capsule or another ``Obstacle``; it moves at its own velocity.
    touch
        What it does to matter: a grip is sticky, a slide slips, the ground separates.
    friction
        Coefficient of Coulomb friction [1] where it separates.
    start, end
        When it is there [s]: a release is an end.
    spin, axis_point
        Turn [rad/s] of a grip, shape (3,), about an axis through the point [m].
    """

    shape: Obstacle
    touch: Touch = Touch.SEPARATE
    friction: float = 0.0
    start: float = 0.0
    end: float = np.inf
    spin: Sequence[float] = (0.0, 0.0, 0.0)
    axis_point: Sequence[float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        numbers = [self.friction, *self.spin, *self.axis_point, *self.shape.velocity]
        if not (np.isfinite(numbers).all() and self.friction >= 0):
            raise InputError(f"wall {self}: wanted finite numbers, friction >= 0")

    @property
    def moves(self) -> bool:
        """Whether other nodes lie in it later."""
        turns = np.any(self.spin) and self.touch != Touch.STICKY
        return bool(np.any(self.shape.velocity) or turns)

    def at(
        self, lattice: BackgroundGrid, nodes: Int[np.ndarray, "nodes"], time: float
    ) -> WallNodes:
        """Nodes of ``nodes`` in the wall at ``time`` [s]."""
        if not self.start <= time < self.end:
            nodes = nodes[:0]
        x = lattice.positions(nodes)
        velocity = np.asarray(self.shape.velocity, dtype=float)
        # A node on the surface is in the wall, whatever the last digit of its place.
        found = self.shape.distance(x - velocity * (time - self.start if self.moves else 0.0))
        inside = found.gap <= 1e-9 * lattice.spacing
        arm = x[inside] - self.axis_point
        return WallNodes(nodes[inside], found.normal[inside], velocity + np.cross(self.spin, arm))


@dataclass(frozen=True, eq=False)
class WallNodes:
    """Numbers of nodes, outward normals of the wall there, and its velocities [m/s]."""

    nodes: Int[np.ndarray, "nodes"]
    normals: Float[np.ndarray, "nodes 3"]
    velocities: Float[np.ndarray, "nodes 3"]


def room_walls(
    low: Sequence[float], high: Sequence[float], touch: Touch = Touch.SLIP
) -> tuple[Wall, ...]:
    """Six planes that close the room from ``low`` to ``high`` [m]."""
    inward = np.eye(3)
    return tuple(
        Wall(shape=Plane(tuple(corner), tuple(sign * inward[axis])), touch=touch)
        for corner, sign in ((low, 1.0), (high, -1.0))
        for axis in range(3)
    )


@dataclass(frozen=True, kw_only=True)
class Impulse:
    """A push of ``momentum`` (3,) [N s] on all mass within a ``box`` at ``time`` [s].

    It is shared by mass: the change of velocity depends neither on sampling nor on steps.
    """

    momentum: Sequence[float]
    box: Box | None = None
    time: float = 0.0

    def change(
        self, x: Float[np.ndarray, "n 3"], mass: Float[np.ndarray, "n"]
    ) -> Float[np.ndarray, "n 3"]:
        """Change of the velocities [m/s] of particles of these places [m] and masses [kg]."""
        hit = np.ones(len(x), dtype=bool) if self.box is None else self.box.distance(x).gap <= 0
        if not hit.any():
            raise InputError(f"an impulse of {self.momentum} N s meets no particle: move its box")
        return hit[:, None] * np.asarray(self.momentum, dtype=float) / mass[hit].sum()


class StillNodes(NamedTuple):
    """Numbers of the nodes that stationary particles reach, and their mass [kg] there."""

    nodes: Int[np.ndarray, "nodes"]
    mass: Float[np.ndarray, "nodes"]


def still_nodes(held: Particles | None, lattice: BackgroundGrid) -> StillNodes:
    """Stationary mass on the nodes of the grid, by the weights of the particles."""
    total = np.zeros(lattice.count)
    if held is not None:
        first = lattice.first_nodes(held.x)
        room = ((first >= 0) & (first < np.array(lattice.shape) - 2)).all(axis=1)
        first, x, mass = first[room], held.x[room], held.mass[room]
        f = (x - lattice.origin) / lattice.spacing - first
        w = np.stack([0.5 * (1.5 - f) ** 2, 0.75 - (f - 1) ** 2, 0.5 * (f - 0.5) ** 2])
        for a, b, c in np.ndindex(3, 3, 3):
            share = mass * w[a, :, 0] * w[b, :, 1] * w[c, :, 2]
            total += np.bincount(lattice.flat(first + np.array([a, b, c])), share, lattice.count)
    nodes = np.flatnonzero(total)
    return StillNodes(nodes, total[nodes])
