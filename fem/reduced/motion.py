"""A scene followed by a reduced body, and again in fields of what the first motion missed.

A basis is made before any motion, of vibrations and of how they bend on. What it lacks is small and
stiff, and is not known before; the error that is estimated beside a motion is an answer of the full
body to what the coordinates leave unbalanced, so that it lies where they lack. Its principal
components join them. Of the linear law all of it is the full body's motion.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ..device import one_thread, single_threaded
from ..elements.assembly import (
    Discretisation,
    add_diagonal,
    apply_supports,
    discretise,
    node_supports,
)
from ..elements.elastic import ElasticBody
from ..elements.forces import load_vector, lumped_mass, weighing_mass
from ..elements.space import Space, extend_linear, make_space
from ..errors import ConvergenceError, InputError, UsageError
from ..laws.law import Law
from ..linalg.cholesky import CholeskyFactor, NotPositive, planned_elimination
from ..linalg.krylov import length
from ..linalg.solver import MOST_ENTRIES
from ..mesh import TetMesh, material_of
from ..note import Note
from ..scene.scene import Scene
from ..scene.supports import Supports
from ..solve.contact import Contact
from ..solve.method import FrameProgress, halving_notes
from ..solve.nonlinear import Point, minimise
from ..solve.result import MOTION_LIMIT, Impact, ModelError, Motion, MotionResult, locking_fraction
from ..solve.schemes import ROUND_OFF, Forecast, Kinematics, Scheme, Step
from ..validation import checked_count, checked_positive
from .basis import (
    HANDLES,
    accuracy_warnings,
    linear_body,
    orthonormal_fields,
    principal_fields,
    reduce_body,
    whole_model,
)
from .cubature import CELLS, with_cells
from .elasticity import KeptInverse, ReducedElasticity, reduced_frequencies
from .model import ReducedModel, Subspace

# A motion that is off by more than the limit is followed again so often, with so many fields more:
# the swing of a soft bonsai in 34 coordinates is 26 % off, in 46 then 8, in 58 2 %.
ROUNDS, JOINING = 2, 12


def impact_of(states: Sequence[Motion]) -> Impact:
    """How obstacles were met in steps that each ended with one of ``states``, but the first."""
    given = max(s.kinetic + s.elastic + s.barrier for s in states) or 1.0
    forces = np.linalg.norm([s.obstacle_force for s in states], axis=2)
    pairs = [(a, b) for a, b in pairwise(states) if a.barrier or b.barrier]
    lost = max((a.energy - b.energy for a, b in pairs), default=0.0) / given
    return Impact(forces.max(axis=0), lost, max(s.barrier for s in states) / given, 0.0)


class Followed(NamedTuple):
    """A motion, the model that made it, its error (None: not known), and steps halved.

    ``before`` are the errors [1] of the motions that were given up for it.
    """

    model: ReducedModel
    states: tuple[Motion, ...]
    error: ModelError | None
    halved: int
    before: tuple[float, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Following:
    """How a scene is followed: by intervals of ``dt`` [s], a law and a scheme.

    ``rounds`` are how often at most it is followed again, ``most_cells`` those of the models of
    these (0: all). ``announce`` hears of each before, in words. ``rough`` is whether the full body
    is followed beside it in every second frame alone, by tangents that serve for longer.
    """

    dt: float
    frames: int
    law: str = Law.NEO_HOOKEAN
    scheme: Scheme = Scheme.BDF2
    most_cells: int = CELLS[-1]
    rounds: int = ROUNDS
    rough: bool = False
    announce: Callable[[str], None] | None = None
    progress: FrameProgress | None = None

    def of(self, scene: Scene, model: ReducedModel) -> Followed:
        """The motion of ``scene`` by ``model``, or by what it is made of what that missed."""
        followed, missed = self._once(scene, model)
        for _ in range(self.rounds):
            error = followed.error
            if missed is None or error is None or error.share <= MOTION_LIMIT:
                break
            if model.kind is not Subspace.VECTOR:
                break
            if self.announce is not None:
                self.announce(Note("motion.off_once", words=error.words, joining=JOINING))
            wider = enriched(followed.model, scene, missed, most_cells=self.most_cells)
            again, missed = self._once(scene, wider)
            if again.error is None or again.error.share >= error.share:
                break
            followed = again._replace(before=(*followed.before, error.share))
        return followed

    def _once(self, scene: Scene, model: ReducedModel) -> tuple[Followed, np.ndarray | None]:
        """The motion by ``model``, and what it missed (frames, nodes, 3) [m], those checked."""
        body = reduced_dynamics(scene, model, law=self.law, scheme=self.scheme)
        states, halved = [body.state], 0
        for frame in range(1, self.frames + 1):
            states.append(body.step(self.dt))
            halved += body.last_dt != self.dt
            if self.progress is not None:
                self.progress(frame, self.frames)
        space, checked = make_space(scene.mesh, model.order), states[:: 2 if self.rough else 1]
        missed = missed_motion(
            scene.mesh,
            scene.supports,
            checked,
            load=nodal_forces_of(scene, model.order),
            velocity=start_velocity(scene, space),
            law=self.law,
            scheme=self.scheme,
            order=model.order,
            contact=_contact_of(scene, space),
            rough=self.rough,
        )
        if missed is not None and self.rough:
            missed *= ROUGHLY
        error = None if missed is None else error_of(missed, checked, model.mass)
        return Followed(model, tuple(states), error, halved), missed


@single_threaded
def enriched(
    model: ReducedModel,
    scene: Scene,
    missed: Float[np.ndarray, "frames nodes 3"],
    *,
    joining: int = JOINING,
    most_cells: int,
) -> ReducedModel:
    """Model of the held body of ``scene``, with principal components of what a motion ``missed``.

    These [m] join its fields. Cells are chosen anew, and accepted by the scene's forces.
    """
    body = linear_body(scene.mesh, scene.supports, order=model.order)
    joined = principal_fields(np.moveaxis(missed, 0, 2), model.basis, model.mass, joining)
    basis = orthonormal_fields(np.concatenate([model.basis, joined], axis=2), model.mass)
    whole = whole_model(body, basis, Subspace.VECTOR)
    accuracy = whole.accuracy._replace(stiffening=model.accuracy.stiffening)
    load = whole.pull_back(nodal_forces_of(scene, model.order))
    return with_cells(replace(whole, accuracy=accuracy), load, most_cells)


def reduced_dynamics(
    scene: Scene, model: ReducedModel, *, law: str, scheme: Scheme = Scheme.BDF2
) -> ReducedDynamics:
    """The body of ``scene`` at its start, moved by ``model``."""
    space = make_space(scene.mesh, model.order)
    with one_thread():
        return ReducedDynamics(
            model,
            load=model.pull_back(nodal_forces_of(scene, model.order)),
            velocity=model.coordinates(start_velocity(scene, space)),
            contact=_contact_of(scene, space),
            law=law,
            scheme=scheme,
        )


def start_velocity(scene: Scene, space: Space) -> Float[np.ndarray, "nodes 3"]:
    """Velocity [m/s] of the nodes that the scene starts with."""
    velocity = np.asarray(scene.velocity, dtype=float)
    at_points = np.broadcast_to(velocity, scene.mesh.points.shape)
    return extend_linear(space, at_points)


def nodal_forces_of(scene: Scene, order: int) -> Float[np.ndarray, "nodes 3"]:
    """Forces [N] at the nodes of elements of ``order``, of all that acts."""
    grid = discretise(scene.mesh, order)
    weighing = weighing_mass(scene.mesh, grid, scene.held)
    weight = weighing[:, None] * np.asarray(scene.gravity_vector, dtype=float)
    return weight + load_vector(scene.mesh, grid, traction=scene.tractions, forces=scene.forces)


def _contact_of(scene: Scene, space: Space) -> Contact:
    """The obstacles of ``scene`` against the nodes of the body."""
    return Contact(scene.mesh, space, scene.obstacles, scene.friction, scene.thickness)


# How far a reduced motion is from the full body's, followed beside it a posteriori.
#
# What the coordinates leave unbalanced is a force on the full mesh, r = M a + f(u) + S u - load.
# The error e of the motion answers to it, M e'' + K e = -r, by the same steps, K the tangent about
# the reduced motion, with that of the ground where it stands: dead forces would tip it over. One
# factor serves as long as the body stays near where it was made: all frames of a stiff body. Exact
# for the linear law, for others to the first order in e.

# A tangent serves until a point has moved so far since, over the body's longest side; and where the
# error is wanted to a part of itself only.
NEAR, ROUGHLY_NEAR = 0.02, 0.1
# A rough error is this much larger than what was found: of a plant that swings by its own height
# that is a fifth of the truth, of a bar that folds two sevenths.
ROUGHLY = 5.0
# And until obstacles press by so much more or less, over their stiffness.
ALIKE = 0.5


@single_threaded
def missed_motion(
    mesh: TetMesh,
    supports: Supports | None,
    states: Sequence[Motion],
    *,
    load: Float[np.ndarray, "nodes 3"],
    velocity: Float[np.ndarray, "nodes 3"],
    law: str,
    scheme: Scheme = Scheme.BDF2,
    contact: Contact | None = None,
    order: int = 1,
    rough: bool = False,
) -> Float[np.ndarray, "frames nodes 3"] | None:
    """What a reduced motion lacks of the full body's [m], of every frame but the start.

    An estimate; None where the mesh is too large for a factor. ``states`` are at equal times, the
    start first, their contact forces taken as they are; ``load`` [N] and ``velocity`` [m/s] at the
    start are those of the nodes, ``contact`` the obstacles that were met. A ``rough`` one takes
    tangents that serve for longer, and have no negative part: what such a one drives away would
    come back before the next.
    """
    full = _FullBody(mesh, supports, law, load, order, contact, rough)
    if full.plan.entries > MOST_ENTRIES or len(states) < 2:
        return None
    dt = states[1].time - states[0].time
    late = np.where(full.fixed, 0.0, velocity - states[0].v)
    per_mass = 1 / np.where(full.mass > 0, full.mass, 1.0)[:, None]
    start = Kinematics(np.zeros_like(load), late, -full.unbalanced(states[0]) * per_mass)
    now, before = start, None
    errors = []
    for state in states[1:]:
        step = Step.of(scheme, dt, now, before)
        inertia = step.factor * full.mass[:, None]
        push = np.where(full.fixed, 0.0, inertia * step.target - full.unbalanced(state))
        e = full.solve(step.factor, state, push)
        now, before = step.ended(e), now
        errors.append(e)
    return np.stack(errors)


def error_of(
    missed: Float[np.ndarray, "frames nodes 3"],
    states: Sequence[Motion],
    mass: Float[np.ndarray, "nodes"],
) -> ModelError:
    """Size of what was ``missed`` [m] by ``states``, the start first, with the ``mass`` [kg]."""
    moved = np.stack([state.u for state in states[1:]])
    error, size = (float(np.sqrt((mass[:, None] * x**2).sum())) for x in (missed, moved))
    largest = float(np.linalg.norm(missed, axis=2).max())
    return ModelError(error / size if size else 0.0, largest)


class _FullBody:
    """The full body: its forces, and (c M + K)^-1 about rest for every factor c [1/s^2]."""

    def __init__(
        self,
        mesh: TetMesh,
        supports: Supports | None,
        law: str,
        load: np.ndarray,
        order: int,
        contact: Contact | None,
        rough: bool,
    ) -> None:
        self.mesh, self.load = mesh, load
        self.contact = contact if contact is not None and contact.obstacles else None
        self.grid: Discretisation = discretise(mesh, order)
        self.mass = lumped_mass(mesh, self.grid.space)
        self.elastic = ElasticBody(self.grid, material_of(mesh), law)
        held = node_supports(supports or Supports.none(len(mesh.points)), self.grid.space)
        self.fixed, self.springs = held.fixed | (self.mass == 0)[:, None], held.springs
        self.reach = (ROUGHLY_NEAR if rough else NEAR) * float(np.ptp(mesh.bounds, axis=0).max())
        self.tangents = (True,) if rough else (False, True)
        self.plan = planned_elimination(self.grid.pattern, self.grid.space.edges)
        self._about: np.ndarray | None = None
        self._factor, self._pressed = 0.0, np.zeros((1, 3, 3))

    def unbalanced(self, state: Motion) -> Float[np.ndarray, "nodes 3"]:
        """Force [N] that the coordinates leave at the nodes that are free."""
        force = self.mass[:, None] * state.a + self.elastic.response(state.u).force
        force += self.springs * state.u - self.load - state.contact_force
        return np.where(self.fixed, 0.0, force)

    def solve(self, factor: float, state: Motion, b: np.ndarray) -> Float[np.ndarray, "nodes 3"]:
        """(c M + K)^-1 b for the ``factor`` c [1/s^2], K about a state near to ``state``."""
        u, ground = state.u, np.zeros((1, 3, 3))
        if self.contact is not None:  # stiffness [N/m] of the obstacles at every point
            self.contact.begin(u, state.time, 1.0)
            ground = self.contact.hessian_blocks(u)[0]
        near = self._about is not None and np.abs(u - self._about).max() <= self.reach
        changed = np.linalg.norm(ground - self._pressed)
        near = near and changed <= ALIKE * np.linalg.norm(self._pressed)
        if near and factor == self._factor:
            return self._inverse.solve(b)
        self._about, self._factor, self._pressed = u, factor, ground
        for projected in self.tangents:
            matrix = self.elastic.tangent(u, projected=projected)
            if self.contact is not None:
                matrix = self.contact.with_hessian(u, matrix)
            add_diagonal(matrix, (factor * self.mass)[:, None, None] * np.eye(3))
            apply_supports(matrix, self.fixed, self.springs)
            try:
                self._inverse = CholeskyFactor(matrix, self.plan)
            except NotPositive:
                continue
            return self._inverse.solve(b)
        raise ConvergenceError("motion.full_bodys")


# Motion of a reduced body: every step minimises an incremental potential of the coordinates.

logger = logging.getLogger(__name__)

# A step ends when the unbalanced force is below this fraction of the external and inertial force.
TOLERANCE = 1e-4
# A step that fails is halved so often at most.
HALVINGS = 8
FRICTION_PASSES = 2
# Moves that make room in front of an obstacle: each meets the sites that the last one left behind.
ROOM_PASSES = 10


class _Potential:
    """Incremental potential: c/2 |q - target|^2 + W(q) - f . q + barrier + friction."""

    def __init__(self, body: ReducedDynamics, factor: float, target: np.ndarray) -> None:
        self.of, self.factor, self.target = body, factor, target
        stiffness = factor + body.stiffest
        self.least = ROUND_OFF * stiffness * length(target) / body.tolerance
        self._gradient = np.zeros_like(target)  # of what was evaluated last
        body.kept.begin(factor * target)

    def evaluate(self, q: np.ndarray) -> Point:
        """Energy, infinite on contact; gradient; size of the external and inertial force."""
        of, away = self.of, q - self.target
        push = self.factor * away
        energy, force = of.elasticity.response(q)
        energy += 0.5 * float(push @ away) - float(of.load @ q)
        gradient, scale = force + push - of.load, max(of.load_size, length(push))
        if of.contact is not None:
            u = of.model.displacement(q)
            barrier = of.contact.value(u)
            if not np.isfinite(barrier):
                return Point(np.inf, np.full_like(q, np.inf), 0.0)
            contact = -of.model.pull_back(of.contact.forces(u, len(u)))
            energy, gradient = energy + barrier, gradient + contact
            scale = max(scale, length(contact))
        self._gradient = gradient
        return Point(energy, gradient, max(scale, self.least, 1e-300))

    def hessian(self, q: np.ndarray, *, projected: bool) -> KeptInverse:
        """Inverse of the second derivative (dofs, dofs) [s^2] at ``q``, the last one evaluated.

        Without obstacles that of an earlier state serves as long as it does well.
        """
        of = self.of
        if of.contact is not None:
            of.kept.inverse = None

        def matrix() -> np.ndarray:
            H = of.elasticity.tangent(q, projected=projected)
            H.flat[:: len(q) + 1] += self.factor
            if of.contact is not None:
                H += pulled_hessian(of.model, of.contact, of.model.displacement(q))
            return H

        return of.kept.at(q, self._gradient, matrix, projected)

    def longest_step(self, q: np.ndarray, step: np.ndarray) -> float:
        """Fraction of ``step`` that keeps the body out of the obstacles."""
        if self.of.contact is None:
            return np.inf
        model = self.of.model
        return self.of.contact.longest_step(model.displacement(q), model.displacement(step))


class ReducedDynamics:
    """A reduced body in motion.

    ``load`` [N/sqrt(kg)] on the coordinates is constant (``model.weight`` and ``model.pull_back``
    make it), ``velocity`` [m sqrt(kg)/s] the initial one. ``contact`` are obstacles against the
    surface of the full body, pulled back through the basis; ``tolerance`` is the residual of a
    step over the external and inertial force.
    """

    def __init__(
        self,
        model: ReducedModel,
        *,
        load: Float[np.ndarray, "dofs"] | None = None,
        velocity: Float[np.ndarray, "dofs"] | None = None,
        contact: Contact | None = None,
        law: str = Law.NEO_HOOKEAN,
        scheme: Scheme = Scheme.BDF2,
        tolerance: float = TOLERANCE,
    ) -> None:
        self.model, self.scheme, self.tolerance = model, scheme, tolerance
        self.elasticity = ReducedElasticity(model, law)
        self.contact = contact if contact is not None and contact.obstacles else None
        zero = np.zeros(model.dofs)
        self.load = zero if load is None else load
        self.load_size = length(self.load)
        self.stiffest = float(np.linalg.eigvalsh(self.elasticity.tangent(zero))[-1])
        if self.contact is not None and not self.contact.gap(model.displacement(zero)) > 0:
            raise InputError("motion.body_starts")
        if self.contact is not None and (number := self.contact.inside()) is not None:
            raise InputError("motion.obstacle_inside", number=number + 1)
        v = zero if velocity is None else velocity
        self.now = Kinematics(zero, v, self.load - self.elasticity.response(zero).force)
        self.time, self.iterations, self.last_dt = 0.0, 0, 0.0
        self.kept, self._factor = KeptInverse(), 0.0
        self._forget()

    def _forget(self) -> None:
        """Start anew: the past has other steps, or none."""
        self._before: Kinematics | None = None
        self._forecast = Forecast()

    def advance(self, dt: float) -> Kinematics:
        """Coordinates, their velocity and acceleration ``dt`` [s] later.

        A step that does not converge is made of smaller ones; ``last_dt`` [s] is then that of the
        last of them.

        Raises ConvergenceError: If steps of dt / 256 still fail.
        """
        checked_positive("dt", dt, "s")
        self.iterations = 0
        self._halved(dt, HALVINGS)
        return self.now

    def step(self, dt: float) -> Motion:
        """Advance by ``dt`` [s]; see ``advance``."""
        with one_thread():
            self.advance(dt)
        return self.state

    @property
    def state(self) -> Motion:
        """What the full body does now, as the full method tells it."""
        q, v, a = self.now
        u, contact, model = self.model.displacement(q), self.contact, self.model
        none = np.zeros_like(u)
        return Motion(
            self.time,
            u,
            model.displacement(v),
            model.displacement(a),
            contact_force=none if contact is None else contact.forces(u, len(u)),
            obstacle_force=np.zeros((0, 3)) if contact is None else contact.obstacle_forces(u),
            gap=np.inf if contact is None else contact.gap(u),
            kinetic=0.5 * float(v @ v),
            elastic=self.elasticity.response(q).energy,
            potential=-float(self.load @ q),
            barrier=0.0 if contact is None else contact.barrier(u),
            iterations=self.iterations,
        )

    def _halved(self, dt: float, halvings: int) -> None:
        try:
            if dt != self.last_dt:
                self._forget()
            step = Step.of(self.scheme, dt, self.now, self._before)
            if self.contact is not None:
                self.contact.begin(self.model.displacement(self.now.u), self.time + dt, dt)
            q, iterations = self._solve(step)
            # Whether an obstacle stops or throws the body within the step: the past is forgotten
            leapt = False
            if self.contact is not None:
                at = [self.model.displacement(x) for x in (self.now.u, q)]
                barriers = [self.contact.barrier(u) for u in at]
                if any(barriers):
                    kinetic = 0.5 * float(self.now.v @ self.now.v)
                    elastic = self.elasticity.response(self.now.u).energy
                    leapt = step.leaps(q, 1.0, kinetic + elastic + barriers[0])
            if leapt:
                self._forget()
                if step.before is not None:
                    try:  # once more without it
                        q, more = self._solve(step.restarted)
                        step, iterations = step.restarted, iterations + more
                    except ConvergenceError as error:
                        logger.info("an impact is kept as its past leads it: %s", error)
            self._before, self.last_dt, self.now = None if leapt else self.now, dt, step.ended(q)
            self.time, self.iterations = self.time + dt, self.iterations + iterations
            self._forecast.add(self.now.a)
        except ConvergenceError as error:
            if halvings == 0:
                raise
            logger.info("step of %g s failed (%s): halved", dt, error)
            for _ in range(2):
                self._halved(dt / 2, halvings - 1)

    def _solve(self, step: Step) -> tuple[np.ndarray, int]:
        if step.factor != self._factor:
            self.kept, self._factor = KeptInverse(), step.factor
        potential = _Potential(self, step.factor, step.target)
        ahead = step.target + self._forecast.next() / step.factor
        options: dict[str, Any] = {"solve": KeptInverse.solve, "tolerance": self.tolerance}
        if self.contact is None:
            minimum = minimise(potential, ahead, **options)
            return minimum.u, minimum.iterations
        if self.contact.swept(self.model.displacement(self.now.u)):
            raise ConvergenceError("motion.obstacle_moves")
        # The last state moved as little as possible out of the way of obstacles that move
        q, count = self.now.u, 0
        for _ in range(ROOM_PASSES):
            u = self.model.displacement(q)
            push = self.contact.allowed(u) - u
            size = np.linalg.norm(push, axis=1)
            if not size.any():
                break
            near = size > 0
            rows = np.einsum("nia,ni->na", self.model.basis[near], push[near] / size[near, None])
            q = q + np.linalg.lstsq(rows, size[near], rcond=None)[0]
        else:
            if not self.contact.gap(self.model.displacement(q)) > 0:
                raise ConvergenceError("motion.obstacle_moves")
        q = q + min(1.0, potential.longest_step(q, ahead - q)) * (ahead - q)
        for _ in range(FRICTION_PASSES if self.contact.friction else 1):
            self.contact.lag_friction(self.model.displacement(q))
            minimum = minimise(potential, q, **options)
            q, count = minimum.u, count + minimum.iterations
        return q, count


def pulled_hessian(
    model: ReducedModel, contact: Contact, u: Float[np.ndarray, "points 3"]
) -> Float[np.ndarray, "dofs dofs"]:
    """Hessian of barrier and friction by the coordinates [1/s^2], at the displacement ``u`` [m]."""
    diagonal, pairs = contact.hessian_blocks(u)
    near = np.flatnonzero(np.abs(diagonal).max(axis=(1, 2)) > 0)
    B = model.basis[near]
    total = B.reshape(-1, model.dofs).T @ (diagonal[near] @ B).reshape(-1, model.dofs)
    for i, j, blocks in pairs:
        left, right = model.basis[i.ravel()], model.basis[j.ravel()]
        total += np.einsum("nia,nij,njb->ab", left, blocks.reshape(-1, 3, 3), right, optimize=True)
    return total


# Derived fields that a motion has: with 21 a bonsai's swings were 4.4 % off, with 36 1.3 %.
DERIVED_IN_MOTION = 45
# The motion that a model is measured by: so many of its slowest periods, in so many steps each.
PERIODS, PER_PERIOD = 2, 30


@dataclass(frozen=True, kw_only=True)
class ReducedMethod:
    """Motion of a scene by a reduced body.

    kind: What the coordinates move: fields of vectors, of a free body their components, or handles.
    handles: Handles of a skinned body.
    most_cells: Most tets that the elastic energy is summed over; 0: all.
    scale, nu: What E is multiplied by [1], and Poisson's ratio [1] in place of the body's own:
        fitted.
    rounds: How often at most a motion that is off is followed again, with more coordinates.
    rough: Whether the motion is checked roughly, in a quarter of the time.
    announce: Hears of the model, in words, before the motion.
    """

    kind: Subspace = Subspace.VECTOR
    handles: int = HANDLES
    most_cells: int = CELLS[-1]
    scale: float = 1.0
    nu: float | None = None
    rounds: int = ROUNDS
    rough: bool = False
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
        scheme: Scheme = Scheme.BDF2,
    ) -> MotionResult:
        """Follow the scene for its duration, one step of ``scheme`` a frame.

        Raises UsageError: Where a GPU is asked for.
        """
        if device != "cpu":
            raise UsageError("method.reduced_body")
        frames = checked_count("frames", scene.frames)
        dt = checked_positive("duration", scene.duration, "s") / frames
        model = self.model_of(scene, order)
        if self.announce is not None:
            self.announce(model_in_words(model))
        fitted = self.scale != 1 or self.nu is not None
        followed = Following(
            dt=dt,
            frames=frames,
            law=law or Law.NEO_HOOKEAN,
            scheme=scheme,
            most_cells=self.most_cells,
            rounds=0 if fitted else self.rounds,
            rough=self.rough,
            announce=self.announce,
            progress=progress,
        ).of(scene, model)
        model, solution = followed.model, [("reduced model", model_in_words(followed.model))]
        if followed.before:
            before = ", then by ".join(f"{100 * error:.2g} %" for error in followed.before)
            again = Note("method.motion_before", before=before)
            solution.append(("followed again", again))
        notes, error = [*accuracy_warnings(model)], followed.error
        if error is None:
            notes.append(Note("method.how_far"))
        elif not error.share <= MOTION_LIMIT:
            notes.append(Note("method.reduced_motion", words=error.words))
        notes += halving_notes(followed.halved, frames)
        if scene.obstacles:
            notes.append(Note("method.coordinates_follow", dofs=model.dofs))
        return MotionResult(
            followed.states,
            dt,
            len(scene.mesh.points),
            model.order,
            locking_fraction(scene.mesh) if model.order == 1 else 0.0,
            notes=tuple(notes),
            solution=tuple(solution),
            model_error=error,
            stiffening=model.accuracy.stiffening,
            impact=impact_of(followed.states) if scene.obstacles else None,
        )

    def model_of(self, scene: Scene, order: int | None = None) -> ReducedModel:
        """Reduced model of the body as the ``scene`` holds it; see ``reduce_body``."""
        if self.kind is Subspace.VECTOR and self.handles != HANDLES:
            raise UsageError("method.fields_vectors_handles")
        model = reduce_body(
            scene.mesh,
            scene.supports,
            **scene.loads,
            order=order,
            kind=self.kind,
            derived=DERIVED_IN_MOTION,
            handles=self.handles,
            most_cells=self.most_cells,
        )
        nu = None if self.nu is None else np.full_like(model.nu, self.nu)
        return model.with_moduli(self.scale * model.E, nu)


METHOD = ReducedMethod()


def with_motion_error(model: ReducedModel, scene: Scene) -> ReducedModel:
    """The model, with the error of a motion: the held body let go in the scene.

    Where that is off, coordinates of what it missed join it.
    """
    loose = replace(scene, obstacles=())
    body = reduced_dynamics(loose, model, law=Law.NEO_HOOKEAN)
    if not body.load.any() and not body.now.v.any():
        return model
    period = 1 / float(reduced_frequencies(body.elasticity)[0])
    followed = Following(dt=period / PER_PERIOD, frames=PERIODS * PER_PERIOD).of(loose, model)
    error = np.nan if followed.error is None else followed.error.share
    return replace(followed.model, accuracy=followed.model.accuracy._replace(motion=error))


def model_in_words(model: ReducedModel) -> str:
    """Kind, coordinates, cells and lowest frequency of a model, in a line."""
    basis = (
        Note("method.functions_along")
        if model.kind is Subspace.SKINNING
        else Note("method.fields_vectors")
    )
    of = "linear" if np.isnan(model.accuracy.stiffening) else "quadratic"
    return Note(
        "method.coordinates_cells",
        dofs=model.dofs,
        basis=basis,
        count=len(model.cells),
        best_frequency=model.accuracy.best_frequency,
        of=of,
    )
