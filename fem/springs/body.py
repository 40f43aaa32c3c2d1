"""The network of a scene, as its method: anchors, springs, loads, contacts, the mesh after them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from ..elements.assembly import discretise
from ..elements.forces import load_vector
from ..errors import UsageError
from ..mesh import face_areas, material_of, point_components
from ..note import Note
from ..scene.obstacles import Plane
from ..scene.scene import Scene
from ..solve.method import FrameProgress
from ..solve.result import Motion, MotionResult
from ..validation import checked_count, checked_positive
from .motion import AnchorLoads, SpringMotion, SurfaceContact, network_frequencies
from .network import (
    CAUCHY_NU,
    SOFTEST,
    Anchors,
    LineOfSight,
    SpringNetwork,
    sample_anchors,
    stiffened,
)

# A network has nu = 1/4: what is further from it than this is said.
NEAR_NU = 0.05
# Bending needs so many anchors of thickness: at 3.7 a slab of nu 1/4 rings at .94 of its tone.
LAYERS = 6.0
# Where a part is fewer anchors thick than this, hinges are looked for: vibrations that are slower
# than this fraction of the slowest wave's across the body.
HINGES, SLACK = 3.0, 1e-3
# Contact begins this fraction of the body's diagonal before a plane, as for finite elements.
REACH = 1e-3
# Stiffness of contact over that of a cube of matter around an anchor.
HARDNESS = 4.0


@dataclass(frozen=True, eq=False, kw_only=True)
class SpringBody:
    """The network of a scene, and the points of its mesh after it.

    ``weights`` (points, anchors), sparse, are those of the anchors for the mesh points; ``loads``
    and ``contact`` act on the anchors; ``notes`` say what a network does not know of this body.
    ``asked`` is how many anchors were asked for, beside which there are those that are held.
    """

    scene: Scene
    network: SpringNetwork
    weights: Any
    loads: AnchorLoads
    contact: SurfaceContact | None
    notes: tuple[str, ...]
    asked: int

    def motion(
        self, stiffness: Float[np.ndarray, "springs"], *, dashpot: float = 0.0
    ) -> SpringMotion:
        """Motion from the start, with springs of ``stiffness`` [N/m] and ``dashpot`` [s] of it."""
        mesh, anchors = self.scene.mesh, self.network.anchors
        velocity = np.asarray(self.scene.velocity, dtype=float)
        if velocity.ndim == 2:
            of_tets = velocity[mesh.tets].mean(axis=1)
            from scipy.spatial import KDTree

            velocity = of_tets[KDTree(mesh.centroids).query(anchors.x)[1]]
        return SpringMotion(
            network=self.network,
            stiffness=stiffness,
            dashpot=dashpot * stiffness if dashpot else None,
            loads=self.loads,
            contact=self.contact,
            velocity=np.broadcast_to(velocity, anchors.x.shape).copy(),
        )

    def displacement(self, x: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "points 3"]:
        """Displacement [m] of the mesh points where anchors are at ``x`` [m]."""
        held = self.scene.held
        moved = self.weights @ (x - self.network.anchors.x)
        return np.where(held.fixed, held.values, moved)

    def state(self, motion: SpringMotion, time: float) -> Motion:
        """The mesh at ``time`` [s]; forces are means since the last state."""
        scene, anchors, x = self.scene, self.network.anchors, motion.x
        u, v, free = self.displacement(x), motion.synchronous_v, ~scene.held.fixed
        force, gap, barrier = np.zeros((len(scene.obstacles), 3)), np.inf, 0.0
        at_points, contact = np.zeros_like(u), self.contact
        if contact is not None:
            impulses = motion.take_impulses() / (scene.duration / scene.frames)
            used = np.unique(scene.mesh.boundary.faces)
            at_points[used] = impulses.sum(axis=1)
            force = impulses.sum(axis=0)
            here = scene.mesh.points[used] + u[used]
            for plane in contact.planes:
                shift = time * np.asarray(plane.velocity, dtype=float)
                gaps = plane.distance(here - shift).gap
                gap = min(gap, float(gaps.min()))
                depth = np.maximum(contact.reach - gaps, 0)
                barrier += 0.5 * float(contact.stiffness @ depth**2)
        return Motion(
            time=time,
            u=u,
            v=free * (self.weights @ v),
            a=free * (self.weights @ motion.a),
            contact_force=at_points,
            obstacle_force=force,
            gap=gap,
            kinetic=0.5 * float(anchors.mass @ (v**2).sum(axis=1)),
            elastic=motion.elastic,
            potential=-float((self.loads.force * (x - anchors.x)).sum()),
            barrier=barrier,
            iterations=0,
        )


def spring_body(
    scene: Scene, anchors: int = 2048, neighbours: int = 32, *, seed: int = 0
) -> SpringBody:
    """Network of about ``anchors`` anchors with ``neighbours`` each for a scene; see there."""
    mesh, material = scene.mesh, material_of(scene.mesh)
    faces = mesh.boundary.faces
    surface = LineOfSight(mesh.points, faces)
    placed = sample_anchors(mesh, anchors, supports=scene.held, surface=surface, seed=seed)
    network = SpringNetwork.of(placed, neighbours, surface)
    weights = interpolation(mesh.points, point_components(mesh), placed, surface)
    diagonal = float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
    # Weight, tractions and forces of the scene on its anchors, and springs to the ground
    space = discretise(mesh, 1)
    load = load_vector(mesh, space, traction=scene.tractions, forces=scene.forces)
    weight = placed.mass[:, None] * np.asarray(scene.gravity_vector, dtype=float)
    ground = np.maximum(weights.T @ scene.held.springs, 0.0)
    # What a network of springs does not know of this body
    notes = []
    far = np.abs(material.nu - CAUCHY_NU) > NEAR_NU
    for k, name in enumerate(mesh.region_names):
        inside = far & (mesh.region == k)
        if inside.any():
            mean = float(np.average(material.nu[inside], weights=mesh.volumes[inside]))
            notes.append(Note("body.springs_take", name=name, cauchy_nu=CAUCHY_NU, mean=mean))
    for name, layers in zip(mesh.region_names, placed.layers, strict=True):
        if layers < LAYERS:
            notes.append(Note("body.about_anchors", name=name, layers=layers, layers_2=LAYERS))
    if placed.layers.min() < HINGES:
        wave = float(np.sqrt((placed.E / mesh.mass * mesh.volume).min())) / diagonal
        if network_frequencies(network, network.stiffness())[0] < SLACK * wave:
            notes.append(Note("body.pieces_turn"))
    if network.bridges:
        notes.append(Note("body.springs_leave", bridges=network.bridges))
    if material.tensor is not None:
        notes.append(Note("body.wood_taken"))
    contact = None
    if scene.obstacles:
        planes = tuple(o for o in scene.obstacles if isinstance(o, Plane))
        if len(planes) < len(scene.obstacles):
            raise UsageError("body.springs_meet")
        used = np.unique(faces)
        area = np.bincount(faces.ravel(), np.repeat(face_areas(mesh.points, faces) / 3, 3))[used]
        E = np.zeros(len(mesh.points))
        np.maximum.at(E, mesh.tets.ravel(), np.repeat(material.E, 4))
        contact = SurfaceContact(
            points=mesh.points[used],
            weights=weights[used],
            stiffness=HARDNESS * E[used] * area / placed.spacing,
            planes=planes,
            friction=scene.friction,
            reach=REACH * diagonal if scene.thickness is None else scene.thickness,
        )
    return SpringBody(
        scene=scene,
        network=network,
        weights=weights,
        loads=AnchorLoads(force=weight + weights.T @ load, ground=ground),
        contact=contact,
        notes=tuple(notes),
        asked=anchors,
    )


# Points that follow anchors: linear moving least squares at rest, fixed weights in motion.

# Anchors that a point follows, and those that they are chosen from.
NEAREST, CHOICE = 12, 32
# Directions in which the anchors around a point reach less than this fraction are not followed:
# there a point stays as far from them as it is.
FLAT = 0.1


def interpolation(
    points: Float[np.ndarray, "points 3"],
    body: Int[np.ndarray, "points"],
    anchors: Anchors,
    surface: LineOfSight,
) -> Any:
    """Weights of the anchors for ``points`` [m] of the given ``body``: u = W u_anchors.

    Every row adds up to one, and affine displacements are reproduced where the anchors around a
    point span its neighbourhood. Returns (points, anchors) ``scipy.sparse.csr_array``.
    """
    from scipy.sparse import csr_array
    from scipy.spatial import KDTree

    count = min(CHOICE, len(anchors.x))
    near = KDTree(anchors.x).query(points, count)[1].reshape(len(points), count)
    start = np.repeat(np.arange(len(points)), count)
    seen = ~surface.crossed(points[start], anchors.x[near.ravel()])
    seen &= anchors.body[near.ravel()] == body[start]
    order = np.argsort(~seen.reshape(near.shape), axis=1, kind="stable")[:, :NEAREST]
    near = np.take_along_axis(near, order, axis=1)
    good = np.take_along_axis(seen.reshape(-1, count), order, axis=1)
    good |= ~good.any(axis=1, keepdims=True)  # where none is seen: the nearest ones
    # Weights of sum one and of first moment zero about `points`, over the `good` ones
    around = anchors.x[near]
    away = np.linalg.norm(around - points[:, None], axis=2)
    reach = 1.1 * np.where(good, away, 0.0).max(axis=1, keepdims=True) + 1e-300
    theta = np.where(good, (1 - np.minimum(away / reach, 1) ** 2) ** 2 + 1e-6, 0.0)
    theta /= theta.sum(axis=1, keepdims=True)
    centre = np.einsum("nk,nki->ni", theta, around)
    arm = around - centre[:, None]
    spread = np.einsum("nk,nki,nkj->nij", theta, arm, arm)
    inverse = np.linalg.pinv(spread, rcond=FLAT**2, hermitian=True)
    slope = np.einsum("nki,nij,nj->nk", arm, inverse, points - centre)
    weights = theta * (1 + slope)
    row = np.repeat(np.arange(len(points)), near.shape[1])
    return csr_array((weights.ravel(), (row, near.ravel())), shape=(len(points), len(anchors.x)))


# CPU time of half a spring and step [s]: 3.3 to 5 ns were measured, on a busy machine more.
COST = 6e-9
# A run that takes longer [s] is refused.
PATIENCE = 600.0


@dataclass(frozen=True, kw_only=True)
class SpringMethod:
    """Motion of a scene by a spring-mass network.

    anchors, neighbours: Anchors of the body, and how many each is joined with.
    eta: Weights of the neighbours: 0, all of them alike; 20, the nearest sixteen alone.
    scale: What the calibrated stiffness of the springs is multiplied by [1].
    surface: Logarithm [1] of the stiffness at the surface over that in the middle, as a fit finds
        it.
    stiffer: How many times as stiff [1] as at the softest eta, k the same: eta is then found for
        that.
    dashpot: Damping of every spring over its stiffness [s].
    seed: Of the places of the anchors.
    announce: Hears springs, steps and expected time, in words, before the run.
    """

    anchors: int = 2048
    neighbours: int = 32
    eta: float = 0.0
    scale: float = 1.0
    surface: float = 0.0
    stiffer: float | None = None
    dashpot: float = 0.0
    seed: int = 0
    announce: Callable[[str], None] | None = None

    laws: tuple[str, ...] = ()

    def solve(
        self,
        scene: Scene,
        *,
        law: str | None = None,
        order: int | None = None,
        device: str = "cpu",
        progress: FrameProgress | None = None,
    ) -> MotionResult:
        """Follow the scene for its duration.

        Raises UsageError: Where an obstacle is no plane, the run would take ten minutes, a GPU is
            asked for, or a ``law`` or an ``order``: these are for elements.
        Raises ConvergenceError: Where the steps turn out unstable.
        """
        if law is not None or order is not None:
            raise UsageError("method.springs_elements")
        if device != "cpu":
            raise UsageError("method.springs_device")
        body = spring_body(scene, self.anchors, self.neighbours, seed=self.seed)
        frames = checked_count("frames", scene.frames)
        dt = checked_positive("duration", scene.duration, "s") / frames
        motion = body.motion(self.stiffness(body), dashpot=self.dashpot)
        springs, steps = len(motion.network.i), motion.steps_for(scene.duration)
        seconds = 2 * COST * springs * steps
        if seconds > PATIENCE:
            raise UsageError(
                "method.springs_stiff",
                longest_step=motion.longest_step,
                steps=steps,
                minutes=seconds / 60,
            )
        count = len(motion.network.anchors.x)
        plan = Note("method.anchors_springs", count=count, springs=springs, steps=steps)
        plan = f"{plan}: some {seconds:,.0f} s"
        if self.announce is not None:
            self.announce(plan)
        states = [body.state(motion, 0.0)]
        for frame in range(1, frames + 1):
            motion.advance(dt)
            states.append(body.state(motion, frame * dt))
            if progress is not None:
                progress(frame, frames)
        solution = (("springs", plan), ("steps", f"{motion.steps:,}"))
        points = len(scene.mesh.points)
        return MotionResult(tuple(states), dt, points, order=0, notes=body.notes, solution=solution)

    def stiffness(self, body: SpringBody) -> Float[np.ndarray, "springs"]:
        """Stiffness of the springs of ``body`` [N/m]."""
        if self.stiffer is None:
            return self.scale * body.network.stiffness(self.eta, surface=self.surface)
        k = self.scale * body.network.constants(SOFTEST, self.surface)
        return stiffened(body.network, k, self.stiffer)


METHOD = SpringMethod()
