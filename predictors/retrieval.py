"""Retrieval: the table's rows alone, by words and by nearness in meaning; nothing is trained."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import ClassVar

from ..fem.scene.materials import MaterialTable, load_table
from .asset import UpAxis
from .encoders.protocol import TextEncoder
from .images.appearance import Appearance
from .language.binding import bind
from .language.clauses import Sentence
from .lookup.lookup import Lookup, lookup_of
from .prediction import PartChoice, Prediction
from .voxels import PartVoxels


class RetrievalPredictor:
    """Gives every part its likeliest row: the baseline, and the fallback of all others."""

    name: ClassVar[str] = "retrieval"
    takes_alpha: ClassVar[bool] = True
    takes_samples: ClassVar[bool] = False

    def __init__(
        self, *, table: MaterialTable | None = None, encoder: TextEncoder | None = None
    ) -> None:
        table = table or load_table()
        self.lookup = Lookup(table=table, encoder=encoder) if encoder else lookup_of(table)

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
        """Return the choices themselves; see ``Predictor``. What is seen is not asked for."""
        if choices is None:
            choices = self.lookup.settle(
                parts.part_labels, bind(sentence, parts.part_labels), alpha=alpha,
                volumes=parts.volumes,
            ).choices  # fmt: skip
        return Prediction.of(parts, choices, sentence, alpha=alpha)
