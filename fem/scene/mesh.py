"""The tetrahedral mesh: points, tets, named regions and, once assigned, their material."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from ..errors import InputError
from .boundary import (
    Boundary,
    boundary_faces,
    cross,
    edge_vectors,
    tet_area_vectors,
)
from .material import ElementMaterial, wave_speed

# Sizes [m] that things which people assign materials to have: beyond, a unit was likely mistaken.
USUAL_SIZE = (0.002, 30.0)


def signed_volumes(
    points: Float[np.ndarray, "points 3"], tets: Int[np.ndarray, "tets 4"]
) -> Float[np.ndarray, "tets"]:
    """Signed volume [m^3] of every tet, positive where (b-a, c-a, d-a) is right-handed."""
    b, c, d = edge_vectors(points, tets)
    x, y, z = cross(b, c)
    return (x * d[0] + y * d[1] + z * d[2]) / 6


def altitudes(
    points: Float[np.ndarray, "points 3"], tets: Int[np.ndarray, "tets 4"]
) -> Float[np.ndarray, "tets 4"]:
    """Distance [m] of every vertex of every tet from the opposite face."""
    area = np.linalg.norm(tet_area_vectors(points, tets), axis=1)
    return (3 * signed_volumes(points, tets) / area).T


@dataclass(frozen=True, eq=False)
class TetMesh:
    """A tetrahedral mesh in metres.

    Parameters
    ----------
    points
        Vertex positions [m], shape (points, 3), float64.
    tets
        Point ids, shape (tets, 4), int32, positively oriented.
    region
        Index into ``region_names`` of every tet, shape (tets,).
    region_names
        Name of every region, unique.
    material
        E, nu, rho of every tet, or None before ``assign``.

    Raises
    ------
    InputError
        On wrong shapes, values that are not finite, ids out of range or a tet that is not positive.

    The arrays are copies that cannot be written to: what is kept of them stays true.
    """

    points: Float[np.ndarray, "points 3"]
    tets: Int[np.ndarray, "tets 4"]
    region: Int[np.ndarray, "tets"]
    region_names: tuple[str, ...] = ("body",)
    material: ElementMaterial | None = None

    def __repr__(self) -> str:
        names = ", ".join(self.region_names[:5]) + ", ..." * (len(self.region_names) > 5)
        known = "" if self.material is None else ", with E, nu and rho"
        return f"<TetMesh: {len(self.tets):,} tets, {len(self.points):,} points, {names}{known}>"

    def __post_init__(self) -> None:
        points = _frozen(self.points, np.float64)
        tets = _frozen(self.tets, np.int32)
        region = _frozen(self.region, np.int32)
        _check_arrays(points, tets, region, self.region_names)
        volumes = signed_volumes(points, tets)
        bad = np.flatnonzero(~(volumes > 0))
        if bad.size:
            raise InputError(
                f"tet {bad[0]} has volume {volumes[bad[0]]:g} m^3 ({bad.size} of {len(tets)} tets "
                "are flat or inverted): wanted > 0; TetMesh.oriented(...) flips mirrored tets"
            )
        if self.material is not None and self.material.E.size != len(tets):
            raise InputError(f"material of {self.material.E.size} tets on a mesh of {len(tets)}")
        for name, value in (("points", points), ("tets", tets), ("region", region)):
            object.__setattr__(self, name, value)
        object.__setattr__(self, "region_names", tuple(self.region_names))

    @classmethod
    def oriented(cls, points, tets, region=None, **fields) -> TetMesh:
        """Build a mesh from tets of either winding: mirrored ones get two vertices swapped.

        Without ``region`` all tets are in region 0.
        """
        points = np.asarray(points, dtype=np.float64)
        tets = np.array(tets, dtype=np.int32)
        if tets.ndim == 2 and tets.shape[1:] == (4,) and tets.size and tets.max() < len(points):
            mirrored = signed_volumes(points, tets) < 0
            tets[mirrored] = tets[mirrored][:, [0, 1, 3, 2]]
        if region is None:
            region = np.zeros(len(tets), dtype=np.int32)
        return cls(points, tets, region, **fields)

    @property
    def volumes(self) -> Float[np.ndarray, "tets"]:
        """Volume [m^3] of every tet."""
        return signed_volumes(self.points, self.tets)

    @property
    def volume(self) -> float:
        """Total volume [m^3]."""
        return float(self.volumes.sum())

    @property
    def centroids(self) -> Float[np.ndarray, "tets 3"]:
        """Centroid [m] of every tet."""
        return self.points[self.tets].mean(axis=1)

    @property
    def bounds(self) -> Float[np.ndarray, "2 3"]:
        """Lower and upper corner [m] of the axis-aligned box around the used points."""
        used = self.points[np.unique(self.tets)]
        return np.stack([used.min(axis=0), used.max(axis=0)])

    @property
    def mass(self) -> float:
        """Total mass [kg]: sum of rho V over the tets."""
        return float(material_of(self).rho @ self.volumes)

    @property
    def boundary(self) -> Boundary:
        """Outward boundary faces and the tets that own them."""
        return boundary_faces(self.tets)

    def region_volumes(self) -> Float[np.ndarray, "regions"]:
        """Volume [m^3] of every region, in the order of ``region_names``."""
        return np.bincount(self.region, weights=self.volumes, minlength=len(self.region_names))

    def with_material(self, material: ElementMaterial | None) -> TetMesh:
        """Return the same mesh with another material."""
        return replace(self, material=material)


def join_meshes(mesh: TetMesh, other: TetMesh, shift: Float[np.ndarray, "3"]) -> TetMesh:
    """One mesh of two that share no point, ``other`` moved by ``shift`` [m].

    Its regions come last; a name that is taken gets a number.
    """
    names = list(mesh.region_names)
    for name in other.region_names:
        count = 1
        while (free := name if count == 1 else f"{name} {count}") in names:
            count += 1
        names.append(free)
    one, two = material_of(mesh), material_of(other)
    values = (np.concatenate([getattr(one, k), getattr(two, k)]) for k in ("E", "nu", "rho"))
    return TetMesh(
        np.concatenate([mesh.points, other.points + shift]),
        np.concatenate([mesh.tets, other.tets + len(mesh.points)]),
        np.concatenate([mesh.region, other.region + len(mesh.region_names)]),
        tuple(names),
        ElementMaterial(*values),
    )


def material_of(mesh: TetMesh) -> ElementMaterial:
    """Material of ``mesh``; ``InputError`` where it has none yet."""
    if mesh.material is None:
        raise InputError("the mesh has no material yet: run `assign` first")
    return mesh.material


def edge_share(mesh: TetMesh) -> float:
    """Median length [1] of the first edges of its tets, as a share of its bounding diagonal."""
    lengths = np.linalg.norm(edge_vectors(mesh.points, mesh.tets), axis=1)
    return float(np.median(lengths) / np.linalg.norm(np.ptp(mesh.bounds, axis=0)))


def largest_explicit_step(mesh: TetMesh) -> float:
    """Largest stable step [s] of explicit dynamics: a pressure wave crosses no altitude in less."""
    material = material_of(mesh)
    speed = wave_speed(material.E, material.nu, material.rho)
    return float((altitudes(mesh.points, mesh.tets).min(axis=1) / speed).min())


def _frozen(given, dtype: type) -> np.ndarray:
    """Copy of an array that cannot be written to; one of this kind already is taken as it is."""
    array = np.asarray(given)
    frozen = array.base is None and not array.flags.writeable
    if not (frozen and array.dtype == dtype and array.flags.c_contiguous):
        array = np.array(given, dtype=dtype, order="C")
        array.flags.writeable = False
    return array


def _check_arrays(points, tets, region, region_names) -> None:
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"points must have shape (points, 3), got {points.shape}")
    if tets.ndim != 2 or tets.shape[1] != 4 or len(tets) == 0:
        raise InputError(f"tets must have shape (tets, 4) with at least one tet, got {tets.shape}")
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if bad.size:
        raise InputError(
            f"point {bad[0]} is not finite ({bad.size} of {len(points)}): {points[bad[0]]}"
        )
    if tets.min() < 0 or tets.max() >= len(points):
        raise InputError(
            f"tets name points {tets.min()}..{tets.max()}, the mesh has 0..{len(points) - 1}"
        )
    if region.shape != (len(tets),):
        raise InputError(f"region must have shape ({len(tets)},), got {region.shape}")
    if len(set(region_names)) != len(region_names):
        raise InputError(f"region names must be unique, got {list(region_names)}")
    if region.min() < 0 or region.max() >= len(region_names):
        raise InputError(
            f"region ids {region.min()}..{region.max()} but {len(region_names)} region names"
        )
