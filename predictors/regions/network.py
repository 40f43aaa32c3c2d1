"""Regions x clauses: a small set transformer says which clause speaks of which region, or none.

Tokens are the regions of a thing, the clauses of a sentence, and one null clause for matter that
nobody spoke of; all attend to all, and how far two regions touch is a bias. The shares of a region
are the softmax of a head on pairs that also hears how well its looks fit the clause's kind of
matter. Written for numpy: a thing has 48 regions at most, and torch alone takes longer to start.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ...fem.errors import InputError
from ...fem.note import Note
from ...fem.table import MaterialTable
from ..encoders import TextEncoder
from ..encoders.minilm import gelu
from ..matter import FEATURES, CategoriesByAppearance, measure
from ..packed import unpacked
from ..text.parts import KINDS, kind_of

WEIGHTS = Path(__file__).parents[1] / "weights" / "regions.safetensors"
PLACES = 8  # of clauses in a sentence that are told apart; later ones are all the last
ORDER = PLACES + 3  # the place, how many there are, where among them, and whether it is the null
EPSILON = 1e-5  # of the normalisation of layers
OUTLIER = 5.0  # deviations: measures beyond are clipped
HEADS, WORDS = 4, 384
# Kinds of matter by looks, of rows whose own words name none.
_KIND_OF_CATEGORY = {
    "metal": "metal", "wood": "wood", "plastic": "plastic", "elastomer": "rubber",
    "hard elastomer": "rubber", "stone": "stone", "glass-ceramic": "ceramic", "plant": "plant",
    "paper": "paper",
}  # fmt: skip


class Said(NamedTuple):
    """What a clause says: words for parts, words for a material, and its row; "" for none."""

    part: str
    material: str = ""
    row: str = ""


class Inputs(NamedTuple):
    """What the network is given of a thing of R regions and a sentence of K - 1 clauses.

    ``region`` (R, measures + 1) are standardised measures and whether a mesh told the shells;
    ``pairs`` (R, R, 4) what ``measures.pairs_of`` says of two regions;
    ``part``, ``material`` (K, 384) embeddings of words, ``matter`` (K, kinds + 1 + categories) what
    the material is, ``order`` (K, ORDER) the place in the sentence, the null clause last;
    ``evidence`` (R, K, 3) how much likelier the looks make the clause's kind of matter [log],
    whether they tell, and what a user told of the region: 1 of its clause, -1 of the others;
    ``told`` (R,) the clause that a user gave the region, -1 where none did.
    """

    region: np.ndarray
    pairs: np.ndarray
    part: np.ndarray
    material: np.ndarray
    matter: np.ndarray
    order: np.ndarray
    evidence: np.ndarray
    told: np.ndarray


def part_words(phrase: str) -> list[str]:
    """Phrases for single parts: "base and armrests" -> base, armrests."""
    found = re.split(r",|;|&|\band\b|\bor\b|\bwith\b", phrase.lower())
    return [words for each in found if (words := " ".join(each.split()))]


def part_vector(phrase: str, encoder: TextEncoder) -> Float[np.ndarray, "dim"]:
    """Unit embedding of words for parts, of several the mean."""
    mean = encoder.text(part_words(phrase)).mean(axis=0)
    return mean / np.linalg.norm(mean)


class Words(NamedTuple):
    """Embeddings of what clauses call parts and materials (K - 1, 384) each; 0 of none."""

    part: np.ndarray
    material: np.ndarray

    @classmethod
    def of(cls, said: Sequence[Said], encoder: TextEncoder) -> Words:
        """Embed each phrase once, all together."""
        phrases = {word for each in said for word in (*part_words(each.part), each.material)}
        names = sorted(phrases - {""})
        vector = dict(zip(names, encoder.text(names), strict=True)) if names else {}
        none = np.zeros(WORDS, dtype=np.float32)
        parts = [sum((vector[word] for word in part_words(each.part)), none) for each in said]
        return cls(
            np.stack([part / max(float(np.linalg.norm(part)), EPSILON) for part in parts]),
            np.stack([vector.get(each.material, none) for each in said]),
        )


def categories(table: MaterialTable) -> list[str]:
    """Categories of the table, in the order that ``matter`` counts them."""
    return sorted({row.category for row in table})


def kind_index(material: str, row: str, table: MaterialTable) -> int:
    """Index into ``KINDS`` of a material's words or of its row, -1 where neither tells."""
    kind = kind_of(material)
    if kind is None and row:
        kind = kind_of(row) or _KIND_OF_CATEGORY.get(table.exact(row).category)
    return -1 if kind is None else KINDS.index(kind)


