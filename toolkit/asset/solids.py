"""Which part a point lies in: winding numbers per part, nearest surface where parts share one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

from ...fem.mesh import area_vectors, face_areas
from ...fem.table import WallShare
from .surface import (
    Surface,
    boundary_edges,
    bounds_itself,
    component_areas,
    component_volumes,
    open_components,
)
from .triangles import (
    Faces,
    Places,
    Points,
    Triangles,
    WindingNumber,
    closest,
    edge_components,
    enclosed_volume,
    sample,
    winding_numbers,
)

INSIDE = 0.5  # |winding number| of a point inside a closed surface is 1, outside 0
# A sheet has |winding number| 1/2 on both sides, foliage any number; open surfaces that enclose
# something together, or with closed ones, have whole numbers but for this.
CRISP = 0.15
SHEET_SHARE = 0.8  # of the area of an open component that must enclose something for a solid
# Where on a face that is asked: its centre and half-way to its corners, as barycentric weights.
PROBES = np.array([[2, 2, 2], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / 6
ASKED = 64  # faces of a component that are asked: its share to a few per cent
ASKED_OF_ALL = 20_000  # of very many, like the leaves of a tree, fewer each: 4 s of questions
FEWEST_ASKED = 2
SHEET_DEPTH = 2e-3  # share of the diagonal at which that is looked at
PAD = 1e-9  # share of the box by which it is widened, for points on it


@dataclass(frozen=True, eq=False)
class Shell:
    """Closed or nearly closed triangles of one part, or of several parts that share one skin.

    ``points`` (n, 3) [m], ``faces`` (m, 3), ``part`` (m,) of every face; what lies inside the
    outward surface ``cavity`` does not belong to it.
    """

    points: np.ndarray
    faces: np.ndarray
    part: np.ndarray
    cavity: Triangles | None = None

    @cached_property
    def volume(self) -> float:
        """Volume [m^3] that it encloses, without the cavity."""
        hole = 0.0 if self.cavity is None else max(enclosed_volume(self.cavity), 0.0)
        return abs(enclosed_volume(Triangles(self.points, self.faces))) - hole

    def contains(self, where: Places) -> Bool[np.ndarray, "n"]:
        """Whether points [m] lie inside, by the fast winding number."""
        return self.depth(where) > 0

    def depth(self, where: Places) -> Int[np.ndarray, "n"]:
        """How many bodies of the shell points [m] lie in, 0 outside and in the cavity."""
        corners = self.points[self.faces].reshape(-1, 3)
        lo, hi = corners.min(axis=0), corners.max(axis=0)
        pad = PAD * (hi - lo).max()
        near = np.flatnonzero(((where >= lo - pad) & (where <= hi + pad)).all(axis=1))
        depth = np.zeros(len(where), dtype=np.int64)
        if near.size:
            winding = np.abs(self.winding(where[near]))
            depth[near] = np.where(winding > INSIDE, np.round(winding), 0)
        if self.winding_of_cavity is not None:
            held = np.flatnonzero(depth)
            depth[held[self.winding_of_cavity(where[held]) >= INSIDE]] = 0
        return depth

    @cached_property
    def rimless(self) -> bool:
        """Whether inside and outside are apart: no way leads from one to the other but across."""
        hole = self.cavity is None or bounds_itself(self.cavity.faces)
        return hole and bounds_itself(self.faces)

    @cached_property
    def winding(self) -> WindingNumber:
        """Winding number of the shell."""
        return WindingNumber(self.points, self.faces)

    @cached_property
    def winding_of_cavity(self) -> WindingNumber | None:
        """Winding number of its cavity, if it has one."""
        return self.cavity and WindingNumber(*self.cavity)


@dataclass(frozen=True, eq=False)
class Plates:
    """Closed components of a surface with a mean thickness below ``thinnest`` [m].

    ``thickness`` [m] and ``volume`` [m^3] of each.
    """

    surface: Surface
    thinnest: float
    thickness: np.ndarray
    volume: np.ndarray

    @classmethod
    def of(cls, surface: Surface, thinnest: float) -> Plates:
        """Find them."""
        thickness = _thickness(surface)
        thin = ~open_components(surface) & (thickness < thinnest)
        volume = np.abs(component_volumes(surface)[thin])
        return cls(_of_components(surface, thin), thinnest, thickness[thin], volume)

    def contain(self, where: Places) -> Bool[np.ndarray, "n"]:
        """Whether points [m] lie inside one."""
        return np.abs(winding_numbers(self.surface.points, self.surface.faces, where)) > INSIDE

    def thickness_of(self, share: float) -> float:
        """Thickness [m] that this share of their volume has at least."""
        order = np.argsort(-self.thickness)
        upto = np.cumsum(self.volume[order])
        return float(self.thickness[order][np.searchsorted(upto, share * upto[-1])])


@dataclass(frozen=True, eq=False)
class Solids:
    """The shells that enclose something, and the parts that are nothing but sheets.

    ``surface`` holds all faces of the shells; ``sheets`` the ids of parts without any; ``plates``
    the closed components left out because they are thinner than asked for.
    """

    shells: tuple[Shell, ...]
    surface: Surface
    sheets: tuple[int, ...]
    plates: Plates

    @classmethod
    def of(
        cls, surface: Surface, part_count: int, *, thinnest: float, whole: bool = False
    ) -> Solids:
        """Sort the components of a repaired surface into shells and sheets.

        A closed component whose mean thickness is below ``thinnest`` [m] counts as a sheet. As a
        ``whole`` all open ones are one shell, though none may tell inside from outside by itself.
        """
        plates = Plates.of(surface, thinnest)
        solid = _solid(surface, thinnest)
        kept = _of_components(surface, solid | open_components(surface) if whole else solid)
        sheets = tuple(p for p in range(part_count) if p not in set(kept.part.tolist()))
        return cls(tuple(_shells(kept)), kept, sheets, plates)

    @property
    def bounds(self) -> Float[np.ndarray, "2 3"]:
        """Lower and upper corner [m] of the box around all shells."""
        corners = self.surface.points[self.surface.faces].reshape(-1, 3)
        return np.stack([corners.min(axis=0), corners.max(axis=0)])

    def clean_triangles(self) -> Triangles:
        """Return all faces that have an area, on the points that they use."""
        proper = face_areas(self.surface.points, self.surface.faces) > 0
        used, faces = np.unique(self.surface.faces[proper], return_inverse=True)
        return Triangles(self.surface.points[used], faces.reshape(-1, 3))

    def label(self, where: Places) -> Int[np.ndarray, "n"]:
        """Part that each point [m] lies in, -1 outside.

        Where shells overlap the one that holds the smallest volume wins, so that what is nested
        stays what it is.
        """
        label = np.full(len(where), -1, dtype=np.int64)
        for shell in self.largest_first:
            inside = np.flatnonzero(shell.contains(where))
            label[inside] = shell.part[0]
            if (shell.part != shell.part[0]).any() and len(inside):
                face = closest(where[inside], shell.points, shell.faces).face
                label[inside] = shell.part[face]
        return label

    @cached_property
    def largest_first(self) -> list[Shell]:
        """The shells by falling volume."""
        return sorted(self.shells, key=lambda shell: -shell.volume)


def sheet_faces(surface: Surface, *, thinnest: float) -> Bool[np.ndarray, "faces"]:
    """Faces of components that enclose nothing, or nothing thicker than ``thinnest`` [m]."""
    return ~_solid(surface, thinnest)[surface.component]


def _solid(surface: Surface, thinnest: float) -> Bool[np.ndarray, "components"]:
    """Components that enclose a volume: closed and thick, or open but more than a sheet."""
    joint = is_open = open_components(surface)
    while joint.any():
        held = joint & _bounds(_of_components(surface, joint | ~is_open), len(is_open))
        if (held == joint).all():
            break
        joint = held
    thick = (component_volumes(surface) != 0) & (_thickness(surface) >= thinnest)
    return np.where(is_open, joint, thick)


def _thickness(surface: Surface) -> Float[np.ndarray, "components"]:
    """Twice volume by area [m] of each component: the thickness of a plate."""
    area = np.maximum(component_areas(surface), np.finfo(float).tiny)
    return 2 * np.abs(component_volumes(surface)) / area


def _of_components(surface: Surface, which: Bool[np.ndarray, "components"]) -> Surface:
    """Return the faces of some components, which keep their numbers."""
    mine = which[surface.component]
    return surface._replace(
        faces=surface.faces[mine], part=surface.part[mine], component=surface.component[mine]
    )


def _bounds(surface: Surface, count: int) -> Bool[np.ndarray, "components"]:
    """Which of ``count`` components have an inside and an outside by most of their area."""
    normal = area_vectors(surface.points, surface.faces)
    area = np.maximum(np.linalg.norm(normal, axis=1), np.finfo(float).tiny)
    component = surface.component
    asked, weight = _asked(component, area)
    step = SHEET_DEPTH * np.linalg.norm(np.ptp(surface.points, axis=0)) * normal / area[:, None]
    corners = surface.points[surface.faces[asked]]
    probes = np.einsum("pk,fki->pfi", PROBES, corners)
    sides = np.stack([probes - step[asked], probes + step[asked]])
    winding = winding_numbers(surface.points, surface.faces, sides.reshape(-1, 3))
    low, high = np.sort(np.abs(winding).reshape(sides.shape[:3]), axis=0)
    whole = (np.abs(low - np.round(low)) < CRISP) & (np.abs(high - np.round(high)) < CRISP)
    crisp = (whole & (np.round(high) >= 1)).all(axis=0)  # also of a wall between two insides
    total = np.bincount(component, weights=area, minlength=count)
    share = np.bincount(component[asked], weights=weight * crisp, minlength=count)
    return share >= SHEET_SHARE * np.where(total > 0, total, 1)


def _asked(
    component: Int[np.ndarray, "faces"], area: Float[np.ndarray, "faces"]
) -> tuple[Int[np.ndarray, "asked"], Float[np.ndarray, "asked"]]:
    """Faces that stand for ``ASKED`` equal areas of each component or fewer, and these areas."""
    most = int(np.clip(ASKED_OF_ALL // len(np.unique(component)), FEWEST_ASKED, ASKED))
    order = np.argsort(component, kind="stable")
    upto = np.cumsum(area[order])
    start = np.searchsorted(component[order], component[order])
    before = np.concatenate([[0.0], upto])[start]
    total = np.bincount(component, weights=area)[component[order]]
    share = np.floor(most * (upto - before - area[order] / 2) / total)
    key = component[order] * most + np.clip(share, 0, most - 1).astype(np.int64)
    _, first, group = np.unique(key, return_index=True, return_inverse=True)
    return order[first], np.bincount(group.reshape(-1), weights=area[order])


def _shells(surface: Surface) -> Iterator[Shell]:
    """One shell per part of its own components, one per component that parts share, one of rims.

    Open components are taken together: a table top and its underside enclose the top only jointly.
    """
    first = np.full(surface.component.max(initial=-1) + 1, -1)
    first[surface.component] = surface.part
    shared = np.zeros(len(first), dtype=bool)
    shared[surface.component[surface.part != first[surface.component]]] = True
    is_open = open_components(surface)[surface.component]
    own = ~shared[surface.component] & ~is_open
    groups = [own & (surface.part == part) for part in np.unique(surface.part[own])]
    groups += [surface.component == c for c in np.unique(surface.component[~own & ~is_open])]
    # Join each group that is inside out to the largest one with a part of it: as its cavity
    volumes = component_volumes(surface)
    volume = [float(volumes[np.unique(surface.component[group])].sum()) for group in groups]
    solid = {i: group for i, group in enumerate(groups) if volume[i] >= 0}
    for i in set(range(len(groups))) - set(solid):
        parts = np.unique(surface.part[groups[i]])
        hosts = [j for j, group in solid.items() if np.isin(surface.part[group], parts).any()]
        if hosts:
            host = max(hosts, key=lambda j: volume[j])
            solid[host] = solid[host] | groups[i]
        else:
            solid[i] = groups[i]
    groups = list(solid.values())
    groups += [is_open] if is_open.any() else []
    for group in groups:
        yield Shell(surface.points, surface.faces[group], surface.part[group])


SAMPLES = 16_000  # shares to about half a per cent
SEED = 0  # the same body has the same wall
REACHED = 1e-3  # of its depth: round-off of the distance back to the face that a point lies under


def wall_fraction(
    points: Points, faces: Faces, wall: float, *, samples: int = SAMPLES
) -> WallShare:
    """Shares of volume and bending of the layer within ``wall`` [m] of a closed, outward surface.

    Points are dropped from random places of the surface to random depths; those that are nearer to
    another face count there. Exact in the mean for convex bodies; wedges behind inward edges are
    missed, each a part (wall x angle / 2) of the faces beside it. A quarter of the ``samples`` has
    twice the error.
    """
    rng = np.random.default_rng(SEED)
    found = sample(points, faces, rng=rng, count=samples)
    where, normal = found.where[:samples], found.normal[:samples]
    depth = wall * (np.arange(samples) + rng.random(samples)) / samples
    under = where - depth[:, None] * normal
    own = closest(under, points, faces).distance >= depth * (1 - REACHED)
    # Volume [m^3], centroid [m] and integral of x x^T about it [m^5]. Over a tet with a corner at
    # the origin: 6 V / 120 (sum of p p^T + s s^T), s the sum of p.
    origin = points[faces].mean(axis=(0, 1))
    corners = points[faces] - origin
    six, total = np.linalg.det(corners), corners.sum(axis=1)
    volume = float(six.sum() / 6)
    centre = (six[:, None] * total).sum(axis=0) / 24 / volume
    outer = np.einsum("f,fki,fkj->ij", six, corners, corners)
    outer += np.einsum("f,fi,fj->ij", six, total, total)
    moment = outer / 120 - volume * np.outer(centre, centre)
    centre += origin
    axis = np.linalg.eigh(moment)[1][:, 0]
    z = (under[own] - centre) @ axis
    layer = face_areas(points, faces).sum() * wall / samples
    bending = layer * float(z @ z) / float(axis @ moment @ axis)
    return WallShare(min(float(layer * own.sum() / volume), 1.0), min(float(bending), 1.0))


def hull_fraction(points: Points, faces: Faces) -> float:
    """Volume inside a closed surface [m] by that of its convex hull: 1 of a ball."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points[np.unique(faces)])
    return abs(enclosed_volume(Triangles(points, faces))) / hull.volume


