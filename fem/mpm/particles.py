"""Particles: places, volumes, material and class of what is simulated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ..elements.assembly import discretise
from ..elements.forces import load_vector
from ..errors import InputError
from ..material import lame_parameters, wave_speed
from ..mesh import TetMesh, boundary_faces, face_areas
from ..scene.scene import Scene
from .materials import MaterialClass, Substance

JELLY = Substance()


@dataclass(frozen=True, eq=False, kw_only=True)
class Particles:
    """Particles of a body at rest, in SI.

    x, volume: Places [m], shape (n, 3), and volumes [m^3], shape (n,).
    E, nu, rho: Young's modulus [Pa], Poisson's ratio [1] and density [kg/m^3], each (n,).
    part: Index into ``parts`` of every particle, shape (n,).
    parts: Names of the parts.
    substance: Index into ``substances`` of every particle, shape (n,).
    substances: Class and yield of the matter.
    velocity: Velocity at the start [m/s], shape (n, 3).
    rigid: Number of the rigid body of every particle, shape (n,); -1 where it deforms.
    Raises InputError: Where there are none, shapes differ, or a value is not finite or has the
        wrong sign.
    """

    x: Float[np.ndarray, "n 3"]
    volume: Float[np.ndarray, "n"]
    E: Float[np.ndarray, "n"]
    nu: Float[np.ndarray, "n"]
    rho: Float[np.ndarray, "n"]
    part: Int[np.ndarray, "n"]
    parts: tuple[str, ...] = ("body",)
    substance: Int[np.ndarray, "n"]
    substances: tuple[Substance, ...] = field(default=(JELLY,))
    velocity: Float[np.ndarray, "n 3"]
    rigid: Int[np.ndarray, "n"]

    def __post_init__(self) -> None:
        if not len(self.x):
            raise InputError("particles.particles_body")
        total = len(self.x)
        for name in ("volume", "E", "nu", "rho", "x", "velocity"):
            values = getattr(self, name)
            if (count := len(values)) != total:
                raise InputError(
                    "particles.values_particles", count=count, name=name, count_2=total
                )
            good = np.isfinite(values).reshape(total, -1).all(axis=1)
            if values.ndim == 1:  # positive; nu may be zero
                good &= (0 <= values) & (values < 0.5) if name == "nu" else values > 0
            if bad := np.flatnonzero(~good).tolist():
                raise InputError(
                    "particles.particle_bad",
                    name=name, values=values[bad[0]], first=bad[0], count=len(bad), count_2=total,
                )  # fmt: skip
        for name, names in (("part", self.parts), ("substance", self.substances)):
            ids, most = getattr(self, name), len(names)
            if len(ids) != total or ids.min() < 0 or ids.max() >= most:
                raise InputError("particles.particles_wanted", name=name, count=total, count_2=most)

    @classmethod
    def of(
        cls,
        x: np.ndarray,
        volume: float | np.ndarray,
        *,
        E: float | np.ndarray,
        nu: float | np.ndarray,
        rho: float | np.ndarray,
        substance: Substance = JELLY,
        velocity: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
    ) -> Particles:
        """Particles of one part and one class; numbers are for all of them or one for each."""
        x = np.array(x, dtype=np.float64)

        def each(value: float | np.ndarray) -> np.ndarray:
            return np.broadcast_to(np.asarray(value, dtype=np.float64), len(x)).copy()

        none = np.zeros(len(x), dtype=np.int64)
        return cls(
            x=x, volume=each(volume), E=each(E), nu=each(nu), rho=each(rho), part=none,
            substance=none.copy(), substances=(substance,),
            velocity=np.broadcast_to(np.asarray(velocity, dtype=np.float64), x.shape).copy(),
            rigid=none - 1,
        )  # fmt: skip

    @property
    def mass(self) -> Float[np.ndarray, "n"]:
        """Mass [kg] of every particle."""
        return self.rho * self.volume

    @property
    def kinds(self) -> Int[np.ndarray, "n"]:
        """Class of every particle; a rigid body is stationary in itself."""
        kinds = np.array([int(s.kind) for s in self.substances])[self.substance]
        return np.where(self.rigid >= 0, int(MaterialClass.STATIONARY), kinds)

    @property
    def held(self) -> Bool[np.ndarray, "n"]:
        """Particles that never move: stationary, and of no rigid body."""
        return (self.kinds == MaterialClass.STATIONARY) & (self.rigid < 0)

    @property
    def wave_speed(self) -> Float[np.ndarray, "n"]:
        """Speed of pressure waves [m/s]; of a fluid by its bulk modulus, of what is rigid zero."""
        speed = wave_speed(self.E, self.nu, self.rho)
        for i, substance in enumerate(self.substances):
            if substance.kind == MaterialClass.FLUID and substance.bulk is not None:
                rows = self.substance == i
                speed[rows] = np.sqrt(substance.bulk / self.rho[rows])
        return np.where(self.kinds == MaterialClass.STATIONARY, 0.0, speed)

    def numbers(self, spacing: float) -> Float[np.ndarray, "n 3"]:
        """What the kernel of every particle's class is given, on a grid of ``spacing`` [m]."""
        lam, mu = lame_parameters(self.E, self.nu)
        numbers = np.zeros((len(self.x), 3))
        for i, substance in enumerate(self.substances):
            rows = self.substance == i
            numbers[rows] = substance.numbers(0.0)
            if substance.kind == MaterialClass.FLUID and substance.bulk is None:
                numbers[rows, 0] = (lam + 2 * mu / 3)[rows]
            if substance.tears and substance.tension and substance.fracture_energy:
                scatter = np.random.default_rng(substance.seed).standard_normal(int(rows.sum()))
                tension = substance.tension * (1 + SCATTER * np.minimum(np.abs(scatter), 3.0))
                band = crack_band(tension, substance.fracture_energy, self.E[rows], spacing)
                numbers[rows, 0], numbers[rows, 1] = tension, band.softening
        return numbers

    def only(self, keep: Bool[np.ndarray, "n"]) -> Particles:
        """The particles of a mask."""
        arrays = {f.name: getattr(self, f.name) for f in fields(self)}
        kept = {name: a[keep] for name, a in arrays.items() if isinstance(a, np.ndarray)}
        return replace(self, **kept)


