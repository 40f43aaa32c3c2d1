"""Contact with obstacles and itself: a logarithmic barrier, lagged smoothed Coulomb friction.

And what a body that only stands needs of the ground, its ``support_polygon``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ..elements.assembly import BlockMatrix, add_blocks, add_diagonal
from ..elements.forces import edge_nodes
from ..elements.space import Space
from ..errors import InputError
from ..mesh import TetMesh, barycentric, face_areas, material_of
from ..scene.obstacles import Distance, Obstacle, obstacle_middle, obstacle_size
from ..scene.up import UpAxis, up_index, up_vector
from .self_contact import (
    GAP_SHARE,
    STICK_SHARE,
    STIFFNESS_SHARE,
    ContactPressures,
    PieceForce,
    SelfContact,
    largest_pressure,
)

# The barrier acts closer than this fraction of the body's diagonal.
BARRIER_SHARE = 1e-3
# Advancement along a step that meets no obstacle within so many moves is stopped there.
ADVANCES = 60


def barrier_thickness(mesh: TetMesh) -> float:
    """Distance [m] from an obstacle at which it begins to push ``mesh``."""
    return BARRIER_SHARE * float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))


class Contact:
    """Barrier energy of the surface of a body against rigid obstacles, and against itself.

    For a site of area A at distance d < dhat the energy is k A dhat b(d / dhat) with the barrier
    b(s) = -(s - 1)^2 log s of IPC (Li et al. 2020): zero at dhat, infinite at contact.

    Raises InputError: Where an obstacle is far smaller than a face of the body.
    """

    def __init__(
        self,
        mesh: TetMesh,
        space: Space,
        obstacles: Sequence[Obstacle],
        friction: float,
        thickness: float | None = None,
        *,
        self_contact: bool = False,
    ) -> None:
        diagonal = float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
        self.thickness = thickness or barrier_thickness(mesh)
        size = space.elements.shape[1]
        E, ids = np.repeat(material_of(mesh).E, size), space.elements.ravel()
        around = np.maximum(np.bincount(ids, minlength=len(space.nodes)), 1)
        stiffness = STIFFNESS_SHARE * np.bincount(ids, E, len(space.nodes)) / around
        self.obstacles, self.friction = tuple(obstacles), friction
        self.surfaces = [
            SurfaceSites(mesh, space, stiffness * self.thickness, obstacle)
            for obstacle in self.obstacles
        ]
        self.time, self.step, self.stick = 0.0, 1.0, STICK_SHARE * diagonal
        self.lagged: list[Lagged] = []
        self.mesh, self.space = mesh, space
        self.own = SelfContact(mesh, space, self.thickness, friction) if self_contact else None
        self.acts = bool(self.surfaces) or self_contact

    @property
    def notes(self) -> tuple[str, ...]:
        """What is not kept apart."""
        return self.own.notes if self.own else ()

    def _shift(self, obstacle: int) -> np.ndarray:
        return self.time * np.asarray(self.obstacles[obstacle].velocity, dtype=float)

    def _touching(self, u: np.ndarray, margin: float) -> Iterator[tuple[int, Sites, Distance]]:
        """Number of an obstacle, sites and distances: all closer than ``margin`` [m], and more."""
        for k, surface in enumerate(self.surfaces):
            shift = self._shift(k)
            for sites in surface.near(u, shift, margin):
                x = sites.rest + sites.moved(u) - shift
                yield k, sites, self.obstacles[k].distance(x)

    def gap(self, u: np.ndarray) -> float:
        """Smallest distance [m] of any site from any obstacle, and of what touches itself."""
        smallest = self.own.gap(u) if self.own else np.inf
        for k, surface in enumerate(self.surfaces):
            shift, obstacle = self._shift(k), self.obstacles[k]
            x = surface.rest[surface.corners] + u[surface.corners] - shift
            nearest = float(obstacle.distance(x).gap.min())
            for sites in surface.near(u, shift, nearest):
                x = sites.rest + sites.moved(u) - shift
                nearest = min(nearest, float(obstacle.distance(x).gap.min()))
            smallest = min(smallest, nearest)
        return smallest

    def check_sizes(self, u: np.ndarray) -> None:
        """Raise ``InputError`` where an obstacle touches a face far larger than itself."""
        for k, surface in enumerate(self.surfaces):
            if surface.close(surface.too_large, u, self._shift(k), self.thickness).size:
                raise InputError(
                    "contact.obstacle_size",
                    k=k + 1,
                    obstacle_size=obstacle_size(self.obstacles[k]),
                    most_cells=MOST_CELLS * 2 * SPACING,
                )

    def barrier(self, u: np.ndarray) -> float:
        """Energy of the barrier [J]; infinite on contact."""
        total = self.own.barrier(u) if self.own else 0.0
        for _, sites, d in self._touching(u, self.thickness):
            s = d.gap / self.thickness
            if not (s > 0).all():
                return np.inf
            near = s < 1
            total -= float((sites.weight[near] * (s[near] - 1) ** 2 * np.log(s[near])).sum())
        return total

    def value(self, u: np.ndarray) -> float:
        """Barrier and friction energy [J]; infinite on contact."""
        own = self.own.friction_energy(u) if self.own else 0.0
        return self.barrier(u) + own + sum(lag.energy(u) for lag in self.lagged)

    def add_gradient(self, u: np.ndarray, out: np.ndarray) -> None:
        """Add the gradient [N] of the energy to ``out`` (nodes, 3)."""
        for _, sites, d in self._touching(u, self.thickness):
            sites.spread(self._slope(sites, d.gap)[:, None] * d.normal, out)
        for lag in self.lagged:
            lag.sites.spread(lag.gradient(u), out)
        if self.own:
            self.own.add_gradient(u, out)

    def hessian_blocks(self, u: np.ndarray, *, sharp: bool = False) -> tuple[np.ndarray, list]:
        """Of obstacles: ``Sites.spread_blocks`` of the Hessian [N/m]; ``sharp`` as ``Lagged``."""
        diagonal, pairs = np.zeros((len(u), 3, 3)), []
        for _, sites, d in self._touching(u, self.thickness):
            s = np.maximum(d.gap / self.thickness, 1e-300)
            bend = -2 * np.log(s) - 4 * (s - 1) / s + ((s - 1) / s) ** 2
            curve = np.where(s < 1, sites.weight * bend, 0.0) / self.thickness**2
            sites.spread_blocks(curve[:, None, None] * outer(d.normal), diagonal, pairs)
        for lag in self.lagged:
            lag.sites.spread_blocks(lag.hessian(u, sharp=sharp), diagonal, pairs)
        return diagonal, pairs

    def with_hessian(
        self, u: np.ndarray, matrix: BlockMatrix, *, sharp: bool = False
    ) -> BlockMatrix:
        """``matrix`` [N/m] and the positive part of the Hessian; ``sharp`` as for ``Lagged``.

        It is added in place but for pairs of nodes that share no tet: there the matrix grows.
        """
        if self.surfaces:
            diagonal, pairs = self.hessian_blocks(u, sharp=sharp)
            add_diagonal(matrix, diagonal)
            for i, j, blocks in pairs:
                add_blocks(matrix, i.ravel(), j.ravel(), blocks.reshape(-1, 3, 3))
        return self.own.with_hessian(u, matrix) if self.own else matrix

    def _slope(self, sites: Sites, gap: np.ndarray) -> np.ndarray:
        """Derivative of the barrier energy by the distance [N], not positive."""
        s = np.maximum(gap / self.thickness, 1e-300)
        slope = -2 * (s - 1) * np.log(s) - (s - 1) ** 2 / s
        return np.where(s < 1, sites.weight * slope, 0.0) / self.thickness

    def begin(self, u: np.ndarray, time: float, step: float) -> None:
        """Move the obstacles to ``time`` [s], the end of a ``step`` [s] that starts at ``u``."""
        self.time, self.step, self.lagged = time, step, []
        self._start = u.copy()
        if self.own:
            self.own.begin(u, step)

    def lag_friction(self, u: np.ndarray) -> None:
        """Freeze normal forces and normals at ``u`` for the friction of the next solve."""
        if self.friction == 0:
            return
        if self.own:
            self.own.lag_friction(u)
        self.lagged = [
            Lagged(
                k,
                sites,
                -self.friction * self._slope(sites, d.gap),
                d.normal,
                sites.moved(self._start) + self.step * np.asarray(self.obstacles[k].velocity),
                self.stick * self.step,
            )
            for k, sites, d in self._touching(u, self.thickness)
        ]

    def allowed(self, u: np.ndarray) -> np.ndarray:
        """``u`` with the nodes that a moving obstacle has reached carried along in front of it."""
        u = u.copy()
        for k, obstacle in enumerate(self.obstacles):
            move = self.step * np.asarray(obstacle.velocity, dtype=float)
            if not move.any():
                continue
            shift, reach = self._shift(k), self.thickness + float(np.linalg.norm(move))
            near = [*self.surfaces[k].near(u, shift, reach)]
            gaps = []
            for sites in near:
                x = sites.rest + sites.moved(u) - shift
                now, before = obstacle.distance(x), obstacle.distance(x + move)
                gaps.append(np.minimum(before.gap, 0.5 * self.thickness))
                if sites.alone:
                    push = np.maximum(gaps[-1] - now.gap, 0.0)
                    sites.spread(push[:, None] * now.normal, u)
            # Whole faces go along until half the gaps are there. One that moves as the obstacle
            # does keeps its gap; its neighbours may then have to move.
            start, carried, before = u.copy(), np.zeros(len(u), dtype=bool), -1
            while carried.sum() > before:
                before = carried.sum()
                for sites, gap in zip(near, gaps, strict=True):
                    x = sites.rest + sites.moved(u) - shift
                    carried[sites.nodes[obstacle.distance(x).gap < 0.5 * gap]] = True
                if carried.sum() > before:
                    u[carried] = start[carried] + move
        return u

    def inside(self) -> int | None:
        """Number of the first obstacle that lies wholly in the body at rest; None: there is none.

        No place of the surface is near such a one: its middle is in a tet.
        """
        corners = self.mesh.points[self.mesh.tets]
        for k, obstacle in enumerate(self.obstacles):
            if (middle := obstacle_middle(obstacle)) is None:
                continue
            around = np.flatnonzero(
                ((corners.min(axis=1) <= middle) & (middle <= corners.max(axis=1))).all(axis=1)
            )
            shares = barycentric(corners[around], middle[None])
            if (shares > -1e-9).all(axis=1).any():  # or on a face
                return k
        return None

    def swept(self, u: np.ndarray) -> bool:
        """Whether an obstacle meets the body at ``u`` [m] within the step, which is too long then.

        It moves by more than half of its size, and is looked at as often on its way.
        """
        for k, obstacle in enumerate(self.obstacles):
            move = self.step * np.asarray(obstacle.velocity, dtype=float)
            parts = int(np.ceil(2 * np.linalg.norm(move) / obstacle_size(obstacle)))
            for part in range(parts + 1 if parts > 1 else 0):
                shift = self._shift(k) - part / parts * move
                for sites in self.surfaces[k].near(u, shift, self.thickness):
                    x = sites.rest + sites.moved(u) - shift
                    if (obstacle.distance(x).gap <= 0).any():
                        return True
        return False

    def longest_step(self, u: np.ndarray, step: np.ndarray) -> float:
        """Largest fraction of ``step`` that leaves a tenth of every gap, by safe advancement.

        Distance changes no faster than position, so a site may always move by its distance.
        """
        fraction = self.own.longest_step(u, step) if self.own else 1.0
        farthest = np.linalg.norm(step, axis=1).max() / GAP_SHARE if self.surfaces else 0.0
        for k, sites, first in self._touching(u, farthest):
            p = sites.moved(step)
            speed = np.linalg.norm(p, axis=1)
            at_risk = np.flatnonzero(GAP_SHARE * first.gap < speed)
            if not at_risk.size:
                continue
            done = np.zeros(len(at_risk))
            floor = (1 - GAP_SHARE) * first.gap[at_risk]
            here = (sites.rest + sites.moved(u) - self._shift(k))[at_risk]
            for _ in range(ADVANCES):
                d = self.obstacles[k].distance(here + done[:, None] * p[at_risk])
                room = np.maximum(d.gap - floor, 0.0) / np.maximum(speed[at_risk], 1e-300)
                done = np.minimum(done + room, 1.0)
                if (room < 1e-3 * np.maximum(done, 1e-12)).all() or (done >= 1).all():
                    break
            fraction = min(fraction, float(done.min()))
        return fraction

    def obstacle_forces(self, u: np.ndarray) -> np.ndarray:
        """Force of every obstacle on the body [N], shape (obstacles, 3)."""
        total = np.zeros((len(self.obstacles), 3))
        for k, sites, d in self._touching(u, self.thickness):
            total[k] -= (self._slope(sites, d.gap)[:, None] * d.normal).sum(axis=0)
        for lag in self.lagged:
            total[lag.obstacle] -= lag.gradient(u).sum(axis=0)
        return total

    def rubbed(self, u: np.ndarray) -> float:
        """Energy [J] that friction took in the step that ends at ``u``."""
        own = self.own.rubbed(u) if self.own else 0.0
        return own + sum(float((lag.gradient(u) * lag.slip(u)[0]).sum()) for lag in self.lagged)

    def pressures(self, u: np.ndarray) -> ContactPressures:
        """Largest contact pressures [Pa] at ``u``, without friction."""
        pushes = np.zeros((len(self.obstacles) + 1, *u.shape))
        for k, sites, d in self._touching(u, self.thickness):
            sites.spread(-self._slope(sites, d.gap)[:, None] * d.normal, pushes[k])
        if self.own:
            pushes[-1, self.own.nodes] = -self.own.push(u)
        largest = np.array(
            [largest_pressure(self.mesh, self.space, u, pushes[k]) for k in range(len(pushes))]
        )
        return ContactPressures(largest[:-1], float(largest[-1]))

    def piece_forces(self, u: np.ndarray) -> tuple[PieceForce, ...]:
        """Force of every piece on every other that it touches."""
        return self.own.piece_forces(u) if self.own else ()

    def forces(self, u: np.ndarray, count: int) -> np.ndarray:
        """Force of obstacles and other faces on every node [N], shape (count, 3)."""
        out = np.zeros((count, 3))
        self.add_gradient(u, out)
        return -out


# Sites of contact are the nodes where faces are small against the obstacle. A face that is large
# against it gets a lattice of further places, apart by at most this fraction of its size: a ball
# of radius R that sits between three of them is s^2 / 6 R = R / 100 inside the face.
SPACING = 0.25
# Most places along the edge of a face: smaller obstacles are refused.
MOST_CELLS = 64


class Sites(NamedTuple):
    """Places ``rest`` (n, 3) [m] that move with fractions ``alpha`` (n, k) of ``nodes`` (n, k).

    ``weight`` (n,) [J] is stiffness times area times thickness.
    """

    nodes: Int[np.ndarray, "n k"]
    alpha: Float[np.ndarray, "n k"]
    rest: Float[np.ndarray, "n 3"]
    weight: Float[np.ndarray, "n"]

    @property
    def alone(self) -> bool:
        """Whether every place is a node, and no node is there twice."""
        return self.nodes.shape[1] == 1

    def moved(self, u: np.ndarray) -> Float[np.ndarray, "n 3"]:
        """Value of the nodal field ``u`` (nodes, 3) at the places."""
        if self.alone:
            return u[self.nodes[:, 0]]
        return np.einsum("nk,nkd->nd", self.alpha, u[self.nodes])

    def spread(self, values: Float[np.ndarray, "n 3"], out: np.ndarray) -> None:
        """Add ``values`` at the places to the nodes of ``out`` (nodes, 3)."""
        if self.alone:
            out[self.nodes[:, 0]] += values
        else:
            np.add.at(out, self.nodes, self.alpha[:, :, None] * values[:, None])

    def spread_blocks(
        self, blocks: Float[np.ndarray, "n 3 3"], diagonal: np.ndarray, pairs: list
    ) -> None:
        """Add ``blocks`` to the ``diagonal`` (nodes, 3, 3), or couplings to ``pairs``."""
        if self.alone:
            diagonal[self.nodes[:, 0]] += blocks
            return
        near = np.flatnonzero(np.abs(blocks).max(axis=(1, 2)) > 0)
        if not near.size:
            return
        nodes, alpha = self.nodes[near], self.alpha[near]
        i, j = np.broadcast_arrays(nodes[:, :, None], nodes[:, None, :])
        both = alpha[:, :, None] * alpha[:, None, :]
        pairs.append((i, j, both[..., None, None] * blocks[near, None, None]))


class SurfaceSites:
    """Sites of a body against one obstacle.

    mesh, space: The body and its nodes.
    stiffness: Barrier stiffness times thickness at every node [J/m^2], shape (nodes,).
    obstacle: What it shall keep out of.
    """

    def __init__(
        self, mesh: TetMesh, space: Space, stiffness: Float[np.ndarray, "nodes"], obstacle: Obstacle
    ) -> None:
        self.obstacle, self.rest = obstacle, space.nodes
        faces = mesh.boundary.faces
        self.corners = np.unique(faces)
        areas = face_areas(mesh.points, faces)
        corners = mesh.points[faces]
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        nodes = faces
        if space.order == 2:
            nodes = np.hstack([faces, edge_nodes(space, faces[:, [[0, 1], [1, 2], [2, 0]]])])
        spacings = np.maximum(longest / (SPACING * obstacle_size(obstacle)), space.order)
        cells = np.minimum(2 ** np.ceil(np.log2(spacings)), MOST_CELLS).astype(int)
        plain = cells == space.order
        self.too_large = nodes[spacings > 2 * MOST_CELLS]
        # Nodes of faces that need no more places, each with its part of their area
        parts = np.array([1 / 3] * 3 if space.order == 1 else [1 / 12] * 3 + [1 / 4] * 3)
        area = np.zeros(len(space.nodes))
        np.add.at(area, nodes[plain], areas[plain, None] * parts)
        ids = np.flatnonzero(area > 0)
        weight = stiffness[ids] * area[ids]
        self.nodal = Sites(ids[:, None], np.ones((len(ids), 1)), space.nodes[ids], weight)
        # Faces with the same lattice: nodes (faces, k), stiffness (faces,) [J] and the lattice. A
        # place is as stiff as a corner of the face: few of them carry what presses a flat face.
        self.groups: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        for count in np.unique(cells[~plain]).tolist():
            own = cells == count
            mean = stiffness[faces[own]].mean(axis=1)
            lattice = face_lattice(count, nodes.shape[1])
            self.groups.append((nodes[own], mean * areas[own] / 3, lattice))

    def near(self, u: np.ndarray, shift: np.ndarray, margin: float) -> Iterator[Sites]:
        """Sites of the displaced body, all that are closer than ``margin`` [m] among them.

        ``shift`` (3,) [m] is how far the obstacle has moved.
        """
        if len(self.nodal.nodes):
            yield self.nodal
        for faces, stiffness, lattice in self.groups:
            close = self.close(faces, u, shift, margin)
            if close.size:
                nodes = np.repeat(faces[close], len(lattice), axis=0)
                alpha = np.tile(lattice, (len(close), 1))
                rest = np.einsum("nk,nkd->nd", alpha, self.rest[nodes])
                yield Sites(nodes, alpha, rest, np.repeat(stiffness[close], len(lattice)))

    def close(self, faces: np.ndarray, u: np.ndarray, shift: np.ndarray, margin: float):
        """Indices of all ``faces`` (faces, k) that are closer than ``margin``, and of more."""
        corners = self.rest[faces] + u[faces]
        centre = corners.mean(axis=1)
        reach = np.linalg.norm(corners - centre[:, None], axis=2).max(axis=1)
        # A curved face leaves the ball around its nodes by less than its reach.
        return np.flatnonzero(self.obstacle.distance(centre - shift).gap < margin + 2 * reach)


def face_lattice(cells: int, nodes: int) -> Float[np.ndarray, "places nodes"]:
    """Shares of the 3 or 6 ``nodes`` of a triangle in its places, ``cells`` along an edge."""
    i, j = (k.ravel() for k in np.indices((cells + 1, cells + 1)))
    b = np.stack([i, j, cells - i - j], axis=1)[i + j <= cells] / cells
    return np.hstack([b * (2 * b - 1), 4 * b * np.roll(b, -1, axis=1)]) if nodes == 6 else b


# Smoothed Coulomb friction (Li et al. 2020, IPC), its normal forces frozen during a solve.


class Lagged(NamedTuple):
    """Friction of one obstacle, frozen during a solve.

    ``force`` (n,) is the coefficient times the normal force [N] at the ``sites``, ``normal``
    (n, 3) its direction, ``start`` (n, 3) [m] the displacement from which sliding is counted,
    ``limit`` [m] the slip below which it sticks, ``obstacle`` the number of that one.
    """

    obstacle: int
    sites: Sites
    force: np.ndarray
    normal: np.ndarray
    start: np.ndarray
    limit: float

    def slip(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Tangential slip y (n, 3) [m] at ``u`` [m], f1(|y|) / |y| [1/m] and f0(|y|) [m]."""
        y = self.sites.moved(u) - self.start
        y = y - (y * self.normal).sum(axis=1, keepdims=True) * self.normal
        size, limit = np.linalg.norm(y, axis=1), self.limit
        inside = size < limit
        over = np.where(inside, (2 - size / limit) / limit, 1 / np.maximum(size, limit))
        potential = np.where(inside, size**2 / limit - size**3 / (3 * limit**2) + limit / 3, size)
        return y, over, potential

    def gradient(self, u: np.ndarray) -> np.ndarray:
        """Derivative of the potential by the place of every site [N], shape (n, 3)."""
        y, over, _ = self.slip(u)
        return (self.force * over)[:, None] * y

    def energy(self, u: np.ndarray) -> float:
        """Potential of friction [J]."""
        return float((self.force * self.slip(u)[2]).sum())

    def hessian(self, u: np.ndarray, *, sharp: bool) -> np.ndarray:
        """Positive second derivative at every site [N/m], shape (n, 3, 3).

        A bound, with which Newton creeps but never overshoots; ``sharp``: friction's own, with
        which it arrives at once from near by.
        """
        y, over, _ = self.slip(u)
        flat = over[:, None, None] * (np.eye(3) - outer(self.normal))
        if sharp:  # a slide is pushed back across its direction only
            size = np.linalg.norm(y, axis=1)
            along = y / np.where(size > 0, size, 1.0)[:, None]
            bend = np.where(size < self.limit, 2 * (1 - size / self.limit) / self.limit, 0.0) - over
            flat += bend[:, None, None] * outer(along)
        return self.force[:, None, None] * flat


