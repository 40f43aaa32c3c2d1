"""An asset's surfaces to one watertight tet mesh with a region for each part."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...fem.errors import NoVolumeError, UsageError
from ...fem.mesh import TetMesh
from ...predictors.asset import Asset, Part
from ..asset.cache import Runner
from ..asset.child import ChildFailure, Progress
from ..asset.repair import WELD_REL, Closing, RepairReport, repair
from ..asset.solids import Plates, Shell, Solids, hollowed, sheet_faces, thickened
from ..asset.surface import Surface
from ..asset.triangles import Triangles, closest, edge_components, enclosed_volume
from .ftetwild import EngineTarget, Filling, LatticeFit, NoFilling
from .guarantees import (
    BROKEN,
    ENVELOPE_SHARE,
    Attempt,
    ConversionReport,
    Distances,
    Engine,
    Guarantee,
    InputVolume,
    Region,
    ThinPieces,
    guarantees,
    input_volume,
    lattice_guarantees,
    measure_distances,
)
from .losses import MOST_LOST, FileLosses, FileSamples, FileSurface, losses
from .meshers import AUTO, FTETWILD, MESHERS, QUICK_TRIANGLES, STUFFING, chosen_mesher
from .messages import differences, left_out, likely_hollow, listed, no_mesh, no_volume, said
from .quality import Quality, quality
from .stuffing.mesher import resolving

VOLUME_TOLD = 0.01  # relative error of a part's volume in a lattice
GAP_TOLD = 1e-3  # share of all surface from which tets reach over a gap: four rays
THIN_TOLD = 0.05  # share of a part's surface where it is thinner than the lattice's edge


def tetrahedralize(
    asset: Asset,
    *,
    mesher: str = AUTO,
    edge_length_rel: float | None = None,
    epsilon_rel: float = 2e-3,
    edge_length: float | None = None,
    max_tets: int | None = None,
    layers: int = 1,
    thicken: float | None = None,
    wall: float | None = None,
    part_wall: Mapping[str, float] | None = None,
    solid: Sequence[str] = (),
    stop_energy: float = 20.0,
    time_limit: float = 300.0,
    memory_limit: int | None = None,
    accept_broken: bool = False,
    cache: Path | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> tuple[TetMesh, ConversionReport]:
    """Fill an asset [m] with tets, a region for each part: the mesh [m] and a report of proofs.

    Parameters
    ----------
    mesher
        Name in ``MESHERS``, or "auto": "stuffing" if sampled, and where fTetWild takes minutes.
        "ftetwild" keeps epsilon, "stuffing" good angles and the volume, in seconds.
    edge_length_rel, epsilon_rel
        Wanted edge, by default .05 or ``LATTICE_TETS`` tets in a lattice, and largest distance
        between the boundary and the input, as shares of the diagonal of the bounding box.
    edge_length, max_tets, layers
        Wanted edge [m] instead of ``edge_length_rel``; budget: edge and envelope grow to meet it;
        layers of tets wanted through thin places, where it allows them.
    thicken, wall, part_wall, solid
        Thickness [m] given to sheets, else left out; wall [m] of all closed parts, or the named
        ones, unless ``solid``; one thinner than epsilon is left to the material.
    stop_energy, time_limit, memory_limit
        AMIPS energy at which the engine is content with the tets' shape, 3 is the optimum; seconds
        and bytes that one attempt may take.
    accept_broken, cache, seed, progress
        Return the best mesh, with warnings, where none keeps its guarantees; folder of results;
        seed of the samples that check; called with (stage, seconds) meanwhile.

    Raises NoVolumeError where no part encloses a volume or no mesh keeps its guarantees.
    """
    diagonal, rng = float(np.linalg.norm(asset.size)), np.random.default_rng(seed)
    rel = edge_length_rel if edge_length is None else edge_length / diagonal
    target = EngineTarget.of(diagonal, rel, epsilon_rel, stop_energy, layers)
    target = target.on_lattice(max_tets, sharp=not asset.sampled)
    target = replace(target, most_triangles=QUICK_TRIANGLES if mesher == AUTO else None)
    walls = _walls(asset, wall, part_wall or {})
    names = asset.part_names
    held = {
        p: wall for p, wall in walls.items() if wall >= target.epsilon and names[p] not in solid
    }
    runner = Runner(time_limit, memory_limit, progress, cache).checked()
    preparation = Preparation.of(asset, thinnest=target.envelope, thicken=thicken, walls=held)
    problem, ready = _problem(asset, target, preparation, runner, rng, lossy=accept_broken)
    found = _found(asset, problem, mesher, max_tets, whole=ready.closing.whole)
    if found.made is None or not (found.kept or accept_broken):
        raise NoVolumeError(no_mesh(asset, found.record))
    made = found.made
    report = _report(asset, problem, made, found.record, ready, solid, seed)
    mesh = replace(made.mesh, points=made.mesh.points + asset.bounds.mean(axis=0))
    told = said(report, layers, max_tets)
    return mesh, replace(report, warnings=told, differences=differences(report))


def _problem(
    asset: Asset,
    target: EngineTarget,
    preparation: Preparation,
    runner: Runner,
    rng: np.random.Generator,
    *,
    lossy: bool,
) -> tuple[Problem, Prepared]:
    """The solids that are to be meshed and who judges the result, and how they were prepared."""
    ready = preparation.prepared(epsilon=target.epsilon, rng=rng)
    if not ready.solids.shells:
        raise NoVolumeError(no_volume(asset, target.envelope))
    if not (ready.losses.bearable or lossy):
        raise NoVolumeError(left_out(asset, ready.losses, target.envelope))
    volume = input_volume(ready.solids, len(asset.parts), rng=rng)
    judge = _judged(asset, ready, volume, rng)
    return Problem(ready.solids, target, volume, ready.again, runner, judge), ready


def _found(
    asset: Asset, problem: Problem, mesher: str, max_tets: int | None, *, whole: bool
) -> Attempts:
    """What the attempts of the ``mesher``, or of the automatic one, gave.

    The automatic one puts guarantees before the edge that a lattice was to have.
    """
    name = chosen_mesher(mesher, sampled=asset.sampled or whole)
    free = problem._replace(mesher=name, target=problem.target.unless_finer(problem.volume.total))
    if mesher == AUTO and not asset.sampled:
        return mesh_within(free, max_tets)
    found = mesh_within(problem._replace(mesher=name), max_tets)
    if mesher != AUTO or found.kept or not problem.target.edge_is_given:
        return found
    finer = mesh_within(free, max_tets)
    best = finer.made if finer.kept else found.made or finer.made
    return Attempts(best, found.record + finer.record)


def _judged(
    asset: Asset, ready: Prepared, volume: InputVolume, rng: np.random.Generator
) -> Callable[[Filling, float], Made]:
    """What measures a filling of the solids and holds it against epsilon [m]."""

    def judge(filling: Filling, epsilon: float) -> Made:
        mesh = _mesh(filling, asset.part_names)
        measured = quality(mesh)
        gaps = measure_distances(
            mesh, ready.solids, epsilon=epsilon, rng=rng, reference=ready.reference
        )
        if ready.preparation.walls:  # the inner side of a wall is far from the file too
            gaps = replace(gaps, bridged_share=0.0)
        if filling.lattice is None:
            promised = guarantees(mesh, measured, volume, gaps, epsilon, asset.part_names)
        else:
            parted = _parted_volume(filling.lattice, mesh, asset.part_names)
            promised = lattice_guarantees(mesh, measured, volume, parted)
        return Made(filling, mesh, gaps, measured, promised, epsilon)

    return judge


def _walls(asset: Asset, wall: float | None, part_wall: Mapping[str, float]) -> dict[int, float]:
    """Wall [m] by number of the part."""
    unknown = [name for name in part_wall if name not in asset.part_names]
    if unknown:
        raise UsageError(
            f"--part-wall names {unknown[0]!r}, the asset has {listed(asset.part_names, most=20)}"
        )
    walls = {} if wall is None else dict.fromkeys(range(len(asset.parts)), wall)
    walls |= {asset.part_names.index(name): value for name, value in part_wall.items()}
    bad = [value for value in walls.values() if not 0 < value < np.inf]
    if bad:
        raise UsageError(f"--wall and --part-wall must be lengths > 0 m, got {bad[0]:g}")
    return walls


def _mesh(filling: Filling, names: tuple[str, ...]) -> TetMesh:
    """Tets with a region for each part that has any."""
    present, region = np.unique(filling.part, return_inverse=True)
    return TetMesh(
        filling.mesh.points,
        filling.mesh.tets,
        region.reshape(-1).astype(np.int32),
        region_names=tuple(names[i] for i in present),
    )


def _report(
    asset: Asset,
    problem: Problem,
    made: Made,
    attempts: tuple[Attempt, ...],
    ready: Prepared,
    solid: Sequence[str],
    seed: int,
) -> ConversionReport:
    """Measure everything that the conversion promises."""
    hollow = likely_hollow(asset, made.mesh, ready.preparation.walls)
    mesh, solids, filling, names = made.mesh, problem.solids, made.filling, asset.part_names
    thin = _thin(solids.plates, names)
    missing = [name for name in names if name not in (*mesh.region_names, *thin.parts)]
    sheets = tuple(names[i] for i in solids.sheets if names[i] in missing)
    tets = np.bincount(mesh.region, minlength=len(mesh.region_names))
    return ConversionReport(
        repair=ready.repair,
        attempts=attempts,
        guarantees=(*made.guarantees, ready.kept_volume),
        quality=made.quality,
        regions=tuple(
            Region(
                name,
                int(count),
                float(filled),
                float(problem.volume.by_part[list(names).index(name)]),
            )
            for name, count, filled in zip(
                mesh.region_names, tets, mesh.region_volumes(), strict=True
            )
        ),
        diagonal=filling.target.diagonal,
        edge_length=filling.target.edge_length,
        epsilon=made.epsilon,
        input_volume=problem.volume.total,
        distances=made.gaps,
        split_edges=filling.mesh.split_edges,
        doubled_points=filling.mesh.doubled_points,
        layers=filling.target.layers,
        mesher=FTETWILD if filling.lattice is None else STUFFING,
        **_fit(filling.lattice, names),
        losses=ready.losses,
        sheets=sheets,
        thin=thin,
        lost=tuple(name for name in missing if name not in sheets),
        hollow=tuple(name for name in hollow if name not in solid),
        walls=tuple(names[p] for p in ready.preparation.walls if names[p] in mesh.region_names),
        whole=ready.closing.whole,
        seed=seed,
    )


def _thin(plates: Plates, names: Sequence[str]) -> ThinPieces:
    """What is said of the closed pieces that are left out."""
    if not len(plates.volume):
        return ThinPieces()
    parts = tuple(str(names[p]) for p in np.unique(plates.surface.part))
    thickness = plates.thickness_of(1 - MOST_LOST)
    return ThinPieces(len(plates.volume), parts, plates.thinnest, thickness)


def _fit(lattice: LatticeFit | None, names: Sequence[str]) -> dict[str, Any]:
    """Fields of the report for a lattice: the parts that it does not fit."""
    if lattice is None:
        return {}
    errors, shares, parted, closed, beads = lattice
    return {
        "beads": beads,
        "off_volume": tuple((names[p], e) for p, e in errors.items() if abs(e) > VOLUME_TOLD),
        "thin_parts": tuple((names[p], s) for p, s in shares.items() if s > THIN_TOLD),
        "fallen_apart": tuple((names[p], s) for p, s in parted.items()),
        "closed_gaps": tuple((names[p], s) for p, s in closed.items() if s > GAP_TOLD),
    }


def _parted_volume(lattice: LatticeFit, mesh: TetMesh, names: Sequence[str]) -> float:
    """Volume [m^3] of the pieces that have come off."""
    volume = dict(zip(mesh.region_names, mesh.region_volumes().tolist(), strict=True))
    return sum(share * volume[names[part]] for part, share in lattice.parted_shares.items())


# Attempts at a mesh: as asked, repaired harder, coarser, wrapped; every one is on record.

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
        made = _attempts_judged(problem, filling, filling.target.epsilon)
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


def _attempts_judged(problem: Problem, filling: Filling, epsilon: float) -> Made:
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
    again = _attempts_judged(problem, filling, made.epsilon)
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


# An asset's surfaces made ready: repaired, sorted into solids, held against the file as read.

# Ways to close what is open, until no volume is lost: piece by piece, all pieces together, either
# with caps larger than the piece itself, for those that are little more than a rim; without caps.
CLOSINGS = (
    Closing(),
    Closing(joint=True),
    Closing(largest=2.0),
    Closing(joint=True, largest=2.0),
    Closing(joint=True, whole=True),
)
MOST_GAINED = 0.25  # of the volume: with more that only caps enclose, a closing has filled a room


@dataclass(frozen=True)
class Preparation:
    """How surfaces become solids; lengths in metres.

    ``parts`` lie near the origin: far from it winding numbers and distances lose digits. Pieces
    thinner than ``thinnest`` are left out, sheets get the thickness ``thicken`` if any, solids the
    ``walls`` by number of their part.
    """

    parts: tuple[Part, ...]
    thinnest: float
    thicken: float | None
    walls: Mapping[int, float]

    @classmethod
    def of(
        cls, asset: Asset, *, thinnest: float, thicken: float | None, walls: Mapping[int, float]
    ) -> Preparation:
        """Take the bare parts of an asset, moved to the origin."""
        from trimesh import Trimesh

        centre = asset.bounds.mean(axis=0)
        parts = (
            replace(part, mesh=Trimesh(part.mesh.vertices - centre, part.mesh.faces, process=False))
            for part in asset.parts
        )
        return cls(tuple(parts), thinnest, thicken, walls)

    def prepared(self, *, epsilon: float, rng: np.random.Generator) -> Prepared:
        """Close the surfaces in the first way that loses no volume, or in the least lossy one."""
        file, tried = FileSamples.of(FileSurface.of(self.parts), rng=rng), []
        names = [part.name for part in self.parts]
        for closing in CLOSINGS:
            repaired, solids = self._solids(WELD_REL, closing)
            lost = losses(file, solids, names, distance=epsilon)
            if tried and lost.gained > max(tried[0].losses.gained, MOST_GAINED):
                continue
            tried.append(Prepared(solids, repaired, lost, self, closing, file.surface.read))
            if lost.bearable:
                break
        best = min(tried, key=lambda one: one.losses.lost)
        if self.thicken is not None:  # a sheet's volume closes no hole
            best = replace(best, losses=replace(best.losses, gained=0.0, capped=0.0))
        return replace(best, solids=hollowed(best.solids, self.walls))

    def again(self, weld_rel: float, closing: Closing) -> Solids:
        """Return the solids with another welding distance, a share of the diagonal."""
        return hollowed(self._solids(weld_rel, closing)[1], self.walls)

    def _solids(self, weld_rel: float, closing: Closing) -> tuple[RepairReport, Solids]:
        surface, repaired = repair(self.parts, weld_rel=weld_rel, closing=closing)
        if self.thicken is not None:
            sheet = sheet_faces(surface, thinnest=self.thinnest)
            surface = thickened(surface, sheet, self.thicken)
        solids = Solids.of(surface, len(self.parts), thinnest=self.thinnest, whole=closing.whole)
        return repaired, solids


@dataclass(frozen=True, eq=False)
class Prepared:
    """Solids, what repair changed, what they lack of the file; how they are prepared again."""

    solids: Solids
    repair: RepairReport
    losses: FileLosses
    preparation: Preparation
    closing: Closing
    read: Surface

    def again(self, weld_rel: float) -> Solids:
        """Return the solids with another welding distance, a share of the diagonal."""
        return self.preparation.again(weld_rel, self.closing)

    @property
    def kept_volume(self) -> Guarantee:
        """The promise that the solids hold next to all that the file encloses."""
        told = "share of the file's volume that is left out"
        return Guarantee(told, self.losses.lost, MOST_LOST)

    @property
    def reference(self) -> Surface | None:
        """Surface as read that distances are measured from; None where sheets were thickened."""
        return self.read if self.preparation.thicken is None else None
