"""What training never saw: objects with clauses of held-out frames, wordings and pairs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np

from ..datasets.objects import make_objects
from ..datasets.real import RealObject
from ..datasets.text_table import TextTable, build_text_table
from ..encoders.minilm import MiniLM
from ..language.hints import HintedEncoder

if TYPE_CHECKING:
    from ..training.batch import Batch

_DRAWS = 1009  # between the seeds of two draws: no other evaluation's seed by chance

Split = Literal["procedural", "validation"]


def held_out_text(seed: int, *, per_part: int = 12, real: Sequence[RealObject] = ()) -> TextTable:
    """Clauses of frames, wordings and pairs that training never sees, embedded."""
    encoder = HintedEncoder(MiniLM())
    return build_text_table(
        np.random.default_rng(seed), encoder.text, per_part=per_part, held_out=True, real=real
    )


def spoken(batch: Batch, text: TextTable) -> list[str]:
    """Return what every slot for a clause says, "" where it is empty."""
    given = batch.scene.clauses[0].numpy()
    known = text.embedding.astype(np.float32)
    here = batch.scene.clause_mask[0].numpy()
    return [
        text.texts[int(np.square(known - vector).sum(axis=1).argmin())] if there else ""
        for vector, there in zip(given, here, strict=True)
    ]


def held_out_batches(
    split: Split,
    text: TextTable,
    *,
    objects: int,
    cells: int,
    seed: int,
    draw: int = 0,
    names: bool = False,
    real: Sequence[RealObject] = (),
) -> Iterator[Batch]:
    """Yield batches of one object each, for a split; every ``draw`` says something else of them."""
    import torch

    from ..training.samples import Mixture, Sampler
    from ..training.sentences import Phrasebook
    from ..training.stores import Store, procedural_store, real_store

    mixture = Mixture(
        composite=0, relabelled=0, real=0, no_text=0.1, mention=0.7, whole=0.1,
        object_name=0.5 if split == "validation" else 0.0, names=float(names), vision=0.0,
        no_hints=0.0, augment=0.0,
    )  # fmt: skip
    book = Phrasebook(text, "cpu")
    if split == "procedural":
        made = make_objects(objects, np.random.default_rng(seed + 1))
        store = procedural_store(made, cells=cells, device="cpu")
    else:
        store = real_store(list(real[:objects]), text, cells=cells, device="cpu")
    sampler = Sampler(book, store, None, None, mixture=mixture, seed=seed + _DRAWS * draw)
    for index in range(len(store.label)):
        item = Store(*(column[index : index + 1] for column in store))
        yield sampler.compose(item, torch.tensor([split == "validation"]), torch.tensor([False]))