# Faces at a vertex whose normals spread by less than about 25 degrees are one smooth surface: the
# smaller eigenvalues of their normals' covariance, (1 - cos 25) / 2, then are noise, not edges.
SMOOTH = 0.05
LONGEST_MITER = 3.0  # distances: a sharper spike is cut, as in a drawing
KEPT_DEPTH = 0.9  # of the wall: an inner face nearer to the outer surface is none (thin places)


def vertex_offsets(points: Points, faces: Faces) -> Points:
    """Move of each vertex that moves all faces around it outward by one: mitred, not averaged."""
    corners = points[faces]
    edges = np.roll(corners, -1, axis=1) - corners
    normal = np.cross(edges[:, 0], edges[:, 1])
    normal /= np.maximum(np.linalg.norm(normal, axis=1), np.finfo(float).tiny)[:, None]
    length = np.maximum(np.linalg.norm(edges, axis=-1), np.finfo(float).tiny)
    cosine = -np.einsum("fki,fki->fk", edges, np.roll(edges, 1, axis=1))
    angle = np.arccos(np.clip(cosine / (length * np.roll(length, 1, axis=1)), -1, 1))
    vertex, weight = faces.reshape(-1), angle.reshape(-1)
    normal = np.repeat(normal, 3, axis=0)
    size = len(points)
    right = _gathered(vertex, weight[:, None] * normal, size)
    outer = np.einsum("ci,cj->cij", normal, normal).reshape(-1, 9)
    matrix = _gathered(vertex, weight[:, None] * outer, size).reshape(-1, 3, 3)
    inverse = np.linalg.pinv(matrix, rcond=SMOOTH, hermitian=True)
    move = np.einsum("vij,vj->vi", inverse, right)
    norm = np.linalg.norm(move, axis=1, keepdims=True)
    return move * np.minimum(1, LONGEST_MITER / np.maximum(norm, np.finfo(float).tiny))


