"""What the region network learns from: objects cut into regions, measured, with their true slots.

Real objects as they are, in baked light and in other colours, procedural ones in looks of real
slots; each by looks alone and by shells too, coarser and finer.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ...converters.npz import load_npz, save_npz
from ...fem.errors import InputError
from ...fem.table import MaterialTable
from ...predictors.appearance.features import PLAIN_FINISH
from ...predictors.encoders import TextEncoder
from ...predictors.matter import FEATURES, measure
from ...predictors.regions.division import MOST, segment
from ...predictors.regions.network import MEASURES, categories, measured, part_vector, part_words
from ...predictors.regions.network import kind_index as kind_of_material
from ...predictors.text.reader import parse
from .one_piece import OnePiece
from .real import CELLS, kind_index

FEWEST = 20  # cells that a slot needs to lend its look
_GREY_LEVELS = 48  # of a texture that is varied


class RegionSet(NamedTuple):
    """One object cut into regions.

    name: Of the object that it is of.
    shells: Whether the cut knew the shells of the mesh, and the finish.
    values: ``MEASURES`` of each region.
    contact: Fraction of a region's common faces that it has with each other one.
    cells: Cells of each slot in each region (regions, slots).
    slots: Names of the slots.
    kinds: For each slot the kind of matter that it was recoloured as, -1 where it was not.
    """

    name: str
    shells: bool
    values: np.ndarray
    contact: np.ndarray
    cells: np.ndarray
    slots: tuple[str, ...]
    kinds: tuple[int, ...]


class Looks(NamedTuple):
    """Looks of real slots: mean (n, 7), deviation of colour (n, 3), kind of matter (n,), or -1."""

    mean: np.ndarray
    deviation: np.ndarray
    kind: np.ndarray


def looks_of(pieces: Iterable[OnePiece]) -> Looks:
    """Return the looks of all slots that have cells enough."""
    rows = [
        (seen.mean(axis=0), seen[:, :3].std(axis=0), kind_index(name))
        for piece in pieces
        for slot, name in enumerate(piece.slots)
        for seen in [piece.looks[piece.slot == slot]]
        if len(seen) >= FEWEST
    ]
    return Looks(*map(np.array, zip(*rows, strict=True)))


def plain(looks: Float[np.ndarray, "n look"]) -> Float[np.ndarray, "n look"]:
    """Looks as a scan has them: without opacity and finish."""
    return np.concatenate([looks[:, :3], np.tile(PLAIN_FINISH, (len(looks), 1))], axis=1)


NEARS = {False: (10.0, 7.0, 5.0), True: (10.0, 7.0)}  # how near looks are one, without shells


def region_set(
    name: str, piece: OnePiece, kinds: Sequence[int] | None = None, *, shells: bool, near: float
) -> RegionSet:
    """Cut an object by looks that are as near, and by its shells, and measure the regions."""
    looks = piece.looks if shells else plain(piece.looks)
    region = segment(piece.cells, looks, piece.shell if shells else None, near=near)
    found = measured(piece.cells, looks, region)
    cells = np.zeros((len(found.values), len(piece.slots)))
    np.add.at(cells, (region, piece.slot), 1)
    kinds = tuple(kinds or [-1] * len(piece.slots))
    return RegionSet(name, shells, found.values, found.contact, cells, piece.slots, kinds)


def every_set(name: str, piece: OnePiece) -> list[RegionSet]:
    """Cut an object in every way."""
    ways = [(shells, near) for shells, nears in NEARS.items() for near in nears]
    return [region_set(name, piece, shells=shells, near=near) for shells, near in ways]


def two_sets(
    name: str, piece: OnePiece, rng: np.random.Generator, kinds: Sequence[int] | None = None
) -> list[RegionSet]:
    """Cut an object without and with its shells, by looks that are as near as chance has it."""
    return [
        region_set(name, piece, kinds, shells=shells, near=float(rng.choice(nears)))
        for shells, nears in NEARS.items()
    ]


def shorter(piece: OnePiece, rng: np.random.Generator) -> OnePiece:
    """The object with one of its sides two thirds as long, or almost as long as it was."""
    factor = np.ones(3)
    factor[rng.integers(3)] = rng.uniform(0.65, 0.95)
    cells, first = np.unique((piece.cells * factor).astype(int), axis=0, return_index=True)
    shell = np.unique(piece.shell[first], return_inverse=True)[1].ravel()
    return OnePiece(
        piece.name, cells, piece.looks[first], shell, piece.slot[first], piece.slots
    )  # fmt: skip


def in_baked_light(piece: OnePiece, rng: np.random.Generator) -> OnePiece:
    """The object as a scan may see it: colours alone, with light and noise in them."""
    looks = plain(piece.looks)
    looks[:, :3] *= baked_light(piece.cells, rng)[:, None]
    looks[:, :3] = (looks[:, :3] + 0.02 * rng.normal(size=(len(looks), 3))).clip(0, 1)
    return OnePiece(piece.name, piece.cells, looks, piece.shell, piece.slot, piece.slots)


def recoloured(
    piece: OnePiece, looks: Looks, rng: np.random.Generator
) -> tuple[OnePiece, list[int]]:
    """Return the object in looks of other slots, and the kind of matter that each slot now is.

    Of six in ten slots the look changes, of four to that of another kind; one object in seven keeps
    all. Half are darker or lighter, as under another lamp; half have baked light, as a scan does.
    """
    seen, kinds = piece.looks.astype(np.float32), [-1] * len(piece.slots)
    if rng.random() > 0.15:
        for slot, name in enumerate(piece.slots):
            mine = piece.slot == slot
            kind, change = kind_index(name), rng.random()
            if change < 0.4:
                kind = kinds[slot] = int(rng.choice(np.unique(looks.kind[looks.kind >= 0])))
            if change < 0.76 and mine.any():
                fitting = np.flatnonzero(looks.kind == kind) if kind >= 0 else len(looks.kind)
                new = looks.mean[rng.choice(fitting)]
                seen[mine] = new + (seen[mine] - seen[mine].mean(axis=0)) * rng.choice([0.3, 1.0])
    if rng.random() < 0.5:
        seen[:, :3] = seen[:, :3] * rng.uniform(0.75, 1.15) + rng.normal(size=3) * 0.02
    if rng.random() < 0.5:
        seen[:, :3] *= baked_light(piece.cells, rng)[:, None]
        seen[:, :3] += rng.normal(size=(len(seen), 3)) * 0.02
    seen[:, :4] = seen[:, :4].clip(0, 1)
    shown = OnePiece(piece.name, piece.cells, seen, piece.shell, piece.slot, piece.slots)
    return shown, kinds


def baked_light(
    cells: Int[np.ndarray, "n 3"], rng: np.random.Generator, *, strength: float = 0.15
) -> Float[np.ndarray, "n"]:
    """Factor on the colours of cells of light that a scan took for colour: blotches, and height."""
    from scipy.ndimage import gaussian_filter

    blotch = gaussian_filter(rng.normal(size=(CELLS,) * 3), CELLS / 8)
    height = cells[:, 2] - cells[:, 2].mean()
    height = height / max(float(height.std()), 1.0)
    return 1 + strength * (0.6 * blotch[tuple(cells.T)] / blotch.std() + 0.4 * height)


class Procedural(NamedTuple):
    """A procedural object, and what may be said of it: kind of part, and row, of each slot."""

    piece: OnePiece
    parts: tuple[str, ...]
    rows: tuple[str, ...]


def procedural(
    count: int, looks: Looks, kind_of_row: dict[str, int], rng: np.random.Generator
) -> list[Procedural]:
    """Return procedural objects in looks of real slots of the kind of matter that each part is."""
    import torch
    from scipy.ndimage import label as connect

    from .objects import CATEGORIES, HELD_OUT, make_objects
    from .parts import part_kinds
    from .shapes import EMPTY, rasterise

    names, kinds_of_parts = list(part_kinds()), list(part_kinds().values())
    made = make_objects(count, rng, names=[*CATEGORIES, *HELD_OUT])
    labels = rasterise(torch.from_numpy(np.asarray(made.rows, np.float32)), cells=CELLS).numpy()
    out = []
    for label, kinds in zip(labels, made.kinds, strict=True):
        cells = np.argwhere(label != EMPTY)
        part = label[tuple(cells.T)].astype(int)
        kinds = kinds[kinds >= 0]
        rows = [
            kinds_of_parts[kind].materials[rng.integers(len(kinds_of_parts[kind].materials))].name
            for kind in kinds
        ]
        any_colour, finish = rng.random() < 0.25, rng.random() < 0.8
        taken = []
        for row in rows:
            fitting = np.flatnonzero(looks.kind == kind_of_row[row])
            free = any_colour or kind_of_row[row] < 0 or not len(fitting)
            taken.append(rng.choice(len(looks.kind) if free else fitting))
        if len(taken) > 1 and rng.random() < 0.08:  # two neighbours of one look
            i, j = rng.choice(len(taken), 2, replace=False)
            taken[i] = taken[j]
        seen = looks.mean[taken][part].astype(np.float32)
        spread = np.minimum(looks.deviation[taken][part], 0.08)
        seen[:, :3] = (seen[:, :3] + rng.normal(size=spread.shape) * spread).clip(0, 1)
        seen = seen if finish else plain(seen)
        shell, found = np.zeros(len(cells), dtype=int), 0
        for k in range(len(kinds)):
            pieces, count_of = connect(label == k, structure=np.ones((3, 3, 3)))
            shell[part == k] = pieces[tuple(cells[part == k].T)] - 1 + found
            found += count_of
        slots = tuple(f"{k}" for k in range(len(kinds)))
        piece = OnePiece("", cells, seen, shell, part, slots)
        out.append(Procedural(piece, tuple(names[kind] for kind in kinds), tuple(rows)))
    return out


class Sentence(NamedTuple):
    """Clauses (words for parts, for a material, and the slots), and slots of which none speaks.

    ``anew``: Whether nobody said it so.
    """

    clauses: Sequence[tuple[str, str, Sequence[str]]]
    unsaid: Sequence[str] = ()
    anew: bool = False


def said_anew(
    said: Sequence[Sentence],
    parts: Sequence[tuple[str, str, Sequence[str]]],
    count: int,
    rng: np.random.Generator,
) -> list[Sentence]:
    """Return sentences of some of a thing's parts, half of them with the largest part first.

    Words for each part and its matter are those of ``parts``, the largest first, or of anybody who
    spoke of the same slots; one part in three that has other names gets one of them.
    """
    from .parts import part_kinds

    kinds = part_kinds().values()
    others = {word: kind.words for kind in kinds for word in kind.words}
    heard: dict[frozenset[str], list[tuple[str, str]]] = {}
    for part, matter, slots in (*parts, *(clause for one in said for clause in one.clauses)):
        heard.setdefault(frozenset(slots), []).append((part, matter))
    out: dict[str, Sentence] = {}
    for _ in range(count):
        few = len(parts) > 2 and rng.random() < 0.6
        chosen = rng.choice(
            len(parts), rng.integers(2, len(parts) + 1) if few else len(parts), False
        )
        chosen = chosen if rng.random() < 0.5 else np.sort(chosen)
        clauses = []
        for _, _, slots in (parts[i] for i in chosen):
            words, matters = zip(*heard[frozenset(slots)], strict=True)
            part = str(rng.choice(words))
            if part.lower() in others and rng.random() < 1 / 3:
                part = str(rng.choice(others[part.lower()]))
            clauses.append((part, str(rng.choice([*filter(None, matters)])), slots))
        unsaid = [slot for i in range(len(parts)) if i not in chosen for slot in parts[i][2]]
        unsaid = unsaid if rng.random() < 0.5 else []
        out.setdefault(json.dumps(clauses), Sentence(clauses, unsaid, anew=True))
    return [*out.values()] if len(parts) > 1 else []


def spoken_of(made: Procedural, rng: np.random.Generator) -> Sentence:
    """Return a sentence about a procedural object: mostly the largest part first."""
    from .parts import part_kinds

    volume = np.bincount(made.piece.slot, minlength=len(made.parts))
    order = rng.permutation(np.flatnonzero(volume))
    if rng.random() < 0.6:
        order = order[np.argsort(-volume[order], kind="stable")]
    groups = [[int(k)] for k in order]
    if len(groups) > 2 and rng.random() < 0.3:  # "the seat and the back are ..."
        i, j = rng.choice(len(groups), 2, replace=False)
        groups[i] += groups[j]
        groups.pop(j)
    kinds = part_kinds()
    words = [
        " and ".join(str(rng.choice(sorted(kinds[made.parts[k]].words))) for k in group)
        for group in groups
    ]
    return Sentence(
        [
            (word, made.rows[group[0]], [str(k) for k in group])
            for word, group in zip(words, groups, strict=True)
        ]
    )


# All of it as arrays, in one file.

NULL = -2
CLAUSES, OPTIONS, SLOTS = 8, 4, 32  # at most: of a sentence, of a clause's part, of an object


@dataclass(frozen=True, eq=False)
class RegionCorpus:
    """Sets of N segmentations of T things, and Q sentences about them; -1 stands for nothing.

    values (N, R, measures), contact (N, R, R), cells (N, R, slots): As ``RegionSet`` has them, 0
        after the last region.
    kinds (N, slots): Kind of matter that a slot was recoloured as.
    thing, shells, varied (N,): What it is of, which way it was cut, and whether it is not as found.
    real (T,): Whether a thing is real.
    slot_values (T, slots, features), slot_kinds (T, slots): What ``matter.measure`` says of the
        slots of a real thing, NaN of none, and the kinds that their names tell.
    of, anew (Q,): The thing that a sentence is about, and whether nobody said it so.
    part (Q, clauses, options), material (Q, clauses): Places in ``words`` and ``materials``; the
        first option is the whole phrase.
    clause (Q, slots): Clause that speaks of a slot; ``NULL`` where it is known that none does.
    word_vectors, material_vectors: Embeddings.
    material_kind, category: Of each material.
    facts: Names: words, materials, categories, things.
    """

    values: np.ndarray
    contact: np.ndarray
    cells: np.ndarray
    kinds: np.ndarray
    thing: np.ndarray
    shells: np.ndarray
    varied: np.ndarray
    real: np.ndarray
    slot_values: np.ndarray
    slot_kinds: np.ndarray
    of: np.ndarray
    anew: np.ndarray
    part: np.ndarray
    material: np.ndarray
    clause: np.ndarray
    word_vectors: np.ndarray
    material_vectors: np.ndarray
    material_kind: np.ndarray
    category: np.ndarray
    facts: dict[str, Any]

    def save(self, path: Path) -> None:
        """Write it, in half precision where that is enough."""
        arrays = {name: value for name, value in vars(self).items() if name != "facts"}
        for name in ("values", "contact", "word_vectors", "material_vectors", "slot_values"):
            arrays[name] = arrays[name].astype(np.float16)
        save_npz(path, facts=np.array(json.dumps(self.facts)), **arrays)

    @classmethod
    def load(cls, path: Path) -> RegionCorpus:
        """Read what ``save`` wrote."""
        try:
            arrays = load_npz(path)
            facts = json.loads(str(arrays.pop("facts")))
            whole = {k: v.astype(np.float32) if v.dtype == np.float16 else v
                     for k, v in arrays.items()}  # fmt: skip
            return cls(**whole, facts=facts)
        except (OSError, KeyError, TypeError, ValueError) as error:
            raise InputError(f"{path} is not a file of regions: {error}") from error


def row_of(material: str, table: MaterialTable) -> str:
    """Name of the row that the reader hears in a material's words, "" for none."""
    said = parse(f"the part is {material}", table).clauses
    named = next((c.material or c.coating for c in said if c.material or c.coating), None)
    return table.exact(named).name if named else ""


