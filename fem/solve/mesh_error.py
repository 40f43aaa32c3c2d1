"""Error that the mesh leaves in a quadratic answer, by the surplus of cubic elements.

Some steps of conjugate gradients solve for what cubic elements would add; every tet's share of that
is multiplied by what the theory of corners says is still to come at the edges that it touches.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ..device import single_threaded, start_warp
from ..elements.assembly import node_supports
from ..elements.elastic import linear_stress, von_mises
from ..elements.forces import edge_nodes
from ..elements.space import EDGES, Space, duffy_rule, element_points, shape_functions
from ..linalg.solver import Inverse
from ..mesh import FACES, TetMesh, equal_faces, face_areas, material_of, tet_area_vectors
from ..scene.loads import Traction
from ..scene.supports import Supports
from .result import CUBIC, PLACES, DiscretisationError, Modes, SingularPlace, StaticResult

# The steps end where one wins less than this fraction of all energy that was won. Flat cells and nu
# near .5 creep: at .02 a tet of 1:20 is told half of its error.
GAIN, MOST_STEPS = 0.005, 60
# Smallest exponents of points and lines, where no energy is finite: corners have .5 and more.
POINT = 0.3
# An edge or vertex of a larger exponent is smooth; one of a smaller is a place to be named, and not
# a crease such as a facet's of a round face.
SMOOTH, NAMED = 0.97, 0.8
# At one point the change may cancel: it is told to be no less than this of that of the work, of
# the loads or of the supports that move.
OF_WORK = 0.125
# A mode whose frequency is no more than this above the first may be the first on a finer mesh.
CLOSE = 0.1
# Share of the largest force of a support below which that of another is not judged.
LEAST = 0.01
# Ratio of moduli from which on the end of an interface counts.
CONTRAST = 3.0


class Surplus(NamedTuple):
    """What cubic elements add: to the nodes (nodes, 3), and numbers of their own (surplus, 3) [m].

    ``energies`` (tets,) are those of both [J], times two.
    """

    moved: np.ndarray
    own: np.ndarray
    energies: np.ndarray


@single_threaded
def find_surplus(
    cubic: CubicElements,
    stiffness: Inverse,
    held: Bool[np.ndarray, "nodes 3"],
    rest: Float[np.ndarray, "surplus 3"],
) -> Surplus:
    """What the forces ``rest`` [N] on the surplus move, by conjugate gradients.

    Blocks of the surplus are the preconditioner, and the nodes follow at every step: by one cycle
    of the ``stiffness`` of quadratic elements or by its factor, as they were solved for.
    """
    precondition = cubic.inverse_blocks()
    moved, own = np.zeros(held.shape), np.zeros_like(rest)
    pull, rest = np.zeros(held.shape), np.where(cubic.fixed, 0.0, rest)
    along = forces = (moved, own)
    size, won = 0.0, 0.0
    for _ in range(MOST_STEPS):
        z = np.einsum("nij,nj->ni", precondition, rest)
        on_nodes, on_own = cubic.forces(z)
        follows = -stiffness.near(np.where(held, 0.0, on_nodes + pull))
        follows[held] = 0.0
        on_nodes = np.where(held, 0.0, on_nodes + stiffness.times(follows))
        on_own = np.where(cubic.fixed, 0.0, on_own + cubic.nodal_forces(follows))
        # Conjugate to the direction before: a cycle is no inverse, and formulas for one would drift
        back = ((follows * forces[0]).sum() + (z * forces[1]).sum()) / size if size else 0.0
        along = follows - back * along[0], z - back * along[1]
        forces = on_nodes - back * forces[0], on_own - back * forces[1]
        size = float((along[0] * forces[0]).sum() + (along[1] * forces[1]).sum())
        slope = float((along[1] * rest).sum() - (along[0] * pull).sum())
        if not (size > 0 and slope > 0):
            break
        step = slope / size
        moved, own = moved + step * along[0], own + step * along[1]
        pull, rest = pull + step * forces[0], rest - step * forces[1]
        won += step * slope
        if step * slope < GAIN * won:
            break
    return Surplus(moved, own, cubic.energies(moved, own))


# What is still to come beyond cubic elements, at edges and corners.


# Steps of Newton's method from every start: those that arrive at all do so in fewer.
NEWTON = 16


def wedge_exponents(
    angle: Float[np.ndarray, "*n"], nu: Float[np.ndarray, "*n"], held: Bool[np.ndarray, "*n"]
) -> Float[np.ndarray, "*n"]:
    """Least real part of a in u ~ r^a [1] at edges of the interior ``angle`` [degrees].

    Williams (1952), plane strain: both faces free, sin(a w) = -a sin w; one ``held``, (3 - 4 nu)
    sin^2(a w) = 4 (1 - nu)^2 - a^2 sin^2 w, whose roots are complex at wide angles. One where none
    is below one.
    """
    w = np.radians(np.minimum(angle, 360.0))[..., None]
    nu, clamped, sine = nu[..., None], held[..., None], np.sin(w)
    starts = np.linspace(0.2, 1.1, 19)[:, None] + 1j * np.array([0.0, 0.05, 0.15, 0.3])
    a: Any = starts.ravel()

    def equation(a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The sides' difference, and its slope along a."""
        s, c, k = np.sin(a * w), np.cos(a * w), 3 - 4 * nu
        one = k * s**2 - 4 * (1 - nu) ** 2 + (a * sine) ** 2, 2 * (k * w * s * c + a * sine**2)
        two = s + a * sine, w * c + sine
        return np.where(clamped, one[0], two[0]), np.where(clamped, one[1], two[1])

    with np.errstate(all="ignore"):  # of starts that lead nowhere
        for _ in range(NEWTON):
            value, slope = equation(a)
            a = a - value / slope
        good = (np.abs(equation(a)[0]) < 1e-8) & (a.real > 0.2) & (a.real < 1)
    least = np.where(good, a.real, 1.0).min(axis=-1)
    return np.where(held | (angle > 181), least, 1.0)


