"""The mesher `particles`: cubes inside the solids, where no mesh of their surface can be had."""

from __future__ import annotations

import numpy as np

from ...converters.transfer import tets_of_cells
from ...predictors.grid import Grid
from ..asset.cache import Runner
from ..asset.solids import Solids
from .ftetwild import TETS_PER_CUBE, EngineTarget, Filling, LatticeFit, NoFilling
from .guarantees import separate
from .stuffing.mesher import thin_shares

TETS_PER_CELL = 6
ASKED = 8  # places of a cell, one in each of its octants, that are asked for their part
MOST_CELLS = 500_000  # of the box: some seconds of questions


def filled(solids: Solids, target: EngineTarget, runner: Runner) -> Filling:
    """Fill ``solids`` [m] with cubes of a grid, six tets in each.

    Nothing is cut, so that nothing can fail; the surface is one of steps. A part gets as many
    cubes as its volume, those that it fills most: what is thinner than a cube keeps its volume and
    may come apart. ``runner`` only hears of it. ``NoFilling`` where no part is as large as a cube.
    """
    if runner.progress is not None:
        runner.progress("particles", 0.0)
    total, box = sum(shell.volume for shell in solids.shells), np.ptp(solids.bounds, axis=0)
    size = target.lattice_edge(total)
    if not target.edge_is_given:
        size *= (TETS_PER_CELL / TETS_PER_CUBE) ** (1 / 3)
    size = max(size, float(np.prod(box) / MOST_CELLS) ** (1 / 3))
    grid = Grid.around(solids.bounds, cells=int(np.ceil(box.max() / size)))
    rng = np.random.default_rng(0)
    cells = rng.permutation(np.argwhere(np.ones(grid.shape, dtype=bool)))  # of equals any
    octants = (np.array(list(np.ndindex(2, 2, 2))) + rng.random((len(cells), ASKED, 3))) / 2 - 0.5
    asked = solids.label(grid.to_world(cells[:, None] + octants).reshape(-1, 3)).reshape(-1, ASKED)
    parts, counts = np.unique(asked[asked >= 0], return_counts=True)
    part = np.full(len(cells), -1)
    for one in parts[np.argsort(counts, kind="stable")]:  # the smallest choose first
        held = np.where(part < 0, (asked == one).sum(axis=1), 0)
        most = np.argsort(-held, kind="stable")[: round((asked == one).sum() / ASKED)]
        part[most[held[most] > 0]] = one
    if not (part >= 0).any():
        raise NoFilling(f"no part is as large as a cube of {grid.h:.3g} m")
    cells, part = cells[part >= 0], part[part >= 0]
    mesh = separate(*tets_of_cells(grid, cells))
    rel = grid.h / target.diagonal
    used = EngineTarget(target.diagonal, rel, rel, tets=len(mesh.tets))
    fit = LatticeFit({}, thin_shares(solids, grid.h), {}, {})
    return Filling(mesh, part[mesh.origin // TETS_PER_CELL], used, lattice=fit)
