"""The ladder of attempts: as asked, repaired harder, coarser, wrapped; every rung is recorded."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..fem.errors import UsageError
from ..fem.mesh import signed_volumes
from ..predictors.asset import Part
from .child import ChildFailure, Progress, run_guarded
from .conversion import Attempt, Engine
from .manifold import Separated, separate
from .regions import Shell, Solids
from .repair import Surface, repair
from .triangles import closest, edge_components

log = logging.getLogger(__name__)

HARDER_WELD_REL = 1e-4  # a tenth of the default epsilon: closes gaps that nobody can see
COARSER = (2.0, 4.0)  # factors of edge length and epsilon
COARSEST_EDGE_REL, COARSEST_EPSILON_REL = 0.25, 1e-2
WRAP_ALPHA_REL = 0.02  # share of the diagonal: holes below this size are bridged
WRAP_VOLUME_TOLERANCE = 0.1  # a wrap that changes the volume by more is a shell, not the solid


@dataclass(frozen=True)
class Target:
    """What the engine is asked for; lengths are shares of ``diagonal`` [m]."""

    diagonal: float
    edge_length_rel: float
    epsilon_rel: float
    stop_energy: float
    time_limit: float
    memory_limit: int | None = None

    @property
    def edge_length(self) -> float:
        """Wanted edge [m]."""
        return self.edge_length_rel * self.diagonal

    @property
    def epsilon(self) -> float:
        """Largest distance from the input [m]."""
        return self.epsilon_rel * self.diagonal

    @property
    def thinnest(self) -> float:
        """Thickness [m] below which the envelope swallows a plate whole."""
        return self.epsilon

    def checked(self) -> Target:
        """Return itself, or say what is out of range."""
        for option, value, most in (
            ("--edge-length-rel", self.edge_length_rel, 1.0),
            ("--epsilon-rel", self.epsilon_rel, 0.1),
            ("--time-limit", self.time_limit, np.inf),
        ):
            if not 0 < value <= most:
                raise UsageError(f"{option} must be > 0 and at most {most:g}, got {value:g}")
        return self

    def coarser(self, factor: float) -> Target:
        """Return the same with longer edges and a wider envelope, within sense."""
        return replace(
            self,
            edge_length_rel=min(self.edge_length_rel * factor, COARSEST_EDGE_REL),
            epsilon_rel=min(self.epsilon_rel * factor, COARSEST_EPSILON_REL),
        )


class Filling(NamedTuple):
    """Tets of the solids in metres, the part of each, and the target they meet."""

    mesh: Separated
    part: np.ndarray
    target: Target


class NoFilling(RuntimeError):
    """An attempt that gave no usable mesh, and why."""


def climb(
    parts: Sequence[Part],
    solids: Solids,
    target: Target,
    enclosed: float,
    *,
    progress: Progress | None = None,
) -> tuple[Filling | None, tuple[Attempt, ...]]:
    """Try until the solids, which enclose ``enclosed`` [m^3], are filled; all attempts on record.

    A time-out goes straight to the coarser rungs: more repair does not make it faster.
    """
    attempts: list[Attempt] = []
    for engine, aim, prepare in _rungs(parts, solids, target, enclosed):
        out_of_time = bool(attempts) and attempts[-1].outcome.startswith("time")
        if out_of_time and aim is target and engine == "tetwild":
            continue
        seconds, filling = 0.0, None
        try:
            filling, seconds = _fill(prepare(), aim, progress)
            outcome = "ok"
        except ChildFailure as failure:
            outcome, seconds = f"{failure.kind}: {failure}", failure.seconds
        except NoFilling as failure:
            outcome = f"rejected: {failure}"
        attempts.append(Attempt(engine, aim.edge_length, aim.epsilon, seconds, outcome))
        log.info("%s: %s after %.1f s", engine, outcome, seconds)
        if filling is not None:
            return filling, tuple(attempts)
    return None, tuple(attempts)


def _rungs(
    parts: Sequence[Part], solids: Solids, target: Target, enclosed: float
) -> Iterator[tuple[Engine, Target, Callable[[], Solids]]]:
    """What to try one after the other; solids are prepared only when their turn comes."""
    yield "tetwild", target, lambda: solids
    yield "tetwild", target, lambda: repaired_harder(parts, target)
    for factor in COARSER:
        yield "tetwild", target.coarser(factor), lambda: solids
    coarsest = target.coarser(COARSER[0])
    yield "alpha wrap + tetwild", coarsest, lambda: wrapped(solids, coarsest, enclosed)


def repaired_harder(parts: Sequence[Part], target: Target) -> Solids:
    """Weld over larger gaps before sorting into solids and sheets."""
    surface, _ = repair(parts, weld_rel=HARDER_WELD_REL)
    return Solids.of(surface, len(parts), thinnest=target.thinnest)


def wrapped(solids: Solids, target: Target, enclosed: float) -> Solids:
    """One watertight shell around all solids, accepted by its volume, split by nearest part."""
    surface = solids.surface
    wrap = run_guarded(
        "alpha_wrap",
        {"points": surface.points, "faces": surface.faces},
        {"alpha_rel": WRAP_ALPHA_REL, "offset_rel": target.epsilon_rel},
        time_limit=target.time_limit,
        memory_limit=target.memory_limit,
    )
    points, faces = wrap["points"], wrap["faces"]
    a, b, c = (points[faces[:, i]] for i in range(3))
    volume = float(np.einsum("fi,fi->f", np.cross(a, b), c).sum() / 6)
    if abs(volume - enclosed) > WRAP_VOLUME_TOLERANCE * enclosed:
        raise NoFilling(f"the wrap encloses {volume:.4g} m^3, the input {enclosed:.4g} m^3")
    part = surface.part[closest((a + b + c) / 3, surface.points, surface.faces).face]
    skin = Surface(points, faces, part, edge_components(faces))
    return Solids((Shell(points, faces, part),), skin, solids.sheets)


def _fill(solids: Solids, target: Target, progress: Progress | None) -> tuple[Filling, float]:
    """One run of the engine in a box of unit diagonal, and the tets that lie in a solid."""
    points, faces = solids.clean_triangles()
    lo, hi = points.min(axis=0), points.max(axis=0)
    centre, scale = (lo + hi) / 2, float(np.linalg.norm(hi - lo))
    started = time.monotonic()
    box = run_guarded(
        "tetwild",
        {"points": (points - centre) / scale, "faces": faces},
        {
            "edge_length_rel": min(target.edge_length / scale, 1.0),
            "epsilon_rel": target.epsilon / scale,
            "stop_energy": target.stop_energy,
        },
        time_limit=target.time_limit,
        memory_limit=target.memory_limit,
        progress=progress,
    )
    seconds = time.monotonic() - started
    where = box["points"] * scale + centre
    part = solids.label(where[box["tets"]].mean(axis=1), signed_volumes(where, box["tets"]))
    if not (part >= 0).any():
        raise NoFilling("no tet lies in a solid")
    mesh = separate(where, box["tets"][part >= 0])
    if (flat := int((signed_volumes(mesh.points, mesh.tets) <= 0).sum())) > 0:
        raise NoFilling(f"{flat} tets are flat or inverted")
    return Filling(mesh, part[part >= 0][mesh.origin], target), seconds
