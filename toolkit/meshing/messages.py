"""What a conversion says in words: warnings, and why there is no mesh."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from ...fem.mesh import TetMesh, boundary_faces
from ...predictors.asset import Asset
from ...predictors.construction import IN_ITS_SHAPE, head_of_name, kinds_named
from ..asset.repair import MOST_CROSSED
from ..asset.solids import hull_fraction
from .guarantees import BROKEN, MOST_LOST, SHARE_TOLD, Attempt, ConversionReport, FileLosses
from .meshers import STUFFING

MOST = 5  # names that a sentence lists
KEPT_BY = 0.95  # of a plate's thickness: the envelope that keeps it
FINEST = 1e-4  # of the diagonal: an epsilon that no engine keeps in an hour


def said(report: ConversionReport, layers: int = 1, max_tets: int | None = None) -> tuple[str, ...]:
    """Sentences about whatever a user would not expect who asked for so many layers and tets."""
    sentences, losses, distances = [], report.losses, report.distances
    if report.whole:
        sentences.append(
            "the file's open pieces close no body: inside is what they surround by their winding "
            "number, and its boundary in their gaps is a guess; close them in a modeller"
        )
    if distances.bridged_share > SHARE_TOLD:
        sentences.append(
            f"{distances.bridged_share:.1%} of the boundary closes holes: the file has no surface "
            "there"
        )
    if losses.capped > MOST_LOST:
        least = (1 - losses.capped) * report.input_volume
        sentences.append(
            f"{losses.capped:.0%} of the volume is inside only since holes were closed: the file "
            f"encloses {least:.3g} m^3 for certain, the mesh {report.quality.volume:.3g} m^3"
        )
    if report.mesher == STUFFING:
        if report.attempts[0].engine != STUFFING:
            sentences.append(
                f"fTetWild takes too long ({report.attempts[0].outcome.removeprefix('time: ')}): a "
                f"lattice of {report.edge_length:.3g} m was cut to the surface instead, which "
                "keeps no epsilon; --mesher ftetwild tries on"
            )
        far, ends = max(
            (distances.to_input, ("the boundary", "the input")),
            (distances.from_input, ("the input", "the boundary")),
        )
        if far > report.edge_length:
            sentences.append(
                f"{ends[0]} is up to {far:.3g} m from {ends[1]}, more than the lattice's edge of "
                f"{report.edge_length:.3g} m; --mesher ftetwild keeps epsilon"
            )
        if layers > 1:
            sentences.append(
                "--layers is for --mesher ftetwild: a lattice has the same edge everywhere"
            )
    sentences += differences(report)
    if max_tets is not None and report.quality.tets > max_tets:
        sentences.append(
            f"{report.quality.tets:,} tets are more than --max-tets {max_tets:,}: no coarser mesh "
            "kept its guarantees"
        )
    if report.layers < layers and report.mesher != STUFFING:
        sentences.append(
            f"{layers} layers of tets through thin places are more than --max-tets allows: "
            "given up; a larger --max-tets keeps them"
        )
    if report.repair.crossing_faces is None:
        sentences.append(f"self-intersections are not counted: more than {MOST_CROSSED} triangles")
    if report.hollow:
        sentences.append(
            f"{listed(report.hollow)}: filled with tets, though by its name a shell is likely; "
            "--wall METRES or --part-wall NAME=METRES gives it a wall of tets, else `assign` may "
            "give it the apparent material of one"
        )
    failed = [attempt for attempt in report.attempts if attempt.outcome != "ok"]
    if failed:
        sentences.append(
            f"{len(failed)} of {len(report.attempts)} attempts failed "
            f"({'; '.join(attempt.outcome for attempt in failed)})"
        )
    if report.epsilon > report.asked_epsilon and report.mesher != STUFFING:
        sentences.append(
            f"the distance that is kept is epsilon {report.epsilon:.3g} m, not the "
            f"{report.asked_epsilon:.3g} m asked for; the wanted edge is {report.edge_length:.3g} m"
        )
    return tuple(sentences)


def differences(report: ConversionReport) -> tuple[str, ...]:
    """Sentences about what the mesh joins, cuts off, blurs or leaves out of the file's body."""
    return (*report.failed, *_misfits(report), *_left_out(report))


def _left_out(report: ConversionReport) -> Iterator[str]:
    """What of the file is not in the mesh."""
    length = "the lattice's edge" if report.mesher == STUFFING else "epsilon"
    thinnest = f"{length} ({report.epsilon:.3g} m)"
    if report.sheets:
        yield f"{listed(report.sheets)}: a sheet without volume, not meshed; --thicken gives it one"
    if report.thin.count:
        # Which closed pieces are left out, how much that is, and what would keep them
        thin, share = report.thin, report.losses.thin
        much = f", {share:.0%} of the volume that the file encloses," if share > SHARE_TOLD else ""
        keeping = 2 * KEPT_BY * thin.thickness / report.diagonal
        way = (
            f"--epsilon-rel {keeping:.2g} keeps them"
            if keeping > FINEST
            else f"they are {thin.thickness:.2g} m thick, too thin for tets"
        )
        yield (
            f"{thin.count} closed pieces thinner than {thin.thinnest:.3g} m, "
            f"of {listed(thin.parts)}{much} are left out; {way}"
        )
    if report.lost:
        yield (
            f"{listed(report.lost)}: thinner than {thinnest} or covered by other parts, "
            f"has no tets; {_finer(report)} keeps thin parts"
        )
    if report.distances.sheet_share > SHARE_TOLD:
        yield (
            f"{report.distances.sheet_share:.1%} of the surface has no volume on either side, is "
            "not in the mesh"
        )
    if report.distances.missed_share > SHARE_TOLD:
        yield (
            f"{report.distances.missed_share:.1%} of the surface is on plates or gaps thinner than "
            f"{thinnest}, which the mesh lacks or blurs; {_finer(report)} keeps them"
        )


