"""A filling: the tets of the solids, as the engine makes them once for one target."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ...fem.errors import UsageError
from ...fem.mesh import boundary_faces, signed_volumes
from ..asset.cache import Runner
from ..asset.solids import Solids
from ..asset.triangles import (
    Places,
    Points,
    Tets,
    Triangles,
    closest,
    facets,
    linked_groups,
    sample,
)
from .guarantees import ENVELOPE_SHARE, Separated
from .pinches import manifold

EDGE_LENGTH_REL = 0.05  # of the diagonal: the edge that is wanted where none is given
# Tets that a lattice has where no edge is given: a thing of a few parts is resolved, and quadratic
# elements on them still settle in seconds.
LATTICE_TETS = 50_000
BELOW_BUDGET = 0.8  # of the tets that are allowed: thin things get a fifth more than wanted
TETS_PER_CUBE = 12  # of a body-centred lattice, in a cube of its long edge
COARSEST_EDGE_REL, COARSEST_EPSILON_REL = 0.5, 2e-2
MOST_LAYERS = 8  # more are 64 times the tets and more of a plate
DECIMATED_SHARE = 0.25  # of epsilon: how far the surface that the engine gets is off the input
# CPU seconds that fTetWild may take where a lattice will do, those after which what is to come is
# foreseen, and the passes that most bodies need: after the first two or three few tets are bad.
HURRIED, FORESEEN, PASSES = 60.0, 10.0, 4
WORST = (
    2.0  # degrees from flat: a new tet where hollows touch is no worse; the engine's have 3 to 5
)
OUTSIDE, NEAR = -1, -2  # labels of points in no part, and of those near the input's surface
CONFORMING_ROUNDS = 5  # relabelled tets show new vertices; crumbs are one or two tets wide


@dataclass(frozen=True)
class EngineTarget:
    """What the engine is asked for; lengths are shares of ``diagonal`` [m].

    ``layers`` of tets are wanted through thin places; 1 leaves the edge as it is. A lattice has
    that edge where it ``edge_is_given``, else one that gives about ``tets``; it keeps ``sharp``
    edges of the input, and with ``beads`` joins bodies that touch in it. The engine gives up after
    ``most_seconds`` of CPU; if it is ``hurried``, also where it foresees more than ``HURRIED``.
    """

    diagonal: float
    edge_length_rel: float
    epsilon_rel: float
    stop_energy: float = 20.0
    layers: int = 1
    edge_is_given: bool = True
    tets: int = LATTICE_TETS
    sharp: bool = True
    beads: bool = False
    most_seconds: float = np.inf
    hurried: bool = False

    @classmethod
    def of(
        cls,
        diagonal: float,
        edge_length_rel: float | None,
        epsilon_rel: float,
        *,
        max_tets: int | None = None,
        **more: Any,
    ) -> EngineTarget:
        """Build one, checked; without an edge it is ``EDGE_LENGTH_REL``, of a lattice its tets'."""
        edge = EDGE_LENGTH_REL if edge_length_rel is None else edge_length_rel
        limits = ("--edge-length-rel", edge, 1.0), ("--epsilon-rel", epsilon_rel, 0.1)
        for option, value, most in limits:
            if not 0 < value <= most:
                raise UsageError(f"{option} must be > 0 and at most {most:g}, got {value:g}")
        if not 1 <= more.get("layers", 1) <= MOST_LAYERS:
            raise UsageError(f"--layers must be 1 to {MOST_LAYERS}, got {more['layers']}")
        tets = LATTICE_TETS if max_tets is None else min(LATTICE_TETS, BELOW_BUDGET * max_tets)
        given = edge_length_rel is not None
        tets = max(int(tets), 1)
        return cls(diagonal, edge, epsilon_rel, edge_is_given=given, tets=tets, **more)

    @property
    def edge_length(self) -> float:
        """Wanted edge [m]."""
        return self.edge_length_rel * self.diagonal

    @property
    def epsilon(self) -> float:
        """Largest distance from the input [m]."""
        return self.epsilon_rel * self.diagonal

    @property
    def envelope(self) -> float:
        """Distance [m] that the engine keeps; a plate thinner than that is swallowed whole."""
        return ENVELOPE_SHARE * self.epsilon

    def lattice_edge(self, volume: float) -> float:
        """Long edge [m] of a lattice that fills ``volume`` [m^3]."""
        if self.edge_is_given:
            return self.edge_length
        return float((TETS_PER_CUBE * volume / self.tets) ** (1 / 3))

    def unless_finer(self, volume: float) -> EngineTarget:
        """Return the same for a lattice that nobody asked for: its edge is at most the given one.

        Another mesher takes the edge as the longest one, and shorter ones where the shape wants.
        """
        if not self.edge_is_given:
            return self
        tets = int(TETS_PER_CUBE * volume / self.edge_length**3)
        return replace(self, edge_is_given=False, tets=max(self.tets, tets))

    def coarser(self, factor: float) -> EngineTarget:
        """Return the same with longer edges and a wider envelope, within sense."""
        return replace(
            self,
            edge_length_rel=min(self.edge_length_rel * factor, COARSEST_EDGE_REL),
            epsilon_rel=min(self.epsilon_rel * factor, COARSEST_EPSILON_REL),
            tets=max(int(self.tets / factor**3), 1),
        )


