"""Implicit dynamics: every step minimises an incremental potential by Newton's method.

Damping is Rayleigh's: of the velocity by the mass, and of the rate of strain by the stiffness.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ..device import checked_device, one_thread, start_warp
from ..elements.assembly import BlockMatrix, Discretisation, add_diagonal, discretise, node_supports
from ..elements.elastic import ElasticBody, Response, displacement_gradients
from ..elements.forces import load_vector, lumped_mass, node_counts, node_velocities, weighing_mass
from ..elements.space import element_points
from ..errors import ConvergenceError, InputError, UsageError
from ..laws.law import Law
from ..linalg.solver import RepeatedSolver
from ..material import ElementMaterial, LameParameters
from ..mesh import TetMesh, face_areas, material_of
from ..scene.obstacles import Obstacle
from ..scene.scene import Scene
from ..scene.supports import Supports
from ..validation import checked_count, checked_positive, checked_rows, checked_vector
from .contact import Contact
from .error import motion_elements, motion_order
from .method import FrameProgress, halving_notes
from .nonlinear import minimise
from .result import Impact, Motion, MotionResult, locking_fraction
from .schemes import DeviceSteps, Forecast, Incremental, Kinematics, Scheme, Step, nodal_rigidity


@dataclass(frozen=True)
class Damping:
    """Rayleigh damping C = ``mass`` M + ``stiffness`` K [1/s, s]; none by default.

    K resists the rate of strain of the body as it lies, so that it brakes no turn; M brakes all.

    Parameters
    ----------
    mass
        Rate [1/s] at which velocities fade, all of them.
    stiffness
        Time [s] by which rates of strain are resisted.

    Examples
    --------
    >>> from autophyx_tet.fem import Damping, Dynamics, ElementMaterial, box_mesh
    >>> block = box_mesh((1, 1, 1), (1, 1, 1))
    >>> block = block.with_material(ElementMaterial.uniform(6, E=1e6, nu=0.0, rho=1e3))
    >>> body = Dynamics(block, velocity=(1.0, 0.0, 0.0), damping=Damping(mass=1.0))
    >>> body.step(1.0).v[0, 0].round(6).item()  # m/s: implicit Euler, v / (1 + dt)
    0.5
    """

    mass: float = 0.0
    stiffness: float = 0.0


class Rayleigh:
    """Damping forces of a body of nodal ``mass`` [kg] (nodes,).

    Viscosity is a stress that resists the rate of strain and leaves turns alone (Kelvin & Voigt).
    Over a step of dt the rate is (E - E_0) / dt with Green's strains at its ends. Its stress is
    then the derivative of dt |rate|^2 / 2 by the displacement, with Hooke's law as the norm: a turn
    of any size costs nothing, and small motions see exactly the stiffness at rest times their
    velocity.
    """

    def __init__(
        self,
        grid: Discretisation,
        material: ElementMaterial,
        mass: Float[np.ndarray, "nodes"],
        damping: Damping,
    ) -> None:
        if damping.stiffness and material.tensor is not None:
            raise InputError("damping.damping_proportion")
        self.alpha, self.beta = damping.mass, damping.stiffness
        self.mass, self.grid = damping.mass * mass[:, None], grid
        lame = [grid.array(self.beta * np.asarray(m)) for m in material.lame]  # [Pa s]
        self._arrays = [grid.tets, *lame, None, True]  # no tensors; finite strains

    def force(self, u: np.ndarray, v: np.ndarray) -> Float[np.ndarray, "nodes 3"]:
        """Damping force [N] at the displacement ``u`` [m] and velocity ``v`` [m/s]."""
        return self.mass * v + (self._viscous(1.0, u, v, rate=True).force if self.beta else 0.0)

    def step(self, u: np.ndarray, start: np.ndarray, dt: float) -> Response:
        """Half the energy [J] lost in a step of ``dt`` [s] from ``start`` to ``u``, its force."""
        push = self.mass * (u - start) / dt
        energy = 0.5 * float(((u - start) * push).sum())
        if not self.beta:
            return Response(energy, push)
        more, force = self._viscous(1 / dt, u, start, rate=False)
        return Response(energy + more, push + force)

    def _viscous(self, scale: float, u: np.ndarray, along: np.ndarray, *, rate: bool) -> Response:
        """Potential [J] and force [N] of the viscosity, ``rate``: for the velocity ``along``."""
        from ..elements import kernels_elastic as k

        wp = start_warp()
        fields = [self.grid.array(u), self.grid.array(along)]
        tets, device = len(self.grid.space.elements), self.grid.device
        energy = wp.zeros(tets, dtype=wp.float64, device=device)
        force = wp.zeros_like(fields[0])
        inputs = [*self._arrays, scale, *fields, rate, energy, force]
        wp.launch(k.tensor_response, tets, inputs=inputs, device=device)
        return Response(float(energy.numpy().sum()), force.numpy())

    def stresses(
        self, u: np.ndarray, start: np.ndarray, v: np.ndarray | None, dt: float
    ) -> list[Callable[[LameParameters], np.ndarray]]:
        """Viscous stresses (tets, points, 3, 3) of given moduli: of ``step``, of ``force`` at v.

        First Piola stresses at the points of ``element_points``, linear in the moduli (broadcast).
        """
        where = element_points(self.grid.space.order)

        def stress(lame: LameParameters, at: np.ndarray, along: np.ndarray, rate: bool):
            H, G = (displacement_gradients(self.grid, field, where) for field in (at, along))
            D, T = H - G, H.swapaxes(-1, -2)
            D = G + T @ G if rate else D + (T @ D + D.swapaxes(-1, -2) @ G) / 2
            trace = np.trace(D, axis1=-2, axis2=-1)[..., None, None] * np.eye(3)
            lam, mu = (np.asarray(m)[..., None, None] for m in lame)
            S = mu * (D + D.swapaxes(-1, -2)) + lam * trace
            return S + H @ S

        if not self.beta:
            return []
        of_step = lambda lame: self.beta / dt * stress(lame, u, start, False)  # noqa: E731
        if v is None:
            return [of_step]
        return [of_step, lambda lame: self.beta * stress(lame, start, v, True)]

    def add_to(
        self, matrix: BlockMatrix, u: np.ndarray, start: np.ndarray, dt: float, *, projected: bool
    ) -> None:
        """Add the derivative of the force of ``step`` to ``matrix``.

        ``projected``: no tet has a negative part.
        """
        from ..elements import kernels_elastic as k

        if self.beta:
            inputs = [*self._arrays, 1 / dt, self.grid.array(u), self.grid.array(start), projected]
            inputs += [self.grid.pattern.slots, matrix.values]
            tets, device = len(self.grid.space.elements), self.grid.device
            start_warp().launch(k.tensor_tangent, tets, inputs=inputs, device=device)
        add_diagonal(matrix, self.mass[:, :, None] / dt * np.eye(3))


logger = logging.getLogger(__name__)

# A step ends when the unbalanced force is below this fraction of the external and inertial force.
TOLERANCE = 1e-4
# A step that fails is halved so often at most.
HALVINGS = 8
# Normal forces of friction are frozen during a solve: two solves settle them.
FRICTION_PASSES = 2
# Forces below this strain of the whole body, times its E, count as none [N].
NOISE = 1e-10


class Dynamics:
    """A body in motion.

    Parameters
    ----------
    mesh
        Tets with a material.
    supports
        Prescribed components (values are held from the start on) and springs.
    gravity_vector
        Acceleration of gravity [m/s^2], shape (3,).
    forces
        Constant nodal forces [N], shape (points, 3) or (nodes, 3).
    obstacles, friction, thickness
        Rigid obstacles, the coefficient of Coulomb friction on all of them, and the distance [m]
        at which they begin to push, by default a thousandth of the body's diagonal.
    self_contact
        Whether faces of the body keep out of each other, those of separate pieces too.
    velocity
        Initial velocity [m/s], (3,) or (nodes, 3).
    law, order, scheme, damping
        Name of the elastic law, order of the elements (None: as ``motion_order`` says), time
        integration, Rayleigh damping.
    tolerance
        Residual of a step over the external and inertial force.

    Examples
    --------
    >>> from autophyx_tet.fem import Dynamics, ElementMaterial, Scheme, box_mesh
    >>> block = box_mesh((1, 1, 1), (1, 1, 1))
    >>> block = block.with_material(ElementMaterial.uniform(6, E=1e6, nu=0.3, rho=1e3))
    >>> body = Dynamics(block, gravity_vector=(0, 0, -10), scheme=Scheme.TRAPEZOIDAL)
    >>> state = body.run(0.1, 5)[-1]
    >>> state.time, float(state.u[0, 2].round(9))  # s, m: g t^2 / 2
    (0.5, -1.25)
    """

    def __init__(
        self,
        mesh: TetMesh,
        *,
        supports: Supports | None = None,
        gravity_vector: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
        forces: np.ndarray | None = None,
        obstacles: Sequence[Obstacle] = (),
        friction: float = 0.0,
        thickness: float | None = None,
        self_contact: bool = True,
        velocity: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
        law: str = Law.NEO_HOOKEAN,
        order: int | None = None,
        scheme: Scheme = Scheme.IMPLICIT_EULER,
        damping: Damping | None = None,
        tolerance: float = TOLERANCE,
        device: str = "cpu",
    ) -> None:
        self.mesh, self.scheme, self.tolerance = mesh, scheme, tolerance
        grid = discretise(mesh, order or motion_order(mesh), checked_device(device))
        self.space = grid.space
        self.body = ElasticBody(grid, material_of(mesh), law)
        self.mass = lumped_mass(mesh, grid.space)
        self.held = node_supports(supports or Supports.none(len(mesh.points)), self.space)
        weighing = weighing_mass(mesh, grid, self.held)
        self.load = weighing[:, None] * checked_vector("gravity_vector", gravity_vector, "m/s^2")
        if forces is not None:
            rows = checked_rows("forces", forces, node_counts(self.space), "N")
            self.load[: len(rows)] += rows
        self.contact = Contact(
            mesh, grid.space, obstacles, friction, thickness, self_contact=self_contact
        )
        self.damping = Rayleigh(grid, material_of(mesh), self.mass, damping) if damping else None
        area = float((np.ptp(mesh.bounds, axis=0) ** 2).sum())
        self.noise = NOISE * float(np.median(material_of(mesh).E)) * area
        self.rigidity = nodal_rigidity(mesh, grid.space)
        self.solver = RepeatedSolver(grid.space.nodes, self.held.fixed)
        plain = not (self.contact.acts or self.damping) and grid.pattern.columns.device.is_cuda
        self.steps = DeviceSteps(self, grid.device) if plain else None
        u = np.where(self.held.fixed, self.held.values, 0.0)
        v = np.where(self.held.fixed, 0.0, node_velocities(velocity, self.space))
        if not (gap := self.contact.gap(u)) > 0:
            raise InputError("dynamics.body_starts", gap=-gap)
        if (number := self.contact.inside()) is not None:
            raise InputError("dynamics.obstacle_inside", number=number + 1)
        self._known: tuple[np.ndarray, Response] = (u, self.body.response(u))
        force = self.load - self.response(u).force - self.held.springs * u
        force += self.contact.forces(u, len(u))
        if self.damping:
            force -= self.damping.force(u, v)
        mass = np.where(self.mass > 0, self.mass, 1.0)[:, None]
        start = Kinematics(u, v, np.where(self.held.fixed, 0.0, force / mass))
        self.state = self._measured(0.0, start, 0)
        self._step_made: tuple | None = None
        self.patience = np.inf  # halvings that are left
        self._forget()

    def _forget(self) -> None:
        """Start anew from the state: its past has other steps, or none."""
        self._before: Kinematics | None = None  # for BDF2
        self._forecast, self._dt = Forecast(), 0.0

    @property
    def kept(self) -> tuple:
        """The state and its past: set again, the body goes on from there."""
        return self.state, self._before, copy(self._forecast), self._dt, self._step_made

    @kept.setter
    def kept(self, kept: tuple) -> None:
        self.state, self._before, self._forecast, self._dt, self._step_made = kept

    @property
    def last_step(self) -> Step | None:
        """The step made last: shorter than the one asked for where that was halved."""
        return Step.of(*self._step_made) if self._step_made else None

    def response(self, u: np.ndarray) -> Response:
        """Elastic energy and force at ``u`` [m]; the last one is remembered."""
        if self._known[0] is not u:
            self._known = (u, self.body.response(u))
        return self._known[1]

    def _measured(self, time: float, motion: Kinematics, iterations: int) -> Motion:
        held, u = self.held, motion.u
        contact, response = self.contact.forces(u, len(u)), self.response(u)
        reaction = np.where(held.fixed, response.force - self.load - contact, 0.0)
        if self.damping and held.fixed.any():
            reaction += np.where(held.fixed, self.damping.force(u, motion.v), 0.0)
        return Motion(
            time,
            *motion,
            contact_force=contact,
            obstacle_force=self.contact.obstacle_forces(u),
            piece_forces=self.contact.piece_forces(u),
            pressures=self.contact.pressures(u),
            gap=self.contact.gap(u),
            kinetic=0.5 * float((self.mass[:, None] * motion.v**2).sum()),
            elastic=response.energy + 0.5 * float((held.springs * u**2).sum()),
            potential=-float((self.load * u).sum()),
            barrier=self.contact.barrier(u),
            iterations=iterations,
            reaction=reaction - held.springs * u,
        )

    def step(self, dt: float) -> Motion:
        """Advance by ``dt`` [s]; a step that does not converge is made of smaller ones.

        Raises
        ------
        ConvergenceError
            If steps of dt / 256 still fail.
        """
        checked_positive("dt", dt, "s")
        with one_thread():
            return self._step(dt, HALVINGS)

    def _step(self, dt: float, halvings: int) -> Motion:
        try:
            self._advance(dt)
        except ConvergenceError as error:
            self.patience -= 1
            if halvings == 0 or self.patience < 0:
                raise
            logger.info("step of %g s failed (%s): halved", dt, error)
            for _ in range(2):
                self._step(dt / 2, halvings - 1)
        return self.state

    def run(self, dt: float, steps: int) -> list[Motion]:
        """Return the states after each of ``steps`` steps of ``dt`` [s], the start first."""
        return [self.state, *(self.step(dt) for _ in range(checked_count("steps", steps)))]

    def _advance(self, dt: float) -> None:
        if dt != self._dt:
            self._forget()
        now = Kinematics((state := self.state).u, state.v, state.a)
        made = (self.scheme, dt, now, self._before)
        if self.steps is not None:
            self.state = self.steps.advance(dt)
            self._before, self._dt, self._step_made = now, dt, made
            return
        step = Step.of(*made)
        self.contact.begin(state.u, state.time + dt, dt)
        u, iterations = self._solve(step)
        # Where contact stops or throws the body within the step, what was before is of no use
        touches = self.contact.acts and (state.barrier > 0 or self.contact.barrier(u) > 0)
        energy = state.kinetic + state.elastic + state.barrier
        if leapt := touches and step.leaps(u, self.mass[:, None], energy):
            self._forecast = Forecast()
            if step.before is not None:
                made, step = (*made[:3], None), step.restarted
                u, iterations = self._solve(step)
        u, v, a = step.ended(u)
        v, a = (np.where(self.held.fixed, 0.0, w) for w in (v, a))
        self.contact.check_sizes(u)
        self.state = self._measured(state.time + dt, Kinematics(u, v, a), iterations)
        self._before, self._dt, self._step_made = None if leapt else now, dt, made
        self._forecast.add(a)

    def _solve(self, step: Step) -> tuple[np.ndarray, int]:
        old, fixed = self.state.u, self.held.fixed
        if self.contact.swept(old):
            raise ConvergenceError("dynamics.obstacle_moves")
        start = np.where(fixed, old, self.contact.allowed(old))
        if not self.contact.gap(start) > 0:
            raise ConvergenceError("dynamics.obstacle_moves")
        own = self.contact.own
        if own is not None and own.longest_step(old, start - old) < 1:
            raise ConvergenceError("dynamics.obstacle_presses")
        ahead = np.where(fixed, old, step.target + self._forecast.next() / step.factor) - start
        u = start + min(1.0, self.contact.longest_step(start, ahead)) * ahead
        target = np.where(fixed, old, step.target)
        potential = Incremental(self, step.factor, target, step.dt, old)
        count = 0
        for _ in range(FRICTION_PASSES if self.contact.friction else 1):
            self.contact.lag_friction(u)
            minimum = minimise(potential, u, solve=self.solver, tolerance=self.tolerance)
            u, count = minimum.u, count + minimum.iterations
        return u, count

    def solve_adjoint(self, step: Step, u: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Solve H x = b with the Hessian [N/m] of a ``step`` that ended at ``u`` [m]."""
        potential = Incremental(self, step.factor, u, step.dt, step.now.u)
        return self.solver(potential.hessian(u, projected=False), b, 0.0)


