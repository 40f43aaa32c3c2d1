"""Questions about triangle soups that libigl answers, with plain arrays on both sides."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ...fem.mesh import FACES, area_vectors, equal_faces

# Shapes of arrays; places and points are in metres unless a function says otherwise.
Points = Float[np.ndarray, "points 3"]
Faces = Int[np.ndarray, "faces 3"]
Tets = Int[np.ndarray, "tets 4"]
Places = Float[np.ndarray, "n 3"]


class Triangles(NamedTuple):
    """Triangle surface: ``points`` (n, 3) [m], ``faces`` (m, 3)."""

    points: np.ndarray
    faces: np.ndarray


def enclosed_volume(surface: Triangles) -> float:
    """Signed volume [m^3] inside a closed surface, positive where it is wound outward.

    It is taken about the centre of the box, so that small holes change it little.
    """
    corners = surface.points[surface.faces]
    middle = (corners.min(axis=(0, 1)) + corners.max(axis=(0, 1))) / 2
    a, b, c = np.moveaxis(corners - middle, 1, 0)
    return float(np.einsum("fi,fi->", np.cross(a, b), c) / 6)


class Closest(NamedTuple):
    """``distance`` (n,) [m] to the nearest point of a surface and the ``face`` (n,) it lies on."""

    distance: np.ndarray
    face: np.ndarray


class WindingNumber:
    """Generalised winding number of a surface: 1 inside a closed outward one, 0 outside.

    What it is computed from is kept, for many questions about one surface.
    """

    def __init__(self, points: Points, faces: Faces) -> None:
        """Sort triangles [m] into a tree."""
        import igl

        # A point or a line winds around nothing, and crashes igl.
        faces = faces[area_vectors(points, faces).any(axis=1)]
        self._tree = igl.FastWindingNumberBVH() if len(faces) else None
        if self._tree is not None:
            self._tree.init(points, _int64(faces))

    def __call__(self, where: Places) -> Float[np.ndarray, "n"]:
        """Winding number at ``where`` [m]."""
        if self._tree is None or not len(where):
            return np.zeros(len(where))
        return np.asarray(self._tree.winding_number(where), dtype=np.float64)


def winding_numbers(points: Points, faces: Faces, where: Places) -> Float[np.ndarray, "n"]:
    """Winding number of a surface at ``where`` [m], asked once."""
    return WindingNumber(points, faces)(where)


class ClosestTo:
    """Nearest points of one surface, whose tree is kept for many questions."""

    def __init__(self, points: Points, faces: Faces) -> None:
        """Sort triangles [m] into a tree."""
        import igl

        self._points, self._faces = np.ascontiguousarray(points, np.float64), _int64(faces)
        self._tree = igl.AABB()
        self._tree.init(self._points, self._faces)

    def __call__(self, where: Places) -> Closest:
        """Nearest point for each of ``where`` [m]."""
        if not len(where):
            return Closest(np.zeros(0), np.zeros(0, np.int64))
        where = np.ascontiguousarray(where, np.float64)
        squared, face, _ = self._tree.squared_distance(self._points, self._faces, where)
        return Closest(np.sqrt(np.maximum(squared, 0)), np.asarray(face, dtype=np.int64))


def closest(where: Places, points: Points, faces: Faces) -> Closest:
    """Nearest point of a surface for each of ``where`` [m], asked once."""
    return ClosestTo(points, faces)(where)


def edge_components(faces: Faces) -> Int[np.ndarray, "faces"]:
    """Label from 0 on of the edge-connected component of every face."""
    import igl

    if not len(faces):
        return np.zeros(0, np.int64)
    return np.asarray(igl.facet_components(_int64(faces))[1], dtype=np.int64)


def linked_groups(count: int, a: np.ndarray, b: np.ndarray) -> Int[np.ndarray, "count"]:
    """Label from 0 on of the group of each of ``count`` things that pairs of ``a``, ``b`` link."""
    import igl
    from scipy.sparse import csc_matrix

    if not count:
        return np.zeros(0, np.int64)
    ends = np.concatenate([a, b]), np.concatenate([b, a])
    graph = csc_matrix((np.ones(2 * len(a), np.int64), ends), shape=(count, count))
    return np.asarray(igl.connected_components(graph)[1], np.int64)


def crossing_pairs(points: Points, faces: Faces) -> Int[np.ndarray, "pairs 2"]:
    """Pairs of faces that intersect and do not lie in one plane, by exact predicates."""
    from igl.predicates import find_self_intersections

    if not len(faces):
        return np.zeros((0, 2), np.int64)
    _, pairs, coplanar = find_self_intersections(points, _int64(faces))
    crossing = ~np.asarray(coplanar, dtype=bool).reshape(-1)
    return np.asarray(pairs, np.int64).reshape(-1, 2)[crossing]


def coherent_patches(faces: Faces) -> tuple[np.ndarray, np.ndarray]:
    """Faces wound the same way round within each orientable patch, and the patch of each."""
    import igl

    if not len(faces):
        return faces, np.zeros(0, np.int64)
    coherent, patch = igl.bfs_orient(_int64(faces))
    return np.asarray(coherent, np.int64), np.asarray(patch, np.int64)


def _int64(faces: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(faces, dtype=np.int64)


# Points on surfaces and in bodies, from which distances and volumes are sampled.

CONFIDENCE = 4.0  # standard errors that a sampled volume may be off
COARSE, KNOWN = 0.05, 0.02  # relative: a volume known no better is asked for again, until so well
MOST = 1_000_000  # points of the second look: seconds

SAMPLES = 20_000  # points on a surface: the distances of a smooth field to 3 digits


class Samples(NamedTuple):
    """Points on a surface: ``where`` (n, 3) [m] and the unit ``normal`` (n, 3) there."""

    where: np.ndarray
    normal: np.ndarray


def sample(
    points: Points, faces: Faces, *, rng: np.random.Generator, count: int = SAMPLES
) -> Samples:
    """Random points of uniform density on a surface, and its vertices."""
    normal = area_vectors(points, faces)
    area = np.linalg.norm(normal, axis=1)
    normal = normal / np.maximum(area, np.finfo(float).tiny)[:, None]
    # Faces without any area are drawn like each other.
    share = area / area.sum() if area.sum() > 0 else None
    face = rng.choice(len(area), size=count, p=share)
    u, v = np.sort(rng.random((2, count)), axis=0)
    weight = np.stack([u, v - u, 1 - v], axis=1)
    where = np.einsum("nk,nki->ni", weight, points[faces[face]])
    _, first = np.unique(faces, return_index=True)
    some = first if len(first) <= count else rng.choice(first, size=count, replace=False)
    vertices = faces.reshape(-1)[some]
    return Samples(
        np.concatenate([where, points[vertices]]), np.concatenate([normal[face], normal[some // 3]])
    )


class Facets(NamedTuple):
    """Triangles between two tets: ``faces`` (n, 3) sorted, the tets ``left``, ``right``."""

    faces: np.ndarray
    left: np.ndarray
    right: np.ndarray


def facets(tets: Tets) -> Facets:
    """All inner faces of a tet mesh, once each."""
    faces = tets[:, FACES].reshape(-1, 3)
    order, same = equal_faces(faces)
    left, right = order[:-1][same], order[1:][same]
    return Facets(np.sort(faces[left], axis=1), left // 4, right // 4)


def interface_faces(tets: Tets, region: Int[np.ndarray, "tets"]) -> Faces:
    """Faces between two tets of different regions, once each."""
    faces, left, right = facets(tets)
    return faces[region[left] != region[right]]


FLATTEST = 1e-3  # of its length: a flatter box is sampled a little beyond its sides


class Boxes(NamedTuple):
    """Equal boxes of ``size`` (3,) [m] from the corner ``lo`` (3,) [m], ``shape`` (3,) of them."""

    lo: np.ndarray
    size: np.ndarray
    shape: np.ndarray

    @property
    def volume(self) -> float:
        """Volume [m^3] of one."""
        return float(self.size.prod())

    def corners(self) -> Places:
        """Lower corners [m]."""
        grid = np.meshgrid(*(np.arange(n) for n in self.shape), indexing="ij")
        return self.lo + np.stack(grid, axis=-1).reshape(-1, 3) * self.size

    def centres(self) -> Places:
        """Centres [m]."""
        return self.corners() + self.size / 2

    def beside_others(self, held: Bool[np.ndarray, "n"]) -> Bool[np.ndarray, "n"]:
        """Which have a neighbour across a side of which ``held`` is not the same."""
        grid = held.reshape(self.shape)
        out = np.zeros_like(grid)
        for axis in range(3):
            here, there = np.moveaxis(out, axis, 0), np.moveaxis(grid, axis, 0)
            differs = there[1:] != there[:-1]
            here[1:] |= differs
            here[:-1] |= differs
        return out.reshape(-1)

    def linked(self, some: Bool[np.ndarray, "n"]) -> Int[np.ndarray, "n"]:
        """Number of the group of each of some boxes, linked across their sides; of others -1."""
        from scipy.ndimage import label

        groups: Any = label  # its stubs know no pair
        return groups(some.reshape(self.shape))[0].reshape(-1) - 1

    def within(
        self, chosen: Bool[np.ndarray, "n"], times: int, *, rng: np.random.Generator
    ) -> Float[np.ndarray, "m 3"]:
        """One random point [m] in each of ``times`` cubed equal boxes of each ``chosen`` one."""
        finer = Boxes(np.zeros(3), self.size / times, np.full(3, times)).corners()
        corner = (self.corners()[chosen][:, None] + finer).reshape(-1, 3)
        return corner + rng.random(corner.shape) * self.size / times


def stratified(
    bounds: Float[np.ndarray, "2 3"], *, rng: np.random.Generator, count: int
) -> tuple[Boxes, Places]:
    """About ``count`` equal boxes that fill ``bounds`` [m], and one random point [m] in each."""
    lo, size = bounds[0], bounds[1] - bounds[0]
    size = np.maximum(size, FLATTEST * size.max())
    shape = np.maximum(np.round(size * (count / size.prod()) ** (1 / 3)), 1).astype(int)
    boxes = Boxes(lo, size / shape, shape)
    return boxes, boxes.within(np.ones(shape.prod(), dtype=bool), 1, rng=rng)


Label = Callable[[Places], Int[np.ndarray, "n"]]


class Inside(NamedTuple):
    """Points ``where`` (n, 3) [m] inside, the ``label`` (n,) >= 0 of each.

    Each stands for ``cell`` (n,) [m^3]; ``error`` [m^3] is the standard error of their sum.
    """

    where: np.ndarray
    label: np.ndarray
    cell: np.ndarray
    error: float

    @property
    def total(self) -> float:
        """Volume [m^3]."""
        return float(self.cell.sum())

    @property
    def uncertainty(self) -> float:
        """Share of the volume by which it may be off; infinite where no point is inside."""
        return CONFIDENCE * self.error / self.total if len(self.cell) else np.inf


def inside(
    surface: Triangles,
    label: Label,
    bounds: Float[np.ndarray, "2 3"],
    *,
    rng: np.random.Generator,
    count: int,
    crisp: bool = False,
) -> Inside:
    """Sample what a ``surface`` [m] encloses within ``bounds`` [m], in some ``count`` boxes.

    ``label`` gives -1 for points outside. It changes at the surface and at caps of its holes: of a
    body so thin or so scattered that its volume stays ``COARSE``, the boxes there are asked again
    in smaller ones; of the others each is known by its point. Where it is ``crisp`` and changes at
    the surface alone, one point is asked for all that are on the same side for certain.
    """
    boxes, where = stratified(bounds, rng=rng, count=count)
    gap = cache(lambda: closest(boxes.centres(), *surface).distance)  # not always needed
    reach = np.linalg.norm(boxes.size) / 2
    labels = _labels(label, where, boxes.linked(gap() > reach)) if crisp else label(where)
    found = _of(where, labels, boxes.volume)
    if found.uncertainty <= COARSE:
        return found
    mixed = (gap() <= reach) | boxes.beside_others(labels >= 0)
    finer = min((found.uncertainty / KNOWN) ** 2, MOST / mixed.sum())
    times = max(int(finer ** (1 / 3)), 2)
    closer = boxes.within(mixed, times, rng=rng)
    box = np.repeat(np.flatnonzero(mixed), times**3)
    free = np.linalg.norm(closer - boxes.centres()[box], axis=1) < gap()[box]
    closer_labels = _labels(label, closer, np.where(free, box, -1)) if crisp else label(closer)
    whole = _of(where[~mixed], labels[~mixed], boxes.volume)
    part = _of(closer, closer_labels, boxes.volume / times**3)
    where, labels, cells = (np.concatenate(pair) for pair in zip(whole[:3], part[:3], strict=True))
    return Inside(where, labels, cells, part.error)


def _labels(label: Label, where: Places, group: Int[np.ndarray, "n"]) -> Int[np.ndarray, "n"]:
    """Labels of points [m], asked once for all of a group; those in group -1 are alone."""
    alone = np.flatnonzero(group < 0)
    _, first, of_all = np.unique(group, return_index=True, return_inverse=True)
    out = label(where[first])[of_all]
    out[alone] = label(where[alone])
    return out


def _of(where: Places, labels: Int[np.ndarray, "n"], cell: float) -> Inside:
    """Keep the points inside, of those that stand for ``cell`` [m^3] each."""
    held = np.flatnonzero(labels >= 0)
    share = len(held) / max(len(where), 1)
    error = cell * np.sqrt(len(where) * share * (1 - share))  # an upper bound: strata vary less
    return Inside(where[held], labels[held], np.full(len(held), cell), float(error))
