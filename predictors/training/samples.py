"""Batches for training, made on the device: objects, colours, clauses, names, evidence, truth.

Shapes are drawn from a store of voxelised objects; everything else is drawn anew for each sample.
Three kinds of object are mixed: categories (words and shape tell which clause is meant), composites
and relabelled objects (only evidence tells), and real ones (clauses speak of kinds of matter).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from ..dataset.grammar import Role, spoken_names
from ..dataset.objects import Objects
from ..dataset.parts import part_kinds
from ..dataset.real import RealObject, kind_index
from ..dataset.shapes import EMPTY, MAX_PARTS, rasterise
from ..dataset.texttable import TextTable
from ..encoders.kinds import KINDS
from ..film_unet import Scene
from ..lexicon import CHANNELS

CLAUSES = MAX_PARTS + 1  # one for each part, one for the whole
WHOLE = MAX_PARTS
_CHUNK = 64  # objects rasterised at once
UNHINTED = 0.2  # of the clauses that train alone


@dataclass(frozen=True)
class Mixture:
    """How samples are drawn; all numbers are probabilities unless they say otherwise."""

    composite: float = 0.25
    relabelled: float = 0.1
    real: float = 0.15
    no_text: float = 0.1
    mention: float = 0.6
    whole: float = 0.2
    pair: float = 0.2
    object_name: float = 0.5
    names: float = 0.25
    vision: float = 0.5
    vision_without_shape: float = 0.85
    colour: float = 0.85
    strength: float = 4.0  # evidence is drawn with strengths from 0 to this
    no_hints: float = 0.15  # the lexicon is silent on a whole object
    augment: float = 1.0  # of the colours of real slots
    dressed: float = 0.0  # of the real ones: procedural shapes in slots of real objects
    noise: tuple[float, float, float] = (0.7, 0.7, 0.7)  # of evidence: by part, smooth, by voxel


class Batch(NamedTuple):
    """A scene with its truth.

    ``target`` (batch, 3, x, y, z) normalised; ``clause`` (batch, x, y, z) the clause that speaks of
    a voxel, ``CLAUSES`` for none; ``valued`` and ``bound``: where each of the two counts.
    ``mentioned`` (batch,) counts the clauses.
    """

    scene: Scene
    target: Tensor
    clause: Tensor
    valued: Tensor
    bound: Tensor
    mentioned: Tensor


class Store(NamedTuple):
    """Voxelised objects on the device.

    ``label`` (n, cells, cells, cells) uint8; ``kinds`` (n, 6): part kinds, or kinds of matter of
    real objects, -1 where unknown; ``category`` (n,); ``value`` (n, 6, 3) and ``colour`` (n, 6, 3)
    of real slots, NaN elsewhere; ``text`` (n, 7): rows of the default template and the slot names.
    """

    label: Tensor
    kinds: Tensor
    category: Tensor
    value: Tensor
    colour: Tensor
    text: Tensor


def procedural_store(objects: Objects, *, cells: int, device: str) -> Store:
    """Rasterise objects onto ``cells``^3 voxels."""
    rows = torch.tensor(objects.rows, device=device)
    label = torch.cat([rasterise(chunk, cells=cells) for chunk in rows.split(_CHUNK)])
    n = len(rows)
    nan = torch.full((n, MAX_PARTS, 3), torch.nan, device=device)
    none = torch.full((n, 1 + MAX_PARTS), -1, device=device)
    kinds = torch.tensor(objects.kinds, device=device)
    return Store(label, kinds, torch.tensor(objects.category, device=device), nan, nan, none)


def real_store(objects: list[RealObject], table: TextTable, *, cells: int, device: str) -> Store:
    """Bring real objects to ``cells``^3 voxels."""
    label = torch.tensor(np.stack([o.label for o in objects]), device=device)
    if cells != label.shape[1]:
        label = torch.cat([_coarsen(chunk, cells) for chunk in label.split(_CHUNK)])
    kinds, value, colour = _slots(objects)
    columns = (kinds, np.full(len(objects), -1), value, colour, table.real_names.astype(int))
    return Store(label, *(torch.tensor(column, device=device) for column in columns))


def _slots(objects: list[RealObject]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Kinds (n, 6), values (n, 6, 3) and colours (n, 6, 3) of the slots of real objects."""
    from ..normalisation import DEFAULT

    n = len(objects)
    kinds = np.full((n, MAX_PARTS), -1)
    value, colour = (np.full((n, MAX_PARTS, 3), np.nan, dtype=np.float32) for _ in range(2))
    for i, o in enumerate(objects):
        colour[i, : len(o.slots)] = o.colours
        for j, (slot, row) in enumerate(zip(o.slots, o.materials(), strict=True)):
            kinds[i, j] = kind_index(slot)
            if row is not None:
                value[i, j] = DEFAULT.normalise(*row.value())
    return kinds, value, colour