def _gathered(vertex: np.ndarray, values: np.ndarray, size: int) -> np.ndarray:
    """Sum of the rows of ``values`` over the corners of each vertex."""
    return np.stack([np.bincount(vertex, weights=v, minlength=size) for v in values.T], axis=1)


def thickened(surface: Surface, sheet: Bool[np.ndarray, "faces"], thickness: float) -> Surface:
    """Replace the faces ``sheet`` by closed plates of ``thickness`` [m] around them."""
    plate = Surface(
        surface.points, surface.faces[sheet], surface.part[sheet], surface.component[sheet]
    )
    move = vertex_offsets(plate.points, plate.faces) * thickness / 2
    size = len(plate.points)
    rim, owner = boundary_edges(plate)
    u, v = rim.T
    sides = np.concatenate(
        [np.stack([v, u, u + size], axis=1), np.stack([v, u + size, v + size], axis=1)]
    )
    faces = np.concatenate([plate.faces, plate.faces[:, ::-1] + size, sides])
    part = np.concatenate([plate.part, plate.part, np.tile(plate.part[owner], 2)])
    rest = surface.faces[~sheet] + 2 * size
    points = np.concatenate([plate.points + move, plate.points - move, surface.points])
    faces = np.concatenate([faces, rest])
    part = np.concatenate([part, surface.part[~sheet]])
    return Surface(points, faces, part, edge_components(faces))