class Exponents(NamedTuple):
    """Exponent [1] of every point of a mesh, and its kind, an index of ``PLACES``; -1: smooth."""

    value: Float[np.ndarray, "points"]
    kind: Int[np.ndarray, "points"]


def find_exponents(
    mesh: TetMesh,
    space: Space,
    held: Bool[np.ndarray, "nodes 3"],
    forces: Float[np.ndarray, "points 3"] | None = None,
) -> Exponents:
    """Exponents at the edges of supports, inner corners, ends of interfaces, loads at points."""
    points, faces = len(mesh.points), mesh.boundary.faces
    value, kind = np.ones(points), np.full(points, -1)

    def lower(ids: np.ndarray, to: np.ndarray, of: str) -> None:
        to = np.where(to < SMOOTH, to, 1.0)
        order = np.argsort(-to, kind="stable")  # the least is written last
        ids, to = ids[order], to[order]
        less = to < value[ids]
        value[ids[less]] = to[less]
        kind[ids[less]] = PLACES.index(of)

    # Interior angle of every edge, the sum over its tets, and its largest nu
    edges = space.elements[:, 4:] - space.points
    areas = tet_area_vectors(mesh.points, mesh.tets)
    normals = areas / np.linalg.norm(areas, axis=1)[:, None]
    angle, nu = np.zeros(len(space.edges)), np.zeros(len(space.edges))
    poisson = np.minimum(material_of(mesh).nu, 0.499)
    for k, ends in enumerate(EDGES):
        one, two = (f for f in range(4) if f not in ends)
        cosine = -np.einsum("xt,xt->t", normals[one], normals[two])
        angle += np.bincount(edges[:, k], np.degrees(np.arccos(cosine.clip(-1, 1))), len(angle))
        np.maximum.at(nu, edges[:, k], poisson)
    # Faces that are held in every direction, or in some
    around = edge_nodes(space, faces[:, [[0, 1], [1, 2], [2, 0]]])
    by_axis = np.all(held[faces], axis=1) & np.all(held[around], axis=1)
    count = np.zeros((3, len(space.edges)), dtype=np.int64)  # faces, held ones, wholly held ones
    any_axis, every_axis = np.any(by_axis, axis=1), np.all(by_axis, axis=1)
    for row, which in enumerate((slice(None), any_axis, every_axis)):
        count[row] = np.bincount(around[which].ravel() - space.points, minlength=len(angle))
    every, some, whole = count
    for of, which in (
        ("support edge", (some > 0) & (some < every)),
        ("inner corner", (every > 0) & (some == 0) & (angle > 181)),
    ):
        at = np.flatnonzero(which)
        clamped = (whole > 0)[at] if of == "support edge" else np.zeros(len(at), dtype=bool)
        # A face that slides mirrors the body: a free edge of twice the angle
        mirrored = (some[at] > 0) & ~clamped
        rows = np.column_stack(
            [np.where(mirrored, 2 * angle[at], angle[at]).round(), nu[at].round(3), clamped]
        )
        unlike, back = np.unique(rows, axis=0, return_inverse=True)
        found = wedge_exponents(unlike[:, 0], unlike[:, 1], unlike[:, 2] > 0)[back.ravel()]
        lower(space.edges[at].ravel(), np.repeat(found, 2), of)
    # Where an interface meets the surface the stiff side holds the soft one
    E, ends = material_of(mesh).E, np.unique(faces)
    low, high, worst = np.full(points, np.inf), np.zeros(points), np.zeros(points)
    np.minimum.at(low, mesh.tets, E[:, None])
    np.maximum.at(high, mesh.tets, E[:, None])
    np.maximum.at(worst, mesh.tets, poisson[:, None])
    ends = ends[high[ends] > CONTRAST * low[ends]]
    part = (high - low)[ends] / (high + low)[ends]
    unlike, back = np.unique(worst[ends].round(3), return_inverse=True)
    right = wedge_exponents(np.full(len(unlike), 90.0), unlike, np.full(len(unlike), True))[back]
    lower(ends, 1 - part * (1 - right), "interface end")
    if forces is not None:
        loaded = np.flatnonzero(np.any(forces[:points], axis=1))
        lower(loaded, np.full(len(loaded), POINT), "point load")
    alone = np.array(np.any(held[:points], axis=1))
    alone[faces[any_axis]] = False
    alone = np.flatnonzero(alone)
    lower(alone, np.full(len(alone), POINT), "point support")
    return Exponents(value, kind)


