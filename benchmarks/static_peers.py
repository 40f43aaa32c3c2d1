"""Peers of the static benchmark, each as ``solve(mesh, order) -> row``; see ``statics.py``."""

from __future__ import annotations

import importlib.util
import json
import resource
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
from static_case import STRENGTH_OF_GRAVITY, TOLERANCE, Case, make_row

MOST = 2000  # iterations of pyamg, which stops at 100 unasked
# The system's Python, for which Debian packages dolfinx.
SYSTEM_PYTHON = "/usr/bin/python3"


def assembled(case: Case, order: int):
    """Our matrix as BSR and load: what a pure linear solver among the peers is given."""
    from autophyx_tet.fem.elements.assembly import (
        discretise,
        node_supports,
        reduced_load,
        stiffness,
    )
    from autophyx_tet.fem.elements.forces import load_vector
    from autophyx_tet.fem.scene.supports import Supports

    mesh = case.mesh
    grid = discretise(mesh, order)
    held = node_supports(Supports.clamp(len(mesh.points), case.held), grid.space)
    load = load_vector(mesh, grid, gravity_vector=case.gravity)
    matrix = stiffness(grid, *mesh.material.lame)
    rhs = reduced_load(matrix, load, held, np.zeros_like(load))
    return grid, matrix.to_scipy(), rhs.reshape(-1), held


def rigid(nodes: np.ndarray, fixed: np.ndarray) -> np.ndarray:
    from autophyx_tet.fem.mesh import rigid_motions

    return (rigid_motions(nodes - nodes.mean(axis=0)) * ~fixed[:, :, None]).reshape(-1, 6)


def pyamg(case: Case, order: int) -> dict:
    """Smoothed aggregation with rigid modes on our matrix; only the solve is pyamg's."""
    import pyamg as amg
    from scipy.sparse import bsr_matrix

    start = time.process_time()
    grid, A, b, held = assembled(case, order)
    middle = time.process_time()
    hierarchy = amg.smoothed_aggregation_solver(
        bsr_matrix(A), B=rigid(grid.space.nodes, held.fixed), max_coarse=500, coarse_solver="splu"
    )
    residuals: list[float] = []
    x = hierarchy.solve(b, tol=TOLERANCE, maxiter=MOST, accel="cg", residuals=residuals)
    residual = np.linalg.norm(b - A @ x) / np.linalg.norm(b)
    return make_row(case, b.size, start, middle, x.reshape(-1, 3), len(residuals) - 1, residual)


def scikit_fem(case: Case, order: int) -> dict:
    """scikit-fem's assembly, pyamg's solve."""
    import pyamg as amg
    import skfem
    from skfem.helpers import ddot, eye, sym_grad, trace

    start, mesh = time.process_time(), case.mesh
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
        return rho * sum(g * v[i] for i, g in enumerate(case.gravity))

    A, b = stiffness.assemble(basis), weight.assemble(basis)
    ends = case.held[grid.edges].all(axis=0)
    dofs = [basis.nodal_dofs[:, case.held]] + ([basis.edge_dofs[:, ends]] if order == 2 else [])
    fixed = np.concatenate([d.ravel() for d in dofs])
    A, b, x, inner = skfem.condense(A, b, D=fixed)
    middle = time.process_time()
    location = basis.doflocs.T  # one row a dof; components in turn
    modes = np.zeros((len(location), 6))
    axis = np.arange(len(location)) % 3
    from autophyx_tet.fem.mesh import rigid_motions

    modes[:] = rigid_motions(location - location.mean(axis=0))[np.arange(len(location)), axis]
    residuals: list[float] = []
    hierarchy = amg.smoothed_aggregation_solver(
        A.tocsr(), B=modes[inner], max_coarse=500, coarse_solver="splu"
    )
    y = hierarchy.solve(b, tol=TOLERANCE, maxiter=MOST, accel="cg", residuals=residuals)
    x[inner] = y
    residual = np.linalg.norm(b - A @ y) / np.linalg.norm(b)
    points = x[basis.nodal_dofs].T
    return make_row(case, x.size, start, middle, points, len(residuals) - 1, residual)


def pardiso(case: Case, order: int) -> dict:
    """MKL Pardiso on our matrix; the cache of pypardiso is emptied, or it would time nothing."""
    import pypardiso

    start = time.process_time()
    _, A, b, _ = assembled(case, order)
    A = A.tocsr()
    middle = time.process_time()
    solver = pypardiso.PyPardisoSolver()
    x = solver.solve(A, b)
    solver.free_memory(everything=True)
    residual = np.linalg.norm(b - A @ x) / np.linalg.norm(b)
    return make_row(case, b.size, start, middle, x.reshape(-1, 3), 0, residual)


