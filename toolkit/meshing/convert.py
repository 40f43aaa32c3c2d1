"""An asset's surfaces, or tets that exist already, to one mesh with a region for each part."""

from __future__ import annotations

import hashlib
import logging
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...converters.mesh.meshdata import read_data
from ...fem.errors import NoVolumeError, UsageError
from ...fem.mesh import TetMesh, boundary_faces, signed_volumes
from ...predictors.asset import Asset, Part, PlainMesh, UpAxis
from ..asset.cache import Runner
from ..asset.child import ChildFailure, Progress
from ..asset.load import Unit, scaled
from ..asset.repair import WELD_REL, Closing, RepairReport, repair
from ..asset.solids import Shell, Solids, hollowed, sheet_faces, thickened
from ..asset.surface import Surface
from ..asset.triangles import Triangles, closest, edge_components, enclosed_volume
from . import AUTO, FTETWILD, MESHERS, OR_PARTICLES, PARTICLES, STUFFING, chosen_mesher
from .ftetwild import FORESEEN, EngineTarget, Filling, LatticeFit, NoFilling
from .guarantees import (
    BROKEN,
    ENVELOPE_SHARE,
    LATTICE_VOLUME,
    LEFT_OUT,
    MOST_LOST,
    Attempt,
    ConversionReport,
    Distances,
    Engine,
    FileLosses,
    FileSamples,
    FileSurface,
    Guarantee,
    InputVolume,
    Region,
    ThinPieces,
    guarantees,
    input_volume,
    lattice_guarantees,
    losses,
    measure_distances,
    mesh_losses,
    separate,
    sound,
)
from .messages import differences, left_out, likely_hollow, listed, no_mesh, no_volume, said
from .quality import Quality, quality
from .stuffing.pieces import SPECK, pieces_of, without_floaters

