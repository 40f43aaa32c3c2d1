"""Particles out of tets, and points that follow particles."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ..discrete.assembly import discretise
from ..discrete.forces import load_vector
from ..scene.boundary import boundary_faces, face_areas
from ..scene.mesh import TetMesh
from ..scene.scene import Scene
from .particles import ParticleState

# Pairs of tet and place that are tested at a time: 20 MB.
PAIRS = 200_000
# A place on a face is in a tet down to this barycentric coordinate.
ON_FACE = -1e-9
# Particles that a point follows: those around it in every direction.
NEAREST = 8
# A part thinner than this many cells bends wrongly: 4 % at two, 1.2 % at four.
THIN = 2.0


class TetSample(NamedTuple):
    """Places ``x`` (n, 3) [m] on a regular lattice, ``tet`` (n,) and ``volume`` (n,) [m^3] of each.

    ``thin`` are names of parts that are about less than two cells of the grid thick.
    """

    x: np.ndarray
    tet: np.ndarray
    volume: np.ndarray
    thin: tuple[str, ...]


def sample_tets(mesh: TetMesh, spacing: float, *, along: int = 2) -> TetSample:
    """Fill ``mesh`` with ``along``^3 particles a cell of a grid of ``spacing`` [m].

    The volumes add up to that of every region; a region that no place lies in gets its largest tet.
    """
    h = spacing / along
    origin = mesh.bounds[0] + h / 2
    corners = mesh.points[mesh.tets]
    low = np.ceil((corners.min(axis=1) - origin) / h - 1e-9).astype(np.int64)
    high = np.floor((corners.max(axis=1) - origin) / h + 1e-9).astype(np.int64)
    extent = np.maximum(high - low + 1, 0)
    maps = np.linalg.inv((corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1))
    ends = np.cumsum(extent.prod(axis=1))
    cuts = np.unique([0, *np.searchsorted(ends, np.arange(PAIRS, ends[-1], PAIRS)), len(ends)])
    places, owners = [], []
    for a, b in pairwise(cuts):
        node, owner = _in_boxes(low[a:b], extent[a:b])
        owner = owner + a
        three = np.einsum("nij,nj->ni", maps[owner], origin + h * node - corners[owner, 0])
        inside = (three >= ON_FACE).all(axis=1) & (three.sum(axis=1) <= 1 - ON_FACE)
        places.append(node[inside])
        owners.append(owner[inside])
    node, owner = np.concatenate(places), np.concatenate(owners)
    _, first = np.unique(node, axis=0, return_index=True)  # on a face: in one tet only
    x, tet = origin + h * node[first], owner[first]
    empty = np.setdiff1d(np.unique(mesh.region), mesh.region[tet])
    for region in empty:
        largest = int(np.argmax(np.where(mesh.region == region, mesh.volumes, -1.0)))
        x = np.concatenate([x, corners[largest].mean(axis=0)[None]])
        tet = np.append(tet, largest)
    region = mesh.region[tet]
    volumes = np.bincount(mesh.region, mesh.volumes, len(mesh.region_names))
    counts = np.bincount(region, minlength=len(mesh.region_names))
    return TetSample(x, tet, (volumes / np.maximum(counts, 1))[region], _thin(mesh, spacing))


def _in_boxes(
    low: Int[np.ndarray, "tets 3"], extent: Int[np.ndarray, "tets 3"]
) -> tuple[np.ndarray, np.ndarray]:
    """Places of the lattice in boxes, and the box of each."""
    counts = extent.prod(axis=1)
    owner = np.repeat(np.arange(len(low)), counts)
    rank = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    wide, deep = extent[owner, 2], extent[owner, 1]
    local = np.stack([rank // (wide * deep), rank // wide % deep, rank % wide], axis=1)
    return low[owner] + local, owner


def _thin(mesh: TetMesh, spacing: float) -> tuple[str, ...]:
    """Parts of less than two cells, by volume over surface: half of a plate, a quarter of a rod."""
    found = []
    for k, name in enumerate(mesh.region_names):
        own = mesh.region == k
        if own.any():
            area = face_areas(mesh.points, boundary_faces(mesh.tets[own]).faces).sum()
            if 3 * mesh.volumes[own].sum() / area < THIN * spacing:
                found.append(name)
    return tuple(found)


@dataclass(frozen=True, eq=False)
class Followers:
    """Points that follow the particles around them: x' = sum w (x_j + F_j (X - X_j)).

    Parameters
    ----------
    near
        The particles that every point follows, shape (n, k).
    weights
        Their weights, shape (n, k), of sum one.
    arms
        Ways [m] from them to the point at rest, shape (n, k, 3).
    """

    near: Int[np.ndarray, "n k"]
    weights: Float[np.ndarray, "n k"]
    arms: Float[np.ndarray, "n k 3"]

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
        known = np.isin(labels, np.unique(parts))
        for part in [*np.unique(labels[known]), None]:
            asking = ~known if part is None else labels == part
            sources = np.arange(len(rest)) if part is None else np.flatnonzero(parts == part)
            if asking.any():
                k = min(count, len(sources))
                far, row = KDTree(rest[sources]).query(points[asking], k=k)
                near[asking, :k] = sources[row.reshape(-1, k)]
                away[asking, :k] = far.reshape(-1, k)
        smallest = np.maximum(away[:, :1], 1e-3 * np.median(away[:, 0]) + 1e-300)
        weights = 1 / (away / smallest + 1e-9) ** 2
        weights /= weights.sum(axis=1, keepdims=True)
        return cls(near, weights, points[:, None] - rest[near])

    def positions(self, state: ParticleState) -> Float[np.ndarray, "n 3"]:
        """Positions [m] of the points."""
        moved = state.x[self.near] + np.einsum("nkij,nkj->nki", state.F[self.near], self.arms)
        return np.einsum("nk,nki->ni", self.weights, moved)

    def gradients(self, state: ParticleState) -> Float[np.ndarray, "n 3 3"]:
        """Deformation gradient at every point."""
        return np.einsum("nk,nkij->nij", self.weights, state.F[self.near])


def mesh_followers(
    mesh: TetMesh, rest: Float[np.ndarray, "particles 3"], parts: Int[np.ndarray, "particles"]
) -> Followers:
    """The points of a mesh after particles of a region of theirs."""
    labels = np.zeros(len(mesh.points), dtype=np.int64)
    labels[mesh.tets.ravel()] = np.repeat(mesh.region, 4)
    return Followers.of(mesh.points, rest, labels=labels, parts=parts)


def particle_forces(
    scene: Scene, rest: Float[np.ndarray, "particles 3"]
) -> Float[np.ndarray, "particles 3"]:
    """Forces [N] on particles: those of every mesh point go to the particles around it."""
    total = np.zeros_like(rest)
    if scene.tractions or scene.forces is not None:
        space = discretise(scene.mesh, 1)
        load = load_vector(scene.mesh, space, traction=scene.tractions, forces=scene.forces)
        loaded = np.flatnonzero(load.any(axis=1))
        one, points = np.zeros(len(rest), dtype=np.int64), scene.mesh.points[loaded]
        found = Followers.of(points, rest, labels=np.zeros(len(loaded), dtype=np.int64), parts=one)
        np.add.at(total, found.near, found.weights[:, :, None] * load[loaded, None])
    return total
