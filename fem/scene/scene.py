"""The scene: a body, what holds it, what acts on it, and what is asked of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ..mesh import TetMesh, material_of
from .loads import Traction
from .obstacles import Obstacle, Plane
from .supports import Supports
from .up import UpAxis, up_index, up_vector

LEVEL = 0.99  # cosine from the up axis of what is ground


class Hold(NamedTuple):
    """What a user called a support: its ``name``, ids of its points, and the ``axes`` it holds.

    ``by`` is the prescribed displacement (3,) [m]; ``beyond`` how far the place goes on past its
    points, within tets that it cuts [m].
    """

    name: str
    points: Int[np.ndarray, "held"]
    axes: tuple[int, ...] = (0, 1, 2)
    by: tuple[float, ...] = (0.0, 0.0, 0.0)
    beyond: float = 0.0


@dataclass(frozen=True, eq=False, kw_only=True)
class Scene:
    """What every method of solution is given: physics only, in SI.

    Parameters
    ----------
    mesh
        Tets with a material.
    up
        The axis that points up, with its sign: the body's height is measured along it.
    supports
        What holds the body; None: nothing does.
    holds
        The supports by the names that a user gave them, where one did.
    gravity_vector
        Acceleration of gravity [m/s^2], shape (3,).
    tractions
        Forces per area [Pa] on boundary faces.
    forces
        Forces [N] at the points of the mesh, shape (points, 3).
    ground
        What the body stands on, without friction; None: it is held in the air.
    obstacles, friction
        Rigid obstacles, and the coefficient of Coulomb friction [1] on all of them.
    thickness
        Distance [m] from obstacles at which they begin to push; None: as the method says.
    self_contact
        Whether faces of the body keep out of each other in a motion, those of its pieces too.
    velocity
        Initial velocity [m/s], shape (3,) or (points, 3).
    duration, frames
        How long a motion is followed [s], and how many states of it are wanted after the start.
    modes
        How many natural vibrations are wanted.
    warnings
        What had to be assumed when the scene was built.

    Examples
    --------
    >>> from autophyx_tet.fem import METHODS, ElementMaterial, Scene, Supports, box_mesh
    >>> block = box_mesh((1, 1, 1), (1, 1, 1))
    >>> block = block.with_material(ElementMaterial.uniform(6, E=1e6, nu=0.0, rho=1e3))
    >>> held = Supports.clamp(len(block.points), block.points[:, 2] == 0)
    >>> scene = Scene(mesh=block, supports=held, gravity_vector=(0, 0, -10))
    >>> rest = METHODS["statics"].solve(scene, order=2)
    >>> round(float(-rest.displacement[:, 2].min()), 9)  # m: rho g L^2 / (2 E)
    0.005
    """

    mesh: TetMesh
    up: UpAxis = "z"
    supports: Supports | None = None
    holds: tuple[Hold, ...] = ()
    gravity_vector: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0)
    tractions: tuple[Traction, ...] = ()
    forces: Float[np.ndarray, "points 3"] | None = None
    ground: Plane | None = None
    obstacles: tuple[Obstacle, ...] = ()
    friction: float = 0.0
    thickness: float | None = None
    self_contact: bool = True
    velocity: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0)
    duration: float = 1.0
    frames: int = 60
    modes: int = 6
    warnings: tuple[str, ...] = ()

    @property
    def held(self) -> Supports:
        """What holds the body, on the points of the mesh."""
        return self.supports or Supports.none(len(self.mesh.points))

    @property
    def loads(self) -> dict[str, Any]:
        """What acts on the body, as ``solve_static`` takes it."""
        dead = {"gravity_vector": self.gravity_vector, "forces": self.forces}
        return dead | {"traction": self.tractions}

    @property
    def height(self) -> float:
        """Extent of the body along the up axis [m]."""
        return float(np.ptp(self.mesh.bounds[:, up_index(self.up)]))

    @property
    def longest(self) -> float:
        """Longest side of the body's bounding box [m]."""
        return float(np.ptp(self.mesh.bounds, axis=0).max())

    @property
    def floor(self) -> float | None:
        """Height [m] along the up axis of what the body stands on or falls to; None: nothing."""
        up = up_vector(self.up)
        planes = [o for o in (self.ground, *self.obstacles) if isinstance(o, Plane)]
        ways = [up @ o.normal / np.linalg.norm(o.normal) for o in planes]
        heights = [float(up @ o.point) for o, way in zip(planes, ways, strict=True) if way > LEVEL]
        return max(heights, default=None)

    def moving(self) -> Scene:
        """The scene of the tets that can move, of the same points: what is all held needs none."""
        mesh, free = self.mesh, np.logical_not(self.held.fixed.all(axis=1))
        kept = free[mesh.tets].any(axis=1)
        if kept.all() or not kept.any():
            return self
        tractions = []
        for load in self.tractions:
            some, one = free[load.faces].any(axis=1), np.ndim(load.value) == 1
            value, parts = load.value, load.parts
            tractions.append(load._replace(
                faces=load.faces[some], value=value if one else value[some],
                parts=None if parts is None else parts[some],
            ))  # fmt: skip
        material = material_of(mesh).of_tets(kept)
        some = {"tets": mesh.tets[kept], "region": mesh.region[kept], "material": material}
        return replace(self, mesh=replace(mesh, **some), tractions=tuple(tractions))

    def similar(self, scale: float) -> Scene:
        """Scene whose motion is ``scale`` times that of a body 1 / ``scale`` times as large.

        By similarity: stresses act as share^2, accelerations and speeds as ``scale`` of themselves.
        """
        return replace(
            self,
            mesh=self.mesh.with_material(material_of(self.mesh).times(scale**2)),
            gravity_vector=scale * np.asarray(self.gravity_vector, dtype=float),
            velocity=scale * np.asarray(self.velocity, dtype=float),
            tractions=tuple(t._replace(value=scale**2 * t.value) for t in self.tractions),
            forces=None if self.forces is None else scale**2 * self.forces,
        )
