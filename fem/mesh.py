"""The tetrahedral mesh: points, tets, named regions and, once assigned, their material.

With its components, what is joined firmly enough to move as one body, and its boundary.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from .errors import InputError
from .material import ElementMaterial, wave_speed
from .note import Note

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

    Examples
    --------
    >>> from autophyx_tet.fem import TetMesh
    >>> points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]  # m
    >>> tet = TetMesh.oriented(points, [[0, 1, 2, 3]])
    >>> round(6 * tet.volume, 12)  # a sixth of the cube around it
    1.0
    """

    points: Float[np.ndarray, "points 3"]
    tets: Int[np.ndarray, "tets 4"]
    region: Int[np.ndarray, "tets"]
    region_names: tuple[str, ...] = ("body",)
    material: ElementMaterial | None = None

    def __repr__(self) -> str:
        names = ", ".join(self.region_names[:5]) + ", ..." * (len(self.region_names) > 5)
        known = "" if self.material is None else Note("mesh.nu_rho")
        return f"<TetMesh: {len(self.tets):,} tets, {len(self.points):,} points, {names}{known}>"

    def __post_init__(self) -> None:
        points = _frozen(self.points, np.float64)
        tets = _frozen(self.tets, np.int32)
        region = _frozen(self.region, np.int32)
        if points.ndim != 2 or points.shape[1] != 3:
            raise InputError("mesh.points_must", shape=points.shape)
        if tets.ndim != 2 or tets.shape[1] != 4 or len(tets) == 0:
            raise InputError("mesh.tets_must", shape=tets.shape)
        bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
        if bad.size:
            first, size = bad[0], bad.size
            raise InputError(
                "mesh.point_finite", bad=first, size=size, count=len(points), points=points[first]
            )
        low, high = tets.min(), tets.max()
        if low < 0 or high >= len(points):
            raise InputError("mesh.tets_name", min=low, max=high, count=len(points) - 1)
        if region.shape != (len(tets),):
            raise InputError("mesh.region_must", count=len(tets), shape=region.shape)
        if len(set(self.region_names)) != len(self.region_names):
            raise InputError("mesh.region_names", region_names=list(self.region_names))
        if region.min() < 0 or region.max() >= len(self.region_names):
            ids, names = f"{region.min()}..{region.max()}", len(self.region_names)
            raise InputError("mesh.region_ids", ids=ids, names=names)
        volumes = signed_volumes(points, tets)
        bad = np.flatnonzero(~(volumes > 0))
        if bad.size:
            first, size = bad[0], bad.size
            raise InputError(
                "mesh.tet_volume", bad=first, volumes=volumes[first], size=size, count=len(tets)
            )
        if self.material is not None and self.material.E.size != len(tets):
            raise InputError("mesh.material_tets", size=self.material.E.size, count=len(tets))
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
    both = material_of(mesh), material_of(other)
    values = (np.concatenate([getattr(m, name) for m in both]) for name in ("E", "nu", "rho"))
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
        raise InputError("mesh.mesh_material")
    return mesh.material


def edge_fraction(mesh: TetMesh) -> float:
    """Median length [1] of the first edges of its tets, as a share of its bounding diagonal."""
    lengths = np.linalg.norm(edge_vectors(mesh.points, mesh.tets), axis=1)
    return float(np.median(lengths) / np.linalg.norm(np.ptp(mesh.bounds, axis=0)))


def largest_explicit_step(mesh: TetMesh) -> float:
    """Largest stable step [s] of explicit dynamics: a pressure wave crosses no altitude in less."""
    material = material_of(mesh)
    speed = wave_speed(material.E, material.nu, material.rho)
    return float((altitudes(mesh.points, mesh.tets).min(axis=1) / speed).min())


