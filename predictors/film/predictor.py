"""The FiLM predictor: clauses bound to parts, or to pieces of them, by the trained network."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar, NamedTuple

import numpy as np

from ...fem.note import Note
from ...fem.table import FIELDS, MaterialTable, MaterialValue
from ..appearance.features import Appearance
from ..asset import UpAxis
from ..encoders.registry import TextEncoder
from ..field import MaterialField
from ..film.words import hear
from ..grid import PartVoxels
from ..partition import Partition, match_clauses, partition
from ..prediction import Binding, PartChoice, Prediction, field_of, unbound_by
from ..resolve.resolve import Lookup, lookup_of, nearest_row
from ..text.clauses import Sentence, bind
from .inference import FilmModel, Inference


class FilmPredictor:
    """Predicts with the shipped weights, or those of ``weights``."""

    name: ClassVar[str] = "film"
    takes_alpha: ClassVar[bool] = False
    takes_samples: ClassVar[bool] = False

    def __init__(
        self,
        *,
        weights: Path | None = None,
        table: MaterialTable | None = None,
        encoder: TextEncoder | None = None,
    ) -> None:
        self.model = FilmModel(weights=weights, table=table, encoder=encoder)
        self.table = self.model.table
        self.certainty = None if weights else Certainty.load()  # measured of the shipped ones
        self.lookup = (
            Lookup(table=self.table, encoder=encoder) if encoder else lookup_of(self.table)
        )

    def predict(
        self,
        parts: PartVoxels,
        sentence: Sentence,
        *,
        choices: Sequence[PartChoice] | None = None,
        appearance: Callable[[], Appearance] | None = None,
        up: UpAxis = "z",
        alpha: float | None = None,
    ) -> Prediction:
        """Return what words settle, and for all other parts what the network finds there.

        A clause that names a material gives its row; where none does, the values are the network's
        own. See ``Predictor``; ``alpha`` moves nothing here.
        """
        if choices is None:
            bound = bind(sentence, parts.part_labels)
            choices = self.lookup.settle(parts.part_labels, bound, volumes=parts.volumes).choices
        there = set(np.unique(parts.part).tolist())
        left_open = [i for i, choice in enumerate(choices) if not choice.settled and i in there]
        seen = appearance() if appearance else None
        heard = hear(sentence, parts.part_labels, self.table, self.model.words)
        found = self.model.infer(parts, heard, up=up, appearance=seen)
        if found.of_pieces:  # the text speaks of more parts than there are
            pieces = partition(parts, left_open, found.shares, found.clauses)
        else:
            owners = match_clauses(parts, left_open, found.shares, found.unbound)
            pieces = Partition(parts, tuple(range(len(owners))), owners)
        decided = [
            replace(choices[parent], part=name)
            for parent, name in zip(pieces.parents, pieces.parts.part_names, strict=True)
        ]
        for i, (parent, owner) in enumerate(zip(pieces.parents, pieces.owners, strict=True)):
            if parent in left_open:
                decided[i] = self._choose(decided[i], found, pieces.parts.part == i, owner)
        # The choices' values, and the network's own cell by cell where it decided alone
        field = field_of(pieces.parts, decided)
        own = [i for i, choice in enumerate(decided) if choice.network]
        learned = np.isin(pieces.parts.part, own)
        values = {
            name: np.where(learned, value, getattr(field, name))
            for name, value in zip(FIELDS, found.normalisation.physical(found.values), strict=True)
        }
        field = replace(field, ranges=None if learned.any() else field.ranges, **values)
        unbound = unbound_by([*choices, *decided], sentence.clauses)
        return Prediction(pieces.parts, pieces.parents, field, tuple(decided), unbound)

    def field(
        self,
        parts: PartVoxels,
        sentence: Sentence,
        *,
        up: UpAxis = "z",
        appearance: Appearance | None = None,
        names: bool = True,
    ) -> MaterialField:
        """Return what the network finds by itself, no value looked up; see ``FilmModel.infer``."""
        heard = hear(sentence, parts.part_labels, self.table, self.model.words)
        found = self.model.infer(parts, heard, up=up, appearance=appearance, names=names, turns=1)
        E, nu, rho = found.normalisation.physical(found.values)
        labels = parts.part.astype(np.int64)
        return MaterialField(
            parts.grid, parts.occupied, E, nu, rho, part=labels, part_names=parts.part_names
        )

    def _choose(
        self, words: PartChoice, found: Inference, cells: np.ndarray, owner: int | None
    ) -> PartChoice:
        """Choose for a piece what its clause names, else the row nearest to the values found.

        Of what ``words`` made likeliest stays whether the text was understood.
        """
        clause = None if owner is None else found.clauses[owner]
        shares = found.shares[cells].mean(axis=0)
        share = float(shares[-1 if owner is None else owner])
        text = None if clause is None else clause.text
        measured = text is not None and owner == shares.argmax() and not found.of_pieces
        certainty = self.certainty.of(share) if self.certainty and measured else None
        spread = float(found.spread[cells].mean())
        binding = Binding(text, share, int(cells.sum()), spread, certainty)
        why = f"network: {'nothing text' if text is None else repr(text)}"
        if certainty is not None:
            why += Note("predictor.right_about", certainty=10 * certainty)
        if clause is not None and clause.material:
            return replace(
                self.lookup.of_clause(words.part, clause, why), weight=share, settled=False,
                binding=binding, unknown=words.unknown, guessed=words.unknown is not None,
            )  # fmt: skip
        mean = found.values[cells].mean(axis=0)
        value = MaterialValue(*map(float, found.normalisation.physical(mean)))
        row = nearest_row(self.table, found.normalisation, mean)
        return PartChoice(
            words.part, row, value, share, 0.5, why, settled=False, binding=binding,
            network="FiLM", unknown=words.unknown,
            guessed=clause is None or words.unknown is not None,
        )  # fmt: skip


# How often a share of the network's is right: said only where it was found to hold.

SHIPPED = Path(__file__).parents[1] / "weights" / "film_certainty.json"

_LEAST = 1e-4  # of a share, for its log-odds: shares are means over cells and views


class Calibration(NamedTuple):
    """Certainty = logistic(slope log-odds(share) + offset), Platt (1999)."""

    slope: float
    offset: float

    def __call__(self, share: float) -> float:
        """Return how often an answer with such a share of a part is right."""
        return float(1 / (1 + np.exp(-(self.slope * log_odds(share) + self.offset))))


@dataclass(frozen=True)
class Certainty:
    """A calibration, and the spans of certainty in which other objects bore it out.

    ``benchmarks/reliability.py`` fits and checks it; the card of the weights shows both.
    """

    calibration: Calibration
    spans: tuple[tuple[float, float], ...] = ()

    @classmethod
    def load(cls, path: Path = SHIPPED) -> Certainty:
        """Return that of the shipped weights."""
        found = json.loads(path.read_text(encoding="utf-8"))
        calibration = Calibration(found["slope"], found["offset"])
        return cls(calibration, tuple((low, high) for low, high in found["spans"]))

    def of(self, share: float) -> float | None:
        """Return how often an answer with such a share is right, None where nobody knows."""
        certainty = self.calibration(share)
        known = any(low <= certainty <= high for low, high in self.spans)
        return certainty if known else None


def log_odds(share: np.ndarray | float) -> np.ndarray:
    """Return log(p / (1 - p)) of shares in [0, 1]."""
    share = np.asarray(np.clip(share, _LEAST, 1 - _LEAST))
    return np.asarray(np.log(share / (1 - share)))
