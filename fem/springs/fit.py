"""Springs after another method: scale and profile of k by a motion, or a scale by a frequency."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from ..errors import ConvergenceError, InputError, UsageError
from ..mesh import material_of
from ..note import Note
from ..solve.method import FrameProgress
from .body import COST, SpringBody
from .motion import network_frequencies
from .network import SOFTEST, SpringNetwork, stiffened

# A network that should ring so many times faster has pieces that turn freely: no k mends that.
LOOSE = 1e3
# A fit that takes longer [s] is refused.
PATIENCE = 3600.0
# Gauss-Newton on log k and its profile: difference, longest step, shortest step, and most steps. It
# ends where the square of the error falls, or would, by less than a fraction. Derivatives serve
# while a step gains about what they promise, and learn from it (Broyden).
DIFFERENCE, LONGEST, SHORTEST, MOST, GAIN = 1e-3, 1.0, 1e-5, 48, 1e-2
# Bar and slab are followed within 5 %: a fit that ends at more than twice that is none.
FOLLOWED = 0.1
# A misfit below this fraction of the motion is none: no springs come so near to another solver.
EXACT = 1e-5
# The profiles [exp] that a fit starts from where it knows a frequency: bar and slab end at 2.1 to
# 2.4; where it does not follow from there, it starts once more, between those and the calibrated.
PROFILES = (2.0, 1.0)
# The surface is at most so many times [exp] stiffer or softer than the middle.
STEEPEST = 4.0


@dataclass(frozen=True, kw_only=True)
class SpringFit:
    """A network fitted to a motion.

    scale: What the calibrated stiffness is multiplied by [1], in the geometric mean of the volume.
    surface: Logarithm [1] of the stiffness of springs at the surface over that in the middle: what
        few anchors across need to bend and to shear as they should.
    error: Root of the mass-weighted mean square of the displacement's error, over that of the
        motion.
    calibrated_error: The same without the fit, at scale 1 and surface 0.
    frequency_ratio: First frequency of the fitted network over the one asked for; nan where none
        was given.
    runs: How many motions it took.
    anchors, neighbours, eta: The network that was fitted: another one has another scale.
    stiffer: How many times as stiff the network of another, stiff motion is [1]; nan where there
        was none.
    stiff_error: Error of the stiff motion by this network made so many times stiffer.
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
    stiffer: float = np.nan
    stiff_error: float = np.nan


def spring_warnings(fit: SpringFit) -> tuple[str, ...]:
    """What to say where a fit is not what it looks like."""
    warnings = []
    if abs(fit.surface) >= STEEPEST:
        warnings.append(Note("fit.springs_profile", exp=np.exp(STEEPEST)))
    if not fit.error <= FOLLOWED:
        warnings.append(Note("fit.springs_follow", error=fit.error, followed=FOLLOWED))
    return tuple(warnings)


def scale_to_frequency(
    network: SpringNetwork, wanted: float, *, eta: float = 0.0, surface: float = 0.0
) -> float:
    """Scale of k [1] that gives the network the first frequency ``wanted`` [Hz]: no motion.

    ``InputError`` where no scale does: pieces of the network turn freely.
    """
    if not wanted > 0:
        raise InputError("fit.first_frequency", wanted=wanted)
    frequency = float(network_frequencies(network, network.stiffness(eta, surface=surface))[0])
    if not LOOSE * frequency > wanted:
        raise InputError("fit.springs_first", frequency=frequency, wanted=wanted)
    return (wanted / frequency) ** 2


def fit_both_ends(
    body: SpringBody,
    soft: Float[np.ndarray, "frames points 3"],
    stiff: Float[np.ndarray, "frames points 3"],
    dt: tuple[float, float],
    *,
    frequency: float | None = None,
    **options: Any,
) -> SpringFit:
    """As ``fit_to_motion`` of a ``soft`` motion at the softest eta, and how stiff another is.

    ``dt`` [s] are the intervals of both. The stiff motion is fitted at the same eta; how many times
    more its springs carry is what eta, and k beyond its reach, has to make. ``options`` as there.
    """
    one = fit_to_motion(body, soft, dt[0], eta=SOFTEST, frequency=frequency, **options)
    two = fit_to_motion(body, stiff, dt[1], eta=SOFTEST, frequency=frequency, **options)
    square = body.network.length**2
    ends = [f.scale * body.network.stiffness(SOFTEST, surface=f.surface) for f in (one, two)]
    ratio = float((ends[1] @ square) / (ends[0] @ square))
    k = one.scale * body.network.constants(SOFTEST, one.surface)
    error = np.linalg.norm(SpringMisfit(body, stiff, dt[1]).of(stiffened(body.network, k, ratio)))
    return replace(one, stiffer=ratio, stiff_error=float(error), runs=one.runs + two.runs + 1)