def _frozen(values, dtype: type) -> np.ndarray:
    """Copy of an array that cannot be written to; one of this kind already is taken as it is."""
    array = np.asarray(values)
    frozen = array.base is None and not array.flags.writeable
    if not (frozen and array.dtype == dtype and array.flags.c_contiguous):
        array = np.array(values, dtype=dtype, order="C")
        array.flags.writeable = False
    return array


# Points are on one line when they leave it by less than this fraction of their extent.
FLATNESS = 1e-6
# Above this many components the dense matrix of their rigid motions is not worth making.
MAX_COMPONENTS = 300


def face_components(mesh: TetMesh) -> Int[np.ndarray, "tets"]:
    """Component of every tet: tets that share a face are in one; the first tet is in component 0.

    Tets that share only a corner or an edge form a hinge, not one body.
    """
    order, same = equal_faces(mesh.tets[:, FACES].reshape(-1, 3))
    pairs = order[:-1][same] // 4, order[1:][same] // 4
    return _components(pairs, len(mesh.tets)).astype(np.int64)


def point_components(mesh: TetMesh) -> Int[np.ndarray, "points"]:
    """Piece of every point: tets that share a point are in one; -1 for points of no tet.

    Pieces are numbered by their first point.
    """
    pairs = np.repeat(mesh.tets[:, 0], 3), mesh.tets[:, 1:].ravel()
    label, used = _components(pairs, len(mesh.points)), np.unique(mesh.tets)
    order, first = np.unique(label[used], return_index=True)
    number = np.full(label.max() + 1, -1, dtype=np.int64)
    number[order[np.argsort(first)]] = np.arange(len(order))
    return number[label]