def matter_vector(kind: int, category: int | None, count: int) -> Float[np.ndarray, "n"]:
    """One-hot kind (the last of them for another one) and category; 0 without a category."""
    out = np.zeros(len(KINDS) + 1 + count, dtype=np.float32)
    if category is not None:
        out[[kind if kind >= 0 else len(KINDS), len(KINDS) + 1 + category]] = 1.0
    return out


def order_vectors(count: int) -> Float[np.ndarray, "clauses order"]:
    """Places of so many clauses, and the null clause as the last."""
    out = np.zeros((count + 1, ORDER), dtype=np.float32)
    place = np.arange(count)
    out[place, np.minimum(place, PLACES - 1)] = 1.0
    out[:, PLACES] = count / PLACES
    out[:count, PLACES + 1] = place / max(count - 1, 1)
    out[count, PLACES + 2] = 1.0
    return out


@dataclass(frozen=True, eq=False)
class RegionNetwork:
    """Networks that were trained alike, whose shares are averaged.

    Parameters
    ----------
    tensors
        Weights by name, the networks along the first axis.
    facts
        ``mean`` and ``deviation`` of the measures, ``categories`` of the table that it knows, and
        ``certainty``, the slope and offset of its calibration.
    """

    tensors: Mapping[str, np.ndarray]
    facts: Mapping

    @classmethod
    @lru_cache(maxsize=2)
    def load(cls, path: Path = WEIGHTS) -> RegionNetwork:
        """Return the shipped ones, or those of a file of safetensors.

        Raises InputError: Where it is no such file, or of other measures or kinds.
        """
        from safetensors import SafetensorError, safe_open

        try:
            with safe_open(path, framework="np") as file:
                facts = {name: json.loads(fact) for name, fact in file.metadata().items()}
                stored = {k: file.get_tensor(k) for k in file.keys()}
            if facts["measures"] != list(MEASURES) or facts["kinds"] != list(KINDS):
                raise ValueError(Note("matter.other_features"))
        except (SafetensorError, OSError, AttributeError, KeyError, ValueError) as error:
            raise InputError("regions.no_weights", path=path, error=error) from error
        return cls(unpacked(stored), facts)

    def inputs(
        self,
        found: Measured,
        said: Sequence[Said],
        *,
        words: Words,
        shells: bool,
        table: MaterialTable,
        told: Int[np.ndarray, "regions"] | None = None,
    ) -> Inputs:
        """Return what the network is given of measured regions and of what clauses say.

        words: The embeddings of what they say.
        told: The clause that a user gave each region, their number for none of them, else -1.
        """
        rows = list(self.facts["categories"])
        ratio = CategoriesByAppearance.load().log_ratio(found.values[:, : len(FEATURES)])
        kinds = [kind_index(each.material, each.row, table) for each in said]
        places = [table.exact(each.row).category if each.row else None for each in said]
        evidence = np.zeros((len(found.values), len(said) + 1, 3), dtype=np.float32)
        for k, kind in enumerate(kinds):
            if kind >= 0:
                evidence[:, k, 0], evidence[:, k, 1] = ratio[:, kind], 1.0
        told = np.full(len(ratio), -1) if told is None else told
        known = np.flatnonzero(told >= 0)
        evidence[known, :, 2] = -1.0
        evidence[known, told[known], 2] = 1.0
        none = np.zeros((1, WORDS), dtype=np.float32)
        matter = [
            matter_vector(kind, rows.index(place) if place in rows else None, len(rows))
            for kind, place in zip(kinds, places, strict=True)
        ]
        return Inputs(
            self.standard(found.values, shells=shells),
            pairs_of(found),
            np.concatenate([words.part, none]),
            np.concatenate([words.material, none]),
            np.stack([*matter, matter_vector(-1, None, len(rows))]),
            order_vectors(len(said)),
            evidence,
            told,
        )

    def standard(
        self, values: Float[np.ndarray, "r measures"], *, shells: bool
    ) -> Float[np.ndarray, "r inputs"]:
        """Measures in deviations from their mean, and whether a mesh told the shells."""
        return standardised(values, self.facts["mean"], self.facts["deviation"], shells=shells)

    def __call__(self, given: Inputs) -> Float[np.ndarray, "regions clauses"]:
        """Shares of the clauses in every region, the null clause last; what a user told is so."""
        r = self._linear("region.2", gelu(self._linear("region.0", given.region[None])))
        c = self._linear("part", given.part[None]) + self._linear("material", given.material[None])
        c = c + self._linear("said", np.concatenate([given.matter, given.order], axis=1)[None])
        known, kind = np.flatnonzero(given.told >= 0), self.tensors["kind"]
        r[:, known] += self._linear("told", c[:, given.told[known]])
        x = np.concatenate([r + kind[:, :1], c + kind[:, 1:]], axis=1)
        nets, n, width = x.shape
        regions = len(given.region)
        bias = np.zeros((nets, HEADS, n, n), dtype=np.float32)
        touch = self._linear("touch", given.pairs.reshape(1, regions * regions, -1))
        bias[..., :regions, :regions] = touch.swapaxes(1, 2).reshape(nets, HEADS, regions, regions)
        for layer in range(len([k for k in self.tensors if k.endswith("attend.weight")])):
            at = f"layers.{layer}"
            qkv = self._linear(f"{at}.attend", self._norm(f"{at}.before", x))
            q, k, v = qkv.reshape(nets, n, 3, HEADS, -1).transpose(2, 0, 3, 1, 4)
            weight = _softmax(q @ k.swapaxes(-1, -2) / (width // HEADS) ** 0.5 + bias)
            mixed = (weight @ v).swapaxes(1, 2).reshape(nets, n, width)
            x = x + self._linear(f"{at}.out", mixed)
            inner = gelu(self._linear(f"{at}.inner", self._norm(f"{at}.between", x)))
            x = x + self._linear(f"{at}.outer", inner)
        r = self._norm("regions_out", x[:, :regions])[:, :, None]
        c = self._norm("clauses_out", x[:, regions:])[:, None]
        shape = np.broadcast_shapes(r.shape, c.shape)
        evidence = np.broadcast_to(given.evidence, (nets, *given.evidence.shape))
        both = [np.broadcast_to(r, shape), np.broadcast_to(c, shape), r * c, evidence]
        pairs = np.concatenate(both, axis=-1).reshape(nets, regions * shape[2], -1)
        logit = self._linear("pair.2", gelu(self._linear("pair.0", pairs)))
        logit = logit.reshape(nets, regions, -1)
        logit = logit + (evidence * self.tensors["looks.weight"][:, None]).sum(axis=-1)
        shares = _softmax(logit).mean(axis=0)
        shares[known] = np.eye(shares.shape[1])[given.told[known]]
        return shares

    def _linear(self, name: str, x: np.ndarray) -> np.ndarray:
        y = x @ self.tensors[f"{name}.weight"].swapaxes(1, 2)
        return y + self.tensors[f"{name}.bias"][:, None]

    def _norm(self, name: str, x: np.ndarray) -> np.ndarray:
        x = x - x.mean(axis=-1, keepdims=True)
        x = x / np.sqrt((x * x).mean(axis=-1, keepdims=True) + EPSILON)
        return x * self.tensors[f"{name}.weight"][:, None] + self.tensors[f"{name}.bias"][:, None]


def standardised(
    values: Float[np.ndarray, "r measures"], mean, deviation, *, shells: bool
) -> Float[np.ndarray, "r inputs"]:
    """Measures in deviations from their mean, and whether a mesh told the shells."""
    x = (values - np.asarray(mean)) / np.asarray(deviation)
    flag = np.full((len(x), 1), float(shells))
    return np.concatenate([x.clip(-OUTLIER, OUTLIER), flag], axis=1).astype(np.float32)


def _softmax(x: np.ndarray) -> np.ndarray:
    weight = np.exp(x - x.max(axis=-1, keepdims=True))
    return weight / weight.sum(axis=-1, keepdims=True)


# Beside those of ``matter.measure``; lengths over the longest side of the whole.
MEASURES = (
    *FEATURES, "own width", "own depth", "own height", "x offset", "y offset",
    "mean radius", "outer contact", "inner contact", "mirror x", "mirror y",
    "upright axis", "flat axis", "log copies", "log contact", "neighbours", "log whole fill",
    "log slenderness x", "log slenderness y", "log slenderness z", "log relative", "rank",
    "log count", "log copied share", "log like share", "contrast", "whole contrast",
    "closest contact",
)  # fmt: skip
# Of two regions: the share of the first one's common faces, how like their looks and sizes are,
# and whether the first is higher.
PAIRS = ("contact", "like look", "like size", "higher")
# Measures that change places where the thing makes a quarter turn about its upright axis, and where
# each measure then comes from.
_CHANGED = {
    "width": "depth", "own width": "own depth", "x offset": "y offset", "mirror x": "mirror y",
    "log slenderness x": "log slenderness y",
}  # fmt: skip
_CHANGED |= {other: one for one, other in _CHANGED.items()}
TURNED = [MEASURES.index(_CHANGED.get(name, name)) for name in MEASURES]
_COPY = 0.15  # of the logarithm of sizes that differ by less, two regions are copies
_FACES = 5.0  # what brings logarithms of faces, and numbers of neighbours, near 1
_LIKE = 12.0  # of CIE L*a*b*: looks that differ by less are one
_HIGHER = 0.2  # of the whole's height


class Measured(NamedTuple):
    """What is measured of a thing's regions.

    values: ``MEASURES`` of each (regions, measures).
    contact: Fraction of its common faces that each has with each other one (regions, regions).
    """

    values: np.ndarray
    contact: np.ndarray


def measured(
    cells: Int[np.ndarray, "n 3"], looks: Float[np.ndarray, "n look"], region: Int[np.ndarray, "n"]
) -> Measured:
    """Measure the regions of a thing.

    cells: Indices of its cells on an upright grid.
    looks: As ``matter.measure`` takes them.
    region: The region of each cell, from 0, none empty.
    """
    count, low, high = int(region.max()) + 1, cells.min(axis=0), cells.max(axis=0) + 1
    sides, longest = high - low, float((high - low).max())
    box = np.full(sides + 2, count)  # outside is a region too
    box[tuple((cells - low + 1).T)] = region
    touch = np.zeros((count + 1, count + 1))
    for axis in range(3):
        a, b = (np.moveaxis(box, axis, 0)[part] for part in (slice(1, None), slice(None, -1)))
        np.add.at(touch, (a[a != b], b[a != b]), 1)
    touch += touch.T
    values = measure(cells, looks, region)
    size = np.bincount(region, minlength=count)
    colours = values[:, :3]
    apart = np.linalg.norm(colours[:, None] - colours, axis=2)
    copied = (np.abs(np.log(size / size[:, None])) < _COPY) & (apart < _LIKE)
    spread = np.sqrt((size / len(cells)) @ np.square(colours - size @ colours / len(cells)))
    whole = [np.log(len(cells) / np.prod(sides)), *np.log(sides / longest)]
    rows = []
    for k in range(count):
        own = cells[region == k]
        place = (own + 0.5 - (low + high) / 2) / longest
        spread_of = place - place.mean(axis=0)
        # 1e-5: as in ``matter.measure``
        axes = np.linalg.eigh(spread_of.T @ spread_of / len(own) + 1e-5 * np.eye(3))[1]
        mirrored = []
        for axis in range(2):
            across = own - low + 1
            across[:, axis] = sides[axis] + 1 - across[:, axis]
            mirrored.append((box[tuple(across.T)] == k).mean())
        outer, inner = touch[k, count], touch[k, :count].sum()
        rows.append([
            *((np.ptp(own, axis=0) + 1) / longest), *np.abs(place[:, :2].mean(axis=0)),
            np.hypot(*place[:, :2].T).mean(), outer / (outer + inner), inner / (outer + inner),
            *mirrored, abs(axes[2, 2]), abs(axes[2, 0]),
            np.log((np.abs(np.log(size / size[k])) < _COPY).sum()), np.log1p(inner) / _FACES,
            (touch[k, :count] > 0).sum() / _FACES, *whole, np.log(size[k] / size.max()),
            (size > size[k]).sum() / count, np.log(count),
            np.log(size[copied[k]].sum() / len(cells)),
            np.log(size[apart[k] < _LIKE].sum() / len(cells)),
            touch[k, :count] @ apart[k] / (inner + 1), np.linalg.norm(spread),
            touch[k, :count].max() / (inner + 1),
        ])  # fmt: skip
    values = np.concatenate([values, np.array(rows)], axis=1)
    share = touch[:count, :count] / (touch[:count, :count].sum(axis=1, keepdims=True) + 1)
    return Measured(values.astype(np.float32), share.astype(np.float32))


def copies(found: Measured) -> Bool[np.ndarray, "regions regions"]:
    """Whether two regions are of one look and of one size."""
    look, size = found.values[:, :3], found.values[:, FEATURES.index("log share")]
    apart = np.linalg.norm(look[:, None] - look, axis=2)
    return (apart < _LIKE) & (np.abs(size - size[:, None]) < _COPY)


def quarter_turned(found: Measured) -> Measured:
    """What is measured of the thing after a quarter turn about its upright axis."""
    return found._replace(values=found.values[:, TURNED])


def pairs_of(found: Measured) -> Float[np.ndarray, "regions regions pairs"]:
    """``PAIRS`` of measured regions."""
    values, look = found.values, found.values[:, :3]
    apart = np.linalg.norm(look[:, None] - look, axis=2)
    size, height = (values[:, FEATURES.index(name)] for name in ("log share", "height"))
    each = [
        found.contact,
        np.exp(-apart / _LIKE),
        np.exp(-np.abs(size[:, None] - size) / _COPY),
        np.tanh((height[:, None] - height) / _HIGHER),
    ]
    return np.stack(each, axis=-1).astype(np.float32)
