"""The material point method as a method of the scene: tets become particles, and follow them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ..errors import UsageError
from ..laws.law import Law
from ..particle_run import ParticleRun
from ..result import Motion, MotionResult
from ..scene.mesh import material_of
from ..scene.obstacles import Plane
from ..scene.scene import Scene
from ..solve.method import FrameProgress
from ..validation import checked_count, checked_positive
from .background import BackgroundGrid, grid_around
from .classes import MaterialClass, Substance
from .particles import Particles, ParticleState
from .sampling import TetSample, mesh_followers, particle_forces, sample_tets
from .solver import MpmSolver
from .stability import BUDGET, MpmError
from .stiff import Stiff, Treatment, near_held, treated
from .walls import Wall, support_walls

# Room around the body [shares of its longest side] in which particles may move.
ROOM = 0.5
# CPU time of a particle and substep [s], by class, of `benchmarks/mpm.py` on one core.
COSTS = {MaterialClass.SNOW: 2.5e-7, MaterialClass.JELLY: 1.5e-7}
COST = 2.2e-7


@dataclass(frozen=True, kw_only=True)
class MpmMethod:
    """Motion of a scene by explicit MLS-MPM.

    Parameters
    ----------
    grid
        Cells of the grid along the longest side of the body.
    stiff
        What becomes of matter that is too stiff for the steps.
    budget
        Substeps a second of motion that matter may need at most.
    substances
        Class and yield by name of region; jelly where none is named.
    damping
        Rate [1/s] at which velocities fade.
    threads
        One or two on a CPU.
    announce
        Hears particles, steps and expected time, in words, before the run.
    """

    grid: int = 32
    stiff: Stiff = Stiff.RIGID
    budget: float = BUDGET
    substances: Mapping[str, Substance] = field(default_factory=dict)
    damping: float = 0.0
    threads: int = 1
    announce: Callable[[str], None] | None = None

    laws: tuple[str, ...] = (Law.NEO_HOOKEAN.value,)

    def solve(
        self,
        scene: Scene,
        *,
        law: str | None = None,
        order: int | None = None,
        device: str = "cpu",
        progress: FrameProgress | None = None,
    ) -> MotionResult:
        """Follow the scene for its duration; ``MpmError`` where the run fails.

        ``law`` and ``order`` are for elements: there are none here.
        """
        frames = checked_count("frames", scene.frames)
        dt = checked_positive("duration", scene.duration, "s") / frames
        checked_count("grid", self.grid)
        setup = self._setup(scene, device)
        record, states = _Recorder(scene, setup), [setup.now(0.0)]
        motions = [record.motion(states[0])]
        for frame in range(1, frames + 1):
            if setup.solver is not None and not setup.solver.advance(dt):
                assert setup.solver.failure is not None
                plan = setup.plan(scene.duration)
                raise MpmError(setup.solver.failure, plan, setup.notes)
            states.append(setup.now(frame * dt))
            motions.append(record.motion(states[-1]))
            if progress is not None:
                progress(frame, frames)
        points = len(scene.mesh.points)
        return MotionResult(tuple(motions), dt, points, particles=record.run(states))

    def _setup(self, scene: Scene, device: str) -> _Setup:
        mesh = scene.mesh
        spacing = float(np.ptp(mesh.bounds, axis=0).max()) / self.grid
        sample = sample_tets(mesh, spacing)
        given = self._particles(scene, sample)
        supports = scene.held
        held = near_held(scene, given.x, spacing)
        gravity = float(np.linalg.norm(scene.gravity_vector))
        found = treated(
            given, spacing, held=held, stiff=self.stiff, budget=self.budget, gravity=gravity or 9.81
        )
        walls = [Wall(shape=obstacle, friction=scene.friction) for obstacle in scene.obstacles]
        if scene.ground is not None:
            walls.append(Wall(shape=scene.ground))
        walls += support_walls(mesh, supports, spacing, scene.duration)
        room = _room(scene, spacing)
        notes = _notes(sample, found)
        if found.particles.held.all():
            return _Setup(found, sample, room, None, notes)
        solver = MpmSolver(
            found.particles,
            room,
            walls=walls,
            gravity_vector=scene.gravity_vector,
            damping=self.damping,
            lagrangian=_may_be_lagrangian(scene, found),
            device=device,
            threads=self.threads,
        )
        force = particle_forces(scene, found.particles.x)
        if force.any():
            solver.push(force / found.particles.mass[:, None])
        setup = _Setup(found, sample, room, solver, notes)
        if self.announce is not None:
            self.announce(setup.plan(scene.duration))
        return setup

    def _particles(self, scene: Scene, sample: TetSample) -> Particles:
        mesh, material = scene.mesh, material_of(scene.mesh)
        unknown = sorted(set(self.substances) - set(mesh.region_names))
        if unknown:
            raise UsageError(f"no part {unknown[0]!r}: there are {', '.join(mesh.region_names)}")
        region = mesh.region[sample.tet].astype(np.int64)
        named = tuple(self.substances.get(name, Substance()) for name in mesh.region_names)
        velocity = np.asarray(scene.velocity, dtype=float)
        if velocity.ndim == 2:
            velocity = velocity[mesh.tets[sample.tet]].mean(axis=1)
        start = np.broadcast_to(velocity, sample.x.shape).copy()
        return Particles(
            x=sample.x, volume=sample.volume, E=material.E[sample.tet],
            nu=material.nu[sample.tet], rho=material.rho[sample.tet], part=region,
            parts=mesh.region_names, substance=region.copy(), substances=named, velocity=start,
            rigid=np.full(len(region), -1, dtype=np.int64),
        )  # fmt: skip


METHOD = MpmMethod()


class _Setup(NamedTuple):
    """What is solved; without a ``solver`` nothing moves."""

    treatment: Treatment
    sample: TetSample
    room: BackgroundGrid
    solver: MpmSolver | None
    notes: tuple[str, ...]

    def now(self, time: float) -> ParticleState:
        if self.solver is not None:
            return self.solver.state
        x = self.treatment.particles.x
        eyes = np.tile(np.eye(3), (len(x), 1, 1))
        return ParticleState(time, x, np.zeros_like(x), eyes, np.zeros(len(x)))

    def plan(self, duration: float) -> str:
        """Particles, steps and the time that they will take, in words."""
        given = self.treatment.particles
        waves = float(given.wave_speed.max())
        dt = 0.4 * self.room.spacing / waves if waves > 0 else self.treatment.dt
        steps = duration / dt
        each = np.array([COSTS.get(MaterialClass(int(k)), COST) for k in given.kinds])
        seconds = steps * float(each[~given.held].sum())
        return (
            f"{len(given.x):,} particles, a grid of {'x'.join(map(str, self.room.shape))}, about "
            f"{steps:,.0f} steps: some {seconds:,.0f} s"
        )


def _room(scene: Scene, spacing: float) -> BackgroundGrid:
    """Grid around the body and where it may move: down to planes that it falls on."""
    low, high = scene.mesh.bounds
    side = ROOM * float((high - low).max())
    reach = [low - side, high + side]
    for wall in (*scene.obstacles, *([scene.ground] if scene.ground else [])):
        if isinstance(wall, Plane):
            normal = np.asarray(wall.normal, dtype=float) / np.linalg.norm(wall.normal)
            foot = low + normal * min(0.0, float((np.asarray(wall.point) - low) @ normal))
            reach.append(foot)
    lows, highs = np.min(reach, axis=0), np.max(reach, axis=0)
    first = next(iter(scene.obstacles), None)
    if isinstance(first, Plane) and abs(first.normal[scene.up]) > 1 - 1e-9:
        level = {scene.up: float(first.point[scene.up])}
        return grid_around(lows, highs, spacing, planes=level)
    return grid_around(lows, highs, spacing)


def _may_be_lagrangian(scene: Scene, found: Treatment) -> bool:
    """Whether it is jelly alone, held, and meets nothing: weights at rest forget nothing then."""
    given = found.particles
    moving = given.kinds[~given.held] == MaterialClass.JELLY
    tears = any(s.tears for s in given.substances)
    return bool(moving.all() and not tears and not scene.obstacles and scene.held.fixed.any())


def _notes(sample: TetSample, found: Treatment) -> tuple[str, ...]:
    thin = f"{', '.join(sample.thin)}: less than about two cells thick, bends wrongly: finer --grid"
    still = "everything is stationary: nothing can move"
    return (*found.notes, *[thin] * bool(sample.thin), *[still] * bool(found.particles.held.all()))


class _Recorder:
    """States of particles as states of the mesh."""

    def __init__(self, scene: Scene, setup: _Setup) -> None:
        self.scene, self.setup = scene, setup
        given = setup.treatment.particles
        self.follow = mesh_followers(scene.mesh, given.x, given.part)
        self.time = 0.0

    def motion(self, state: ParticleState) -> Motion:
        """The mesh at the time of ``state``; forces are means since the last."""
        scene, follow, given = self.scene, self.follow, self.setup.treatment.particles
        solver, points, obstacles = self.setup.solver, len(scene.mesh.points), scene.obstacles
        forces = np.zeros((len(obstacles), 3))
        if solver is not None and state.time > self.time:
            pushes = solver.substep.take_impulses() / (state.time - self.time)
            forces = pushes[: len(obstacles)]
        self.time = state.time
        gaps = [
            o.distance(state.x - state.time * np.asarray(o.velocity, dtype=float)).gap.min()
            for o in obstacles
        ]
        weight = given.mass @ ((given.x - state.x) @ np.asarray(scene.gravity_vector, dtype=float))
        return Motion(
            time=state.time,
            u=follow.positions(state) - scene.mesh.points,
            v=np.einsum("nk,nki->ni", follow.weights, state.v[follow.near]),
            a=np.zeros((points, 3)),
            contact_force=np.tile(forces.sum(axis=0) / points, (points, 1)),
            obstacle_force=forces,
            gap=float(min(gaps, default=np.inf)),
            kinetic=float(0.5 * given.mass @ (state.v**2).sum(axis=1)),
            elastic=0.0 if solver is None else solver.elastic_energy,
            potential=float(weight),
            barrier=0.0,
            iterations=0,
        )

    def run(self, states: list[ParticleState]) -> ParticleRun:
        """What is kept of the particles themselves."""
        setup, found = self.setup, self.setup.treatment
        solver = setup.solver
        lost = solver.outside if solver is not None else 0
        notes = setup.notes
        if lost:
            notes = (*notes, f"{lost:,} particles left the grid and stand still where they did")
        return ParticleRun(
            spacing=setup.room.spacing,
            nodes=setup.room.shape,
            substeps=solver.substeps if solver is not None else 0,
            outside=lost,
            stationary=int(found.particles.held.sum()),
            rigid=found.rigid,
            bodies=found.bodies,
            capped=found.capped,
            lagrangian=solver is not None and solver.lagrangian,
            plan=setup.plan(self.scene.duration),
            notes=notes,
            part=found.particles.part,
            positions=np.stack([s.x for s in states]).astype(np.float32),
            gradients=np.stack([s.F for s in states]).astype(np.float32),
        )
