"""Cells and weights that stand for all tets: non-negative least squares on forces.

After An, Kim & James (2008): of snapshots of the body, every tet makes a force on the coordinates;
few tets, with weights that are not negative, shall make the same sum. The snapshots are the
stiffness about rest, coordinate by coordinate, and states of equilibrium at a few amplitudes.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ..errors import ConvergenceError
from .elasticity import (
    RIGID,
    KeptInverse,
    ReducedElasticity,
    held_rest,
    lowest_frequency,
    reduced_rest,
    solve_dense,
)
from .model import ReducedModel

# Largest displacement of a state, over the body's longest side.
AMPLITUDES = (0.01, 0.15)
STATES = 12
# Lowest vibrations whose combinations load the states.
LOADED = 8
# The stiffness about rest counts as much as so many states.
LINEAR_WEIGHT = 8.0
# And the rest under the load, about which the body moves: its sag is what cells are accepted by.
REST_WEIGHT = 100.0
# Cells that states are found with, and that weights are sought for: a draw where there are more.
DRAWN, CANDIDATES = 1500, 6000
# Unbalanced force of a state, over its load.
TOLERANCE = 1e-2
# Cells that are tried, until frequency and sag agree with all tets to this fraction, and forces do.
CELLS = (60, 90, 120, 180, 250, 320, 400)
ACCEPTED, RESIDUAL = 3e-3, 1e-3
# Cells that join before weights are found again: the most needed of those left, at least so many,
# or so many of a cell there is.
JOINING, GROWTH = 8, 0.05


class Cubature(NamedTuple):
    """Candidates ``cells`` (n,), a ``factor`` (n,) [1] to the volume of each, and what it misses.

    ``residual`` is that of the forces of the snapshots, over their size.
    """

    cells: Int[np.ndarray, "n"]
    factor: Float[np.ndarray, "n"]
    residual: float


def with_cells(
    whole: ReducedModel, load: Float[np.ndarray, "dofs"], most: int, *, seed: int = 0
) -> ReducedModel:
    """Model of at most ``most`` cells (0: all), as few as keep frequency and sag to ``ACCEPTED``.

    The sag is that under ``load``, forces on the coordinates [N/sqrt(kg)]; the forces of the
    snapshots are within ``RESIDUAL``. Where no count is enough, the one with the most cells is
    returned; its ``accuracy`` tells.
    """
    if not most:
        return whole
    elasticity = ReducedElasticity(whole)
    stiffness = elasticity.tangent(np.zeros(whole.dofs))
    few, kept = ReducedElasticity(drawn_cells(whole, seed)), KeptInverse()
    start = held_rest(few, load)
    if start is not None:
        kept.renew(few.tangent(start))
    rest = held_rest(elasticity, load, start=start, kept=None if start is None else kept)
    frequency = lowest_frequency(stiffness)
    A, y, candidates = snapshot_forces(
        elasticity, few, load, stiffness=stiffness, rest=rest, seed=seed
    )
    cubature: Cubature | None = None
    model = whole
    for count in [n for n in CELLS if n < most] + [most]:
        if count >= len(whole.cells):
            break
        cubature = select_cells(A, y, count, start=cubature)
        if cubature.residual > RESIDUAL and count < most:
            continue
        cells = candidates[cubature.cells]
        model = whole.on_cells(cells, cubature.factor * whole.weights[cells])
        # Frequency and sag against those of all cells
        summed = ReducedElasticity(model)
        ratio = lowest_frequency(summed.tangent(np.zeros(model.dofs))) / frequency
        sag = np.nan
        if rest is not None:
            q = held_rest(summed, load, start=rest)
            size = float(np.linalg.norm(rest))
            sag = np.inf if q is None else float(np.linalg.norm(q - rest)) / size
        accuracy = whole.accuracy._replace(
            frequency=whole.accuracy.frequency * ratio, cell_frequency=ratio, cell_sag=sag
        )
        model = replace(model, accuracy=accuracy)
        if accuracy.cell_error <= ACCEPTED:
            return model
    return whole if cubature is None else model


def snapshot_forces(
    elasticity: ReducedElasticity,
    few: ReducedElasticity,
    load: Float[np.ndarray, "dofs"],
    *,
    stiffness: Float[np.ndarray, "dofs dofs"],
    rest: Float[np.ndarray, "dofs"] | None = None,
    seed: int = 0,
) -> tuple[Float[np.ndarray, "rows n"], Float[np.ndarray, "rows"], Int[np.ndarray, "n"]]:
    """Forces of candidate cells in snapshots, of all cells together, and which are candidates.

    The states are those that ``few`` cells are at rest in; ``stiffness`` [1/s^2] is that about
    zero, ``rest`` the state under ``load``: the forces on the coordinates [N/sqrt(kg)] that will
    act, of weight and others. Every other state is loaded by them, scaled either way.
    """
    square, modes = np.linalg.eigh(stiffness)
    elastic = square > RIGID * square[-1]
    square, modes = square[elastic], modes[:, elastic]
    turn = (modes / np.sqrt(square)).T  # the norm of a force is what it moves the body by
    count = len(elasticity.model.cells)
    candidates = np.sort(np.random.default_rng(seed).permutation(count)[:CANDIDATES])
    slopes = elasticity.model.gradients[candidates].reshape(len(candidates), 9, -1)

    def forces(q: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Components of the candidates' forces, and last of that of all cells."""
        stress = elasticity.stress(q)
        each = np.einsum("tk,tka->at", stress[candidates].reshape(-1, 9), slopes)
        whole = elasticity.gradients.pull(stress)
        return rows @ np.concatenate([each, whole[:, None]], axis=1)

    blocks = []
    for k in range(min(LOADED, len(square))):
        step = 1e-7 / np.abs(elasticity.gradients.of(turn[k])).max()
        linear = forces(step * turn[k], turn[k:]) / step
        blocks.append(np.sqrt(LINEAR_WEIGHT / LOADED) * linear)
    # States of equilibrium under loads that bend the body between the amplitudes
    states = [] if rest is None else [(rest, REST_WEIGHT)]
    rng, model, taken = np.random.default_rng(seed), few.model, range(min(LOADED, len(square)))
    size = float(np.ptp(model.points[model.mass > 0], axis=0).max())
    inverse = modes / square @ modes.T
    for number in range(STATES):
        mixed = rng.normal(size=len(taken)) * np.sqrt(square[0] * square[taken])
        push = modes[:, taken] @ mixed if number % 2 or not load.any() else load
        linear = inverse @ push
        largest = np.linalg.norm(model.basis @ linear, axis=1).max()
        amplitude = size * np.exp(rng.uniform(*np.log(AMPLITUDES))) / largest
        sign = -1.0 if number % 4 == 2 else 1.0
        try:
            q = reduced_rest(few, sign * amplitude * push, tolerance=TOLERANCE).u
        except ConvergenceError:  # it snaps through: the linear state, as far as it goes
            q = 0.1 * sign * amplitude * linear
        states.append((q, 1.0))
    for q, weight in states:
        bent = forces(q, turn)
        blocks.append(np.sqrt(weight) / np.linalg.norm(bent[:, -1]) * bent)
    rows = np.concatenate(blocks)
    return rows[:, :-1], rows[:, -1], candidates


