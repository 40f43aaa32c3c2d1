"""The material point method as a method of the scene: tets become particles, and follow them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ..errors import UsageError
from ..laws.law import Law
from ..mesh import material_of
from ..scene.scene import Scene
from ..solve.method import FrameProgress
from ..solve.result import Motion, MotionResult, ParticleRun
from ..validation import checked_count, checked_number, checked_positive
from .boundaries import BackgroundGrid, Wall, scene_room, support_walls
from .materials import MaterialClass, Substance
from .particles import (
    Particles,
    ParticleState,
    TetSample,
    mesh_followers,
    particle_forces,
    sample_tets,
)
from .rigid import Stiff, Treatment, bending_regions, near_held, treated, treatment_notes
from .solver import MpmSolver
from .time_step import BUDGET, COURANT, MpmError, largest_modulus, longest_step

# CPU time [s] of a particle and substep, by class, and of a substep without any, on one core
# (`benchmarks/mpm.py`).
COSTS = {MaterialClass.SNOW: 2.5e-7, MaterialClass.JELLY: 1.5e-7}
COST, OVERHEAD = 2.2e-7, 6e-5


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
    step, courant
        Step [s] instead of the longest stable one, and what share of a cell waves may cross in it:
        what is too stiff for it is a failure then.
    metres
        The body is moved as if its longest side were this long [m]; None: as long as it is.
    corotated
        Whether what no substance is named for is fixed corotated, not stable neo-Hookean.
    notes
        What was assumed of the matter, in words: it is on record with the run.
    announce
        Hears particles, steps and expected time, in words, before the run.

    Examples
    --------
    >>> import numpy as np
    >>> from autophyx_tet.fem import ElementMaterial, MpmMethod, Scene, box_mesh
    >>> block = box_mesh((1, 1, 1), (1, 1, 1))
    >>> block = block.with_material(ElementMaterial.uniform(6, E=1e6, nu=0.0, rho=1e3))
    >>> scene = Scene(mesh=block, velocity=(2.0, 0.0, 0.0), duration=0.1, frames=1)
    >>> moved = MpmMethod(grid=8).solve(scene).displacements[-1]
    >>> bool(np.allclose(moved, [0.2, 0, 0], atol=1e-5))  # m: v t, in single precision
    True
    """

    grid: int = 32
    stiff: Stiff = Stiff.RIGID
    budget: float = BUDGET
    substances: Mapping[str, Substance] = field(default_factory=dict)
    damping: float = 0.0
    threads: int = 1
    step: float | None = None
    courant: float = COURANT
    metres: float | None = None
    corotated: bool = False
    notes: tuple[str, ...] = ()
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
        checked_number("damping", self.damping, "1/s", least=0.0)
        share = scene.longest / (self.metres or scene.longest)
        scene = scene.similar(share)
        setup = self._setup(scene, device)
        record = _Recorder(scene, setup)
        motions = [record.motion(setup.now(0.0))]
        for frame in range(1, frames + 1):
            if setup.solver is not None and not setup.solver.advance(dt):
                assert setup.solver.failure is not None
                plan = setup.plan(scene.duration)
                raise MpmError(setup.solver.failure.scaled(share**2), plan, setup.notes)
            motions.append(record.motion(setup.now(frame * dt)))
            if progress is not None:
                progress(frame, frames)
        return MotionResult(tuple(motions), dt, len(motions[0].u), 0, particles=record.run())

    def _setup(self, scene: Scene, device: str) -> _Setup:
        mesh = scene.mesh
        spacing = scene.longest / self.grid
        room = scene_room(scene, spacing)  # or the grid is refused, before anything is made for it
        step = self.step or 1 / self.budget
        bends = bending_regions(scene, self.substances, spacing, step=step, courant=self.courant)
        sample = sample_tets(mesh, spacing, bends=bends)
        given = self._particles(scene, sample)
        found = self._treated(scene, given, spacing)
        walls = [Wall(shape=obstacle, friction=scene.friction) for obstacle in scene.obstacles]
        if scene.ground is not None:
            walls.append(Wall(shape=scene.ground))
        walls += support_walls(mesh, scene.held, spacing, scene.duration)
        notes = (*self._assumed(scene), *treatment_notes(found, sample.thin))
        if found.particles.held.all():
            return _Setup(found, sample, room, None, notes)
        # Whether it is jelly alone, held, and meets nothing: weights at rest forget nothing then
        given = found.particles
        moving = given.kinds[~given.held] == MaterialClass.JELLY
        tears = any(s.tears for s in given.substances)
        solver = MpmSolver(
            found.particles,
            room,
            walls=walls,
            gravity_vector=scene.gravity_vector,
            damping=self.damping,
            lagrangian=bool(
                moving.all() and not tears and not scene.obstacles and scene.held.fixed.any()
            ),
            device=device,
            threads=self.threads,
            courant=self.courant,
            step=self.step,
        )
        force = particle_forces(scene, found.particles.x)
        if force.any():
            solver.push(force / found.particles.mass[:, None])
        setup = _Setup(found, sample, room, solver, notes)
        if self.announce is not None:
            self.announce(setup.plan(scene.duration))
        return setup

    def _treated(self, scene: Scene, given: Particles, spacing: float) -> Treatment:
        """What becomes of stiff matter; with a step of its own it stays as it is, and may fail."""
        if self.step is not None:
            most = largest_modulus(given.nu, given.rho, spacing, self.step, courant=self.courant)
            return Treatment(particles=given, dt=self.step, E_max=np.asarray(most))
        return treated(
            given, spacing, held=near_held(scene, given.x, spacing), stiff=self.stiff,
            budget=self.budget, gravity=float(np.linalg.norm(scene.gravity_vector)) or 9.81,
        )  # fmt: skip

    def _assumed(self, scene: Scene) -> tuple[str, ...]:
        """What is not the body's own size, in words."""
        if self.metres is None:
            return self.notes
        return (
            *self.notes,
            f"moved as if it were {self.metres:g} m long, not {scene.longest:.3g} m: times, speeds "
            "and sags are not the body's own",
        )

    def _particles(self, scene: Scene, sample: TetSample) -> Particles:
        mesh, material = scene.mesh, material_of(scene.mesh)
        unknown = sorted(set(self.substances) - set(mesh.region_names))
        if unknown:
            raise UsageError(f"no part {unknown[0]!r}: there are {', '.join(mesh.region_names)}")
        region = mesh.region[sample.tet].astype(np.int64)
        jelly = Substance(corotated=self.corotated)
        named = tuple(self.substances.get(name, jelly) for name in mesh.region_names)
        velocity = np.asarray(scene.velocity, dtype=float)
        if velocity.ndim == 2:
            velocity = velocity[mesh.tets[sample.tet]].mean(axis=1)
        return Particles(
            x=sample.x, volume=sample.volume, E=material.E[sample.tet],
            nu=material.nu[sample.tet], rho=material.rho[sample.tet], part=region,
            parts=mesh.region_names, substance=region.copy(), substances=named,
            velocity=np.broadcast_to(velocity, sample.x.shape).copy(),
            rigid=np.full(len(region), -1, dtype=np.int64),
        )  # fmt: skip


