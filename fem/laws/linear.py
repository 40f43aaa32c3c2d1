# type: ignore  (warp code: its types are warp's, not Python's)
"""Hooke's law of small strains: W = mu |e|^2 + lam/2 (tr e)^2 with e = (H + H^T) / 2."""

import warp as wp

from .law import ElasticLaw

wp.set_module_options({"enable_backward": False, "max_unroll": 4})


@wp.func
def energy_and_stress(H: wp.mat33d, lam: wp.float64, mu: wp.float64):
    """Stress lam (tr e) I + 2 mu e."""
    sigma = lam * wp.trace(H) * wp.identity(n=3, dtype=wp.float64) + mu * (H + wp.transpose(H))
    return wp.float64(0.5) * wp.ddot(sigma, H), sigma


@wp.func
def stiffness_block(p: wp.vec3d, q: wp.vec3d, lam: wp.float64, mu: wp.float64) -> wp.mat33d:
    """Lam p q^T + mu (q p^T + (p . q) I): the second derivative along shape gradients p and q."""
    d = mu * wp.dot(p, q)
    return wp.mat33d(
        (lam + mu) * p[0] * q[0] + d,
        lam * p[0] * q[1] + mu * q[0] * p[1],
        lam * p[0] * q[2] + mu * q[0] * p[2],
        lam * p[1] * q[0] + mu * q[1] * p[0],
        (lam + mu) * p[1] * q[1] + d,
        lam * p[1] * q[2] + mu * q[1] * p[2],
        lam * p[2] * q[0] + mu * q[2] * p[0],
        lam * p[2] * q[1] + mu * q[2] * p[1],
        (lam + mu) * p[2] * q[2] + d,
    )


LINEAR = ElasticLaw(
    title="linear",
    energy_and_stress=energy_and_stress,
    stiffness_block=stiffness_block,
    finite=False,
)
