"""Sag of a clamped beam by dolfinx, from the files of ``export --for fenics``: run by its Python.

python3 fenics_beam.py FOLDER LOADER ORDER: displacements [m] at the corners go to FOLDER/found.npz.
"""

import sys

sys.path.insert(0, sys.argv[1])

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc
from petsc4py import PETSc

load = __import__(sys.argv[2]).load
mesh, _, fields = load()
V = fem.VectorFunctionSpace(mesh, ("Lagrange", int(sys.argv[3])))
u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
E, nu, rho = (fields[name] for name in ("E", "nu", "rho"))


def strain(w):
    return ufl.sym(ufl.grad(w))


def isotropic(e):
    lam, mu = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
    return lam * ufl.tr(e) * ufl.Identity(3) + 2 * mu * e


def grained(e):
    """Stress of wood: Hooke's law along its axes L, R, T, by the inverse of its compliance."""
    Q = fields["grain_axes"]
    E_L, E_R, E_T, nu_LR, nu_LT, nu_RT, G_LR, G_LT, G_RT = (
        fields[name] for name in "E_L E_R E_T nu_LR nu_LT nu_RT G_LR G_LT G_RT".split()
    )
    soft = ufl.as_matrix([
        [1 / E_L, -nu_LR / E_L, -nu_LT / E_L],
        [-nu_LR / E_L, 1 / E_R, -nu_RT / E_R],
        [-nu_LT / E_L, -nu_RT / E_R, 1 / E_T],
    ])  # fmt: skip
    e = Q * e * Q.T
    normal = ufl.inv(soft) * ufl.as_vector([e[i, i] for i in range(3)])
    shear = (2 * G_LR * e[0, 1], 2 * G_LT * e[0, 2], 2 * G_RT * e[1, 2])
    stress = ufl.as_matrix([
        [normal[0], shear[0], shear[1]],
        [shear[0], normal[1], shear[2]],
        [shear[1], shear[2], normal[2]],
    ])  # fmt: skip
    return Q.T * stress * Q


def stress(e):
    if "grain_axes" not in fields:
        return isotropic(e)
    return ufl.conditional(ufl.gt(fields["E_L"], 0), grained(e), isotropic(e))


held = np.flatnonzero(np.isclose(V.tabulate_dof_coordinates()[:, 0], 0))
problem = petsc.LinearProblem(
    ufl.inner(stress(strain(u)), strain(v)) * ufl.dx,
    -9.81 * rho * v[2] * ufl.dx,
    bcs=[fem.dirichletbc(np.zeros(3), held.astype(np.int32), V)],
    petsc_options={"ksp_type": "preonly", "pc_type": "lu"},
)
found = problem.solve()
assert problem.solver.getConvergedReason() > 0, PETSc.Error
np.savez(
    f"{sys.argv[1]}/found.npz",
    points=V.tabulate_dof_coordinates(),
    displacement=found.x.array.reshape(-1, 3),
)