# An impact is followed in so many steps while a wave crosses the body and comes back, which no
# contact is shorter than; in at most so many a frame, and so many for every frame altogether.
PARTS, MOST_PARTS, MOST_STEPS = 16, 64, 4
# A motion is given up whose steps were halved so many times as often as it has frames: an obstacle
# that is driven through what is held takes ever more of them.
HALVED = 2
# A frame that meets an obstacle and loses more than this fraction of the energy, but to friction,
# is such an impact.
LOSSY = 0.01


class ImpactSteps:
    """Frames of ``dt`` [s] of a body: one step each, but for impacts, which have their own.

    A step stops what it meets at once, and takes the energy of its fall. Where that is seen, the
    frame is taken again, by BDF2, in parts of the time in which waves cross the body, if these are
    not too many; ``impact`` tells what came of it.
    """

    def __init__(self, body: Dynamics, dt: float, frames: int) -> None:
        mesh, material = body.mesh, material_of(body.mesh)
        lam, mu = material.lame
        wave = np.sqrt(mesh.volumes @ (lam + 2 * mu) / mesh.mass)
        size = 6 * mesh.volume / face_areas(mesh.points, mesh.boundary.faces).sum()
        self.body, self.dt, body.patience = body, dt, HALVED * frames
        self.parts = int(np.ceil(dt * PARTS * wave / (2 * size)))
        self.left = MOST_STEPS * frames if self.parts <= MOST_PARTS else 0
        self.halved, self._lost, self._given, self._barrier = 0, 0.0, 0.0, 0.0
        self._forces: list[np.ndarray] = []

    def frame(self) -> Motion:
        """The state a frame later."""
        body, before = self.body, self.body.kept
        lost = self._step(self.dt)
        if lost > LOSSY * self._given and 1 < self.parts <= self.left:
            self.left -= self.parts
            scheme, body.scheme, body.kept = body.scheme, Scheme.BDF2, before
            del self._forces[-1:]
            lost = max(self._step(self.dt / self.parts) for _ in range(self.parts))
            body.scheme = scheme
        self._lost = max(self._lost, lost / self._given if self._given else 0.0)
        return body.state

    def _step(self, dt: float) -> float:
        """Energy [J] that a step lost, but to friction, where an obstacle or a piece is met."""
        body, before = self.body, self.body.state
        after = body.step(dt)
        self.halved += body._dt != dt
        own = [s.kinetic + s.elastic + s.barrier for s in (before, after)]
        self._given = max(self._given, *own)
        self._barrier = max(self._barrier, after.barrier)
        self._forces.append(np.linalg.norm(after.obstacle_force, axis=1))
        if not (before.barrier or after.barrier):
            return 0.0
        return before.energy - after.energy - body.contact.rubbed(after.u)

    @property
    def impact(self) -> Impact | None:
        """How obstacles and pieces were met until now; None where nothing can be."""
        if not self.body.contact.acts:
            return None
        none = np.zeros_like(self._forces[0])  # before the first step; after the last it goes on
        forces = np.stack([none, *self._forces, self._forces[-1]])
        largest, peak = forces.max(axis=0), forces.argmax(axis=0).clip(1, len(forces) - 2)
        beside = (forces[peak - 1] + forces[peak + 1]).diagonal() / 2
        rough = (largest - beside) / np.where(largest > 0, largest, 1.0)
        barrier = self._barrier / self._given if self._given else 0.0
        return Impact(largest, self._lost, barrier, float(rough.max(initial=0.0)))