def drawn_cells(model: ReducedModel, seed: int = 0) -> ReducedModel:
    """The model on some of its cells, drawn by volume: states that are near to rest are enough."""
    if len(model.cells) <= DRAWN:
        return model
    odds = model.weights / model.weights.sum()
    cells = np.random.default_rng(seed).choice(len(odds), DRAWN, p=odds)
    return model.on_cells(cells, np.full(DRAWN, model.weights.sum() / DRAWN))


def select_cells(
    A: Float[np.ndarray, "rows n"],
    y: Float[np.ndarray, "rows"],
    limit: int,
    *,
    start: Cubature | None = None,
) -> Cubature:
    """At most ``limit`` columns of ``A`` whose weighted sum comes near to ``y``.

    Greedy: the cells that point most along what is missed join, weights are found anew, those that
    become zero leave. ``start`` goes on from what was selected before.
    """
    size = np.linalg.norm(A, axis=0)
    usable, whole = size > 1e-12 * size.max(), float(np.linalg.norm(y))
    chosen = np.zeros(0, dtype=int) if start is None else start.cells
    factor = np.zeros(0) if start is None else start.factor
    gram = A[:, chosen].T @ A[:, chosen]
    missing = y - A[:, chosen] @ factor
    while len(chosen) < limit and missing.any():
        along = np.where(usable, missing @ A / np.maximum(size, 1e-300), -np.inf)
        along[chosen] = -np.inf
        most = min(max(JOINING, int(GROWTH * len(chosen))), limit - len(chosen))
        new = np.argpartition(-along, most - 1)[:most]
        new = new[along[new] > 0]
        if not new.size:
            break
        grown = np.concatenate([chosen, new])
        columns, joined = A[:, grown], A[:, new]
        beside = joined.T @ columns
        gram = np.block([[gram, beside[:, : len(chosen)].T], [beside]])
        first = np.concatenate([factor, np.zeros(len(new))])
        weights = nonnegative_weights(gram, columns.T @ y, first)
        kept = weights > 0
        gram = gram[np.ix_(kept, kept)]
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

    On the normal equations (Bro & de Jong 1997). All are free at first, so that from the answer of
    a smaller set it takes a few small Cholesky solves.
    """
    x, passive = start.copy(), np.ones(len(start), dtype=bool)
    ridge = 1e-13 * np.diag(gram).max()
    enough = 1e-10 * np.abs(right).max()
    for _ in range(3 * len(right) + 10):
        while passive.any():
            ids = np.flatnonzero(passive)
            inner = gram[np.ix_(ids, ids)]
            inner.flat[:: len(ids) + 1] += ridge
            solved = solve_dense(inner, right[ids])
            low = solved <= 0
            if not low.any():
                x[ids] = solved
                break
            alpha = (x[ids[low]] / (x[ids[low]] - solved[low])).min()
            x[ids] += alpha * (solved - x[ids])
            out = ids[low & (x[ids] <= 1e-14 * max(x.max(), 1e-300))]
            passive[out if out.size else ids[low][:1]] = False
            x[~passive] = 0.0
        slope = np.where(passive, -np.inf, right - gram @ x)
        if slope.max() <= enough:
            return x
        passive[np.argmax(slope)] = True
    return x
