"""The network: which anchors are joined, and how stiff each spring is.

After Spring-Gaus (Zhong et al. 2024): an anchor draws at its K nearest with weights of one number
eta. Here a pair is one spring, in SI, so that forces balance, and k follows from E: a spring of
stiffness s and length l gives the isotropic average E = sum s l^2 / 6 V at nu = 1/4 (Cauchy).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from ..device import start_warp
from ..errors import InputError
from ..mesh import FACES, TetMesh, boundary_faces, face_areas, material_of, point_components
from ..scene.supports import Supports

# Poisson's ratio of a network of central forces that is alike in all directions.
CAUCHY_NU = 0.25
# Nearest neighbours that always count; eta weighs the others.
ALWAYS = 16
# Neighbours are sought among so many times as many anchors: what is not seen is left out.
CANDIDATES = 3
# Springs that join what would fall apart.
BRIDGES = 6


def neighbour_weights(eta: float, neighbours: int) -> Float[np.ndarray, "neighbours"]:
    """Weight of the neighbour of every rank: clip(2 - softplus(eta)^i, 0, 1), i = 0 ... 1."""
    rest = max(neighbours - ALWAYS, 0)
    power = np.arange(rest) / max(rest, 1)
    far = np.clip(2 - np.exp(np.log(np.logaddexp(0.0, eta)) * power), 0, 1)
    return np.concatenate([np.ones(min(ALWAYS, neighbours)), far])


@dataclass(frozen=True, eq=False, kw_only=True)
class SpringNetwork:
    """Springs between ``anchors``, each once, from ``i`` to a larger ``j``.

    ``rank_i`` is the rank of j among the neighbours of i, ``rank_j`` that of i among those of j, -1
    where it is none of them; an anchor has ``neighbours`` at most. ``bridges`` springs leave the
    tets because something would fall apart without them.
    """

    anchors: Anchors
    i: Int[np.ndarray, "springs"]
    j: Int[np.ndarray, "springs"]
    rank_i: Int[np.ndarray, "springs"]
    rank_j: Int[np.ndarray, "springs"]
    neighbours: int
    bridges: int = 0

    @classmethod
    def of(cls, anchors: Anchors, neighbours: int, surface: LineOfSight) -> SpringNetwork:
        """Join every anchor with its ``neighbours`` nearest ones that it sees inside the body."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components
        from scipy.spatial import KDTree

        x, body, count = anchors.x, anchors.body, len(anchors.x)
        if not 3 < neighbours < count:
            raise InputError(
                "network.neighbours_anchors", neighbours=neighbours, count=count, count_2=count - 1
            )
        # Of the nearest candidates those that are seen, by rank
        wide = min(CANDIDATES * neighbours, count - 1)
        b = np.asarray(KDTree(x).query(x, wide + 1)[1])[:, 1:]
        a = np.repeat(np.arange(count), wide).reshape(b.shape)
        key, pair = np.unique(np.minimum(a, b) * count + np.maximum(a, b), return_inverse=True)
        i, j = key // count, key % count
        good = (body[i] == body[j]) & ~surface.crossed(x[i], x[j])
        seen = good[pair].reshape(b.shape)
        rank = np.cumsum(seen, axis=1) - 1
        seen &= rank < neighbours
        a, b, rank = a[seen], b[seen], rank[seen]
        # Every pair once, with its rank at both ends
        key, spring = np.unique(np.minimum(a, b) * count + np.maximum(a, b), return_inverse=True)
        i, j = key // count, key % count
        ranks = np.full((2, len(key)), -1)
        ranks[(a > b).astype(int), spring] = rank
        # Shortest pairs that join what the springs leave apart but tets hold together
        bridges = [np.zeros((0, 2), dtype=np.int64)]
        graph = coo_array((np.ones(len(i), dtype=np.int8), (i, j)), shape=(count, count))
        piece = connected_components(graph, directed=False)[1]
        for name in np.unique(body):
            while len(pieces := np.unique(piece[body == name])) > 1:
                sizes = np.bincount(piece, minlength=count)[pieces]
                inner = np.flatnonzero(piece == pieces[np.argmin(sizes)])
                outer = np.flatnonzero((body == name) & (piece != piece[inner[0]]))
                many = min(BRIDGES, len(outer))
                far, near = KDTree(x[outer]).query(x[inner], k=many)
                best = np.argsort(far.reshape(-1), kind="stable")[:BRIDGES]
                ends = outer[near.reshape(-1)[best]]
                pairs = np.stack([inner.repeat(many)[best], ends], axis=1)
                bridges.append(np.sort(pairs, axis=1))
                piece[np.isin(piece, piece[ends])] = piece[inner[0]]
        bridge = np.concatenate(bridges)
        ranks = np.pad(ranks, ((0, 0), (0, len(bridge))))  # as near as the nearest
        return cls(
            anchors=anchors,
            i=np.concatenate([i, bridge[:, 0]]),
            j=np.concatenate([j, bridge[:, 1]]),
            rank_i=ranks[0],
            rank_j=ranks[1],
            neighbours=neighbours,
            bridges=len(bridge),
        )

    @cached_property
    def length(self) -> Float[np.ndarray, "springs"]:
        """Lengths at rest [m]."""
        x = self.anchors.x
        return np.linalg.norm(x[self.j] - x[self.i], axis=1)

    @cached_property
    def direction(self) -> Float[np.ndarray, "springs 3"]:
        """Unit vectors from i to j at rest."""
        x = self.anchors.x
        return (x[self.j] - x[self.i]) / self.length[:, None]

    def _weights(self, eta: float) -> tuple[np.ndarray, np.ndarray]:
        weights = np.append(neighbour_weights(eta, self.neighbours), 0.0)
        return weights[self.rank_i], weights[self.rank_j]

    def calibrated(self, eta: float) -> Float[np.ndarray, "n"]:
        """Constant k [N] of every anchor: half its springs, k w l / 2 in sum, carry 6 V E."""
        at_i, at_j = self._weights(eta)
        count = len(self.anchors.x)
        reach = np.bincount(self.i, at_i * self.length, count)
        reach += np.bincount(self.j, at_j * self.length, count)
        carried = 6 * self.anchors.volume * self.anchors.E
        return carried / np.where(reach > 0, reach / 2, np.inf)

    def constants(self, eta: float = 0.0, surface: float = 0.0) -> Float[np.ndarray, "n"]:
        """Calibrated constants k [N] times exp(surface (skin - its mean)).

        The mean is that by volume, so that the mean of log k stays.
        """
        anchors = self.anchors
        outer = anchors.skin - np.average(anchors.skin, weights=anchors.volume)
        return self.calibrated(eta) * np.exp(surface * outer)

    def stiffness(
        self, eta: float = 0.0, *, surface: float = 0.0, k: Float[np.ndarray, "n"] | None = None
    ) -> Float[np.ndarray, "springs"]:
        """Stiffness [N/m] of every spring: (k_i w + k_j w) / 2 l, across borders the harmonic mean.

        ``k`` [N] are the anchors' constants, by default those of ``eta`` and ``surface``.
        """
        k = self.constants(eta, surface) if k is None else k
        at_i, at_j = self._weights(eta)
        a, b = self.anchors.E[self.i], self.anchors.E[self.j]
        series = 4 * (a / (a + b)) * (b / (a + b))  # harmonic over arithmetic mean: halves in a row
        return series * (k[self.i] * at_i + k[self.j] * at_j) / (2 * self.length)

    def matrix(self, stiffness: Float[np.ndarray, "springs"]) -> Any:
        """Stiffness matrix [N/m] at rest, (3 n, 3 n) ``scipy.sparse.csr_array``: B^T k B."""
        from scipy.sparse import csr_array

        count, ends = len(self.i), np.stack([self.i, self.j], axis=1)
        columns = (3 * ends[:, :, None] + np.arange(3)).ravel()
        stretch = np.concatenate([-self.direction, self.direction], axis=1).ravel()
        rows = 6 * np.arange(count + 1)
        B = csr_array((stretch, columns, rows), shape=(count, 3 * len(self.anchors.x)))
        kB = csr_array((stretch * np.repeat(stiffness, 6), columns, rows), shape=B.shape)
        return (B.T @ kB).tocsr()


