"""The material point method as a method of the scene: tets become particles, and follow them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from ..errors import UsageError
from ..laws.law import Law
from ..mesh import material_of
from ..note import Note
from ..scene.scene import Scene
from ..solve.method import FrameProgress
from ..solve.result import Motion, MotionResult, ParticleRun
from ..validation import checked_count, checked_number, checked_positive
from .boundaries import BackgroundGrid, Wall, scene_room, support_boundaries
from .materials import MaterialClass, Substance
from .particles import Followers, Particles, ParticleState, particle_forces, sample_tets
from .rigid import Stiff, Treatment, bending_regions, near_fixed, treated, treatment_notes
from .solver import MpmSolver
from .time_step import BUDGET, COURANT, MpmError, stable_step

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
        What becomes of parts that are too stiff for the steps.
    budget
        Substeps a second of motion that a part may need at most.
    substances
        Class and yield by name of region; jelly where none is named.
    damping
        Rate [1/s] at which velocities fade.
    threads
        One or two on a CPU.
    step, courant
        Step [s] instead of the longest stable one, and what fraction of a cell waves may cross in
        it: what is too stiff for it is a failure then.
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
        """Follow the scene for its duration.

        Raises
        ------
        UsageError
            Where an ``order`` is asked for, which is for elements, a ``law`` that jelly here does
            not have, or a substance of a part that there is not.
        MpmError
            Where the run fails.
        """
        laws = () if self.corotated else self.laws
        if order is not None or law not in (None, *laws):
            raise UsageError("method.particles_elements")
        frames = checked_count("frames", scene.frames)
        dt = checked_positive("duration", scene.duration, "s") / frames
        checked_count("grid", self.grid)
        checked_number("damping", self.damping, "1/s", least=0.0)
        scale = scene.longest / (self.metres or scene.longest)
        run = self._run(scene.similar(scale), device)
        motions = [run.motion(0.0)]
        for frame in range(1, frames + 1):
            if run.solver is not None and not run.solver.advance(dt):
                assert run.solver.failure is not None
                raise MpmError(run.solver.failure.scaled(scale**2), run.plan, run.notes)
            motions.append(run.motion(frame * dt))
            if progress is not None:
                progress(frame, frames)
        return MotionResult(tuple(motions), dt, len(motions[0].u), 0, particles=run.record())

    def _run(self, scene: Scene, device: str) -> _Run:
        """Particles of the body, what becomes of stiff ones, boundaries, and the solver."""
        mesh, material = scene.mesh, material_of(scene.mesh)
        spacing = scene.longest / self.grid
        room = scene_room(scene, spacing)  # or the grid is refused, before anything is made for it
        step = self.step or 1 / self.budget
        bends = bending_regions(scene, self.substances, spacing, step=step, courant=self.courant)
        sample = sample_tets(mesh, spacing, bends=bends)

        unknown = sorted(set(self.substances) - set(mesh.region_names))
        if unknown:
            raise UsageError(
                "method.part", unknown=unknown[0], region_names=", ".join(mesh.region_names)
            )
        region = mesh.region[sample.tet].astype(np.int64)
        jelly = Substance(corotated=self.corotated)
        velocity = np.asarray(scene.velocity, dtype=float)
        if velocity.ndim == 2:
            velocity = velocity[mesh.tets[sample.tet]].mean(axis=1)
        particles = Particles(
            x=sample.x, volume=sample.volume, E=material.E[sample.tet],
            nu=material.nu[sample.tet], rho=material.rho[sample.tet], part=region,
            parts=mesh.region_names, substance=region.copy(),
            substances=tuple(self.substances.get(name, jelly) for name in mesh.region_names),
            velocity=np.broadcast_to(velocity, sample.x.shape).copy(),
            rigid=np.full(len(region), -1, dtype=np.int64),
        )  # fmt: skip
        if self.step is None:
            treatment = treated(
                particles, spacing, stiff=self.stiff,
                held=near_fixed(mesh.points, scene.held, particles.x, spacing),
                budget=self.budget, gravity=float(np.linalg.norm(scene.gravity_vector)) or 9.81,
            )  # fmt: skip
        else:  # with a step of its own it stays as it is, and may fail
            treatment = Treatment(particles=particles)
        particles = treatment.particles

        notes = self.notes
        if self.metres is not None:
            notes += (Note("method.moved_if", metres=self.metres, longest=scene.longest),)
        notes += treatment_notes(treatment, sample.thin)
        force = particle_forces(scene, particles.x)
        if particles.held.all():
            return _Run(scene, treatment, room, None, force, notes)
        walls = [Wall(shape=obstacle, friction=scene.friction) for obstacle in scene.obstacles]
        if scene.ground is not None:
            walls.append(Wall(shape=scene.ground))
        walls += support_boundaries(mesh, scene.held, spacing, scene.duration)
        # Whether it is jelly alone, held, and meets nothing: weights at rest forget nothing then
        moving = particles.kinds[~particles.held] == MaterialClass.JELLY
        tears = any(s.tears for s in particles.substances)
        solver = MpmSolver(
            particles,
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
        if force.any():
            solver.push(force / particles.mass[:, None])
        run = _Run(scene, treatment, room, solver, force, notes)
        if self.announce is not None:
            self.announce(run.plan)
        return run


METHOD = MpmMethod()
# Xie et al. 2024, ficus_config.json of their code: a body of 1 m in 2 m of 50 cells, 0.9999 of the
# velocities kept in a step.
PRESETS = {
    "physgaussian": MpmMethod(
        grid=25, step=1e-4, courant=1.0, metres=1.0, corotated=True, damping=-np.log(0.9999) / 1e-4
    )
}


class _Run:
    """Particles that a scene became, and their states as states of the mesh.

    Without a ``solver`` nothing moves. ``plan`` is particles, steps and the time that they will
    take, in words.
    """

    def __init__(
        self,
        scene: Scene,
        treatment: Treatment,
        room: BackgroundGrid,
        solver: MpmSolver | None,
        force: Float[np.ndarray, "particles 3"],
        notes: tuple[str, ...],
    ) -> None:
        self.scene, self.treatment, self.room = scene, treatment, room
        self.solver, self.notes, self.time = solver, notes, 0.0
        particles = treatment.particles
        labels = np.zeros(len(scene.mesh.points), dtype=np.int64)
        labels[scene.mesh.tets.ravel()] = np.repeat(scene.mesh.region, 4)
        self.followers = Followers.of(
            scene.mesh.points, particles.x, labels=labels, parts=particles.part
        )
        weight = particles.mass[:, None] * np.asarray(scene.gravity_vector, dtype=float)
        self.load = weight + force
        self.positions: list[np.ndarray] = []
        self.gradients: list[np.ndarray] = []
        dt = np.inf  # nothing moves
        if solver is not None:
            fastest = float(np.linalg.norm(particles.velocity, axis=1).max())
            dt = solver.step or stable_step(
                float(particles.wave_speed.max()), fastest, room.spacing,
                pull=solver.substep.pull, courant=solver.courant,
            )  # fmt: skip
        steps = max(scene.duration / dt, 1.0)
        each = np.array([COSTS.get(MaterialClass(int(k)), COST) for k in particles.kinds])
        seconds = steps * (OVERHEAD + float(each[~particles.held].sum()))
        self.plan = Note(
            "method.particles_grid",
            count=len(particles.x),
            shape="x".join(map(str, room.shape)),
            steps=steps,
            seconds=seconds,
        )

    def motion(self, time: float) -> Motion:
        """The mesh now, which is kept; forces are means since the last."""
        scene, followers, particles = self.scene, self.followers, self.treatment.particles
        solver, points, obstacles = self.solver, len(scene.mesh.points), scene.obstacles
        forces = np.zeros((len(obstacles), 3))
        if solver is None:
            eyes = np.tile(np.eye(3), (len(particles.x), 1, 1))
            still = np.zeros_like(particles.x)
            state = ParticleState(time, particles.x, still, eyes, still[:, 0])
        else:
            state = solver.state
            if state.time > self.time:
                pushes = solver.substep.take_impulses() / (state.time - self.time)
                forces = pushes[: len(obstacles)]
        self.time = state.time
        self.positions.append(state.x.astype(np.float32))
        self.gradients.append(state.F.astype(np.float32))
        gaps = [
            o.distance(state.x - state.time * np.asarray(o.velocity, dtype=float)).gap.min()
            for o in obstacles
        ]
        return Motion(
            time=state.time,
            u=followers.positions(state) - scene.mesh.points,
            v=np.einsum("nk,nki->ni", followers.weights, state.v[followers.near]),
            a=np.zeros((points, 3)),
            contact_force=np.tile(forces.sum(axis=0) / points, (points, 1)),
            obstacle_force=forces,
            gap=float(min(gaps, default=np.inf)),
            kinetic=float(0.5 * particles.mass @ (state.v**2).sum(axis=1)),
            elastic=0.0 if solver is None else solver.elastic_energy,
            potential=float((self.load * (particles.x - state.x)).sum()),
            barrier=0.0,
            iterations=0,
        )

    def record(self) -> ParticleRun:
        """What is kept of the particles themselves."""
        solver, treatment, notes = self.solver, self.treatment, self.notes
        particles = treatment.particles
        outside = solver.outside if solver is not None else 0
        if outside:
            notes = (*notes, Note("method.particles_left", outside=outside))
        return ParticleRun(
            spacing=self.room.spacing,
            nodes=self.room.shape,
            substeps=solver.substeps if solver is not None else 0,
            outside=outside,
            stationary=int(particles.held.sum()),
            rigid=treatment.rigid,
            bodies=treatment.bodies,
            capped=treatment.capped,
            lagrangian=solver is not None and solver.lagrangian,
            plan=self.plan,
            notes=notes,
            laws=tuple(sorted({one.law for one in particles.substances})),
            part=particles.part,
            positions=np.stack(self.positions),
            gradients=np.stack(self.gradients),
        )
