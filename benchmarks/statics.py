"""Static solve of the two-material cantilever, ours beside peers: same mesh, load and tolerance.

    python benchmarks/statics.py --sizes S,M,L --order 1 --peers pyamg,scikit-fem --json

Box 1 x 0.2 x 0.2 m clamped at x = 0 under gravity; lower half E = 1e6, nu = .3, rho = 1000, upper
half E = 1e7, nu = .4, rho = 1200. Every row is the second, warm call in a process of its own
with one thread: CPU seconds of assembly and of set-up + solve, to a relative residual of 1e-8.
``tip`` is the mean u_z of the end face. A peer that is not installed is skipped with a word.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import multiprocessing
import os
import resource
import sys
import time

os.environ.update({f"{name}_NUM_THREADS": "1" for name in ("OMP", "MKL", "OPENBLAS", "NUMEXPR")})

import numpy as np

SIZES = {"S": (40, 6, 8), "M": (60, 12, 12), "L": (96, 18, 20)}
TOLERANCE = 1e-8
GRAVITY = (0.0, 0.0, -9.81)


def bench_mesh(size: str):
    from autophyx_tet.fem.box import box_mesh
    from autophyx_tet.fem.material import ElementMaterial

    mesh = box_mesh((1, 0.2, 0.2), SIZES[size])
    upper = mesh.centroids[:, 2] > 0.1
    pick = lambda high, low: np.where(upper, high, low)  # noqa: E731
    material = ElementMaterial(pick(1e7, 1e6), pick(0.4, 0.3), pick(1200.0, 1000.0))
    return mesh.with_material(material)


def tip(mesh, u: np.ndarray) -> float:
    return float(u[np.isclose(mesh.points[:, 0], 1.0), 2].mean())


def ours(mesh, order: int, device: str = "cpu") -> dict:
    from autophyx_tet.fem.blocks import discretise, stiffness
    from autophyx_tet.fem.solver import solve
    from autophyx_tet.fem.statics import load_vector, reduced_load
    from autophyx_tet.fem.supports import Supports

    grid = discretise(mesh, order, device)  # once for each mesh, as the peers' dof tables
    start = time.process_time()
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0).on(grid.space)
    load = load_vector(mesh, grid.space, GRAVITY, None, (), None)
    matrix = stiffness(grid, *mesh.material.lame)
    rhs = reduced_load(matrix, load, held, np.zeros_like(load))
    middle = time.process_time()
    nodes = grid.space.nodes
    solution = solve(matrix, rhs, points=nodes, fixed=held.fixed, tolerance=TOLERANCE)
    return _row(mesh, nodes.size, start, middle, solution.x, solution.iterations, solution.residual)


def _row(mesh, dof, start, middle, u, iterations, residual) -> dict:
    end = time.process_time()
    return {
        "tets": len(mesh.tets),
        "dof": int(dof),
        "assemble_cpu_s": middle - start,
        "solve_cpu_s": end - middle,
        "cpu_s": end - start,
        "iterations": int(iterations),
        "tip": tip(mesh, u[: len(mesh.points)]),
        "rel_residual": float(residual),
    }


def _assembled(mesh, order: int):
    """Our matrix as CSR and load: what a pure linear solver among the peers is given."""
    from autophyx_tet.fem.blocks import discretise, stiffness
    from autophyx_tet.fem.statics import load_vector, reduced_load
    from autophyx_tet.fem.supports import Supports

    grid = discretise(mesh, order)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0).on(grid.space)
    load = load_vector(mesh, grid.space, GRAVITY, None, (), None)
    matrix = stiffness(grid, *mesh.material.lame)
    rhs = reduced_load(matrix, load, held, np.zeros_like(load))
    return grid, matrix.to_scipy(), rhs.reshape(-1), held


def _rigid(nodes: np.ndarray, fixed: np.ndarray) -> np.ndarray:
    from autophyx_tet.fem.pieces import rigid_motions

    return (rigid_motions(nodes - nodes.mean(axis=0)) * ~fixed[:, :, None]).reshape(-1, 6)


def pyamg(mesh, order: int) -> dict:
    """Smoothed aggregation with rigid modes on our matrix; only the solve is pyamg's."""
    import pyamg as amg
    from scipy.sparse import bsr_matrix

    start = time.process_time()
    grid, A, b, held = _assembled(mesh, order)
    middle = time.process_time()
    hierarchy = amg.smoothed_aggregation_solver(
        bsr_matrix(A), B=_rigid(grid.space.nodes, held.fixed), max_coarse=500
    )
    residuals: list[float] = []
    x = hierarchy.solve(b, tol=TOLERANCE, accel="cg", residuals=residuals)
    residual = np.linalg.norm(b - A @ x) / np.linalg.norm(b)
    return _row(mesh, b.size, start, middle, x.reshape(-1, 3), len(residuals) - 1, residual)


