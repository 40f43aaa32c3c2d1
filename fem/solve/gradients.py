"""Gradients of displacements with respect to E, nu and rho, by the adjoint method, for torch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..device import checked_device
from ..elements.assembly import Discretisation, discretise, node_supports, reduced_load, stiffness
from ..elements.elastic import displacement_gradients, first_piola
from ..elements.forces import mass_fractions
from ..elements.space import TET_POINTS, affordable_order, element_points, shape_functions
from ..errors import InputError
from ..laws.law import Law
from ..linalg.solver import solve_system
from ..material import ElementMaterial, LameParameters
from ..mesh import TetMesh
from ..scene.supports import Supports
from ..validation import checked_vector
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


Stress = Callable[[LameParameters], np.ndarray]


def _elastic_stress(grid: Discretisation, law: str, u: np.ndarray) -> Stress:
    """First Piola stress (tets, points, 3, 3) [Pa] of the displacement ``u`` [m] by the moduli."""
    H = displacement_gradients(grid, u, element_points(grid.space.order))
    return lambda lame: first_piola(law, H, lame)


def _by_moduli(
    grid: Discretisation,
    mesh: TetMesh,
    material: ElementMaterial,
    stress: Stress,
    adjoint: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives by E and nu of -adjoint . force of a ``stress`` that is linear in the moduli."""
    where = element_points(grid.space.order)
    along = displacement_gradients(grid, adjoint, where)
    weight = mesh.volumes / len(where)

    def work(lame: LameParameters) -> np.ndarray:
        return -weight * np.einsum("tqij,tqij->t", along, stress(lame))

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
        def backward(context: Any, *outer: torch.Tensor) -> tuple[torch.Tensor, ...]:  # type: ignore
            loss = outer[0].detach().cpu().double().numpy()
            return tuple(torch.from_numpy(g).to(outer[0]) for g in backward(loss))

    result = Displacement.apply(*tensors)
    assert isinstance(result, torch.Tensor)
    return result


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
    """Displacement of the linear static solve, differentiable by E, nu and rho.

    The backward pass is one more solve with the same matrix.

    Parameters
    ----------
    mesh, supports, gravity_vector, order, tolerance, device, loads
        As in ``solve_static``: metres, m/s^2, N/m^3, Pa and N.
    E, nu, rho
        Young's modulus [Pa], Poisson's ratio [1] and density [kg/m^3], tensors of shape (tets,).

    Returns
    -------
    torch.Tensor
        Displacement [m], shape (nodes, 3).

    Raises
    ------
    InputError
        Where the material of ``mesh`` has a grain.

    Examples
    --------
    >>> import torch
    >>> from autophyx_tet.fem import Supports, box_mesh, static_displacement
    >>> block = box_mesh((1, 1, 1), (1, 1, 1))
    >>> held = Supports.clamp(8, block.points[:, 2] == 0)
    >>> E, nu, rho = (torch.full((6,), value).double() for value in (1e6, 0.3, 1e3))
    >>> u = static_displacement(block, held, E.requires_grad_(), nu, rho, gravity_vector=(0, 0, -9))
    >>> u[:, 2].sum().backward()
    >>> round(float((E.grad @ E) / u[:, 2].sum()), 6)  # u goes as 1 / E: E du/dE = -u
    -1.0
    """
    if mesh.material is not None and mesh.material.tensor is not None:
        raise InputError("gradients.material_grain")
    grid = discretise(mesh, order or affordable_order(mesh), checked_device(device))
    held = node_supports(supports, grid.space)
    kept: dict[str, Any] = {}

    def forward(material: ElementMaterial) -> np.ndarray:
        body = mesh.with_material(material)
        options = {"order": grid.space.order, "tolerance": tolerance, "device": device}
        known: dict[str, Any] = {"gravity_vector": gravity_vector, **options, **loads}
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
        stress = _elastic_stress(grid, Law.LINEAR, u)
        by_E, by_nu = _by_moduli(grid, mesh, material, stress, adjoint)
        fraction = shape_functions(grid.space.order, TET_POINTS).mean(axis=0)
        lifted = np.einsum("i,tid->td", fraction, adjoint[grid.space.elements])
        return MaterialGradient(by_E, by_nu, mesh.volumes * (lifted @ np.asarray(gravity_vector)))

    return _function(forward, backward, (E, nu, rho))


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
    """Displacement after one implicit step, differentiable by E, nu and rho.

    Parameters
    ----------
    make
        Builds the ``Dynamics`` of a mesh with material, with this ``gravity_vector`` and a tight
        tolerance, in any scheme and with any damping.
    mesh
        Tets [m].
    E, nu, rho
        Young's modulus [Pa], Poisson's ratio [1] and density [kg/m^3], tensors of shape (tets,).
    gravity_vector
        Acceleration of gravity [m/s^2], shape (3,).
    dt
        The step [s].

    Returns
    -------
    torch.Tensor
        Displacement [m], shape (nodes, 3).

    Raises
    ------
    InputError
        With obstacles (their barrier and friction depend on E), or where the step was halved.

    Examples
    --------
    >>> import torch
    >>> from autophyx_tet.fem import Dynamics, box_mesh, implicit_step
    >>> g = (0.0, 0.0, -10.0)
    >>> E, nu, rho = (torch.full((6,), value).double() for value in (1e6, 0.3, 1e3))
    >>> block, free = box_mesh((1, 1, 1), (1, 1, 1)), lambda mesh: Dynamics(mesh, gravity_vector=g)
    >>> u = implicit_step(free, block, E, nu, rho, gravity_vector=g, dt=0.1)
    >>> round(float(u[0, 2]), 9)  # m: implicit Euler falls by g dt^2
    -0.1
    """
    gravity = checked_vector("gravity_vector", gravity_vector, "m/s^2")
    kept: dict[str, Any] = {}

    def forward(material: ElementMaterial) -> np.ndarray:
        body = make(mesh.with_material(material))
        if body.contact.obstacles:
            raise InputError("gradients.step_obstacles")
        kept.update(body=body, material=material)
        state = body.step(dt)
        if state.barrier > 0:
            raise InputError("gradients.body_touches")
        u = state.u
        if body.last_step is None or body.last_step.dt != dt:
            raise InputError("gradients.step_halved", dt=dt)
        return u

    def backward(outer: np.ndarray) -> MaterialGradient:
        body, material = kept["body"], kept["material"]
        u, step = body.state.u, body.last_step
        start, law, grid = step.now, body.body.law, body.body.grid
        twice = step.scheme is Scheme.TRAPEZOIDAL  # it has the forces of both ends
        loss = np.where(body.held.fixed, 0.0, outer)
        adjoint = np.where(body.held.fixed, 0.0, body.solve_adjoint(step, u, loss))
        stresses = [_elastic_stress(grid, law, x) for x in ((u, start.u) if twice else (u,))]
        pull = (2 if twice else 1) * gravity - step.factor * (u - start.u - dt * start.v)
        if body.damping:
            speed = (u - start.u) / dt + (start.v if twice else 0.0)
            pull = pull - body.damping.alpha * speed
            stresses += body.damping.stresses(u, start.u, start.v if twice else None, dt)
        work = (adjoint * pull).sum(axis=1)[grid.space.elements]
        by_rho = mesh.volumes * (work @ mass_fractions(grid.space.order))
        by = [_by_moduli(grid, mesh, material, stress, adjoint) for stress in stresses]
        by_E, by_nu = np.sum(by, axis=0)
        return MaterialGradient(by_E, by_nu, by_rho)

    return _function(forward, backward, (E, nu, rho))