# Anchors: points in the tets that stand for the matter around them, and points that are held.

# Places that are looked at for every anchor, and rounds of Lloyd's algorithm on them.
PLACES, ROUNDS = 16, 4
# Anchors are this many spacings from their neighbours on what is held, at least.
APART = 0.8
LEAST = 8
# Places of a part that its thickness is taken from: twice the depth that so many stay above.
PROBED, DEEPEST = 1000, 0.95


@dataclass(frozen=True, eq=False, kw_only=True)
class Anchors:
    """Points of a body with the matter around them.

    x: Positions at rest [m], shape (n, 3).
    volume, mass, E: Volume [m^3], mass [kg] and geometric mean of E [Pa] of the matter around them,
        (n,).
    part: Index of their part, shape (n,).
    body: Index of what hangs together through tets, shape (n,).
    fixed, values: Components that are held, and their displacement [m], shape (n, 3).
    spacing: Edge [m] of a cube that belongs to one anchor.
    layers: Anchors across the thickness of every part [1], shape (parts,).
    skin: How near the surface of its part an anchor is [1]: from 0 in the middle, with the square
        of the height above it, to 1; shape (n,).
    """

    x: Float[np.ndarray, "n 3"]
    volume: Float[np.ndarray, "n"]
    mass: Float[np.ndarray, "n"]
    E: Float[np.ndarray, "n"]
    part: Int[np.ndarray, "n"]
    body: Int[np.ndarray, "n"]
    fixed: Bool[np.ndarray, "n 3"]
    values: Float[np.ndarray, "n 3"]
    spacing: float
    layers: Float[np.ndarray, "parts"]
    skin: Float[np.ndarray, "n"]