METHOD = MpmMethod()
# Xie et al. 2024, ficus_config.json of their code: a body of 1 m in 2 m of 50 cells, 0.9999 of the
# velocities kept in a step.
PRESETS = {
    "physgaussian": MpmMethod(
        grid=25, step=1e-4, courant=1.0, metres=1.0, corotated=True, damping=-np.log(0.9999) / 1e-4
    )
}


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
        dt = np.inf  # nothing moves
        if self.solver is not None:
            waves, speeds = float(given.wave_speed.max()), np.linalg.norm(given.velocity, axis=1)
            pull, spacing = self.solver.substep.pull, self.room.spacing
            dt = longest_step(waves, float(speeds.max()), spacing, pull=pull)
            dt = self.solver.step or dt
        steps = max(duration / dt, 1.0)
        each = np.array([COSTS.get(MaterialClass(int(k)), COST) for k in given.kinds])
        seconds = steps * (OVERHEAD + float(each[~given.held].sum()))
        return (
            f"{len(given.x):,} particles, a grid of {'x'.join(map(str, self.room.shape))}, about "
            f"{steps:,.0f} steps: some {seconds:,.0f} s"
        )


class _Recorder:
    """States of particles as states of the mesh."""

    def __init__(self, scene: Scene, setup: _Setup) -> None:
        self.scene, self.setup, self.time = scene, setup, 0.0
        given = setup.treatment.particles
        self.follow = mesh_followers(scene.mesh, given.x, given.part)
        weight = given.mass[:, None] * np.asarray(scene.gravity_vector, dtype=float)
        self.load = weight + particle_forces(scene, given.x)
        self.positions: list[np.ndarray] = []
        self.gradients: list[np.ndarray] = []

    def motion(self, state: ParticleState) -> Motion:
        """The mesh at the time of ``state``, which is kept; forces are means since the last."""
        self.positions.append(state.x.astype(np.float32))
        self.gradients.append(state.F.astype(np.float32))
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
            potential=float((self.load * (given.x - state.x)).sum()),
            barrier=0.0,
            iterations=0,
        )

    def run(self) -> ParticleRun:
        """What is kept of the particles themselves."""
        setup, found = self.setup, self.setup.treatment
        solver, notes = setup.solver, setup.notes
        lost = solver.outside if solver is not None else 0
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
            laws=tuple(sorted({one.law for one in found.particles.substances})),
            part=found.particles.part,
            positions=np.stack(self.positions),
            gradients=np.stack(self.gradients),
        )
