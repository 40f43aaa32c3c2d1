"""A triangle surface in components, what can be asked of each, and where they touch."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ...fem.mesh import face_areas
from .triangles import ClosestTo, Faces, Points, edge_components, sample

# Volume by area^1.5 below which the sign of an open component's volume says nothing (ball: 0.09).
FLAT = 1e-3
PER_SQUARE = 16  # samples on a square of the wanted spacing, so that none is missed
MOST_SAMPLES = 20_000  # samples on one body


class Surface(NamedTuple):
    """Triangles with the part that each belongs to and their edge-connected component.

    ``points`` (n, 3) [m], ``faces`` (m, 3), ``part`` (m,), ``component`` (m,) from 0 on.
    """

    points: Points
    faces: Faces
    part: Int[np.ndarray, "faces"]
    component: Int[np.ndarray, "faces"]


def subset(surface: Surface, keep: Bool[np.ndarray, "faces"]) -> Surface:
    """Return the faces ``keep`` of a surface, in components of their own."""
    faces = surface.faces[keep]
    return Surface(surface.points, faces, surface.part[keep], edge_components(faces))


def face_orientation(faces: Faces) -> Bool[np.ndarray, "faces"]:
    """Whether the vertices of each face run in falling cyclic order: tells two windings apart."""
    a, b, c = faces.T
    return ((a > b).astype(int) + (b > c) + (c > a)) == 2


def boundary_edges(surface: Surface) -> tuple[np.ndarray, np.ndarray]:
    """Directed edges (n, 2) that lie on one face only, and that face."""
    edges, edge, count = face_edges(surface.faces)
    single = np.flatnonzero(count[edge] == 1)
    return edges[single], single // 3


def unbalanced_edges(surface: Surface) -> tuple[np.ndarray, np.ndarray]:
    """Directed edges (n, 2) that faces run once more than the other way, and one such face.

    They bound what the surface lacks to enclose a volume: the rim of a hole, also where it lies on
    another wall. An edge run twice more is there twice; two faces wound apart do not count.
    """
    edges, inverse, count = face_edges(surface.faces)
    way = np.where(edges[:, 0] < edges[:, 1], 1, -1)
    net = np.bincount(inverse, weights=way).astype(np.int64)
    net[count == 2] = 0
    with_it = np.flatnonzero(way == np.sign(net)[inverse])
    edge, first = np.unique(inverse[with_it], return_index=True)
    rim = np.repeat(with_it[first], np.abs(net[edge]))
    return edges[rim], rim // 3


def incoherence(surface: Surface) -> float:
    """Share of the edges between two faces that both run the same way: one is wound wrongly."""
    edges, edge, count = face_edges(surface.faces)
    way = np.where(edges[:, 0] < edges[:, 1], 1, -1)
    net = np.bincount(edge, weights=way)
    return float((net[count == 2] != 0).mean()) if (count == 2).any() else 0.0


def open_components(surface: Surface) -> Bool[np.ndarray, "components"]:
    """Whether each component has an edge on one face only."""
    is_open = np.zeros(surface.component.max(initial=-1) + 1, dtype=bool)
    is_open[surface.component[boundary_edges(surface)[1]]] = True
    return is_open


def component_areas(surface: Surface) -> Float[np.ndarray, "components"]:
    """Area [m^2] of every component."""
    area = face_areas(surface.points, surface.faces)
    return np.bincount(surface.component, weights=area).astype(np.float64)


def bulky_components(surface: Surface) -> Bool[np.ndarray, "components"]:
    """Whether the sign of each component's volume says anything, also of an open one."""
    return np.abs(component_volumes(surface)) > FLAT * component_areas(surface) ** 1.5


def component_volumes(surface: Surface) -> Float[np.ndarray, "components"]:
    """Signed volume [m^3] of every component, about its own centre so that open ones make sense."""
    count = surface.component.max(initial=-1) + 1
    corners = surface.points[surface.faces]
    size = np.maximum(np.bincount(surface.component, minlength=count), 1)
    sums = (np.bincount(surface.component, w, count) for w in corners.mean(axis=1).T)
    centre = np.stack([total / size for total in sums], axis=1)
    a, b, c = np.moveaxis(corners - centre[surface.component][:, None], 1, 0)
    six = np.einsum("fi,fi->f", np.cross(a, b), c)
    return np.bincount(surface.component, weights=six / 6, minlength=count).astype(np.float64)


