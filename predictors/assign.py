"""From clauses to the material of every part: words where they settle it, else a predictor."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from ..fem.errors import UsageError
from ..fem.note import Note
from ..fem.table import MaterialTable, key, load_table
from .appearance.features import Appearance
from .asset import UpAxis
from .grid import PartVoxels
from .partition import alike, merged
from .prediction import Numbered, PartChoice, Prediction
from .predictor import PREDICTORS, Predictor
from .regions.division import (
    Regions,
    apart,
    carve,
    cut,
    divided,
    of_matters,
    region_name,
    region_numbers,
)
from .resolve.resolve import RetrievalPredictor, lookup_of
from .text.clauses import Bound, BoundPart


def predict_materials(
    parts: PartVoxels,
    bound: Bound,
    *,
    predictor: Predictor | str,
    overrides: Mapping[str, str] | None = None,
    materials: Mapping[str, str] | None = None,
    values: Mapping[str, Mapping[str, float]] | None = None,
    alpha: float | None = None,
    samples: int = 0,
    volumes: Sequence[float] | None = None,
    within: Callable[[int, float], float] | None = None,
    usual: Mapping[str, tuple[str, str]] | None = None,
    up: UpAxis = "z",
    appearance: Callable[[], Appearance] | None = None,
    regions_of: Callable[[], Regions] | None = None,
    table: MaterialTable | None = None,
    regions: Mapping[int | Point, str] | None = None,
) -> Prediction:
    """Return the material of every part; what is one thing several times is found once.

    A part that is one thing for the modeller and several for the speaker is divided: into regions,
    each given to the clause that speaks of it, or left whole where that is unsure.

    parts: The cells [m] of every part.
    bound: What the user says of the object, and of which part.
    predictor: Who finds what words leave open, or its name in ``PREDICTORS``.
    overrides, materials, values, alpha, volumes, within: As ``Lookup.settle`` takes them; volumes
        [m^3], depths [m].
    samples: How many plausible materials to draw of every part that words leave open.
    usual: By part a kind of thing and its usual material, for where no word names another.
    up: The axis that points up.
    appearance: Gives what is seen of the cells; called only where words leave a part open.
    regions_of: Gives the regions of the cells, called only where one is asked for; by default they
        are cut by what is seen.
    table: The materials, by default those of the package.
    regions: Text for single regions, by number from 1 as the prediction numbers them, or by a
        point [m] that is in them or nearest to them.
    Raises UsageError: Where a part, a material or the predictor is unknown, a part is stated twice,
        ``alpha`` is to move, or ``samples`` to draw, what a predictor finds that cannot do it.
    """
    if both := {key(name) for name in overrides or {}} & {key(name) for name in materials or {}}:
        raise UsageError("assign.part_both", both=min(both))
    if samples < 0:
        raise UsageError("assign.samples_wanted", samples=samples)
    if isinstance(predictor, str) and (samples or predictor not in PREDICTORS):
        if not PREDICTORS[predictor].takes_samples:
            able = " or ".join(name for name in PREDICTORS if PREDICTORS[name].takes_samples)
            raise UsageError("assign.samples_finds", predictor=predictor, able=able)
    options = {"table": table, "samples": samples}  # a table of the user's own is its table too
    table = table or load_table()
    lookup = lookup_of(table)
    seen = None if appearance is None else cache(appearance)
    cut_up = regions_of or (lambda: _cut(given, seen, up))
    retrieves = predictor == "retrieval" or isinstance(predictor, RetrievalPredictor)
    given, overrides = parts, dict(overrides or {})
    parents = tuple(range(len(parts.part_names)))
    whole: Regions | None = None
    if regions:
        whole = cut_up()
        cells = _chosen(parts, whole, regions)
        overrides |= {name: text for name, (_, text) in cells.items()}
        taken = {name: mine for name, (mine, _) in cells.items() if name not in parts.part_names}
        parts, parents = carve(parts, taken)
        extra = len(parts.part_names) - len(given.part_names)
        bound = replace(bound, parts=(*bound.parts, *[BoundPart()] * extra))
    fixed = {"overrides": overrides, "materials": materials, "values": values, "alpha": alpha}
    volumes = parts.volumes if whole or volumes is None else volumes
    settled = lookup.settle(
        parts.part_labels, bound, volumes=volumes, within=_of_parents(within, parents), **fixed
    )
    kinds = usual or {}
    choices = [
        _as_usual(one, *kinds[one.part], table) if one.part in kinds else one
        for one in settled.choices
    ]
    left_open = [i for i, c in enumerate(choices) if not c.settled and i in parts.part]
    warnings, pieces = settled.warnings, None
    # without an asset, by shape alone, the network of voxels divides better
    cut_before = seen is not None and region_numbers(given.part_names) is not None
    things = 1 if cut_before else len(given.part_names)
    several = seen is not None and len(bound.sentence.clauses) > things
    clauses = of_matters(bound.sentence) if several else []
    if things > 1:  # what is said of parts by their names is not of regions
        named = bound.named
        clauses = [k for k in clauses if k not in named]
    if len(clauses) > 1 and not retrieves:
        stated = {key(name) for each in (overrides, materials, values) for name in each or {}}
        # of the only part there is words say more than its one choice can hold; of regions of one
        # thing too, unless they name one by its number
        by_number = [cut_before and "name" in one.how for one in bound.parts]
        among = [
            i for i in np.unique(parts.part[parts.occupied]).tolist()
            if ((things == 1 and not by_number[i]) or i in left_open)
            and key(parts.part_names[i]) not in stated
        ]  # fmt: skip
        whole = whole or cut_up()
        if among and whole.region.any():
            thing = [0] * len(parents) if cut_before else parents
            told = {
                i: choices[i].row.name for i, parent in enumerate(parents)
                if i not in among and (cut_before or i != parent)
            }  # fmt: skip
            known = {"of": thing, "told": told, "encoder": lookup.kernel.encoder, "table": table}
            pieces = divided(parts, among, bound, clauses, whole, **known)
    if pieces is not None:
        parts, parents = pieces.parts, tuple(parents[i] for i in pieces.parents)
        within_piece = _of_parents(within, parents)
        again = lookup.settle(
            parts.part_labels, pieces.bound, volumes=parts.volumes, within=within_piece, **fixed
        )
        choices = list(again.choices)
        for i, binding in pieces.bindings.items():
            why = Note("regions.why", clause=binding.clause or "")
            choices[i] = replace(
                choices[i], binding=binding, why=why, settled=i not in pieces.unsaid
            )
        warnings = tuple(dict.fromkeys((*pieces.notes, *again.warnings)))
        left_open = [i for i in pieces.unsaid if i in parts.part]
    numbered = whole and _numbered(parts, whole)
    if not left_open:
        made = Prediction.of(parts, choices, bound.sentence, alpha=alpha)
        return replace(made, parents=parents, warnings=warnings, regions=numbered)
    if isinstance(predictor, str):  # loaded where words leave something open, and not before
        kind = PREDICTORS[predictor]
        predictor = kind(**{name: value for name, value in options.items() if value})
    if alpha is not None and not predictor.takes_alpha:
        able = " or ".join(name for name in PREDICTORS if PREDICTORS[name].takes_alpha)
        raise UsageError("assign.alpha_moves", part=choices[left_open[0]].part, able=able)
    first = alike(parts, left_open, [c.clause and c.clause.span for c in choices])
    known = {"choices": choices, "appearance": seen, "up": up, "alpha": alpha}
    found = predictor.predict(merged(parts, first), bound.sentence, **known)
    found = found.for_each(parts, first)
    of_given = tuple(parents[i] for i in found.parents)
    return replace(found, parents=of_given, warnings=warnings, regions=numbered)


Point = tuple[float, float, float]


def _as_usual(choice: PartChoice, kind: str, material: str, table: MaterialTable) -> PartChoice:
    """The usual ``material`` of a part's ``kind`` where no word of text or name decided it."""
    if not material or not choice.guessed or choice.clause or not choice.understood:
        return choice
    row, alpha, why = table.exact(material), choice.alpha, Note("assign.usual", kind=kind)
    return PartChoice(choice.part, row, row.value(alpha), 1.0, alpha, why, guessed=True)