def fit_to_motion(
    body: SpringBody,
    wanted: Float[np.ndarray, "frames points 3"],
    dt: float,
    *,
    eta: float = 0.0,
    dashpot: float = 0.0,
    frequency: float | None = None,
    steps: int = 1,
    announce: Callable[[str], None] | None = None,
    progress: FrameProgress | None = None,
) -> SpringFit:
    """Scale and profile of k with which ``body`` follows displacements [m] every ``dt`` [s] best.

    The first frame is the start. Gauss-Newton from the scale of the first ``frequency`` [Hz] where
    that is known. k and eta are one number: eta stays. At least ``steps`` are taken every ``dt``.
    ``announce`` hears before what the fit takes, ``progress`` every frame how many are done.

    Raises InputError: Where nothing moves, the shapes do not fit, or pieces of the network turn
        freely.
    Raises ConvergenceError: Where the fit does not settle, or a motion's steps are unstable.
    Raises UsageError: Where the fit would take hours.
    """
    network = body.network
    compared = SpringMisfit(
        body, wanted, dt, dashpot=dashpot, steps=steps, announce=announce, progress=progress
    )

    def stiffness(p: np.ndarray) -> np.ndarray:
        return np.exp(p[0]) * network.stiffness(eta, surface=p[1])

    def misfit(p: np.ndarray) -> np.ndarray:
        return compared.of(stiffness(p))

    def start(surface: float) -> np.ndarray:
        """The profile ``surface`` at the scale of the first frequency, where that is known."""
        if frequency is None:
            return np.zeros(2)
        scale = scale_to_frequency(network, frequency, eta=eta, surface=surface)
        return np.array([np.log(scale), surface])

    near = start(PROFILES[0])  # before any motion: it refuses pieces that turn freely
    calibrated = misfit(np.zeros(2))
    p, error, runs = _gauss_newton(misfit, near, calibrated)
    if frequency is not None and error > FOLLOWED:
        q, other, more = _gauss_newton(misfit, start(PROFILES[1]), calibrated)
        p, error, runs = (q, other, runs + more) if other < error else (p, error, runs + more)
    ratio = np.nan
    if frequency is not None:
        ratio = float(network_frequencies(network, stiffness(p))[0] / frequency)
    return SpringFit(
        scale=float(np.exp(p[0])),
        surface=float(p[1]),
        error=error,
        calibrated_error=float(np.linalg.norm(calibrated)),
        frequency_ratio=ratio,
        runs=runs + 1,
        anchors=body.asked,
        neighbours=network.neighbours,
        eta=eta,
    )


def _gauss_newton(
    misfit: Callable[[np.ndarray], np.ndarray], p: np.ndarray, at_zero: np.ndarray
) -> tuple[np.ndarray, float, int]:
    """Least squares of ``misfit`` from ``p`` on: argument, root of the least square, and runs."""
    here, runs = (misfit(p), 1) if p.any() else (at_zero, 0)
    J: np.ndarray | None = None
    age = 0  # steps since J was made of differences
    for _ in range(MOST):
        fresh = J is None
        if J is None:
            age = 0
            columns = [misfit(p + d) - here for d in DIFFERENCE * np.eye(len(p))]
            J, runs = np.stack(columns, 1) / DIFFERENCE, runs + len(p)
        move = np.linalg.lstsq(J, -here, rcond=1e-6)[0]
        # No longer than is safe, and to no steeper profile than there may be
        move = move * min(1.0, LONGEST / max(float(np.abs(move).max()), 1e-300))
        move[1] = np.clip(p[1] + move[1], -STEEPEST, STEEPEST) - p[1]
        expected = here + J @ move
        if not expected @ expected < (1 - GAIN) * (here @ here):
            if age < 2:
                return p, float(np.linalg.norm(here)), runs
            J = None  # what was learnt promises nothing: differences
            continue
        there, runs = misfit(p + move), runs + 1
        if not there @ there < (1 - GAIN) * (here @ here) and not fresh:
            J = None
            continue
        while not there @ there < here @ here:  # steps that do not help are halved
            move = move / 2
            if np.abs(move).max() < SHORTEST:
                return p, float(np.linalg.norm(here)), runs
            there, runs = misfit(p + move), runs + 1
        gained = there @ there < (1 - GAIN) * (here @ here)
        J = J + np.outer(there - here - J @ move, move) / (move @ move)
        p, here, age = p + move, there, age + 1
        if not gained or here @ here < EXACT**2:
            return p, float(np.linalg.norm(here)), runs
    raise ConvergenceError("fit.fit_settle", most=MOST)