def rigid_labels(x: Float[np.ndarray, "n 3"], reach: float) -> Int[np.ndarray, "n"]:
    """Number of the body of every place: those within ``reach`` of each other are one.

    Parameters
    ----------
    x
        Places [m], shape (n, 3).
    reach
        How far apart neighbours may be [m].

    Returns
    -------
    array
        Numbers of bodies from 0, shape (n,).

    Examples
    --------
    >>> import numpy as np
    >>> from autophyx_tet.fem import rigid_labels
    >>> rigid_labels(np.array([[0.0, 0, 0], [0.9, 0, 0], [5.0, 0, 0]]), reach=1.0).tolist()
    [0, 0, 1]
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    pairs = KDTree(x).query_pairs(reach, output_type="ndarray").T
    graph = coo_array((np.ones(pairs.shape[1], dtype=np.int8), tuple(pairs)), shape=(len(x),) * 2)
    return connected_components(graph, directed=False)[1].astype(np.int64)


class ParticleState(NamedTuple):
    """Particles at one time, in the order they were given in.

    ``x`` [m] and ``v`` [m/s] (n, 3), ``F`` total deformation gradient (n, 3, 3), ``q`` the state of
    the class (n,).
    """

    time: float
    x: np.ndarray
    v: np.ndarray
    F: np.ndarray
    q: np.ndarray


def block_places(
    low: Sequence[float], high: Sequence[float], spacing: float, *, along: int = 2
) -> Float[np.ndarray, "n 3"]:
    """Places [m] of ``along``^3 particles a cell that fill the box from ``low`` to ``high`` [m]."""
    h = spacing / along
    axes = [a + h * (np.arange(round((b - a) / h)) + 0.5) for a, b in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


# Fracture of jelly by Rankine's criterion: the energy of a crack is spread over a band.

# A crack is this many spacings wide: 0.88 to 0.94 of the fracture energy is spent at 10 and at 20
# cells, wherever between the nodes it opens; with 1.75 or less two may open. Where a bar stores
# more energy than its crack needs, waves open others: up to 1.5 times as much is spent.
BAND = 1.8
# Tensile strengths of particles lie above that of the matter by this fraction (of the half of a
# normal distribution), for no body is perfect, and none tears below its strength.
SCATTER = 0.1
# G_f E / (l_c f_t^2) at least: below one half the stress would snap back.
LEAST = 1 / 1.9
# A particle is torn where damage leaves less than this fraction of its stress.
TORN = 0.5
# Particles within so many spacings, two to a cell and axis, are of one piece, and a piece is no
# crumb from this fraction of the body on.
REACH, CRUMB = 0.9, 0.01


class CrackBand(NamedTuple):
    """``softening`` H_s [1], and how many times G_f a crack ``spends`` [1] on this grid."""

    softening: np.ndarray
    spends: np.ndarray


def crack_band(tension, energy: float, E, spacing: float) -> CrackBand:
    """Softening after f_t: sigma = f_t exp(-H_s (k - 1)) spends G_f over the band l_c.

    ``tension`` f_t [Pa] and ``E`` [Pa] are arrays, ``energy`` G_f [J/m^2]: 1/H_s = G_f E / (l_c
    f_t^2) - 1/2. Where that is not positive (the cells are too large for so brittle a matter) the
    strength stays, and a crack spends more: what the band stores when it breaks.
    """
    least = LEAST * BAND * spacing * np.asarray(tension, dtype=float) ** 2 / E
    spends = np.maximum(least / energy, 1.0)
    return CrackBand(1 / (LEAST * spends * energy / least - 0.5), spends)


def stress_left(
    q: Float[np.ndarray, "n"], softening: Float[np.ndarray, "n"]
) -> Float[np.ndarray, "n"]:
    """Fraction of its stress that damage ``q`` (largest sigma_1 / f_t) leaves matter [1]."""
    q = np.maximum(q, 1.0)
    return np.exp(-softening * (q - 1)) / q


def pieces_of(x: Float[np.ndarray, "n 3"], volume: Float[np.ndarray, "n"], spacing: float) -> int:
    """Number of pieces that particles at ``x`` [m] are in, beside crumbs, of a grid's ``spacing``.

    Particles deep in rigid bodies, merged to one of several cells, join nothing.
    """
    own = volume < spacing**3
    if not own.any():
        return 0
    size = np.bincount(rigid_labels(x[own], REACH * spacing), volume[own])
    return int((size > CRUMB * size.sum()).sum())


def without_cracks(
    F: Float[np.ndarray, "n 3 3"], q: Float[np.ndarray, "n"], softening: Float[np.ndarray, "n"]
) -> Float[np.ndarray, "n 3 3"]:
    """Deformation gradients of the matter beside its cracks, whose opening is no stretch of it.

    Of a stretch stays what damage ``q`` (largest sigma_1 / f_t) left of its stress; what is pressed
    together stays so.
    """
    torn = q > 1
    keep = stress_left(q[torn], softening[torn])
    left, s, right = np.linalg.svd(F[torn])
    s = np.where(s > 1, 1 + keep[:, None] * (s - 1), s)
    whole = F.copy()
    whole[torn] = (left * s[:, None]) @ right
    return whole


# Particles out of tets, and points that follow particles.

# Pairs of tet and place that are tested at a time: 20 MB.
PAIRS = 200_000
# A region is missed by a regular grid whose places stand for less than this fraction of it.
MISSED = 0.5
# A place on a face is in a tet down to this barycentric coordinate.
ON_FACE = -1e-9
# Particles that a point follows: those around it in every direction.
NEAREST = 8
# Particles along a cell, and along one in a part that is thinner than ``THIN`` cells and bends.
# Cantilevers against quadratic tets, two along a cell: 1.2 % too soft at four cells of thickness, 4
# to 6 % at two, 16 to 26 % at one, and 280 % at 0.6; with four along a cell 2, 1 to 5 and 52 %.
ALONG, FINE = 2, 4
THIN = 2.0


class TetSample(NamedTuple):
    """Places ``x`` (n, 3) [m] on regular grids, ``tet`` (n,) and ``volume`` (n,) [m^3] of each.

    ``thin`` are names of parts that are too thin for the grid to bend rightly, by finer particles
    too.
    """

    x: np.ndarray
    tet: np.ndarray
    volume: np.ndarray
    thin: tuple[str, ...]


def sample_tets(
    mesh: TetMesh, spacing: float, *, bends: Bool[np.ndarray, "regions"] | None = None
) -> TetSample:
    """Fill ``mesh`` with 8 particles a cell of a grid of ``spacing`` [m]; 64 in what is thin.

    ``bends`` are the regions that finer particles help: by default none. The volumes add up to that
    of every region; one that places hardly lie in has one in every cube that it meets.
    """
    # Thickness of the parts by volume over surface: half of a plate, a quarter of a rod
    thickness = np.full(len(mesh.region_names), np.inf)
    for k in np.unique(mesh.region):
        inside = mesh.region == k
        area = face_areas(mesh.points, boundary_faces(mesh.tets[inside]).faces).sum()
        thickness[k] = 3 * mesh.volumes[inside].sum() / area
    thin = thickness / spacing < THIN
    fine = np.zeros(len(thin), dtype=bool) if bends is None else bends & thin
    places, owners = [], []
    for along, regions in ((ALONG, ~fine), (FINE, fine)):
        tets = np.flatnonzero(regions[mesh.region])
        if len(tets):
            place, owner = _grid_places(mesh, tets, spacing / along)
            places.append(place)
            owners.append(owner)
    x, tet = np.concatenate(places), np.concatenate(owners)
    volumes = np.bincount(mesh.region, mesh.volumes, len(mesh.region_names))
    found = np.bincount(mesh.region[tet], minlength=len(mesh.region_names))
    h = spacing / ALONG
    for region in np.flatnonzero(np.maximum(found, 1e-9) * h**3 < MISSED * volumes):
        # Thinner than the grid of places, and between its planes: one in every cube that it meets
        own = np.flatnonzero(mesh.region == region)
        kept = mesh.region[tet] != region
        place, owner = _met_cubes(mesh, own, h)
        x, tet = np.concatenate([x[kept], place]), np.concatenate([tet[kept], owner])
    region = mesh.region[tet]
    counts = np.bincount(region, minlength=len(mesh.region_names))
    names = tuple(mesh.region_names[k] for k in np.flatnonzero(thin))
    return TetSample(x, tet, (volumes / np.maximum(counts, 1))[region], names)


def _met_cubes(
    mesh: TetMesh, tets: Int[np.ndarray, "some"], h: float
) -> tuple[np.ndarray, np.ndarray]:
    """A place [m] of some tets in every cube of edge ``h`` [m] that they meet, and its tet."""
    corners = mesh.points[mesh.tets[tets]]
    edges = np.linalg.norm(corners[:, :, None] - corners[:, None], axis=3).max(axis=(1, 2))
    places, owners = [], []
    for n in np.unique(parts := np.ceil(2 * edges / h).astype(np.int64)):
        some = np.flatnonzero(parts == n)
        # Middles of the parts of a tet whose edges are divided by n
        ids = np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
        ids = ids[ids.sum(axis=1) < n]
        weights = np.column_stack([ids, n - 1 - ids.sum(axis=1)]) / n + 1 / (4 * n)
        places.append(np.einsum("sk,tki->tsi", weights, corners[some]).reshape(-1, 3))
        owners.append(np.repeat(tets[some], len(weights)))
    x, owner = np.concatenate(places), np.concatenate(owners)
    cube = np.floor((x - mesh.bounds[0]) / h).astype(np.int64)
    _, first = np.unique(cube, axis=0, return_index=True)
    return x[first], owner[first]


def _grid_places(
    mesh: TetMesh, tets: Int[np.ndarray, "some"], h: float
) -> tuple[np.ndarray, np.ndarray]:
    """Places [m] of a regular grid of spacing ``h`` [m] in some tets, and the tet of each."""
    origin = mesh.bounds[0] + h / 2
    corners = mesh.points[mesh.tets[tets]]
    low = np.ceil((corners.min(axis=1) - origin) / h - 1e-9).astype(np.int64)
    high = np.floor((corners.max(axis=1) - origin) / h + 1e-9).astype(np.int64)
    extent = np.maximum(high - low + 1, 0)
    maps = np.linalg.inv((corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1))
    counts = extent.prod(axis=1)
    ends = np.cumsum(counts)
    cuts = np.unique([0, *np.searchsorted(ends, np.arange(PAIRS, ends[-1], PAIRS)), len(ends)])
    places, owners = [], []
    for a, b in pairwise(cuts):  # all places in the boxes of some tets
        owner = np.repeat(np.arange(a, b), counts[a:b])
        rank = np.arange(len(owner)) - (ends - counts)[owner] + (ends - counts)[a]
        wide, deep = extent[owner, 2], extent[owner, 1]
        local = np.stack([rank // (wide * deep), rank // wide % deep, rank % wide], axis=1)
        node = low[owner] + local
        three = np.einsum("nij,nj->ni", maps[owner], origin + h * node - corners[owner, 0])
        inside = (three >= ON_FACE).all(axis=1) & (three.sum(axis=1) <= 1 - ON_FACE)
        places.append(node[inside])
        owners.append(owner[inside])
    node, owner = np.concatenate(places), np.concatenate(owners)
    _, first = np.unique(node, axis=0, return_index=True)  # on a face: in one tet only
    return origin + h * node[first], tets[owner[first]]


@dataclass(frozen=True, eq=False)
class Followers:
    """Points that follow the particles around them: x' = sum w (x_j + F_j (X - X_j)).

    ``near`` are the particles j of every point, nearest first, ``weights`` w of sum one at rest;
    ``points`` X and all particles' ``rest`` X_j [m]. Across a crack a point follows its own side.
    """

    near: Int[np.ndarray, "n k"]
    weights: Float[np.ndarray, "n k"]
    points: Float[np.ndarray, "n 3"]
    rest: Float[np.ndarray, "particles 3"]

    @classmethod
    def of(
        cls,
        points: Float[np.ndarray, "n 3"],
        rest: Float[np.ndarray, "particles 3"],
        *,
        labels: Int[np.ndarray, "n"],
        parts: Int[np.ndarray, "particles"],
    ) -> Followers:
        """Points [m] after the particles at ``rest`` [m] of their own part, where it has any."""
        from scipy.spatial import KDTree

        count = min(NEAREST, len(rest))
        near = np.zeros((len(points), count), dtype=np.int64)
        away = np.full((len(points), count), np.inf)
        lost = ~np.isin(labels, np.unique(parts))  # of parts without particles: any will do
        groups = [(labels == part, parts == part) for part in np.unique(labels[~lost])]
        for asking, asked in [*groups, (lost, np.ones(len(rest), dtype=bool))]:
            if asking.any():
                sources = np.flatnonzero(asked)
                k = min(count, len(sources))
                far, row = KDTree(rest[sources]).query(points[asking], k=k)
                near[asking, :k] = sources[row.reshape(-1, k)]
                away[asking, :k] = far.reshape(-1, k)
        smallest = np.maximum(away[:, :1], 1e-3 * np.median(away[:, 0]) + 1e-300)
        weights = 1 / (away / smallest + 1e-9) ** 2
        weights /= weights.sum(axis=1, keepdims=True)
        return cls(near, weights, np.asarray(points, dtype=np.float64), rest)

    def only(self, rows: Any) -> Followers:
        """Some of the points."""
        return Followers(self.near[rows], self.weights[rows], self.points[rows], self.rest)

    def mixing(self, weights: Float[np.ndarray, "n k"]) -> Any:
        """Sparse matrix (n, particles) that takes means over ``near`` by ``weights``."""
        from scipy.sparse import csr_matrix

        ends = np.arange(0, weights.size + 1, weights.shape[1])
        shape = (len(weights), len(self.rest))
        return csr_matrix((weights.ravel(), self.near.ravel(), ends), shape=shape)

    def positions(
        self, state: ParticleState, weights: Float[np.ndarray, "n k"] | None = None
    ) -> Float[np.ndarray, "n 3"]:
        """Positions [m] of the points, by ``weights`` that are known already, else by their own."""
        mean = self.mixing(self.weights_in(state) if weights is None else weights)
        shift = state.x - (state.F @ self.rest[:, :, None])[..., 0]
        F = (mean @ state.F.reshape(-1, 9)).reshape(-1, 3, 3)
        return mean @ shift + (F @ self.points[:, :, None])[..., 0]

    @cached_property
    def _pairs(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Pairs of a nearest particle and another of a point, and the pair of each (n, k)."""
        first = np.broadcast_to(self.near[:, :1], self.near.shape)
        keys, of = np.unique(first * len(self.rest) + self.near, return_inverse=True)
        return *np.divmod(keys, len(self.rest)), of.reshape(self.near.shape)

    def weights_in(self, state: ParticleState) -> Float[np.ndarray, "n k"]:
        """Weights that fade as a particle comes off the nearest one by as much as it was away.

        What comes off is what the mean of both gradients does not tell: the opening of a crack.
        """
        first, near, of = self._pairs
        across = self.rest[near] - self.rest[first]
        F = (state.F[first] + state.F[near]) / 2
        off = state.x[near] - state.x[first] - (F @ across[:, :, None])[..., 0]
        away = np.linalg.norm(across, axis=1)
        opening = np.linalg.norm(off, axis=1) / np.where(away > 0, away, 1.0)
        weights = self.weights * np.clip(1 - opening, 0.0, 1.0)[of]
        return weights / weights.sum(axis=1, keepdims=True)


