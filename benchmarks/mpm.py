"""CPU time of a substep of the material point method, by class, size, threads and device.

    python benchmarks/mpm.py --json
    python benchmarks/mpm.py --device cuda --particles 1000000
    python benchmarks/mpm.py --peers fem total updated newton jelly taichi

A block of particles with small random velocities on a 64^3 grid, or larger where it does not fit,
8 a cell at random places, sorted; the best of some rounds of 20 substeps, in ns of CPU time of the
first thread a particle and substep, ``wall_ns`` beside it (on a GPU only that). With two threads
the first takes half of the work: its time says what two free cores would give on a busy machine.
``--peers`` are those of ``mpm_peers.py``, in the same run and as JSON.
Yielding snow is squeezed past its clamps first: eigenvectors are in its figure.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from typing import Any

import numpy as np
from autophyx_tet.fem.mpm.boundaries import BackgroundGrid
from autophyx_tet.fem.mpm.materials import MaterialClass, Substance
from autophyx_tet.fem.mpm.particles import Particles
from autophyx_tet.fem.mpm.solver import MpmSolver
from mpm_peers import PEERS

SUBSTANCES = {
    "jelly": Substance(),
    "metal": Substance(kind=MaterialClass.METAL, yield_stress=1e3),
    "sand": Substance(kind=MaterialClass.SAND, friction=0.3),
    "visplas": Substance(kind=MaterialClass.VISPLAS, yield_stress=100.0, viscosity=10.0),
    "fluid": Substance(kind=MaterialClass.FLUID, bulk=1e5),
    "snow": Substance(kind=MaterialClass.SNOW),
    "yielding snow": Substance(kind=MaterialClass.SNOW),
}
# Wanted at most, ns a particle and substep on one quiet core.
HENCKY = {"metal": 230, "sand": 230, "visplas": 230}
WANTED = {"jelly": 160, **HENCKY, "snow": 450, "yielding snow": 450}
STEPS = 20


def block(count: int, substance: Substance, *, speed: float) -> tuple[Particles, BackgroundGrid]:
    """About ``count`` particles, 8 a cell, amid a grid; squeezed at ``speed`` [1/s]."""
    side = round((count / 8) ** (1 / 3))
    nodes = max(64, side + 12)
    spacing, first = 1 / 64, (nodes - side) // 2
    rng = np.random.default_rng(0)
    axis = np.arange(first, first + side)
    cells = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    x = (np.repeat(cells, 8, axis=0) + rng.random((8 * len(cells), 3))) * spacing
    v = 0.01 * rng.standard_normal(x.shape) - speed * (x - x.mean(axis=0))
    body = Particles.of(
        x, spacing**3 / 8, E=1e5, nu=0.3, rho=1000.0, substance=substance, velocity=v
    )
    return body, BackgroundGrid(np.zeros(3), spacing, (nodes,) * 3)


def measure(
    name: str, count: int, *, device: str = "cpu", threads: int = 1, rounds: int = 7
) -> dict[str, Any]:
    """Best time of a particle and substep [ns], and that of the whole substep [ms]."""
    import warp as wp

    yielding = name == "yielding snow"
    body, grid = block(count, SUBSTANCES[name], speed=20.0 if yielding else 0.0)
    solver = MpmSolver(body, grid, threads=threads, device=device)
    solver.substep.set_step(1e-5, 0.0)
    solver.substep.run(100 if yielding else 3)
    clock = time.thread_time if device == "cpu" else time.perf_counter
    best, wall = np.inf, np.inf
    for _ in range(rounds):
        wp.synchronize()
        start, began = clock(), time.perf_counter()
        solver.substep.run(STEPS)
        wp.synchronize()
        best = min(best, (clock() - start) / STEPS)
        wall = min(wall, (time.perf_counter() - began) / STEPS)
    each = best / len(body.x) * 1e9
    return {
        "class": name,
        "particles": len(body.x),
        "device": device,
        "threads": threads,
        "ns": round(each, 2),
        "substep_ms": round(best * 1e3, 3),
        "wall_ns": round(wall / len(body.x) * 1e9, 1),
        "wanted_ns": WANTED.get(name) if device == "cpu" and threads == 1 else None,
    }


def cases(device: str, count: int | None) -> list[tuple[str, int, int]]:
    """Class, particles, threads."""
    if device != "cpu":
        return [(name, count or 1_000_000, 1) for name in SUBSTANCES]
    if count is not None:
        return [(name, count, 1) for name in SUBSTANCES]
    rows = [(name, 22_000, 1) for name in SUBSTANCES]
    pairs = [("jelly", n, 2) for n in (22_000, 100_000)]
    return [*rows, ("jelly", 100_000, 1), ("jelly", 512, 1), *pairs]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--particles", type=int)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--peers", nargs="+", choices=PEERS, default=(), metavar="NAME")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    if given.peers:
        found = [PEERS[name]() for name in given.peers]
        print(json.dumps({"load": os.getloadavg(), "peers": found}, indent=1))
        return
    rows = []
    for name, count, threads in cases(given.device, given.particles):
        options = {"device": given.device, "threads": threads, "rounds": given.rounds}
        rows.append(measure(name, count, **options))
        if not given.json:
            print(
                "{class:14} {particles:9,} {threads} {ns:7.1f} ns {substep_ms:8.3f} ms".format(
                    **rows[-1]
                )
            )
    if given.json:
        print(json.dumps({"load": os.getloadavg(), "rows": rows}, indent=1))


if __name__ == "__main__":
    main()