def dolfinx(case: Case, order: int, preconditioner: str = "icc") -> dict:
    """PETSc's CG in the system's Python: ``preconditioner`` icc (level 0) or gamg (rigid modes)."""
    script = Path(__file__).with_name("static_dolfinx.py")
    from autophyx_tet.fem.elements.space import make_space

    mesh, space = case.mesh, make_space(case.mesh, order)
    lam, mu = mesh.material.lame
    arrays = {"points": mesh.points, "tets": mesh.tets, "lam": lam, "mu": mu}
    arrays |= {"held": space.nodes[case.held_nodes(space)], "gravity": case.gravity}
    arrays |= {"probe": case.probe, "direction": case.direction}
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "mesh.npz")
        np.savez(path, **arrays, rho=mesh.material.rho)
        command = [SYSTEM_PYTHON, str(script), path, str(order), preconditioner, str(TOLERANCE)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"dolfinx ended with {done.returncode}: {done.stderr[-500:]}")
    return json.loads(done.stdout.splitlines()[-1])


def dolfinx_gamg(case: Case, order: int) -> dict:
    """Same, with PETSc's algebraic multigrid."""
    return dolfinx(case, order, "gamg")


def calculix(case: Case, order: int, solver: str = "") -> dict:
    """CalculiX with its default, direct solver on a deck of ours: the whole process, its files too.

    ``solver`` is what the deck says of another.
    """
    from autophyx_tet.fem.elements.space import make_space

    mesh, space = case.mesh, make_space(case.mesh, order)
    with tempfile.TemporaryDirectory() as folder:
        deck = Path(folder) / "deck.inp"
        deck.write_text(_deck(case, space, solver))
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(["ccx", "deck"], cwd=folder, capture_output=True, check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        table = [line.split() for line in (Path(folder) / "deck.dat").read_text().splitlines()]
    u = np.zeros(mesh.points.shape)
    for entry in table:
        if len(entry) == 4 and entry[0].isdigit():
            u[int(entry[0]) - 1] = [float(value) for value in entry[1:]]
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return {
        "tets": len(mesh.tets),
        "dof": space.nodes.size,
        "assemble_cpu_s": 0.0,
        "solve_cpu_s": spent,
        "cpu_s": spent,
        "iterations": 0,
        "tip": case.tip(u),
        "rel_residual": None,  # it prints none
        "rss_mb": after.ru_maxrss / 1024,
    }


def calculix_iterative(case: Case, order: int) -> dict:
    """Same, with its conjugate gradients."""
    return calculix(case, order, ", SOLVER=ITERATIVE CHOLESKY")


def _deck(case: Case, space, solver: str) -> str:
    """Deck with one element set a material, the probe printed; a number has 20 characters."""
    mesh = case.mesh
    table = np.stack([mesh.material.E, mesh.material.nu, mesh.material.rho], axis=1)
    kinds, index = np.unique(table, axis=0, return_inverse=True)
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{i},{x:.12e},{y:.12e},{z:.12e}" for i, (x, y, z) in enumerate(space.nodes, 1)]
    element = "C3D4" if space.order == 1 else "C3D10"
    for kind, (E, nu, rho) in enumerate(kinds):
        lines.append(f"*ELEMENT, TYPE={element}, ELSET=E{kind}")
        members = np.flatnonzero(index.ravel() == kind)
        lines += [f"{t + 1},{','.join(map(str, space.elements[t] + 1))}" for t in members]
        lines += [f"*MATERIAL, NAME=M{kind}", "*ELASTIC", f"{E:.12e},{nu:.12e}"]
        lines += ["*DENSITY", f"{rho:.12e}", f"*SOLID SECTION, ELSET=E{kind}, MATERIAL=M{kind}"]
    for name, ids in {
        "HELD": np.flatnonzero(case.held_nodes(space)),
        "TIP": np.flatnonzero(case.probe),
    }.items():
        lines += [f"*NSET, NSET={name}", *(str(i + 1) for i in ids)]
    lines += ["*BOUNDARY", "HELD,1,3", "*STEP", f"*STATIC{solver}", "*DLOAD"]
    down = ",".join(f"{-d:g}" for d in case.direction)
    lines += [f"E{kind},GRAV,{STRENGTH_OF_GRAVITY:.17g},{down}" for kind in range(len(kinds))]
    return "\n".join([*lines, "*NODE PRINT, NSET=TIP", "U", "*END STEP", ""])


PEERS = {
    "pyamg": pyamg,
    "scikit-fem": scikit_fem,
    "pardiso": pardiso,
    "dolfinx": dolfinx,
    "dolfinx-gamg": dolfinx_gamg,
    "calculix": calculix,
    "calculix-iterative": calculix_iterative,
}
MODULES = {"pyamg": ["pyamg"], "scikit-fem": ["skfem", "pyamg"], "pardiso": ["pypardiso"]}


def missing(tool: str) -> str | None:
    """Why the peer ``tool`` cannot run here, or None."""
    if tool not in PEERS:
        return f"no adapter: have {sorted(PEERS)}"
    if tool.startswith("calculix"):
        return None if shutil.which("ccx") else "apt-get install calculix-ccx"
    if tool.startswith("dolfinx"):
        command = [SYSTEM_PYTHON, "-c", "import dolfinx"]
        found = (
            shutil.which(SYSTEM_PYTHON)
            and not subprocess.run(command, capture_output=True, check=False).returncode
        )
        return None if found else "apt-get install python3-dolfinx"
    absent = [m for m in MODULES[tool] if importlib.util.find_spec(m) is None]
    return f"pip install {' '.join(absent)}" if absent else None
