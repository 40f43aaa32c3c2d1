"""Batches for training, made on the device: objects, colours, clauses, names, evidence, truth.

Shapes are drawn from stores of voxelised objects; everything else is drawn anew for each sample.
Three kinds of object are mixed: categories (words and shape tell which clause is meant), composites
and relabelled objects (only evidence tells), and real ones (clauses speak of kinds of matter).
"""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional as F

from ....predictors.film.unet import VoxelScene
from ...datasets.grammar import Role
from ...datasets.parts import part_kinds
from ...datasets.shapes import EMPTY, MAX_PARTS
from ..sentences import Sentences
from ..stores import Store, parts_that_exist, take
from .augmentation import shrunk, turned
from .batch import CLAUSES, WHOLE, TrainingBatch, by_part, exists_or_whole
from .mixture import Mixture
from .simulated_evidence import simulate_evidence, simulate_features, spread_features


class VoxelSampler:
    """Draws batches from stores of categories, composites and real objects (or None).

    Parameters
    ----------
    sentences
        The clauses.
    shapes, composites, real
        Stores of objects.
    mixture, seed
        How batches are drawn.
    dressed
        Procedural shapes in slots of real objects.
    coarse_evidence
        Evidence at half the resolution: all that a network with a fine stage reads.
    clauses
        How many clauses of a batch train alone, without an object.
    looks
        What an image encoder saw of real slots (rows, F): unit vectors that ``Store.look`` counts.
    """

    def __init__(
        self,
        sentences: Sentences,
        shapes: Store,
        composites: Store | None,
        real: Store | None,
        *,
        mixture: Mixture,
        seed: int,
        dressed: Store | None = None,
        coarse_evidence: bool = False,
        clauses: int = 0,
        looks: Tensor | None = None,
    ) -> None:
        self.sentences, self.mixture, self.dressed = sentences, mixture, dressed
        self.coarse_evidence, self.clauses, self.looks = coarse_evidence, clauses, looks
        self.shapes, self.composites, self.real = shapes, composites, real
        self.device = shapes.label.device
        self.generator = torch.Generator(self.device).manual_seed(seed)
        kinds = part_kinds().values()
        self.seen = torch.tensor(
            [i for i, kind in enumerate(kinds) if not kind.held_out], device=self.device
        )

    def _rand(self, *shape: int) -> Tensor:
        return torch.rand(shape, generator=self.generator, device=self.device)

    def _chance(self, n: int, share: float) -> Tensor:
        return self._rand(n) < share

    def draw(self, n: int) -> TrainingBatch:
        """Draw a batch of ``n`` samples."""
        item, is_real, random_words = self._objects(n)
        batch = self.compose(item, is_real, random_words)
        if self.mixture.doubt:
            # A squared error would make the network sure of the few real objects that it knows.
            spoken = is_real[:, None, None, None] & (batch.clause < CLAUSES)
            doubt = self.mixture.doubt * is_real.float()
            batch = batch._replace(valued=batch.valued & ~spoken, doubt=doubt)
        if not self.clauses:
            return batch
        return batch._replace(alone=self.sentences.clauses(self.clauses, self.generator))

    def _objects(self, n: int) -> tuple[Store, Tensor, Tensor]:
        """Return ``n`` objects, which of them are real, and which get random words."""
        mix = self.mixture
        wanted_real = round(n * mix.real) if self.real is not None else 0
        wanted_composites = round(n * mix.composite) if self.composites is not None else 0
        items = [take(self.shapes, n - wanted_real - wanted_composites, self._rand)]
        if wanted_composites and self.composites is not None:
            items.append(take(self.composites, wanted_composites, self._rand))
        if wanted_real and self.real is not None:
            dressed = round(wanted_real * mix.dressed) if self.dressed is not None else 0
            if dressed and self.dressed is not None:
                items.append(take(self.dressed, dressed, self._rand))
            real = take(self.real, wanted_real - dressed, self._rand)
            items.append(real._replace(label=shrunk(real.label, self.generator)))
        item = Store(*(torch.cat(columns) for columns in zip(*items, strict=True)))
        order = torch.arange(n, device=self.device)
        is_real = order >= n - wanted_real
        random_words = (order >= n - wanted_real - wanted_composites) & ~is_real
        random_words |= ~is_real & self._chance(n, mix.relabelled)
        return item._replace(label=turned(item.label, self.generator)), is_real, random_words

    def compose(self, item: Store, is_real: Tensor, random_words: Tensor) -> TrainingBatch:
        """Give objects words, colours and evidence."""
        n = len(item.label)
        exists = parts_that_exist(item)
        words = self._rand(n, len(self.seen)).argsort(1)[:, :MAX_PARTS]
        # Of half of the relabelled objects some parts keep their words: shape then tells a little.
        all_parts = (item.category < 0) | self._chance(n, 0.5)
        swapped = all_parts[:, None] | (self._rand(n, MAX_PARTS) < 0.5)
        swapped &= random_words[:, None] & exists
        kinds = torch.where(swapped, self.seen[words], item.kinds)
        rows, owner = self._clauses(kinds, exists, is_real, item.category)
        name_rows, object_row = self._names(item, kinds, exists, is_real, random_words)
        value, known = self._values(item, kinds, rows, owner, name_rows, is_real, random_words)
        part = torch.where(item.label == EMPTY, -1, item.label.long())
        clause = by_part(owner, part, CLAUSES)
        present = rows >= 0
        has_names = (name_rows >= 0).any(1)
        seen_at, said_at = part, clause
        if self.coarse_evidence:
            seen_at = F.max_pool3d(part.float()[:, None], 2)[:, 0].long()
            said_at = by_part(owner, seen_at, CLAUSES)
        evidence, reliability = self._evidence(seen_at, said_at, present, has_names, random_words)
        hinted = self._chance(n, 1 - self.mixture.no_hints)
        scene = VoxelScene(
            self._inputs(item, part),
            self.sentences.embed(rows, hinted),
            present,
            self.sentences.embed(object_row),
            object_row >= 0,
            evidence,
            reliability,
            self.sentences.embed(name_rows, hinted),
            name_rows >= 0,
            part,
            self._features(item, kinds, is_real, seen_at) if self.mixture.features else None,
        )
        occupied = part >= 0
        target = by_part(value, part, 0.0).movedim(-1, 1)
        # Of a real slot of unknown matter one cannot say which clause is meant, nor its value.
        sure = by_part((~is_real[:, None]) | (kinds >= 0), part, False)
        valued = by_part(known, part, False) & occupied
        mentioned = (present & exists_or_whole(exists)).sum(1)
        doubt = torch.zeros(n, device=self.device)
        return TrainingBatch(scene, target, clause, valued, occupied & sure, mentioned, doubt)

    def _clauses(self, kinds, exists, is_real, category) -> tuple[Tensor, Tensor]:
        """Rows of the clauses (n, 7) and the clause of every part (n, 6), ``CLAUSES`` for none."""
        n, mix, generator = len(kinds), self.mixture, self.generator
        silent = self._chance(n, mix.no_text)[:, None]
        said = (self._rand(n, MAX_PARTS) < mix.mention) & exists & ~silent & (kinds >= 0)
        as_part = self.sentences.pick(Role.PART, kinds, generator)
        as_matter = self.sentences.pick(Role.KIND, kinds, generator)
        rows = torch.where(is_real[:, None], as_matter, as_part)
        said &= rows >= 0
        own = torch.arange(MAX_PARTS, device=self.device).expand(n, -1)
        owner = torch.where(said, own, CLAUSES)
        owner = self._share(owner, kinds, said, is_real)
        self._join(rows, owner, kinds, said & ~is_real[:, None])
        rows = torch.where((owner == own) & said, rows, -1)
        specific = self._chance(n, 0.5) & (category >= 0)
        whole = self.sentences.pick(Role.WHOLE, torch.where(specific, category + 1, 0), generator)
        keep = self._chance(n, mix.whole) & ~silent[:, 0] & (whole >= 0)
        keep &= ~(is_real & (self.sentences.level[whole] >= 0))
        whole = torch.where(keep, whole, -1)
        owner = torch.where((owner == CLAUSES) & exists & keep[:, None], WHOLE, owner)
        return torch.cat([rows, whole[:, None]], 1), owner

    @staticmethod
    def _share(owner: Tensor, kinds: Tensor, said: Tensor, is_real: Tensor) -> Tensor:
        """Slots of a real object that are of one kind of matter share the first one's clause."""
        same = (
            (kinds[:, :, None] == kinds[:, None, :]) & said[:, None, :] & (kinds >= 0)[:, :, None]
        )
        first = torch.where(same, 1.0, 0.0).argmax(2)
        return torch.where(is_real[:, None] & same.any(2), first, owner)

    def _join(self, rows: Tensor, owner: Tensor, kinds: Tensor, said: Tensor) -> None:
        """Let one clause speak of two mentioned parts, in place."""
        score = self._rand(*said.shape) * said
        first, second = score.topk(2, dim=1).indices.unbind(1)
        at = torch.arange(len(rows), device=self.device)
        both = said[at, first] & said[at, second] & self._chance(len(rows), self.mixture.pair)
        pair = self.sentences.pair_of[kinds[at, first], kinds[at, second]]
        row = self.sentences.pick(Role.PAIR, torch.where(both, pair, -1), self.generator)
        use = row >= 0
        rows[at[use], first[use]] = row[use]
        owner[at[use], second[use]] = first[use]

    def _names(self, item, kinds, exists, is_real, random_words) -> tuple[Tensor, Tensor]:
        """Rows of the parts' own names (n, 6) and of the default template (n,), -1 if withheld."""
        n, mix = len(kinds), self.mixture
        made_up = self.sentences.pick(Role.NAME, torch.where(exists, kinds, -1), self.generator)
        names = torch.where(is_real[:, None], item.text[:, 1:], made_up)
        given = self._chance(n, mix.names)[:, None] & (self._rand(n, MAX_PARTS) < 0.9)
        category = torch.where(random_words, -1, item.category)
        template = self.sentences.pick(Role.OBJECT, category, self.generator)
        # A real object has six templates in a row.
        frame = torch.randint(6, (n,), generator=self.generator, device=self.device)
        template = torch.where(is_real, item.text[:, 0] + frame, template)
        template = torch.where(self._chance(n, mix.object_name), template, -1)
        return torch.where(given & exists, names, -1), template

    def _values(self, item, kinds, rows, owner, name_rows, is_real, random_words):
        """Normalised value of every part (n, 6, 3), and whether it is known (n, 6)."""
        sentences = self.sentences
        padded = torch.cat([rows, torch.full_like(rows[:, :1], -1)], dim=1)
        row = padded.gather(1, owner.clamp(max=CLAUSES))
        at = kinds.clamp(min=0)
        level = torch.where(row >= 0, sentences.level[row.clamp(min=0)], -1)
        at_level = sentences.levels[at, level]  # level -1 is the last column, the mean
        by_row = sentences.value[row.clamp(min=0)]
        by_name = sentences.value[name_rows.clamp(min=0)]
        named = (name_rows >= 0)[..., None] & ~by_name.isnan()
        mean = torch.where(is_real[:, None, None], item.value, sentences.levels[at, -1])
        rest = torch.where(named & ~is_real[:, None, None], by_name, mean)
        spoken = (row >= 0)[..., None]
        value = torch.where(spoken, torch.where((level >= 0)[..., None], at_level, by_row), rest)
        # A part that only its word could tell, with no word given, has no value to learn.
        hidden = random_words[:, None] & (row < 0) & (name_rows < 0)
        # A level moves a part within its own range, which an unknown word does not tell.
        hidden |= random_words[:, None] & (owner == WHOLE) & (level >= 0) & (name_rows < 0)
        known = ~value.isnan().any(-1) & ~hidden
        return torch.nan_to_num(value), known

    def _inputs(self, item: Store, part: Tensor) -> Tensor:
        """Occupancy, colour (dropped at times) and place."""
        n, cells = len(part), part.shape[-1]
        palette = self._rand(n, MAX_PARTS, 3)
        jitter = 0.1 * (self._rand(n, 1, 3) - 0.5) + 0.15 * (self._rand(n, MAX_PARTS, 3) - 0.5)
        light = 0.5 * self._rand(n, 1, 1) - 0.3
        lit = item.colour + self.mixture.augment * (item.colour * light + jitter)
        palette = torch.where(item.colour.isnan(), palette, lit)
        noise = 0.08 * (self._rand(n, *part.shape[1:], 3) - 0.5)
        shown = self._chance(n, self.mixture.colour).float()[:, None, None, None, None]
        colour = (by_part(palette, part, 0.0) + noise).clamp(0, 1) * shown
        occupied = (part >= 0).float()
        line = (torch.arange(cells, device=self.device) + 0.5) / cells * 2 - 1
        line = line * cells / (cells - 2)
        place = torch.stack(torch.meshgrid(line, line, line, indexing="ij"))
        place = place.expand(n, -1, -1, -1, -1)
        flag = shown.expand(-1, 1, *part.shape[1:])
        full = torch.cat([occupied[:, None], colour.movedim(-1, 1), flag, place], dim=1)
        return full * occupied[:, None]

    def _evidence(self, part, clause, present, has_names, random_words):
        """Simulated evidence of vision and names, (n, 2, 7, x, y, z), and reliability (n, 2)."""
        mix, n = self.mixture, len(part)
        seen = self._chance(n, mix.vision)
        seen = torch.where(random_words, self._chance(n, mix.vision_without_shape), seen)
        names = has_names & self._chance(n, 0.85)
        # A fifth useless, a quarter poor: how far to trust it is learned where it is in doubt.
        reach = torch.where(self._rand(n, 2) < 0.3, 1.0, mix.strength)
        strength = self._rand(n, 2) * reach * (self._rand(n, 2) > 0.2)
        strength[:, 1] = 1 + strength[:, 1]
        given = torch.stack([seen, names], dim=1)
        fields = [
            simulate_evidence(
                part, clause, present, strength[:, i], self.generator, noise=mix.noise
            )
            for i in range(2)
        ]
        fuzz = 0.3 * (self._rand(n, 2) - 0.5)
        reliability = (strength / mix.strength + fuzz).clamp(0.05, 1) * given
        evidence = torch.stack(fields, dim=1) * given[:, :, None, None, None, None]
        return evidence, reliability

    def _features(self, item: Store, kinds: Tensor, is_real: Tensor, part: Tensor) -> Tensor:
        """What an image encoder sees (n, F, x, y, z): of real slots what it saw, else simulated."""
        n, mix = len(part), self.mixture
        made_up = self.sentences.pick(Role.NAME, kinds, self.generator)
        rows = torch.where(is_real[:, None], item.text[:, 1:], made_up)
        simulated = simulate_features(self.sentences.sentence(rows), self.generator)
        if self.looks is not None:
            looked = (item.look >= 0) & self._chance(n, mix.looked)[:, None]
            seen = self.looks[item.look.clamp(min=0)]
            simulated = torch.where(looked[..., None], seen.to(simulated.dtype), simulated)
        shown = self._chance(n, mix.features)[:, None, None]
        return spread_features(simulated * shown, part, self.generator)
