"""Static solve of the two-material cantilever, ours beside peers: same mesh, load and tolerance.

    python benchmarks/statics.py --sizes S,M,L --order 1 --peers pyamg,scikit-fem --json

Box 1 x 0.2 x 0.2 m clamped at x = 0 under gravity; lower half E = 1e6, nu = .3, rho = 1000, upper
half E = 1e7, nu = .4, rho = 1200. Every row is the second, warm call in a process of its own
with one thread: CPU seconds of assembly and of set-up + solve, to a relative residual of 1e-8.
``tip`` is the mean u_z of the end face; a peer's difference from ours is printed beside it. A peer
(``static_peers.py``) that is not installed is skipped with a word.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import resource
import sys
import time

os.environ.update({f"{name}_NUM_THREADS": "1" for name in ("OMP", "MKL", "OPENBLAS", "NUMEXPR")})

import numpy as np
from static_cantilever import GRAVITY, TOLERANCE, bench_mesh, make_row
from static_peers import PEERS, missing

# Peers that run in a process of their own: what there is to warm up, they warm up themselves.
COLD = ("calculix", "dolfinx", "dolfinx-gamg")


def ours(mesh, order: int, device: str = "cpu") -> dict:
    from autophyx_tet.fem.discrete.assembly import discretise, stiffness
    from autophyx_tet.fem.discrete.constraints import node_supports, reduced_load
    from autophyx_tet.fem.discrete.forces import load_vector
    from autophyx_tet.fem.linalg.solver import solve_system
    from autophyx_tet.fem.scene.supports import Supports

    grid = discretise(mesh, order, device)  # once for each mesh, as the peers' dof tables
    start = time.process_time()
    held = node_supports(Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0), grid.space)
    load = load_vector(mesh, grid, gravity_vector=GRAVITY)
    matrix = stiffness(grid, *mesh.material.lame)
    rhs = reduced_load(matrix, load, held, np.zeros_like(load))
    middle = time.process_time()
    nodes = grid.space.nodes
    solution = solve_system(
        matrix, rhs, points=nodes, fixed=held.fixed, tolerance=TOLERANCE, edges=grid.space.edges
    )
    return make_row(
        mesh, nodes.size, start, middle, solution.x, solution.iterations, solution.residual
    )


def solver_of(tool: str):
    """Function (mesh, order) -> row of ``tool``."""
    return ours if tool == "ours" else PEERS[tool]


def measure(tool: str, size: str, order: int, device: str, pipe) -> None:
    """Send the row of a second, warm call."""
    mesh = bench_mesh(size)
    extra = [device] if tool == "ours" else []
    for _ in range(1 if tool in COLD else 2):
        wall = time.perf_counter()
        row = solver_of(tool)(mesh, order, *extra)
        wall = time.perf_counter() - wall
    rss = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    pipe.send({"tool": tool, "size": size, "order": order, "wall_s": wall, "rss_mb": rss, **row})


def run(tool: str, size: str, order: int, device: str) -> dict | None:
    """One row, from a process of its own; None if the tool fails."""
    context = multiprocessing.get_context("spawn")
    ours_end, theirs = context.Pipe(duplex=False)
    process = context.Process(target=measure, args=(tool, size, order, device, theirs))
    process.start()
    theirs.close()
    try:
        return ours_end.recv()
    except EOFError:  # its own message is on stderr
        print(f"{tool} {size}: failed", file=sys.stderr)
        return None
    finally:
        process.join()


def line(row: dict, reference: float | None) -> str:
    """One row in words; ``reference`` is the tip to compare with."""
    apart = "" if reference is None else f"  off ours {abs(row['tip'] / reference - 1):.1e}"
    residual = "-" if row["rel_residual"] is None else f"{row['rel_residual']:.1e}"
    return (
        f"{row['tool']:12s} {row['size']} P{row['order']} {row['tets']:7d} tets  "
        f"cpu {row['assemble_cpu_s']:.2f} + {row['solve_cpu_s']:.2f} = {row['cpu_s']:.2f} s  "
        f"wall {row['wall_s']:.2f} s  {row['rss_mb']:.0f} MB  {row['iterations']:3d} it  "
        f"tip {row['tip']:.9f}  res {residual}{apart}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", default="S,M")
    parser.add_argument("--order", type=int, default=1, choices=(1, 2))
    parser.add_argument("--peers", default="pyamg,scikit-fem", help=f"of {', '.join(PEERS)}")
    parser.add_argument("--device", default="cpu", help="of ours: cpu or cuda (read wall_s there)")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    rows, tips = [], {}
    for tool in ["ours", *filter(None, options.peers.split(","))]:
        if tool != "ours" and (reason := missing(tool)):
            print(f"{tool}: skipped ({reason})", file=sys.stderr)
            continue
        for size in options.sizes.split(","):
            row = run(tool, size, options.order, options.device)
            if row is None:
                continue
            rows.append(row)
            tips.setdefault(size, row["tip"])
            if not options.json:
                print(line(row, None if tool == "ours" else tips[size]), flush=True)
    if options.json:
        print(json.dumps({"schema": 1, "rows": rows}))


if __name__ == "__main__":
    main()
