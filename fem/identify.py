"""Moduli of a reduced body fitted to a motion that another solver, or a camera, has made.

Least squares on displacements by a trust region. The derivative of a path is one more linear step
with the Hessian that the step itself ended with (forward sensitivities): no adjoint pays for one or
two parameters. What a motion says of E and of nu is nearly one number, so that the scale of E is
fitted alone unless nu is asked for.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float

from .device import single_threaded
from .errors import ConvergenceError, InputError
from .laws.law import Law
from .material import lame_parameters
from .note import Note
from .reduced.elasticity import ReducedElasticity, solve_dense
from .reduced.model import ReducedModel
from .reduced.motion import ReducedDynamics
from .solve.schemes import Kinematics, Scheme, Step

# Usual change of log E and of nu, the share of it at which the fit ends, and most motions.
SCALE, ENOUGH, MOST = np.array([1.0, 0.1]), 1e-6, 50
# Poisson's ratio is kept between these.
NU_LOW, NU_HIGH = 0.0, 0.495
# Beyond this misfit nu is not told: ten handles, 1.4 % off, gave .28 where it was .35.
NU_MISFIT = 0.01
# Residual of a step: its path must be known better than what the fit compares.
TOLERANCE = 1e-8
# Change of nu that the derivative of the moduli is taken by.
DNU = 1e-6


@dataclass(frozen=True, kw_only=True)
class MotionFit:
    """A reduced body fitted to a motion.

    scale: What E of all cells is multiplied by [1].
    nu: Poisson's ratio [1] of all cells, where it was fitted; else None.
    error: Root mean square of the displacement's error over that of the motion, by mass [1].
    unfitted_error: The same with the moduli as they were.
    outside: Fraction of the motion [1], in the same norm, that the coordinates cannot follow
        whatever the moduli.
    frequency_ratio: First frequency of the reduced body over that of the full one of the same
        moduli, with quadratic elements where that is known: away from one the model locks, and the
        fit makes up for it with wrong moduli.
    covariance: Of (log E, nu), or of (log E), shape (parameters, parameters), as if the misfit were
        noise: what the model itself has wrong is not in it, and may be far more.
    scheme: Time integration that was fitted with.
    runs: How many motions it took.
    """

    scale: float
    nu: float | None
    error: float
    unfitted_error: float
    outside: float
    frequency_ratio: float
    covariance: np.ndarray
    scheme: Scheme
    runs: int

    @property
    def deviation(self) -> np.ndarray:
        """Standard deviation of log E, and of nu."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self) -> float:
        """Correlation of log E and nu; NaN of one parameter."""
        if len(self.covariance) < 2:
            return np.nan
        return float(self.covariance[0, 1] / np.prod(self.deviation))


@dataclass(frozen=True, eq=False, kw_only=True)
class ObservedMotion:
    """What a body did: ``displacement`` (frames, points, 3) [m] every ``dt`` [s], from rest on.

    ``load`` (dofs,) [N/sqrt(kg)] acts on it all the time, ``velocity`` (dofs,) [m sqrt(kg)/s] is
    what it starts with.
    """

    displacement: Float[np.ndarray, "frames points 3"]
    dt: float
    load: Float[np.ndarray, "dofs"]
    velocity: Float[np.ndarray, "dofs"]