def hollowed(solids: Solids, walls: Mapping[int, float]) -> Solids:
    """Give the shells of the parts in ``walls`` a cavity that leaves a wall [m] of that thickness.

    Where a shell is thinner than two walls it stays solid.
    """
    shells, surface = [], solids.surface
    for shell in solids.shells:
        wall = max((walls.get(int(part), 0.0) for part in np.unique(shell.part)), default=0.0)
        if wall > 0:
            inner, kept = inner_surface(shell, wall)
            added = inner.faces[kept][:, ::-1] + len(surface.points)
            faces = np.concatenate([surface.faces, added])
            points = np.concatenate([surface.points, inner.points])
            part = np.concatenate([surface.part, shell.part[kept]])
            surface = Surface(points, faces, part, edge_components(faces))
            shell = replace(shell, cavity=inner)
        shells.append(shell)
    return replace(solids, shells=tuple(shells), surface=surface)


def inner_surface(shell: Shell, wall: float) -> tuple[Triangles, Bool[np.ndarray, "faces"]]:
    """Surface parallel to a shell's, a ``wall`` [m] inside; which faces bound a real cavity.

    Those are inside and a wall away from the shell.
    """
    inner = Triangles(shell.points - wall * vertex_offsets(shell.points, shell.faces), shell.faces)
    middle = inner.points[inner.faces].mean(axis=1)
    deep = closest(middle, shell.points, shell.faces).distance >= KEPT_DEPTH * wall
    return inner, deep & shell.contains(middle)