# Of the surface through splats or points: a body that lacks more of it is another one.
MOST_GUESSED = 0.4
# Of the volume: pieces of such a body that a lattice may cut off; told, as they may be real.
SCATTERED = 0.25
# What a lattice may miss without a warning.
BAD_VOLUME = 0.01  # relative error of a part's volume in a lattice
CLOSED_SURFACE = 1e-3  # share of all surface from which tets reach over a gap: four rays
THIN_SURFACE = 0.05  # share of a part's surface where it is thinner than the lattice's edge


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
    keep: str | None = None,
    first: Callable[[TetMesh], None] | None = None,
    cache: Path | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> tuple[TetMesh, ConversionReport]:
    """Fill an asset [m] with tets, a region for each part: the mesh [m] and a report of proofs.

    mesher: Name in ``MESHERS``, or "auto": "stuffing" if sampled, and where fTetWild takes minutes.
        "ftetwild" keeps epsilon, "stuffing" good angles and the volume, in seconds; "particles"
        are cubes, which "auto-or-particles" takes where no mesh keeps its guarantees.
    edge_length_rel, epsilon_rel: Wanted edge, by default .05 or ``LATTICE_TETS`` tets in a lattice,
        and largest distance between the boundary and the input, as shares of the diagonal of the
        bounding box.
    edge_length, max_tets, layers: Wanted edge [m] instead of ``edge_length_rel``; budget: edge and
        envelope grow to meet it; layers of tets wanted through thin places, where it allows them.
    thicken, wall, part_wall, solid: Thickness [m] given to sheets, else left out; wall [m] of all
        closed parts, or the named ones, unless ``solid``; one thinner than epsilon is left to the
        material.
    stop_energy, time_limit, memory_limit: AMIPS energy at which the engine is content with the
        tets' shape, 3 is the optimum; seconds and bytes that one attempt may take.
    keep, first: Loose pieces that stay, as ``without_floaters`` takes them; called with a lattice,
        once, where fTetWild takes more than ``FORESEEN`` seconds.
    accept_broken, cache, seed, progress: Return the best mesh, with warnings, where none keeps its
        guarantees; folder of results; seed of the samples that check; called with (stage, seconds)
        meanwhile.
    Raises NoVolumeError where no part encloses a volume or no mesh keeps its guarantees.:
    """
    particles = mesher == OR_PARTICLES
    mesher = AUTO if particles else mesher
    asset, floaters, floating = without_floaters(asset, keep)
    diagonal, rng = float(np.linalg.norm(asset.size)), np.random.default_rng(seed)
    rel = edge_length_rel if edge_length is None else edge_length / diagonal
    target = EngineTarget.of(
        diagonal, rel, epsilon_rel, stop_energy=stop_energy, layers=layers, max_tets=max_tets,
        sharp=not asset.sampled, hurried=mesher == AUTO,
    )  # fmt: skip
    names, by_name = asset.part_names, dict(part_wall or {})
    if unknown := [name for name in by_name if name not in names]:
        listing = listed(names, most=20)
        raise UsageError(f"--part-wall names {unknown[0]!r}, the asset has {listing}")
    if wall is not None:
        by_name = dict.fromkeys(names, wall) | by_name
    if bad := [value for value in by_name.values() if not 0 < value < np.inf]:
        raise UsageError(f"--wall and --part-wall must be lengths > 0 m, got {bad[0]:g}")
    walls = {
        names.index(name): thickness
        for name, thickness in by_name.items()
        if thickness >= target.epsilon and name not in solid
    }
    runner = Runner(time_limit, memory_limit, progress, cache).checked()
    preparation = Preparation.of(asset, thinnest=target.envelope, thicken=thicken, walls=walls)
    ready = preparation.prepared(epsilon=target.epsilon, rng=rng)
    if not ready.solids.shells:
        raise NoVolumeError(no_volume(asset, target.envelope))
    scattered = asset.sampled and ready.losses.lost_area > MOST_GUESSED
    if scattered and not accept_broken:
        raise NoVolumeError("messages.scattered", name=asset.name, share=ready.losses.lost_area)
    if not (ready.losses.bearable or accept_broken):
        raise NoVolumeError(left_out(asset, ready.losses, target.envelope))
    volume = input_volume(
        ready.solids, len(asset.parts), rng=rng, crossing=ready.repair.crossing_faces != 0
    )
    name = chosen_mesher(mesher, sampled=asset.sampled or ready.closing.whole)
    problem = Problem(asset, ready, volume, target, runner, rng, name, max_tets)
    centre = asset.bounds.mean(axis=0)
    if first is not None and name == AUTO:
        waiting = [first]

        def meanwhile(seconds: float) -> None:
            """Show a lattice once, in what time fTetWild still takes."""
            if seconds > FORESEEN and waiting:
                show, guess = waiting.pop(), replace(problem, rng=np.random.default_rng(seed))
                made, _ = _tried(guess, *next(_lattices(guess)))
                if made is not None:
                    show(replace(made.mesh, points=made.mesh.points + centre))

        problem = replace(problem, runner=replace(runner, meanwhile=meanwhile))
    best, attempts = mesh_within(problem)
    tried = target.edge_is_given and any(attempt.engine == STUFFING for attempt in attempts)
    if mesher == AUTO and tried and (best is None or best.broken):
        # Guarantees before the edge that the lattice was to have
        free = replace(problem, target=target.unless_finer(volume.total), mesher=STUFFING)
        other, more = mesh_within(free)
        best = other if best is None or (other and not other.broken) else best
        attempts += more
    if particles and (best is None or best.broken):
        free = replace(problem, target=replace(target, edge_is_given=False), mesher=PARTICLES)
        other, more = mesh_within(free)
        if other is not None and not other.broken:
            best, attempts = other, attempts + more
    if best is None or (best.broken and not accept_broken):
        raise NoVolumeError(no_mesh(asset, attempts))
    report = _report(problem, best, attempts, solid, seed)
    lattice = target.edge_is_given and best.filling.lattice is not None
    finer = lattice and report.edge_length < target.edge_length
    report = replace(report, floaters=floaters, floating=floating, finer=finer)
    mesh = replace(best.mesh, points=best.mesh.points + centre)
    sentences = said(report, layers, max_tets)
    return mesh, replace(report, warnings=sentences, differences=differences(report))