class Wardrobe:
    """Slots of real objects by kind of matter: colour, value and name of each belong together."""

    def __init__(self, objects: list[RealObject], table: TextTable) -> None:
        kinds, self._value, self._colour = (a.reshape(-1, *a.shape[2:]) for a in _slots(objects))
        self._name = table.real_names[:, 1:].reshape(-1)
        self._of_kind = [np.flatnonzero(kinds == k) for k in range(len(KINDS))]

    def dress(self, store: Store, matter: np.ndarray, rng: np.random.Generator) -> Store:
        """Give every part whose ``matter`` (n, 6) is known a slot of that kind."""
        value, colour = store.value.cpu().numpy().copy(), store.colour.cpu().numpy().copy()
        text = store.text.cpu().numpy().copy()
        for kind, slots in enumerate(self._of_kind):
            i, j = np.nonzero(matter == kind)
            if slots.size and i.size:
                chosen = rng.choice(slots, size=i.size)
                value[i, j], colour[i, j] = self._value[chosen], self._colour[chosen]
                text[i, 1 + j] = self._name[chosen]
        # A kind without a slot is unknown matter.
        empty = [k for k, slots in enumerate(self._of_kind) if not slots.size]
        kinds = np.where(np.isin(matter, empty), -1, matter)
        columns = (kinds, np.full(len(kinds), -1), value, colour, text)
        return Store(store.label, *(torch.tensor(c, device=store.label.device) for c in columns))


def dressed_store(shapes: Store, wardrobe: Wardrobe, book: Phrasebook, seed: int) -> Store:
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
    text[:, 0] = book.first(Role.OBJECT, shapes.category)
    nothing = torch.full_like(shapes.value, torch.nan)
    return wardrobe.dress(shapes._replace(text=text, value=nothing), matter, rng)


def _coarsen(label: Tensor, cells: int) -> Tensor:
    """Most frequent slot of the occupied voxels in each coarser cell."""
    factor = label.shape[1] // cells
    count = [F.avg_pool3d((label == p).float(), factor) for p in range(MAX_PARTS)]
    stacked = torch.stack(count)
    best = stacked.argmax(0).to(torch.uint8)
    return torch.where(stacked.sum(0) > 0, best, EMPTY)


def with_changes_of_dress(
    store: Store, wardrobe: Wardrobe, rng: np.random.Generator, *, changes: int = 3
) -> Store:
    """Real objects as they are, and again with each slot from another object of its kind."""
    stores = [store]
    for _ in range(changes):
        dressed = wardrobe.dress(store, store.kinds.cpu().numpy(), rng)
        stores.append(dressed)
    return Store(*(torch.cat(columns) for columns in zip(*stores, strict=True)))


