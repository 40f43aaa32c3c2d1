"""A table of what-if runs: E of every part and the load, a row a run, answered by a reduced model.

Columns are names of parts (a factor to their E), ``load`` (one to all that acts) and ``gx``,
``gy``, ``gz`` [m/s^2] (gravity instead of the scenario's); what a table does not name stays.
"""

from __future__ import annotations

import csv
import time
from pathlib import Path

import numpy as np

from ...fem.discrete.space import LARGEST_MOVING, affordable_order
from ...fem.errors import InputError
from ...fem.reduced.following import stated_forces
from ...fem.reduced.model import ReducedModel
from ...fem.reduced.what_if import what_if, what_if_error
from ...fem.scene.scene import Scene
from ..results.reduction import WhatIfTable

LOAD, GRAVITY = "load", ("gx", "gy", "gz")


def answer_table(path: Path, model: ReducedModel, scene: Scene) -> WhatIfTable:
    """Answer every row of the table at ``path`` by ``model``, and some by the full body.

    Raises
    ------
    InputError
        Where the table is empty, names what is no part, or holds what is no number.
    """
    header, rows = _read(path, model.region_names)
    columns = dict(zip(header, rows.T, strict=True))
    runs, ones = len(rows), np.ones(len(rows))
    scales = np.stack([columns.get(part, ones) for part in model.region_names], axis=1)
    usual = np.asarray(scene.gravity_vector, dtype=float)
    pairs = zip(GRAVITY, usual, strict=True)
    gravity = np.stack([columns.get(name, g * ones) for name, g in pairs], axis=1)
    share, dead = columns.get(LOAD, ones), stated_forces(scene, model.order)

    def forces(run: int) -> np.ndarray:
        return share[run] * (model.mass[:, None] * gravity[run] + dead)

    weights = np.stack([model.weight(axis) for axis in np.eye(3)])
    loads = share[:, None] * (gravity @ weights + model.pull_back(dead))
    started = time.perf_counter()
    found = what_if(model, scales=scales, loads=loads)
    seconds = time.perf_counter() - started
    error = what_if_error(
        model,
        found,
        scene.mesh,
        scene.held,
        scales=scales,
        forces=forces,
        count=min(4, runs),
        order=affordable_order(scene.mesh, LARGEST_MOVING),
    )
    return WhatIfTable(header, rows, found, error, seconds)


def _read(path: Path, parts: tuple[str, ...]) -> tuple[tuple[str, ...], np.ndarray]:
    try:
        with path.open(newline="") as file:
            header, *lines = [row for row in csv.reader(file) if row]
        rows = np.array(lines, dtype=float).reshape(len(lines), len(header))
    except (OSError, ValueError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: wanted a table of numbers with a header: {error}") from error
    header = tuple(name.strip() for name in header)
    unknown = [name for name in header if name not in (*parts, LOAD, *GRAVITY)]
    if unknown or len(set(header)) < len(header):
        known = ", ".join((*parts, LOAD, *GRAVITY))
        wrong = ", ".join(unknown or header)
        raise InputError(f"{path}: columns {wrong}: wanted each once of {known}")
    if not len(rows) or not np.isfinite(rows).all():
        raise InputError(f"{path}: wanted a row of finite numbers for every run")
    return header, rows
