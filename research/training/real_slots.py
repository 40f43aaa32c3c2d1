"""Slots of real objects on other shapes: of one kind of matter, any slot may stand for another."""

from __future__ import annotations

import numpy as np
import torch

from ...predictors.text.parts import KINDS
from ..datasets.grammar import Role, spoken_names
from ..datasets.parts import part_kinds
from ..datasets.real import RealObject, kind_index
from ..datasets.text_table import TextTable
from .sentences import Sentences
from .stores import Store, look_rows, slot_columns


class RealSlots:
    """Slots of real objects by kind of matter: colour, value and name of each belong together."""

    def __init__(self, objects: list[RealObject], table: TextTable) -> None:
        kinds, self._value, self._colour = (
            a.reshape(-1, *a.shape[2:]) for a in slot_columns(objects, table.normalisation)
        )
        self._name = table.real_names[:, 1:].reshape(-1)
        self._look = look_rows(objects).reshape(-1)
        self._of_kind = [np.flatnonzero(kinds == k) for k in range(len(KINDS))]

    def put_on(self, store: Store, matter: np.ndarray, rng: np.random.Generator) -> Store:
        """Give every part whose kind of ``matter`` (n, 6) is known a slot of that kind."""
        value, colour = store.value.cpu().numpy().copy(), store.colour.cpu().numpy().copy()
        text, look = store.text.cpu().numpy().copy(), store.look.cpu().numpy().copy()
        for kind, slots in enumerate(self._of_kind):
            i, j = np.nonzero(matter == kind)
            if slots.size and i.size:
                chosen = rng.choice(slots, size=i.size)
                value[i, j], colour[i, j] = self._value[chosen], self._colour[chosen]
                text[i, 1 + j], look[i, j] = self._name[chosen], self._look[chosen]
        # A kind without a slot is unknown matter.
        empty = [k for k, slots in enumerate(self._of_kind) if not slots.size]
        kinds = np.where(np.isin(matter, empty), -1, matter)
        columns = (kinds, np.full(len(kinds), -1), value, colour, text, look)
        return Store(store.label, *(torch.tensor(c, device=store.label.device) for c in columns))


def shapes_with_real_slots(
    shapes: Store, slots: RealSlots, sentences: Sentences, *, seed: int
) -> Store:
    """Procedural shapes in plausible slots of real objects: kinds of matter without end."""
    rng = np.random.default_rng(seed)
    plausible = [
        [k for m in kind.materials if (k := kind_index(spoken_names(m)[0])) >= 0] or [-1]
        for kind in part_kinds().values()
    ]
    matter = np.array(
        [[rng.choice(plausible[k]) if k >= 0 else -1 for k in row] for row in shapes.kinds.tolist()]
    )
    text = torch.full_like(shapes.text, -1)
    text[:, 0] = sentences.first(Role.OBJECT, shapes.category)
    nothing = torch.full_like(shapes.value, torch.nan)
    return slots.put_on(shapes._replace(text=text, value=nothing), matter, rng)


def with_exchanged_slots(
    store: Store, slots: RealSlots, rng: np.random.Generator, *, copies: int = 3
) -> Store:
    """Real objects as they are, and copies with each slot from another object of its kind."""
    stores = [store]
    for _ in range(copies):
        stores.append(slots.put_on(store, store.kinds.cpu().numpy(), rng))
    return Store(*(torch.cat(columns) for columns in zip(*stores, strict=True)))