class TouchingPlaces(NamedTuple):
    """Places ``where`` (n, 3) [m] on one of two ``bodies`` (n, 2), components of a surface."""

    where: np.ndarray
    bodies: np.ndarray


def touching_places(surface: Surface, *, touching: float, spacing: float) -> TouchingPlaces:
    """Sampled places where closed bodies are within ``touching`` [m] of each other.

    Samples are nearer than ``spacing`` [m] to each other, and the vertices are among them.
    """
    is_open = open_components(surface)
    numbers = [int(n) for n in np.unique(surface.component) if not is_open[n]]
    faces = [surface.faces[surface.component == number] for number in numbers]
    low = np.array([surface.points[own].min(axis=(0, 1)) for own in faces]).reshape(-1, 3)
    high = np.array([surface.points[own].max(axis=(0, 1)) for own in faces]).reshape(-1, 3)
    where, bodies = [np.zeros((0, 3))], [np.zeros((0, 2), dtype=np.int64)]
    for number, own in enumerate(faces):
        meet = (low <= high[number] + touching) & (high >= low[number] - touching)
        near = [n for n in np.flatnonzero(meet.all(axis=1)).tolist() if n != number]
        if not near:
            continue
        # Random points [m] of a body of which each has others within `spacing` [m]
        area = float(face_areas(surface.points, own).sum())
        count = int(np.clip(PER_SQUARE * area / spacing**2, 1, MOST_SAMPLES))
        places = sample(surface.points, own, rng=np.random.default_rng(0), count=count).where
        around = [(places >= low[n] - touching) & (places <= high[n] + touching) for n in near]
        places = places[np.any([both.all(axis=1) for both in around], axis=0)]
        others = np.concatenate([faces[n] for n in near])
        owner = np.repeat([numbers[n] for n in near], [len(faces[n]) for n in near])
        distance, face = ClosestTo(surface.points, others)(places)
        touch = distance <= touching
        where.append(places[touch])
        mine = np.full(int(touch.sum()), numbers[number])
        bodies.append(np.sort(np.stack([mine, owner[face[touch]]], axis=1), axis=1))
    return TouchingPlaces(np.concatenate(where), np.concatenate(bodies))


# Rows of whole numbers that are equal: edges, faces, cells.

LARGEST = 2**62  # of a row as one number


class EqualRows(NamedTuple):
    """The ``first`` of each group of equal rows, in rising order; the ``group`` of every row.

    ``count`` is the size of each group.
    """

    first: np.ndarray
    group: np.ndarray
    count: np.ndarray


def equal_rows(rows: Int[np.ndarray, "n k"]) -> EqualRows:
    """Group equal rows: as ``numpy.unique`` along an axis, but ten times as fast."""
    key, size = np.zeros(len(rows), np.int64), 1
    for column in rows.T if len(rows) else ():
        low, span = column.min(), int(column.max()) - int(column.min()) + 1
        if size * span >= LARGEST:
            (key, size), (column, span) = _renumbered(key), _renumbered(column)
            low = 0
        key = key * span + (column - low)
        size *= span
    _, first, group, count = np.unique(
        key, return_index=True, return_inverse=True, return_counts=True
    )
    return EqualRows(first, group.reshape(-1), count)


def _renumbered(values: Int[np.ndarray, "n"]) -> tuple[Int[np.ndarray, "n"], int]:
    """Numbers from 0 on in the order of the values, and how many there are."""
    unique, number = np.unique(values, return_inverse=True)
    return number.reshape(-1).astype(np.int64), len(unique)


class FaceEdges(NamedTuple):
    """Edges of triangles, three each: ``directed`` (3 n, 2), the ``edge`` (3 n,) that each is.

    ``count`` says how many faces an edge is on.
    """

    directed: np.ndarray
    edge: np.ndarray
    count: np.ndarray


def face_edges(faces: Faces) -> FaceEdges:
    """Number the edges of triangles."""
    directed = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    found = equal_rows(np.column_stack([directed.min(axis=1), directed.max(axis=1)]))
    return FaceEdges(directed, found.group, found.count)


def bounds_itself(faces: Faces) -> bool:
    """Whether every edge is run as often one way as the other: the surface has no rim.

    Its winding number is then a whole number that changes nowhere but across it.
    """
    directed, edge, _ = face_edges(faces)
    way = np.where(directed[:, 0] < directed[:, 1], 1, -1)
    return not np.bincount(edge, weights=way).any()
