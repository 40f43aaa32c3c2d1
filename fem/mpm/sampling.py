"""Particles out of tets, and points that follow particles."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

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
# Particles along a cell, and along one in a part that is thinner than ``THIN`` cells and bends.
# Cantilevers against quadratic tets, two along a cell: 1.2 % too soft at four cells of thickness, 4
# to 6 % at two, 16 to 26 % at one, and 280 % at 0.6; with four along a cell 2, 1 to 5 and 52 %.
ALONG, FINE = 2, 4
THIN = 2.0


class TetSample(NamedTuple):
    """Places ``x`` (n, 3) [m] on regular lattices, ``tet`` (n,) and ``volume`` (n,) [m^3] of each.

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
    of every region; a region that no place lies in gets its largest tet.
    """
    cells = _thickness(mesh) / spacing
    fine = np.zeros(len(cells), dtype=bool) if bends is None else bends & (cells < THIN)
    places, owners = [], []
    for along, regions in ((ALONG, ~fine), (FINE, fine)):
        tets = np.flatnonzero(regions[mesh.region])
        found, owner = _lattice(mesh, tets, spacing / along)
        places.append(found)
        owners.append(tets[owner])
    x, tet = np.concatenate(places), np.concatenate(owners)
    for region in np.setdiff1d(np.unique(mesh.region), mesh.region[tet]):
        largest = int(np.argmax(np.where(mesh.region == region, mesh.volumes, -1.0)))
        x = np.concatenate([x, mesh.points[mesh.tets[largest]].mean(axis=0)[None]])
        tet = np.append(tet, largest)
    region = mesh.region[tet]
    volumes = np.bincount(mesh.region, mesh.volumes, len(mesh.region_names))
    counts = np.bincount(region, minlength=len(mesh.region_names))
    thin = np.flatnonzero(cells < THIN)
    names = tuple(mesh.region_names[k] for k in thin)
    return TetSample(x, tet, (volumes / np.maximum(counts, 1))[region], names)


def _lattice(mesh: TetMesh, tets: Int[np.ndarray, "some"], h: float) -> tuple[Any, Any]:
    """Places [m] of a lattice of spacing ``h`` [m] in some tets, and which of them it is."""
    origin = mesh.bounds[0] + h / 2
    corners = mesh.points[mesh.tets[tets]]
    if not len(tets):
        return np.zeros((0, 3)), tets
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
    return origin + h * node[first], owner[first]


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


def _thickness(mesh: TetMesh) -> Float[np.ndarray, "regions"]:
    """Thickness [m] of the parts by volume over surface: half of a plate, a quarter of a rod."""
    found = np.full(len(mesh.region_names), np.inf)
    for k in np.unique(mesh.region):
        own = mesh.region == k
        area = face_areas(mesh.points, boundary_faces(mesh.tets[own]).faces).sum()
        found[k] = 3 * mesh.volumes[own].sum() / area
    return found


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
