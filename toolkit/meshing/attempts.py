"""Attempts at a mesh: as asked, repaired harder, coarser, wrapped; every one is on record."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

from ...fem.scene.mesh import TetMesh
from ..native.cache import Runner
from ..native.child import ChildFailure
from ..surfaces.solids import Shell, Solids
from ..surfaces.surface import Surface
from ..surfaces.triangles import Triangles, closest, edge_components, enclosed_volume
from .conversion_report import (
    BROKEN,
    ENVELOPE_SHARE,
    Attempt,
    Distances,
    Engine,
    Guarantee,
    InputVolume,
)
from .engine_run import EngineTarget, Filling, NoFilling
from .meshers import AUTO, FTETWILD, MESHERS, STUFFING
from .quality import Quality
from .stuffing.fit import resolving

log = logging.getLogger(__name__)

HARDER_WELD_REL = 1e-4  # a twentieth of the default epsilon: closes gaps that nobody can see
COARSER = (2.0, 4.0)  # factors of edge length and epsilon
TIGHTER = 2.0  # divides epsilon where the result misses parts of the input
TIGHTER_TIME = 4.0  # times that of the first attempt: samples of an envelope go with its square
TIGHTER_START = 10.0  # s that it may take in any case
# Coarser runs until --max-tets is met, with some reserve. The tets of a thin body go with the
# square of the edge, those of a thick one with the cube.
BUDGET_ROUNDS, BUDGET_MARGIN = 4, 1.1
FINER = (1.6, 2.2)  # divide the edge of a lattice too coarse for a body: 4 and 11 times the tets
WHOLE_TETS = 250_000  # that a lattice may have to keep in one piece what a coarser one cut apart
NO_REPAIR_HELPS = ("time", BROKEN)  # such outcomes are the same with vertices welded harder
WRAP_ALPHA_REL = 0.02  # share of the diagonal: holes below this size are bridged
WRAP_VOLUME_TOLERANCE = 0.1  # a wrap that changes the volume by more is a shell, not the solid


class Made(NamedTuple):
    """A filling as a mesh with regions, and what was measured about it at ``epsilon`` [m]."""

    filling: Filling
    mesh: TetMesh
    gaps: Distances
    quality: Quality
    guarantees: tuple[Guarantee, ...]
    epsilon: float

    @property
    def broken(self) -> tuple[str, ...]:
        """Sentences about the guarantees that are not kept."""
        return tuple(g.sentence for g in self.guarantees if not g.ok)

    @property
    def parted(self) -> float:
        """Largest share of a part's volume that a lattice too coarse for it has cut off."""
        lattice = self.filling.lattice
        return 0.0 if lattice is None else max(lattice.parted_shares.values(), default=0.0)

    @property
    def rank(self) -> tuple[int, float, float]:
        """The lower, the better: broken guarantees, loose pieces, the distance in epsilons."""
        return len(self.broken), self.parted, self.gaps.largest / self.epsilon


class Attempts(NamedTuple):
    """The best mesh, if any attempt gave one, and the record of all attempts."""

    made: Made | None
    record: tuple[Attempt, ...]

    @property
    def kept(self) -> bool:
        """Whether there is a mesh that keeps every guarantee."""
        return self.made is not None and not self.made.broken


Judge = Callable[[Filling, float], Made]


class Problem(NamedTuple):
    """Solids that enclose a ``volume``, what is asked of their tets, and who makes them.

    ``again`` prepares the solids anew with another welding distance, a share of the diagonal;
    ``judge`` measures a filling and holds it against epsilon [m]; ``mesher`` is a name of
    ``MESHERS``, or ``AUTO``: the first, and a lattice where it takes too long; within a budget of
    tets none that is too coarse is made ``finer``.
    """

    solids: Solids
    target: EngineTarget
    volume: InputVolume
    again: Callable[[float], Solids]
    runner: Runner
    judge: Judge
    mesher: str = AUTO
    finer: bool = True


