"""Discretisation error of a body at rest; what elements a motion takes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ..device import single_threaded
from ..elements.assembly import constrained_stiffness, discretise, node_supports
from ..elements.space import (
    EDGES,
    LARGEST_MOVING,
    LARGEST_P2,
    affordable_order,
    duffy_rule,
    p2_unknowns,
    shape_functions,
)
from ..errors import ConvergenceError, InputError
from ..material import mandel_tensor, mandel_vector
from ..mesh import FACES, TetMesh, equal_faces, face_areas, material_of
from ..note import Note
from ..scene.loads import Traction
from ..scene.supports import Supports
from .modal import QUICK, constrained_inverse, factor_fits, natural_modes
from .result import BENDS_ALIKE, CUBIC, LOCKING, DiscretisationError, StaticResult

# Unknowns of quadratic elements up to which a motion takes them where linear ones lock in bending.
FEW_UNKNOWNS = 20_000
# Where no factor is affordable the estimate solves to this relative residual.
ROUGH = 1e-3
LINEAR_TAKEN = Note("error.linear_elements", largest_p2=LARGEST_P2)


class MotionElements(NamedTuple):
    """Order of a motion's elements, and how many times too stiff they are: NaN, not known."""

    order: int
    stiffening: float = np.nan


def motion_order(mesh: TetMesh) -> int:
    """Linear elements for a motion, but quadratic ones where linear ones lock, if affordable."""
    locks = (material_of(mesh).nu > LOCKING).any()
    return affordable_order(mesh, LARGEST_MOVING) if locks else 1


def motion_elements(
    mesh: TetMesh, supports: Supports | None, order: int | None = None, *, most: int = FEW_UNKNOWNS
) -> MotionElements:
    """Elements of a motion: of ``order`` where it is given, else ``motion_order``'s.

    Quadratic ones too where linear ones lock in bending, while they have ``most`` unknowns.
    """
    if (used := order or motion_order(mesh)) == 2:
        return MotionElements(2)
    stiffening = linear_stiffening(mesh, supports)
    if order is None and stiffening > BENDS_ALIKE and p2_unknowns(mesh) <= most:
        return MotionElements(2)
    return MotionElements(used, stiffening)


def linear_stiffening(mesh: TetMesh, supports: Supports | None = None) -> float:
    """How many times as stiff [1] linear elements make ``mesh`` as quadratic ones do, as held.

    The ratio of the squares of the first frequencies, both with the consistent mass. Linear
    elements lock in bending where a part is few of them thick, whatever its nu. NaN where quadratic
    ones have no modes within seconds.
    """
    try:
        if not factor_fits(mesh, most=QUICK):
            return np.nan
        linear, quadratic = (
            float(natural_modes(mesh, 1, supports=supports, order=order).frequencies[0]) ** 2
            for order in (1, 2)
        )
    except (InputError, ConvergenceError):
        return np.nan
    return linear / quadratic if quadratic > 0 else np.nan


def find_discretisation_error(
    result: StaticResult, supports: Supports, solve: Callable[..., StaticResult], **loads: Any
) -> DiscretisationError:
    """Error of the linear ``result`` under ``supports`` and ``loads`` as in ``solve_static``.

    ``solve(order=2)`` answers the same problem with quadratic elements, where linear ones were
    taken.
    """
    if supports.values.any():
        why = Note("error.largest_displacement")
        return DiscretisationError(np.nan, "", why)
    largest = float(np.linalg.norm(result.displacement, axis=1).max())
    if result.order == 1:
        if affordable_order(result.mesh) == 1:
            return DiscretisationError(np.nan, "", LINEAR_TAKEN)
        try:
            fine = float(np.linalg.norm(solve(order=2).displacement, axis=1).max())
        except ConvergenceError as error:
            return DiscretisationError(np.nan, "", Note("error.quadratic_elements", error=error))
        return DiscretisationError(abs(largest - fine) / fine if fine > 0 else 0.0, "P1/P2")
    grid = discretise(result.mesh, 2)
    held = node_supports(supports, grid.space)
    stiffness = constrained_stiffness(grid, material_of(result.mesh), held)
    inverse = constrained_inverse(stiffness, grid.space, held, rough=ROUGH)
    assert inverse is not None  # it may be rough
    known = {name: loads[name] for name in ("gravity_vector", "traction")}
    moved = cubic_surplus(result, supports, inverse.solve, **known)
    node = int(np.linalg.norm(result.displacement, axis=1).argmax())
    change = abs(float(np.linalg.norm(result.displacement[node] + moved[node])) - largest)
    return DiscretisationError(STILL_TO_COME * change / largest if largest else 0.0, CUBIC)