def _report(
    problem: Problem, made: Made, attempts: tuple[Attempt, ...], solid: Sequence[str], seed: int
) -> ConversionReport:
    """Everything that the conversion promises, and what a user would not expect."""
    asset, ready, mesh, filling = problem.asset, problem.ready, made.mesh, made.filling
    by_cells = PARTICLES if attempts[-1].engine == PARTICLES else STUFFING
    names, walls, plates = asset.part_names, ready.preparation.walls, ready.solids.plates
    thin, count = ThinPieces(), len(plates.volume)
    if count:
        left = tuple(names[p] for p in np.unique(plates.surface.part))
        thin = ThinPieces(count, left, plates.thinnest, plates.thickness_of(1 - MOST_LOST))
    missing = [name for name in names if name not in (*mesh.region_names, *thin.parts)]
    sheets = tuple(names[i] for i in ready.solids.sheets if names[i] in missing)
    tets = np.bincount(mesh.region, minlength=len(mesh.region_names)).tolist()
    volumes = mesh.region_volumes().tolist()
    boxes = [np.array(part.mesh.bounds) for part in ready.preparation.parts]
    by_part = dict(zip(names, problem.volume.by_part.tolist(), strict=True))
    fit = filling.lattice or LatticeFit({}, {}, {}, {})

    def named(shares: Mapping[int, float], least: float = 0.0) -> tuple[tuple[str, float], ...]:
        return tuple((names[part], s) for part, s in shares.items() if abs(s) > least)

    return ConversionReport(
        repair=ready.repair,
        attempts=attempts,
        guarantees=(*made.guarantees, Guarantee(LEFT_OUT, ready.losses.lost, MOST_LOST)),
        quality=made.quality,
        regions=tuple(
            Region(name, count, volume, by_part[name])
            for name, count, volume in zip(mesh.region_names, tets, volumes, strict=True)
        )
        + tuple(Region(name, 0, 0.0, by_part[name]) for name in missing),
        diagonal=filling.target.diagonal,
        edge_length=filling.target.edge_length,
        epsilon=made.epsilon,
        input_volume=problem.volume.total,
        distances=made.distances,
        split_edges=filling.mesh.split_edges,
        doubled_points=filling.mesh.doubled_points,
        mended_vertices=filling.mesh.mended,
        pinched=tuple(map(tuple, filling.mesh.pinched + asset.bounds.mean(axis=0))),
        layers=filling.target.layers,
        mesher=FTETWILD if filling.lattice is None else by_cells,
        beads=fit.beads,
        off_volume=named(fit.volume_errors, BAD_VOLUME),
        thin_parts=named(fit.thin_shares, THIN_SURFACE),
        fallen_apart=named(fit.parted_shares),
        closed_gaps=named(fit.closed_shares, CLOSED_SURFACE),
        losses=ready.losses,
        part_losses=tuple(
            replace(one, place=tuple(np.array(one.place) + asset.bounds.mean(axis=0)))
            for one in mesh_losses(ready.file, mesh, names, boxes)
        ),
        sheets=sheets,
        thin=thin,
        lost=tuple(name for name in missing if name not in sheets),
        hollow=tuple(name for name in likely_hollow(asset, mesh, walls) if name not in solid),
        walls=tuple(names[p] for p in walls if names[p] in mesh.region_names),
        whole=ready.closing.whole,
        seed=seed,
    )


# The attempts: as asked, repaired harder, coarser, wrapped; each is judged and put on record.

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
WHOLE_TETS = 250_000  # that a lattice of no given edge may have, whatever it cuts apart
BEADS_COST = 5.0  # times what the lattice took, of a fence of 274,095 tets
FULLER = 1.25  # times the tets that were wanted a lattice of thin parts has
PARTED = 0.005  # of a part's volume that may come off before a lattice is made finer: crumbs
NO_REPAIR_HELPS = ("time", BROKEN)  # such outcomes are the same with vertices welded harder
WRAP_ALPHA_REL = 0.02  # share of the diagonal: holes below this size are bridged
WRAP_VOLUME_TOLERANCE = 0.1  # a wrap that changes the volume by more is a shell, not the solid