def sample_anchors(
    mesh: TetMesh,
    count: int = 2048,
    *,
    supports: Supports | None = None,
    surface: LineOfSight | None = None,
    seed: int = 0,
) -> Anchors:
    """Spread about ``count`` anchors over ``mesh``, and others over what ``supports`` hold.

    They are divided by volume among the parts, at least one each. Cells are Lloyd's; an anchor
    whose cell has its centre outside the tets stands at the nearest place inside.

    Raises InputError: Where fewer than ``LEAST`` anchors are asked for.
    """
    if count < LEAST:
        raise InputError("network.anchors_wanted", count=count, least=LEAST)
    from scipy.spatial import KDTree

    rng = np.random.default_rng(seed)
    spacing = float(np.cbrt(mesh.volume / count))
    supports = supports or Supports.none(len(mesh.points))
    surface = surface or LineOfSight(mesh.points, mesh.boundary.faces)
    fixed_x, fixed, values = _support_places(mesh, supports, spacing, rng)

    # Places, evenly over the volume, that hold the volume of every part
    ends, parts = np.cumsum(mesh.volumes), len(mesh.region_names)
    steps = (np.arange(PLACES * count) + rng.random()) / (PLACES * count) * ends[-1]
    tet = np.searchsorted(ends, steps).clip(max=len(ends) - 1)
    lost = np.setdiff1d(np.unique(mesh.region), mesh.region[tet])
    largest = [int(np.argmax(np.where(mesh.region == k, mesh.volumes, -1.0))) for k in lost]
    tet = np.append(tet, np.array(largest, dtype=tet.dtype))
    region = mesh.region[tet]
    each = mesh.region_volumes() / np.maximum(np.bincount(region, minlength=parts), 1)
    places, volumes = _random_points(mesh, tet, rng), each[region]

    # Cells of the anchors, part by part
    near = KDTree(places).query(fixed_x)[1] if len(fixed_x) else np.zeros(0, dtype=np.int64)
    positions, part, total = [fixed_x], [region[near]], len(fixed_x)
    owner = np.zeros(len(places), dtype=np.int64)
    for name in np.unique(region):
        inside = np.flatnonzero(region == name)
        corners = np.flatnonzero(region[near] == name)
        free = min(max(1, round(volumes[inside].sum() / spacing**3)), len(inside))
        centres, cell = _lloyd(places[inside], fixed_x[corners], free, surface, rng)
        owner[inside] = np.concatenate([corners, total + np.arange(free)])[cell]
        positions.append(centres[len(corners) :])
        part.append(np.full(free, name))
        total += free

    # What is in them; free ones whose cell is empty are left out
    material = material_of(mesh)
    volume = np.bincount(owner, volumes, total)
    mass = np.bincount(owner, volumes * material.rho[tet], total)
    log_E = np.bincount(owner, volumes * np.log(material.E[tet]), total)
    full = np.where(volume > 0, volume, 1.0)
    E = np.where(volume > 0, np.exp(log_E / full), np.median(material.E))
    some = np.zeros(total, dtype=np.int64)
    some[owner[::-1]] = tet[::-1]
    body = point_components(mesh)[mesh.tets[some, 0]]
    stays = (volume > 0) | (np.arange(total) < len(fixed_x))
    x, part = np.concatenate(positions)[stays], np.concatenate(part)[stays]

    # Thickness of every part, to 5 % that of a plate, to a fifth that of a rod
    thickness, skin = np.full(parts, np.inf), np.zeros(len(x))
    for k in np.unique(mesh.region):
        tets = np.flatnonzero(mesh.region == k)
        probes = rng.choice(tets, PROBED, p=mesh.volumes[tets] / mesh.volumes[tets].sum())
        outside = LineOfSight(mesh.points, boundary_faces(mesh.tets[tets]).faces)
        depths = outside.depth(_random_points(mesh, probes, rng))
        thickness[k] = 2 * float(np.quantile(depths, DEEPEST))
        here = part == k
        if here.any():
            skin[here] = np.clip(1 - 2 * outside.depth(x[here]) / thickness[k], 0, 1) ** 2
    rest = ((0, len(x) - len(fixed_x)), (0, 0))
    return Anchors(
        x=x, volume=volume[stays], mass=mass[stays], E=E[stays], part=part, body=body[stays],
        fixed=np.pad(fixed, rest), values=np.pad(values, rest), spacing=spacing,
        layers=thickness / spacing, skin=skin,
    )  # fmt: skip