# Error of a quadratic answer: what cubic elements would add to it, by a few steps of CG.
#
# The unknowns of the cubic elements are eliminated to those that quadratic ones lack, the surplus:
# at every step of CG for these the quadratic ones follow, through the inverse of their stiffness.

# The steps end where one wins less than this fraction of all energy that was won; flat cells and nu
# near .5 would creep on for long.
GAIN, MOST_STEPS = 0.02, 20
# True error of a displacement over what cubic elements win of it, which are off themselves: by
# (2/3)^4 of the whole where the answer is smooth, by half where a sharp corner rules. .76 to 2.6 on
# 79 problems with refined references, 1.45 in the median.
STILL_TO_COME = 1.45
PART = 1024  # tets that are worked on together, so that their arrays stay in the cache


@lru_cache(maxsize=1)
def _slopes() -> Float[np.ndarray, "functions 10 4"]:
    """Derivatives by barycentric coordinates of 10 quadratic functions and 10 of the surplus.

    The surplus is Li Lj (Li - Lj) of every edge and Li Lj Lk of every face: zero at all nodes. As
    quadratic polynomials in a basis that is orthonormal over a tet of volume one: a product of two
    gradients is integrated exactly by summing over the ten numbers.
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
    rule = duffy_rule()
    N = shape_functions(2, rule.points)
    products = np.einsum("q,qi,qj->ij", rule.weights, N, N)  # of degree 4, where the rule is exact
    return np.einsum("ki,akm->aim", np.linalg.cholesky(products), out)


class _CubicElements:
    """Stiffness of cubic elements on the mesh of ``result``, applied tet by tet.

    Functions are numbered as the nodes of the quadratic space, then an edge's, then a face's.
    """

    def __init__(self, result: StaticResult) -> None:
        mesh, space = result.mesh, result.space
        tets, self.nodes, self.material = mesh.tets, len(space.nodes), material_of(mesh)
        corners = np.sort(tets[:, FACES].reshape(-1, 3), axis=1)
        order, same = equal_faces(corners)
        first = np.concatenate([[True], ~same])
        face = np.empty(len(corners), dtype=np.int64)
        face[order] = np.cumsum(first) - 1
        self.faces = corners[order[first]]
        self.first_face = self.nodes + len(space.edges)
        self.count = self.first_face + len(self.faces)
        edge = space.elements[:, 4:] - space.points + self.nodes
        ids = [space.elements, edge, self.first_face + face.reshape(-1, 4)]
        self.numbers = np.concatenate(ids, axis=1)
        self.signs = np.ones((len(tets), 20, 1))
        self.signs[:, 10:16, 0] = np.where(tets[:, EDGES[:, 0]] < tets[:, EDGES[:, 1]], 1.0, -1.0)
        x = mesh.points[tets]
        inner = np.linalg.inv(x[:, 1:] - x[:, :1]).transpose(0, 2, 1)
        self.gradients = np.concatenate([-inner.sum(axis=1, keepdims=True), inner], axis=1)
        self.points, self.volumes = mesh.points, mesh.volumes

    def force(self, u: Float[np.ndarray, "functions 3"]) -> Float[np.ndarray, "functions 3"]:
        """Product of the stiffness [N/m] with the numbers ``u`` [m] of all functions."""
        D = _slopes()
        local = np.empty((len(self.numbers), 20, 3))
        for begin in range(0, len(local), PART):
            part = slice(begin, begin + PART)
            g, own = self.gradients[part], u[self.numbers[part]] * self.signs[part]
            along = (own.swapaxes(1, 2).reshape(-1, 20) @ D.reshape(20, 40)).reshape(-1, 3, 10, 4)
            H = np.matmul(along, g[:, None])  # (tets, component, number, axis)
            # Stress [Pa], in the same order
            turned = H.transpose(0, 3, 2, 1)
            if self.material.tensor is not None:
                strain = mandel_vector(((H + turned) / 2).swapaxes(1, 2))
                vectors = np.einsum("tij,tnj->tni", self.material.tensor[part], strain)
                stress = mandel_tensor(vectors).swapaxes(1, 2)
            else:
                lam, mu = (m[part, None, None, None] for m in self.material.lame)
                stress = mu * (H + turned)
                trace = lam[..., 0] * np.trace(H, axis1=1, axis2=3)[:, None]
                for axis in range(3):
                    stress[:, axis, :, axis] += trace[:, 0]
            stress = self.volumes[part, None, None, None] * stress
            pulled = np.matmul(stress, g[:, None].swapaxes(-1, -2)).reshape(-1, 40)
            back = (pulled @ D.reshape(20, 40).T).reshape(-1, 3, 20).swapaxes(1, 2)
            local[part] = back * self.signs[part]
        ids = self.numbers.ravel()
        each = (np.bincount(ids, local[..., axis].ravel(), self.count) for axis in range(3))
        return np.stack([*each], axis=1)

    def surplus_blocks(self) -> Float[np.ndarray, "surplus 3 3"]:
        """Diagonal blocks [N/m] of the surplus functions, without the grain."""
        D = _slopes()[10:]
        products = np.einsum("akm,akn->amn", D, D)
        lam, mu = (m[:, None, None, None] for m in self.material.lame)
        g = self.gradients[:, None]
        G = np.matmul(g.swapaxes(-1, -2), np.matmul(products, g))
        G *= self.volumes[:, None, None, None]
        block = (lam + mu) * G
        trace = mu[..., 0, 0] * np.trace(G, axis1=2, axis2=3)
        for axis in range(3):
            block[..., axis, axis] += trace
        ids, count = self.numbers[:, 10:].ravel() - self.nodes, self.count - self.nodes
        each = (np.bincount(ids, b, count) for b in block.reshape(-1, 9).T)
        return np.stack([*each], axis=1).reshape(-1, 3, 3)

    def load(
        self, gravity_vector: np.ndarray, tractions: Sequence[Traction]
    ) -> Float[np.ndarray, "functions 3"]:
        """Forces [N] on the surplus functions, on those of faces alone: an edge's have no mean."""
        weight = np.zeros(self.count)
        mass = np.repeat(self.material.rho * self.volumes / 120, 4)
        weight += np.bincount(self.numbers[:, 16:].ravel(), mass, self.count)
        total = weight[:, None] * np.asarray(gravity_vector, dtype=float)
        size = int(self.faces.max()) + 1
        keys = [np.sort(f, axis=1).astype(np.int64) @ [size**2, size, 1] for f in
                (self.faces, *(one.faces for one in tractions))]  # fmt: skip
        for one, key in zip(tractions, keys[1:], strict=True):
            area = face_areas(self.points, one.faces)[:, None]
            at = self.first_face + np.searchsorted(keys[0], key)
            np.add.at(total, at, np.broadcast_to(one.value, one.faces.shape) * area / 60)
        return total


