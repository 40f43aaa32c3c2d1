"""Energy, force and tangent of an elastic law on a discretised body."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ..device import start_warp
from ..laws.law import LAWS, Law
from ..material import (
    ElementMaterial,
    LameParameters,
    isotropic_part,
    isotropic_tensor,
    mandel_tensor,
    mandel_vector,
)
from ..scene.supports import Supports
from .assembly import BlockMatrix, Discretisation, apply_supports, linear_stiffness, stiffness


class Response(NamedTuple):
    """Elastic ``energy`` W [J] and its gradient, the ``force`` [N] (nodes, 3) of resistance."""

    energy: float
    force: np.ndarray


class ElasticBody:
    """Elastic energy W(u) of a body, its gradient and its second derivative.

    A grain adds its own to a finite law: what its stiffness tensor has beyond an isotropic one
    below it acts on Green's strain, so that small strains see the tensor and turns cost nothing.

    grid: The discretised mesh.
    material: E, nu, rho of every tet, and its stiffness tensor where it has a grain.
    law: Name of the elastic law, one of ``LAWS``.
    """

    def __init__(self, grid: Discretisation, material: ElementMaterial, law: str) -> None:
        start_warp()
        from .kernels_elastic import elastic_kernels

        self.grid, self.law, self.material = grid, law, material
        self._law, self._kernels = LAWS[law], elastic_kernels(LAWS[law])
        # Tensors of what the law does not know, and the Lame parameters that it takes
        self._tensor, lame = None, material.lame
        if material.tensor is not None:
            from .kernels_elastic import mat66d

            zero = LameParameters(*np.zeros((2, len(material.E))))
            lame = isotropic_part(material) if self._law.finite else zero
            beyond = material.tensor - isotropic_tensor(*lame)
            self._tensor = start_warp().array(beyond, dtype=mat66d, device=grid.device)
        self._arrays = [grid.tets, *grid.constants(*lame)]

    def _launch(self, kernel: Any, inputs: list, rows: int = 1) -> None:
        """Launch ``rows`` threads a tet."""
        size = rows * len(self.grid.space.elements)
        start_warp().launch(kernel, size, inputs=inputs, device=self.grid.device)

    def response(self, u: Float[np.ndarray, "nodes 3"]) -> Response:
        """Energy and force at the displacement ``u`` [m]."""
        energy, force = self.responses(u)
        # On a GPU the sum is made there: one number comes back.
        on_gpu = energy.device.is_cuda
        total = start_warp().utils.array_sum(energy) if on_gpu else energy.numpy().sum()
        return Response(float(total), force.numpy())

    def energies(self, u: Float[np.ndarray, "nodes 3"]) -> Float[np.ndarray, "tets"]:
        """Energy [J] of every tet at the displacement ``u`` [m]."""
        return self.responses(u)[0].numpy()

    def responses(self, u: Any) -> tuple[Any, Any]:
        """Device arrays of the energy of every tet and of the force on every node."""
        wp = start_warp()
        field = self.grid.array(u)
        energy = wp.zeros(len(self.grid.space.elements), dtype=wp.float64, device=self.grid.device)
        force = wp.zeros_like(field)
        if self._tensor is None or self._law.finite:
            self._launch(self._kernels.energy_and_force, [*self._arrays, field, energy, force])
        if self._tensor is not None:
            from . import kernels_elastic as k

            inputs = [*self._arrays, self._tensor, self._law.finite, 1.0, field, None, False]
            self._launch(k.tensor_response, [*inputs, energy, force])
        return energy, force

    def tangent(self, u: Any, *, projected: bool = False) -> BlockMatrix:
        """Second derivative of W [N/m] at ``u`` [m], (nodes, 3) or a ``DeviceVector``.

        That of the linear law is the same for every ``u``. ``projected``: no tet has a negative
        part. Where the law offers one of the two only, that is what it gives.
        """
        wp = start_warp()
        pattern, arrays = self.grid.pattern, self._arrays
        values = wp.zeros(pattern.columns.shape[0], dtype=wp.mat33d, device=self.grid.device)
        if self._tensor is not None:
            from . import kernels_elastic as k

            if not self._law.finite:
                return linear_stiffness(self.grid, self.material)
            inputs = [*arrays, self._tensor, True, 1.0, self.grid.array(u), None, projected]
            self._launch(k.tensor_tangent, [*inputs, pattern.slots, values])
        kernels, p1, rows = self._kernels, self.grid.space.order == 1, 1
        if kernels.stiffness_p1:
            kernel, rows = (kernels.stiffness_p1, 1) if p1 else (kernels.stiffness_p2, 10)
        else:
            arrays, kernel = [*arrays, self.grid.array(u)], kernels.exact
            if kernels.projected and (projected or not kernels.exact):
                kernel = kernels.projected
            elif self._law.tangent_p1 and p1:
                kernel = self._law.tangent_p1
        self._launch(kernel, [*arrays, pattern.slots, values], rows)
        return BlockMatrix(pattern.rows, pattern.columns, values)


# Stiffnesses of the last bodies: a rest, its buckling and its vibrations have the same one, and
# linear elements come between.
_RECENT_STIFFNESS: list[tuple[ElasticBody, Supports, BlockMatrix]] = []
_KEPT_STIFFNESS = 2


def constrained_stiffness(body: ElasticBody, held: Supports) -> BlockMatrix:
    """Stiffness [N/m] of a body by linear elasticity, with the supports of its nodes.

    It may be one that was kept: nobody may change it.
    """
    for kept, supports, matrix in _RECENT_STIFFNESS:
        one, other = kept.material, body.material
        pairs = [(getattr(one, name), getattr(other, name)) for name in ("E", "nu", "tensor")]
        pairs += [(supports.fixed, held.fixed), (supports.springs, held.springs)]
        if kept.grid is body.grid and all(a is b or np.array_equal(a, b) for a, b in pairs):
            return matrix  # whatever it weighs, and wherever it is held
    matrix = linear_stiffness(body.grid, body.material)
    apply_supports(matrix, held.fixed, held.springs)
    return matrix


def keep_stiffness(body: ElasticBody, held: Supports, matrix: BlockMatrix) -> None:
    """Keep a ``constrained_stiffness`` for its next call."""
    if not any(kept is matrix for *_, kept in _RECENT_STIFFNESS):
        _RECENT_STIFFNESS.insert(0, (body, held, matrix))
        del _RECENT_STIFFNESS[_KEPT_STIFFNESS:]


class StrainAndStress(NamedTuple):
    """Strain [1] and Cauchy stress [Pa], each (tets, 3, 3)."""

    strain: np.ndarray
    stress: np.ndarray


def von_mises(stress: Float[np.ndarray, "*n 3 3"]) -> Float[np.ndarray, "*n"]:
    """Von Mises stress sqrt(3/2 s : s) with s the deviator of ``stress``.

    Parameters
    ----------
    stress
        Cauchy stress [Pa], shape (..., 3, 3).

    Returns
    -------
    array
        Von Mises stress [Pa], shape (...).

    Examples
    --------
    >>> import numpy as np
    >>> from autophyx_tet.fem import von_mises
    >>> von_mises(np.diag([2e6, 0.0, 0.0])[None]).round(3)  # of a bar that is pulled: its stress
    array([2000000.])
    """
    mean = np.trace(stress, axis1=-2, axis2=-1) / 3
    s = stress - mean[..., None, None] * np.eye(3)
    return np.sqrt(1.5 * np.einsum("...ij,...ij->...", s, s))


def energy_and_piola(
    law: str, H: Float[np.ndarray, "*n 3 3"], lame: LameParameters
) -> tuple[Float[np.ndarray, "*n"], Float[np.ndarray, "*n 3 3"]]:
    """Energy [J/m^3] and first Piola stress [Pa] of ``H``; both are linear in ``lame`` [Pa].

    The Lame parameters broadcast against the leading axes of ``H``. Evaluated on the CPU by the
    functions that the kernels of elements are made of.
    """
    wp = start_warp()
    from .kernels_elastic import elastic_kernels

    leading = H.shape[:-2]
    moduli = [np.broadcast_to(m, leading).astype(float).ravel() for m in lame]
    gradients = wp.array(np.ascontiguousarray(H.reshape(-1, 3, 3)), dtype=wp.mat33d, device="cpu")
    W, P = wp.empty(len(gradients), dtype=wp.float64, device="cpu"), wp.empty_like(gradients)
    inputs = [gradients, *(wp.array(m, dtype=wp.float64, device="cpu") for m in moduli), W, P]
    wp.launch(elastic_kernels(LAWS[law]).stress, len(gradients), inputs=inputs, device="cpu")
    return W.numpy().reshape(leading), P.numpy().reshape(H.shape)


def first_piola(
    law: str, H: Float[np.ndarray, "*n 3 3"], lame: LameParameters
) -> Float[np.ndarray, "*n 3 3"]:
    """First Piola stress [Pa] of the displacement gradient ``H``."""
    return energy_and_piola(law, H, lame)[1]


def linear_stress(
    H: Float[np.ndarray, "tets n 3 3"], material: ElementMaterial
) -> Float[np.ndarray, "tets n 3 3"]:
    """Stress [Pa] of Hooke's law of displacement gradients, along the grain where there is one."""
    if material.tensor is None:
        return first_piola(Law.LINEAR, H, LameParameters(*(m[:, None] for m in material.lame)))
    strain = mandel_vector((H + H.swapaxes(-1, -2)) / 2)
    return mandel_tensor(np.einsum("tij,tnj->tni", material.tensor, strain))


