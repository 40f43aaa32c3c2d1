"""What training never saw: objects with clauses of held-out frames, wordings and pairs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from ...predictors.encoders.minilm import MiniLM
from ...predictors.film.words import HintedEncoder
from ..datasets.objects import make_objects
from ..datasets.real import CELLS, RealObject
from ..datasets.text_table import TextTable, build_text_table

if TYPE_CHECKING:
    from ..training.film.batch import TrainingBatch
    from ..training.stores import Store

_DRAWS = 1009  # between the seeds of two draws: no other evaluation's seed by chance
_PER_PART = 12  # clauses written for every kind of part

Split = Literal["procedural", "validation", "merged"]


class ImageFeatures(NamedTuple):
    """Features of an image encoder: half-resolution cells (n, 3) that have one, values (n, D)."""

    cells: np.ndarray
    values: np.ndarray


class HeldOutObject(NamedTuple):
    """One object with what its clauses say ("" for none).

    ``names`` are those of its slots if they are given, ``features`` what an image encoder sees,
    ``looks`` (n, 7) what is seen of each cell, in C order, as ``matter.looks`` wants it.
    """

    batch: TrainingBatch
    said: list[str]
    names: tuple[str, ...] = ()
    features: ImageFeatures | None = None
    looks: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class HeldOutSet:
    """Objects, how fine they are, and what is said of them.

    Parameters
    ----------
    split
        "procedural": new shapes, held-out frames, wordings and part/material pairs, no names.
        "validation": ``real`` objects of a source that training never saw, texts about kinds of
        matter and the default template.
        "merged": those of at least two kinds of matter, in one piece; each kind is spoken of.
    objects, cells, seed
        How many objects, on how fine a grid, drawn how.
    texts
        How often something is said of each object.
    real, features
        Objects of the validation split, and what an image encoder sees of each, if it was asked.
    """

    split: Split
    objects: int = 64
    cells: int = 64
    seed: int = 0
    texts: int = 1
    real: Sequence[RealObject] = ()
    features: Sequence[ImageFeatures | None] = ()

    @property
    def _furniture(self) -> bool:
        """Whether the objects are ``real``."""
        return self.split != "procedural"

    @property
    def _merged(self) -> bool:
        return self.split == "merged"

    def text_table(self) -> TextTable:
        """Clauses of frames, wordings and pairs that training never sees, embedded."""
        return build_text_table(
            np.random.default_rng(self.seed), HintedEncoder(MiniLM()).text, per_part=_PER_PART,
            held_out=True, real=self.real,
        )  # fmt: skip

    def drawn(
        self, text: TextTable, *, draw: int = 0, names: bool = False
    ) -> Iterator[tuple[int, HeldOutObject]]:
        """Yield every object that has a known value, with its number.

        Each ``draw`` says something else of them; ``names``: those of the parts are given.
        """
        for index, batch in enumerate(self._batches(text, draw, names)):
            matters = len(batch.clause[batch.bound].unique())
            if not batch.valued.any() or (self._merged and matters < 2):
                continue
            slots = self.real[index].slots if names and self._furniture else ()
            features = self.features[index] if self.features else None
            looks = self.real[index].seen if self._furniture and self.cells == CELLS else None
            yield index, HeldOutObject(batch, clause_texts(batch, text), slots, features, looks)

    def _batches(self, text: TextTable, draw: int, names: bool) -> Iterator[TrainingBatch]:
        """Yield batches of one object each."""
        import torch

        from ..training.film.mixture import Mixture
        from ..training.film.sampler import VoxelSampler
        from ..training.sentences import Sentences
        from ..training.stores import Store

        real, all_said = self._furniture, self._merged
        mixture = Mixture(
            composite=0, relabelled=0, real=0, no_text=0.0 if all_said else 0.1,
            mention=1.0 if all_said else 0.7, whole=0.0 if all_said else 0.1,
            object_name=0.5 if real else 0.0, names=float(names), vision=0.0, no_hints=0.0,
            augment=0.0,
        )  # fmt: skip
        sentences = Sentences(text, "cpu")
        store, seed = self._store(text), self.seed + _DRAWS * draw
        sampler = VoxelSampler(sentences, store, None, None, mixture=mixture, seed=seed)
        for index in range(len(store.label)):
            item = Store(*(column[index : index + 1] for column in store))
            yield sampler.compose(item, torch.tensor([real]), torch.tensor([False]))

    def _store(self, text: TextTable) -> Store:
        """Return the voxels of the objects."""
        from ..training.stores import procedural_store, real_store

        if self._furniture:
            real = list(self.real[: self.objects])
            return real_store(real, text, cells=self.cells, device="cpu")
        made = make_objects(self.objects, np.random.default_rng(self.seed + 1))
        return procedural_store(made, cells=self.cells, device="cpu")


def clause_texts(batch: TrainingBatch, text: TextTable) -> list[str]:
    """Return what every slot for a clause says, "" where it is empty."""
    given = batch.scene.clauses[0].numpy()
    known = text.embedding.astype(np.float32)
    here = batch.scene.clause_mask[0].numpy()
    return [
        text.texts[int(np.square(known - vector).sum(axis=1).argmin())] if there else ""
        for vector, there in zip(given, here, strict=True)
    ]