def _numbered(parts: PartVoxels, regions: Regions) -> Numbered:
    """Number and colour of each region, from 1."""
    number = np.zeros(parts.part.shape, dtype=int)
    number[parts.occupied] = regions.region + 1
    size = np.bincount(regions.region).clip(min=1)
    sums = [np.bincount(regions.region, channel) for channel in regions.looks[:, :3].T]
    return Numbered(number, np.stack(sums, axis=1) / size[:, None])


def _cut(parts: PartVoxels, seen: Callable[[], Appearance] | None, up: UpAxis) -> Regions:
    """Cut all parts into regions, none of which crosses from one part to another."""
    regions = cut(np.argwhere(parts.occupied), seen() if seen else None, up)
    return apart(regions, parts.part[parts.occupied])


def _chosen(
    parts: PartVoxels, regions: Regions, texts: Mapping[int | Point, str]
) -> dict[str, tuple[np.ndarray, str]]:
    """Cells (nx, ny, nz) and text of each region that is chosen, by name."""
    cells, count = np.argwhere(parts.occupied), int(regions.region.max()) + 1
    out = {}
    for which, text in texts.items():
        if isinstance(which, int):
            number = which
            if not (regions.region == number - 1).any():
                raise UsageError("assign.no_region", number=number, count=count)
        else:
            nearest = np.square(parts.grid.to_world(cells) - np.asarray(which)).sum(axis=1).argmin()
            number = int(regions.region[nearest]) + 1
        mine = np.zeros(parts.part.shape, dtype=bool)
        mine[tuple(cells[regions.region == number - 1].T)] = True
        out[region_name(number)] = (mine, text)
    return out


def _of_parents(
    within: Callable[[int, float], float] | None, parents: Sequence[int]
) -> Callable[[int, float], float] | None:
    """``within`` for pieces: as of the part that each is of."""
    return within and (lambda i, depth: within(parents[i], depth))
