"""Springs after another method: scale and profile of k by a motion, or a scale by a frequency."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

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
# Gauss-Newton on log k and its profile: difference, longest step, shortest step, and most steps. It
# ends where the square of the error falls, or would, by less than a share.
DIFFERENCE, LONGEST, SHORTEST, MOST, GAIN = 1e-3, 1.0, 1e-5, 12, 5e-3
# Steps are made shorter only where they are too long by more than this share, so that differences
# are not those of another step.
LEEWAY = 0.05
# The surface is at most so many times [exp] stiffer or softer than the middle.
STEEPEST = 4.0


@dataclass(frozen=True, kw_only=True)
class SpringFit:
    """A network fitted to a motion.

    Parameters
    ----------
    scale
        What the calibrated stiffness is multiplied by [1], in the geometric mean of the volume.
    surface
        Logarithm [1] of the stiffness of springs at the surface over that in the middle: what few
        anchors across need to bend and to shear as they should.
    error
        Root of the mass-weighted mean square of the displacement's error, over that of the motion.
    calibrated_error
        The same without the fit, at scale 1 and surface 0.
    frequency_ratio
        First frequency of the fitted network over the one asked for; nan where none was given.
    runs
        How many motions it took.
    anchors, neighbours, eta
        The network that was fitted: another one has another scale.
    """

    scale: float
    surface: float
    error: float
    calibrated_error: float
    frequency_ratio: float
    runs: int
    anchors: int
    neighbours: int
    eta: float


def profile_warnings(fit: SpringFit) -> tuple[str, ...]:
    """What to say where a fit is not what it looks like."""
    if abs(fit.surface) < STEEPEST:
        return ()
    return (
        f"the springs' profile ended at its limit, {np.exp(STEEPEST):.0f} times from middle to "
        "surface: the motion wants what springs cannot do",
    )


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
    steps: int = 1,
) -> SpringFit:
    """Scale and profile of k with which ``body`` follows displacements [m] every ``dt`` [s] best.

    The first frame is the start. Gauss-Newton from the scale of the first ``frequency`` [Hz] where
    that is known. k and eta are one number: eta stays. At least ``steps`` are taken every ``dt``.

    Raises
    ------
    InputError
        Where nothing moves, the shapes do not fit, or pieces of the network turn freely.
    ConvergenceError
        Where the fit does not settle, or a motion's steps are unstable.
    """
    network = body.network
    target = np.asarray(wanted, dtype=float)[1:]
    weight = _weights(body.scene.mesh, target)

    def stiffness(p: np.ndarray) -> np.ndarray:
        return np.exp(p[0]) * network.stiffness(eta, surface=p[1])

    def misfit(p: np.ndarray) -> np.ndarray:
        nonlocal steps
        motion = body.motion(stiffness(p), dashpot=dashpot)
        needed = motion.steps_for(dt)
        steps = needed if needed > (1 + LEEWAY) * steps else steps
        out = np.empty_like(target)
        for frame in range(len(target)):
            motion.advance(dt, steps=steps)
            out[frame] = body.displacement(motion.x)
        return (weight * (out - target)).ravel()

    found = 1.0 if frequency is None else scale_to_frequency(network, frequency, eta=eta)
    first = misfit(np.zeros(2))
    p, error, runs = _gauss_newton(misfit, np.array([np.log(found), 0.0]), first)
    ratio = np.nan
    if frequency is not None:
        ratio = float(network_frequencies(network, stiffness(p))[0] / frequency)
    return SpringFit(
        scale=float(np.exp(p[0])),
        surface=float(p[1]),
        error=error,
        calibrated_error=float(np.linalg.norm(first)),
        frequency_ratio=ratio,
        runs=runs + 1,
        anchors=body.asked,
        neighbours=network.neighbours,
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


class _Least(NamedTuple):
    """Argument of the least square, the root of that, and how many runs it took."""

    p: np.ndarray
    error: float
    runs: int


def _gauss_newton(
    misfit: Callable[[np.ndarray], np.ndarray], p: np.ndarray, at_zero: np.ndarray
) -> _Least:
    """Least squares of ``misfit`` from ``p`` on; steps that do not help are halved."""
    here, runs = (misfit(p), 1) if p.any() else (at_zero, 0)
    for _ in range(MOST):
        J = np.stack([misfit(p + d) - here for d in DIFFERENCE * np.eye(len(p))], 1) / DIFFERENCE
        move = _short(p, np.linalg.lstsq(J, -here, rcond=1e-6)[0])
        expected, runs = here + J @ move, runs + len(p)
        if not expected @ expected < (1 - GAIN) * (here @ here):
            return _Least(p, float(np.linalg.norm(here)), runs)
        while np.abs(move).max() > SHORTEST:
            there, runs = misfit(p + move), runs + 1
            if there @ there < here @ here:
                break
            move = move / 2
        else:
            return _Least(p, float(np.linalg.norm(here)), runs)
        gained = there @ there < (1 - GAIN) * (here @ here)
        p, here = p + move, there
        if not gained:
            return _Least(p, float(np.linalg.norm(here)), runs)
    raise ConvergenceError(f"the fit of k does not settle within {MOST} steps")


def _short(p: np.ndarray, move: np.ndarray) -> np.ndarray:
    """``move`` no longer than is safe, and to no steeper profile than there may be."""
    move = move * min(1.0, LONGEST / max(float(np.abs(move).max()), 1e-300))
    move[1] = np.clip(p[1] + move[1], -STEEPEST, STEEPEST) - p[1]
    return move