class Phrasebook:
    """The text table on the device, with random picks by role and key."""

    def __init__(self, table: TextTable, device: str) -> None:
        def tensor(array: np.ndarray) -> Tensor:
            return torch.tensor(array, device=device)

        self.embedding = tensor(table.embedding)
        self.level, self.value = tensor(table.level).long(), tensor(table.value)
        self.levels = tensor(table.levels)
        self._first, self._count = {}, {}
        for role in Role:
            rows = np.flatnonzero(table.role == role)
            size = int(table.key[rows].max(initial=0)) + 1
            count = np.bincount(table.key[rows], minlength=size)
            start = (rows[0] if rows.size else 0) + np.cumsum(count) - count
            self._first[role], self._count[role] = tensor(start), tensor(count)
        kinds = len(table.levels)
        pairs = np.full((kinds + 1, kinds + 1), -1)
        pairs[table.pairs[:, 0], table.pairs[:, 1]] = np.arange(len(table.pairs))
        pairs[table.pairs[:, 1], table.pairs[:, 0]] = np.arange(len(table.pairs))
        self.pair_of = tensor(pairs)
        self.role = tensor(table.role)
        value, known = settled_values(table)
        self._value, self._settled = tensor(value), tensor(np.flatnonzero(known))

    def pick(self, role: Role, key: Tensor, generator: torch.Generator) -> Tensor:
        """Return a random row for each key, -1 where the key has none or is negative."""
        inside = (key >= 0) & (key < len(self._first[role]))
        key = torch.where(inside, key, 0)
        count = self._count[role][key]
        u = torch.rand(key.shape, generator=generator, device=key.device)
        row = self._first[role][key] + (u * count).long().clamp(max=(count - 1).clamp(min=0))
        return torch.where(inside & (count > 0), row, -1)

    def first(self, role: Role, key: Tensor) -> Tensor:
        """Return the first row of each key."""
        return self._first[role][key]

    def clauses(self, n: int, generator: torch.Generator) -> tuple[Tensor, Tensor, Tensor]:
        """Random clauses whose value needs no object: embeddings, slot types, values (n, 3)."""
        u = torch.rand(n, generator=generator, device=self.value.device)
        row = self._settled[(u * len(self._settled)).long()]
        kind = torch.where(self.role[row] == Role.NAME, 3, 0)
        hinted = torch.rand(n, generator=generator, device=self.value.device) > UNHINTED
        return self.embed(row, hinted), kind, self._value[row]

    def embed(self, row: Tensor, hinted: Tensor | None = None) -> Tensor:
        """Embeddings of rows (n, ...), zeros where the row is -1, hints where ``hinted`` (n,)."""
        out = self.embedding[row.clamp(min=0)].float() * (row >= 0)[..., None]
        if hinted is not None:
            plain = torch.arange(out.shape[-1], device=out.device) < out.shape[-1] - len(CHANNELS)
            out = out * (plain | hinted.reshape(-1, *(1,) * (out.ndim - 1)))
        return out


def settled_values(table: TextTable) -> tuple[np.ndarray, np.ndarray]:
    """Normalised values (rows, 3) of clauses that say all by themselves, and which do (rows,)."""
    value, kinds = table.value.copy(), len(table.levels)
    by_level = (table.role == Role.PART) & (table.level >= 0)
    value[by_level] = table.levels[table.key[by_level], table.level[by_level]]
    plain = (table.role == Role.NAME) & np.isnan(value[:, 0]) & (table.key < kinds)
    value[plain] = table.levels[table.key[plain], -1]
    return value, np.asarray(np.isfinite(value).all(axis=1))


