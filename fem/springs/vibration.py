"""Natural frequencies of a network at rest: what tells how stiff it is, without a motion."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from ..errors import InputError
from .network import SpringNetwork

# Free bodies: rigid motions, and the shift [share of the mean square of the frequencies] that makes
# their matrix regular.
RIGID, SHIFT = 6, 1e-9


def network_frequencies(
    network: SpringNetwork, stiffness: Float[np.ndarray, "springs"], count: int = 1
) -> Float[np.ndarray, "count"]:
    """First ``count`` natural frequencies [Hz] with springs of ``stiffness`` [N/m], rising.

    Without anything held, the six rigid motions are left out.
    """
    from scipy.sparse import csc_array, diags_array, eye_array
    from scipy.sparse.linalg import LinearOperator, eigsh, splu

    anchors = network.anchors
    free = np.flatnonzero(~anchors.fixed.ravel() & (anchors.mass > 0).repeat(3))
    skipped = 0 if anchors.fixed.any() else RIGID
    if count + skipped >= len(free):
        raise InputError(f"{count} frequencies of {len(free)} unknowns: wanted fewer")
    root = diags_array(1 / np.sqrt(anchors.mass.repeat(3)[free]))
    scaled = root @ network.matrix(stiffness)[free][:, free] @ root
    shift = SHIFT * float(scaled.diagonal().mean())
    shifted = csc_array(scaled + shift * eye_array(len(free)))
    exact = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0}
    factor = splu(shifted, options={"SymmetricMode": True}, **exact)
    inverse = LinearOperator(shifted.shape, matvec=factor.solve, dtype=float)  # type: ignore
    start = np.random.default_rng(0).normal(size=len(free))
    found = eigsh(
        shifted, k=count + skipped, sigma=0.0, OPinv=inverse, v0=start, return_eigenvectors=False
    )
    square = np.sort(np.asarray(found))[skipped:] - shift
    return np.sqrt(np.maximum(square, 0.0)) / (2 * np.pi)
