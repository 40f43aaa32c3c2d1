"""Cells and weights that stand for all tets: non-negative least squares on forces.

After An, Kim & James (2008): of snapshots of the body, every tet makes a force on the coordinates;
few tets, with weights that are not negative, shall make the same sum. The snapshots are the
stiffness about rest, coordinate by coordinate, and states of equilibrium at a few amplitudes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ..errors import ConvergenceError
from .elasticity import ReducedElasticity
from .model import ReducedModel
from .rest import reduced_rest, solve_dense

# Largest displacement of a state, in shares of the body's longest side.
AMPLITUDES = (0.01, 0.15)
STATES = 12
# Lowest vibrations whose combinations load the states.
LOADED = 8
# The stiffness about rest counts as much as so many states.
LINEAR_SHARE = 8.0
# Cells that states are found with, and that weights are sought for: a draw where there are more.
DRAWN, CANDIDATES = 1500, 6000
# Unbalanced force of a state, over its load.
TOLERANCE = 1e-2
# Squares of frequencies below this share of the largest are rigid motions.
RIGID = 1e-9
# Cells that join before weights are found again: the most needed of those left, at least so many,
# or so many of a cell there is.
JOINING, GROWTH = 8, 0.05


class Cubature(NamedTuple):
    """Candidates ``cells`` (n,), a ``factor`` (n,) [1] to the volume of each, and what it misses.

    ``residual`` is that of the forces of the snapshots, as a share.
    """

    cells: Int[np.ndarray, "n"]
    factor: Float[np.ndarray, "n"]
    residual: float


class Training(NamedTuple):
    """Forces in the snapshots: ``parts`` (rows, candidates) of cells, ``whole`` (rows,) of all.

    ``cells`` (candidates,) says which cells may be taken.
    """

    parts: Float[np.ndarray, "rows candidates"]
    whole: Float[np.ndarray, "rows"]
    cells: Int[np.ndarray, "candidates"]


def training(
    elasticity: ReducedElasticity, load: Float[np.ndarray, "dofs"], *, size: float, seed: int = 0
) -> Training:
    """Forces of the cells of a model with all of them; ``size`` [m] is the body's longest side.

    ``load`` are the forces on the coordinates [N/sqrt(kg)] that will act, of weight and others:
    every other state is loaded by them, scaled either way.
    """
    square, modes = np.linalg.eigh(elasticity.tangent(np.zeros(elasticity.model.dofs)))
    elastic = square > RIGID * square[-1]
    square, modes = square[elastic], modes[:, elastic]
    turn = (modes / np.sqrt(square)).T  # the norm of a force is what it moves the body by
    count = len(elasticity.model.cells)
    taken = np.sort(np.random.default_rng(seed).permutation(count)[:CANDIDATES])
    slopes = elasticity.model.gradients[taken].reshape(len(taken), 9, -1)

    def forces(q: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Components of the candidates' forces, and last of that of all cells."""
        stress = elasticity.stress(q)
        each = np.einsum("tk,tka->at", stress[taken].reshape(-1, 9), slopes)
        whole = elasticity.gradients.pull(stress)
        return rows @ np.concatenate([each, whole[:, None]], axis=1)

    blocks = []
    for k in range(min(LOADED, len(square))):
        step = 1e-7 / np.abs(elasticity.gradients.of(turn[k])).max()
        linear = forces(step * turn[k], turn[k:]) / step
        blocks.append(np.sqrt(LINEAR_SHARE / LOADED) * linear)
    few = ReducedElasticity(_drawn(elasticity.model, seed), elasticity.law)
    for q in _states(few, square, modes, load, size, seed):
        bent = forces(q, turn)
        blocks.append(bent / np.linalg.norm(bent[:, -1]))
    found = np.concatenate(blocks)
    return Training(found[:, :-1], found[:, -1], taken)


def _drawn(model: ReducedModel, seed: int) -> ReducedModel:
    """The model on some of its cells, drawn by volume: states that are near to rest are enough."""
    if len(model.cells) <= DRAWN:
        return model
    share = model.weights / model.weights.sum()
    cells = np.random.default_rng(seed).choice(len(share), DRAWN, p=share)
    return model.on_cells(cells, np.full(DRAWN, model.weights.sum() / DRAWN))


