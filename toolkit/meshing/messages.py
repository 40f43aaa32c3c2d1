"""What a conversion says in words: warnings, and why there is no mesh."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ...fem.mesh import TetMesh, boundary_faces
from ...fem.note import Note
from ...predictors.asset import Asset
from ...predictors.construction import IN_ITS_SHAPE, head_of_name, kinds_named
from ..asset.solids import hull_fraction
from . import FTETWILD, PARTICLES, STUFFING
from .guarantees import (
    BROKEN,
    LEFT_OUT,
    LOSS_TOLD,
    MOST_LOST,
    SHARE_TOLD,
    Attempt,
    ConversionReport,
    FileLosses,
)

MOST = 5  # names that a sentence lists
# Kinds of what is left out, of how it was made and what that blurs, and of what was open: of each
# there is one sentence.
OMITTED = ("floaters", "sheets", "thin", "lost", "sheet_share", "part_losses", "missed")
MAKING = ("too_long", "finer", "over_budget", "layers_given_up", "far", "misfit", "beads")
OPEN = ("whole", "capped", "bridged")
KEPT_BY = 0.95  # of a plate's thickness: the envelope that keeps it
FINEST = 1e-4  # of the diagonal: an epsilon that no engine keeps in an hour


def said(report: ConversionReport, layers: int = 1, max_tets: int | None = None) -> tuple[str, ...]:
    """Sentences about whatever a user would not expect who asked for so many layers and tets."""
    losses, distances, lattice = report.losses, report.distances, report.mesher != FTETWILD
    told: list[str] = [Note("messages.whole")] if report.whole else []
    holes, share = report.repair.closed_holes, distances.bridged_share
    if losses.capped > MOST_LOST:
        least = (1 - losses.capped) * report.input_volume
        got = report.quality.volume
        told.append(Note("messages.capped", share=losses.capped, least=least, got=got))
    elif share > LOSS_TOLD:
        told.append(Note("messages.bridged", share=share))
    elif share > SHARE_TOLD or (holes and not report.whole):
        told.append(Note("messages.holes", share=share))
    if report.floaters:
        share = report.floating
        told.append(Note("messages.floaters", count=report.floaters, share=share))
    if report.losses.swallowed:
        told.append(Note("messages.swallowed", parts=listed(report.losses.swallowed)))
    if pinched := report.quality.boundary.pinched_vertices:
        places = ["({:.3g}, {:.3g}, {:.3g}) m".format(*place) for place in report.pinched]
        at = ", ".join(places[:MOST]) + _more(len(places))
        told.append(Note("messages.pinched", count=pinched, at=at and f", around {at},"))
    if report.mesher == STUFFING:
        edge = report.edge_length
        if report.attempts[0].engine != STUFFING:
            why = report.attempts[0].outcome.removeprefix("time: ")
            told.append(Note("messages.too_long", why=why, edge=edge))
        far, *ends = max(
            (distances.to_input, "the boundary", "the input"),
            (distances.from_input, "the input", "the boundary"),
        )
        if far > edge:
            told.append(Note("messages.far", start=ends[0], end=ends[1], far=far, edge=edge))
        if report.finer:
            told.append(Note("messages.finer", edge=edge))
        if layers > 1:
            told.append(Note("messages.layers_of_lattice"))
    told += differences(report)
    if max_tets is not None and report.quality.tets > max_tets:
        told.append(Note("messages.over_budget", tets=report.quality.tets, most=max_tets))
    if report.layers < layers and not lattice:
        told.append(Note("messages.layers_given_up", layers=layers))
    if report.hollow:
        told.append(Note("messages.hollow", parts=listed(report.hollow)))
    failed = [attempt.outcome for attempt in report.attempts if attempt.outcome != "ok"]
    if report.mesher == STUFFING and report.attempts[0].engine != STUFFING:
        del failed[0]  # told above
    if failed and report.mesher != PARTICLES:
        count, why = len(report.attempts), "; ".join(failed)
        told.append(Note("messages.attempts", failed=len(failed), count=count, why=why))
    asked, kept = report.asked_epsilon, report.epsilon
    if kept > asked and not lattice:
        told.append(Note("messages.wider", kept=kept, asked=asked, edge=report.edge_length))
    for kinds in (OMITTED, MAKING, OPEN):
        alike = [note for note in told if getattr(note, "kind", "")[len("messages.") :] in kinds]
        if len(alike) > 1:  # before nobody reads them
            at, what = told.index(alike[0]), "; ".join(alike)
            told = [note for note in told if note not in alike]
            head = "left out: " if kinds is OMITTED else ""
            told.insert(at, Note("messages.alike", head=head, what=what))
    return tuple(told)


def differences(report: ConversionReport) -> tuple[str, ...]:
    """Sentences about what the mesh joins, cuts off, blurs or leaves out of the file's body."""
    named = report.losses.thin > MOST_LOST  # thin pieces say so by name
    told = [g.sentence for g in report.guarantees if not (g.ok or (named and g.name == LEFT_OUT))]
    edge = f"the lattice's edge of {report.edge_length:.3g} m"
    finer = "a shorter --edge-length or --mesher ftetwild"
    thinnest = f"the lattice's edge ({report.epsilon:.3g} m)"
    if report.mesher == PARTICLES:
        tried = "; ".join(one.outcome for one in report.attempts if one.outcome != "ok")
        why = f"no tet mesh was had ({tried}): " if tried else ""
        size, volume = report.edge_length, report.quality.volume
        known = {"size": size, "far": report.distances.largest, "cubes": round(volume / size**3)}
        off = volume / report.input_volume - 1
        told.append(Note("messages.particles", why=why, off=off, **known))
        finer, thinnest = "a shorter --edge-length", f"a cube ({size:.3g} m)"
    elif report.mesher != STUFFING:
        finer, thinnest = "a smaller --epsilon-rel", f"epsilon ({report.epsilon:.3g} m)"
    if report.part_losses:
        told.append(Note("messages.part_losses", parts=_places(report), finer=finer))
    misfits = []
    for what, shares, form in (
        ("volumes are off", [one for one in report.off_volume if one[1] > 0], "+.1%"),
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
            misfits.append(f"{what}: {parts}{_more(len(worst))}")
    if misfits:
        told.append(Note("messages.misfit", what="; ".join(misfits), finer=finer))
    if report.beads:
        share = report.beads / report.quality.volume
        told.append(Note("messages.beads", edge=edge, beads=report.beads, share=share, finer=finer))
    # What of the file is not in the mesh
    if report.sheets:
        told.append(Note("messages.sheets", parts=listed(report.sheets)))
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
        thick, parts = thin.thinnest, listed(thin.parts)
        told.append(
            Note("messages.thin", count=thin.count, thinnest=thick, parts=parts, much=much, way=way)
        )
    if report.lost:
        told.append(
            Note("messages.lost", parts=listed(report.lost), thinnest=thinnest, finer=finer)
        )
    if report.distances.sheet_share > SHARE_TOLD:
        told.append(Note("messages.sheet_share", share=report.distances.sheet_share))
    missed = report.distances.missed_share
    if missed > SHARE_TOLD and not (report.thin_parts or report.closed_gaps):
        told.append(Note("messages.missed", share=missed, thinnest=thinnest, finer=finer))
    return tuple(told)


def _places(report: ConversionReport) -> str:
    """What each part lacks: of its volume, where, and of its box; those that lack most."""
    worst = sorted(report.part_losses, key=lambda one: -max(one.volume, 1e-9))
    told = []
    for one in worst[:MOST]:
        facts = []
        if one.volume > LOSS_TOLD and one.place is not None:
            place = ", ".join(f"{x:.2g}" for x in one.place)
            facts.append(f"{one.volume:.1%} of its volume around ({place}) m")
        if one.shorter > 0:
            facts.append(f"{one.shorter:.2g} m of its box")
        told.append(f"{one.name!r} {' and '.join(facts)}")
    return "; ".join(told) + _more(len(worst))


def listed(names: Sequence[str], most: int = MOST) -> str:
    """Quoted names, the first few of many."""
    return ", ".join(repr(name) for name in names[:most]) + _more(len(names), most)


def _more(count: int, most: int = MOST) -> str:
    """How many names of so many are not listed."""
    return f" and {count - most} more" if count > most else ""


def no_volume(asset: Asset, thinnest: float) -> Note:
    """Why an asset has nothing to fill: no part is thicker than ``thinnest`` [m]."""
    parts, count = listed(asset.part_names), len(asset.parts)
    return Note("messages.no_volume", name=asset.name, count=count, thinnest=thinnest, parts=parts)


def left_out(asset: Asset, lost: FileLosses, thinnest: float) -> Note:
    """Why there is no mesh of a body that would lack too much of what its file encloses."""
    worst = sorted((p for p in lost.parts if p.volume > MOST_LOST), key=lambda p: -p.volume)
    at = f" ({listed([part.name for part in worst])})" if worst and len(asset.parts) > 1 else ""
    share = lost.lost
    return Note("messages.left_out", name=asset.name, share=share, at=at, thinnest=thinnest)


def no_mesh(asset: Asset, attempts: Sequence[Attempt]) -> Note:
    """Why no attempt gave a mesh, or none that keeps what a conversion promises."""
    what, lattices = "tet mesh", all(attempt.engine == STUFFING for attempt in attempts)
    if any(attempt.outcome.startswith(BROKEN) for attempt in attempts):
        what, way = f"{what} that keeps its guarantees", "--accept-broken gives the best of them"
        if lattices:
            way = f"a shorter --edge-length or more --max-tets, or neither, may keep them; {way}"
    elif lattices:
        way = "a shorter --edge-length or --mesher ftetwild may help"
    else:
        heaviest = max(asset.parts, key=lambda part: len(part.mesh.faces))
        most, total = len(heaviest.mesh.faces), sum(len(part.mesh.faces) for part in asset.parts)
        way = Note("messages.heaviest", part=heaviest.name, most=most, total=total)
    tried = "; ".join(f"{a.engine} at epsilon {a.epsilon:.3g} m: {a.outcome}" for a in attempts)
    return Note(
        "messages.no_mesh", name=asset.name, what=what, count=len(attempts), tried=tried, way=way
    )


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
