"""Warm calls on a GPU: static solves, implicit steps, substeps of particles, splats that they move.

    python benchmarks/gpu.py --output docs/data/gpu.json

Statics and steps are those of the bench beam (``static_case.py``), P1 but where said: assembly and
solve of the second and further calls on one mesh, as the peers count. A substep moves a cube of
jelly, eight particles a cell: by launches alone where it has no weight, with all that a user's run
has between them (looks at every particle, sorts, lists of nodes) where it falls. A film is gel that
falls on the ground, and splats in it, as time goes: substeps, looks and sorts, the splats' places
and shapes, and pictures of 512 px in the host's memory, 30 a second of motion. Shadows, harmonics
and the writing of a file are not in it. Wall time, the device waited for; medians.
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
from autophyx_tet.converters.points.film import FPS
from autophyx_tet.converters.points.table import PointTable
from autophyx_tet.fem.mpm.boundaries import Wall, grid_around
from autophyx_tet.fem.mpm.particles import Particles, block_places
from autophyx_tet.fem.mpm.solver import MpmSolver
from autophyx_tet.fem.scene.obstacles import Plane
from autophyx_tet.predictors.appearance.views import ring
from live_splats import LiveSplats
from mpm import measure
from static_case import STRENGTH_OF_GRAVITY, cantilever
from statics import ours

REPEATS = 7
STEPS, DT = 30, 0.01
SUBSTEPS = 300  # it falls a quarter of its size, within its room
SIDES = {"100,000": 46, "1,000,000": 100}  # particles along an edge of the cube
GAUSSIANS = 150_000


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
    for size, order in (("S", 2), ("2S", 1), ("M", 2), ("2M", 1), ("L", 1)):
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


def jelly(side: int, size: float, E: float) -> tuple[Particles, float]:
    """Cube of ``size`` [m] with so many particles along an edge, and the spacing of its grid."""
    dx = 2 * size / side
    x = block_places((0.0,) * 3, (size,) * 3, dx, along=2)
    return Particles.of(x, (dx / 2) ** 3, E=E, nu=0.3, rho=1000.0), dx


def substep_rows(device: str) -> Iterator[dict]:
    from autophyx_tet.fem.device import start_warp

    row = measure("yielding snow", 1_000_000, device=device)  # the slowest class
    yield {
        "what": "MPM substep, yielding snow, launches alone",
        "particles": row["particles"],
        "wall_ms": row["substep_ms"],
    }
    for side in SIDES.values():
        body, dx = jelly(side, 1.0, E=1e5)
        room, dt = grid_around([-0.3] * 3, [1.3] * 3, dx), 0.2 * dx / np.sqrt(1.4e5 / 1000)
        for pull in (0.0, STRENGTH_OF_GRAVITY):
            solver = MpmSolver(body, room, gravity_vector=(0, 0, -pull), device=device, step=dt)
            solver.advance(100 * dt)  # compiles, records
            start_warp().synchronize()
            before, start = solver.substeps, time.perf_counter()
            if pull:
                solver.advance(SUBSTEPS * dt)
            else:
                solver.substep.run(SUBSTEPS)
            start_warp().synchronize()
            count = solver.substeps - before if pull else SUBSTEPS
            between = "that falls, looks and sorts between included" if pull else "launches alone"
            yield {
                "what": f"MPM substep, jelly{', ' if not pull else ' '}{between}",
                "particles": len(body.x),
                "wall_ms": round(1e3 * (time.perf_counter() - start) / count, 3),
            }


def film_row(device: str) -> dict:
    """Gel of 20 kPa in a cube of 0.2 m, dropped from 0.1 m: it bounces, and leans on the ground."""
    body, dx = jelly(SIDES["100,000"] + 1, 0.2, E=2e4)
    body.velocity[:] = np.cross([0.0, 3.0, 1.0], body.x - 0.1)  # it tumbles
    ground = Wall(shape=Plane((0.0, 0.0, -0.1), (0.0, 0.0, 1.0)), friction=0.5)
    room = grid_around([-0.2, -0.2, -0.1], [0.4, 0.4, 0.35], dx)
    solver = MpmSolver(body, room, walls=(ground,), device=device, follows=True)
    rng = np.random.default_rng(0)
    places, turn = 0.2 * rng.random((3, GAUSSIANS)), rng.normal(size=(4, GAUSSIANS))
    columns = dict(zip("xyz", places, strict=True))
    columns |= {f"scale_{i}": rng.normal(np.log(1.5e-3), 0.4, GAUSSIANS) for i in range(3)}
    columns |= {f"rot_{i}": turn[i] / np.linalg.norm(turn, axis=0) for i in range(4)}
    columns |= {f"f_dc_{i}": np.cos(30 * places[i]) for i in range(3)}
    live = LiveSplats(PointTable({**columns, "opacity": np.full(GAUSSIANS, 2.0)}), solver)
    sees = np.array([[-0.1, -0.1, -0.1], [0.3, 0.3, 0.25]])
    camera, behind = ring(sees, count=5, up="z", pixels=512)[1], np.full((512, 512, 3), 0.95)

    def frame() -> None:
        assert solver.advance(1 / FPS), str(solver.failure)
        live.carry()
        live.picture(camera, behind)

    frame()
    before, spent = solver.substeps, []
    for _ in range(2 * FPS):
        start = time.perf_counter()
        frame()
        spent.append(time.perf_counter() - start)
    return {
        "what": f"film, {GAUSSIANS:,} splats, {(solver.substeps - before) / (2 * FPS):.0f} "
        f"substeps a frame; slowest frame {1e3 * max(spent):.0f} ms",
        "particles": len(body.x),
        "wall_ms": round(1e3 * float(np.mean(spent)), 2),
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
    device = options.device
    rows = [*static_rows(device), step_row(device), *substep_rows(device), film_row(device)]
    found = {
        "schema": 1,
        "command": "python benchmarks/gpu.py --output docs/data/gpu.json",
        "machine": machine(device),
        "rows": rows,
    }
    text = json.dumps(found, indent=1) + "\n"
    if options.output:
        options.output.write_text(text, encoding="utf-8")
    else:
        print(text)


if __name__ == "__main__":
    main()