class Made(NamedTuple):
    """A filling as a mesh with regions, and what was measured about it at ``epsilon`` [m]."""

    filling: Filling
    mesh: TetMesh
    distances: Distances
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
        most = 0.0 if lattice is None else max(lattice.parted_shares.values(), default=0.0)
        return most if most > PARTED else 0.0

    @property
    def rank(self) -> tuple[int, float, float]:
        """The lower, the better: broken guarantees, loose pieces, the distance in epsilons."""
        return len(self.broken), self.parted, self.distances.largest / self.epsilon


@dataclass(frozen=True, eq=False)
class Problem:
    """Solids that enclose a ``volume``, what is asked of their tets, and who makes them.

    ``mesher`` is a name of ``MESHERS``, or ``AUTO``: the first, and a lattice where it takes too
    long. Within a budget of ``max_tets`` none that is too coarse is made finer.
    """

    asset: Asset
    ready: Prepared
    volume: InputVolume
    target: EngineTarget
    runner: Runner
    rng: np.random.Generator
    mesher: str
    max_tets: int | None

    def judged(self, filling: Filling, epsilon: float) -> Made:
        """Measure a filling of the solids and hold it against ``epsilon`` [m].

        Of surfaces that are samples specks of tets are left out: their thin places are noise.
        """
        if self.asset.sampled and filling.lattice is not None:
            piece, volumes = pieces_of(filling.mesh.tets), signed_volumes(*filling.mesh[:2])
            size = np.bincount(piece, weights=volumes)
            kept = (size >= SPECK * size.sum())[piece]
            used, tets = np.unique(filling.mesh.tets[kept], return_inverse=True)
            mesh = filling.mesh._replace(
                points=filling.mesh.points[used], tets=tets.reshape(-1, 4).astype(np.int32),
                origin=filling.mesh.origin[kept],
            )  # fmt: skip
            filling = filling._replace(mesh=mesh, part=filling.part[kept])
        names = self.asset.part_names
        present, region = np.unique(filling.part, return_inverse=True)
        mesh = TetMesh(
            filling.mesh.points,
            filling.mesh.tets,
            region.reshape(-1).astype(np.int32),
            region_names=tuple(names[i] for i in present),
        )
        measured = quality(mesh)
        distances = measure_distances(
            mesh, self.ready.solids, epsilon=epsilon, rng=self.rng, reference=self.ready.reference
        )
        if self.ready.preparation.walls:  # the inner side of a wall is far from the file too
            distances = replace(distances, bridged_share=0.0)
        if filling.lattice is None:
            kept = guarantees(mesh, measured, self.volume, distances, epsilon, names)
        else:
            volumes = dict(zip(mesh.region_names, mesh.region_volumes().tolist(), strict=True))
            parted = filling.lattice.parted_shares.items()
            off = sum(share * volumes[names[part]] for part, share in parted)
            most = SCATTERED if self.asset.sampled else LATTICE_VOLUME
            kept = lattice_guarantees(mesh, measured, self.volume, off, most)
        return Made(filling, mesh, distances, measured, kept, epsilon)


def mesh_within(problem: Problem) -> tuple[Made | None, tuple[Attempt, ...]]:
    """Make a mesh, and again with a coarser target while it has more than ``max_tets`` tets.

    Layers of thin places are given up first: they cost the most.
    """
    best, record = make_mesh(problem)
    for _ in range(BUDGET_ROUNDS):
        if best is None or problem.max_tets is None or len(best.mesh.tets) <= problem.max_tets:
            break
        target = best.filling.target
        if target.layers > 1:
            target = replace(target, layers=1)
        else:
            target = target.coarser(BUDGET_MARGIN * (len(best.mesh.tets) / problem.max_tets) ** 0.5)
        made, more = make_mesh(replace(problem, target=target))
        record += more
        if made is not None and (best.broken or not made.broken):
            best = made
    return best, record


