"""An asset's surfaces to one watertight tet mesh with a region for each part."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...fem.errors import NoVolumeError, UsageError
from ...fem.scene.mesh import TetMesh
from ...predictors.asset import Asset
from ..native.cache import Runner
from ..native.child import Progress
from ..surfaces.solids import Plates
from .attempts import Attempts, Made, Problem, mesh_within
from .conversion_report import (
    Attempt,
    ConversionReport,
    InputVolume,
    Region,
    ThinPieces,
    guarantees,
    input_volume,
    measure_distances,
)
from .engine_run import EngineTarget, Filling, LatticeFit
from .lattice_guarantees import lattice_guarantees
from .losses import MOST_LOST
from .meshers import AUTO, FTETWILD, QUICK_TRIANGLES, STUFFING, chosen_mesher
from .messages import differences, left_out, likely_hollow, listed, no_mesh, no_volume, said
from .preparation import Preparation, Prepared
from .quality import quality

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
    held = _held(asset, _walls(asset, wall, part_wall or {}), target.epsilon, solid)
    runner = Runner(time_limit, memory_limit, progress, cache).checked()
    preparation = Preparation.of(asset, thinnest=target.envelope, thicken=thicken, walls=held)
    problem, ready = _problem(asset, target, preparation, runner, rng, lossy=accept_broken)
    found = _found(asset, problem, mesher, max_tets, whole=ready.closing.whole)
    made = _kept(asset, found, accept_broken)
    report = _report(asset, problem, made, found.record, ready, solid, seed)
    mesh = replace(made.mesh, points=made.mesh.points + asset.bounds.mean(axis=0))
    return mesh, _worded(report, layers, max_tets)


def _worded(report: ConversionReport, layers: int, max_tets: int | None) -> ConversionReport:
    told = said(report, layers, max_tets)
    return replace(report, warnings=told, differences=differences(report))


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


def _kept(asset: Asset, found: Attempts, accept_broken: bool) -> Made:
    """The best mesh, unless it breaks what a conversion promises."""
    if found.made is None or not (found.kept or accept_broken):
        raise NoVolumeError(no_mesh(asset, found.record))
    return found.made


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


def _held(
    asset: Asset, walls: Mapping[int, float], thinnest: float, solid: Sequence[str]
) -> dict[int, float]:
    """Walls [m] that the mesh is to have: not of ``solid`` parts, nor below ``thinnest``."""
    names = asset.part_names
    return {p: wall for p, wall in walls.items() if wall >= thinnest and names[p] not in solid}


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
    return ConversionReport(
        repair=ready.repair,
        attempts=attempts,
        guarantees=(*made.guarantees, ready.kept_volume),
        quality=made.quality,
        regions=_regions(mesh, names, problem.volume),
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


def _regions(mesh: TetMesh, names: Sequence[str], volume: InputVolume) -> tuple[Region, ...]:
    tets = np.bincount(mesh.region, minlength=len(mesh.region_names))
    return tuple(
        Region(name, int(count), float(filled), float(volume.by_part[list(names).index(name)]))
        for name, count, filled in zip(mesh.region_names, tets, mesh.region_volumes(), strict=True)
    )
