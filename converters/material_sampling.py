"""A field sampled at every tet of a mesh."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from ..fem.scene.material import ElementMaterial
from ..fem.scene.mesh import TetMesh
from ..predictors.field import MaterialField
from ..predictors.sampling import ANY_PART, sample_field

Mode = Literal["centroid", "quadrature"]

# Four-point rule of degree 2 on a tet: barycentric coordinates (5 -+ sqrt 5) / 20.
_NEAR, _FAR = (5 + 3 * 5**0.5) / 20, (5 - 5**0.5) / 20
_QUADRATURE = np.full((4, 4), _FAR) + (_NEAR - _FAR) * np.eye(4)


class SampledMesh(NamedTuple):
    """A mesh with its material, and how it was sampled.

    ``n_fallback`` samples found no voxel of their part around them, the nearest was at most
    ``max_fallback_distance`` [m] away; ``unmatched`` regions have no part of their name in the
    field and took the nearest part.
    """

    mesh: TetMesh
    n_fallback: int
    max_fallback_distance: float
    unmatched: tuple[str, ...]


def sample_material(mesh: TetMesh, field: MaterialField, *, mode: Mode = "centroid") -> SampledMesh:
    """Give every tet E [Pa], nu, rho [kg/m^3] of the field.

    A region samples only the part of its own name.

    ``centroid`` takes one sample a tet; ``quadrature`` the mean of four in (log10 E, nu,
    log10 rho), for tets larger than a voxel.
    """
    part, unmatched = _parts(mesh, field)
    at = np.full((1, 4), 0.25) if mode == "centroid" else _QUADRATURE
    points = np.einsum("qv,tvi->tqi", at, mesh.points[mesh.tets]).reshape(-1, 3)
    sample = sample_field(field, points, part=np.repeat(part, len(at)))
    logE, nu, logrho = (
        values.reshape(-1, len(at)).mean(axis=1)
        for values in (np.log10(sample.E), sample.nu, np.log10(sample.rho))
    )
    return SampledMesh(
        mesh.with_material(ElementMaterial(10**logE, nu, 10**logrho)),
        sample.n_fallback,
        sample.max_fallback_distance,
        unmatched,
    )


def _parts(mesh: TetMesh, field: MaterialField) -> tuple[np.ndarray, tuple[str, ...]]:
    """Part label of every tet by the name of its region, and the names without a part."""
    if field.part is None:
        return np.full(len(mesh.tets), ANY_PART), ()
    held = set(np.unique(field.part[field.occupied]))
    label = {name: i for i, name in enumerate(field.part_names) if i in held}
    of_region = np.array([label.get(name, ANY_PART) for name in mesh.region_names])
    used = [mesh.region_names[i] for i in np.unique(mesh.region)]
    return of_region[mesh.region], tuple(name for name in used if name not in label)