def _components(pairs: tuple[np.ndarray, np.ndarray], count: int) -> np.ndarray:
    """Component of each of ``count`` things of which ``pairs`` are joined."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(len(pairs[0]), dtype=np.int8), pairs), shape=(count, count))
    return connected_components(graph, directed=False)[1]


def outer_faces(mesh: TetMesh) -> Bool[np.ndarray, "faces"]:
    """Which faces of ``mesh.boundary`` are of its outer surface, not of a closed cavity.

    Seen from outside of the solid a cavity is inside out: its volume is negative. Surfaces that
    share an edge are one.
    """
    faces = mesh.boundary.faces
    order, same = equal_faces(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2))
    label = _components((order[:-1][same] // 3, order[1:][same] // 3), len(faces))
    middle = mesh.points[faces].mean(axis=1) - mesh.bounds.mean(axis=0)
    volume = np.bincount(label, (middle * area_vectors(mesh.points, faces)).sum(axis=1))
    return volume[label] > 0


def piece_names(mesh: TetMesh) -> tuple[str, ...]:
    """Names of the parts in every piece of ``point_components``, the first three of each."""
    piece, names = point_components(mesh)[mesh.tets[:, 0]], []
    for k in range(int(piece.max()) + 1):
        inside = [mesh.region_names[i] for i in np.unique(mesh.region[piece == k])]
        names.append(" + ".join(inside[:3] + ["..."] * (len(inside) > 3)))
    return tuple(names)


def spans_plane(points: Float[np.ndarray, "n 3"]) -> bool:
    """Whether the points are at least three and not on one line."""
    if len(points) < 3:
        return False
    extent = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(extent[1] > FLATNESS * extent[0])


class FreeMotions(NamedTuple):
    """What a body may do without resistance.

    ``motions`` (points, 3, k) is a basis of the displacements, rigid in every component, that meet
    none; ``components`` (free,) are those that take part.
    """

    motions: Float[np.ndarray, "points 3 k"]
    components: Int[np.ndarray, "free"]


def free_motions(mesh: TetMesh, held: Bool[np.ndarray, "points 3"]) -> FreeMotions:
    """Rigid motions of the components of ``mesh`` that the entries ``held`` do not stop.

    Every component has six; supports, and points shared with others, resist them.

    Raises InputError: If the mesh has more than ``MAX_COMPONENTS`` components.
    """
    labels = face_components(mesh)
    count = int(labels.max()) + 1
    if count > MAX_COMPONENTS:
        raise InputError("mesh.separate_pieces", count=count, max_components=MAX_COMPONENTS)
    pairs = np.unique(np.stack([mesh.tets.ravel(), np.repeat(labels, 4)], axis=1), axis=0)
    point, component = pairs.T
    owner = np.zeros(len(mesh.points), dtype=np.int64)
    owner[point[::-1]] = component[::-1]  # the first component around every point
    scale = np.ptp(mesh.bounds, axis=0).max()
    motion = rigid_motions((mesh.points - mesh.bounds[0]) / scale)
    resistance = np.zeros((count, count, 6, 6))
    own = component == owner[point]
    stopped = motion[point[own]] * held[point[own], :, None]
    np.add.at(resistance, (component[own],) * 2, stopped.transpose(0, 2, 1) @ stopped)
    tied, first = component[~own], owner[point[~own]]
    tie = motion[point[~own]].transpose(0, 2, 1) @ motion[point[~own]]
    for a, b, sign in ((tied, tied, 1), (first, first, 1), (tied, first, -1), (first, tied, -1)):
        np.add.at(resistance, (a, b), sign * tie)
    square = resistance.transpose(0, 2, 1, 3).reshape(6 * count, 6 * count)
    value, mode = np.linalg.eigh(square)
    loose = mode[:, value < FLATNESS**2 * max(value[-1], 1.0)].reshape(count, 6, -1)
    moved = np.einsum("pim,pmk->pik", motion, loose[owner])
    moved[np.setdiff1d(np.arange(len(moved)), point)] = 0.0
    return FreeMotions(
        moved, np.flatnonzero(np.abs(loose).max(axis=(1, 2), initial=0.0) > FLATNESS)
    )


def rigid_motions(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3 6"]:
    """Displacement of every point in three unit translations and rotations about the origin."""
    motion = np.broadcast_to(np.eye(3, 6), (len(points), 3, 6)).copy()
    motion[:, :, 3:] = np.cross(np.eye(3), points[:, None]).mT
    return motion


# Outward faces of a positively oriented tet (vertex i is opposite to face i).
FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])


class Boundary(NamedTuple):
    """Outward faces of the boundary: ``faces`` (faces, 3) point ids, ``tet`` (faces,) owners."""

    faces: np.ndarray
    tet: np.ndarray


def boundary_faces(tets: Int[np.ndarray, "tets 4"]) -> Boundary:
    """Faces that belong to one tet only, oriented outward for positively oriented tets."""
    faces = tets[:, FACES].reshape(-1, 3)
    order, same = equal_faces(faces)
    single = np.ones(len(faces), dtype=bool)
    single[order[1:][same]] = single[order[:-1][same]] = False
    index = np.flatnonzero(single)
    return Boundary(faces[index], index // 4)


class EqualFaces(NamedTuple):
    """An ``order`` (n,) of faces in which equal ones are neighbours; ``same`` (n - 1,) says which.

    Rising by their sorted corners, and by their number where those are equal.
    """

    order: np.ndarray
    same: np.ndarray


def equal_faces(faces: Int[np.ndarray, "n k"]) -> EqualFaces:
    """Find the faces, or edges, that have the same corners in any order."""
    corners = np.sort(faces, axis=1).astype(np.int64, copy=False)
    size, count = int(corners.max(initial=0)) + 1, corners.shape[1]
    if size**count > np.iinfo(np.int64).max:
        order = np.lexsort(corners.T[::-1])
        return EqualFaces(order, (corners[order][1:] == corners[order][:-1]).all(axis=1))
    key = corners @ size ** np.arange(count)[::-1]  # far faster to sort
    order = np.argsort(key, kind="stable")
    return EqualFaces(order, np.diff(key[order]) == 0)


def area_vectors(
    points: Float[np.ndarray, "points 3"], faces: Int[np.ndarray, "*faces 3"]
) -> Float[np.ndarray, "*faces 3"]:
    """Area vector [m^2] of every face: its area along its normal.

    The four outward faces of every tet are ``tets[:, FACES]``.
    """
    return np.stack(cross(*edge_vectors(points, faces)), axis=-1) / 2


def edge_vectors(
    points: Float[np.ndarray, "points 3"], cells: Int[np.ndarray, "*cells k"]
) -> list[Float[np.ndarray, "3 *cells"]]:
    """Vectors [m] from the first corner of every cell to each other one, component by component.

    Long rows of one component are gathered and multiplied several times faster than short vectors.
    """
    rows = np.ascontiguousarray(points.T)
    first, *others = (rows.take(corner, axis=1) for corner in np.moveaxis(cells, -1, 0))
    return [other - first for other in others]


def barycentric(
    corners: Float[np.ndarray, "n 4 3"], places: Float[np.ndarray, "#n 3"]
) -> Float[np.ndarray, "n 4"]:
    """Barycentric coordinates of each place [m], or the only one, in each tet; outside some < 0."""
    edges = (corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1)
    three = np.linalg.solve(edges, (places - corners[:, 0])[:, :, None])[:, :, 0]
    return np.column_stack([1 - three.sum(axis=1), three])


def cross(
    u: Float[np.ndarray, "3 *cells"], v: Float[np.ndarray, "3 *cells"]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Components of the vector products of vectors given component by component."""
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