def still_to_come(exponent: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """Squared error of order 2 over what order 3 wins of it: order p leaves p^(-4 exponent)."""
    two, three = (p ** (-4.0 * np.maximum(exponent, POINT)) for p in (2.0, 3.0))
    return 1 + three / (two - three)


def _named_places(
    mesh: TetMesh, space: Space, at: Exponents, shares: Float[np.ndarray, "tets"]
) -> list[tuple[SingularPlace, np.ndarray]]:
    """Connected places that hold more of the error than of the volume, with their points."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    found, count = [], len(mesh.points)
    strong = at.value < NAMED
    for kind in np.unique(at.kind[strong]):
        mine = strong & (at.kind == kind)
        joined = space.edges[mine[space.edges].all(axis=1)]
        graph = coo_array((np.ones(len(joined)), tuple(joined.T)), shape=(count, count))
        label = connected_components(graph, directed=False)[1]
        for one in np.unique(label[mine]):
            points = np.flatnonzero(mine & (label == one))
            hit = np.isin(mesh.tets, points).any(axis=1)
            share, part = shares[hit].sum(), mesh.volumes[hit].sum() / mesh.volume
            if share > min(2 * part, (1 + part) / 2):
                centre, around = mesh.points[points].mean(axis=0), np.unique(mesh.tets[hit])
                radius = float(np.linalg.norm(mesh.points[around] - centre, axis=1).max())
                known = (tuple(centre.tolist()), radius, float(at.value[points].min()))
                found.append((SingularPlace(PLACES[kind], *known, float(share)), points))
    return sorted(found, key=lambda pair: -pair[0].share)


# Barycentric centres of the eight children of a tet, where stresses are compared.
INNER = np.array([[6, 4, 2, 4], [4, 6, 4, 2], [4, 2, 4, 6], [2, 4, 6, 4]]) / 16
CHILDREN = np.vstack([0.125 + 0.5 * np.eye(4), INNER])
# The smooth part of a body is a tenth of its tets at least, if it is to lie a ring of tets away.
SMOOTH_PART = 0.1


def smooth_patch(result: StaticResult, exponents: Exponents) -> tuple[np.ndarray, int] | None:
    """Tets around the one that has the largest stress off the singular places, and that one.

    A ring of tets away from them where much of the body is; None where nothing is.
    """
    tets, size = result.mesh.tets, result.von_mises
    near = (exponents.value < 1)[tets].any(axis=1)
    ring = np.isin(tets, tets[near]).any(axis=1) if near.any() else near
    away = ~ring if (~ring).mean() > SMOOTH_PART else ~near
    if not (away.any() and size.max() > 0):
        return None
    top = int(np.where(away, size, -1.0).argmax())
    return np.flatnonzero(np.isin(tets, tets[top]).any(axis=1) & away), top


def _stress_error(
    result: StaticResult, cubic: CubicElements, exponents: Exponents, surplus: Surplus
) -> float:
    """Rms error of the equivalent stress around its largest, over that [1]."""
    if (patch := smooth_patch(result, exponents)) is None:
        return np.nan
    around, top = patch
    own, none = material_of(result.mesh).of_tets(around), np.zeros_like(surplus.own)
    fields = (result.node_displacement, none), (surplus.moved, surplus.own)
    told, off = (
        von_mises(linear_stress(cubic.gradients(*field, around, CHILDREN), own)) for field in fields
    )
    return float(np.sqrt((off**2).mean()) / told[around == top].max())


class MeshError(NamedTuple):
    """Relative errors, and what every tet has of the squared one in energy [1]."""

    relative: DiscretisationError
    shares: Float[np.ndarray, "tets"] | None = None


def estimate_error(
    result: StaticResult,
    supports: Supports,
    stiffness: Inverse,
    *,
    gravity_vector: Sequence[float] | np.ndarray | None,
    traction: Traction | Sequence[Traction] | None,
    forces: np.ndarray | None = None,
) -> MeshError:
    """Errors of a quadratic linear ``result`` under ``supports`` and loads as in ``solve_static``.

    ``stiffness`` is that of its elements, as they are held.
    """
    mesh, space, u = result.mesh, result.space, result.node_displacement
    held = node_supports(supports, space)
    cubic = CubicElements(mesh, space, held.fixed)
    gravity = np.zeros(3) if gravity_vector is None else gravity_vector
    tractions = [traction] if isinstance(traction, Traction) else traction or ()
    rest = cubic.load(gravity, tractions) - cubic.nodal_forces(u)
    surplus = find_surplus(cubic, stiffness, held.fixed, rest)
    moved, own, energies = surplus
    exponents = find_exponents(mesh, space, held.fixed, forces)
    least = exponents.value[mesh.tets].min(axis=1)
    squares, won = still_to_come(least) * energies, float(energies.sum())
    total = float(squares.sum())
    factor, shares = (total / won, squares / total) if won > 0 else (1.0, squares)
    # Largest displacement, of what is not prescribed
    size, doubled = np.linalg.norm(u, axis=1), 2 * result.energy
    largest, node = float(size.max()), int(size.argmax())
    change = abs(float(np.linalg.norm(u[node] + moved[node])) - largest)
    if held.fixed[node].any() and held.values[node].any():
        change = float(np.linalg.norm(moved, axis=1).max())
    displaced = factor * change / largest if largest else 0.0
    share = total / doubled if doubled > 0 else np.nan
    work = np.nan if supports.values.any() else share
    displaced = float(np.fmax(displaced, OF_WORK * share))
    # Reactions, place by place
    pull = np.where(held.fixed, result.body.response(moved).force + cubic.forces(own)[0], 0.0)
    each = [(np.where(place, f, 0.0).sum(axis=0) for f in (result.reaction, factor * pull))
            for place in held.places]  # fmt: skip
    carried, off = np.linalg.norm([[*pair] for pair in each], axis=2).T if each else ([], [])
    named = _named_places(mesh, space, exponents, shares)
    here = mesh.tets[result.von_mises.argmax()]
    peak = next((place for place, points in named if np.isin(here, points).any()), None)
    relative = DiscretisationError(
        displaced,
        CUBIC,
        energy=float(np.sqrt(share)) if doubled > 0 else 0.0,
        work=work,
        reaction=max(
            (float(d / f) for f, d in zip(carried, off, strict=True) if f > LEAST * max(carried)),
            default=np.nan,
        ),
        stress=_stress_error(result, cubic, exponents, surplus),
        places=tuple(place for place, _ in named),
        peak=peak,
    )
    return MeshError(relative, shares)


def estimate_frequency_error(
    mesh: TetMesh, space: Space, held: Supports, stiffness: Inverse, modes: Modes
) -> float:
    """Relative error [1] of the first frequency of quadratic ``modes``, which the mesh raises.

    ``stiffness`` is that of its elements under the supports ``held`` of the nodes. A mode that is
    close above the first may come before it.
    """
    cubic = CubicElements(mesh, space, held.fixed)
    least = find_exponents(mesh, space, held.fixed).value[mesh.tets].min(axis=1)
    factors, first, found = still_to_come(least), float(modes.frequencies[0]), []
    for frequency, phi in zip(modes.frequencies, modes.shapes, strict=True):
        if not 0 < frequency <= (1 + CLOSE) * first:
            break
        square = (2 * np.pi * float(frequency)) ** 2
        weighed = cubic.weigh(phi, np.zeros((cubic.count, 3)))[0]
        rest = square * weighed - cubic.nodal_forces(phi)
        moved, own, energies = find_surplus(cubic, stiffness, held.fixed, rest)
        phi = phi + moved  # Rayleigh's quotient of what cubic elements make of it
        energy = cubic.energies(phi, own).sum() + float((held.springs * phi**2).sum())
        lower = 1 - float(np.sqrt(energy / cubic.weigh(phi, own)[1] / square))
        factor = float(factors @ energies / energies.sum()) if energies.any() else 1.0
        found.append(frequency * (1 - factor * lower))
    return 1 - min(found) / first if found else np.nan


def estimate_factor_error(
    mesh: TetMesh,
    space: Space,
    held: Supports,
    stiffness: Inverse,
    shape: Float[np.ndarray, "nodes 3"],
    pull: Float[np.ndarray, "tets points 3 3"],
) -> float:
    """Relative error [1] of the load factor of a quadratic ``shape`` [m], which the mesh raises.

    What cubic elements win in the shape, over its energy: of the factor of the body, which that of
    the mesh is 1 + error times; to second order of either. ``pull`` [Pa] is what its stiffness
    balances: factor grad(shape) stress, at the points of quadrature.
    """
    cubic = CubicElements(mesh, space, held.fixed)
    least = find_exponents(mesh, space, held.fixed).value[mesh.tets].min(axis=1)
    rest = -cubic.flux_forces(pull, element_points(2)) - cubic.nodal_forces(shape)
    won = still_to_come(least) * find_surplus(cubic, stiffness, held.fixed, rest).energies
    return float(won.sum() / (shape * stiffness.times(shape)).sum())


@lru_cache(maxsize=1)
def _slopes_at_nodes() -> Float[np.ndarray, "20 10 4"]:
    """Derivatives by barycentric coordinates of 20 functions at the ten nodes of a tet.

    Ten quadratic ones, then the surplus: Li Lj (Li - Lj) of every edge and Li Lj Lk of every face,
    which are zero at all nodes.
    """
    corners = np.eye(4)
    at = np.concatenate([corners, corners[EDGES].mean(axis=1)])
    out = np.zeros((20, len(at), 4))
    for i in range(4):
        out[i, :, i] = 4 * at[:, i] - 1
    for k, (i, j) in enumerate(EDGES):
        one, two = at[:, i], at[:, j]
        out[4 + k, :, i], out[4 + k, :, j] = 4 * two, 4 * one
        out[10 + k, :, i], out[10 + k, :, j] = 2 * one * two - two**2, one**2 - 2 * one * two
    for k, (i, j, m) in enumerate(FACES):
        for one, two, three in ((i, j, m), (j, m, i), (m, i, j)):
            out[16 + k, :, one] = at[:, two] * at[:, three]
    return out


def _slopes() -> Float[np.ndarray, "10 4 20"]:
    """The same as numbers of a basis that is orthonormal over a tet of volume one.

    Its first four polynomials are linear, the others of second degree.
    """
    N = shape_functions(2, (rule := duffy_rule()).points)
    corners = np.concatenate([np.eye(4), np.eye(4)[EDGES].mean(axis=1)])
    basis = np.hstack([corners, *(corners[:, [i]] * corners[:, [j]] for i, j in EDGES)])
    gram = np.einsum("q,qi,qj->ij", rule.weights, N @ basis, N @ basis)
    numbers = np.linalg.cholesky(gram).T @ np.linalg.inv(basis)  # of values at the nodes
    return np.einsum("ni,aim->nma", numbers, _slopes_at_nodes())


@lru_cache(maxsize=1)
def _mass() -> Float[np.ndarray, "20 20"]:
    """Consistent mass of a cubic tet of mass one."""
    L, weights = duffy_rule(5)
    edges = [L[:, i] * L[:, j] * (L[:, i] - L[:, j]) for i, j in EDGES]
    N = np.column_stack([shape_functions(2, L), *edges, *(L[:, f].prod(axis=1) for f in FACES)])
    return np.einsum("q,qi,qj->ij", weights, N, N)


class CubicElements:
    """What cubic functions add to the quadratic ones of ``space``, on the CPU.

    The surplus has three numbers for every edge, then for every face. ``fixed`` (surplus, 3) are
    those that the supports of the nodes, ``held`` (nodes, 3), hold: of edges whose middle is held,
    and of faces between three of these.
    """

    def __init__(self, mesh: TetMesh, space: Space, held: Bool[np.ndarray, "nodes 3"]) -> None:
        from ..elements import kernels_cubic as k
        from ..elements.kernels_elastic import mat66d
        from ..laws.kernels_tensor import Tets

        wp, tets = start_warp(), mesh.tets
        self.mesh, self.space, self.material = mesh, space, material_of(mesh)
        corners = np.sort(tets[:, FACES].reshape(-1, 3), axis=1)
        order, same = equal_faces(corners)
        first = np.concatenate([[True], ~same])
        face = np.empty(len(corners), dtype=np.int64)
        face[order] = np.cumsum(first) - 1
        self.faces = corners[order[first]]
        edge, edges = space.elements[:, 4:] - space.points, len(space.edges)
        self.numbers = np.hstack([edge, edges + face.reshape(-1, 4)]).astype(np.int32)
        self.count = edges + len(self.faces)
        around = [[k for k, ends in enumerate(EDGES) if f not in ends] for f in range(4)]
        borders = edge[:, around].reshape(-1, 3)[order[first]]
        middles = held[space.points :]
        self.fixed = np.concatenate([middles, middles[borders].all(axis=1)])
        self._arrays = c = k.Cubic()
        c.tets = Tets()
        c.tets.points = wp.array(space.nodes, dtype=wp.vec3d, device="cpu")
        c.tets.elements = wp.array(space.elements, dtype=wp.int32, device="cpu")
        c.tets.quadrature = wp.array(np.full((1, 4), 0.25), dtype=wp.vec4d, device="cpu")
        c.surplus = wp.array(self.numbers, dtype=wp.int32, device="cpu")
        lam, mu = self.material.lame
        c.lam, c.mu = (wp.array(m, dtype=wp.float64, device="cpu") for m in (lam, mu))
        if self.material.tensor is not None:
            c.tensors = wp.array(self.material.tensor, dtype=mat66d, device="cpu")
        c.quadratic, c.cubic = (
            wp.array(np.ascontiguousarray(part), dtype=k.vec10d, device="cpu")
            for part in (_slopes()[:4, :, :10], _slopes()[..., 10:])
        )

    def _launch(self, kernel: Any, *arrays: Any) -> None:
        inputs = [self._arrays, *arrays]
        start_warp().launch(kernel, len(self.numbers), inputs=inputs, device="cpu")

    def forces(self, x: Float[np.ndarray, "surplus 3"]) -> tuple[np.ndarray, np.ndarray]:
        """Forces [N] on the nodes and on the surplus of its numbers ``x`` [m]."""
        from ..elements import kernels_cubic as k

        wp = start_warp()
        own = wp.array(x, dtype=wp.vec3d, device="cpu")
        nodes = wp.zeros(len(self.space.nodes), dtype=wp.vec3d, device="cpu")
        surplus = wp.zeros(self.count, dtype=wp.vec3d, device="cpu")
        self._launch(k.surplus_force, own, nodes, surplus)
        return nodes.numpy(), surplus.numpy()

    def nodal_forces(self, u: Float[np.ndarray, "nodes 3"]) -> Float[np.ndarray, "surplus 3"]:
        """Forces [N] on the surplus of a displacement ``u`` [m] of the nodes."""
        from ..elements import kernels_cubic as k

        wp = start_warp()
        out = wp.zeros(self.count, dtype=wp.vec3d, device="cpu")
        self._launch(k.nodal_force, wp.array(u, dtype=wp.vec3d, device="cpu"), out)
        return out.numpy()

    def energies(
        self, u: Float[np.ndarray, "nodes 3"], x: Float[np.ndarray, "surplus 3"]
    ) -> Float[np.ndarray, "tets"]:
        """Energy [J] of every tet, times two, of both parts of a displacement [m] together."""
        from ..elements import kernels_cubic as k

        wp = start_warp()
        fields = (wp.array(v, dtype=wp.vec3d, device="cpu") for v in (u, x))
        out = wp.zeros(len(self.numbers), dtype=wp.float64, device="cpu")
        self._launch(k.surplus_energy, *fields, out)
        return out.numpy()

    def inverse_blocks(self) -> Float[np.ndarray, "surplus 3 3"]:
        """Inverse diagonal blocks [m/N] of the surplus, of no grain; zero where it is fixed."""
        from ..elements import kernels_cubic as k

        wp = start_warp()
        made = wp.zeros(self.count, dtype=wp.mat33d, device="cpu")
        self._launch(k.surplus_blocks, made)
        blocks = made.numpy()
        stopped, axes = np.nonzero(self.fixed)
        blocks[stopped, axes] = blocks[stopped, :, axes] = 0
        blocks[stopped, axes, axes] = 1
        inverse = np.linalg.inv(blocks)
        inverse[stopped, axes, axes] = 0
        return inverse

    def load(
        self, gravity_vector: Sequence[float] | np.ndarray, tractions: Sequence[Traction]
    ) -> Float[np.ndarray, "surplus 3"]:
        """Forces [N] on the surplus, on that of faces alone: an edge's functions have no mean."""
        first = self.count - len(self.faces)
        mass = np.repeat(self.material.rho * self.mesh.volumes / 120, 4)
        weight = np.bincount(self.numbers[:, 6:].ravel(), mass, self.count)
        total = weight[:, None] * np.asarray(gravity_vector, dtype=float)
        size = int(self.faces.max()) + 1
        keys = [np.sort(f, axis=1).astype(np.int64) @ [size**2, size, 1] for f in
                (self.faces, *(one.faces for one in tractions))]  # fmt: skip
        for one, key in zip(tractions, keys[1:], strict=True):
            area = face_areas(self.mesh.points, one.faces)[:, None]
            at = first + np.searchsorted(keys[0], key)
            np.add.at(total, at, np.broadcast_to(one.value, one.faces.shape) * area / 60)
        return total

    def gradients(
        self,
        u: Float[np.ndarray, "nodes 3"],
        x: Float[np.ndarray, "surplus 3"],
        tets: np.ndarray,
        where: Float[np.ndarray, "points 4"],
    ) -> Float[np.ndarray, "some points 3 3"]:
        """Gradients [1] of both parts together at barycentric points of some ``tets``."""
        slopes, g = self._gradients(tets, where)
        return np.einsum("tac,qam,tmd->tqcd", self._local(u, x, tets), slopes, g, optimize=True)

    def flux_forces(
        self, flux: Float[np.ndarray, "tets points 3 3"], where: Float[np.ndarray, "points 4"]
    ) -> Float[np.ndarray, "surplus 3"]:
        """Forces [N] on the surplus of a ``flux`` [Pa] at points of equal weights of every tet."""
        slopes, g = self._gradients(slice(None), where)
        flux = flux * (self.mesh.volumes / len(where))[:, None, None, None]
        own = np.einsum("tqcd,qam,tmd->tac", flux, slopes[:, 10:], g, optimize=True)
        return self._gathered(own)

    def _gradients(self, tets: Any, where: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Slopes (points, 20, 4) by barycentric coordinates; their gradients (some, 4, 3) [1/m]."""
        corners = self.mesh.points[self.mesh.tets[tets]]
        inner = np.linalg.inv(corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1)
        g = np.concatenate([-inner.sum(axis=1, keepdims=True), inner], axis=1)
        return np.einsum("qi,aim->qam", shape_functions(2, where), _slopes_at_nodes()), g

    def _gathered(self, own: Float[np.ndarray, "tets 10 3"]) -> Float[np.ndarray, "surplus 3"]:
        """Sums on the surplus of what its ten functions have in every tet."""
        own, ids = own * self._signs(slice(None)), self.numbers.ravel()
        sums = [np.bincount(ids, own[..., axis].ravel(), self.count) for axis in range(3)]
        return np.stack(sums, axis=1)

    def weigh(
        self, u: Float[np.ndarray, "nodes 3"], x: Float[np.ndarray, "surplus 3"]
    ) -> tuple[np.ndarray, float]:
        """Mass of cubic elements times both parts: on the surplus [kg m]; times both [kg m^2]."""
        local = self._local(u, x)
        mass = self.material.rho * self.mesh.volumes
        pushed = mass[:, None, None] * (_mass() @ local)
        return self._gathered(pushed[:, 10:]), float((local * pushed).sum())

    def _signs(self, tets: Any) -> Float[np.ndarray, "some 10 1"]:
        """An edge's function changes its sign with the way along it: up in the mesh's points."""
        corners = self.mesh.tets[tets]
        signs = np.ones((len(corners), 10, 1))
        signs[:, :6, 0] -= 2.0 * (corners[:, EDGES[:, 0]] > corners[:, EDGES[:, 1]])
        return signs

    def _local(self, u: np.ndarray, x: np.ndarray, tets: Any = slice(None)) -> np.ndarray:
        """Numbers (some, 20, 3) of the functions of some tets."""
        own = x[self.numbers[tets]] * self._signs(tets)
        return np.concatenate([u[self.space.elements[tets]], own], axis=1)
