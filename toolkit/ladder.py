"""The ladder of attempts: as asked, repaired harder, coarser, wrapped; every rung is recorded."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ..fem.errors import UsageError
from ..fem.mesh import boundary_faces, signed_volumes
from .cache import Runner
from .child import ChildFailure
from .conversion import ENVELOPE_SHARE, Attempt, Engine
from .manifold import Separated, separate
from .regions import Shell, Solids
from .surface import Surface
from .triangles import closest, edge_components

log = logging.getLogger(__name__)

HARDER_WELD_REL = 1e-4  # a twentieth of the default epsilon: closes gaps that nobody can see
COARSER = (2.0, 4.0)  # factors of edge length and epsilon
TIGHTER = 2.0  # divides epsilon where the result misses parts of the input
TIGHTER_TIME = 4.0  # times that of the first attempt: samples of an envelope go with its square
TIGHTER_START = 10.0  # s that it may take in any case
COARSEST_EDGE_REL, COARSEST_EPSILON_REL = 0.5, 2e-2
DECIMATED_SHARE = 0.25  # of epsilon: how far the surface that the engine gets is off the input
# Coarser runs until --max-tets is met, with some reserve. The tets of a thin body go with the
# square of the edge, those of a thick one with the cube.
BUDGET_ROUNDS, BUDGET_MARGIN = 4, 1.1
OUTSIDE, NEAR = -1, -2  # labels of points in no part, and of those near the input's surface
CONFORMING_ROUNDS = 5  # relabelled tets show new vertices; crumbs are one or two tets wide
WRAP_ALPHA_REL = 0.02  # share of the diagonal: holes below this size are bridged
WRAP_VOLUME_TOLERANCE = 0.1  # a wrap that changes the volume by more is a shell, not the solid


@dataclass(frozen=True)
class Target:
    """What the engine is asked for; lengths are shares of ``diagonal`` [m]."""

    diagonal: float
    edge_length_rel: float
    epsilon_rel: float
    stop_energy: float

    @property
    def edge_length(self) -> float:
        """Wanted edge [m]."""
        return self.edge_length_rel * self.diagonal

    @property
    def epsilon(self) -> float:
        """Largest distance from the input [m]."""
        return self.epsilon_rel * self.diagonal

    @property
    def envelope(self) -> float:
        """Distance [m] that the engine keeps; a plate thinner than that is swallowed whole."""
        return ENVELOPE_SHARE * self.epsilon

    def checked(self) -> Target:
        """Return itself, or say what is out of range."""
        for option, value, most in (
            ("--edge-length-rel", self.edge_length_rel, 1.0),
            ("--epsilon-rel", self.epsilon_rel, 0.1),
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


class Job(NamedTuple):
    """Solids that enclose ``enclosed`` [m^3], what is asked of their tets, and who makes them.

    ``again`` prepares the solids anew with another welding distance, a share of the diagonal.
    """

    solids: Solids
    target: Target
    enclosed: float
    again: Callable[[float], Solids]
    runner: Runner


def climb_within(job: Job, max_tets: int | None) -> tuple[Filling | None, tuple[Attempt, ...]]:
    """Climb, and again with a coarser target while the result has more than ``max_tets`` tets."""
    filling, attempts = climb(job)
    for _ in range(BUDGET_ROUNDS):
        if filling is None or max_tets is None or len(filling.part) <= max_tets:
            break
        factor = BUDGET_MARGIN * (len(filling.part) / max_tets) ** 0.5
        finer = filling
        filling, more = climb(job._replace(target=finer.target.coarser(factor)))
        attempts += more
        filling = filling or finer
    return filling, attempts


def climb(job: Job) -> tuple[Filling | None, tuple[Attempt, ...]]:
    """Try one rung after the other until the solids are filled; all attempts are on record.

    A time-out goes straight to the coarser rungs: more repair does not make it faster.
    """
    attempts: list[Attempt] = []
    for engine, aim, prepare in _rungs(job):
        out_of_time = bool(attempts) and attempts[-1].outcome.startswith("time")
        if out_of_time and aim is job.target:
            continue
        filling, attempt = _try(engine, aim, prepare, job.runner)
        attempts.append(attempt)
        if filling is not None:
            return filling, tuple(attempts)
    return None, tuple(attempts)


def tighten(job: Job, first: Attempt) -> tuple[Filling | None, Attempt]:
    """One more try in a narrower envelope, for spikes and corners that the first cut off.

    It may take a few times as long as the first: an improvement, not worth a long wait.
    """
    aim = replace(job.target, epsilon_rel=job.target.epsilon_rel / TIGHTER)
    limit = min(job.runner.time_limit, TIGHTER_START + TIGHTER_TIME * first.seconds)
    runner = replace(job.runner, time_limit=limit)
    return _try("tetwild", aim, lambda: job.solids, runner)


def _try(
    engine: Engine, aim: Target, prepare: Callable[[], Solids], runner: Runner
) -> tuple[Filling | None, Attempt]:
    """One rung: a filling or None, and what to put on record."""
    started, filling = time.monotonic(), None
    try:
        filling = _fill(prepare(), aim, runner)
        outcome = "ok"
    except ChildFailure as failure:
        outcome = f"{failure.kind}: {failure}"
    except NoFilling as failure:
        outcome = f"rejected: {failure}"
    seconds = time.monotonic() - started
    log.info("%s: %s after %.1f s", engine, outcome, seconds)
    return filling, Attempt(engine, aim.edge_length, aim.epsilon, seconds, outcome)


def _rungs(job: Job) -> Iterator[tuple[Engine, Target, Callable[[], Solids]]]:
    """What to try one after the other; solids are prepared only when their turn comes."""
    yield "tetwild", job.target, lambda: job.solids
    yield "tetwild", job.target, lambda: job.again(HARDER_WELD_REL)
    for factor in COARSER:
        yield "tetwild", job.target.coarser(factor), lambda: job.solids
    coarsest = job._replace(target=job.target.coarser(COARSER[0]))
    yield "alpha wrap + tetwild", coarsest.target, lambda: wrapped(coarsest)


def wrapped(job: Job) -> Solids:
    """One watertight shell around all solids, accepted by its volume, split by nearest part."""
    surface = job.solids.surface
    wrap = job.runner.run(
        "alpha_wrap",
        {"points": surface.points, "faces": surface.faces},
        {"alpha_rel": WRAP_ALPHA_REL, "offset_rel": ENVELOPE_SHARE * job.target.epsilon_rel},
    )
    points, faces = wrap["points"], wrap["faces"]
    a, b, c = (points[faces[:, i]] for i in range(3))
    volume = float(np.einsum("fi,fi->f", np.cross(a, b), c).sum() / 6)
    if abs(volume - job.enclosed) > WRAP_VOLUME_TOLERANCE * job.enclosed:
        raise NoFilling(f"the wrap encloses {volume:.4g} m^3, the input {job.enclosed:.4g} m^3")
    part = surface.part[closest((a + b + c) / 3, surface.points, surface.faces).face]
    skin = Surface(points, faces, part, edge_components(faces))
    return Solids((Shell(points, faces, part),), skin, job.solids.sheets)


def _fill(solids: Solids, target: Target, runner: Runner) -> Filling:
    """One run of the engine in a box of unit diagonal, and the tets that lie in a solid."""
    points, faces = solids.clean_triangles()
    lo, hi = points.min(axis=0), points.max(axis=0)
    centre, scale = (lo + hi) / 2, float(np.linalg.norm(hi - lo))
    box = runner.run(
        "tetwild",
        {"points": (points - centre) / scale, "faces": faces},
        {
            "edge_length_rel": min(target.edge_length / scale, 1.0),
            "epsilon_rel": target.envelope / scale,
            "stop_energy": target.stop_energy,
            "decimate_rel": DECIMATED_SHARE * target.epsilon / scale,
        },
    )
    where = box["points"] * scale + centre
    part = solids.label(where[box["tets"]].mean(axis=1), signed_volumes(where, box["tets"]))
    part = conforming(where, box["tets"], part, solids, target.epsilon)
    if not (part >= 0).any():
        raise NoFilling("no tet lies in a solid")
    mesh = separate(where, box["tets"][part >= 0])
    if (flat := int((signed_volumes(mesh.points, mesh.tets) <= 0).sum())) > 0:
        raise NoFilling(f"{flat} tets are flat or inverted")
    return Filling(mesh, part[part >= 0][mesh.origin], target)


def conforming(
    points: Float[np.ndarray, "points 3"],
    tets: Int[np.ndarray, "tets 4"],
    part: Int[np.ndarray, "tets"],
    solids: Solids,
    epsilon: float,
) -> Int[np.ndarray, "tets"]:
    """Relabel tets where the boundary is farther than ``epsilon`` [m] from the input.

    The engine swallows what is thinner than its envelope; tets that then cross the input are told
    apart by their centroids, at random. A boundary vertex that far from the input lies inside or
    outside, and so do all tets around it; a face whose middle is outside bounds no solid.
    """
    part = part.copy()
    for _ in range(CONFORMING_ROUNDS):
        if not (part >= 0).any():
            break
        boundary = boundary_faces(tets[part >= 0])
        skin = np.unique(boundary.faces)
        vertex = _labels_off(solids, points[skin], epsilon)
        face = _labels_off(solids, points[boundary.faces].mean(axis=1), epsilon)
        if (vertex == NEAR).all() and (face == NEAR).all():
            break
        wrong = np.flatnonzero(part >= 0)[boundary.tet[face == OUTSIDE]]
        corner = np.full(len(points), NEAR)
        corner[skin] = vertex
        within = corner[tets].max(axis=1)
        part = np.where((part == OUTSIDE) & (within >= 0), within, part)
        part[(corner[tets] == OUTSIDE).any(axis=1)] = OUTSIDE
        part[wrong] = OUTSIDE
    return part


def _labels_off(
    solids: Solids, where: Float[np.ndarray, "n 3"], epsilon: float
) -> Int[np.ndarray, "n"]:
    """Part that each point lies in, ``OUTSIDE``, or ``NEAR`` the input, within ``epsilon`` [m]."""
    label = np.full(len(where), NEAR)
    far = closest(where, solids.surface.points, solids.surface.faces).distance > epsilon
    label[far] = solids.label(where[far], np.ones(int(far.sum())))
    return label
