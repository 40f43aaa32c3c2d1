"""One material point without a grid, driven through a history of F."""

import numpy as np
import warp as wp
from autophyx_tet.fem.device import start_warp
from autophyx_tet.fem.material import lame_parameters
from autophyx_tet.fem.mpm.kernels_transfer import class_laws

EYE = np.eye(3)


def shear(g):
    return EYE + g * np.outer(EYE[0], EYE[1])


def point_kernel(kind, form):
    """Kernel of a class without a grid: H, q -> H, q and tau of every point."""
    law = class_laws(wp.float64)[kind, form]

    @wp.kernel(module="unique", enable_backward=False)
    def respond(
        H: wp.array(dtype=wp.mat33d),
        C: wp.mat33d,
        mu: wp.float64,
        lam: wp.float64,
        k: wp.vec3d,
        q: wp.array(dtype=wp.float64),
        dt: wp.float64,
        tau: wp.array(dtype=wp.mat33d),
    ):
        p = wp.tid()
        H_new, stress, state = law(H[p], C, mu, lam, k, q[p], dt)
        H[p] = H_new
        q[p] = state
        tau[p] = stress

    return respond


def driven(substance, path, *, E, nu, steps, time=1.0, turn=None, numbers=None):
    """Kirchhoff stress after every step, last H and state, of F = ``path(t)`` @ (turned) I.

    ``turn`` is a rotation of the frame: F becomes turn @ F, with the same material. ``numbers`` are
    those of the class where its substance does not know them.
    """
    start_warp()
    lam, mu = map(float, lame_parameters(E, nu))
    kernel = point_kernel(substance.kind, substance.form)
    numbers = wp.vec3d(*(numbers or substance.numbers(lam + 2 * mu / 3)))
    turn = EYE if turn is None else turn
    H = wp.array((turn @ path(0.0) - EYE)[None], dtype=wp.mat33d)
    q = wp.full(1, substance.state, dtype=wp.float64)
    tau = wp.zeros(1, dtype=wp.mat33d)
    before, dt, found = path(0.0), time / steps, []
    for i in range(1, steps + 1):
        after = path(i * dt)
        step = turn @ after @ np.linalg.inv(before) @ turn.T
        rate = (step - EYE) / dt
        H.assign((step @ (H.numpy()[0] + EYE) - EYE)[None])
        wp.launch(kernel, 1, [H, wp.mat33d(rate), mu, lam, numbers, q, dt, tau])
        found.append(tau.numpy()[0].copy())
        before = after
    return np.array(found), H.numpy()[0], float(q.numpy()[0])


def deviator(tau):
    return tau - np.trace(tau) / 3 * EYE
