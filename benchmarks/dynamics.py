"""Implicit steps of a 20.7k-tet cantilever, ours beside peers.

    python benchmarks/dynamics.py --peers mujoco,newton --json

Box 1 x 0.2 x 0.2 m, 54 x 8 x 8 cells, clamped at x = 0, released under gravity; lower half E = 1e6,
nu = .3, rho = 1000, upper half nu = .4, rho = 1200 and E = 1e7 (case ``soft``) or 2e11 (``steel``).
``ms_per_step`` is the mean CPU time of the steps after the first, one thread. Our step ends at a
residual of 1e-4 of the external and inertial force; MuJoCo (flex) and Newton (VBD) have steps of
their own. ``tip`` is the mean sag of the free end after 0.2 s; none where a tool has not come so
far or has no finite answer. A peer that is not installed is skipped with a word.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import sys
import time
from collections.abc import Iterator

os.environ.update({f"{name}_NUM_THREADS": "1" for name in ("OMP", "MKL", "OPENBLAS", "NUMEXPR")})

import numpy as np
from dynamics_peers import GRAVITY, PEERS, Peer

CELLS = (54, 8, 8)
DTS = (0.01, 0.002)
TIME = 0.2
CASES = {"soft": 1e7, "steel": 2e11}


def bench_mesh(stiff: float):
    from autophyx_tet.fem.material import ElementMaterial
    from autophyx_tet.fem.mesh import box_mesh

    mesh = box_mesh((1, 0.2, 0.2), CELLS)
    upper = mesh.centroids[:, 2] > 0.1
    pick = lambda high, low: np.where(upper, high, low)  # noqa: E731
    return mesh.with_material(
        ElementMaterial(pick(stiff, 1e6), pick(0.4, 0.3), pick(1200.0, 1000.0))
    )


def ours(mesh, dt: float, device: str) -> Peer:
    from autophyx_tet.fem.scene.supports import Supports
    from autophyx_tet.fem.solve.dynamics import Dynamics

    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0)
    body = Dynamics(mesh, supports=held, gravity_vector=(0, 0, -GRAVITY), device=device)
    end = np.isclose(mesh.points[:, 0], 1)
    return Peer(lambda: body.step(dt), lambda: float(body.state.u[end, 2].mean()), dt)


def measure(tool: str, case: str, peer: Peer, mesh, steps: int) -> dict:
    peer.step()  # kernels, preconditioner
    tip, newton = None, 0
    start, wall = time.process_time(), time.perf_counter()
    for done in range(2, steps + 2):
        newton += getattr(peer.step(), "iterations", 0)
        if done == round(TIME / peer.dt):
            tip = peer.tip()
    spent, wall = time.process_time() - start, time.perf_counter() - wall
    return {
        "tool": tool,
        "case": case,
        "dt": peer.dt,
        "ms_per_step": 1e3 * spent / steps,
        "wall_ms_per_step": 1e3 * wall / steps,
        "tets": len(mesh.tets),
        "steps": steps,
        "newton_per_step": newton / steps or None,
        "tip": tip if tip is not None and np.isfinite(tip) else None,
    }


def rows(options: argparse.Namespace) -> Iterator[dict]:
    for case, stiff in CASES.items():
        mesh = bench_mesh(stiff)
        for dt in DTS:
            yield measure("ours", case, ours(mesh, dt, options.device), mesh, options.steps)
        for name in filter(None, options.peers.split(",")):
            if name not in PEERS:
                sys.exit(f"no peer {name!r}: have {', '.join(PEERS)}")
            try:
                peer = PEERS[name](mesh)
            except ImportError:
                print(f"{name}: skipped (not installed)", file=sys.stderr)
                continue
            yield measure(name, case, peer, mesh, options.steps)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--peers", default="mujoco,newton")
    parser.add_argument("--steps", type=int, default=100)
    parser.add_argument("--device", default="cpu", help="cpu or cuda (read the wall time there)")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    if options.json:
        with contextlib.redirect_stdout(sys.stderr):  # a peer greets on stdout
            found = list(rows(options))
        print(json.dumps({"schema": 1, "rows": found}))
        return
    for row in rows(options):
        print(
            "{tool:7s} {case:6s} dt {dt:.5f}  {ms_per_step:7.1f} ms/step "
            "({wall_ms_per_step:.1f} wall)  Newton {newton_per_step}  tip {tip}".format(**row)
        )


if __name__ == "__main__":
    main()
