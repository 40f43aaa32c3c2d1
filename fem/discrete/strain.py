"""Strain and stress of a displacement gradient, tensor by tensor."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from ..scene.material import ElementMaterial, LameParameters
from .elastic import Law


def von_mises(stress: Float[np.ndarray, "*n 3 3"]) -> Float[np.ndarray, "*n"]:
    """Von Mises stress sqrt(3/2 s : s) [Pa] with s the deviator of ``stress`` [Pa]."""
    mean = np.trace(stress, axis1=-2, axis2=-1) / 3
    s = stress - mean[..., None, None] * np.eye(3)
    return np.sqrt(1.5 * np.einsum("...ij,...ij->...", s, s))


def hooke(
    strain: Float[np.ndarray, "tets *q 3 3"], material: ElementMaterial
) -> Float[np.ndarray, "tets *q 3 3"]:
    """Stress lam tr(e) I + 2 mu e [Pa] of every tet; ``strain`` (tets, ..., 3, 3)."""
    lam, mu = (m.reshape(-1, *[1] * (strain.ndim - 1)) for m in material.lame)
    trace = np.trace(strain, axis1=-2, axis2=-1)[..., None, None]
    return lam * trace * np.eye(3) + 2 * mu * strain


def strain_and_stress(
    law: Law, H: Float[np.ndarray, "tets 3 3"], material: ElementMaterial
) -> tuple[np.ndarray, np.ndarray]:
    """Strain [1] and Cauchy stress [Pa] of the displacement gradient ``H``, each (tets, 3, 3).

    Small strain under the linear law, Green's strain (F^T F - I) / 2 under the others.
    """
    small = (H + H.transpose(0, 2, 1)) / 2
    if law is Law.LINEAR:
        return small, hooke(small, material)
    lame = LameParameters(*(m[:, None, None] for m in material.lame))
    F = H + np.eye(3)
    J = np.linalg.det(F)[:, None, None]
    stress = first_piola(law, F, lame) @ F.transpose(0, 2, 1) / J
    return small + H.transpose(0, 2, 1) @ H / 2, stress


def first_piola(
    law: Law, F: Float[np.ndarray, "*n 3 3"], lame: LameParameters
) -> Float[np.ndarray, "*n 3 3"]:
    """First Piola stress [Pa] of the deformation gradient ``F``; it is linear in ``lame`` [Pa].

    The Lame parameters broadcast against ``F``.
    """
    lam, mu = lame
    if law is Law.LINEAR:
        strain = (F + np.swapaxes(F, -1, -2)) / 2 - np.eye(3)
        trace = np.trace(strain, axis1=-2, axis2=-1)[..., None, None]
        return lam * trace * np.eye(3) + 2 * mu * strain
    if law is Law.COROTATED:
        U, _, Vt = np.linalg.svd(F)
        U[..., 2] *= np.sign(np.linalg.det(U @ Vt))[..., None]
        R = U @ Vt
        trace = np.einsum("...ij,...ij->...", R, F)[..., None, None] - 3
        return 2 * mu * (F - R) + lam * trace * R
    columns = [np.cross(F[..., (i + 1) % 3], F[..., (i + 2) % 3]) for i in range(3)]
    J = np.linalg.det(F)[..., None, None]
    return mu * F + ((lam + mu) * (J - 1) - mu) * np.stack(columns, axis=-1)