def make_mesh(problem: Problem) -> tuple[Made | None, tuple[Attempt, ...]]:
    """Try one way after the other until a mesh keeps its guarantees; all attempts are on record.

    A mesh counts at the epsilon of its own attempt, which is what the report states. After a
    time-out or a broken guarantee the coarser ones are next: more repair helps neither. A lattice
    that cuts more than ``PARTED`` off a thin part is followed by finer ones, and by one that joins
    what touches. Where every mesh breaks a guarantee, the best one is returned.
    """
    started = time.process_time() + problem.runner.clock.seconds
    record: list[Attempt] = []
    costs: list[float] = []  # seconds a tet of lattices so far
    best: Made | None = None
    for engine, aim, prepare in _ways(problem, record):
        if aim.beads and (best is None or not best.parted):
            continue
        by_tetwild = engine not in (STUFFING, PARTICLES)
        same = by_tetwild and aim is problem.target
        if record and same and record[-1].outcome.startswith(NO_REPAIR_HELPS):
            continue
        if best is not None and not best.broken and by_tetwild:
            break
        # A lattice costs as many seconds a tet as those before it, with beads a few times as many.
        foretold = max((cost * aim.tets for cost in costs), default=0.0)
        foretold *= BEADS_COST if aim.beads else 1.0
        spent = time.process_time() + problem.runner.clock.seconds - started
        if best is not None and not by_tetwild and spent + foretold > problem.runner.time_limit:
            outcome = f"time: a finer lattice would take {foretold:.0f} s of CPU more"
            record.append(Attempt(engine, aim.edge_length, aim.epsilon, 0.0, outcome))
            continue
        made, attempt = _tried(problem, engine, aim, prepare)
        record.append(attempt)
        if not by_tetwild:
            costs.append(attempt.seconds / aim.tets)
        if made is None:
            continue
        missed = made.broken or not made.distances.good(made.epsilon)
        if problem.max_tets is None and by_tetwild and missed:
            # In a narrower envelope, for spikes and corners that this one cut off. It may take a
            # few times as long: an improvement, not worth a long wait.
            limit = TIGHTER_START + TIGHTER_TIME * attempt.seconds
            tighter = replace(aim, epsilon_rel=aim.epsilon_rel / TIGHTER, most_seconds=limit)
            again, attempt = _tried(
                problem, "tetwild", tighter, lambda: problem.ready.solids, made.epsilon
            )
            record.append(attempt)
            worst = len(made.broken), max(made.distances.largest, made.epsilon)
            if again and (len(again.broken), again.distances.largest) <= worst:
                made = again
        best = made if best is None else min(best, made, key=lambda one: one.rank)
        if not made.broken and not made.parted:
            break
    return best, tuple(record)


def _tried(
    problem: Problem,
    engine: Engine,
    aim: EngineTarget,
    prepare: Callable[[], Solids],
    epsilon: float | None = None,
) -> tuple[Made | None, Attempt]:
    """One attempt, judged at ``epsilon`` [m], by default its own; None where it gave no mesh."""
    started, filling = time.process_time() + problem.runner.clock.seconds, None
    try:
        mesher = MESHERS[engine if engine in MESHERS else FTETWILD]
        filling = mesher(prepare(), aim, problem.runner)
        outcome, aim = "ok", filling.target
    except ChildFailure as failure:
        outcome = f"{failure.kind}: {failure}"
    except NoFilling as failure:
        outcome = f"rejected: {failure}"
    seconds = time.process_time() + problem.runner.clock.seconds - started
    log.info("%s: %s after %.1f s", engine, outcome, seconds)
    made = None
    if filling is not None:
        epsilon = aim.epsilon if epsilon is None else epsilon
        made = problem.judged(filling, epsilon)
        if made.broken and filling.by_cells is not None:
            try:
                other = problem.judged(filling.by_cells(), epsilon)
                made = min(made, other, key=lambda one: one.rank)
            except NoFilling as failure:
                log.info("by cells: %s", failure)
        if made.broken:
            outcome = f"{BROKEN}: {'; '.join(made.broken)}"
        elif made.parted:
            outcome = f"in pieces: a part lost {made.parted:.2%} of itself"
    return made, Attempt(engine, aim.edge_length, aim.epsilon, seconds, outcome)


