"""Predictors without a network: how far one gets by reading clauses, or by knowing nothing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ...predictors.field import DEFAULT
from ...predictors.resolve.resolve import Lookup
from ...predictors.text.clauses import bind
from ...predictors.text.reader import parse
from .held_out import HeldOutObject
from .rows import Setting, VoxelPredictor


@dataclass(frozen=True)
class ClauseBaseline:
    """Reads every clause perfectly, but knows not of which voxel it speaks.

    ``combine`` makes one value (3,) of those that the clauses ask for (n, 3); without it, and where
    nothing is said, the value is the mean of the kinds of part.
    """

    combine: Callable[[Float[np.ndarray, "n 3"]], Float[np.ndarray, "3"]] | None = None
    names: bool = False

    def build(self, setting: Setting) -> VoxelPredictor:
        """Return the baseline, which knows the values of all clauses of the setting."""
        import torch

        from ..training.sentences import settled_values

        text = setting.text
        meaning, known = settled_values(text)
        mean = text.levels[:, -1].mean(axis=0)
        first = {said: row for row, said in reversed(list(enumerate(text.texts)))}

        def predict(example: HeldOutObject):
            value = mean
            rows = np.array([first[said] for said in example.said if said], dtype=int)
            if self.combine is not None and len(rows):
                asked = np.where(known[rows, None], np.nan_to_num(meaning[rows]), mean)
                value = self.combine(asked)
            tensor = torch.tensor(value, dtype=torch.float32)
            return tensor[None, :, None, None, None].expand_as(example.batch.target), None

        return predict


@dataclass(frozen=True)
class RetrievalBaseline:
    """Retrieval: the clauses as one text, the parts by their size alone."""

    names: bool = False

    def build(self, setting: Setting) -> VoxelPredictor:
        """Return the baseline; the setting tells it nothing."""
        import torch

        lookup = Lookup()

        def predict(example: HeldOutObject):
            part = example.batch.scene.part[0]
            volumes = [float((part == p).sum()) for p in range(int(part.max()) + 1)]
            labels = [(f"part {p + 1}",) for p in range(len(volumes))]
            said = "; ".join(filter(None, example.said)) or "This is an object."
            read = bind(parse(said, lookup.table), labels)
            chosen = lookup.settle(labels, read, volumes=volumes).choices
            value = torch.tensor(np.array([DEFAULT.normalise(*c.value) for c in chosen]))
            return value.float()[part.clamp(min=0)].movedim(-1, 0)[None], None

        return predict


CONSTANT = ClauseBaseline()
TABLE_MEAN = ClauseBaseline(lambda asked: asked.mean(axis=0))
TABLE_FIRST = ClauseBaseline(lambda asked: asked[0])
RETRIEVAL = RetrievalBaseline()