class LatticeFit(NamedTuple):
    """How a lattice fits the parts, by their number.

    ``volume_errors`` [1] are relative; ``thin_shares`` [1] of a part's surface are where it is
    thinner than the edge; ``parted_shares`` [1] of its volume are in pieces that have come off;
    from ``closed_shares`` [1] of all surface tets reach over a gap to another wall. Beads of the
    volume ``beads`` [m^3] join bodies that touch in the file and would come apart.
    """

    volume_errors: Mapping[int, float]
    thin_shares: Mapping[int, float]
    parted_shares: Mapping[int, float]
    closed_shares: Mapping[int, float]
    beads: float = 0.0


class Filling(NamedTuple):
    """Tets of the solids in metres, the part of each, and the target they meet.

    ``by_cells`` fills them in another way, where the first breaks a guarantee; ``lattice`` is what
    a lattice says of itself.
    """

    mesh: Separated
    part: np.ndarray
    target: EngineTarget
    by_cells: Callable[[], Filling] | None = None
    lattice: LatticeFit | None = None


class NoFilling(RuntimeError):
    """An attempt that gave no usable mesh, and why."""


def run_engine(solids: Solids, target: EngineTarget, runner: Runner) -> Filling:
    """One run of the engine in a box of unit diagonal, and the tets that lie in a solid."""
    points, faces = solids.clean_triangles()
    lo, hi = points.min(axis=0), points.max(axis=0)
    centre, scale = (lo + hi) / 2, float(np.linalg.norm(hi - lo))
    unit = Triangles((points - centre) / scale, faces)
    edge = min(target.edge_length / scale, 1.0)
    field = edge_field(unit, edge=edge, layers=target.layers) if target.layers > 1 else {}
    box = runner.run(
        "tetwild",
        {**unit._asdict(), **field},
        {
            "edge_length_rel": edge,
            "epsilon_rel": target.envelope / scale,
            "stop_energy": target.stop_energy,
            "decimate_rel": DECIMATED_SHARE * target.epsilon / scale,
        },
        most=target.most_seconds,
        hopeless=hopeless if target.hurried else None,
    )
    where = box["points"] * scale + centre
    part = solids.label(where[box["tets"]].mean(axis=1))

    def kept(part: np.ndarray) -> Filling:
        part = conforming(where, box["tets"], part, solids, target.epsilon)
        if not (part >= 0).any():
            raise NoFilling("no tet lies in a solid")
        tets = box["tets"][part >= 0]
        mesh = manifold(where, tets, reach=target.envelope, worst=WORST)
        if (flat := int((signed_volumes(mesh.points, mesh.tets) <= 0).sum())) > 0:
            raise NoFilling(f"{flat} tets are flat or inverted")
        return Filling(mesh, part[part >= 0][mesh.origin], target)

    return kept(part)._replace(
        by_cells=lambda: kept(by_cells(where, box["tets"], part, solids, target.envelope))
    )


