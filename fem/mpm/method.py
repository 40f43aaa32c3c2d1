"""The material point method as a method of the scene: tets become particles, and follow them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from ..errors import InputError, UsageError
from ..laws.law import Law
from ..mesh import barycentric, material_of
from ..note import Note
from ..scene.scene import Scene
from ..solve.method import FrameProgress
from ..solve.result import Breakage, Motion, MotionResult, ParticleRun
from ..validation import checked_count, checked_number, checked_positive
from .boundaries import CLEAR, Wall, flight_time, scene_room, support_boundaries
from .materials import MaterialClass, Substance
from .particles import (
    TORN,
    Followers,
    Particles,
    ParticleState,
    crack_band,
    particle_forces,
    pieces_of,
    sample_tets,
    stress_left,
)
from .rigid import Stiff, Treatment, near_fixed, treated
from .solver import MpmSolver
from .time_step import BUDGET, COST, COURANT, OVERHEAD, MpmError, largest_modulus, stable_step

# CPU time [s] of a particle and substep, by class, where it is not ``COST``.
COSTS = {MaterialClass.SNOW: 2.5e-7, MaterialClass.JELLY: 1.5e-7}


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
            not have, a substance of a part that there is not, or plates close on a rigid body.
        InputError
            Where an obstacle starts in the body.
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
        run = _Run(self, scene.similar(scale), device)
        if run.solver is not None and self.announce is not None:
            self.announce(run.plan)
        motions = [run.motion(0.0)]
        for frame in range(1, frames + 1):
            if run.solver is not None:
                free = min(dt, run.flight - run.solver.time)
                if free > 0:
                    run.solver.coast(free)
                if free < dt and not run.solver.advance(dt - max(free, 0.0)):
                    assert run.solver.failure is not None
                    raise MpmError(run.solver.failure.scaled(scale**2), run.plan, run.notes)
            motions.append(run.motion(frame * dt))
            if progress is not None:
                progress(frame, frames)
        return MotionResult(tuple(motions), dt, len(motions[0].u), 0, particles=run.record())


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

    def __init__(self, method: MpmMethod, scene: Scene, device: str) -> None:
        """Particles of the body, what becomes of stiff ones, boundaries, and the solver."""
        mesh, material = scene.mesh, material_of(scene.mesh)
        names, held = mesh.region_names, scene.held
        gravity = np.asarray(scene.gravity_vector, dtype=float)
        room = scene_room(scene, method.grid)  # or it is refused, before anything is made for it
        spacing = room.spacing
        unknown = sorted(set(method.substances) - set(names))
        if unknown:
            raise UsageError("method.part", unknown=unknown[0], region_names=", ".join(names))
        jelly = Substance(corotated=method.corotated)
        substances = tuple(method.substances.get(name, jelly) for name in names)
        # Jelly that bends, with its weights at rest: finer particles help it where it is thin
        most = largest_modulus(
            material.nu, material.rho, spacing, method.step or 1 / method.budget,
            courant=method.courant,
        )  # fmt: skip
        bends = np.array([s.kind == MaterialClass.JELLY and not s.tears for s in substances])
        bends &= np.isin(np.arange(len(names)), mesh.region[material.E <= most])
        bends &= bool(held.fixed.any()) and not scene.obstacles
        sample = sample_tets(mesh, spacing, bends=bends)
        region = mesh.region[sample.tet].astype(np.int64)
        velocity = np.asarray(scene.velocity, dtype=float)
        if velocity.ndim == 2:
            corners = mesh.tets[sample.tet]
            weights = barycentric(mesh.points[corners], sample.x)
            velocity = np.einsum("nk,nki->ni", weights, velocity[corners])
        particles = Particles(
            x=sample.x, volume=sample.volume, E=material.E[sample.tet],
            nu=material.nu[sample.tet], rho=material.rho[sample.tet], part=region,
            parts=names, substance=region.copy(), substances=substances,
            velocity=np.broadcast_to(velocity, sample.x.shape).copy(),
            rigid=np.full(len(region), -1, dtype=np.int64),
        )  # fmt: skip
        treatment = Treatment(particles=particles)
        if method.step is None:  # with a step of its own it stays as it is, and may fail
            treatment = treated(
                particles, spacing, stiff=method.stiff,
                held=near_fixed(mesh.points, held, particles.x, spacing),
                budget=method.budget, gravity=float(np.linalg.norm(gravity)) or 9.81,
            )  # fmt: skip
        particles = treatment.particles

        notes = [*method.notes, *treatment.notes]
        if method.metres is not None:
            notes.append(Note("method.moved_if", metres=method.metres, longest=scene.longest))
        bending = np.unique(particles.part[particles.kinds != MaterialClass.STATIONARY])
        if thin := [names[i] for i in bending if names[i] in sample.thin]:
            notes.append(Note("rigid.less_about", names=", ".join(thin)))
        if particles.held.all():
            notes.append(Note("rigid.everything_stationary"))
        force = particle_forces(scene, particles.x)
        self.scene, self.treatment, self.room = scene, treatment, room
        self.solver, self.notes, self.time = None, tuple(notes), 0.0
        if not particles.held.all():
            for number, obstacle in enumerate(scene.obstacles, 1):
                if not obstacle.distance(particles.x[~particles.held]).gap.min() > 0:
                    raise InputError("method.body_starts", number=number)
            walls = [Wall(shape=obstacle, friction=scene.friction) for obstacle in scene.obstacles]
            if treatment.rigid and sum(wall.moves for wall in walls) > 1:
                stiff = {particles.parts[i] for i in particles.part[particles.rigid >= 0]}
                raise UsageError("method.rigid_squeezed", parts=", ".join(sorted(stiff)))
            walls += [] if scene.ground is None else [Wall(shape=scene.ground)]
            walls += support_boundaries(mesh, held, particles.x, spacing, scene.duration)
            # Whether it is jelly alone, held, and meets nothing: weights at rest forget nothing
            moving = particles.kinds[~particles.held] == MaterialClass.JELLY
            still = moving.all() and not scene.obstacles and held.fixed.any()
            self.solver = MpmSolver(
                particles,
                room,
                walls=walls,
                gravity_vector=gravity,
                damping=method.damping,
                lagrangian=bool(still and not any(s.tears for s in particles.substances)),
                device=device,
                threads=method.threads,
                courant=method.courant,
                step=method.step,
                follows=True,
            )
            if force.any():
                self.solver.push(force / particles.mass[:, None])

        self.flight = 0.0  # [s] for which the body falls as one
        alone = not (held.fixed.any() or force.any() or method.damping or self.solver is None)
        if alone and not treatment.rigid and not np.ptp(particles.velocity, axis=0).any():
            met = (*scene.obstacles, *([scene.ground] if scene.ground else []))
            start = particles.velocity[0], gravity, scene.duration
            self.flight = flight_time(particles.x, met, *start, room=CLEAR * spacing)
        labels = np.zeros(len(mesh.points), dtype=np.int64)
        labels[mesh.tets.ravel()] = np.repeat(mesh.region, 4)
        self.followers = Followers.of(mesh.points, particles.x, labels=labels, parts=particles.part)
        self.load = particles.mass[:, None] * gravity + force
        self.positions: list[np.ndarray] = []
        self.gradients: list[np.ndarray] = []
        self.left: list[np.ndarray] = []
        dt = np.inf  # nothing moves
        if self.solver is not None:
            fastest = float(np.linalg.norm(particles.velocity, axis=1).max())
            dt = method.step or stable_step(
                float(particles.wave_speed.max()), fastest, spacing,
                pull=self.solver.substep.pull, courant=method.courant,
            )  # fmt: skip
        steps = max(scene.duration / dt, 1.0)
        each = np.array([COSTS.get(kind, COST) for kind in MaterialClass])[particles.kinds]
        self.plan = Note(
            "method.particles_grid",
            count=len(particles.x),
            shape="x".join(map(str, room.shape)),
            steps=steps,
            seconds=steps * (OVERHEAD + float(each[~particles.held].sum())),
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
        self.left.append(np.zeros(len(state.x), dtype=bool) if solver is None else solver.lost)
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

    def breakage(self) -> Breakage:
        """What tore until now."""
        particles, spacing = self.treatment.particles, self.room.spacing
        x, volume = particles.x, particles.volume
        able = np.array([s.tears for s in particles.substances])[particles.substance]
        able &= particles.kinds == MaterialClass.JELLY
        torn, spends = np.zeros(len(x), dtype=bool), 1.0
        if self.solver is not None and able.any():
            _, softening, _ = particles.numbers(spacing).T
            q = self.solver.state.q
            torn = able & (stress_left(q, softening) < TORN)
            for i in np.unique(particles.substance[able]):
                one, rows = particles.substances[i], able & (particles.substance == i)
                if one.tension and one.fracture_energy:
                    band = crack_band(one.tension, one.fracture_energy, particles.E[rows], spacing)
                    spends = max(spends, float(band.spends.max()))
        judged, lost = float(volume[able].sum()), float(volume[torn].sum())
        place = volume[torn] @ x[torn] / lost if lost else np.full(3, np.nan)
        before = pieces_of(x, volume, spacing)
        return Breakage(
            judged=judged / float(volume.sum()),
            fraction=lost / judged if judged else 0.0,
            parts=tuple(particles.parts[i] for i in np.unique(particles.part[torn])),
            place=(float(place[0]), float(place[1]), float(place[2])),
            pieces=pieces_of(x[~torn], volume[~torn], spacing) if lost else before,
            pieces_before=before,
            crack_energy=spends,
        )

    def record(self) -> ParticleRun:
        """What is kept of the particles themselves."""
        solver, treatment, notes = self.solver, self.treatment, self.notes
        particles = treatment.particles
        left = np.logical_or.accumulate(self.left)
        outside = int(left[-1].sum())
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
            breakage=self.breakage(),
            part=particles.part,
            positions=np.stack(self.positions),
            gradients=np.stack(self.gradients),
            left=left,
        )