class Sampler:
    """Draws batches from stores; ``stores`` are categories, composites, real objects (or None)."""

    def __init__(
        self,
        book: Phrasebook,
        shapes: Store,
        composites: Store | None,
        real: Store | None,
        *,
        mixture: Mixture,
        seed: int,
        dressed: Store | None = None,
        coarse_evidence: bool = False,
    ) -> None:
        self.book, self.mixture, self.dressed = book, mixture, dressed
        self.coarse_evidence = coarse_evidence  # at half the resolution: all that a fine net reads
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

    def draw(self, n: int) -> Batch:
        """Draw a batch of ``n`` samples."""
        mix = self.mixture
        wanted_real = round(n * mix.real) if self.real is not None else 0
        wanted_heap = round(n * mix.composite) if self.composites is not None else 0
        items = [_take(self.shapes, n - wanted_real - wanted_heap, self._rand)]
        if wanted_heap and self.composites is not None:
            items.append(_take(self.composites, wanted_heap, self._rand))
        if wanted_real and self.real is not None:
            dressed = round(wanted_real * mix.dressed) if self.dressed is not None else 0
            if dressed and self.dressed is not None:
                items.append(_take(self.dressed, dressed, self._rand))
            real = _take(self.real, wanted_real - dressed, self._rand)
            items.append(real._replace(label=self._stretch(real.label)))
        item = Store(*(torch.cat(columns) for columns in zip(*items, strict=True)))
        order = torch.arange(n, device=self.device)
        is_real = order >= n - wanted_real
        random_words = (order >= n - wanted_real - wanted_heap) & ~is_real
        random_words |= ~is_real & self._chance(n, mix.relabelled)
        item = item._replace(label=self._turn(item.label))
        return self.compose(item, is_real, random_words)

    def _turn(self, label: Tensor) -> Tensor:
        """Rotate about z by quarter turns and mirror, by halves of the batch."""
        order = torch.randperm(len(label), generator=self.generator, device=self.device)
        out = label.clone()
        for half in order.chunk(4):
            turns, mirror = torch.randint(
                4, (2,), generator=self.generator, device=self.device
            ).tolist()
            turned = torch.rot90(label[half], turns, (1, 2))
            out[half] = turned.flip(1) if mirror % 2 else turned
        return out

    def _stretch(self, label: Tensor) -> Tensor:
        """Shrink each object along each axis by up to a third."""
        n, cells = label.shape[:2]
        scale = 1 - self._rand(n, 3) / 3
        line = torch.arange(cells, device=self.device) + 0.5 - cells / 2
        at = (line[None, None] / scale[..., None] + cells / 2).floor().long()
        outside = (at < 0) | (at >= cells)
        x, y, z = at.clamp(0, cells - 1).unbind(1)
        which = torch.arange(n, device=self.device)[:, None, None, None]
        out = label[which, x[:, :, None, None], y[:, None, :, None], z[:, None, None, :]]
        a, b, c = outside.unbind(1)
        empty = a[:, :, None, None] | b[:, None, :, None] | c[:, None, None, :]
        return torch.where(empty, EMPTY, out)

    def compose(self, item: Store, is_real: Tensor, random_words: Tensor) -> Batch:
        """Give objects words, colours and evidence."""
        n = len(item.label)
        exists = _exists(item)
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
        clause = _by_part(owner, part, CLAUSES)
        present = rows >= 0
        has_names = (name_rows >= 0).any(1)
        seen_at, said_at = part, clause
        if self.coarse_evidence:
            seen_at = F.max_pool3d(part.float()[:, None], 2)[:, 0].long()
            said_at = _by_part(owner, seen_at, CLAUSES)
        evidence, reliability = self._evidence(seen_at, said_at, present, has_names, random_words)
        hinted = self._chance(n, 1 - self.mixture.no_hints)
        scene = Scene(
            self._inputs(item, part),
            self.book.embed(rows, hinted),
            present,
            self.book.embed(object_row),
            object_row >= 0,
            evidence,
            reliability,
            self.book.embed(name_rows, hinted),
            name_rows >= 0,
            part,
        )
        occupied = part >= 0
        target = _by_part(value, part, 0.0).movedim(-1, 1)
        # Of a real slot of unknown matter one cannot say which clause is meant, nor its value.
        sure = _by_part((~is_real[:, None]) | (kinds >= 0), part, False)
        valued = _by_part(known, part, False) & occupied
        mentioned = (present & exists_or_whole(exists)).sum(1)
        return Batch(scene, target, clause, valued, occupied & sure, mentioned)

    def _clauses(self, kinds, exists, is_real, category) -> tuple[Tensor, Tensor]:
        """Rows of the clauses (n, 7) and the clause of every part (n, 6), ``CLAUSES`` for none."""
        n, mix, generator = len(kinds), self.mixture, self.generator
        silent = self._chance(n, mix.no_text)[:, None]
        said = (self._rand(n, MAX_PARTS) < mix.mention) & exists & ~silent & (kinds >= 0)
        as_part = self.book.pick(Role.PART, kinds, generator)
        as_matter = self.book.pick(Role.KIND, kinds, generator)
        rows = torch.where(is_real[:, None], as_matter, as_part)
        said &= rows >= 0
        own = torch.arange(MAX_PARTS, device=self.device).expand(n, -1)
        owner = torch.where(said, own, CLAUSES)
        owner = self._share(owner, kinds, said, is_real)
        self._join(rows, owner, kinds, said & ~is_real[:, None])
        rows = torch.where((owner == own) & said, rows, -1)
        specific = self._chance(n, 0.5) & (category >= 0)
        whole = self.book.pick(Role.WHOLE, torch.where(specific, category + 1, 0), generator)
        keep = self._chance(n, mix.whole) & ~silent[:, 0] & (whole >= 0)
        keep &= ~(is_real & (self.book.level[whole] >= 0))
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
        pair = self.book.pair_of[kinds[at, first], kinds[at, second]]
        row = self.book.pick(Role.PAIR, torch.where(both, pair, -1), self.generator)
        use = row >= 0
        rows[at[use], first[use]] = row[use]
        owner[at[use], second[use]] = first[use]

    def _names(self, item, kinds, exists, is_real, random_words) -> tuple[Tensor, Tensor]:
        """Rows of the parts' own names (n, 6) and of the default template (n,), -1 if withheld."""
        n, mix = len(kinds), self.mixture
        made_up = self.book.pick(Role.NAME, torch.where(exists, kinds, -1), self.generator)
        names = torch.where(is_real[:, None], item.text[:, 1:], made_up)
        given = self._chance(n, mix.names)[:, None] & (self._rand(n, MAX_PARTS) < 0.9)
        category = torch.where(random_words, -1, item.category)
        template = self.book.pick(Role.OBJECT, category, self.generator)
        # A real object has six templates in a row.
        frame = torch.randint(6, (n,), generator=self.generator, device=self.device)
        template = torch.where(is_real, item.text[:, 0] + frame, template)
        template = torch.where(self._chance(n, mix.object_name), template, -1)
        return torch.where(given & exists, names, -1), template

    def _values(self, item, kinds, rows, owner, name_rows, is_real, random_words):
        """Normalised value of every part (n, 6, 3), and whether it is known (n, 6)."""
        book = self.book
        padded = torch.cat([rows, torch.full_like(rows[:, :1], -1)], dim=1)
        row = padded.gather(1, owner.clamp(max=CLAUSES))
        at = kinds.clamp(min=0)
        level = torch.where(row >= 0, book.level[row.clamp(min=0)], -1)
        at_level = book.levels[at, level]  # level -1 is the last column, the mean
        by_row = book.value[row.clamp(min=0)]
        by_name = book.value[name_rows.clamp(min=0)]
        named = (name_rows >= 0)[..., None] & ~by_name.isnan()
        mean = torch.where(is_real[:, None, None], item.value, book.levels[at, -1])
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
        colour = (_by_part(palette, part, 0.0) + noise).clamp(0, 1) * shown
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