class DynamicMethod:
    """Motion of a scene under the neo-Hookean law, by default with elements that do not lock."""

    laws: tuple[str, ...] = ()

    def solve(
        self,
        scene: Scene,
        *,
        law: str | None = None,
        order: int | None = None,
        device: str = "cpu",
        progress: FrameProgress | None = None,
        scheme: Scheme = Scheme.IMPLICIT_EULER,
    ) -> MotionResult:
        """Follow the scene for its duration, one step of ``scheme`` a frame.

        Raises UsageError: Where an obstacle is to be driven through what is held.
        """
        frames = checked_count("frames", scene.frames)
        dt = checked_positive("duration", scene.duration, "s") / frames
        held = scene.mesh.points[scene.held.fixed.all(axis=1)]
        for k, obstacle in enumerate(scene.obstacles):
            way = dt * np.asarray(obstacle.velocity, dtype=float)
            for frame in range(1, frames + 1 if way.any() and len(held) else 1):
                if not obstacle.distance(held - frame * way).gap.min() > 0:
                    raise UsageError("dynamics.meets_support", k=k + 1, time=frame * dt)
        order, stiffening = motion_elements(scene.mesh, scene.supports, order)
        forces = scene.forces
        if scene.tractions:
            grid = discretise(scene.mesh, order, checked_device(device))
            forces = load_vector(scene.mesh, grid, traction=scene.tractions, forces=forces)
        body = Dynamics(
            scene.mesh,
            supports=scene.supports,
            gravity_vector=scene.gravity_vector,
            forces=forces,
            obstacles=scene.obstacles,
            friction=scene.friction,
            thickness=scene.thickness,
            self_contact=scene.self_contact,
            velocity=scene.velocity,
            law=law or Law.NEO_HOOKEAN,
            order=order,
            scheme=scheme,
            device=device,
        )
        states, pace = [body.state], ImpactSteps(body, dt, frames)
        for frame in range(1, frames + 1):
            states.append(pace.frame())
            if progress is not None:
                progress(frame, frames)
        locks, notes = locking_fraction(scene.mesh) if order == 1 else 0.0, body.contact.notes
        return MotionResult(
            tuple(states),
            dt,
            len(scene.mesh.points),
            order,
            locks,
            kept_apart=scene.self_contact and not notes,
            notes=notes + halving_notes(pace.halved, frames),
            stiffening=stiffening,
            impact=pace.impact,
        )


METHOD = DynamicMethod()