def hopeless(said: str, seconds: float) -> bool:
    """Whether fTetWild takes longer than ``HURRIED``, by its passes so far and its CPU ``seconds``.

    What comes before the first pass, simplifying and inserting the surface, counts as one.
    """
    passes = said.count("/ pass ") + 1
    return seconds > FORESEEN and seconds * max(PASSES / passes, 1.0) > HURRIED


def by_cells(
    points: Points, tets: Tets, part: Int[np.ndarray, "tets"], solids: Solids, envelope: float
) -> Int[np.ndarray, "tets"]:
    """Give all tets between the same walls of the input, within ``envelope`` [m], one label.

    Where edges with three faces leave a surface unbalanced, winding numbers fade out between the
    walls instead of at them. Not for surfaces with holes, through which inside and outside join.
    """
    from scipy.sparse import coo_matrix

    faces, left, right = facets(tets)
    surface = solids.surface
    at_wall = closest(points, surface.points, surface.faces).distance <= envelope
    middle = closest(points[faces].mean(axis=1), surface.points, surface.faces).distance
    free = ~(at_wall[faces].all(axis=1) & (middle <= envelope))
    cell = linked_groups(len(tets), left[free], right[free])
    votes = coo_matrix((np.abs(signed_volumes(points, tets)), (cell, part + 1))).tocsr()
    return (np.asarray(votes.argmax(axis=1)).reshape(-1) - 1)[cell]


def conforming(
    points: Points, tets: Tets, part: Int[np.ndarray, "tets"], solids: Solids, epsilon: float
) -> Int[np.ndarray, "tets"]:
    """Relabel tets where the boundary is farther than ``epsilon`` [m] from the input.

    The engine swallows what is thinner than its envelope; tets that then cross the input are told
    apart by their centroids, at random. A boundary vertex that far from the input lies inside or
    outside, and so do all tets around it; a face whose middle is outside bounds no solid.
    """

    def labels(where: np.ndarray) -> np.ndarray:
        """Part that each point lies in, ``OUTSIDE``, or ``NEAR`` the input."""
        label = np.full(len(where), NEAR)
        far = closest(where, solids.surface.points, solids.surface.faces).distance > epsilon
        label[far] = solids.label(where[far])
        return label

    part = part.copy()
    for _ in range(CONFORMING_ROUNDS):
        if not (part >= 0).any():
            break
        boundary = boundary_faces(tets[part >= 0])
        skin = np.unique(boundary.faces)
        vertex, face = labels(points[skin]), labels(points[boundary.faces].mean(axis=1))
        if (vertex == NEAR).all() and (face == NEAR).all():
            break
        wrong = np.flatnonzero(part >= 0)[boundary.tet[face == OUTSIDE]]
        corner = np.full(len(points), NEAR)
        corner[skin] = vertex
        within = corner[tets].max(axis=1)
        part = np.where((part == OUTSIDE) & (within >= 0), within, part)
        part[(corner[tets] == OUTSIDE).any(axis=1)] = OUTSIDE
        part[wrong] = OUTSIDE
    return part


# Edges for thin places: how thick a solid is, and a field of edge lengths made from that.

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
    # Six tets in every cell of a lattice of points, in the order of `numpy.argwhere`
    number = np.arange(shape.prod()).reshape(shape)
    corners = [
        number[i : shape[0] - 1 + i, j : shape[1] - 1 + j, k : shape[2] - 1 + k].reshape(-1)
        for k, j, i in np.ndindex(2, 2, 2)
    ]
    return {
        "bg_vertices": vertices,
        "bg_tets": np.stack(corners, axis=1)[:, CUBE_TETS].reshape(-1, 4).astype(np.int32),
        "bg_values": values.reshape(-1),
    }


def thicknesses(
    surface: Triangles, *, edge: float, rng: np.random.Generator, count: int = RAYS
) -> tuple[Places, Places, Float[np.ndarray, "n"]]:
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