Way = tuple[Engine, EngineTarget, Callable[[], Solids]]


def _ways(problem: Problem, record: Sequence[Attempt]) -> Iterator[Way]:
    """What to try one after the other; solids are prepared only when their turn comes.

    ``record`` grows meanwhile: with ``AUTO`` a time-out is followed by a lattice, not by others.
    """
    target, ready = problem.target, problem.ready

    def welded_harder() -> Solids:
        _, solids = ready.preparation.solids(HARDER_WELD_REL, ready.closing)
        return hollowed(solids, ready.preparation.walls)

    if problem.mesher == STUFFING:
        yield from _lattices(problem)
        return
    if problem.mesher == PARTICLES:
        yield PARTICLES, target, lambda: ready.solids
        return
    yield "tetwild", target, lambda: ready.solids
    yield "tetwild", target, welded_harder
    if problem.mesher == AUTO and any(attempt.outcome.startswith("time") for attempt in record):
        yield from _lattices(problem)
    for factor in COARSER:
        yield "tetwild", target.coarser(factor), lambda: ready.solids
    coarsest = target.coarser(COARSER[0])
    yield "alpha wrap + tetwild", coarsest, lambda: wrapped(problem, coarsest.epsilon_rel)


def _lattices(problem: Problem) -> Iterator[Way]:
    """A lattice for what is thin, and finer ones where it misses volume; only one of a given edge.

    Where bodies that touch come apart in all of them, beads join these in the finest affordable.
    Surfaces that are samples have thin places by their noise: they get no finer one for these, and
    no beads.
    """
    first, solids, most = problem.target, problem.ready.solids, int(WHOLE_TETS / FULLER)
    free = problem.max_tets is None and not first.edge_is_given
    if free and first.sharp:
        from .stuffing.mesher import resolving

        first = resolving(solids, first, most=most)
    yield STUFFING, first, lambda: solids
    for factor in FINER if free else ():
        aim = problem.target.coarser(1 / factor)
        aim = replace(aim, tets=min(aim.tets, most))
        if aim.tets > first.tets:
            yield STUFFING, aim, lambda: solids
            first = aim
    if first.sharp:
        yield STUFFING, replace(first, beads=True), lambda: solids


def wrapped(problem: Problem, epsilon_rel: float) -> Solids:
    """One watertight shell around all solids, accepted by its volume, split by nearest part."""
    surface, enclosed = problem.ready.solids.surface, problem.volume.total
    wrap = problem.runner.run(
        "alpha_wrap",
        {"points": surface.points, "faces": surface.faces},
        {"alpha_rel": WRAP_ALPHA_REL, "offset_rel": ENVELOPE_SHARE * epsilon_rel},
    )
    points, faces = wrap["points"], wrap["faces"]
    volume = enclosed_volume(Triangles(points, faces))
    if abs(volume - enclosed) > WRAP_VOLUME_TOLERANCE * enclosed:
        raise NoFilling(f"the wrap encloses {volume:.4g} m^3, the input {enclosed:.4g} m^3")
    part = surface.part[closest(points[faces].mean(axis=1), surface.points, surface.faces).face]
    skin = Surface(points, faces, part, edge_components(faces))
    return replace(problem.ready.solids, shells=(Shell(points, faces, part),), surface=skin)


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
        centre = asset.bounds.mean(axis=0)
        parts = (
            replace(part, mesh=PlainMesh(part.mesh.vertices - centre, part.mesh.faces))
            for part in asset.parts
        )
        return cls(tuple(parts), thinnest, thicken, walls)

    def prepared(self, *, epsilon: float, rng: np.random.Generator) -> Prepared:
        """Close the surfaces in the first way that loses no volume, or in the least lossy one."""
        file, tried = FileSamples.of(FileSurface.of(self.parts), rng=rng), []
        names = [part.name for part in self.parts]
        for closing in CLOSINGS:
            repaired, solids = self.solids(WELD_REL, closing, file.surface.oriented)
            lost = losses(file, solids, names, distance=epsilon)
            if tried and lost.gained > max(tried[0].losses.gained, MOST_GAINED):
                continue
            reference = file.surface.read if self.thicken is None else None
            tried.append(Prepared(solids, repaired, lost, self, closing, reference, file))
            if lost.bearable:
                break
        best = min(tried, key=lambda one: one.losses.lost)
        if self.thicken is not None:  # a sheet's volume closes no hole
            best = replace(best, losses=replace(best.losses, gained=0.0, capped=0.0))
        return replace(best, solids=hollowed(best.solids, self.walls))

    def solids(
        self, weld_rel: float, closing: Closing, start: tuple[Surface, RepairReport] | None = None
    ) -> tuple[RepairReport, Solids]:
        """Repair and sort the surfaces; vertices nearer than a share of the diagonal are one."""
        surface, repaired = repair(self.parts, weld_rel=weld_rel, closing=closing, start=start)
        if self.thicken is not None:
            sheet = sheet_faces(surface, thinnest=self.thinnest)
            surface = thickened(surface, sheet, self.thicken)
        solids = Solids.of(surface, len(self.parts), thinnest=self.thinnest, whole=closing.whole)
        return repaired, solids


