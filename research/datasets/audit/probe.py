"""Both ends of a range in motion: one load, one time, particles on the voxels.

An object has no size and no weight that matters: it is 1 m long, held where it stands, and loaded
by its own weight on a slope of 45 degrees, so strong that its soft end moves by ``SAG`` of its
length at rest, twice that in motion; it is followed for ``PERIODS`` of its soft end's first
vibration, past the turn. Both are found by linear elements on the cells of the grid, corrected by
the particles where thin parts bend further, and stay while the range is refined: the number of
steps does not depend on the scale of E.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ....fem.material import ElementMaterial
from ....fem.mpm.boundaries import ROOM, grid_around, support_boundaries
from ....fem.mpm.materials import MaterialClass, Substance, plane_friction
from ....fem.mpm.particles import Followers, Particles
from ....fem.mpm.rigid import near_fixed, treated
from ....fem.mpm.solver import MpmSolver
from ....fem.mpm.time_step import Failure, largest_modulus
from ....fem.scene.supports import find_supports
from ....fem.solve.statics import solve_static
from ...voxels import TETS_PER_CELL, blocks, voxel_mesh
from .proposal import End, Proposal

ALONG = 2  # voxels a cell of the grid, along each side
SLOPE = np.array([1.0, 0.0, -1.0]) / np.sqrt(2)
SAG = 0.1  # of the longest side
# How much further than twice that particles may move, what a failure counts as, how often to try.
TOO_FAR, FAILED, TRIES = 1.5, 4.0, 3
# How long a motion is followed: the soft end turns back after half a period.
PERIODS = 0.7
FRAMES = 12
CRUSHED = 2  # times the steps expected at most
# Particles this close [spacings] share nodes of the grid, which joins what deforms: stiff parts
# across such a gap are one rigid body too, or they would fall off.
JOINED = 1.5
# Steps that an end may take, of all particles, least and most: what needs more is a failure.
PARTICLE_STEPS, LEAST_STEPS, MOST_STEPS = 3e7, 4_000, 30_000
# Angle of internal friction of grains [rad]: the middle of the table's, 27 to 49 degrees.
FRICTION = np.radians(35.0)
_VALUES = Float[np.ndarray, "voxels"]


class Load(NamedTuple):
    """Acceleration [m/s^2] along the slope, and how long the motion is followed [s]."""

    acceleration: float
    duration: float


class EndMotion(NamedTuple):
    """Positions (frames, particles, 3) [m] of an end, why it failed if it did, how many steps."""

    x: np.ndarray
    failure: Failure | None
    substeps: int

    @property
    def largest(self) -> float:
        """Largest displacement [m]."""
        return float(np.linalg.norm(self.x - self.x[:1], axis=2).max())


class _TooManyStepsError(Exception):
    """Steps have become so short that the motion would take too many of them."""


class Probe:
    """The voxels of an object, ready to be loaded.

    Parameters
    ----------
    part
        Index into ``names`` of every voxel, -1 outside, shape (x, y, z); z is up.
    names
        Names of the parts.
    linear
        Whether ends are those of linear elements, at the turn, instead of particles in motion:
        a hundredth of the time, and nothing can fail but waves too fast for the particles' steps.
    """

    def __init__(
        self, part: Int[np.ndarray, "x y z"], names: Sequence[str], *, linear: bool = False
    ) -> None:
        self.names, self.linear = tuple(names), linear
        inside = blocks(part >= 0, max(part.shape) // ALONG)
        self._voxels_of_cell = inside
        self._occupied = np.asarray(inside.any(axis=3))
        self._mesh = voxel_mesh(self._occupied)
        self._supports, self.notes = find_supports(self._mesh, "z")
        cells = np.argwhere(part >= 0)
        self.part = part[tuple(cells.T)]
        self._cells, self.shape = cells, part.shape
        self.side = 1 / max(part.shape)
        self.x = (cells + 0.5) * self.side
        self.length = float(np.ptp(cells, axis=0).max() + 1) * self.side
        self.steps = int(np.clip(PARTICLE_STEPS / len(cells), LEAST_STEPS, MOST_STEPS))

    def _each(self, proposal: Proposal, end: End) -> tuple[_VALUES, _VALUES, _VALUES]:
        """E, nu and rho of every voxel at an end."""
        values = np.array([proposal.parts[name].value(end) for name in self.names])[self.part]
        return values[:, 0], values[:, 1], values[:, 2]

    def _static(self, proposal: Proposal, end: End) -> Float[np.ndarray, "points 3"]:
        """Displacement [m] of the mesh under 1 m/s^2 along the slope."""
        body = self._mesh.with_material(self._material(proposal, end))
        return solve_static(body, self._supports, gravity_vector=SLOPE, order=1).displacement

    def _material(self, proposal: Proposal, end: End) -> ElementMaterial:
        """Cells with the mean of log E, of nu and of log rho, thinned by what is empty in them."""
        E, nu, rho = self._each(proposal, end)
        grid = np.zeros((*self.shape, 3))
        grid[tuple(self._cells.T)] = np.stack([np.log(E), nu, np.log(rho)], axis=1)
        count = self._voxels_of_cell.sum(axis=3)[self._occupied]
        mean = blocks(grid, max(self.shape) // ALONG).sum(axis=3)[self._occupied] / count[:, None]
        full = count / self._voxels_of_cell.shape[3]
        columns = (np.exp(mean[:, 0]) * full, mean[:, 1], np.exp(mean[:, 2]) * full)
        return ElementMaterial(*(np.repeat(column, TETS_PER_CELL) for column in columns))

    def tried_load(self, proposal: Proposal) -> tuple[Load, EndMotion]:
        """Load (see ``load``) that the particles agree with, and the soft end under it.

        Elements of one cell bend less than particles in it do: where the soft end goes too far or
        fails, it is loaded less, and followed for as much longer as it is softer.
        """
        load = self.load(proposal)
        run = self.simulate(proposal, End.SOFT, load)
        for _ in range(TRIES):
            far = run.largest / (2 * SAG * self.length) if run.failure is None else FAILED
            if far <= TOO_FAR:
                break
            load = Load(load.acceleration / far, load.duration * float(np.sqrt(far)))
            run = self.simulate(proposal, End.SOFT, load)
        return load, run

    def load(self, proposal: Proposal) -> Load:
        """Load that moves the soft end by ``SAG``; its period is that of Rayleigh's quotient."""
        u = self._static(proposal, End.SOFT)
        rho = self._material(proposal, End.SOFT).rho
        mass = rho * self._mesh.volumes / 4
        at = u[self._mesh.tets]
        work = float(mass @ (at @ SLOPE).sum(axis=1))
        inertia = float(mass @ (at**2).sum(axis=(1, 2)))
        moved = float(np.linalg.norm(u, axis=1).max())
        period = 2 * np.pi * np.sqrt(inertia / work)
        return Load(SAG * self.length / moved, PERIODS * float(period))

    def sag(self, proposal: Proposal, end: End, load: Load) -> float:
        """Largest displacement under the load at rest, linear, over the longest side [1]."""
        u = self._static(proposal, end)
        return float(np.linalg.norm(u, axis=1).max()) * load.acceleration / self.length

    def too_stiff(self, proposal: Proposal, end: End, load: Load) -> tuple[Failure, ...]:
        """Parts whose waves are too fast for ``steps``, unless they are rigid at this end."""
        found = []
        for name, part in proposal.parts.items():
            E, nu, rho = part.value(end)
            most = float(largest_modulus(nu, rho, ALONG * self.side, load.duration / self.steps))
            if E > most and end not in part.rigid:
                advice = f"wanted at most {self.steps:,} steps in {load.duration:.3g} s"
                found.append(
                    Failure(kind="cfl", time=0.0, part=name, E=E, E_max=most, advice=advice)
                )
        return tuple(found)

    def simulate(self, proposal: Proposal, end: End, load: Load) -> EndMotion:
        """Follow an end by material points; what fails is returned, not raised.

        Parts that are too stiff for the steps (``too_stiff``) are rigid.
        """
        if self.linear:
            return EndMotion(
                np.stack([self.x, self.x + self._turned(proposal, end, load)]), None, 0
            )
        still = np.repeat(self.x[None], FRAMES + 1, axis=0)
        spacing, step = ALONG * self.side, load.duration / self.steps
        given = treated(
            self._particles(proposal, end), spacing,
            held=near_fixed(self._mesh.points, self._supports, self.x, spacing),
            budget=1 / step, reach=JOINED,
        ).particles  # fmt: skip
        if given.held.all():
            return EndMotion(still, None, 0)
        low, high = self._mesh.bounds
        room = ROOM * self.length
        kinds = given.kinds[~given.held]
        solver = MpmSolver(
            given,
            grid_around(low - room, high + room, spacing),
            walls=support_boundaries(self._mesh, self._supports, given.x, spacing, load.duration),
            gravity_vector=load.acceleration * SLOPE,
            lagrangian=bool((kinds == MaterialClass.JELLY).all()),
        )
        frames = [self.x]
        for _ in range(FRAMES):
            failure = self._advance(solver, load)
            if failure is not None:
                return EndMotion(still, failure, solver.substeps)
            frames.append(solver.state.x)
        return EndMotion(np.stack(frames), None, solver.substeps)

    def _turned(self, proposal: Proposal, end: End, load: Load) -> Float[np.ndarray, "n 3"]:
        """Displacement [m] of the voxels at the turn: twice that at rest."""
        at = Followers.of(
            self.x, self._mesh.points, labels=np.zeros(len(self.x), dtype=np.int64),
            parts=np.zeros(len(self._mesh.points), dtype=np.int64),
        )  # fmt: skip
        u = self._static(proposal, end)
        return 2 * load.acceleration * np.einsum("nk,nki->ni", at.weights, u[at.near])

    def _advance(self, solver: MpmSolver, load: Load) -> Failure | None:
        """Follow a frame; matter that is crushed shortens its steps, but not for ever."""

        def count(_: float) -> None:
            if solver.substeps > CRUSHED * self.steps:
                raise _TooManyStepsError

        try:
            solver.advance(load.duration / FRAMES, tell=count)
        except _TooManyStepsError:
            fastest = self.part[(solver.state.v**2).sum(axis=1).argmax()]
            E = float(solver.cloud.particles.E[solver.cloud.particles.part == fastest].max())
            advice = f"crushed or flung: more than {CRUSHED * self.steps:,} steps"
            return Failure(
                kind="velocity", time=solver.time, part=self.names[fastest], E=E, E_max=np.inf,
                advice=advice,
            )  # fmt: skip
        return solver.failure

    def _particles(self, proposal: Proposal, end: End) -> Particles:
        E, nu, rho = self._each(proposal, end)
        side = 0 if end == End.SOFT else 1
        substances = tuple(substance_of(proposal.parts[name].matter[side]) for name in self.names)
        n = len(self.x)
        return Particles(
            x=self.x.copy(), volume=np.full(n, self.side**3), E=E, nu=nu, rho=rho,
            part=self.part, parts=self.names, substance=self.part.copy(), substances=substances,
            velocity=np.zeros((n, 3)), rigid=np.full(n, -1, dtype=np.int64),
        )  # fmt: skip


def substance_of(kind: MaterialClass) -> Substance:
    """What a class is simulated as, under a load that has no size of its own.

    Sand and snow yield by ratios and strains, and do so here. Metals and pastes yield at a stress,
    which says nothing of a fictitious load; stone is stiff, not still: they stay elastic.
    """
    if kind == MaterialClass.SAND:
        return Substance(kind=kind, friction=plane_friction(FRICTION))
    return Substance(kind=kind) if kind == MaterialClass.SNOW else Substance()


def difference(a: EndMotion, b: EndMotion, part: Int[np.ndarray, "n"], length: float) -> float:
    """How far apart two motions are, over the longest side [1].

    The root mean square over the particles of the part that shows it most, when it does most.
    """
    apart = ((a.x - b.x) ** 2).sum(axis=2)
    means = [apart[:, part == k].mean(axis=1).max() for k in np.unique(part)]
    return float(np.sqrt(max(means))) / length
