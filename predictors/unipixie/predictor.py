"""The UniPixie predictor: what words leave open, from what is seen, anywhere from soft to stiff."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import ClassVar

import numpy as np

from ...fem.mpm.materials import MaterialClass
from ...fem.note import Note
from ...fem.table import MaterialTable, MaterialValue, load_table
from ..appearance.features import Appearance
from ..asset import UpAxis
from ..encoders.registry import TextEncoder
from ..field import Ranges
from ..grid import PartVoxels
from ..prediction import PartChoice, Prediction
from ..resolve.resolve import Lookup, lookup_of, nearest_row
from ..text.clauses import Sentence, bind
from ..text.parts import NamedPart, own_name, vocabulary_of
from .inference import WEIGHTS, Cube, Found, Loaded, load_unipixie, one_torch_thread, voxels_on


class UniPixiePredictor:
    """Predicts with the shipped weights, or those of ``weights``.

    Of every part that it decides it draws so many plausible ``samples``, from ``seed`` on.
    """

    name: ClassVar[str] = "unipixie"
    takes_alpha: ClassVar[bool] = True
    takes_samples: ClassVar[bool] = True

    def __init__(
        self,
        *,
        weights: Path | None = None,
        table: MaterialTable | None = None,
        encoder: TextEncoder | None = None,
        samples: int = 0,
        seed: int = 0,
    ) -> None:
        self.table = table or load_table()
        self._weights = weights or WEIGHTS
        self.samples, self.seed = samples, seed
        self.lookup = (
            Lookup(table=self.table, encoder=encoder) if encoder else lookup_of(self.table)
        )

    @cached_property
    def loaded(self) -> Loaded:
        """The network and what its numbers mean, read on the first inference."""
        return load_unipixie(self._weights)

    @one_torch_thread()
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
        """Return what words settle, and for all other parts what the network finds.

        See ``Predictor``. Without ``alpha`` a part gets the mean of what is plausible; with it, a
        place between the soft and the stiff end of its range.
        """
        if choices is None:
            choices = self.lookup.settle(
                parts.part_labels, bind(sentence, parts.part_labels), alpha=alpha,
                volumes=parts.volumes,
            ).choices  # fmt: skip
        found = self.find(parts, appearance() if appearance else Appearance(), up=up)
        there = set(np.unique(parts.part).tolist())
        left_open = [i for i, c in enumerate(choices) if not c.settled and i in there]
        decided, physical = list(choices), found.normalisation.physical
        drawn = physical(found.samples(self.samples, self.seed))
        ends = {}
        for i in left_open:
            mine = found.cube.part == i
            draws = tuple(
                MaterialValue(*map(float, one))
                for one in zip(*(v[:, i] for v in drawn), strict=True)
            )
            # The mean of the network's values over the part, and the row nearest to it
            values = found.likeliest[0] if alpha is None else found.at(alpha)
            mean = values[mine].mean(axis=0)
            value = MaterialValue(*map(float, physical(mean)))
            row = nearest_row(self.table, found.normalisation, mean, grades=False)
            ends[i] = [end[mine].mean(axis=0) for end in found.ends]
            soft, stiff = (end[0] for end in ends[i])
            place = 0.5 if alpha is None and stiff <= soft else alpha
            if place is None:
                place = float(np.clip((mean[0] - soft) / (stiff - soft), 0, 1))
            votes = np.bincount(found.likeliest[1][mine])
            words = choices[i]
            decided[i] = PartChoice(
                words.part, row, value, words.weight, place,
                Note("predictor.network_looks"), settled=False, network="UniPixie",
                guessed=True, unknown=words.unknown, draws=draws,
                matter=MaterialClass(int(votes.argmax())).name.lower(),
            )  # fmt: skip
        made = Prediction.of(parts, decided, sentence, alpha=alpha)
        field = made.field
        if field.ranges is None or field.part is None:
            return made
        ranges = [np.array(values) for values in field.ranges]
        for part, both in ends.items():
            for values, pair in zip(ranges, zip(*map(physical, both), strict=True), strict=True):
                values[field.part == part] = pair
        return replace(made, field=replace(field, ranges=Ranges(*ranges)))

    def find(self, parts: PartVoxels, appearance: Appearance, *, up: UpAxis = "z") -> Found:
        """Return all that the network finds of an asset: likeliest, range, samples, classes."""
        vocabulary = vocabulary_of(self.table)
        said = [own_name(NamedPart.of(words, vocabulary, 0.0)) for words in parts.part_labels]
        names = self.lookup.kernel.encoder.text([words or "object" for words in said])
        named = np.array([bool(words) for words in said])
        network = self.loaded.network
        cube = Cube.of(parts, up, cells=network.config.cells)
        return Found(self.loaded, cube, voxels_on(network, cube, parts, names, named, appearance))