def mesh_within(problem: Problem, max_tets: int | None) -> Attempts:
    """Make a mesh, and again with a coarser target while it has more than ``max_tets`` tets.

    Layers of thin places are given up first: they cost the most.
    """
    problem = problem._replace(finer=max_tets is None)
    found = make_mesh(problem, tightening=max_tets is None)
    for _ in range(BUDGET_ROUNDS):
        if found.made is None or max_tets is None or len(found.made.mesh.tets) <= max_tets:
            break
        target = found.made.filling.target
        if target.layers > 1:
            target = replace(target, layers=1)
        else:
            factor = BUDGET_MARGIN * (len(found.made.mesh.tets) / max_tets) ** 0.5
            target = target.coarser(factor)
        coarser = make_mesh(problem._replace(target=target), tightening=False)
        made = coarser.made if coarser.kept or not found.kept else found.made
        found = Attempts(made or found.made, found.record + coarser.record)
    return found


def make_mesh(problem: Problem, *, tightening: bool = True) -> Attempts:
    """Try one way after the other until a mesh keeps its guarantees; all attempts are on record.

    A mesh counts at the epsilon of its own attempt, which is what the report states. After a
    time-out or a broken guarantee the coarser ones are next: more repair helps neither. A lattice
    that cuts a thin part into pieces is followed by finer ones of ``WHOLE_TETS`` at most, and by
    one that joins what touches. Where every mesh breaks a guarantee, the best one is returned.
    """
    record: list[Attempt] = []
    best: Made | None = None
    for engine, aim, prepare in _ways(problem, record):
        if aim.beads and (best is None or not best.parted):
            continue
        same = engine != STUFFING and aim is problem.target
        if record and same and record[-1].outcome.startswith(NO_REPAIR_HELPS):
            continue
        if best is not None and not best.broken:
            if engine != STUFFING:
                break
            if not aim.beads and aim.tets > WHOLE_TETS:
                continue  # too fine to keep a part in one piece; beads may join it
        filling, attempt = _try(engine, aim, prepare, problem.runner)
        record.append(attempt)
        if filling is None:
            continue
        made = _judged(problem, filling, filling.target.epsilon)
        if made.broken:
            record[-1] = replace(attempt, outcome=_broken(made))
        elif made.parted:
            told = f"in pieces: a part lost {made.parted:.2%} of itself"
            record[-1] = replace(attempt, outcome=told)
        if tightening and engine != STUFFING and (made.broken or not made.gaps.good(made.epsilon)):
            made, more = _tightened(problem._replace(target=aim), made, attempt)
            record.append(more)
        best = made if best is None else min(best, made, key=lambda one: one.rank)
        if not made.broken and not made.parted:
            break
    return Attempts(best, tuple(record))


def _judged(problem: Problem, filling: Filling, epsilon: float) -> Made:
    """Measure a filling, and where it breaks a guarantee also that by cells: the better one."""
    made = problem.judge(filling, epsilon)
    if not made.broken or filling.by_cells is None:
        return made
    try:
        other = problem.judge(filling.by_cells(), epsilon)
    except NoFilling as failure:
        log.info("by cells: %s", failure)
        return made
    return min(made, other, key=lambda one: one.rank)


def _broken(made: Made) -> str:
    return f"{BROKEN}: {'; '.join(made.broken)}"


def _tightened(problem: Problem, made: Made, first: Attempt) -> tuple[Made, Attempt]:
    """One more try in a narrower envelope, for spikes and corners that the first cut off.

    It may take a few times as long as the first: an improvement, not worth a long wait. What it
    gives is held against the epsilon of the first.
    """
    aim = replace(problem.target, epsilon_rel=problem.target.epsilon_rel / TIGHTER)
    limit = min(problem.runner.time_limit, TIGHTER_START + TIGHTER_TIME * first.seconds)
    runner = replace(problem.runner, time_limit=limit)
    filling, attempt = _try("tetwild", aim, lambda: problem.solids, runner)
    if filling is None:
        return made, attempt
    again = _judged(problem, filling, made.epsilon)
    if again.broken:
        attempt = replace(attempt, outcome=_broken(again))
    better = (len(again.broken), again.gaps.largest) <= (
        len(made.broken),
        max(made.gaps.largest, made.epsilon),
    )
    return again if better else made, attempt


