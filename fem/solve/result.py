"""What the methods answer: a body at rest, in motion, or ringing. Verdicts and reports read these.

A method of solution returns one of the three, whichever way it found it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ..elements.assembly import BlockMatrix
from ..elements.elastic import (
    ElasticBody,
    displacement_gradients,
    linear_stress,
    stress_stiffness,
    von_mises,
)
from ..elements.space import Space, element_points
from ..linalg.solver import Inverse
from ..mesh import TetMesh, material_of
from ..note import Note
from ..scene.scene import Scene
from .self_contact import ContactPressures, PieceForce

# Poisson's ratio beyond which P1 tets answer too stiffly: use order 2.
LOCKING = 0.4

# Error of quadratic answers over its estimate: at most so much on 97 of 100 problems.
SAFETY = 1.5
CUBIC = "cubic surplus"


def locking_fraction(mesh: TetMesh) -> float:
    """Share of the volume of ``mesh`` that plain linear tets make too stiff: nu above 0.4."""
    volumes = mesh.volumes
    return float(volumes[material_of(mesh).nu > LOCKING].sum() / volumes.sum())


PLACES = ("support edge", "inner corner", "interface end", "point load", "point support")


class SingularPlace(NamedTuple):
    """Connected points of a mesh where stress has no bound: it grows as the mesh is refined.

    ``kind`` is one of ``PLACES``, ``centre`` (3,) [m] the mean of its points and ``radius`` [m] how
    far the tets around them reach, ``exponent`` that of the displacement by the distance [1],
    ``share`` what it has of the squared error in energy [1].
    """

    kind: str
    centre: tuple[float, ...]
    radius: float
    exponent: float
    share: float


class DiscretisationError(NamedTuple):
    """Relative errors [1] that the mesh leaves, of the elements that were taken; NaN: not known.

    ``value`` is that of the largest displacement, ``energy`` in the norm of energy, ``work`` of the
    work of the loads, ``reaction`` of the forces of the supports, ``stress`` the rms of the
    equivalent stress around its largest, away from the singular ``places``, over that; where these
    take all of the body it is NaN. ``peak`` is the place at which the very largest stress stands,
    which is then no property of the body.

    ``kind`` is 'cubic surplus' (what cubic elements would add to quadratic ones), 'P1/P2' (what
    quadratic elements add to linear ones) or '' (nothing is known, and ``why`` says why).
    """

    value: float
    kind: str
    why: str = ""
    energy: float = np.nan
    work: float = np.nan
    reaction: float = np.nan
    stress: float = np.nan
    places: tuple[SingularPlace, ...] = ()
    peak: SingularPlace | None = None

    @property
    def bound(self) -> float:
        """What the displacement is off by at most [1], as measured; at least a percent."""
        return max(SAFETY * self.value if self.kind == CUBIC else self.value, 0.01)


class LoadFactor(NamedTuple):
    """Multiple ``value`` [1] of the load at which a body buckles, and the ``shape`` it then takes.

    The shape (points, 3) has a largest displacement of one; infinity stands for more than 1000.
    The value is about (1 + ``error``) times that of the body, by its mesh; nan: not estimated.
    Where it was ``passed`` the body was seen to stand there, and its factor is more than that.
    """

    value: float
    shape: np.ndarray
    error: float = np.nan
    passed: bool = False

    @property
    def bound(self) -> float:
        """Error [1] that is hardly exceeded; nan: not estimated."""
        return SAFETY * self.error


@dataclass(frozen=True, eq=False)
class StaticResult:
    """A body at rest under its loads.

    Parameters
    ----------
    displacement
        Displacement of the mesh points [m], shape (points, 3).
    node_displacement
        Displacement of all nodes of the space [m], shape (nodes, 3); edges follow the points in P2.
    body
        The discretised mesh under the elastic law of the solution.
    strain, stress
        Strain tensor [1] (small strain, or Green's under a finite law) and Cauchy stress [Pa],
        means over every tet, shape (tets, 3, 3).
    reaction
        Force of the supports on the body [N], shape (nodes, 3).
    energy
        Elastic energy [J].
    residual, iterations
        Relative residual of the linear system, and iterations (0: direct).
    solver
        What solved the linear system, and what was tried before in vain.
    cycle
        The V-cycle of the iterations that did, for whoever asks on; None: there were none.
    path
        The ``fem.solve.nonlinear.Path`` of rests that led there as the load grew, if followed.

    Examples
    --------
    >>> from autophyx_tet.fem import ElementMaterial, Supports, box_mesh, solve_static
    >>> block = box_mesh((1, 1, 1), (1, 1, 1))
    >>> block = block.with_material(ElementMaterial.uniform(6, E=1e6, nu=0.0, rho=1e3))
    >>> bottom, top = block.points[:, 2] == 0, block.points[:, 2] == 1
    >>> rest = solve_static(block, Supports.clamp(8, bottom).with_fixed(top, 2, 0.01))
    >>> round(rest.energy, 6), rest.stress[0, 2, 2].round(3).item()  # J: E e^2 V / 2, Pa: E e
    (50.0, 10000.0)
    """

    mesh: TetMesh
    body: ElasticBody = field(repr=False)
    displacement: Float[np.ndarray, "points 3"]
    node_displacement: Float[np.ndarray, "nodes 3"]
    strain: Float[np.ndarray, "tets 3 3"]
    stress: Float[np.ndarray, "tets 3 3"]
    reaction: Float[np.ndarray, "nodes 3"]
    energy: float
    residual: float
    iterations: int
    solver: str = ""
    cycle: Inverse | None = None
    path: Any = field(default=None, repr=False)

    @property
    def law(self) -> str:
        """Name of the elastic law of the solution."""
        return self.body.law

    @property
    def space(self) -> Space:
        """Nodes and elements of the displacement."""
        return self.body.grid.space

    @property
    def order(self) -> int:
        """Order of the elements: 1 or 2."""
        return self.space.order

    @property
    def von_mises(self) -> Float[np.ndarray, "tets"]:
        """Von Mises stress [Pa] of every tet."""
        return von_mises(self.stress)

    @cached_property
    def stressed(self) -> BlockMatrix:
        """What the stress of a linear rest adds to its stiffness [N/m]: nobody may change it."""
        grid = self.body.grid
        H = displacement_gradients(grid, self.node_displacement, element_points(self.order))
        return stress_stiffness(grid, linear_stress(H, self.body.material))

    @property
    def locking_fraction(self) -> float:
        """Share of the volume that plain P1 tets make too stiff: nu above 0.4; else zero."""
        return 0.0 if self.order == 2 else locking_fraction(self.mesh)

    @property
    def max_strain(self) -> float:
        """Largest principal strain of any tet, in size [1]."""
        return float(np.abs(np.linalg.eigvalsh(self.strain)).max())


@dataclass(frozen=True, eq=False)
class SagResult:
    """How a body settles under its own weight, or another static load.

    Parameters
    ----------
    static, height
        The full static solution; extent along the up axis [m].
    max_displacement
        Largest displacement of a point [m].
    sag_ratio
        ``max_displacement`` over the longest side [1].
    discretisation_error
        Relative error of the largest displacement, and how it was found.
    supported
        Points that are held, shape (points,).
    warnings
        What was assumed: components that do not touch the ground, no common base, ...
    load_factor, load_factor_unmade
        Multiple of the load at which it buckles; None where that was not found, and why.
    trusted, assumed
        Whether this is how it rests, else a linear answer to a load that is too large for one;
        share of the volume in pieces that touch nothing held, and are held where they are.

    Examples
    --------
    >>> from autophyx_tet.fem import ElementMaterial, box_mesh, sag
    >>> block = box_mesh((1, 1, 1), (1, 1, 1))
    >>> block = block.with_material(ElementMaterial.uniform(6, E=1e6, nu=0.0, rho=1e3))
    >>> rest = sag(block, gravity=10.0, order=2)
    >>> round(float(rest.static.reaction[:, 2].sum()), 6)  # N: the ground carries the weight, m g
    10000.0
    """

    static: StaticResult
    height: float
    max_displacement: float
    sag_ratio: float
    discretisation_error: DiscretisationError
    supported: Bool[np.ndarray, "points"]
    warnings: tuple[str, ...]
    load_factor: LoadFactor | None = None
    load_factor_unmade: str = ""
    trusted: bool = True
    assumed: float = 0.0

    @property
    def displacement(self) -> Float[np.ndarray, "points 3"]:
        """Displacement [m] of the mesh points."""
        return self.static.displacement

    @property
    def von_mises(self) -> Float[np.ndarray, "tets"]:
        """Von Mises stress [Pa] of every tet."""
        return self.static.von_mises


@dataclass(frozen=True, eq=False)
class Motion:
    """State of a body in motion at ``time`` [s].

    Parameters
    ----------
    u, v, a
        Displacement [m], velocity [m/s] and acceleration [m/s^2], shape (nodes, 3).
    contact_force
        Force of obstacles and other faces together on every node [N], shape (nodes, 3).
    obstacle_force
        Force of every obstacle on the body [N], shape (obstacles, 3).
    gap
        Smallest distance [m] from an obstacle, and from itself where it nearly touches.
    piece_forces, pressures
        Forces of separate pieces on each other; largest contact pressures [Pa], where known.
    kinetic, elastic, potential, barrier
        Energies [J]: of gravity and dead forces, and of the obstacles, the last two.
    iterations
        Newton iterations of the step.
    reaction
        Force of the supports on every node [N], shape (nodes, 3); None: not known.

    Examples
    --------
    >>> from autophyx_tet.fem import Dynamics, ElementMaterial, box_mesh
    >>> block = box_mesh((1, 1, 1), (1, 1, 1))
    >>> block = block.with_material(ElementMaterial.uniform(6, E=1e6, nu=0.0, rho=1e3))
    >>> state = Dynamics(block, velocity=(2.0, 0.0, 0.0)).step(0.1)
    >>> state.u[0].round(9).tolist(), round(state.kinetic, 6)  # m: v t, J: m v^2 / 2
    ([0.2, 0.0, 0.0], 2000.0)
    """

    time: float
    u: Float[np.ndarray, "nodes 3"]
    v: Float[np.ndarray, "nodes 3"]
    a: Float[np.ndarray, "nodes 3"]
    contact_force: Float[np.ndarray, "nodes 3"]
    obstacle_force: Float[np.ndarray, "obstacles 3"]
    gap: float
    kinetic: float
    elastic: float
    potential: float
    barrier: float
    iterations: int
    piece_forces: tuple[PieceForce, ...] = ()
    pressures: ContactPressures | None = None
    reaction: Float[np.ndarray, "nodes 3"] | None = None

    @property
    def energy(self) -> float:
        """Total energy [J]."""
        return self.kinetic + self.elastic + self.potential + self.barrier


# An impact is followed where no step loses more of the energy than the first of these, the barrier
# never holds more of it than the second, and the largest force stands out of the steps beside it by
# no more than the third.
IMPACT_LOST, IMPACT_BARRIER, IMPACT_ROUGH = 0.1, 0.1, 0.15


class Impact(NamedTuple):
    """How obstacles were met, in all steps that were taken.

    ``forces`` (obstacles,) [N] are the largest of every obstacle. ``lost`` is the largest fraction
    [1] of the energy that one step lost, but to friction; ``barrier`` that which the barrier of the
    obstacles held, ``rough`` what the largest force stands out by of the steps beside it [1].
    """

    forces: np.ndarray
    lost: float
    barrier: float
    rough: float

    @property
    def unresolved(self) -> str:
        """What was not resolved: 'time', 'surface', 'force', or '' where these are to be trusted.

        Its steps are too long; it is stiffer than the barrier around obstacles; forces are spikes.
        """
        if self.lost > IMPACT_LOST:
            return "time"
        if self.barrier > IMPACT_BARRIER:
            return "surface"
        return "force" if self.rough > IMPACT_ROUGH else ""


@dataclass(frozen=True, eq=False)
class MotionResult:
    """A body in motion.

    Parameters
    ----------
    frames
        States at equal intervals ``dt`` [s], the start first.
    points, order
        Number of mesh points, the first rows of every frame; order of the elements, 0 without any.
    locking_fraction, stiffening
        Share of the volume with nu above 0.4 under linear elements; how many times as stiff as
        quadratic ones they are in bending, NaN: not known.
    particles, kept_apart
        The particles, where the motion is theirs; whether all faces kept out of each other.
    notes, solution, model_error
        What was assumed; what solved it, as names and words; how far few coordinates are off.
    impact
        How well the meeting with obstacles was followed; None: not known.

    Examples
    --------
    >>> from autophyx_tet.fem import METHODS, ElementMaterial, Scene, box_mesh
    >>> block = box_mesh((1, 1, 1), (1, 1, 1))
    >>> block = block.with_material(ElementMaterial.uniform(6, E=1e6, nu=0.0, rho=1e3))
    >>> scene = Scene(mesh=block, velocity=(2.0, 0.0, 0.0), duration=1.0, frames=4)
    >>> motion = METHODS["dynamics"].solve(scene)
    >>> motion.dt, motion.displacements[-1, 0].round(9).tolist()  # s, m: v t
    (0.25, [2.0, 0.0, 0.0])
    """

    frames: tuple[Motion, ...]
    dt: float
    points: int
    order: int = 1
    locking_fraction: float = 0.0
    particles: ParticleRun | None = None
    kept_apart: bool = False
    notes: tuple[str, ...] = ()
    solution: tuple[tuple[str, str], ...] = ()
    model_error: ModelError | None = None
    stiffening: float = np.nan
    impact: Impact | None = None

    @property
    def reactions(self) -> Float[np.ndarray, "frames nodes 3"] | None:
        """Force of the supports on every node [N] in every frame; None: not known."""
        known = [frame.reaction for frame in self.frames if frame.reaction is not None]
        return np.stack(known) if len(known) == len(self.frames) else None

    @property
    def displacements(self) -> Float[np.ndarray, "frames points 3"]:
        """Displacement [m] of the mesh points in every frame."""
        return np.stack([f.u[: self.points] for f in self.frames])

    @property
    def contact_forces(self) -> Float[np.ndarray, "frames 3"]:
        """Total force of the obstacles on the body [N] in every frame: two plates cancel."""
        return np.stack([f.contact_force.sum(axis=0) for f in self.frames])

    @property
    def obstacle_forces(self) -> Float[np.ndarray, "frames obstacles 3"]:
        """Force of every obstacle on the body [N] in every frame."""
        return np.stack([f.obstacle_force for f in self.frames])

    @property
    def piece_forces(self) -> dict[tuple[int, int], Float[np.ndarray, "frames 3"]]:
        """Force [N] on one piece by another, by their numbers, in every frame."""
        out: dict[tuple[int, int], np.ndarray] = {}
        for i, frame in enumerate(self.frames):
            for on, by, force in frame.piece_forces:
                out.setdefault((on, by), np.zeros((len(self.frames), 3)))[i] = force
        return dict(sorted(out.items()))

    @property
    def largest_pressures(self) -> ContactPressures | None:
        """Largest contact pressures [Pa] ever, where they are known."""
        known = [frame.pressures for frame in self.frames if frame.pressures is not None]
        if not known:
            return None
        obstacles = np.max([pressures.obstacles for pressures in known], axis=0)
        return ContactPressures(obstacles, max(pressures.own for pressures in known))

    @property
    def smallest_gap(self) -> float:
        """Smallest distance from obstacles and itself [m] ever; positive means no penetration."""
        return min(f.gap for f in self.frames)


@dataclass(frozen=True, eq=False)
class Modes:
    """Natural vibrations, the slowest first; rigid motions are left out.

    Parameters
    ----------
    frequencies
        Frequencies [Hz], shape (modes,).
    shapes
        Nodes' displacement of unit modal mass, shape (modes, nodes, 3); the mesh points come first.
    residual
        Largest |K x - w^2 M x| / |w^2 M x| of the modes, with w at least a wave's across the body.
    order, loaded
        Order of the elements; whether they are those of the body under its load.
    free, held
        Names of what nothing stops, and is no vibration: 'about z', 'along x', ...; whether
        anything holds the body.
    error
        Relative error [1] of the first frequency by the mesh, of quadratic elements; NaN: not made.

    Examples
    --------
    >>> import numpy as np
    >>> from autophyx_tet.fem import ElementMaterial, box_mesh, natural_modes
    >>> block = box_mesh((1, 1, 1), (1, 1, 1))
    >>> block = block.with_material(ElementMaterial.uniform(6, E=1e6, nu=0.0, rho=1e3))
    >>> modes = natural_modes(block, 2)
    >>> len(modes.shapes), bool((np.diff(modes.frequencies) >= 0).all())  # Hz, the slowest first
    (2, True)
    """

    frequencies: Float[np.ndarray, "modes"]
    shapes: Float[np.ndarray, "modes nodes 3"]
    residual: float
    order: int = 2
    loaded: bool = False
    free: tuple[str, ...] = ()
    held: bool = True
    error: float = np.nan


class Breakage(NamedTuple):
    """What tore in a motion of particles.

    ``judged`` is the fraction [1] of the body's volume whose tearing was followed: what has a
    strength and an energy of its cracks, and is not too stiff for the steps. Of that ``fraction``
    [1] carries less than half of its stress, in the ``parts``, about the ``place`` [m] at rest
    (NaN: nowhere). The body is in so many ``pieces``, crumbs aside, of ``pieces_before``. A crack
    costs ``crack_energy`` times what was stated [1]: more than once where the grid is too coarse.
    """

    judged: float
    fraction: float
    parts: tuple[str, ...]
    place: tuple[float, float, float]
    pieces: int
    pieces_before: int
    crack_energy: float


@dataclass(frozen=True, eq=False, kw_only=True)
class ParticleRun:
    """The particles of a motion that was found by them.

    spacing, nodes: Spacing of the grid [m] and its nodes along every axis.
    substeps, plan: Steps taken, and what was expected before them, in words.
    outside, stationary, rigid, bodies, capped: Particles that left the grid, that stand still, that
        belong to so many rigid bodies, and that were softened.
    lagrangian: Whether the weights were those at rest.
    notes, laws: What was assumed, and the laws of its matter in words.
    breakage: What tore.
    part: Region of every particle, shape (n,).
    positions, gradients: Places [m] and deformation gradients in every frame, (frames, n, 3) and
        (frames, n, 3, 3).
    left: Particles that have left the grid until every frame, shape (frames, n).
    """

    spacing: float
    nodes: tuple[int, int, int]
    substeps: int
    plan: str
    outside: int
    stationary: int
    rigid: int
    bodies: int
    capped: int
    lagrangian: bool
    notes: tuple[str, ...]
    laws: tuple[str, ...]
    breakage: Breakage
    part: Int[np.ndarray, "n"]
    positions: Float[np.ndarray, "frames n 3"]
    gradients: Float[np.ndarray, "frames n 3 3"]
    left: Bool[np.ndarray, "frames n"]


# Beyond this share a reduced motion is not that of the full body.
MOTION_LIMIT = 0.05
# Linear elements bend as quadratic ones do while they are less than this many times as stiff.
BENDS_ALIKE = 1.1


class ModelError(NamedTuple):
    """Error of a motion, estimated beside it.

    ``share`` [1] is over the motion, all frames together in the norm of mass, ``largest`` [m] that
    of a point in a frame.
    """

    share: float
    largest: float

    @property
    def words(self) -> str:
        """The error in a few words."""
        return Note("result.about_motion", share=100 * self.share, largest=self.largest)


def too_coarse(stiffening: float) -> str | None:
    """Say that linear elements are so many times too stiff [1] in bending; None where not."""
    if not stiffening > BENDS_ALIKE:
        return None
    return Note("result.mesh_too", stiffening=stiffening)


# A body strained by this share has an energy that is worth no word.
UNSEEN = 1e-10


class EnergyBalance(NamedTuple):
    """Energies of a motion [J].

    ``given`` is what it had at the start and what loads and moving obstacles put in, at most at any
    time; ``excess`` what it had beyond what it was given until then, at most; ``lost`` what is
    missing at the end. Of that ``dropped`` went in one frame, the one that ends at ``time`` [s].
    """

    given: float
    excess: float
    lost: float
    dropped: float
    time: float


def energy_balance(motion: MotionResult, scene: Scene) -> EnergyBalance | None:
    """Balance of kinetic, elastic and potential energy; None where supports of particles move.

    Loads are dead, so that their work is in the potential; a moving obstacle works by its force
    over the frame, and one that stands gives nothing.
    """
    if motion.particles is not None and scene.held.values[scene.held.fixed].any():
        return None
    frames = motion.frames
    body = np.array([f.kinetic + f.elastic + f.barrier for f in frames])
    potential = np.array([f.potential for f in frames])
    given = body[0] + potential[0] - potential
    if scene.obstacles:  # work of those that move, until every frame
        speeds = np.array([obstacle.velocity for obstacle in scene.obstacles], dtype=float)
        power = np.einsum("foi,oi->f", motion.obstacle_forces, speeds)
        given += motion.dt * np.concatenate([[0.0], np.cumsum(power[1:])])
    missing = given - body
    drops = np.diff(missing)
    worst = int(np.argmax(drops)) + 1
    floor = UNSEEN**2 * float(material_of(scene.mesh).E @ scene.mesh.volumes)
    return EnergyBalance(
        max(float(given.max()), floor),
        float(max(0.0, -missing.min())),
        float(max(0.0, missing[-1])),
        float(max(0.0, drops[worst - 1])),
        frames[worst].time,
    )