@single_threaded
def fit_motion(
    model: ReducedModel,
    observed: ObservedMotion,
    *,
    with_nu: bool = False,
    scheme: Scheme = Scheme.BDF2,
    law: str = Law.NEO_HOOKEAN,
) -> MotionFit:
    """Scale of E, and nu on request, that bring the model's motion nearest to the observed one.

    The distance is that of the displacement at the points, in the norm of their mass, but for what
    lies outside the span. ``scheme`` should be what the motion was made with.

    Raises InputError: Where the motion is empty or of another mesh.
    Raises ConvergenceError: Where a step fails, or the moduli do not settle.
    """
    from scipy.optimize import least_squares

    u = observed.displacement
    if len(u) < 3 or u.shape[1] != model.vertices or not np.abs(u[1:]).max() > 0:
        raise InputError(
            "identify.motion_frames", count=len(u), shape=u.shape[1], vertices=model.vertices
        )
    root = np.sqrt(model.mass[: model.vertices]).repeat(3)
    span, seen = np.linalg.qr(root[:, None] * model.basis[: model.vertices].reshape(len(root), -1))
    moved = root * u[1:].reshape(-1, len(root))
    target, size = moved @ span, float(np.linalg.norm(moved))
    outside = max(0.0, 1 - float((target**2).sum()) / size**2)

    def misfit(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Difference of the paths (n,) [1] at the moduli ``p``, and its derivative."""
        nu = model.nu if len(p) < 2 else np.full_like(model.nu, p[1])
        body = ReducedDynamics(
            model.with_moduli(model.E * np.exp(p[0]), nu),
            load=observed.load,
            velocity=observed.velocity,
            law=law,
            scheme=scheme,
            tolerance=TOLERANCE,
        )
        still = np.zeros((model.dofs, len(p)))
        now, before = Kinematics(still, still, still), None  # at rest no modulus makes a force
        path, derivative = [], []
        for _ in range(len(u) - 1):
            body.advance(observed.dt)
            if body.last_dt != observed.dt:
                raise ConvergenceError("identify.step_fit")
            step = Step.of(scheme, observed.dt, now, before)
            K = body.elasticity.tangent(body.now.u)
            K.flat[:: len(K) + 1] += step.factor
            push = step.factor * step.target - moduli_forces(body.elasticity, body.now.u, len(p))
            now, before = step.ended(solve_dense(K, push)), now
            path.append(body.now.u)
            derivative.append(now.u)
        difference = (np.stack(path) @ seen.T - target).ravel()
        return difference / size, (seen @ np.stack(derivative)).reshape(-1, len(p)) / size

    known = lru_cache(maxsize=None)(lambda p: misfit(np.array(p)))  # the path brings its derivative
    starts, limits = [0.0], np.array([[-np.inf, NU_LOW], [np.inf, NU_HIGH]])
    if with_nu:
        starts.append(float(np.average(model.nu, weights=model.weights)))
    p, runs = np.zeros(0), 0
    for start in starts:  # E first, for both at once go along a curved valley for long
        p = np.append(p, start)
        found = least_squares(
            lambda p: known(tuple(p))[0],
            p,
            lambda p: known(tuple(p))[1],
            bounds=limits[:, : len(p)],
            method="dogbox",  # a nu that meets its limit is at it
            x_scale=SCALE[: len(p)],
            ftol=ENOUGH**2,
            xtol=ENOUGH,
            gtol=ENOUGH**2,
            max_nfev=MOST,
        )
        if found.status == 0:
            raise ConvergenceError("identify.fit_settle", most=MOST)
        p, runs = found.x, runs + found.nfev
    J, error = found.jac, float(np.linalg.norm(found.fun))
    first = float(np.linalg.norm(known((0.0,))[0]))
    noise = error**2 / max(len(J) - len(p), 1)
    return MotionFit(
        scale=float(np.exp(p[0])),
        nu=float(p[1]) if with_nu else None,
        error=float(np.sqrt(error**2 + outside)),
        unfitted_error=float(np.sqrt(first**2 + outside)),
        outside=float(np.sqrt(outside)),
        frequency_ratio=model.accuracy.best_frequency,
        covariance=noise * np.linalg.inv(J.T @ J),
        scheme=scheme,
        runs=runs,
    )


def fit_warnings(fit: MotionFit) -> tuple[str, ...]:
    """What to say where a fit is not what it looks like."""
    if fit.nu is None:
        return ()
    if not NU_LOW < fit.nu < NU_HIGH:
        return (Note("identify.nu_ended", nu=fit.nu),)
    if fit.error > NU_MISFIT:
        return (Note("identify.nu_trusted", error=fit.error),)
    return ()


def moduli_forces(
    elasticity: ReducedElasticity, q: Float[np.ndarray, "dofs"], count: int = 2
) -> Float[np.ndarray, "dofs _"]:
    """Derivatives of the elastic force [N/sqrt(kg)] by log E, and by nu if ``count`` is 2.

    Stress is linear in the Lame parameters: their derivatives take their place.
    """
    model = elasticity.model
    ahead, behind = (lame_parameters(model.E, model.nu + s * DNU) for s in (0.5, -0.5))
    change = [(a - b) / DNU for a, b in zip(ahead, behind, strict=True)]
    moduli = (model.lame, change)[:count]
    return np.stack([elasticity.force_with(q, *pair) for pair in moduli], axis=1)