def _states(elasticity, square, modes, load, size, seed):
    """States of equilibrium under loads that bend the body between the ``AMPLITUDES``."""
    rng = np.random.default_rng(seed)
    inverse, taken = modes / square @ modes.T, range(min(LOADED, len(square)))
    basis = elasticity.model.basis
    for number in range(STATES):
        mixed = rng.normal(size=len(taken)) * np.sqrt(square[0] * square[taken])
        push = modes[:, taken] @ mixed if number % 2 or not load.any() else load
        linear = inverse @ push
        largest = np.linalg.norm(basis @ linear, axis=1).max()
        amplitude = size * np.exp(rng.uniform(*np.log(AMPLITUDES))) / largest
        sign = -1.0 if number % 4 == 2 else 1.0
        try:
            yield reduced_rest(elasticity, sign * amplitude * push, tolerance=TOLERANCE).u
        except ConvergenceError:  # it snaps through: the linear state, as far as it goes
            yield 0.1 * sign * amplitude * linear


def select_cells(
    given: Training, limit: int, *, tolerance: float = 0.0, start: Cubature | None = None
) -> Cubature:
    """At most ``limit`` cells whose weighted forces come within ``tolerance`` of the whole.

    Greedy: the cells that point most along what is missed join, weights are found anew, those that
    become zero leave. ``start`` goes on from what was selected before.
    """
    A, y, _ = given
    size = np.linalg.norm(A, axis=0)
    usable, whole = size > 1e-12 * size.max(), float(np.linalg.norm(y))
    chosen = np.zeros(0, dtype=int) if start is None else start.cells
    factor = np.zeros(0) if start is None else start.factor
    missing = y - A[:, chosen] @ factor
    while len(chosen) < limit and np.linalg.norm(missing) > tolerance * whole:
        wanted = np.where(usable, A.T @ missing / np.maximum(size, 1e-300), -np.inf)
        wanted[chosen] = -np.inf
        most = min(max(JOINING, int(GROWTH * len(chosen))), limit - len(chosen))
        new = np.argpartition(-wanted, most - 1)[:most]
        new = new[wanted[new] > 0]
        if not new.size:
            break
        grown = np.concatenate([chosen, new])
        columns = A[:, grown]
        first = np.concatenate([factor, np.zeros(len(new))])
        weights = nonnegative_weights(columns.T @ columns, columns.T @ y, first)
        kept = weights > 0
        if np.array_equal(grown[kept], chosen):
            usable[new] = False  # they point along what is missed, but by round-off
            continue
        chosen, factor = grown[kept], weights[kept]
        missing = y - columns[:, kept] @ factor
    return Cubature(chosen, factor, float(np.linalg.norm(missing)) / whole)


def nonnegative_weights(
    gram: Float[np.ndarray, "n n"], right: Float[np.ndarray, "n"], start: Float[np.ndarray, "n"]
) -> Float[np.ndarray, "n"]:
    """Minimise x . G x / 2 - b . x over x >= 0, from ``start``, by Lawson & Hanson's active set.

    On the normal equations (Bro & de Jong 1997): from the answer of a smaller set it takes a few
    small Cholesky solves.
    """
    x, passive = start.copy(), start > 0
    ridge = 1e-13 * np.diag(gram).max()
    enough = 1e-10 * np.abs(right).max()
    for _ in range(3 * len(right) + 10):
        slope = np.where(passive, -np.inf, right - gram @ x)
        if passive.any() or not slope.max() <= enough:
            if slope.max() > enough:
                passive[np.argmax(slope)] = True
        if not passive.any():
            return x
        while True:
            ids = np.flatnonzero(passive)
            inner = gram[np.ix_(ids, ids)] + ridge * np.eye(len(ids))
            found = solve_dense(inner, right[ids])
            if (found > 0).all():
                break
            low = found <= 0
            share = (x[ids[low]] / (x[ids[low]] - found[low])).min()
            x[ids] += share * (found - x[ids])
            out = ids[low & (x[ids] <= 1e-14 * max(x.max(), 1e-300))]
            passive[out if out.size else ids[low][:1]] = False
            x[~passive] = 0.0
        x = np.zeros_like(x)
        x[ids] = found
        slope = np.where(passive, -np.inf, right - gram @ x)
        if slope.max() <= enough:
            return x
    return x
