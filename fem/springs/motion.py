"""Anchors in motion: explicit steps as long as the network's highest frequency allows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float

from ..device import start_warp
from ..elements.assembly import BlockMatrix
from ..errors import ConvergenceError, InputError
from ..linalg.cholesky import CholeskyFactor, planned_elimination
from ..scene.obstacles import Plane
from .network import SpringNetwork

# Fraction of the longest stable step at rest: springs turn and stretch on the way.
SAFE = 0.8
# The same where planes are met: contact that comes and goes shakes the fastest vibrations. A cube
# that planes squeeze by 15 % made 8 to 28 % of its energy of nothing at .7 and .8, .1 % at .6.
IN_CONTACT = 0.5
# Energy that a network may hold over what was put into it: steps of .8 show up to 2.8 times too
# much in the fastest vibration. Rounding is worth this fraction of its stiffness times length
# squared.
EXCESS, ROUNDING = 10.0, 1e-20


@dataclass(eq=False, kw_only=True)
class SpringMotion:
    """A network in motion from rest, or from a ``velocity`` [m/s].

    Springs have a ``stiffness`` [N/m] and, for a speed of their ends, a ``dashpot`` [N s/m];
    ``loads`` act on the anchors, ``contact`` pushes the surface.
    """

    network: SpringNetwork
    stiffness: Float[np.ndarray, "springs"]
    dashpot: Float[np.ndarray, "springs"] | None = None
    loads: AnchorLoads | None = None
    contact: SurfaceContact | None = None
    velocity: Float[np.ndarray, "n 3"] | None = None
    steps: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        anchors = self.network.anchors
        heavy = anchors.mass > 0
        inverse = np.where(heavy, 1 / np.where(heavy, anchors.mass, 1.0), 0.0)
        self.inverse_mass = np.where(anchors.fixed, 0.0, inverse[:, None])
        self._upload()
        # Longest step: 2 / w at the highest frequency, less what dashpots take
        springs, contact = self.network.matrix(self.stiffness), self.contact
        ground = 0.0 if self.loads is None else self.loads.ground

        def force(u: np.ndarray) -> np.ndarray:
            inner = (springs @ u.ravel()).reshape(u.shape) + ground * u
            if contact is None:
                return inner
            W = contact.weights
            return inner + W.T @ (contact.stiffness[:, None] * (W @ u))

        highest = highest_frequency(self.inverse_mass, force)
        self.longest_step = 2 / highest
        if self.dashpot is not None and self.dashpot.any():
            drag = self.network.matrix(self.dashpot)
            dragged = highest_frequency(
                self.inverse_mass, lambda u: (drag @ u.ravel()).reshape(u.shape)
            )
            damping = 0.5 * dragged**2 / highest
            self.longest_step *= np.sqrt(1 + damping**2) - damping
        # Energy put in: at the start, of rounding, and of the surface at the planes' reach
        self._input = self._kinetic + self.elastic
        self._input += ROUNDING * float(self.stiffness @ self.network.length**2)
        if self.contact is not None:
            depths = len(self.contact.planes) * self.contact.reach**2
            self._input += 0.5 * float(self.contact.stiffness.sum()) * depths
        self._work = 0.0

    def _upload(self) -> None:
        """Springs, contacts and the state as structs of warp."""
        from . import kernels_springs as k

        wp, device = start_warp(), "cpu"

        def ints(values: np.ndarray) -> Any:
            return wp.array(np.asarray(values, dtype=np.int32), dtype=int, device=device)

        def reals(values: np.ndarray) -> Any:
            return wp.array(np.asarray(values, dtype=float), dtype=wp.float64, device=device)

        def vectors(values: np.ndarray) -> Any:
            return wp.array(np.ascontiguousarray(values), dtype=wp.vec3d, device=device)

        net, anchors = self.network, self.network.anchors
        start = anchors.x + np.where(anchors.fixed, anchors.values, 0.0)
        velocity = np.zeros_like(start) if self.velocity is None else self.velocity
        order = np.argsort(net.i, kind="stable")
        dashpot = np.zeros_like(self.stiffness) if self.dashpot is None else self.dashpot
        loads = self.loads or AnchorLoads(force=0 * start, ground=0 * start)
        springs = self._springs = k.Springs()
        springs.first = ints(np.searchsorted(net.i[order], np.arange(len(start) + 1)))
        springs.other, springs.dashpot = ints(net.j[order]), reals(dashpot[order])
        springs.stiffness, springs.length = reals(self.stiffness[order]), reals(net.length[order])
        springs.load, springs.ground = vectors(loads.force), vectors(loads.ground)
        springs.inverse_mass, springs.rest = vectors(self.inverse_mass), vectors(anchors.x)

        contact, contacts = self.contact, k.Contacts()
        self._contacts, points, planes = contacts, 0, 0
        if contact is not None:
            points, planes = len(contact.points), len(contact.planes)
            rows, stiffness = contact.weights.tocsr(), contact.stiffness
            contacts.first, contacts.anchor = ints(rows.indptr), ints(rows.indices)
            contacts.weight = reals(rows.data)
            contacts.rest = vectors(contact.points - contact.weights @ anchors.x)
            contacts.stiffness, contacts.grip = reals(stiffness), reals(0 * stiffness)
            normals = np.array([plane.normal for plane in contact.planes], dtype=float)
            contacts.normal = vectors(normals / np.linalg.norm(normals, axis=1, keepdims=True))
            contacts.place = vectors(np.array([p.point for p in contact.planes], dtype=float))
            contacts.speed = vectors(np.array([p.velocity for p in contact.planes], dtype=float))
            contacts.reach = wp.float64(contact.reach)
            contacts.friction = wp.float64(contact.friction)

        now = self._now = k.Now()
        now.x, now.a = vectors(start), vectors(0 * start)
        now.v = vectors(np.where(self.inverse_mass > 0, velocity, 0.0))
        now.push = vectors(np.zeros((points, 3)))
        now.impulse = vectors(np.zeros((points * planes, 3)))
        now.clock = reals(np.zeros(2))

    @property
    def x(self) -> Float[np.ndarray, "n 3"]:
        """Positions of the anchors [m]."""
        return self._now.x.numpy().copy()

    @property
    def v(self) -> Float[np.ndarray, "n 3"]:
        """Velocities of the anchors [m/s], half a step before the positions."""
        return self._now.v.numpy().copy()

    @property
    def a(self) -> Float[np.ndarray, "n 3"]:
        """Accelerations of the anchors [m/s^2] where they are now."""
        from . import kernels_springs as k

        inputs = [self._springs, self._contacts, self._now]
        start_warp().launch(k.balance, 1, inputs=inputs, device="cpu")
        return self._now.a.numpy().copy()

    @property
    def synchronous_v(self) -> Float[np.ndarray, "n 3"]:
        """Velocities of the anchors [m/s] at the time of the positions."""
        return self.v + 0.5 * float(self._now.clock.numpy()[1]) * self.a

    @property
    def elastic(self) -> float:
        """Elastic energy of the springs [J]."""
        network, x, square = self.network, self.x, 0.0
        stretch = np.linalg.norm(x[network.j] - x[network.i], axis=1) - network.length
        if self.loads is not None:
            square = float((self.loads.ground * (x - network.anchors.x) ** 2).sum())
        return 0.5 * (float(self.stiffness @ stretch**2) + square)

    def take_impulses(self) -> Float[np.ndarray, "points planes 3"]:
        """Momentum [N s] that every plane gave every point of the surface since asked last."""
        planes = 0 if self.contact is None else len(self.contact.planes)
        impulses = self._now.impulse.numpy().copy()
        self._now.impulse.zero_()
        return impulses.reshape(-1, max(planes, 1), 3)[:, :planes]

    def advance(self, duration: float, *, steps: int | None = None) -> None:
        """Follow the network for ``duration`` [s], by default in steps that are safely stable.

        Raises ConvergenceError: Where the steps turn out unstable: more energy is there than loads
            and planes gave.
        """
        from . import kernels_springs as k

        wp = start_warp()
        count, pushed = steps or self.steps_for(duration), self._now.impulse.numpy().copy()
        dt, clock = duration / count, self._now.clock
        clock.assign(np.array([clock.numpy()[0], dt]))
        if self.contact is not None:
            self._contacts.grip.assign(self.contact.grip(self.inverse_mass.max(axis=1), dt))
        state = [self._springs, self._contacts, self._now]
        wp.launch(k.follow, 1, inputs=[count, *state], device="cpu")
        self.steps += count
        # Raise where the energy cannot come from the start, the loads and what planes `pushed`
        with np.errstate(over="ignore", invalid="ignore"):
            if self.contact is not None:
                speeds = np.array([plane.velocity for plane in self.contact.planes], dtype=float)
                self._work += float(
                    ((self._now.impulse.numpy() - pushed).reshape(-1, *speeds.shape) * speeds).sum()
                )
            moved = self.x - self.network.anchors.x
            by_loads = 0.0 if self.loads is None else np.abs(self.loads.force * moved).sum()
            given = self._input + by_loads + abs(self._work)
            energy = self._kinetic + self.elastic
        if not energy <= EXCESS * given:
            raise ConvergenceError(
                "motion.springs_hold",
                energy=energy,
                numpy=float(self._now.clock.numpy()[0]),
                given=given,
            )

    @property
    def _kinetic(self) -> float:
        """Kinetic energy [J] half a step before the positions."""
        return 0.5 * float(self.network.anchors.mass @ (self.v**2).sum(axis=1))

    def steps_for(self, duration: float) -> int:
        """How many steps ``duration`` [s] takes."""
        fraction = SAFE if self.contact is None else IN_CONTACT
        return max(1, int(np.ceil(duration / (fraction * self.longest_step))))


# What meets a network from outside: loads of its anchors, planes against its surface.


@dataclass(frozen=True, eq=False, kw_only=True)
class SurfaceContact:
    """Points of the surface that planes push, and the anchors that they follow.

    ``points`` [m] at rest, their ``weights`` of the anchors (sparse) and ``stiffness`` [N/m] of a
    depth; the ``planes``, their Coulomb ``friction`` [1], and from how far they push, ``reach``
    [m].
    """

    points: Float[np.ndarray, "points 3"]
    weights: Any
    stiffness: Float[np.ndarray, "points"]
    planes: tuple[Plane, ...]
    friction: float = 0.0
    reach: float = 0.0

    def grip(self, inverse_mass: Float[np.ndarray, "anchors"], dt: float) -> np.ndarray:
        """Rubbing [N s/m] that stops no point beyond rest in a step, all of them together."""
        size = abs(self.weights)
        crowd = size.T @ np.ones(len(self.points))
        return 1 / np.maximum(dt * (size @ (crowd * inverse_mass)), 1e-300)


@dataclass(frozen=True, eq=False, kw_only=True)
class AnchorLoads:
    """What acts on anchors beside springs, each of shape (n, 3).

    ``force`` [N] is constant, ``ground`` [N/m] are springs to where they rest.
    """

    force: Float[np.ndarray, "n 3"]
    ground: Float[np.ndarray, "n 3"]


# Frequencies of a network at rest: the lowest tell its stiffness, the highest its steps.

# Free bodies: rigid motions, and the shift [over the mean square of the frequencies] that makes
# their matrix regular.
RIGID, SHIFT = 6, 1e-9
# Relative error of the highest frequency's square; below so many unknowns it is exact.
PRECISE, DENSE = 1e-3, 64


def network_frequencies(
    network: SpringNetwork, stiffness: Float[np.ndarray, "springs"], count: int = 1
) -> Float[np.ndarray, "count"]:
    """First ``count`` natural frequencies [Hz] with springs of ``stiffness`` [N/m], rising.

    Without anything held, the six rigid motions are left out.
    """
    from scipy.sparse import diags_array
    from scipy.sparse.linalg import LinearOperator, eigsh

    anchors, wp = network.anchors, start_warp()
    free = ~anchors.fixed & (anchors.mass > 0)[:, None]
    skipped = 0 if anchors.fixed.any() else RIGID
    if count + skipped >= free.sum():
        raise InputError("motion.frequencies_unknowns", count=count, count_2=free.sum())
    heavy = np.where(anchors.mass > 0, anchors.mass, np.inf)
    root = diags_array((free / np.sqrt(heavy)[:, None]).ravel())
    scaled = root @ network.matrix(stiffness) @ root
    typical = float(scaled.diagonal()[free.ravel()].mean())
    shift = SHIFT * typical
    shifted = scaled + diags_array(np.where(free, shift, typical).ravel())
    blocks = shifted.tobsr((3, 3)).sorted_indices()
    rows, columns = (
        wp.array(a, dtype=wp.int32, device="cpu") for a in (blocks.indptr, blocks.indices)
    )
    matrix = BlockMatrix(rows, columns, wp.array(blocks.data, dtype=wp.mat33d, device="cpu"))
    factor = CholeskyFactor(matrix, planned_elimination(matrix))

    def inverse(x: np.ndarray) -> np.ndarray:
        return free.ravel() * factor.solve(x.reshape(-1, 3)).ravel()

    operator = LinearOperator((free.size,) * 2, matvec=inverse, dtype=float)  # type: ignore
    start = np.random.default_rng(0).normal(size=free.size) * free.ravel()
    inverses = eigsh(operator, k=count + skipped, v0=start, return_eigenvectors=False)
    square = np.sort(1 / np.asarray(inverses))[skipped:] - shift
    return np.sqrt(np.maximum(square, 0.0)) / (2 * np.pi)


def highest_frequency(
    inverse_mass: Float[np.ndarray, "n 3"], force: Callable[[np.ndarray], np.ndarray]
) -> float:
    """Highest angular frequency [1/s] of masses whose ``inverse_mass`` [1/kg] is zero where held.

    ``force`` [N] (n, 3) is that of a displacement [m] (n, 3), linear and symmetric. By Lanczos'
    method: the plain power iteration ends well below it.
    """
    from scipy.sparse.linalg import LinearOperator, eigsh

    root = np.sqrt(inverse_mass)

    def times(v: np.ndarray) -> np.ndarray:
        return (root * force(root * v.reshape(root.shape))).ravel()

    if root.size <= DENSE:
        dense = np.stack([times(axis) for axis in np.eye(root.size)])
        return float(np.sqrt(np.linalg.eigvalsh(dense)[-1]))
    operator = LinearOperator((root.size,) * 2, matvec=times, dtype=float)  # type: ignore
    options: dict[str, Any] = {"tol": PRECISE, "return_eigenvectors": False}
    start = np.random.default_rng(0).normal(size=root.size)
    return float(np.sqrt(eigsh(operator, k=1, which="LA", v0=start, **options)[0]))
