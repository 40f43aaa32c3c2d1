"""Scenarios in motion: a body is dropped or squeezed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ..discrete.elastic import Law
from ..errors import InputError
from ..scene.mesh import TetMesh
from ..scene.obstacles import Plane, gripper
from ..scene.support_finder import up_axis
from ..solve.dynamics import Dynamics, Motion
from ..solve.schemes import Scheme
from .static import Axis

# A drop is followed for this many fall times, so that the bounce is seen.
FALLS = 3.0
DROP_FRAMES = 90
SQUEEZE_FRAMES = 20
# A squeeze is slow: the plates take this many times the crossing of the slowest shear wave.
SLOWNESS = 50.0
# And at least this long [s]: friction sticks below a speed that is a share of the size per second,
# so the corners of a squeeze in milliseconds (stiff bodies) would be too sharp for Newton.
LEAST = 10.0

Tell = Callable[[int, int], None]  # called with (frames done, frames in all)


@dataclass(frozen=True, eq=False)
class MotionResult:
    """A body in motion.

    Parameters
    ----------
    frames
        States at equal intervals ``dt`` [s], the start first.
    points
        Number of mesh points: the first rows of every frame.
    """

    frames: tuple[Motion, ...]
    dt: float
    points: int

    @property
    def displacements(self) -> Float[np.ndarray, "frames points 3"]:
        """Displacement [m] of the mesh points in every frame."""
        return np.stack([f.u[: self.points] for f in self.frames])

    @property
    def contact_forces(self) -> Float[np.ndarray, "frames 3"]:
        """Total force of the obstacles on the body [N] in every frame."""
        return np.stack([f.contact_force.sum(axis=0) for f in self.frames])

    @property
    def smallest_gap(self) -> float:
        """Smallest distance from an obstacle [m] ever; positive means no penetration."""
        return min(f.gap for f in self.frames)


def drop(
    mesh: TetMesh,
    *,
    up: Axis = "z",
    height: float | None = None,
    friction: float = 0.3,
    gravity: float = 9.81,
    frames: int = DROP_FRAMES,
    law: Law = Law.NEO_HOOKEAN,
    scheme: Scheme = Scheme.IMPLICIT_EULER,
    order: int = 1,
    device: str = "cpu",
    tell: Tell | None = None,
) -> MotionResult:
    """Let ``mesh`` fall on the ground from ``height`` [m], half its size by default.

    ``friction`` is the coefficient of Coulomb friction of the ground, ``gravity`` in [m/s^2];
    ``tell`` hears of every frame.
    """
    axis = up_axis(up)
    height = 0.5 * float(np.ptp(mesh.bounds, axis=0).max()) if height is None else height
    if not height > 0:
        raise InputError(f"height {height:g} m: wanted > 0")
    normal = np.eye(3)[axis]
    floor = mesh.bounds[0] - height * normal
    body = Dynamics(
        mesh,
        gravity=-gravity * normal,
        obstacles=[Plane(tuple(floor), tuple(normal))],
        friction=friction,
        law=law,
        scheme=scheme,
        order=order,
        device=device,
    )
    dt = FALLS * float(np.sqrt(2 * height / gravity)) / frames
    return MotionResult(tuple(_followed(body, dt, frames, tell)), dt, len(mesh.points))


def squeeze(
    mesh: TetMesh,
    *,
    axis: Axis = "x",
    share: float = 0.1,
    friction: float = 0.5,
    frames: int = SQUEEZE_FRAMES,
    law: Law = Law.NEO_HOOKEAN,
    order: int = 1,
    device: str = "cpu",
    tell: Tell | None = None,
) -> MotionResult:
    """Squeeze ``mesh`` between two plates that close by ``share`` of its width along ``axis``.

    The plates close slowly against the waves in the body; gravity is left out; ``tell`` hears of
    every frame.
    """
    if not 0 < share < 1:
        raise InputError(f"share {share:g}: wanted between 0 and 1")
    k = up_axis(axis)
    low, high = mesh.bounds
    width = float(high[k] - low[k])
    room = 1e-3 * float(np.linalg.norm(high - low)) * 0.5 * np.eye(3)[k]
    material = mesh.material
    if material is None:
        raise InputError("the mesh has no material yet: run `assign` first")
    slowest = float(np.sqrt((material.lame.mu / material.rho).min()))
    duration = max(LEAST, SLOWNESS * float(np.linalg.norm(high - low)) / slowest)
    plates = gripper(tuple(low - room), tuple(high + room), k, share * width / 2 / duration)
    body = Dynamics(mesh, obstacles=plates, friction=friction, law=law, order=order, device=device)
    dt = duration / frames
    return MotionResult(tuple(_followed(body, dt, frames, tell)), dt, len(mesh.points))


def _followed(body: Dynamics, dt: float, frames: int, tell: Tell | None) -> Iterator[Motion]:
    """The states after every step, the start first, each one told of."""
    yield body.state
    for frame in range(1, frames + 1):
        yield body.step(dt)
        if tell is not None:
            tell(frame, frames)