def strain_and_stress(
    law: str, H: Float[np.ndarray, "tets 3 3"], material: ElementMaterial
) -> StrainAndStress:
    """Strain and stress of the displacement gradient ``H`` under the law of that name.

    Small strain under a law of small strains, Green's strain (F^T F - I) / 2 under a finite one.
    """
    small = (H + H.transpose(0, 2, 1)) / 2
    if not LAWS[law].finite:
        return StrainAndStress(small, linear_stress(H[:, None], material)[:, 0])
    F = H + np.eye(3)
    green = small + H.transpose(0, 2, 1) @ H / 2
    base = isotropic_part(material)
    P = first_piola(law, H, base)
    if material.tensor is not None:  # what the grain adds, as ``ElasticBody`` has it
        beyond = material.tensor - isotropic_tensor(*base)
        P = P + F @ mandel_tensor(np.einsum("tij,tj->ti", beyond, mandel_vector(green)))
    stress = P @ F.transpose(0, 2, 1) / np.linalg.det(F)[:, None, None]
    return StrainAndStress(green, stress)


def displacement_gradients(
    grid: Discretisation,
    u: Float[np.ndarray, "nodes 3"],
    barycentric: Float[np.ndarray, "points 4"],
) -> Float[np.ndarray, "tets points 3 3"]:
    """Gradient H = du_i/dx_j [1] of the displacement ``u`` [m] at points of every tet."""
    from . import kernels_field as k

    wp = start_warp()
    tets, device = len(grid.space.elements), grid.device
    out = wp.empty((tets, len(barycentric)), dtype=wp.mat33d, device=device)
    where, field = wp.array(barycentric, dtype=wp.vec4d, device=device), grid.array(u)
    inputs = [grid.tets, where, field, out]
    wp.launch(k.displacement_gradient, tets, inputs=inputs, device=device)
    return out.numpy()


