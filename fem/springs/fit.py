"""Springs after another method: one number for k, by a frequency or a motion; eta for a ratio."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ..errors import ConvergenceError, InputError
from ..scene.mesh import TetMesh, material_of
from .body import SpringBody
from .network import SpringNetwork
from .vibration import network_frequencies

# Where neighbours beyond the nearest sixteen count nothing, and where all do: the ends of eta.
SOFTEST, STIFFEST = 20.0, -20.0
# A network that should ring so many times faster has pieces that turn freely: no k mends that.
LOOSE = 1e3
# Gauss-Newton on log k: difference, longest step, shortest step, and most steps. It ends where the
# square of the error would fall by less than a share.
DIFFERENCE, LONGEST, SHORTEST, MOST, GAIN = 1e-3, 0.5, 1e-5, 12, 1e-4


@dataclass(frozen=True, kw_only=True)
class SpringFit:
    """A network fitted to a motion.

    Parameters
    ----------
    scale
        What the calibrated stiffness is multiplied by [1].
    error
        Root of the mass-weighted mean square of the displacement's error, over that of the motion.
    calibrated_error
        The same without the fit, at scale 1.
    frequency_ratio
        First frequency of the fitted network over the one asked for; nan where none was given.
    runs
        How many motions it took.
    anchors, neighbours, eta
        The network that was fitted: another one has another scale.
    """

    scale: float
    error: float
    calibrated_error: float
    frequency_ratio: float
    runs: int
    anchors: int
    neighbours: int
    eta: float


def scale_to_frequency(network: SpringNetwork, wanted: float, *, eta: float = 0.0) -> float:
    """Scale of k [1] that gives the network the first frequency ``wanted`` [Hz]: no motion.

    ``InputError`` where no scale does: pieces of the network turn freely.
    """
    if not wanted > 0:
        raise InputError(f"a first frequency of {wanted:g} Hz: wanted > 0")
    found = float(network_frequencies(network, network.stiffness(eta))[0])
    if not LOOSE * found > wanted:
        raise InputError(
            f"the springs' first frequency is {found:.2g} Hz, {wanted:.2g} Hz is wanted: pieces "
            "turn freely, wanted more anchors"
        )
    return (wanted / found) ** 2


def eta_for_ratio(network: SpringNetwork, ratio: float) -> float:
    """Eta whose network is ``ratio`` [1] times as stiff as its softest, all k the same.

    By bisection on the sum of k w l; ratios out of reach give the nearer end.
    """
    k = network.calibrated(SOFTEST)

    def log_stiffness(eta: float) -> float:
        return float(np.log(network.stiffness(eta, k=k) @ network.length**2))

    wanted = np.log(ratio) + log_stiffness(SOFTEST)
    low, high = STIFFEST, SOFTEST
    if wanted >= log_stiffness(low):
        return low
    if wanted <= log_stiffness(high):
        return high
    while high - low > 1e-12 * SOFTEST:
        middle = (low + high) / 2
        low, high = (middle, high) if log_stiffness(middle) > wanted else (low, middle)
    return (low + high) / 2


def eta_reach(network: SpringNetwork) -> float:
    """How many times stiffer than its softest a network gets by eta alone [1]."""
    k, square = network.calibrated(SOFTEST), network.length**2
    ends = [network.stiffness(eta, k=k) @ square for eta in (STIFFEST, SOFTEST)]
    return float(ends[0] / ends[1])


def fit_to_motion(
    body: SpringBody,
    wanted: Float[np.ndarray, "frames points 3"],
    dt: float,
    *,
    eta: float = 0.0,
    dashpot: float = 0.0,
    frequency: float | None = None,
) -> SpringFit:
    """Scale of k with which ``body`` follows displacements [m] at intervals ``dt`` [s] best.

    The first frame is the start. Gauss-Newton on log k by differences, from the scale of the first
    ``frequency`` [Hz] where that is known. k and eta are one number: eta stays.

    Raises
    ------
    InputError
        Where nothing moves, the shapes do not fit, or pieces of the network turn freely.
    ConvergenceError
        Where the scale does not settle, or a motion's steps are unstable.
    """
    mesh, base = body.scene.mesh, body.network.stiffness(eta)
    target = np.asarray(wanted, dtype=float)[1:]
    weight = _weights(mesh, target)
    runs, steps = 0, 0

    def misfit(log_scale: float) -> np.ndarray:
        nonlocal runs, steps
        motion = body.motion(np.exp(log_scale) * base, dashpot=dashpot)
        # Never fewer than before: another count of steps would be read as another stiffness.
        runs, steps = runs + 1, max(steps, motion.steps_for(dt))
        out = np.empty_like(target)
        for frame in range(len(target)):
            motion.advance(dt, steps=steps)
            out[frame] = body.displacement(motion.x)
        return (weight * (out - target)).ravel()

    found = 1.0 if frequency is None else scale_to_frequency(body.network, frequency, eta=eta)
    first = misfit(0.0)
    log_scale, error = _gauss_newton(misfit, float(np.log(found)), first)
    ratio = np.nan
    if frequency is not None:
        tone = network_frequencies(body.network, np.exp(log_scale) * base)[0]
        ratio = float(tone / frequency)
    return SpringFit(
        scale=float(np.exp(log_scale)),
        error=error,
        calibrated_error=float(np.linalg.norm(first)),
        frequency_ratio=ratio,
        runs=runs,
        anchors=body.asked,
        neighbours=body.network.neighbours,
        eta=eta,
    )


def _weights(
    mesh: TetMesh, target: Float[np.ndarray, "frames points 3"]
) -> Float[np.ndarray, "points 1"]:
    """Roots of the points' mass, so that the motion to fit to is of length one."""
    if target.ndim != 3 or not len(target) or target.shape[1:] != mesh.points.shape:
        raise InputError(
            f"a motion of shape {target.shape}: wanted (frames, {len(mesh.points)}, 3)"
        )
    share = (material_of(mesh).rho * mesh.volumes / 4).repeat(4)
    weight = np.sqrt(np.bincount(mesh.tets.ravel(), share, len(mesh.points)))[:, None]
    size = float(np.linalg.norm(weight * target))
    if not size > 0:
        raise InputError("nothing moves in the motion: there is nothing to fit to")
    return weight / size


def _gauss_newton(misfit, start: float, at_zero: np.ndarray) -> tuple[float, float]:
    """Argument of least square and the root of that; steps that do not help are halved."""
    p = start
    here = at_zero if p == 0 else misfit(p)
    for _ in range(MOST):
        slope = (misfit(p + DIFFERENCE) - here) / DIFFERENCE
        downhill, square = float(slope @ here), max(float(slope @ slope), 1e-300)
        step = float(np.clip(-downhill / square, -LONGEST, LONGEST))
        if downhill**2 / square < GAIN * float(here @ here):
            return p, float(np.linalg.norm(here))
        while abs(step) > SHORTEST:
            there = misfit(p + step)
            if there @ there < here @ here:
                break
            step /= 2
        else:
            return p, float(np.linalg.norm(here))
        p, here = p + step, there
    raise ConvergenceError(f"the fit of k does not settle within {MOST} steps")
