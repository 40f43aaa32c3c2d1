"""Warm calls on a GPU: static solves, implicit steps, substeps of the material point method.

    python benchmarks/gpu.py --output docs/data/gpu.json

Statics and steps are those of the bench beam (``static_case.py``), P1 but where said: assembly and
solve of the second and further calls on one mesh, as the peers count. A substep moves a cube of
jelly, eight particles a cell, that falls. Wall time, the device waited for; medians.
"""

from __future__ import annotations

import argparse
import json
import platform
import statistics
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from mpm import measure
from static_case import STRENGTH_OF_GRAVITY, cantilever
from statics import ours

REPEATS = 7
STEPS, DT = 30, 0.01
SUBSTEPS = 300  # it falls a quarter of its size, within its room
SIDES = {"100,000": 46, "1,000,000": 100}  # particles along an edge of the cube


def median_ms(call: Callable[[], object]) -> float:
    from autophyx_tet.fem.device import start_warp

    wp, spent = start_warp(), []
    for _ in range(REPEATS + 2):
        wp.synchronize()
        start = time.perf_counter()
        call()
        wp.synchronize()
        spent.append(time.perf_counter() - start)
    return 1e3 * statistics.median(spent[2:])  # the first calls compile, and record


def static_rows(device: str) -> Iterator[dict]:
    for size, order in (("S", 1), ("S", 2), ("M", 1), ("L", 1)):
        case = cantilever(size)
        last: dict = {}
        wall = median_ms(lambda case=case, order=order, last=last: last.update(
            ours(case, order, device)))  # fmt: skip
        yield {
            "what": f"static solve, {'linear' if order == 1 else 'quadratic'}",
            "tets": last["tets"],
            "unknowns": last["dof"],
            "iterations": last["iterations"],
            "wall_ms": round(wall, 2),
        }


def step_row(device: str) -> dict:
    from autophyx_tet.fem.device import start_warp
    from autophyx_tet.fem.scene.supports import Supports
    from autophyx_tet.fem.solve.dynamics import Dynamics

    case = cantilever("L")
    held = Supports.clamp(len(case.mesh.points), case.held)
    options = {"order": 1, "device": device, "self_contact": False}  # a beam cannot meet itself
    body = Dynamics(case.mesh, supports=held, gravity_vector=case.gravity, **options)
    body.step(DT)
    start = time.perf_counter()
    for _ in range(STEPS):
        body.step(DT)
    start_warp().synchronize()
    wall = 1e3 * (time.perf_counter() - start) / STEPS
    what = f"implicit step of {DT:g} s, mean of {STEPS}"
    size = len(case.mesh.tets)
    return {
        "what": what,
        "tets": size,
        "unknowns": 3 * len(case.mesh.points),
        "wall_ms": round(wall, 2),
    }


def substep_rows(device: str) -> Iterator[dict]:
    from autophyx_tet.fem.device import start_warp
    from autophyx_tet.fem.mpm.boundaries import grid_around
    from autophyx_tet.fem.mpm.particles import Particles, block_places
    from autophyx_tet.fem.mpm.solver import MpmSolver

    for name in ("jelly", "yielding snow"):  # the fastest class and the slowest
        row = measure(name, 1_000_000, device=device)
        yield {
            "what": f"MPM substep, {name}, launches alone",
            "particles": row["particles"],
            "wall_ms": row["substep_ms"],
        }
    for side in SIDES.values():
        dx = 2.0 / side
        x = block_places((0.0,) * 3, (1.0,) * 3, dx, along=2)
        body = Particles.of(x, (dx / 2) ** 3, E=1e5, nu=0.3, rho=1000.0)
        room = grid_around([-0.3] * 3, [1.3] * 3, dx)
        dt = 0.2 * dx / np.sqrt(1.4e5 / 1000)
        solver = MpmSolver(
            body, room, gravity_vector=(0, 0, -STRENGTH_OF_GRAVITY), device=device, step=dt
        )
        solver.advance(100 * dt)  # compiles, records
        before, start = solver.substeps, time.perf_counter()
        solver.advance(SUBSTEPS * dt)
        start_warp().synchronize()
        wall = 1e3 * (time.perf_counter() - start) / (solver.substeps - before)
        yield {
            "what": "MPM substep, jelly that falls, looks and sorts between included",
            "particles": len(x),
            "wall_ms": round(wall, 3),
        }


def machine(device: str) -> dict:
    from autophyx_tet.fem.device import start_warp

    wp = start_warp()
    return {
        "device": wp.get_device(device).name,
        "warp": wp.config.version,
        "python": platform.python_version(),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device", default="cuda")
    parser.add_argument("--output", type=Path, help="by default, standard output")
    options = parser.parse_args()
    rows = [*static_rows(options.device), step_row(options.device), *substep_rows(options.device)]
    found = {
        "schema": 1,
        "command": "python benchmarks/gpu.py --output docs/data/gpu.json",
        "machine": machine(options.device),
        "rows": rows,
    }
    text = json.dumps(found, indent=1) + "\n"
    if options.output:
        options.output.write_text(text, encoding="utf-8")
    else:
        print(text)


if __name__ == "__main__":
    main()