# How far springs are from a motion, which every step of a fit asks.

logger = logging.getLogger(__name__)

# Motions that a fit takes, about: 9 to 14 were counted.
USUAL = 12
# Steps are made shorter only where they are too long by more than this fraction, so that
# differences are not those of another step.
LEEWAY = 0.05


class SpringMisfit:
    """A motion that a body's springs are compared with; steps grow shorter as springs need it.

    ``wanted`` (frames, points, 3) [m] every ``dt`` [s], the start first, in at least ``steps``
    steps. ``announce`` hears before the first motion what a fit takes, ``progress`` every frame how
    many of all its frames are done.
    """

    def __init__(
        self,
        body: SpringBody,
        wanted: Float[np.ndarray, "frames points 3"],
        dt: float,
        *,
        dashpot: float = 0.0,
        steps: int = 1,
        announce: Callable[[str], None] | None = None,
        progress: FrameProgress | None = None,
    ) -> None:
        self.body, self.dt, self.dashpot, self.steps = body, dt, dashpot, steps
        self.target = np.asarray(wanted, dtype=float)[1:]
        # Roots of the points' mass, so that the motion to fit to is of length one
        mesh = body.scene.mesh
        target = self.target
        if target.ndim != 3 or not len(target) or target.shape[1:] != mesh.points.shape:
            raise InputError("fit.motion_shape", shape=target.shape, count=len(mesh.points))
        quarter = (material_of(mesh).rho * mesh.volumes / 4).repeat(4)
        weight = np.sqrt(np.bincount(mesh.tets.ravel(), quarter, len(mesh.points)))[:, None]
        size = float(np.linalg.norm(weight * target))
        if not size > 0:
            raise InputError("fit.nothing_moves")
        self.weight = weight / size
        self.motions, self.announce, self.progress = 0, announce, progress

    def of(self, stiffness: Float[np.ndarray, "springs"]) -> np.ndarray:
        """Weighted difference (n,) of the springs' displacement, over the motion's size.

        Raises UsageError: Where a fit would take hours.
        """
        motion = self.body.motion(stiffness, dashpot=self.dashpot)
        needed = motion.steps_for(self.dt)
        self.steps = needed if needed > (1 + LEEWAY) * self.steps else self.steps
        steps = self.steps * len(self.target)
        seconds = USUAL * 2 * COST * len(stiffness) * steps
        if seconds > PATIENCE:
            raise UsageError("fit.fit_takes", usual=USUAL, steps=steps, seconds=seconds / 3600)
        logger.info("a motion of %s steps takes some %.0f s", f"{steps:,}", seconds / USUAL)
        if self.announce is not None and not self.motions:
            plan = Note("fit.springs_about", count=len(stiffness), usual=USUAL, steps=steps)
            self.announce(f"{plan}: some {seconds:,.0f} s")
        out = np.empty_like(self.target)
        for frame in range(len(out)):
            motion.advance(self.dt, steps=self.steps)
            out[frame] = self.body.displacement(motion.x)
            if self.progress is not None:
                most = max(USUAL, self.motions + 2)
                self.progress(self.motions * len(out) + frame + 1, most * len(out))
        self.motions += 1
        return (self.weight * (out - self.target)).ravel()