def simulate_evidence(
    part: Tensor,
    clause: Tensor,
    present: Tensor,
    strength: Tensor,
    generator: torch.Generator,
    *,
    noise: tuple[float, float, float],
) -> Tensor:
    """Evidence of one source (n, 7, x, y, z): truth times ``strength`` plus noise, standardised.

    The noise has three shares: one number for each part and clause (a misjudged part), one that
    varies smoothly over the object, one for each voxel. A whole-object clause gets noise alone.
    """
    n, cells = len(part), part.shape[-1]

    def normal(*shape: int) -> Tensor:
        return torch.randn(shape, generator=generator, device=part.device)

    k = present.shape[1]
    order = torch.arange(k, device=part.device)
    truth = (clause[:, None] == order[None, :, None, None, None]) & (order != WHOLE)[
        None, :, None, None, None
    ]
    coarse = max(2, cells // 8)
    smooth = F.interpolate(normal(n, k, coarse, coarse, coarse), size=cells, mode="trilinear")
    by_part = _by_part(normal(n, MAX_PARTS, k), part, 0.0).movedim(-1, 1)
    field = truth * strength[:, None, None, None, None]
    field = field + noise[0] * by_part + noise[1] * smooth + noise[2] * normal(*field.shape)
    return standardise(field, (part >= 0)[:, None] & present[:, :, None, None, None])


def standardise(evidence: Tensor, where: Tensor) -> Tensor:
    """Zero mean and unit deviation over the voxels and clauses that count; 0 elsewhere."""
    count = where.sum(dim=(1, 2, 3, 4), keepdim=True).clamp(min=1)
    centred = (evidence - (evidence * where).sum((1, 2, 3, 4), keepdim=True) / count) * where
    variance = (centred * centred).sum((1, 2, 3, 4), keepdim=True) / count
    scaled = centred / (variance + 1e-4).sqrt()  # 1e-4: evidence that is constant stays silent
    return scaled.bfloat16() if scaled.is_cuda else scaled


def exists_or_whole(exists: Tensor) -> Tensor:
    """Which clause slots can hold a clause, (n, 7)."""
    return torch.cat([exists, torch.ones_like(exists[:, :1])], dim=1)


def _exists(item: Store) -> Tensor:
    """Whether each part has a voxel, (n, 6)."""
    return torch.stack([(item.label == p).any(3).any(2).any(1) for p in range(MAX_PARTS)], 1)


def _take(store: Store, n: int, rand) -> Store:
    index = (rand(n) * len(store.label)).long()
    return Store(*(column[index] for column in store))


def _by_part(values: Tensor, part: Tensor, outside) -> Tensor:
    """Spread values of parts (n, 6, ...) to their voxels; ``outside`` elsewhere."""
    n = len(part)
    flat = part.reshape(n, -1).clamp(min=0)
    at = torch.arange(n, device=part.device)[:, None]
    spread = values[at, flat].reshape(*part.shape, *values.shape[2:])
    mask = (part >= 0).reshape(*part.shape, *(1,) * (values.ndim - 2))
    return torch.where(mask, spread, torch.full_like(spread, outside))
