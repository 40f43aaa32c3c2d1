"""Batches for the region network: sets of regions, and sentences about them, no two times alike."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from ....predictors.matter import CategoriesByAppearance
from ....predictors.regions.network import ORDER, PLACES, TURNED, Measured, pairs_of, standardised
from ....predictors.text.parts import KINDS
from ...datasets.region_sets import CLAUSES, NULL, RegionCorpus
from ..kinds_by_looks import PENALTY, fit_kinds
from .network import RegionBatch

FOLDS = 5


def folds(corpus: RegionCorpus) -> np.ndarray:
    """Fold of every real thing, -1 of the others."""
    out = np.full(len(corpus.real), -1)
    real = np.flatnonzero(corpus.real)
    out[np.random.default_rng(0).permutation(real)] = np.arange(len(real)) % FOLDS
    return out


def evidence_of(corpus: RegionCorpus, fold: np.ndarray) -> np.ndarray:
    """Log of how much likelier each kind of matter is by looks, (N, R, kinds).

    Of a thing's regions a regression tells that did not see the thing: one that did would seem
    surer than it is of what is new.
    """
    out = np.zeros((*corpus.values.shape[:2], len(KINDS)), dtype=np.float32)
    known = np.isfinite(corpus.slot_values).all(axis=2) & (corpus.slot_kinds >= 0)
    of_set = fold[corpus.thing]
    for number in np.unique(of_set):
        kept = known & (fold != number)[:, None]
        values = corpus.slot_values[kept].astype(np.float64)
        found = fit_kinds(values, corpus.slot_kinds[kept], penalty=PENALTY)
        for i in np.flatnonzero(of_set == number):
            out[i] = _of_set(found, corpus.values[i])
    return out


def _of_set(found: CategoriesByAppearance, values: np.ndarray) -> np.ndarray:
    there = np.flatnonzero(values.any(axis=1))
    out = np.zeros((len(values), len(KINDS)))
    measures = values[there, : len(found.finished.mean)].astype(np.float64)
    out[there] = found.log_ratio(measures)
    return out


@dataclass(frozen=True)
class Habits:
    """How often a batch is varied, and how.

    real: Share of things that are real.
    shuffled, one_word: Sentences whose clauses change places, clauses that keep one of their words.
    other_material: Clauses whose material becomes another of its kind.
    no_part, no_material: Sentences that name no parts, or no materials.
    dropped: Sentences that lose a clause: its regions are of the null clause.
    anew: Sentences put together anew from what was said of a thing.
    by_size: Sentences whose clauses stand by the volumes that they speak of, the largest first.
    told: Things of which a user told the clause of one region, or of two.
    clicked: Things of which a user told the region where most was wrong (``recipe``).
    turned: Things that made a quarter turn.
    noise: Deviation of what is added to the standardised measures.
    """

    real: float = 0.75
    shuffled: float = 0.35
    one_word: float = 0.4
    other_material: float = 0.3
    no_part: float = 0.15
    no_material: float = 0.15
    dropped: float = 0.15
    anew: float = 0.25
    by_size: float = 0.15
    told: float = 0.25
    clicked: float = 0.3
    turned: float = 0.5
    noise: float = 0.15


class RegionSampler:
    """Draws batches from the sets of a corpus whose things are not of the ``fold`` left out."""

    def __init__(
        self,
        corpus: RegionCorpus,
        *,
        seed: int,
        device: str,
        fold: int | None = None,
        habits: Habits | None = None,
    ) -> None:
        self.habits, self.device = habits or Habits(), device
        self.generator = torch.Generator(device=device).manual_seed(seed)
        self.fold = folds(corpus)
        kept = np.ones(len(corpus.thing), bool)
        if fold is not None:
            kept = self.fold[corpus.thing] != fold
        there = np.asarray(corpus.values.any(axis=2))
        seen = corpus.values[kept][there[kept]]
        self.mean, self.deviation = seen.mean(axis=0), seen.std(axis=0) + 1e-3
        region, turned = (
            np.stack(
                [
                    standardised(values, self.mean, self.deviation, shells=bool(shells))
                    for values, shells in zip(each, corpus.shells, strict=True)
                ]
            )
            for each in (corpus.values, corpus.values[..., TURNED])
        )
        real = corpus.real[corpus.thing]
        self.pools = [torch.tensor(np.flatnonzero(kept & (real == way)), device=device)
                      for way in (True, False)]  # fmt: skip

        def put(array: np.ndarray) -> Tensor:
            kind = torch.float32 if array.dtype.kind == "f" else None
            return torch.tensor(array, dtype=kind, device=device)

        self.region, self.turned, self.there = put(region), put(turned), put(there)
        apart = [
            pairs_of(Measured(*each)) for each in zip(corpus.values, corpus.contact, strict=True)
        ]
        self.pairs = put(np.stack(apart))
        self.cells, self.kinds, self.thing = put(corpus.cells), put(corpus.kinds), put(corpus.thing)
        self.evidence = put(evidence_of(corpus, self.fold))
        self.part, self.material = put(corpus.part), put(corpus.material)
        self.clause = put(corpus.clause)
        none = np.zeros((1, corpus.word_vectors.shape[1]), dtype=np.float32)
        # the last of each stands for nothing: -1 finds it
        self.words = put(np.concatenate([corpus.word_vectors, none]))
        self.materials = put(np.concatenate([corpus.material_vectors, none]))
        self.kind, self.category = put(corpus.material_kind), put(corpus.category)
        self.categories = len(corpus.facts["categories"])
        # of each thing the hands' and those put together anew; where it has none, the other ones
        own = [
            [q if len(q) else by[1 - way] for way, q in enumerate(by)]
            for i in range(len(corpus.real))
            for by in [[np.flatnonzero((corpus.of == i) & (corpus.anew == way)) for way in (0, 1)]]
        ]
        table = np.zeros((len(own), 2, max(len(q) for by in own for q in by)), dtype=np.int64)
        for i, by in enumerate(own):
            for way, q in enumerate(by):
                table[i, way, : len(q)] = q
        self.sentences, self.count = put(table), put(np.array([[*map(len, by)] for by in own]))
        self.of_kind = [torch.nonzero(self.kind == k)[:, 0] for k in range(len(KINDS))]

    def draw(self, n: int) -> RegionBatch:
        """Return n sets, each with a sentence about it."""
        real, made = map(len, self.pools)
        first = round(n * self.habits.real) if real and made else n * bool(real)
        drawn = [
            pool[self._integers(len(pool), count)]
            for pool, count in zip(self.pools, (first, n - first), strict=True)
            if count
        ]
        sets = torch.cat(drawn)
        of = self.thing[sets]
        way = (self._uniform(n) < self.habits.anew).long()
        at = (self._uniform(n) * self.count[of, way]).long()
        return self.batch(sets, self.sentences[of, way, at], varied=True)

    def batch(self, sets: Tensor, sentences: Tensor, *, varied: bool) -> RegionBatch:
        """Return these sets with these sentences, as they are or varied."""
        n, habits = len(sets), self.habits
        rows = torch.arange(n, device=self.device)[:, None]
        part = self.part[sentences][..., 0]
        material = self.material[sentences].clone()
        clause = self.clause[sentences].clone()  # (n, slots)
        spoken = (part >= 0) | (material >= 0)
        count = spoken.sum(dim=1)
        kind = torch.where(material >= 0, self.kind[material], -1)
        category = torch.where(material >= 0, self.category[material], -1)
        cells = self.cells[sets]
        if varied:
            # a clause speaks of what the largest of its slots was recoloured as
            of_slot = (
                torch.nn.functional.one_hot(clause.clamp(min=0), CLAUSES) * (clause >= 0)[..., None]
            )
            size = of_slot * cells.sum(dim=1)[..., None]
            new = torch.gather(self.kinds[sets], 1, size.argmax(dim=1))
            other = self._uniform(n, CLAUSES) < habits.other_material
            change = torch.where(new >= 0, new, torch.where(other, kind, -1))
            change = torch.where(material >= 0, change, -1)
            for k, choices in enumerate(self.of_kind):
                mine = change == k
                if len(choices):
                    drawn = choices[self._integers(len(choices), mine.sum())]
                    material[mine] = drawn
            kind = torch.where(material >= 0, self.kind[material], -1)
            category = torch.where(material >= 0, self.category[material], -1)
            options = self.part[sentences]
            more = (options >= 0).sum(dim=-1) - 1
            one = 1 + (self._uniform(n, CLAUSES) * more).long().clamp(max=more - 1).clamp(min=0)
            one = torch.gather(options, 2, one.clamp(max=options.shape[2] - 1)[..., None])[..., 0]
            single = (more > 0) & (self._uniform(n, CLAUSES) < habits.one_word)
            part = torch.where(single, one, part)
            mode = self._uniform(n, 1)
            part = torch.where(mode < habits.no_part, -1, part)
            silent = (mode >= habits.no_part) & (mode < habits.no_part + habits.no_material)
            material, category = (torch.where(silent, -1, x) for x in (material, category))
            kind = torch.where(silent, -1, kind)
            # places in the sentence: shuffled, and without what is dropped
            key = torch.arange(CLAUSES, device=self.device) / CLAUSES + 2.0 * ~spoken
            way = self._uniform(n, 1)
            key = torch.where((way < habits.shuffled) & spoken, self._uniform(n, CLAUSES), key)
            by_size = 2.0 * ~spoken - size.sum(dim=1) / (cells.sum(dim=(1, 2))[:, None] + 1)
            mine = (way >= habits.shuffled) & (way < habits.shuffled + habits.by_size)
            key = torch.where(mine, by_size, key)
            drop = (self._uniform(n) < habits.dropped) & (count > 1)
            lost = (self._uniform(n) * count).long()
            gone = drop[:, None] & (torch.arange(CLAUSES, device=self.device) == lost[:, None])
            key, spoken = key + 4.0 * gone, spoken & ~gone
            order = key.argsort(dim=1)
            place = order.argsort(dim=1)
            clause = torch.where(clause >= 0, place[rows, clause.clamp(min=0)], clause)
            part, material, kind, category, spoken = (
                x.gather(1, order) for x in (part, material, kind, category, spoken)
            )
            count = spoken.sum(dim=1)
            # what no clause is left for is of the null clause
            clause = torch.where(clause >= count[:, None], NULL, clause)
        # the null clause is the first
        target = (
            torch.nn.functional.one_hot(
                torch.where(clause == NULL, 0, clause + 1).clamp(min=0), CLAUSES + 1
            )
            * (clause != -1)[..., None]
        )
        wanted = cells @ target.to(cells.dtype)
        region = self.region[sets]
        of_user = torch.full(region.shape[:2], -1, device=self.device)
        if varied:
            # regions of which a user tells the clause, large ones more often
            known, size = wanted.sum(dim=2) > 0, cells.sum(dim=2)
            chance = -torch.log(-torch.log(self._uniform(*size.shape)))  # Gumbel's
            likely = (0.5 * torch.log(size + 1) + chance).masked_fill(~known, -torch.inf)
            rank = likely.argsort(dim=1, descending=True).argsort(dim=1)
            many = (self._uniform(n, 1) < habits.told) * (1 + (self._uniform(n, 1) < 0.4).long())
            of_user = torch.where((rank < many) & known, wanted.argmax(dim=2), -1)
            turn = self._uniform(n, 1, 1) < habits.turned
            region = torch.where(turn, self.turned[sets], region)
            noise = torch.randn(region.shape, generator=self.generator, device=self.device)
            noise[..., -1] = 0.0  # the flag
            region = region + habits.noise * noise

        def with_null(x: Tensor) -> Tensor:
            return torch.cat([x.new_zeros(n, 1, x.shape[2]), x], dim=1)

        # of the last clause the vectors are 0
        matter = torch.zeros(n, CLAUSES, len(KINDS) + 1 + self.categories, device=self.device)
        told = category >= 0
        where = torch.where(kind >= 0, kind, len(KINDS))
        matter.scatter_(2, where[..., None], told[..., None].float())
        at = (len(KINDS) + 1 + category.clamp(min=0))[..., None]
        matter.scatter_(2, at, told[..., None].float())
        evidence = self.evidence[sets]  # (n, R, kinds)
        index = kind.clamp(min=0)[:, None].expand(-1, evidence.shape[1], -1)
        ratio = torch.gather(evidence, 2, index) * (kind >= 0)[:, None]
        tells = (kind >= 0)[:, None].expand_as(ratio).float()
        pair = torch.stack([ratio, tells], dim=-1)
        pair = torch.cat([pair.new_zeros(*pair.shape[:2], 1, 2), pair], dim=2)
        said = 2.0 * torch.nn.functional.one_hot(of_user.clamp(min=0), CLAUSES + 1) - 1
        pair = torch.cat([pair, (said * (of_user >= 0)[..., None])[..., None]], dim=3)
        place = torch.arange(CLAUSES, device=self.device)
        order = torch.zeros(n, CLAUSES + 1, ORDER, device=self.device)
        order[:, 1:, :PLACES] = torch.eye(PLACES, device=self.device)[place.clamp(max=PLACES - 1)]
        order[..., PLACES] = count[:, None] / PLACES
        order[:, 1:, PLACES + 1] = place / (count[:, None] - 1).clamp(min=1)
        order[:, 0, PLACES + 2] = 1.0
        always = torch.ones(n, 1, dtype=torch.bool, device=self.device)
        return RegionBatch(
            region, self.pairs[sets], with_null(self.words[part]),
            with_null(self.materials[material]), with_null(matter), order,
            pair, of_user, self.there[sets],
            torch.cat([always, spoken], dim=1), wanted,
        )  # fmt: skip

    def _uniform(self, *shape: int) -> Tensor:
        return torch.rand(shape, generator=self.generator, device=self.device)

    def _integers(self, high: int, count) -> Tensor:
        return torch.randint(high, (int(count),), generator=self.generator, device=self.device)
