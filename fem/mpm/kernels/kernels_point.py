# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernel of material points without a grid: what a class answers to a history of F."""

from functools import cache
from typing import Any

import warp as wp

from ..classes import Form, MaterialClass
from .kernels_laws import law_function


@cache
def point_kernel(kind: MaterialClass, real: Any, form: Form = Form.PLAIN) -> Any:
    """Kernel of a class without a grid: F, q -> F, q and tau of every point, of one substance."""
    vec3 = wp.types.vector(length=3, dtype=real)
    mat33 = wp.types.matrix(shape=(3, 3), dtype=real)
    law = law_function(kind, real, form)

    @wp.kernel(module="unique", enable_backward=False)
    def respond(
        H: wp.array(dtype=mat33),
        C: mat33,
        mu: real,
        lam: real,
        k: vec3,
        q: wp.array(dtype=real),
        dt: real,
        tau: wp.array(dtype=mat33),
    ):
        p = wp.tid()
        H_new, stress, state = law(H[p], C, mu, lam, k, q[p], dt)
        H[p] = H_new
        q[p] = state
        tau[p] = stress

    return respond