def scikit_fem(mesh, order: int) -> dict:
    """scikit-fem's assembly, pyamg's solve."""
    import pyamg as amg
    import skfem
    from skfem.helpers import ddot, eye, sym_grad, trace

    start = time.process_time()
    element = skfem.ElementTetP1() if order == 1 else skfem.ElementTetP2()
    grid = skfem.MeshTet(mesh.points.T, mesh.tets.T.astype(np.int64))
    basis = skfem.Basis(grid, skfem.ElementVector(element), intorder=2 * order - 1)
    lam, mu = (m[:, None] for m in mesh.material.lame)
    rho = mesh.material.rho[:, None]

    @skfem.BilinearForm
    def stiffness(u, v, w):
        e = sym_grad(u)
        return ddot(lam * eye(trace(e), 3) + 2 * mu * e, sym_grad(v))

    @skfem.LinearForm
    def weight(v, w):
        return -9.81 * rho * v[2]

    A, b = stiffness.assemble(basis), weight.assemble(basis)
    fixed = basis.get_dofs(lambda x: np.isclose(x[0], 0)).all()
    A, b, x, inner = skfem.condense(A, b, D=fixed)
    middle = time.process_time()
    location = basis.doflocs.T  # one row a dof; components in turn
    modes = np.zeros((len(location), 6))
    axis = np.arange(len(location)) % 3
    from autophyx_tet.fem.pieces import rigid_motions

    modes[:] = rigid_motions(location - location.mean(axis=0))[np.arange(len(location)), axis]
    residuals: list[float] = []
    hierarchy = amg.smoothed_aggregation_solver(A.tocsr(), B=modes[inner], max_coarse=500)
    y = hierarchy.solve(b, tol=TOLERANCE, accel="cg", residuals=residuals)
    x[inner] = y
    residual = np.linalg.norm(b - A @ y) / np.linalg.norm(b)
    points = x[basis.nodal_dofs].T
    return _row(mesh, x.size, start, middle, points, len(residuals) - 1, residual)


def pardiso(mesh, order: int) -> dict:
    """MKL Pardiso on our matrix; the cache of pypardiso is emptied, or it would time nothing."""
    import pypardiso

    start = time.process_time()
    _, A, b, _ = _assembled(mesh, order)
    A = A.tocsr()
    middle = time.process_time()
    solver = pypardiso.PyPardisoSolver()
    x = solver.solve(A, b)
    solver.free_memory(everything=True)
    residual = np.linalg.norm(b - A @ x) / np.linalg.norm(b)
    return _row(mesh, b.size, start, middle, x.reshape(-1, 3), 0, residual)


PEERS = {"ours": ours, "pyamg": pyamg, "scikit-fem": scikit_fem, "pardiso": pardiso}
MODULES = {"pyamg": ["pyamg"], "scikit-fem": ["skfem", "pyamg"], "pardiso": ["pypardiso"]}


def measure(tool: str, size: str, order: int, device: str, pipe) -> None:
    mesh = bench_mesh(size)
    for _ in range(2):  # the second call is warm: kernels compiled, tables of the mesh made
        wall = time.perf_counter()
        row = PEERS[tool](mesh, order, *([device] if tool == "ours" else []))
        row["wall_s"] = time.perf_counter() - wall
    row["rss_mb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    pipe.send({"tool": tool, "size": size, "order": order, **row})


def missing(tool: str) -> str | None:
    """Why ``tool`` cannot run here, or None."""
    if tool not in PEERS:
        return f"no adapter: have {sorted(PEERS)}"
    absent = [m for m in MODULES.get(tool, []) if importlib.util.find_spec(m) is None]
    return f"pip install {' '.join(absent)}" if absent else None


def run(tool: str, size: str, order: int, device: str) -> dict:
    """One row, from a process of its own."""
    context = multiprocessing.get_context("spawn")
    ours_end, theirs = context.Pipe(duplex=False)
    process = context.Process(target=measure, args=(tool, size, order, device, theirs))
    process.start()
    theirs.close()
    row = ours_end.recv()
    process.join()
    return row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", default="S,M")
    parser.add_argument("--order", type=int, default=1, choices=(1, 2))
    parser.add_argument("--peers", default="pyamg,scikit-fem")
    parser.add_argument("--device", default="cpu", help="of ours: cpu or cuda (read wall_s there)")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    rows = []
    for tool in ["ours", *filter(None, options.peers.split(","))]:
        if reason := missing(tool):
            print(f"{tool}: skipped ({reason})", file=sys.stderr)
            continue
        for size in options.sizes.split(","):
            rows.append(row := run(tool, size, options.order, options.device))
            if not options.json:
                print(
                    f"{tool:11s} {size} P{options.order} {row['tets']:7d} tets  "
                    f"cpu {row['assemble_cpu_s']:.2f} + {row['solve_cpu_s']:.2f} = "
                    f"{row['cpu_s']:.2f} s  wall {row['wall_s']:.2f} s  {row['rss_mb']:.0f} MB  "
                    f"{row['iterations']:3d} it  tip {row['tip']:.9f}  "
                    f"res {row['rel_residual']:.1e}"
                )
    if options.json:
        print(json.dumps({"schema": 1, "rows": rows}))


if __name__ == "__main__":
    main()