def _support_places(
    mesh: TetMesh, supports: Supports, spacing: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fixed points and places on the faces between them, apart; their components and values."""
    from scipy.spatial import KDTree

    used, some = np.unique(mesh.tets), np.logical_or.reduce(supports.fixed, axis=1)
    nodes = used[some[used]]
    x, fixed, values = mesh.points[nodes], supports.fixed[nodes], supports.values[nodes]
    faces = mesh.tets[:, FACES].reshape(-1, 3)
    faces = faces[some[faces].all(axis=1)]
    if len(faces):
        faces = faces[np.unique(np.sort(faces, axis=1), axis=0, return_index=True)[1]]
        area = face_areas(mesh.points, faces)
        count = min(int(4 * area.sum() / spacing**2) + 1, 100_000)
        chosen = faces[rng.choice(len(faces), count, p=area / area.sum())]
        weights = rng.dirichlet(np.ones(3), count)
        x = np.concatenate([x, np.einsum("na,nai->ni", weights, mesh.points[chosen])])
        both = np.logical_and.reduce(supports.fixed[chosen], axis=1)
        fixed = np.concatenate([fixed, both])
        between = np.einsum("na,nai->ni", weights, supports.values[chosen])
        values = np.concatenate([values, between])
    kept, free = [], np.ones(len(x), dtype=bool)  # no two of them too close, the first ones first
    if len(x):
        near = KDTree(x)
        for k in range(len(x)):
            if free[k]:
                kept.append(k)
                free[near.query_ball_point(x[k], APART * spacing)] = False
    return x[kept], fixed[kept], values[kept]


def _lloyd(
    places: np.ndarray, fixed: np.ndarray, free: int, surface: LineOfSight, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Cells of ``fixed`` points and of ``free`` ones: their centres, and the cell of each place."""
    from scipy.spatial import KDTree

    x = np.concatenate([fixed, places[rng.choice(len(places), free, replace=False)]])
    moving = np.arange(len(x)) >= len(fixed)
    for _ in range(ROUNDS):
        owner = KDTree(x).query(places)[1]
        size = np.bincount(owner, minlength=len(x))
        centre = np.stack([np.bincount(owner, places[:, k], len(x)) for k in range(3)], axis=1)
        able = moving & (size > 0)
        x[able] = centre[able] / size[able, None]
    inside = places[KDTree(places).query(x)[1]]
    lost = moving & surface.crossed(inside, x)
    x[lost] = inside[lost]
    return x, np.asarray(KDTree(x).query(places)[1])


def _random_points(mesh: TetMesh, tet: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return a random point [m] in every one of the tets, shape (n, 3)."""
    weights = rng.dirichlet(np.ones(4), len(tet))
    return np.einsum("na,nai->ni", weights, mesh.points[mesh.tets[tet]])


# What of a body sees what: segments that leave its tets, and depths below its surface.

# Ends of a segment may lie on the surface: this fraction [1] of its length is not looked at there.
TRIMMED = 2e-3


class LineOfSight:
    """The boundary of tets in a tree of boxes, in single precision of the body's own size.

    points: Positions [m], shape (points, 3).
    faces: Corners of the boundary's faces, shape (faces, 3).
    """

    def __init__(self, points: Float[np.ndarray, "n 3"], faces: Int[np.ndarray, "faces 3"]) -> None:
        used = points[np.unique(faces)]
        self._centre = used.mean(axis=0)
        self._size = float(np.ptp(used, axis=0).max())
        wp = start_warp()
        corners = wp.array(faces.astype(np.int32).ravel(), dtype=int, device="cpu")
        self._mesh = wp.Mesh(points=self._vectors(points), indices=corners)

    def _vectors(self, points: np.ndarray):
        wp = start_warp()
        scaled = ((points - self._centre) / self._size).astype(np.float32)
        return wp.array(scaled, dtype=wp.vec3, device="cpu")

    def crossed(
        self, start: Float[np.ndarray, "n 3"], end: Float[np.ndarray, "n 3"]
    ) -> Bool[np.ndarray, "n"]:
        """Whether the segments between points [m] in the body, or on it, leave it."""
        from . import kernels_springs as k

        wp, trim = start_warp(), TRIMMED * (end - start)
        hit = wp.zeros(len(start), dtype=int, device="cpu")
        ends = [self._vectors(start + trim), self._vectors(end - trim)]
        wp.launch(k.crosses, len(start), inputs=[self._mesh.id, *ends, hit], device="cpu")
        return hit.numpy().astype(bool)

    def depth(self, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
        """Distance [m] of points from the surface."""
        from . import kernels_springs as k

        wp = start_warp()
        out = wp.zeros(len(points), dtype=wp.float32, device="cpu")
        inputs = [self._mesh.id, self._vectors(points), out]
        wp.launch(k.depths, len(points), inputs=inputs, device="cpu")
        return self._size * out.numpy().astype(np.float64)


# Eta, which takes neighbours in: a network that stiffens while its constants k stay.

# Where neighbours beyond the nearest sixteen count nothing, and where all do: the ends of eta.
SOFTEST, STIFFEST = 20.0, -20.0


def eta_for_ratio(network: SpringNetwork, ratio: float) -> float:
    """Eta whose network is ``ratio`` [1] times as stiff as its softest, all k the same.

    By the sum of k w l; ratios out of reach give the nearer end.
    """
    k = network.calibrated(SOFTEST)

    def log_stiffness(eta: float) -> float:
        return float(np.log(network.stiffness(eta, k=k) @ network.length**2))

    target = np.log(ratio) + log_stiffness(SOFTEST)
    if target >= log_stiffness(STIFFEST):
        return STIFFEST
    if target <= log_stiffness(SOFTEST):
        return SOFTEST
    from scipy.optimize import brentq

    root: Any = brentq(lambda eta: log_stiffness(eta) - target, STIFFEST, SOFTEST, xtol=1e-11)
    return root


def stiffened(
    network: SpringNetwork, k: Float[np.ndarray, "n"], ratio: float
) -> Float[np.ndarray, "springs"]:
    """Stiffness [N/m] of springs ``ratio`` [1] times as stiff as at the softest eta.

    ``k`` [N] stays while eta takes more neighbours in, and is multiplied for what eta cannot.
    """
    square = network.length**2
    soft = network.stiffness(SOFTEST, k=k) @ square
    stiff = network.stiffness(eta_for_ratio(network, ratio), k=k)
    return ratio * soft / (stiff @ square) * stiff