def tet_area_vectors(
    points: Float[np.ndarray, "points 3"], tets: Int[np.ndarray, "tets 4"]
) -> Float[np.ndarray, "4 3 tets"]:
    """Area vectors [m^2] of the four outward ``FACES`` of every tet, component by component."""
    b, c, d = edge_vectors(points, tets)
    out = np.array([np.zeros_like(b), cross(d, c), cross(b, d), cross(c, b)]) / 2
    out[0] = -out[1:].sum(axis=0)  # the surface is closed
    return out


def face_areas(
    points: Float[np.ndarray, "points 3"], faces: Int[np.ndarray, "faces 3"]
) -> Float[np.ndarray, "faces"]:
    """Area [m^2] of every face."""
    return np.linalg.norm(area_vectors(points, faces), axis=1)


def face_normals(
    points: Float[np.ndarray, "points 3"], faces: Int[np.ndarray, "faces 3"]
) -> Float[np.ndarray, "faces 3"]:
    """Unit normal of every face, outward where the faces are those of ``mesh.boundary``."""
    vectors = area_vectors(points, faces)
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def box_mesh(size: Sequence[float], cells: Sequence[int], *, lo=(0.0, 0.0, 0.0)) -> TetMesh:
    """Box of tets: Kuhn's six in every cell.

    Parameters
    ----------
    size
        Sides [m], shape (3,).
    cells
        Cells along x, y and z.
    lo
        Lower corner [m], shape (3,).

    Returns
    -------
    TetMesh
        6 nx ny nz tets in one region, without a material.

    Raises
    ------
    InputError
        Where a side is not positive: its tets are flat.

    Examples
    --------
    >>> from autophyx_tet.fem import box_mesh
    >>> box = box_mesh((0.2, 0.1, 0.1), (2, 1, 1))
    >>> len(box.tets), round(box.volume, 12)  # m^3
    (12, 0.002)
    """
    nx, ny, nz = cells
    axes = [o + np.linspace(0, s, n + 1) for o, s, n in zip(lo, size, cells, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    ids = np.arange(len(points)).reshape(nx + 1, ny + 1, nz + 1)
    corner = ids[:-1, :-1, :-1].reshape(-1)
    step = np.array([(ny + 1) * (nz + 1), nz + 1, 1])
    tets = []
    for order in itertools.permutations(range(3)):
        path = np.concatenate([[0], np.cumsum(step[list(order)])])
        tets.append(corner[:, None] + path)
    return TetMesh.oriented(points, np.stack(tets, axis=1).reshape(-1, 4))
