"""Anchors: points in the tets that stand for the matter around them, and points that are held."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ..errors import InputError
from ..scene.boundary import FACES, boundary_faces, face_areas
from ..scene.mesh import TetMesh, material_of
from ..scene.supports import Supports
from .sight import Sight

# Places that are looked at for every anchor, and rounds of Lloyd's algorithm on them.
PLACES, ROUNDS = 16, 4
# Anchors are this many spacings from their neighbours on what is held, at least.
APART = 0.8
LEAST = 8
# Places of a part that its thickness is taken from: twice the depth that so many stay above.
PROBED, DEEPEST = 1000, 0.95


@dataclass(frozen=True, eq=False, kw_only=True)
class Anchors:
    """Points of a body with the matter around them.

    Parameters
    ----------
    x
        Positions at rest [m], shape (n, 3).
    volume, mass, E
        Volume [m^3], mass [kg] and geometric mean of E [Pa] of the matter around them, (n,).
    part
        Index of their part, shape (n,).
    body
        Index of what hangs together through tets, shape (n,).
    fixed, values
        Components that are held, and their displacement [m], shape (n, 3).
    spacing
        Edge [m] of a cube that belongs to one anchor.
    layers
        Anchors across the thickness of every part [1], shape (parts,).
    skin
        How near the surface of its part an anchor is [1]: from 0 in the middle, with the square of
        the height above it, to 1; shape (n,).
    """

    x: Float[np.ndarray, "n 3"]
    volume: Float[np.ndarray, "n"]
    mass: Float[np.ndarray, "n"]
    E: Float[np.ndarray, "n"]
    part: Int[np.ndarray, "n"]
    body: Int[np.ndarray, "n"]
    fixed: Bool[np.ndarray, "n 3"]
    values: Float[np.ndarray, "n 3"]
    spacing: float
    layers: Float[np.ndarray, "parts"]
    skin: Float[np.ndarray, "n"]


class _Places(NamedTuple):
    """Points in the tets: ``x`` (n, 3) [m], their ``tet`` (n,) and ``volume`` (n,) [m^3]."""

    x: np.ndarray
    tet: np.ndarray
    volume: np.ndarray


class _Held(NamedTuple):
    """Held places: ``x`` (n, 3) [m], ``fixed`` (n, 3), ``values`` (n, 3) [m]."""

    x: np.ndarray
    fixed: np.ndarray
    values: np.ndarray


def sample_anchors(
    mesh: TetMesh,
    count: int = 2048,
    *,
    supports: Supports | None = None,
    surface: Sight | None = None,
    seed: int = 0,
) -> Anchors:
    """Spread about ``count`` anchors over ``mesh``, and others over what ``supports`` hold.

    Parts share them by volume, at least one each. Cells are Lloyd's; an anchor whose cell has its
    centre outside the tets stands at the nearest place inside.

    Raises
    ------
    InputError
        Where fewer than ``LEAST`` anchors are asked for.
    """
    if count < LEAST:
        raise InputError(f"{count} anchors: wanted at least {LEAST}")
    rng = np.random.default_rng(seed)
    spacing = float(np.cbrt(mesh.volume / count))
    held = _held_places(mesh, supports or Supports.none(len(mesh.points)), spacing, rng)
    places = _sampled(mesh, PLACES * count, rng)
    region = mesh.region[places.tet]
    seen = surface or Sight(mesh.points, mesh.boundary.faces)
    from scipy.spatial import KDTree

    near = KDTree(places.x).query(held.x)[1] if len(held.x) else np.zeros(0, dtype=np.int64)
    found, owner = [], np.zeros(len(places.x), dtype=np.int64)
    part, total = [region[near]], len(held.x)
    for name in np.unique(region):
        own = np.flatnonzero(region == name)
        own_held = np.flatnonzero(region[near] == name)
        share = max(1, round(places.volume[own].sum() / spacing**3))
        cells = _relaxed(places.x[own], held.x[own_held], min(share, len(own)), seen, rng)
        free = len(cells.x) - len(own_held)
        index = np.concatenate([own_held, total + np.arange(free)])
        owner[own] = index[cells.owner]
        found.append(cells.x[len(own_held) :])
        part.append(np.full(free, name))
        total += free
    matter = _matter(mesh, places, owner, np.concatenate([held.x, *found]), len(held.x))
    part = np.concatenate(part)[matter.stays]
    thickness, skin = _thicknesses(mesh, matter.fields["x"], part, rng)
    fixed, values = np.zeros((len(part), 3), dtype=bool), np.zeros((len(part), 3))
    fixed[: len(held.x)], values[: len(held.x)] = held.fixed, held.values
    known = {"fixed": fixed, "values": values, "spacing": spacing, "layers": thickness / spacing}
    return Anchors(**matter.fields, part=part, skin=skin, **known)


class _Cells(NamedTuple):
    """Centres ``x`` of cells, and the cell ``owner`` of every place."""

    x: np.ndarray
    owner: np.ndarray


def _relaxed(
    places: np.ndarray, held: np.ndarray, free: int, surface: Sight, rng: np.random.Generator
) -> _Cells:
    """Cells of ``held`` points, which stay, and of ``free`` ones, which move to their centres."""
    from scipy.spatial import KDTree

    x = np.concatenate([held, places[rng.choice(len(places), free, replace=False)]])
    moving = np.arange(len(x)) >= len(held)
    for _ in range(ROUNDS):
        owner = KDTree(x).query(places)[1]
        size = np.bincount(owner, minlength=len(x))
        centre = np.stack([np.bincount(owner, places[:, k], len(x)) for k in range(3)], axis=1)
        able = moving & (size > 0)
        x[able] = centre[able] / size[able, None]
    inside = places[KDTree(places).query(x)[1]]
    lost = moving & surface.crossed(inside, x)
    x[lost] = inside[lost]
    return _Cells(x, np.asarray(KDTree(x).query(places)[1]))


class _Matter(NamedTuple):
    """What of the anchors follows from the places around them; those that ``stays`` are left."""

    fields: dict[str, np.ndarray]
    stays: np.ndarray


def _matter(mesh: TetMesh, places: _Places, owner: np.ndarray, x: np.ndarray, held: int) -> _Matter:
    """Matter in the cells of anchors at ``x``; free ones whose cell is empty are left out."""
    count, material = len(x), material_of(mesh)
    volume = np.bincount(owner, places.volume, count)
    mass = np.bincount(owner, places.volume * material.rho[places.tet], count)
    stiff = np.bincount(owner, places.volume * np.log(material.E[places.tet]), count)
    full = np.where(volume > 0, volume, 1.0)
    E = np.where(volume > 0, np.exp(stiff / full), np.median(material.E))
    some = np.zeros(count, dtype=np.int64)
    some[owner[::-1]] = places.tet[::-1]
    body = body_of_points(mesh)[mesh.tets[some, 0]]
    stays = (volume > 0) | (np.arange(count) < held)
    found = {"x": x, "volume": volume, "mass": mass, "E": E, "body": body}
    return _Matter({name: value[stays] for name, value in found.items()}, stays)


class _Thickness(NamedTuple):
    """``thickness`` (parts,) [m] of parts, and the ``skin`` (n,) [1] of anchors in them."""

    thickness: np.ndarray
    skin: np.ndarray


def _thicknesses(
    mesh: TetMesh, x: np.ndarray, part: np.ndarray, rng: np.random.Generator
) -> _Thickness:
    """Thickness of every part, to 5 % that of a plate, to a fifth that of a rod; skin of ``x``."""
    found, skin = np.full(len(mesh.region_names), np.inf), np.zeros(len(x))
    for k in np.unique(mesh.region):
        own = np.flatnonzero(mesh.region == k)
        tet = rng.choice(own, PROBED, p=mesh.volumes[own] / mesh.volumes[own].sum())
        surface = Sight(mesh.points, boundary_faces(mesh.tets[own]).faces)
        found[k] = 2 * float(np.quantile(surface.depth(_inside(mesh, tet, rng)), DEEPEST))
        here = part == k
        if here.any():
            skin[here] = np.clip(1 - 2 * surface.depth(x[here]) / found[k], 0, 1) ** 2
    return _Thickness(found, skin)


def _sampled(mesh: TetMesh, count: int, rng: np.random.Generator) -> _Places:
    """About ``count`` places, evenly over the volume, that hold the volume of every part."""
    ends = np.cumsum(mesh.volumes)
    steps = (np.arange(count) + rng.random()) / count * ends[-1]
    tet = np.searchsorted(ends, steps).clip(max=len(ends) - 1)
    lost = np.setdiff1d(np.unique(mesh.region), mesh.region[tet])
    largest = [int(np.argmax(np.where(mesh.region == k, mesh.volumes, -1.0))) for k in lost]
    tet = np.append(tet, np.array(largest, dtype=tet.dtype))
    region, parts = mesh.region[tet], len(mesh.region_names)
    each = mesh.region_volumes() / np.maximum(np.bincount(region, minlength=parts), 1)
    return _Places(_inside(mesh, tet, rng), tet, each[region])


def _inside(mesh: TetMesh, tet: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return a random point [m] in every one of the tets, shape (n, 3)."""
    share = rng.dirichlet(np.ones(4), len(tet))
    return np.einsum("na,nai->ni", share, mesh.points[mesh.tets[tet]])