def geometric_stiffness(grid: Discretisation, stress: Float[np.ndarray, "tets points 3 3"]) -> Any:
    """K_sigma [N/m] of ``stress`` [Pa] at the points of quadrature, of one direction: a csr_array.

    It is the same for every direction, shape (nodes, nodes).
    """
    from scipy.sparse import csr_array

    from . import kernels_field as k

    wp, pattern, count = start_warp(), grid.pattern, len(grid.space.nodes)
    stresses = wp.array(stress, dtype=wp.mat33d, device=grid.device)
    values = wp.zeros(pattern.columns.shape[0], dtype=wp.float64, device=grid.device)
    inputs = [grid.tets, stresses, pattern.slots, values]
    wp.launch(k.geometric_stiffness, len(stress), inputs=inputs, device=grid.device)
    arrays = (values.numpy(), pattern.columns.numpy(), pattern.rows.numpy())
    return csr_array(arrays, shape=(count, count))


def stress_stiffness(
    grid: Discretisation, stress: Float[np.ndarray, "tets points 3 3"]
) -> BlockMatrix:
    """What a ``stress`` [Pa] at the points of quadrature adds to a stiffness [N/m].

    K_sigma, and what it lacks of the mean stress p, which works by the change of volume, tr H +
    (tr H)^2 / 2 - tr(H^2) / 2, and not by Green's strain: p ((tr e)^2 - 2 |e|^2) of the strain e,
    as lam = p and mu = -p make it. It is small but where the pressure is of the size of mu:
    confined rubber would buckle by its squeeze alone.
    """
    pressure = np.trace(stress, axis1=2, axis2=3).mean(axis=1) / 3
    matrix = stiffness(grid, pressure, -pressure)
    values = matrix.values.numpy()
    values += geometric_stiffness(grid, stress).data[:, None, None] * np.eye(3)
    matrix.values.assign(values)
    return matrix
