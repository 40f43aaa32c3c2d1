"""Moduli of a reduced body fitted to a motion that another solver, or a camera, has made.

Least squares on displacements by Gauss & Newton. The derivative of a path is one more linear step
with the Hessian that the step itself ended with (forward sensitivities): no adjoint pays for one or
two parameters. What a motion says of E and of nu is nearly one number, so that the scale of E is
fitted alone unless nu is asked for.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

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

# Longest step of log E and of nu, where the fit ends, and most motions.
LONGEST, ENOUGH, MOST = np.array([1.2, 0.1]), 1e-6, 25
# A fit whose last step is longer than this after the most motions has not settled.
UNSETTLED = 1e-3
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
    u = observed.displacement
    if len(u) < 3 or u.shape[1] != model.vertices or not np.abs(u[1:]).max() > 0:
        raise InputError(
            "identify.motion_frames", count=len(u), shape=u.shape[1], vertices=model.vertices
        )
    root = np.sqrt(model.mass[: model.vertices]).repeat(3)
    span, seen = np.linalg.qr(root[:, None] * model.basis[: model.vertices].reshape(len(root), -1))
    moved = root * u[1:].reshape(-1, len(root))
    target, total = moved @ span, float((moved**2).sum())
    outside = max(0.0, 1 - float((target**2).sum()) / total)

    def misfit(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Difference of the paths (n,) [m sqrt(kg)] at the moduli ``p``, and its derivative."""
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
        return difference, (seen @ np.stack(derivative)).reshape(-1, len(p))

    start = np.array([0.0, float(np.average(model.nu, weights=model.weights))])[: 1 + with_nu]
    try:
        p, error, J, first, runs = _gauss_newton(misfit, start)
    except ConvergenceError:
        if not with_nu:
            raise  # with nu it may go along a curved valley for long: E first, nu from there
        near, _, _, first, more = _gauss_newton(misfit, start[:1])
        p, error, J, _, runs = _gauss_newton(misfit, np.append(near, start[1:]))
        runs += more + MOST
    noise = error**2 / max(len(J) - len(p), 1)
    return MotionFit(
        scale=float(np.exp(p[0])),
        nu=float(p[1]) if with_nu else None,
        error=float(np.sqrt(error**2 / total + outside)),
        unfitted_error=float(np.sqrt(first**2 / total + outside)),
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


def _gauss_newton(
    misfit: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]], p: np.ndarray
) -> tuple[np.ndarray, float, np.ndarray, float, int]:
    """Least squares of ``misfit`` from ``p``, each step halved until it lowers the sum.

    Returns the parameters, the misfit's size and derivative there, its size at the start, and runs.
    """
    (difference, J), runs, last = misfit(p), 1, 0.0
    first = size = float(np.linalg.norm(difference))
    while runs < MOST:
        # Gauss-Newton step from `p` within its limits; where nu meets one, E follows from that
        longest = LONGEST[: len(p)]
        free = np.linalg.lstsq(J, -difference, rcond=None)[0]
        move = np.clip(free, -longest, longest)
        move[1:] = np.clip(p[1:] + move[1:], NU_LOW, NU_HIGH) - p[1:]
        if (move[1:] != free[1:]).any():
            rest = -difference - J[:, 1:] @ move[1:]
            move[:1] = np.clip(
                np.linalg.lstsq(J[:, :1], rest, rcond=None)[0], -longest[0], longest[0]
            )
        last = float(np.abs(move).max())
        while np.abs(move).max() > ENOUGH and runs < MOST:
            (there, slope), runs = misfit(p + move), runs + 1
            if (norm := float(np.linalg.norm(there))) < size:
                p, difference, J, size = p + move, there, slope, norm
                break
            move = move / 2
        else:
            break
    if runs >= MOST and last > UNSETTLED:
        raise ConvergenceError("identify.fit_settle", most=MOST, last=last)
    return p, size, J, first, runs


def moduli_forces(
    elasticity: ReducedElasticity, q: Float[np.ndarray, "dofs"], count: int = 2
) -> Float[np.ndarray, "dofs _"]:
    """Derivatives of the elastic force [N/sqrt(kg)] by log E, and by nu if ``count`` is 2.

    Stress is linear in the Lame parameters: their derivatives take their place.
    """
    model = elasticity.model
    columns = [elasticity.force_with(q, *model.lame)]
    if count > 1:
        ahead, behind = (lame_parameters(model.E, model.nu + s * DNU) for s in (0.5, -0.5))
        change = [(a - b) / DNU for a, b in zip(ahead, behind, strict=True)]
        columns.append(elasticity.force_with(q, *change))
    return np.stack(columns, axis=1)