def particle_forces(
    scene: Scene, rest: Float[np.ndarray, "particles 3"]
) -> Float[np.ndarray, "particles 3"]:
    """Forces [N] on particles: those of every mesh point go to the particles around it.

    Particles lie within the surface, where arms are shorter: of every load they have the torque
    too, by forces as a turn would move them.
    """
    mesh, grid, total = scene.mesh, discretise(scene.mesh, 1), np.zeros_like(rest)
    loads: list[dict[str, Any]] = [{"traction": one} for one in scene.tractions]
    loads += [] if scene.forces is None else [{"forces": scene.forces}]
    for one in loads:
        load = load_vector(mesh, grid, **one)
        if not (loaded := np.flatnonzero(load.any(axis=1))).size:
            continue
        all_of_one = {"labels": np.zeros(len(loaded), int), "parts": np.zeros(len(rest), int)}
        around = Followers.of(mesh.points[loaded], rest, **all_of_one)
        forces, carries = np.zeros_like(rest), np.zeros(len(rest))
        np.add.at(forces, around.near, around.weights[:, :, None] * load[loaded, None])
        sizes = np.linalg.norm(load[loaded], axis=1)
        np.add.at(carries, around.near, around.weights * sizes[:, None])
        arms = rest - carries @ rest / carries.sum()
        moments = np.einsum("p,pi,pj->ij", carries, arms, arms)
        lost = np.cross(mesh.points, load).sum(axis=0) - np.cross(rest, forces).sum(axis=0)
        turns = np.trace(moments) * np.eye(3) - moments
        spin = np.linalg.pinv(turns, rcond=1e-9, hermitian=True) @ lost
        total += forces + carries[:, None] * np.cross(spin, arms)
    return total