@single_threaded
def cubic_surplus(
    result: StaticResult,
    supports: Supports,
    inverse: Callable[[np.ndarray], np.ndarray],
    *,
    gravity_vector: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
    traction: Sequence[Traction] = (),
) -> Float[np.ndarray, "nodes 3"]:
    """How cubic elements would move the nodes [m] beyond the quadratic linear ``result``.

    ``supports`` and loads are those of the result; forces at nodes do no work on the surplus.
    ``inverse`` solves with the stiffness of the quadratic elements, 0 where they are held.
    """
    cubic = _CubicElements(result)
    n, held = cubic.nodes, node_supports(supports, result.space).fixed
    edges = held[result.space.edges].all(axis=1)
    fixed = np.concatenate([edges, held[cubic.faces].all(axis=1)])
    blocks = cubic.surplus_blocks()
    stopped, axes = np.nonzero(fixed)
    blocks[stopped, axes] = blocks[stopped, :, axes] = 0
    blocks[stopped, axes, axes] = 1
    precondition = np.linalg.inv(blocks)
    whole = np.zeros((cubic.count, 3))

    def force(quadratic: np.ndarray | float, surplus: np.ndarray | float) -> np.ndarray:
        whole[:n], whole[n:] = quadratic, surplus
        return cubic.force(whole)

    rest = cubic.load(np.asarray(gravity_vector), traction)[n:]
    rest = np.where(fixed, 0.0, rest - force(result.node_displacement, 0.0)[n:])
    moved, won = np.zeros((n, 3)), 0.0
    along, size = np.zeros_like(rest), 1.0
    for _ in range(MOST_STEPS):
        z = np.einsum("nij,nj->ni", precondition, rest)
        size, before = float((rest * z).sum()), size
        if not size > 0:
            break
        along = z + (size / before) * along
        follows = -inverse(np.where(held, 0.0, force(0.0, along)[:n]))
        pull = np.where(fixed, 0.0, force(follows, along)[n:])
        step = size / float((along * pull).sum())
        moved += step * follows
        rest = rest - step * pull
        won += step * size
        if step * size < GAIN * won:
            break
    return moved
