"""Edges for thin places: how thick a solid is, and a field of edge lengths made from that."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from ..surfaces.samples import sample
from ..surfaces.triangles import Triangles

# Of the wanted edge: no place gets shorter ones. Tets of a plate go with the square of the edge,
# so that a sheet of paper on a table would have a million.
SHORTEST = 0.25
# Of a layer's thickness: tets lie a little flat, and shorter edges cost the square of their number.
REACH = 4 / 3
SEED = 0  # of the rays: equal surfaces give equal fields, which the cache recognises
RAYS = 20_000  # from the surface inward: one for each hundredth of its size, both ways
START = 1e-4  # of the wanted edge: how far below the surface a ray starts
CELL = 1.0  # of the wanted edge: cells of the field
# Corners of a cube, numbered by their bits zyx, in six tets around its diagonal.
CUBE_TETS = np.array(
    [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]]
)


def edge_field(surface: Triangles, *, edge: float, layers: int) -> dict[str, np.ndarray]:
    """Edge lengths that give thin places ``layers`` tets through their thickness.

    Returns what the engine takes: ``bg_vertices`` (n, 3), ``bg_tets`` (m, 4) and the edge at each
    vertex, ``bg_values`` (n,), at most ``edge``; nothing where no place is that thin. Lengths are
    in the unit of the surface.
    """
    rng = np.random.default_rng(SEED)
    start, end, thickness = thicknesses(surface, edge=edge, rng=rng)
    wanted = np.maximum(REACH * thickness / layers, SHORTEST * edge)
    thin = wanted < edge
    if not thin.any():
        return {}
    lo = surface.points.min(axis=0) - CELL * edge
    shape = np.ceil(np.ptp(surface.points, axis=0) / (CELL * edge)).astype(int) + 3
    where = np.concatenate([start[thin], (start[thin] + end[thin]) / 2, end[thin]])
    cell = np.floor((where - lo) / (CELL * edge)).astype(int)
    values = np.full(shape, edge)
    for corner in np.ndindex(2, 2, 2):
        np.minimum.at(values, tuple((cell + corner).T), np.tile(wanted[thin], 3))
    vertices = lo + CELL * edge * np.argwhere(np.ones(shape, dtype=bool))
    return {"bg_vertices": vertices, "bg_tets": _lattice(shape), "bg_values": values.reshape(-1)}


def thicknesses(
    surface: Triangles, *, edge: float, rng: np.random.Generator, count: int = RAYS
) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"], Float[np.ndarray, "n"]]:
    """Random points of an outward surface, the points opposite to them, and how far those are.

    Points are left out where nothing is opposite.
    """
    from trimesh import Trimesh
    from trimesh.ray.ray_pyembree import RayMeshIntersector

    where, normal = sample(surface.points, surface.faces, rng=rng, count=count)
    origin = where - START * edge * normal
    rays = RayMeshIntersector(Trimesh(*surface, process=False))
    hit, ray, _ = rays.intersects_location(origin, -normal, multiple_hits=False)
    return where[ray], hit, np.linalg.norm(hit - where[ray], axis=1)


def _lattice(shape: Int[np.ndarray, "3"]) -> Int[np.ndarray, "tets 4"]:
    """Six tets in every cell of a lattice of points, in the order of ``numpy.argwhere``."""
    number = np.arange(shape.prod()).reshape(shape)
    corners = [
        number[i : shape[0] - 1 + i, j : shape[1] - 1 + j, k : shape[2] - 1 + k].reshape(-1)
        for k, j, i in np.ndindex(2, 2, 2)
    ]
    return np.stack(corners, axis=1)[:, CUBE_TETS].reshape(-1, 4).astype(np.int32)
