"""Static solves, ours beside peers: same mesh, supports, load and tolerance.

    python benchmarks/statics.py --meshes real --peers calculix --json
    python benchmarks/statics.py --meshes beam --sizes S,M,L --order 1 --peers pyamg,scikit-fem

real: twelve pieces of furniture, converted by ours (``real_meshes.py``), each under its own weight
with quadratic tets. Of ours the CPU seconds of ``solve_static`` on a mesh that it has never
seen, in a process of its own: numbering, pattern, assembly, solve, stresses. Of CalculiX those of
its process with its files. beam: 1 x 0.2 x 0.2 m clamped at x = 0; lower half E = 1e6, nu = .3,
rho = 1000, upper half E = 1e7, nu = .4, rho = 1200; the second, warm call, assembly and solve only.

One thread, a relative residual of 1e-8. ``tip`` is a mean displacement; a peer's difference from
ours stands beside it. A peer (``static_peers.py``) that is not installed is a row that says so.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import resource
import sys
import time
from pathlib import Path

os.environ.update({f"{name}_NUM_THREADS": "1" for name in ("OMP", "MKL", "OPENBLAS", "NUMEXPR")})

import numpy as np
from real_meshes import NAMES, cache_folder, real_mesh
from static_case import TOLERANCE, Case, cantilever, make_row, standing
from static_peers import PEERS, missing

MOST = 1000  # iterations of ours-cg
# Peers that run in a process of their own: what there is to warm up, they warm up themselves.
COLD = ("calculix", "calculix-iterative", "dolfinx", "dolfinx-gamg")


def ours(case: Case, order: int, device: str = "cpu") -> dict:
    from autophyx_tet.fem.elements.assembly import (
        discretise,
        node_supports,
        reduced_load,
        stiffness,
    )
    from autophyx_tet.fem.elements.forces import load_vector
    from autophyx_tet.fem.linalg.solver import solve_system
    from autophyx_tet.fem.scene.supports import Supports

    mesh = case.mesh
    grid = discretise(mesh, order, device)  # once for each mesh, as the peers' dof tables
    start = time.process_time()
    held = node_supports(Supports.clamp(len(mesh.points), case.held), grid.space)
    load = load_vector(mesh, grid, gravity_vector=case.gravity)
    matrix = stiffness(grid, *mesh.material.lame)
    rhs = reduced_load(matrix, load, held, np.zeros_like(load))
    middle = time.process_time()
    known = {"points": grid.space.nodes, "fixed": held.fixed, "edges": grid.space.edges}
    found = solve_system(matrix, rhs, **known, tolerance=TOLERANCE)
    row = make_row(case, rhs.size, start, middle, found.x, found.iterations, found.residual)
    return {**row, "solver": found.solver}


def ours_cg(case: Case, order: int) -> dict:
    """Ours without a factor of the whole matrix: what CG takes where that would not fit."""
    from autophyx_tet.fem.elements.assembly import (
        discretise,
        node_supports,
        reduced_load,
        stiffness,
    )
    from autophyx_tet.fem.elements.forces import load_vector
    from autophyx_tet.fem.linalg.multigrid import scale
    from autophyx_tet.fem.linalg.solver import solve_iterative
    from autophyx_tet.fem.scene.supports import Supports

    start, mesh = time.process_time(), case.mesh
    grid = discretise(mesh, order)
    held = node_supports(Supports.clamp(len(mesh.points), case.held), grid.space)
    load = load_vector(mesh, grid, gravity_vector=case.gravity)
    matrix = stiffness(grid, *mesh.material.lame)
    rhs = reduced_load(matrix, load, held, np.zeros_like(load))
    middle = time.process_time()
    edges = grid.space.edges if order == 2 else None
    known = {"points": grid.space.nodes, "fixed": held.fixed, "edges": edges}
    found = solve_iterative(scale(matrix), rhs, **known, tolerance=TOLERANCE, limit=MOST)
    row = make_row(case, rhs.size, start, middle, found.x, found.iterations, found.residual)
    return {**row, "solver": found.solver}


def ours_whole(case: Case, order: int, device: str = "cpu") -> dict:
    """``solve_static`` as a user calls it, on a mesh that is new to it."""
    from autophyx_tet.fem.material import ElementMaterial
    from autophyx_tet.fem.mesh import box_mesh
    from autophyx_tet.fem.scene.supports import Supports
    from autophyx_tet.fem.solve.statics import solve_static

    box = box_mesh((1, 1, 1), (1, 1, 1))  # loads the libraries and kernels
    box = box.with_material(ElementMaterial.uniform(len(box.tets), E=1.0, nu=0.3, rho=1.0))
    options = {"order": order, "device": device}
    solve_static(
        box, Supports.clamp(8, box.points[:, 2] == 0), gravity_vector=(0, 0, -1), **options
    )
    mesh = case.mesh
    held = Supports.clamp(len(mesh.points), case.held)
    start = time.process_time()
    found = solve_static(mesh, held, gravity_vector=case.gravity, tolerance=TOLERANCE, **options)
    u = found.node_displacement
    row = make_row(case, u.size, start, start, u, found.iterations, found.residual)
    return {**row, "solver": found.solver}


def measure(tool: str, meshes: str, name: str, options: argparse.Namespace, pipe) -> None:
    """Send the row of one tool: the first call on a real mesh, a second, warm one on the beam."""
    from autophyx_tet.fem.linalg import cholesky as factor

    resource.setrlimit(resource.RLIMIT_CPU, (options.limit, options.limit))  # its children's too
    case = cantilever(name) if meshes == "beam" else standing(real_mesh(name, options.cache))
    extra = [options.device] if tool == "ours" else []
    own = {"ours": ours if meshes == "beam" else ours_whole, "ours-cg": ours_cg}
    solve = {**PEERS, **own}[tool]
    for _ in range(1 if tool in COLD or meshes == "real" else 2):
        factor._RECENT.clear()  # a second call would find the factor of the first
        wall = time.perf_counter()
        row = solve(case, options.order, *extra)
        wall = time.perf_counter() - wall
    rss = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    pipe.send(
        {"tool": tool, "mesh": name, "order": options.order, "wall_s": wall, "rss_mb": rss, **row}
    )


def run(tool: str, name: str, options: argparse.Namespace) -> dict:
    """One row, from a process of its own; with an ``error`` if the tool fails."""
    if not tool.startswith("ours") and (reason := missing(tool)):
        return {"tool": tool, "mesh": name, "error": f"not installed: {reason}"}
    context = multiprocessing.get_context("spawn")
    ours_end, theirs = context.Pipe(duplex=False)
    arguments = (tool, options.meshes, name, options, theirs)
    process = context.Process(target=measure, args=arguments)
    process.start()
    theirs.close()
    try:
        return ours_end.recv()
    except EOFError:  # its own message is on stderr
        ended = f"failed, or not done in {options.limit} CPU s"
        return {"tool": tool, "mesh": name, "error": ended}
    finally:
        process.join()


def line(row: dict, base: dict | None) -> str:
    """One row in words, beside ours on the same mesh."""
    if "error" in row:
        return f"{row['tool']:12s} {row['mesh']}: {row['error']}"
    apart = ""
    if base and "error" not in base and row is not base:
        off = abs(row["tip"] / base["tip"] - 1)
        apart = f"  ours/this {base['cpu_s'] / row['cpu_s']:.2f}, off {off:.1e}"
    residual = "-" if row["rel_residual"] is None else f"{row['rel_residual']:.1e}"
    return (
        f"{row['tool']:12s} {row['mesh']} P{row['order']} {row['tets']:7d} tets {row['dof']:7d} dof"
        f"  cpu {row['assemble_cpu_s']:.2f} + {row['solve_cpu_s']:.2f} = {row['cpu_s']:.2f} s  "
        f"wall {row['wall_s']:.2f} s  {row['rss_mb']:.0f} MB  {row['iterations']:3d} it  "
        f"res {residual}{apart}  {row.get('solver', '')}"
    )


def ratios(rows: list[dict]) -> dict[str, dict[str, float]]:
    """Our CPU seconds over a peer's: median and largest over the meshes both solved."""
    spent = {(r["tool"], r["mesh"]): r["cpu_s"] for r in rows if "error" not in r}
    found = {}
    for peer in dict.fromkeys(tool for tool, _ in spent if tool != "ours"):
        share = [
            spent["ours", m] / s
            for (t, m), s in spent.items()
            if t == peer and ("ours", m) in spent
        ]
        if share:
            found[peer] = {
                "median": float(np.median(share)),
                "largest": max(share),
                "meshes": len(share),
            }
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--meshes", choices=("real", "beam"), default="beam")
    parser.add_argument("--sizes", default="S,M", help="of the beam")
    parser.add_argument("--names", default=",".join(NAMES), help="of the real meshes")
    parser.add_argument("--cache", type=Path, default=cache_folder(), help="folder of real meshes")
    parser.add_argument("--order", type=int, choices=(1, 2), help="default: real 2, beam 1")
    parser.add_argument(
        "--peers", default="pyamg,scikit-fem", help=f"of ours-cg, {', '.join(PEERS)}"
    )
    parser.add_argument("--device", default="cpu", help="of ours: cpu or cuda (read wall_s there)")
    parser.add_argument("--limit", type=int, default=1200, help="CPU seconds a row may take")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    options.order = options.order or (1 if options.meshes == "beam" else 2)
    names = (options.sizes if options.meshes == "beam" else options.names).split(",")
    rows = []
    for name in names:
        base = None
        for tool in ["ours", *filter(None, options.peers.split(","))]:
            row = run(tool, name, options)
            base = base or row
            rows.append(row)
            print(line(row, base), file=sys.stderr if options.json else sys.stdout, flush=True)
    print(
        json.dumps({"schema": 2, "ratios": ratios(rows), "rows": rows})
        if options.json
        else ratios(rows)
    )


if __name__ == "__main__":
    main()