def _try(
    engine: Engine, aim: EngineTarget, prepare: Callable[[], Solids], runner: Runner
) -> tuple[Filling | None, Attempt]:
    """One attempt: a filling or None, and what to put on record."""
    started, filling = time.monotonic(), None
    try:
        mesher = MESHERS[STUFFING if engine == STUFFING else FTETWILD]
        filling = mesher(prepare(), aim, runner)
        outcome, aim = "ok", filling.target
    except ChildFailure as failure:
        outcome = f"{failure.kind}: {failure}"
    except NoFilling as failure:
        outcome = f"rejected: {failure}"
    seconds = time.monotonic() - started
    log.info("%s: %s after %.1f s", engine, outcome, seconds)
    return filling, Attempt(engine, aim.edge_length, aim.epsilon, seconds, outcome)


Way = tuple[Engine, EngineTarget, Callable[[], Solids]]


def _ways(problem: Problem, record: Sequence[Attempt]) -> Iterator[Way]:
    """What to try one after the other; solids are prepared only when their turn comes.

    ``record`` grows meanwhile: with ``AUTO`` a time-out is followed by a lattice, not by others.
    """
    yield from _lattices(problem) if problem.mesher == STUFFING else ()
    if problem.mesher == STUFFING:
        return
    yield "tetwild", problem.target, lambda: problem.solids
    yield "tetwild", problem.target, lambda: problem.again(HARDER_WELD_REL)
    if problem.mesher == AUTO and any(attempt.outcome.startswith("time") for attempt in record):
        yield from _lattices(problem)
    for factor in COARSER:
        yield "tetwild", problem.target.coarser(factor), lambda: problem.solids
    coarsest = problem._replace(target=problem.target.coarser(COARSER[0]))
    yield "alpha wrap + tetwild", coarsest.target, lambda: wrapped(coarsest)


def _lattices(problem: Problem) -> Iterator[Way]:
    """A lattice for what is thin, and finer ones where it misses volume; only one of a given edge.

    Where bodies that touch come apart in all of them, beads join these in the finest affordable.
    Surfaces that are samples have thin places by their noise: they get no finer one for these, and
    no beads.
    """
    first, free = problem.target, problem.finer and not problem.target.edge_is_given
    if free and first.sharp:
        first = resolving(problem.solids, first, most=WHOLE_TETS)
    yield STUFFING, first, lambda: problem.solids
    for factor in FINER if free else ():
        aim = problem.target.coarser(1 / factor)
        if aim.tets > first.tets:
            yield STUFFING, aim, lambda: problem.solids
            first = aim if aim.tets <= WHOLE_TETS else first
    if first.sharp:
        yield STUFFING, replace(first, beads=True), lambda: problem.solids


def wrapped(problem: Problem) -> Solids:
    """One watertight shell around all solids, accepted by its volume, split by nearest part."""
    surface = problem.solids.surface
    wrap = problem.runner.run(
        "alpha_wrap",
        {"points": surface.points, "faces": surface.faces},
        {"alpha_rel": WRAP_ALPHA_REL, "offset_rel": ENVELOPE_SHARE * problem.target.epsilon_rel},
    )
    points, faces = wrap["points"], wrap["faces"]
    a, b, c = (points[faces[:, i]] for i in range(3))
    volume = enclosed_volume(Triangles(points, faces))
    enclosed = problem.volume.total
    if abs(volume - enclosed) > WRAP_VOLUME_TOLERANCE * enclosed:
        raise NoFilling(f"the wrap encloses {volume:.4g} m^3, the input {enclosed:.4g} m^3")
    part = surface.part[closest((a + b + c) / 3, surface.points, surface.faces).face]
    skin = Surface(points, faces, part, edge_components(faces))
    return replace(problem.solids, shells=(Shell(points, faces, part),), surface=skin)
