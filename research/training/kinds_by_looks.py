"""Kinds of matter by looks, learned from the slots of real objects whose names tell their kind."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ...fem.errors import InputError
from ...predictors.matter import KindsByLooks
from ..datasets.real import RealObject, kind_index

# Of .3 to 100, on objects of each source of training by the other: 3 to 30 are as good.
PENALTY = 10.0


def train_kinds(objects: Iterable[RealObject]) -> tuple[KindsByLooks, int]:
    """Fit kinds to looks; return how many slots taught it, too."""
    rows, kinds = [], []
    for item in objects:
        for slot, measures in zip(
            item.slots, () if item.looks is None else item.looks, strict=False
        ):
            if kind_index(slot) >= 0 and np.isfinite(measures).all():
                rows.append(measures)
                kinds.append(kind_index(slot))
    if not rows:
        raise InputError("no object has measured looks: build the data anew with `dataset build`")
    return KindsByLooks.fit(np.array(rows), np.array(kinds), penalty=PENALTY), len(rows)