def as_corpus(
    sets: Sequence[tuple[RegionSet, bool]],
    said: Mapping[str, Sequence[Sentence]],
    pieces: Mapping[str, OnePiece],
    encoder: TextEncoder,
    table: MaterialTable,
) -> RegionCorpus:
    """Put sets (each with whether it is varied) and what is ``said`` of the things together.

    ``pieces`` are the real things.
    """
    things = [name for name in dict.fromkeys(one.name for one, _ in sets) if said.get(name)]
    number = {name: i for i, name in enumerate(things)}
    sets = [(one, varied) for one, varied in sets if one.name in number]
    slots_of = {one.name: one.slots[:SLOTS] for one, _ in sets}
    n, r, s = len(sets), MOST, SLOTS
    corpus = {
        "values": np.zeros((n, r, len(MEASURES)), dtype=np.float32),
        "contact": np.zeros((n, r, r), dtype=np.float32),
        "cells": np.zeros((n, r, s), dtype=np.float32),
        "kinds": np.full((n, s), -1),
        "thing": np.array([number[one.name] for one, _ in sets]),
        "shells": np.array([one.shells for one, _ in sets]),
        "varied": np.array([varied for _, varied in sets]),
        "real": np.array([name in pieces for name in things]),
    }
    for i, (one, _) in enumerate(sets):
        count, kept = len(one.values), min(len(one.slots), s)
        corpus["values"][i, :count] = one.values
        corpus["contact"][i, :count, :count] = one.contact
        corpus["cells"][i, :count, :kept] = one.cells[:, :kept]
        corpus["kinds"][i, :kept] = one.kinds[:kept]
    slot_values = np.full((len(things), s, len(FEATURES)), np.nan, dtype=np.float32)
    slot_kinds = np.full((len(things), s), -1)
    for name, piece in pieces.items():
        if name in number:
            there, own = np.unique(piece.slot, return_inverse=True)
            found = measure(piece.cells, piece.looks.astype(float), own.ravel())
            slot_values[number[name], there[there < s]] = found[there < s]
            slot_kinds[number[name], : len(slots_of[name])] = [*map(kind_index, slots_of[name])]
    words: dict[str, int] = {}
    materials: dict[str, int] = {}
    rows = []
    for name in things:
        for sentence in said[name]:
            part = np.full((CLAUSES, OPTIONS), -1)
            material, clause = np.full(CLAUSES, -1), np.full(s, -1)
            clause[[i for i, slot in enumerate(slots_of[name]) if slot in sentence.unsaid]] = NULL
            for k, (phrase, matter, of) in enumerate(sentence.clauses[:CLAUSES]):
                each = part_words(phrase)
                options = ([phrase] + (each if len(each) > 1 else []))[:OPTIONS] if each else []
                part[k, : len(options)] = [words.setdefault(word, len(words)) for word in options]
                material[k] = materials.setdefault(matter, len(materials)) if matter else -1
                clause[[i for i, slot in enumerate(slots_of[name]) if slot in of]] = k
            rows.append((number[name], sentence.anew, part, material, clause))
    known = categories(table)
    found_rows = [row_of(name, table) for name in materials]
    of, anew, part, material, clause = map(np.array, zip(*rows, strict=True))
    return RegionCorpus(
        **corpus, slot_values=slot_values, slot_kinds=slot_kinds, of=of, anew=anew, part=part,
        material=material, clause=clause,
        word_vectors=np.stack([part_vector(word, encoder) for word in words]),
        material_vectors=encoder.text([*materials]),
        material_kind=np.array([kind_of_material(*both, table)
                                for both in zip(materials, found_rows, strict=True)]),
        category=np.array([known.index(table.exact(row).category) if row else -1
                           for row in found_rows]),
        facts={"words": [*words], "materials": [*materials], "categories": known,
               "things": things},
    )  # fmt: skip