def outer(n: np.ndarray) -> np.ndarray:
    """Outer product of every row (n, 3) with itself, (n, 3, 3)."""
    return n[:, :, None] * n[:, None, :]


class SupportPolygon(NamedTuple):
    """What a body that only stands on level ground needs of it.

    The load meets the ground ``inside`` [m] its feet, outside where negative: then it tips over.
    ``friction`` is the least coefficient [1] at which it does not slide; infinite where it lifts.
    """

    inside: float
    friction: float


def support_polygon(
    feet: Float[np.ndarray, "n 3"],
    force: Float[np.ndarray, "3"],
    moment: Float[np.ndarray, "3"],
    up: UpAxis,
) -> SupportPolygon:
    """Foothold of a rigid body on level ground along the axis ``up`` below its ``feet`` [m].

    ``force`` [N] is that of all loads, ``moment`` [N m] theirs about the origin. A rigid body on
    such ground is at rest if and only if its load meets the ground within the convex hull of its
    feet, as there pressures alone balance it.
    """
    z, upwards = up_index(up), up_vector(up)
    x, y = (z + 1) % 3, (z + 2) % 3
    if force @ upwards >= 0:
        return SupportPolygon(-np.inf, np.inf)
    base = (feet @ upwards).min() * upwards
    about = moment - np.cross(base, force)
    place = np.array([-about[y], about[x]]) / force[z]
    slides = float(np.hypot(force[x], force[y]) / abs(force[z]))
    from scipy.spatial import ConvexHull, QhullError

    try:
        sides = ConvexHull(feet[:, [x, y]]).equations
    except QhullError:  # feet on a line hold nothing upright
        inside = -float(np.linalg.norm(feet[:, [x, y]] - place, axis=1).min())
    else:  # outside it is a bound
        inside = float(-(sides[:, :2] @ place + sides[:, 2]).max())
    return SupportPolygon(inside, slides)
