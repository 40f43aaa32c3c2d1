"""One row of the static benchmark by dolfinx; ``statics.py`` runs it in the system's Python.

python3 static_dolfinx.py MESH.npz ORDER icc|gamg TOLERANCE
"""

from __future__ import annotations

import json
import os
import resource
import sys
import time

os.environ["OMP_NUM_THREADS"] = "1"

import dolfinx.fem.petsc as dp
import numpy as np
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI
from petsc4py import PETSc
from scipy.spatial import cKDTree


def problem(data, order: int):
    """Forms of the clamped body under gravity, its boundary condition, and where its dofs are."""
    element = ufl.VectorElement("Lagrange", "tetrahedron", 1)
    cells = data["tets"].astype(np.int64)
    domain = mesh.create_mesh(MPI.COMM_SELF, cells, data["points"], ufl.Mesh(element))
    V, Q = (
        fem.VectorFunctionSpace(domain, ("Lagrange", order)),
        fem.FunctionSpace(domain, ("DG", 0)),
    )
    original = domain.topology.original_cell_index
    lam, mu, rho = (fem.Function(Q) for _ in range(3))
    for function, name in ((lam, "lam"), (mu, "mu"), (rho, "rho")):
        function.x.array[:] = data[name][original]
    u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
    strain = ufl.sym(ufl.grad(u))
    stress = lam * ufl.tr(strain) * ufl.Identity(3) + 2 * mu * strain
    a = fem.form(ufl.inner(stress, ufl.sym(ufl.grad(v))) * ufl.dx)
    weight = ufl.as_vector([float(g) for g in data["gravity"]])
    b = fem.form(rho * ufl.inner(weight, v) * ufl.dx)
    held = nearest(V.tabulate_dof_coordinates(), data["held"]).astype(np.int32)
    return V, a, b, fem.dirichletbc(np.zeros(3), held, V)


def nearest(nodes: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Dof (of a component) at every point."""
    return cKDTree(nodes).query(points)[1]


def rigid_modes(V) -> PETSc.NullSpace:
    """Six orthonormal rigid motions."""
    x, y, z = V.tabulate_dof_coordinates().T
    modes = np.zeros((6, len(x), 3))
    for k in range(3):
        modes[k, :, k] = 1
    modes[3, :, 1], modes[3, :, 2] = -z, y
    modes[4, :, 0], modes[4, :, 2] = z, -x
    modes[5, :, 0], modes[5, :, 1] = -y, x
    basis = np.linalg.qr(modes.reshape(6, -1).T)[0].T
    return PETSc.NullSpace().create(vectors=[PETSc.Vec().createWithArray(m.copy()) for m in basis])


def solve(A, a, b, bc, near, kind: str, tolerance: float):
    """Assemble into ``A`` and solve; CPU seconds of both, the solution and the solver."""
    start = time.process_time()
    A.zeroEntries()
    dp.assemble_matrix(A, a, [bc])
    A.assemble()
    load = dp.assemble_vector(b)
    dp.apply_lifting(load, [a], [[bc]])
    dp.set_bc(load, [bc])
    middle = time.process_time()
    if kind == "gamg":
        A.setNearNullSpace(near)
    solver = PETSc.KSP().create(MPI.COMM_SELF)
    solver.setOperators(A)
    solver.setType("cg")
    solver.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
    solver.getPC().setType(kind)
    solver.setTolerances(rtol=tolerance, max_it=10_000)
    x = load.duplicate()
    solver.solve(load, x)
    residual = (load - A * x).norm() / load.norm()
    return middle - start, time.process_time() - middle, x.array, solver, residual


def main() -> None:
    path, order, kind, tolerance = sys.argv[1:]
    data = np.load(path, allow_pickle=False)  # noqa: TID251 (this Python has no converters)
    V, a, b, bc = problem(data, int(order))
    A = dp.create_matrix(a)  # the pattern, once for each mesh
    near = rigid_modes(V)
    for _ in range(2):  # the second call is warm
        wall = time.perf_counter()
        assemble, spent, x, solver, residual = solve(A, a, b, bc, near, kind, float(tolerance))
        wall = time.perf_counter() - wall
    nodes = V.tabulate_dof_coordinates()
    probe = nearest(nodes, data["points"][data["probe"]])
    tip = (x.reshape(-1, 3)[probe] @ data["direction"]).mean()
    row = {
        "tets": len(data["tets"]),
        "dof": x.size,
        "assemble_cpu_s": assemble,
        "solve_cpu_s": spent,
        "cpu_s": assemble + spent,
        "wall_s": wall,
        "iterations": solver.getIterationNumber(),
        "tip": float(tip),
        "rel_residual": float(residual),
        "rss_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }
    print(json.dumps(row))


if __name__ == "__main__":
    main()