def _misfits(report: ConversionReport) -> Iterator[str]:
    """What a lattice is too coarse for; nothing of another mesher."""
    edge = f"the lattice's edge of {report.edge_length:.3g} m"
    for what, shares, form in (
        ("volumes are off", report.off_volume, "+.1%"),
        ("shares of volumes fell off", report.fallen_apart, ".1%"),
        (f"thinner than {edge} in places, where shapes are blurred", report.thin_parts, ".0%"),
        (
            f"gaps narrower than {edge} are filled, and join what is apart, at shares of surface",
            report.closed_gaps,
            ".1%",
        ),
    ):
        if shares:
            worst = sorted(shares, key=lambda one: -abs(one[1]))
            parts = ", ".join(f"{name!r} ({share:{form}})" for name, share in worst[:MOST])
            yield f"{what}: {parts}{_more(len(worst))}; {_finer(report)} keeps them"
    if report.beads:
        yield (
            f"bodies that touch in the file would come apart at {edge}: beads of "
            f"{report.beads:.2g} m^3 ({report.beads / report.quality.volume:.2%} of the mesh) "
            f"join them; {_finer(report)} does without"
        )


def _finer(report: ConversionReport) -> str:
    """Option that makes that length smaller."""
    lattice = report.mesher == STUFFING
    return "a shorter --edge-length or --mesher ftetwild" if lattice else "a smaller --epsilon-rel"


def listed(names: Sequence[str], most: int = MOST) -> str:
    """Quoted names, the first few of many."""
    return ", ".join(repr(name) for name in names[:most]) + _more(len(names), most)


def _more(count: int, most: int = MOST) -> str:
    """How many names of so many are not listed."""
    return f" and {count - most} more" if count > most else ""


def no_volume(asset: Asset, thinnest: float) -> str:
    """Why an asset has nothing to fill: no part is thicker than ``thinnest`` [m]."""
    return (
        f"{asset.name}: none of its {len(asset.parts)} parts encloses a volume thicker than "
        f"{thinnest:.3g} m ({listed(asset.part_names)}); --thicken METRES gives sheets a "
        "thickness, a smaller --epsilon-rel keeps thin plates"
    )


def left_out(asset: Asset, lost: FileLosses, thinnest: float) -> str:
    """Why there is no mesh of a body that would lack too much of what its file encloses."""
    worst = sorted((p for p in lost.parts if p.volume > MOST_LOST), key=lambda p: -p.volume)
    where = f" ({listed([part.name for part in worst])})" if worst and len(asset.parts) > 1 else ""
    return (
        f"{asset.name}: {lost.lost:.0%} of the volume that the file encloses would be left out"
        f"{where}: open pieces that do not close, or plates thinner than {thinnest:.3g} m; close "
        "them in a modeller, --thicken METRES gives sheets a thickness, a smaller --epsilon-rel "
        "keeps thin plates, --accept-broken goes without them"
    )


def no_mesh(asset: Asset, attempts: Sequence[Attempt]) -> str:
    """Why no attempt gave a mesh, or none that keeps what a conversion promises."""
    if any(attempt.outcome.startswith(BROKEN) for attempt in attempts):
        what, way = "tet mesh that keeps its guarantees", "--accept-broken gives the best of them"
        if all(attempt.engine == STUFFING for attempt in attempts):
            way = f"a shorter --edge-length or more --max-tets, or neither, may keep them; {way}"
    elif all(attempt.engine == STUFFING for attempt in attempts):
        what, way = "tet mesh", "a shorter --edge-length or --mesher ftetwild may help"
    else:
        heaviest = max(asset.parts, key=lambda part: len(part.mesh.faces))
        most, total = len(heaviest.mesh.faces), sum(len(part.mesh.faces) for part in asset.parts)
        what = "tet mesh"
        way = (
            "a longer --time-limit or a larger --epsilon-rel may help, or a simpler "
            f"{heaviest.name!r}, which has {most} of the {total} triangles"
        )
    tried = "; ".join(f"{a.engine} at epsilon {a.epsilon:.3g} m: {a.outcome}" for a in attempts)
    return f"{asset.name}: no {what} after {len(attempts)} attempts ({tried}); {way}"


def likely_hollow(asset: Asset, mesh: TetMesh, walls: Mapping[int, float]) -> tuple[str, ...]:
    """Names of parts filled as solids though they, or the asset, are called a hollow thing.

    A part that fills little of its hull is not: its walls are in its shape.
    """
    hollow = []
    for number, part in enumerate(asset.parts):
        names = (part.name, *part.labels, asset.name)
        kinds = [kind for name in names for kind in kinds_named(head_of_name(name))]
        shell = any(kind.hollow != "never" for kind in kinds)
        if shell and number not in walls and part.name in mesh.region_names:
            tets = mesh.tets[mesh.region == mesh.region_names.index(part.name)]
            if hull_fraction(mesh.points, boundary_faces(tets).faces) >= IN_ITS_SHAPE:
                hollow.append(part.name)
    return tuple(hollow)
