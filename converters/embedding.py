"""Carriers moved by a mesh: splats and points that follow its tets, frame by frame."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ..fem.mesh import TetMesh, barycentric
from ..fem.solve.result import ParticleRun
from .mesh.meshdata import containing_tets
from .points.gaussians import (
    COUNTS,
    gaussians,
    matrices_of,
    polar,
    quaternions_of,
    stretched,
    turned_harmonics,
)
from .points.table import XYZ, PointTable

if TYPE_CHECKING:
    from ..fem.mpm.particles import Followers


NORMALS = ("nx", "ny", "nz")
# No splat becomes longer than so many times its length at rest: beyond, matter is torn.
STRETCH = 3.0
CLEAR = -80.0  # logit of the opacity of what is no longer there


class Bounded(NamedTuple):
    """Deformation gradients ``F`` (m, 3, 3), and which of them were ``clamped`` (m,)."""

    F: np.ndarray
    clamped: np.ndarray


def bounded(F: Float[np.ndarray, "m 3 3"]) -> Bounded:
    """Gradients of which none stretches by more than ``STRETCH`` [1].

    Examples
    --------
    >>> import numpy as np
    >>> from autophyx_tet.converters.embedding import bounded
    >>> bounded(np.diag([5.0, 1.0, 0.5])[None]).F[0].diagonal().round(9).tolist()
    [3.0, 1.0, 0.5]
    """
    clamped = np.sqrt((F**2).sum(axis=(1, 2))) > STRETCH  # no stretch is larger than that
    if clamped.any():
        left, sizes, right = np.linalg.svd(F[clamped])
        F = F.copy()
        F[clamped] = (left * np.minimum(sizes, STRETCH)[:, None]) @ right
        clamped[clamped] = sizes[:, 0] > STRETCH
    return Bounded(F, clamped)


class Carried(NamedTuple):
    """Points in a frame: ``positions`` (n, 3) [m], and who of them are ``gone`` (n,).

    Each follows some of the ``sources`` (m, 3, 3), bounded gradients of mesh points or particles,
    by the rows of ``mixing`` (n, m), sparse; ``clamped`` (m,) are sources that were bounded.
    """

    positions: np.ndarray
    sources: np.ndarray
    mixing: Any
    gone: np.ndarray
    clamped: np.ndarray

    @property
    def gradients(self) -> Float[np.ndarray, "n 3 3"]:
        """Deformation gradients at the points, as smooth as their weights."""
        return (self.mixing @ self.sources.reshape(-1, 9)).reshape(-1, 3, 3)

    @property
    def rotations(self) -> Float[np.ndarray, "n 3 3"]:
        """Rotations at the points: the mean of those of the sources, made orthogonal."""
        R = self.mixing @ polar(self.sources).rotation.reshape(-1, 9)
        R = R.reshape(-1, 3, 3)
        for _ in range(4):  # Newton and Schulz; of turns that are a right angle apart 1e-6 is left
            R = R @ (1.5 * np.eye(3) - 0.5 * R.transpose(0, 2, 1) @ R)
        return R


@dataclass(frozen=True, eq=False)
class Driven:
    """A table of points or splats embedded in a mesh at rest, or in particles; made by ``of``.

    Parameters
    ----------
    table
        The points at rest.
    embedding
        Tet of every point and its place there, or the particles around it.
    valid
        Points with a finite position, shape (n,); the others stay as they are.
    scale
        Metres per unit [m] of the table.

    Examples
    --------
    >>> import numpy as np
    >>> from autophyx_tet.converters import Driven, PointTable
    >>> from autophyx_tet.fem import box_mesh
    >>> box = box_mesh((1, 1, 1), (1, 1, 1))
    >>> middle = PointTable({name: np.full(1, 0.5) for name in "xyz"})
    >>> (moved,) = Driven.of(middle, box).frames([0.1 * box.points])  # m: 10 % larger
    >>> moved.positions.round(9).tolist()
    [[0.55, 0.55, 0.55]]
    """

    table: PointTable
    embedding: Embedding | ParticleNeighbours
    valid: Bool[np.ndarray, "n"]
    scale: float

    @classmethod
    def of(cls, table: PointTable, mesh: TetMesh, *, scale: float = 1.0) -> Driven:
        """Embed the points of a table, whose unit is ``scale`` metres, in ``mesh``."""
        positions = table.positions * scale
        valid = np.asarray(np.isfinite(positions).all(axis=1))
        return cls(table, embed(mesh, positions[valid]), valid, scale)

    @classmethod
    def by_particles(cls, table: PointTable, run: ParticleRun, *, scale: float = 1.0) -> Driven:
        """Points of a table after the particles around them, each those of its own part."""
        positions = table.positions * scale
        valid = np.asarray(np.isfinite(positions).all(axis=1))
        return cls(table, ParticleNeighbours.of(run, positions[valid]), valid, scale)

    @property
    def outside(self) -> int:
        """How many points lie in no tet and follow the nearest one."""
        return int(self.embedding.outside.sum())

    @property
    def farthest(self) -> float:
        """Largest distance [m] of one of those."""
        return float(self.embedding.away.max(initial=0.0))

    def frames(self, states: Iterable[Any]) -> Iterator[PointTable]:
        """The table moved by every state of what it is embedded in.

        That is a displacement (points, 3) [m] of the mesh points, or the number of a frame of the
        particles. Splats whose particles have left the grid are as clear as a file can say.
        """
        normals = None
        splats = _Splats(self.table, self.valid) if self.table.is_splat else None
        if all(name in self.table.columns for name in NORMALS):
            normals = np.stack([self.table.columns[name] for name in NORMALS], axis=1)
            normals = normals.astype(float)[self.valid] if normals.any() else None
        for state in states:
            now = self.embedding.carried(state)
            moved = dict(zip(XYZ, now.positions.T / self.scale, strict=True))
            if splats is not None or normals is not None:
                rotation, stretch = polar(now.gradients)
                if splats is not None:
                    moved |= splats.moved(rotation, stretch)
                    if now.gone.any():
                        old = np.asarray(self.table.columns["opacity"])[self.valid]
                        moved["opacity"] = np.where(now.gone, CLEAR, old)
                if normals is not None:  # F^-T n under F = R U, each at its length
                    across = np.linalg.solve(stretch, normals[:, :, None])
                    turned = (rotation @ across)[:, :, 0]
                    length = np.linalg.norm(turned, axis=1, keepdims=True)
                    size = np.linalg.norm(normals, axis=1, keepdims=True)
                    turned = turned * size / np.where(length > 0, length, 1)
                    moved |= dict(zip(NORMALS, turned.T, strict=True))
            yield self.table.with_columns(
                {name: self._spread(name, v) for name, v in moved.items()}
            )

    def _spread(self, name: str, values: np.ndarray) -> np.ndarray:
        """New values in the type of the column; invalid points keep the old ones."""
        old = np.asarray(self.table.columns[name])
        if self.valid.all():
            return values.astype(old.dtype)
        new = old.copy()
        new[self.valid] = values
        return new


@dataclass(frozen=True, eq=False)
class ParticleNeighbours:
    """Points among the particles of a ``run``: an ``Embedding`` whose states are frame numbers.

    ``outside`` (n,) lie more than a cell from the nearest particle, ``away`` (n,) [m] from it.
    """

    run: ParticleRun
    follow: Followers
    outside: Bool[np.ndarray, "n"]
    away: Float[np.ndarray, "n"]

    @classmethod
    def of(cls, run: ParticleRun, points: Float[np.ndarray, "n 3"]) -> ParticleNeighbours:
        """Points [m] where they are at the start of the run."""
        from scipy.spatial import KDTree

        from ..fem.mpm.particles import Followers

        rest = run.positions[0].astype(np.float64)
        away, row = KDTree(rest).query(points)
        follow = Followers.of(points, rest, labels=run.part[row], parts=run.part)
        outside = np.asarray(away > run.spacing)
        return cls(run, follow, outside, np.where(outside, away, 0.0))

    @property
    def size(self) -> float:
        """Diagonal [m] of the particles at the start."""
        return float(np.linalg.norm(np.ptp(self.run.positions[0], axis=0)))

    def only(self, rows: Any) -> ParticleNeighbours:
        """Some of the points."""
        follow = self.follow.only(rows)
        return ParticleNeighbours(self.run, follow, self.outside[rows], self.away[rows])

    def carried(self, frame: int) -> Carried:
        """The points in a frame."""
        from ..fem.mpm.particles import ParticleState

        x = self.run.positions[frame].astype(np.float64)
        F = self.run.gradients[frame].astype(np.float64)
        state = ParticleState(float(frame), x, x, F, x[:, 0])
        near, weights = self.follow.near, self.follow.weights_in(state)
        sources, clamped = bounded(F)
        gone = (weights * self.run.left[frame][near]).sum(axis=1) > 0.5  # most of it
        # The nearest particle has nearly all the weight of a place, and its F alone is rough
        even = np.sqrt(weights)
        even /= even.sum(axis=1, keepdims=True)
        x = self.follow.positions(state, weights)
        return Carried(x, sources, self.follow.mixing(even), gone, clamped)


class _Splats:
    """What of the valid splats turns and stretches, in float64; harmonics as they are."""

    def __init__(self, table: PointTable, valid: np.ndarray) -> None:
        found = gaussians(table)
        self.sigmas, self.axes = found.sigmas[valid], matrices_of(found.rotations[valid])
        self.scales = [i for i in range(3) if f"scale_{i}" in table.columns]  # two of a surfel
        names = [name for name in table.columns if name.startswith("f_rest_")]
        self.names = [f"f_rest_{i}" for i in range(len(names))]
        channels = 3 if len(names) // 3 in COUNTS and len(names) % 3 == 0 else 0
        self.harmonics = None
        if channels:
            flat = np.stack([np.asarray(table.columns[name])[valid] for name in self.names], axis=1)
            self.harmonics = flat.reshape(len(flat), channels, -1)

    def moved(self, rotation: np.ndarray, stretch: np.ndarray) -> dict[str, np.ndarray]:
        """Columns of scales, rotations and harmonics under F = R U of each."""
        found = stretched(self.sigmas, self.axes, rotation, stretch)
        with np.errstate(divide="ignore"):  # a flat splat stays flat: its log is -inf
            scales = np.log(found.sigmas)
        columns = {f"scale_{i}": scales[:, i] for i in self.scales}
        quaternions = quaternions_of(found.axes)
        columns |= {f"rot_{i}": quaternions[:, i] for i in range(4)}
        if self.harmonics is not None:
            flat = turned_harmonics(self.harmonics, rotation).reshape(len(rotation), -1)
            columns |= dict(zip(self.names, flat.T, strict=True))
        return columns


ON_FACE = 1e-9  # of the mesh's longest side: a point so near to its surface is not outside


@dataclass(frozen=True, eq=False)
class Embedding:
    """Where points lie in a mesh.

    A point moves by the mean over the corners of its tet of what each knows of it: its displacement
    and half of the gradient along the way, u = sum w_k (u_k + G_k (X - X_k) / 2), exact for a
    quadratic u. Gradients at corners are means over the tets around.

    mesh, rest: The mesh at rest, and the points (n, 3) [m].
    tet: Tet of every point, shape (n,): the one around it, or the nearest.
    weights: Barycentric coordinates in it, shape (n, 4), of a point outside those of the nearest
        place on the surface.
    reach: X and half of the way to its place in the tet from there, shape (n, 3) [m].
    outside: Points in no tet, shape (n,).
    away: Distance of such a point from the surface [m], shape (n,); 0 of points inside.
    """

    mesh: TetMesh
    rest: Float[np.ndarray, "n 3"]
    tet: Int[np.ndarray, "n"]
    weights: Float[np.ndarray, "n 4"]
    reach: Float[np.ndarray, "n 3"]
    outside: Bool[np.ndarray, "n"]
    away: Float[np.ndarray, "n"]

    @property
    def size(self) -> float:
        """Diagonal [m] of the mesh."""
        return float(np.linalg.norm(np.ptp(self.mesh.bounds, axis=0)))

    def only(self, rows: Any) -> Embedding:
        """Some of the points."""
        arrays = {f.name: getattr(self, f.name)[rows] for f in fields(self) if f.name != "mesh"}
        return Embedding(self.mesh, **arrays)

    @cached_property
    def _corners(self) -> tuple[np.ndarray, Any, Any, np.ndarray]:
        """Used points, means over them (n, used), over tets at each, inverse edges at rest."""
        from scipy.sparse import csr_matrix

        mesh = self.mesh
        used, near = np.unique(mesh.tets[self.tet], return_inverse=True)
        rows, tets = mesh.tets.ravel(), np.repeat(np.arange(len(mesh.tets)), 4)
        mean = csr_matrix((mesh.volumes[tets], (rows, tets)), (len(mesh.points), len(mesh.tets)))
        mean = mean[used]
        mean.data /= np.repeat(np.asarray(mean.sum(axis=1)).ravel(), np.diff(mean.indptr))
        around = np.unique(mean.indices)
        corners = mesh.points[mesh.tets[around]]
        inverse = np.linalg.inv((corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1))
        ends = np.arange(0, self.weights.size + 1, 4)
        mixing = csr_matrix((self.weights.ravel(), near.ravel(), ends), (len(ends) - 1, len(used)))
        return used, mixing, (mean[:, around], mesh.tets[around]), inverse

    def carried(self, displacement: Float[np.ndarray, "points 3"]) -> Carried:
        """The points when the mesh points are moved by ``displacement`` [m]."""
        used, mixing, (mean, tets), inverse = self._corners
        corners = (self.mesh.points + displacement)[tets]
        F = (corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1) @ inverse
        F = (mean @ F.reshape(-1, 9)).reshape(-1, 3, 3)
        G = F - np.eye(3)
        shift = displacement[used] - (G @ self.mesh.points[used][:, :, None])[..., 0] / 2
        mean = (mixing @ G.reshape(-1, 9)).reshape(-1, 3, 3)
        x = self.rest + mixing @ shift + (mean @ self.reach[:, :, None])[..., 0]
        sources, clamped = bounded(F)
        return Carried(x, sources, mixing, np.zeros(len(x), dtype=bool), clamped)


def embed(mesh: TetMesh, positions: Float[np.ndarray, "n 3"]) -> Embedding:
    """Find the tet around every position [m], or the nearest one where there is none."""
    import igl

    tet, away = containing_tets(mesh, positions), np.zeros(len(positions))
    outside, inner = tet < 0, np.array(positions, dtype=np.float64)
    if outside.any():  # the tet behind the nearest boundary face
        where, faces = np.ascontiguousarray(positions[outside]), mesh.boundary.faces
        squared, face, nearest = igl.point_mesh_squared_distance(
            where, mesh.points, faces.astype(np.int64)
        )
        tet[outside], away[outside] = mesh.boundary.tet[np.asarray(face)], np.sqrt(squared)
        inner[outside] = nearest
        outside[outside] = away[outside] > ON_FACE * np.ptp(mesh.bounds, axis=0).max()
    corners = mesh.points[mesh.tets[tet]]
    weights = barycentric(corners, inner)
    reach = positions - inner / 2
    return Embedding(mesh, positions, tet, weights, reach, outside, np.where(outside, away, 0.0))
