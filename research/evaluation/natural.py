"""Natural sentences on real things in one piece: of the volume, how much gets the right material.

As ``assign`` does it, the reader included: the slots of the file are the truth and are seen by
nobody. A cell is right where it has the row of the clause that speaks of its slot; slots of which
nothing is said are not scored.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np

from ...fem.table import MaterialTable, load_table
from ...predictors.appearance.features import Appearance
from ...predictors.assign import predict_materials
from ...predictors.film.predictor import FilmPredictor
from ...predictors.grid import Grid, PartVoxels
from ...predictors.prediction import Prediction
from ...predictors.regions.division import cut
from ...predictors.text.one_piece import of_one_piece
from ...predictors.text.reader import read_sentence
from ..datasets.natural import Natural
from ..datasets.one_piece import OnePiece
from ..datasets.real import CELLS
from ..datasets.region_sets import in_baked_light, row_of

MANY = 5  # clauses or more are one column
RESAMPLES = 4000  # of the objects, for 95 % intervals
BINS = (0.0, 0.6, 0.7, 0.8, 0.9, 1.0)
NETWORK, SCAN, WORN, CLICK, FILM = (
    "network", "network, scan", "network, scan with baked light", "network, one click",
    "FiLM's voxels",
)  # fmt: skip
LARGEST, FIRST = "largest everywhere", "first clause everywhere"
CEILING, CEILING_SCAN = "ceiling of the regions", "ceiling of the regions, scan"


@dataclass(frozen=True)
class Scored:
    """What came of one sentence: the right share of the scored volume by row of the table.

    ``certainty`` is what was said of it, None where no network was asked; ``whole`` whether the
    thing was left in one piece; ``foreign`` the share of the scored volume that got a material of
    no clause as it was read, ``read`` that of the clauses whose row was read.
    """

    key: str
    clauses: int
    right: dict[str, float]
    certainty: float | None
    whole: bool
    foreign: float
    read: float


def as_seen(piece: OnePiece, *, scan: bool = False) -> tuple[PartVoxels, Appearance]:
    """Return the thing as one part without a name, and how it looks; a scan has colours alone."""

    def grid(values: np.ndarray, outside: float) -> np.ndarray:
        out = np.full((*(CELLS,) * 3, *values.shape[1:]), outside, dtype=values.dtype)
        out[tuple(piece.cells.T)] = values
        return out

    part = grid(np.zeros(len(piece.cells), dtype=int), -1)
    parts = PartVoxels(Grid(np.zeros(3), 1 / CELLS, part.shape), part, ("object",))
    colours = grid(piece.looks[:, :3], 0)
    if scan:
        return parts, Appearance(colours)
    return parts, Appearance(
        colours, finish=grid(piece.looks[:, 3:], 0), shell=grid(piece.shell, -1)
    )


def score(
    natural: Natural, piece: OnePiece, table: MaterialTable, *, film: FilmPredictor | None = None
) -> Scored | None:
    """Score what is made of one sentence; None where fewer than two clauses have a volume."""
    rows = np.array([row_of(clause.material, table) for clause in natural.clauses])
    truth = natural.clause_of(piece.slots)[piece.slot]
    scored = truth >= 0
    volume = np.bincount(truth[scored], minlength=len(rows))
    if (volume > 0).sum() < 2:
        return None
    wanted, at = rows[truth], tuple(piece.cells.T)
    right: dict[str, float] = {}
    parts, seen = as_seen(piece)
    colours = as_seen(piece, scan=True)[1]
    labels = parts.part_labels
    bound = of_one_piece(read_sentence(natural.text, labels, table), labels, table)
    known: dict[str, Any] = {"predictor": "film", "table": table}

    def assigned(shown: Appearance, **given: Any) -> Prediction:
        return predict_materials(parts, bound, appearance=lambda: shown, **known, **given)

    def rows_of(made: Prediction) -> np.ndarray:
        return np.array([choice.row.name for choice in made.choices])[made.parts.part[at]]

    def share(made: Prediction) -> float:
        return float((rows_of(made) == wanted)[scored].mean())

    def ceiling(made: Prediction) -> tuple[float, np.ndarray]:
        """Share that the best clause of each region gives, and that clause."""
        assert made.regions is not None
        region = made.regions.number[at] - 1
        table_of = np.zeros((region.max() + 1, len(rows)))
        np.add.at(table_of, (region[scored], truth[scored]), 1)
        return float(table_of.max(axis=1).sum() / scored.sum()), table_of.argmax(axis=1)

    uncut = cut(piece.cells, seen, "z")
    made = assigned(seen, regions_of=lambda: uncut)
    right[NETWORK] = share(made)
    bindings = [choice.binding for choice in made.choices if choice.binding]
    got = rows_of(made)
    read = {table.exact(one.material).name for one in bound.sentence.clauses if one.material}
    foreign = float((~np.isin(got, [*read]))[scored].mean())
    if made.regions is not None:
        right[CEILING], best = ceiling(made)
        # the user names the region where most is wrong
        region = made.regions.number[at] - 1
        wrong = (got != rows[best][region]) & scored
        right[CLICK] = right[NETWORK]
        if wrong.any():
            worst = int(np.bincount(region[wrong]).argmax())
            text = natural.clauses[best[worst]].material
            clicked = assigned(seen, regions_of=lambda: uncut, regions={worst + 1: text})
            right[CLICK] = share(clicked)
    made_scan = assigned(colours)
    right[SCAN] = share(made_scan)
    if made_scan.regions is not None:
        right[CEILING_SCAN] = ceiling(made_scan)[0]
    worn = in_baked_light(piece, np.random.default_rng(0)).looks[:, :3]
    shown = Appearance(np.zeros_like(colours.colours))
    shown.colours[at] = worn  # type: ignore
    right[WORN] = share(assigned(shown))
    if film is not None:  # the only part is left to it, whatever words make of it
        choices = film.lookup.settle(parts.part_labels, bound, volumes=parts.volumes).choices
        left = [replace(choice, settled=False) for choice in choices]
        right[FILM] = share(
            film.predict(parts, bound.sentence, choices=left, appearance=lambda: seen)
        )
    right[LARGEST] = float(volume.max() / scored.sum())
    right[FIRST] = float(volume[0] / scored.sum())
    return Scored(
        natural.key, len(rows), right, bindings[0].certainty if bindings else None,
        len(made.choices) == 1, foreign, float(np.isin(rows, [*read]).mean()),
    )  # fmt: skip


def evaluate_natural(
    naturals: Sequence[Natural],
    pieces: Iterable[tuple[str, OnePiece]],
    *,
    film: bool = True,
    progress: Callable[[str, float], None] | None = None,
) -> dict[str, Any]:
    """Score all sentences.

    Parameters
    ----------
    naturals
        Sentences about real objects.
    pieces
        The objects, by key.
    film
        Whether the FiLM network is asked too.
    progress
        Called with the object and the seconds so far.

    Returns
    -------
    dict
        ``rows``: right share of the volume with its 95 % interval over objects, less the largest
        clause's, and by number of clauses; ``calibration``: what was said, and what was right.
    """
    table, began = load_table(), time.monotonic()
    predictor = cache(FilmPredictor)
    scored = []
    count = len({one.key for one in naturals})
    for number, (key, piece) in enumerate(pieces):
        for natural in (one for one in naturals if one.key == key):
            if progress:
                taken = time.monotonic() - began
                left = f", {taken * (count - number) / number:.0f} s left" if number else ""
                progress(f"{number + 1} of {count}: {key}, {piece.name}{left}", taken)
            found = score(natural, piece, table, film=predictor() if film else None)
            if found is not None:
                scored.append(found)
    rows = []
    names = list(dict.fromkeys(name for one in scored for name in one.right))
    for name in names:
        there = [one for one in scored if name in one.right]
        values = np.array([one.right[name] for one in there])
        less = values - np.array([one.right[LARGEST] for one in there])
        by = {}
        for count in range(2, MANY + 1):
            mine = values[[min(one.clauses, MANY) == count for one in there]]
            by[f"of_{count}"] = float(mine.mean()) if len(mine) else None
        rows.append({
            "row": name, "right": float(values.mean()), "interval": interval(values),
            "less_largest": float(less.mean()), "less_interval": interval(less),
            "objects": len(there), **by,
        })  # fmt: skip
    sure = np.array([one.certainty for one in scored if one.certainty is not None])
    good = np.array([one.right[NETWORK] for one in scored if one.certainty is not None])
    calibration = [
        {
            "said_from": low, "said_to": high, "objects": int(there.sum()),
            "said": float(sure[there].mean()), "right": float(good[there].mean()),
        }
        for low, high in pairwise(BINS)
        if (there := (sure >= low) & ((sure < high) | (high == 1.0))).any()
    ]  # fmt: skip
    return {
        "rows": rows, "calibration": calibration,
        "left_whole": sum(one.whole for one in scored),
        "foreign": float(np.mean([one.foreign for one in scored])),
        "clauses_read": float(np.mean([one.read for one in scored])),
        "things": [vars(one) for one in scored],
    }  # fmt: skip


def interval(values: np.ndarray) -> tuple[float, float]:
    """95 % bootstrap interval of the mean."""
    drawn = np.random.default_rng(0).integers(len(values), size=(RESAMPLES, len(values)))
    low, high = np.quantile(values[drawn].mean(axis=1), [0.025, 0.975])
    return float(low), float(high)