@dataclass(frozen=True, eq=False)
class Prepared:
    """Solids, what repair changed, what they lack of the file; how they are prepared again.

    ``reference`` is the surface as read that distances are measured from; None where sheets were
    thickened.
    """

    solids: Solids
    repair: RepairReport
    losses: FileLosses
    preparation: Preparation
    closing: Closing
    reference: Surface | None
    file: FileSamples


SUFFIXES = (".msh", ".vtk", ".vtu", ".mesh")


class ImportedTets(NamedTuple):
    """A tet mesh [m] from a file, its outer surfaces as an asset, and what was measured."""

    asset: Asset
    mesh: TetMesh
    report: ConversionReport


def import_tets(
    path: str | Path,
    *,
    size: float | None = None,
    units: Unit | None = None,
    up: UpAxis | None = None,
) -> ImportedTets:
    """Take over a tet mesh: its regions become parts, only its boundary is made manifold.

    path: File of one of ``SUFFIXES``.
    size, units, up: As for ``load_asset``.
    Raises InputError: Where the file cannot be read, holds no tet, or a tet is flat.
    """
    path = Path(path)
    data = read_data(path)
    given = data.mesh
    # The closed surface of every region, in the units of the file
    parts = []
    for number, name in enumerate(given.region_names):
        faces = boundary_faces(given.tets[given.region == number]).faces
        if len(faces):
            used, index = np.unique(faces, return_inverse=True)
            surface = PlainMesh(given.points[used], index.reshape(-1, 3))
            parts.append(Part(name, surface, (name,)))
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    asset = scaled(
        Asset(
            path.stem, tuple(parts), source=str(path), source_hash=digest, warnings=data.warnings
        ),
        size=size,
        units=units,
        up=up,
    )
    apart = separate(given.points * asset.metres_per_unit, given.tets)
    mesh = TetMesh(
        apart.points, apart.tets, given.region[apart.origin], region_names=given.region_names
    )
    if given.material is not None and not apart.split_edges:
        mesh = mesh.with_material(given.material)
    # What can be measured without a surface to compare with
    measured, volumes = quality(mesh), mesh.region_volumes()
    tets = np.bincount(mesh.region, minlength=len(mesh.region_names))
    a, b = mesh.points[mesh.tets[:, 0]], mesh.points[mesh.tets[:, 1]]
    report = ConversionReport(
        repair=RepairReport(),
        attempts=(),
        guarantees=sound(mesh, measured),
        quality=measured,
        regions=tuple(
            Region(name, int(n), float(v), float(v))
            for name, n, v in zip(mesh.region_names, tets, volumes, strict=True)
        ),
        diagonal=float(np.linalg.norm(np.ptp(mesh.bounds, axis=0))),
        edge_length=float(np.median(np.linalg.norm(b - a, axis=1))),
        epsilon=0.0,
        input_volume=mesh.volume,
        distances=Distances(0.0, 0.0),
        split_edges=apart.split_edges,
        doubled_points=apart.doubled_points,
    )
    return ImportedTets(asset, mesh, report)
