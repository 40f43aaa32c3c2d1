"""Carriers moved by a mesh: splats and points that follow its tets, frame by frame."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Bool, Float, Int

from ..fem.mesh import TetMesh
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

    def frames(self, displacements: Iterable[Any]) -> Iterator[PointTable]:
        """The table moved by every state of what it is embedded in.

        That is a displacement (points, 3) [m] of the mesh points, or the number of a frame of the
        particles.
        """
        found, normals = self.embedding, None
        splats = _Splats(self.table, self.valid) if self.table.is_splat else None
        if all(name in self.table.columns for name in NORMALS):
            normals = np.stack([self.table.columns[name] for name in NORMALS], axis=1)
            normals = normals.astype(float)[self.valid] if normals.any() else None
        for displacement in displacements:
            positions = found.positions(displacement) / self.scale
            moved = dict(zip(XYZ, positions.T, strict=True))
            if splats is not None or normals is not None:
                rotation, stretch = polar(found.gradients(displacement))
                if splats is not None:
                    moved |= splats.moved(rotation, stretch, found.of_point)
                if normals is not None:  # F^-T n under F = R U, each at its length
                    across = np.linalg.solve(stretch[found.of_point], normals[:, :, None])
                    turned = (rotation[found.of_point] @ across)[:, :, 0]
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
    def of_point(self) -> Int[np.ndarray, "n"]:
        """Row of every point in what ``gradients`` returns."""
        return np.arange(len(self.outside))

    def positions(self, frame: int) -> Float[np.ndarray, "n 3"]:
        """Positions [m] of the points in a frame."""
        return self.follow.positions(self._state(frame))

    def gradients(self, frame: int) -> Float[np.ndarray, "n 3 3"]:
        """Deformation gradients at the points in a frame."""
        return self.follow.gradients(self._state(frame))

    def _state(self, frame: int) -> Any:
        from ..fem.mpm.particles import ParticleState

        x = self.run.positions[frame].astype(np.float64)
        F = self.run.gradients[frame].astype(np.float64)
        return ParticleState(float(frame), x, x, F, x[:, 0])


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

    def moved(
        self, rotation: np.ndarray, stretch: np.ndarray, of: np.ndarray
    ) -> dict[str, np.ndarray]:
        """Columns of scales, rotations and harmonics under F = R U of the tet ``of`` each."""
        found = stretched(self.sigmas, self.axes, rotation[of], stretch[of])
        with np.errstate(divide="ignore"):  # a flat splat stays flat: its log is -inf
            scales = np.log(found.sigmas)
        columns = {f"scale_{i}": scales[:, i] for i in self.scales}
        quaternions = quaternions_of(found.axes)
        columns |= {f"rot_{i}": quaternions[:, i] for i in range(4)}
        if self.harmonics is not None:
            flat = turned_harmonics(self.harmonics, rotation, of).reshape(len(of), -1)
            columns |= dict(zip(self.names, flat.T, strict=True))
        return columns


ON_FACE = 1e-9  # of the mesh's longest side: a point so near to its surface is not outside


@dataclass(frozen=True, eq=False)
class Embedding:
    """Where points lie in a mesh.

    mesh: The mesh at rest.
    tet: Tet of every point, shape (n,): the one around it, or the nearest.
    weights: Barycentric coordinates in it, shape (n, 4); some are negative outside.
    outside: Points in no tet, shape (n,): they follow the affine map of the nearest one.
    away: Distance of such a point from the surface [m], shape (n,); 0 of points inside.
    """

    mesh: TetMesh
    tet: Int[np.ndarray, "n"]
    weights: Float[np.ndarray, "n 4"]
    outside: Bool[np.ndarray, "n"]
    away: Float[np.ndarray, "n"]

    @cached_property
    def _used(self) -> tuple[Int[np.ndarray, "used"], Int[np.ndarray, "n"]]:
        """The tets that hold a point, and which of them every point has."""
        tets, of = np.unique(self.tet, return_inverse=True)
        return tets, of

    @cached_property
    def _rest(self) -> Float[np.ndarray, "used 3 3"]:
        """Inverse of the edge matrix of the used tets at rest."""
        return np.linalg.inv(self._edges(self.mesh.points))

    def _edges(self, points: np.ndarray) -> np.ndarray:
        corners = points[self.mesh.tets[self._used[0]]]
        return (corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1)

    @property
    def of_point(self) -> Int[np.ndarray, "n"]:
        """Row of every point in what ``gradients`` returns."""
        return self._used[1]

    def positions(self, displacement: Float[np.ndarray, "points 3"]) -> Float[np.ndarray, "n 3"]:
        """Positions [m] of the points when the mesh points are moved by ``displacement`` [m]."""
        moved = self.mesh.points + displacement
        return np.einsum("nk,nki->ni", self.weights, moved[self.mesh.tets[self.tet]])

    def gradients(
        self, displacement: Float[np.ndarray, "points 3"]
    ) -> Float[np.ndarray, "used 3 3"]:
        """Deformation gradient F of every tet that holds a point; ``of_point`` says which."""
        return self._edges(self.mesh.points + displacement) @ self._rest


def embed(mesh: TetMesh, positions: Float[np.ndarray, "n 3"]) -> Embedding:
    """Find the tet around every position [m], or the nearest one where there is none."""
    import igl

    tet, away = containing_tets(mesh, positions), np.zeros(len(positions))
    outside = tet < 0
    if outside.any():  # the tet behind the nearest boundary face
        where, faces = np.ascontiguousarray(positions[outside]), mesh.boundary.faces
        squared, face, _ = igl.point_mesh_squared_distance(
            where, mesh.points, faces.astype(np.int64)
        )
        tet[outside], away[outside] = mesh.boundary.tet[np.asarray(face)], np.sqrt(squared)
        outside[outside] = away[outside] > ON_FACE * np.ptp(mesh.bounds, axis=0).max()
    corners = mesh.points[mesh.tets[tet]]
    edges = (corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1)
    three = np.linalg.solve(edges, (positions - corners[:, 0])[:, :, None])[:, :, 0]
    weights = np.column_stack([1 - three.sum(axis=1), three])
    return Embedding(mesh, tet, weights, outside, np.where(outside, away, 0.0))
