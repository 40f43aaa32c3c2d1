"""Implicit steps of a 20.7k-tet cantilever, ours beside peers.

    python benchmarks/dynamics.py --peers mujoco,newton --json

Box 1 x 0.2 x 0.2 m, 54 x 8 x 8 cells, clamped at x = 0, released under gravity; lower half E = 1e6,
nu = .3, rho = 1000, upper half nu = .4, rho = 1200 and E = 1e7 (case ``soft``) or 2e11 (``steel``).
``ms_per_step`` is the mean CPU time of the steps after the first, one thread; a step ends at a
Newton residual of 1e-4. A peer that is not installed, or has no adapter, is skipped with a word.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time

os.environ.update({f"{name}_NUM_THREADS": "1" for name in ("OMP", "MKL", "OPENBLAS", "NUMEXPR")})

import numpy as np

CELLS = (54, 8, 8)
DT = 0.01
CASES = {"soft": 1e7, "steel": 2e11}


def bench_mesh(stiff: float):
    from autophyx_tet.fem.box import box_mesh
    from autophyx_tet.fem.material import ElementMaterial

    mesh = box_mesh((1, 0.2, 0.2), CELLS)
    upper = mesh.centroids[:, 2] > 0.1
    pick = lambda high, low: np.where(upper, high, low)  # noqa: E731
    return mesh.with_material(
        ElementMaterial(pick(stiff, 1e6), pick(0.4, 0.3), pick(1200.0, 1000.0))
    )


def ours(case: str, steps: int, device: str) -> dict:
    from autophyx_tet.fem.dynamics import Dynamics
    from autophyx_tet.fem.supports import Supports

    mesh = bench_mesh(CASES[case])
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0)
    body = Dynamics(mesh, supports=held, gravity=(0, 0, -9.81), device=device)
    body.step(DT)  # kernels, preconditioner
    start, wall, newton = time.process_time(), time.perf_counter(), 0
    for _ in range(steps):
        newton += body.step(DT).iterations
    spent = time.process_time() - start
    tip = body.state.u[np.isclose(mesh.points[:, 0], 1), 2].mean()
    return {
        "tool": "ours",
        "case": case,
        "dt": DT,
        "ms_per_step": 1e3 * spent / steps,
        "wall_ms_per_step": 1e3 * (time.perf_counter() - wall) / steps,
        "tets": len(mesh.tets),
        "steps": steps,
        "newton_per_step": newton / steps,
        "tip": float(tip),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--peers", default="mujoco,newton")
    parser.add_argument("--steps", type=int, default=100)
    parser.add_argument("--device", default="cpu", help="cpu or cuda (read the wall time there)")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    for peer in filter(None, options.peers.split(",")):
        print(f"{peer}: skipped (no adapter yet)", file=sys.stderr)
    rows = [ours(case, options.steps, options.device) for case in CASES]
    if options.json:
        print(json.dumps({"schema": 1, "rows": rows}))
        return
    for row in rows:
        print(
            f"{row['tool']} {row['case']:6s} {row['tets']} tets  {row['ms_per_step']:.1f} ms/step  "
            f"{row['newton_per_step']:.2f} Newton  tip {row['tip']:.6f}"
        )


if __name__ == "__main__":
    main()
