"""Carriers moved by a mesh: splats and points that follow its tets, frame by frame."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Bool, Float, Int

from ..fem.particle_run import ParticleRun
from ..fem.scene.mesh import TetMesh
from .embedding import Embedding, embed
from .points.splats.covariances import matrices_of, polar, quaternions_of, stretched
from .points.splats.gaussians import gaussians
from .points.splats.harmonics import COUNTS, turned_harmonics
from .points.table import XYZ, PointTable

if TYPE_CHECKING:
    from ..fem.mpm.sampling import Followers

NORMALS = ("nx", "ny", "nz")


@dataclass(frozen=True, eq=False)
class Driven:
    """A table of points or splats embedded in a mesh at rest.

    ``valid`` are the points with a finite position; the others stay as they are. ``scale`` is the
    metres per unit of the table.
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
        splats = _Splats(self.table, self.valid) if self.table.is_splat else None
        for displacement in displacements:
            yield self._moved(displacement, splats)

    def _moved(self, displacement: Any, splats: _Splats | None) -> PointTable:
        found = self.embedding
        positions = found.positions(displacement) / self.scale
        moved = dict(zip(XYZ, positions.T, strict=True))
        normals = self._normals()
        if splats is not None or normals is not None:
            rotation, stretch = polar(found.gradients(displacement))
            if splats is not None:
                moved |= splats.moved(rotation, stretch, found.of_point)
            if normals is not None:
                moved |= _turned_normals(normals, rotation[found.of_point], stretch[found.of_point])
        return self.table.with_columns({name: self._spread(name, v) for name, v in moved.items()})

    def _normals(self) -> np.ndarray | None:
        """Normals of the valid points, where there are any."""
        if not all(name in self.table.columns for name in NORMALS):
            return None
        found = np.stack([self.table.columns[name] for name in NORMALS], axis=1).astype(float)
        return found[self.valid] if found.any() else None

    def _spread(self, name: str, values: np.ndarray) -> np.ndarray:
        """New values in the type of the column; invalid points keep the old ones."""
        old = np.asarray(self.table.columns[name])
        if self.valid.all():
            return values.astype(old.dtype)
        new = old.copy()
        new[self.valid] = values
        return new


def _turned_normals(
    normals: np.ndarray, rotation: np.ndarray, stretch: np.ndarray
) -> dict[str, np.ndarray]:
    """Columns of normals under F = R U: F^-T n, each at its length."""
    across = np.linalg.solve(stretch, normals[:, :, None])
    wanted = (rotation @ across)[:, :, 0]
    length = np.linalg.norm(wanted, axis=1, keepdims=True)
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    return dict(zip(NORMALS, (wanted * size / np.where(length > 0, length, 1)).T, strict=True))


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

        from ..fem.mpm.sampling import Followers

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
        columns = {f"scale_{i}": scales[:, i] for i in range(3)}
        quaternions = quaternions_of(found.axes)
        columns |= {f"rot_{i}": quaternions[:, i] for i in range(4)}
        if self.harmonics is not None:
            flat = turned_harmonics(self.harmonics, rotation, of).reshape(len(of), -1)
            columns |= dict(zip(self.names, flat.T, strict=True))
        return columns
