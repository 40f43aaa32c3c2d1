"""Gradients of displacements with respect to E, nu and rho, by the adjoint method, for torch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..deprecation import renamed_options
from ..device import checked_device
from ..discrete.assembly import Discretisation, discretise, stiffness
from ..discrete.constraints import node_supports, reduced_load
from ..discrete.mass import mass_shares
from ..discrete.quadrature import TET_POINTS, element_points
from ..discrete.space import shape_functions
from ..discrete.strain import displacement_gradients, first_piola
from ..errors import InputError
from ..laws.law import Law
from ..linalg.solver import solve_system
from ..scene.material import ElementMaterial, LameParameters
from ..scene.mesh import TetMesh
from ..scene.supports import Supports
from ..validation import checked_vector
from .discretisation_error import affordable_order
from .dynamics import Dynamics
from .schemes import Scheme
from .statics import TOLERANCE, check_solution, solve_static

if TYPE_CHECKING:
    import torch


class MaterialGradient(NamedTuple):
    """Derivatives of a loss by ``E`` [1/Pa], ``nu`` [1] and ``rho`` [m^3/kg] of every tet."""

    E: np.ndarray
    nu: np.ndarray
    rho: np.ndarray


def _by_moduli(
    grid: Discretisation,
    mesh: TetMesh,
    material: ElementMaterial,
    law: str,
    u: np.ndarray,
    adjoint: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives by E and nu of -adjoint . internal force; P is linear in (lam, mu)."""
    where = element_points(grid.space.order)
    H = displacement_gradients(grid, u, where)
    along = displacement_gradients(grid, adjoint, where)
    weight = mesh.volumes / len(where)

    def work(lame: LameParameters) -> np.ndarray:
        return -weight * np.einsum("tqij,tqij->t", along, first_piola(law, H, lame))

    zero, one = np.zeros(()), np.ones(())
    by_lam, by_mu = work(LameParameters(one, zero)), work(LameParameters(zero, one))
    E, nu = material.E, material.nu
    lam, mu = material.lame
    # lam = E nu / ((1 + nu)(1 - 2 nu)), mu = E / 2 (1 + nu)
    lam_nu = E * (1 + 2 * nu**2) / ((1 + nu) * (1 - 2 * nu)) ** 2
    mu_nu = -mu / (1 + nu)
    return (by_lam * lam + by_mu * mu) / E, by_lam * lam_nu + by_mu * mu_nu


def _function(
    forward: Callable[[ElementMaterial], np.ndarray],
    backward: Callable[[np.ndarray], MaterialGradient],
    tensors: tuple[torch.Tensor, ...],
) -> torch.Tensor:
    """Wrap a solve and its adjoint, both in numpy, as one differentiable torch operation."""
    import torch

    class Displacement(torch.autograd.Function):
        @staticmethod
        def forward(context: Any, *fields: torch.Tensor) -> torch.Tensor:
            arrays = [f.detach().cpu().double().numpy() for f in fields]
            return torch.from_numpy(forward(ElementMaterial(*arrays))).to(fields[0])

        @staticmethod
        def backward(context: Any, *outer: torch.Tensor) -> tuple[torch.Tensor, ...]:
            given = outer[0].detach().cpu().double().numpy()
            return tuple(torch.from_numpy(g).to(outer[0]) for g in backward(given))

    result = Displacement.apply(*tensors)
    assert isinstance(result, torch.Tensor)
    return result


