"""What a conversion says in words: warnings, and why there is no mesh."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

from ...fem.scene.mesh import TetMesh
from ...predictors.asset import Asset
from ...predictors.hearing.vocabulary import name_words
from ..surfaces.repair import MOST_CROSSED
from .conversion_report import BROKEN, SHARE_TOLD, Attempt, ConversionReport

# Words of things whose closed surface usually stands for a shell; two words may make one of them.
HOLLOW = frozenset(
    "cupboard cabinet wardrobe closet drawer dresser bottle vase jar jug kettle teapot bucket bin "
    "box chest barrel tank pipe tube lampshade fridge freezer oven washing boiler balloon case "
    "casing housing hull helmet bookcase suitcase briefcase toolbox mailbox dustbin".split()
)


def said(report: ConversionReport, *, layers: int = 1) -> tuple[str, ...]:
    """Sentences about whatever a user would not expect who asked for so many ``layers``."""
    sentences = list(report.failed)
    if report.layers < layers:
        sentences.append(
            f"{layers} layers of tets through thin places are more than --max-tets allows: "
            "given up; a larger --max-tets keeps them"
        )
    if report.repair.crossing_faces is None:
        sentences.append(f"self-intersections are not counted: more than {MOST_CROSSED} triangles")
    if report.sheets:
        sentences.append(
            f"{listed(report.sheets)}: a sheet without volume, not meshed; --thicken gives it one"
        )
    if report.thin:
        sentences.append(
            f"{report.thin} closed pieces thinner than half of epsilon ({report.epsilon:.3g} m) "
            "are left out; a smaller --epsilon-rel keeps them"
        )
    if report.lost:
        sentences.append(
            f"{listed(report.lost)}: thinner than epsilon ({report.epsilon:.3g} m) or covered by "
            "other parts, has no tets; a smaller --epsilon-rel keeps thin parts"
        )
    if report.distances.sheet_share > SHARE_TOLD:
        sentences.append(
            f"{report.distances.sheet_share:.1%} of the surface has no volume on either side, is "
            "not in the mesh"
        )
    if report.distances.missed_share > SHARE_TOLD:
        sentences.append(
            f"{report.distances.missed_share:.1%} of the surface is on plates or gaps thinner than "
            f"epsilon ({report.epsilon:.3g} m), which the mesh lacks; a smaller --epsilon-rel "
            "keeps them"
        )
    if report.hollow:
        sentences.append(
            f"{listed(report.hollow)}: taken as solid, though by its name a shell is likely; "
            "--wall METRES or --part-wall NAME=METRES hollows it"
        )
    failed = [attempt for attempt in report.attempts if attempt.outcome != "ok"]
    if failed:
        sentences.append(
            f"{len(failed)} of {len(report.attempts)} attempts failed "
            f"({'; '.join(attempt.outcome for attempt in failed)})"
        )
    if report.epsilon > report.asked_epsilon:
        sentences.append(
            f"the distance that is kept is epsilon {report.epsilon:.3g} m, not the "
            f"{report.asked_epsilon:.3g} m asked for; the wanted edge is {report.edge_length:.3g} m"
        )
    return tuple(sentences)


def listed(names: Sequence[str], most: int = 5) -> str:
    """Quoted names, the first few of many."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(repr(name) for name in names[:most]) + more


def no_volume(asset: Asset, thinnest: float) -> str:
    """Why an asset has nothing to fill: no part is thicker than ``thinnest`` [m]."""
    return (
        f"{asset.name}: none of its {len(asset.parts)} parts encloses a volume thicker than "
        f"{thinnest:.3g} m ({listed(asset.part_names)}); --thicken METRES gives sheets a "
        "thickness, a smaller --epsilon-rel keeps thin plates"
    )


def no_mesh(asset: Asset, attempts: Sequence[Attempt]) -> str:
    """Why no attempt gave a mesh, or none that keeps what a conversion promises."""
    if any(attempt.outcome.startswith(BROKEN) for attempt in attempts):
        what, way = "tet mesh that keeps its guarantees", "--accept-broken gives the best of them"
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
    """Names of parts filled as solids though their words are those of hollow things."""
    return tuple(
        part.name
        for number, part in enumerate(asset.parts)
        if number not in walls
        and part.name in mesh.region_names
        and _hollow(" ".join((part.name, *part.labels, asset.name)))
    )


def _hollow(names: str) -> bool:
    """Whether a word of the names, or two that stand together, is that of a hollow thing."""
    words = name_words(names)
    return not HOLLOW.isdisjoint([*words, *(a + b for a, b in pairwise(words))])