def body_of_points(mesh: TetMesh) -> Int[np.ndarray, "points"]:
    """What every point hangs together with, through common tets."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    a, b = np.repeat(mesh.tets[:, 0], 3), mesh.tets[:, 1:].ravel()
    size = (len(mesh.points),) * 2
    graph = coo_array((np.ones(len(a), dtype=np.int8), (a, b)), shape=size)
    return connected_components(graph, directed=False)[1].astype(np.int64)


def _held_places(
    mesh: TetMesh, supports: Supports, spacing: float, rng: np.random.Generator
) -> _Held:
    """Held points, and places on the faces between them, a spacing apart."""
    used, held = np.unique(mesh.tets), np.logical_or.reduce(supports.fixed, axis=1)
    nodes = used[held[used]]
    x: list[np.ndarray] = [mesh.points[nodes]]
    fixed: list[np.ndarray] = [supports.fixed[nodes]]
    values: list[np.ndarray] = [supports.values[nodes]]
    faces = mesh.tets[:, FACES].reshape(-1, 3)
    faces = faces[held[faces].all(axis=1)]
    if len(faces):
        faces = faces[np.unique(np.sort(faces, axis=1), axis=0, return_index=True)[1]]
        area = face_areas(mesh.points, faces)
        count = min(int(4 * area.sum() / spacing**2) + 1, 100_000)
        chosen = faces[rng.choice(len(faces), count, p=area / area.sum())]
        share = rng.dirichlet(np.ones(3), count)
        x.append(np.einsum("na,nai->ni", share, mesh.points[chosen]))
        fixed.append(np.logical_and.reduce(supports.fixed[chosen], axis=1))
        values.append(np.einsum("na,nai->ni", share, supports.values[chosen]))
    places = np.concatenate(x)
    kept = _thinned(places, APART * spacing)
    return _Held(places[kept], np.concatenate(fixed)[kept], np.concatenate(values)[kept])


def _thinned(points: Float[np.ndarray, "n 3"], apart: float) -> Int[np.ndarray, "kept"]:
    """Points no two of which are closer than ``apart`` [m], the first ones first."""
    from scipy.spatial import KDTree

    kept, free = [], np.ones(len(points), dtype=bool)
    if len(points):
        near = KDTree(points)
        for k in range(len(points)):
            if free[k]:
                kept.append(k)
                free[near.query_ball_point(points[k], apart)] = False
    return np.array(kept, dtype=np.int64)
