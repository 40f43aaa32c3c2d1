"""A material field as a body: particles straight from its voxels, or tets that carry them."""

from __future__ import annotations

import itertools
from collections.abc import Mapping

import numpy as np

from ..fem.mpm.classes import Substance
from ..fem.mpm.particles import JELLY, Particles
from ..fem.scene.material import ElementMaterial
from ..fem.scene.mesh import TetMesh
from ..predictors.field import MaterialField


def particles_of_field(
    field: MaterialField, *, along: int = 2, substances: Mapping[str, Substance] | None = None
) -> Particles:
    """Fill every occupied voxel with ``along``^3 particles of its values, all at rest.

    ``substances`` are class and yield by name of part; jelly where none is named. A grid of the
    field's own spacing suits them.
    """
    cells, h = np.argwhere(field.occupied), field.grid.h
    offsets = (np.array(list(np.ndindex((along,) * 3))) + 0.5) / along - 0.5
    x = field.grid.to_world(cells[:, None] + offsets).reshape(-1, 3)
    part, names = _parts(field)
    of = np.repeat(np.arange(len(cells)), along**3)
    values = (getattr(field, name)[field.occupied][of] for name in ("E", "nu", "rho"))
    E, nu, rho = values
    return Particles(
        x=x, volume=np.full(len(x), (h / along) ** 3), E=E, nu=nu, rho=rho, part=part[of],
        parts=names, substance=part[of].copy(), velocity=np.zeros_like(x),
        substances=tuple((substances or {}).get(name, JELLY) for name in names),
        rigid=np.full(len(x), -1, dtype=np.int64),
    )  # fmt: skip


def tets_of_field(field: MaterialField) -> TetMesh:
    """Six tets (Kuhn) in every occupied voxel, with its values: what a scene holds and loads.

    Its surface is that of the voxels, in steps: fit for particles, not for stresses.
    """
    cells = np.argwhere(field.occupied)
    corners = np.array(list(np.ndindex(2, 2, 2)))
    nodes, ids = np.unique((cells[:, None] + corners).reshape(-1, 3), axis=0, return_inverse=True)
    ids = ids.reshape(-1, 8)
    step = np.array([4, 2, 1])  # from a corner to its neighbour along x, y, z
    paths = [
        np.concatenate([[0], np.cumsum(step[list(order)])])
        for order in itertools.permutations(range(3))
    ]
    part, names = _parts(field)
    of = np.repeat(np.arange(len(cells)), len(paths))
    mesh = TetMesh.oriented(
        field.grid.to_world(nodes - 0.5), ids[:, paths].reshape(-1, 4), part[of].astype(np.int32),
        region_names=names,
    )  # fmt: skip
    values = (getattr(field, name)[field.occupied][of] for name in ("E", "nu", "rho"))
    return mesh.with_material(ElementMaterial(*values))


def _parts(field: MaterialField) -> tuple[np.ndarray, tuple[str, ...]]:
    """Index into the names of the parts of every occupied voxel; names that none has are left."""
    if field.part is None:
        return np.zeros(int(field.occupied.sum()), dtype=np.int64), ("body",)
    used, part = np.unique(field.part[field.occupied], return_inverse=True)
    return part, tuple(field.part_names[i] for i in used)