@renamed_options(gravity="gravity_vector")
def static_displacement(
    mesh: TetMesh,
    supports: Supports,
    E: torch.Tensor,
    nu: torch.Tensor,
    rho: torch.Tensor,
    *,
    gravity_vector: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
    order: int | None = None,
    tolerance: float = TOLERANCE,
    device: str = "cpu",
    **loads: Any,
) -> torch.Tensor:
    """Displacement [m] (nodes, 3) of the linear static solve, differentiable by E, nu and rho.

    ``E`` [Pa], ``nu`` [1] and ``rho`` [kg/m^3] have shape (tets,); the other arguments are those of
    ``solve_static``. The backward pass is one more solve with the same matrix.
    """
    grid = discretise(mesh, order or affordable_order(mesh), checked_device(device))
    held = node_supports(supports, grid.space)
    kept: dict[str, Any] = {}

    def forward(material: ElementMaterial) -> np.ndarray:
        body = mesh.with_material(material)
        options = {"order": grid.space.order, "tolerance": tolerance, "device": device}
        known = {"gravity_vector": gravity_vector, **options, **loads}
        u = solve_static(body, held, **known).node_displacement
        kept.update(material=material, u=u)
        return u

    def backward(outer: np.ndarray) -> MaterialGradient:
        material, u = kept["material"], kept["u"]
        matrix = stiffness(grid, *material.lame)
        rhs = reduced_load(matrix, outer.copy(), held, np.zeros_like(outer))
        nodes = grid.space.nodes
        known = {"points": nodes, "fixed": held.fixed, "edges": grid.space.edges}
        solution = solve_system(matrix, rhs, **known, tolerance=tolerance)
        check_solution(mesh, held, solution, tolerance)
        adjoint = np.where(held.fixed, 0.0, solution.x)
        by_E, by_nu = _by_moduli(grid, mesh, material, Law.LINEAR, u, adjoint)
        share = shape_functions(grid.space.order, TET_POINTS).mean(axis=0)
        lifted = np.einsum("i,tid->td", share, adjoint[grid.space.elements])
        return MaterialGradient(by_E, by_nu, mesh.volumes * (lifted @ np.asarray(gravity_vector)))

    return _function(forward, backward, (E, nu, rho))


@renamed_options(gravity="gravity_vector")
def implicit_step(
    make: Callable[[TetMesh], Dynamics],
    mesh: TetMesh,
    E: torch.Tensor,
    nu: torch.Tensor,
    rho: torch.Tensor,
    *,
    gravity_vector: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
    dt: float,
) -> torch.Tensor:
    """Displacement [m] (nodes, 3) after one implicit step, differentiable by E, nu and rho.

    ``make`` builds the ``Dynamics`` of a mesh with material, with this ``gravity_vector`` [m/s^2]
    and a tight tolerance, in any scheme and with any damping. ``dt`` [s] is the step.

    Raises
    ------
    InputError
        With obstacles (their barrier and friction depend on E), or where the step was halved.
    """
    gravity = checked_vector("gravity_vector", gravity_vector, "m/s^2")
    kept: dict[str, Any] = {}

    def forward(material: ElementMaterial) -> np.ndarray:
        body = make(mesh.with_material(material))
        if body.contact.obstacles:
            raise InputError("a step with obstacles has no gradient: wanted a body without contact")
        kept.update(body=body, material=material, start=body.state)
        u = body.step(dt).u
        if body.last_step != dt:
            raise InputError(f"the step of {dt:g} s was halved, so it has no gradient: take less")
        return u

    def backward(outer: np.ndarray) -> MaterialGradient:
        body, start, material = kept["body"], kept["start"], kept["material"]
        twice = body.scheme is Scheme.TRAPEZOIDAL  # it has the forces of both ends
        u, factor = body.state.u, (4 if twice else 1) / dt**2
        given = np.where(body.held.fixed, 0.0, outer)
        adjoint = np.where(body.held.fixed, 0.0, body.solve_adjoint(factor, u, given, dt))
        known, law = (body.body.grid, mesh, material), body.body.law
        by = [_by_moduli(*known, law, u, adjoint)]
        if twice:
            by.append(_by_moduli(*known, law, start.u, adjoint))
        ahead = u - start.u
        pull = (2 if twice else 1) * gravity - factor * (ahead - dt * start.v)
        if body.damping:
            speed = ahead / dt + (start.v if twice else 0.0)
            by.append(_by_moduli(*known, Law.LINEAR, body.damping.beta * speed, adjoint))
            pull = pull - body.damping.alpha * speed
        work = (adjoint * pull).sum(axis=1)[known[0].space.elements]
        by_rho = mesh.volumes * (work @ mass_shares(known[0].space.order))
        by_E, by_nu = np.sum(by, axis=0)
        return MaterialGradient(by_E, by_nu, by_rho)

    return _function(forward, backward, (E, nu, rho))
