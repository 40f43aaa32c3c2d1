"""Ranges of matter by what a thing is called: [min, max] of E, nu, rho, class, typical colours.

UniPixie supplement, A.1: an annotation of a part is a range, not a point. Here the range of "leg"
is what its plausible materials span, that of "oak leg" the one of the row, from the soft end to
the stiff one; rows carry class and colour.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Float16, Int

from ...fem.errors import InputError
from ...fem.mpm.materials import class_of
from ...fem.table import NU_CAP, Material, load_colours, load_contents, load_table
from ...predictors.field import DEFAULT, Normalisation
from .grammar import spoken_names
from .parts import PartKind, part_kinds

MOST_ROWS = 6  # that a kind of part may plausibly be made of
_PARTS_A_ROW = 6  # kinds of part that a row is named with, beside those it is usual for
_NO_COLOUR = (50.0, 0.0, 0.0, 1e3)  # a spread that says nothing


class Named(NamedTuple):
    """Words for a thing, the kind of part they speak of (-1: none), and what it may be made of."""

    text: str
    kind: int
    materials: tuple[Material, ...]


@dataclass(frozen=True, eq=False)
class RangeTable:
    """Names with the rows they leave plausible, and the rows with their ranges.

    ``embedding`` are unit vectors of the names; ``kind`` (names,) indexes ``part_kinds()``, -1 for
    a material alone; ``rows`` (names, 6) index the rows, -1 behind the last. ``low``, ``high``
    (rows, 3) are normalised (log E, nu, log rho), ``matter`` (rows,) the class, ``colour``
    (rows, 4) CIE L*, a*, b* and their spread; ``kind_rows`` (kinds, 6) as ``rows``.
    """

    embedding: Float16[np.ndarray, "names dim"]
    kind: Int[np.ndarray, "names"]
    rows: Int[np.ndarray, "names 6"]
    low: Float[np.ndarray, "rows 3"]
    high: Float[np.ndarray, "rows 3"]
    matter: Int[np.ndarray, "rows"]
    colour: Float[np.ndarray, "rows 4"]
    kind_rows: Int[np.ndarray, "kinds 6"]

    def save(self, path: Path) -> None:
        """Write the table as safetensors."""
        from safetensors.numpy import save_file

        save_file({f.name: np.ascontiguousarray(getattr(self, f.name)) for f in fields(self)}, path)

    @classmethod
    def load(cls, path: Path) -> RangeTable:
        """Read what ``save`` wrote; a file of another kind is an ``InputError``."""
        from safetensors import SafetensorError
        from safetensors.numpy import load_file

        try:
            return cls(**load_file(path))
        except (SafetensorError, OSError, TypeError) as error:
            raise InputError(f"{path} is not a table of ranges: {error}") from error


def build_range_table(
    embed: Callable[[Sequence[str]], np.ndarray],
    *,
    seed: int = 0,
    normalisation: Normalisation = DEFAULT,
) -> RangeTable:
    """Name every kind of part and every row of the table, and put down their ranges."""
    materials = [*load_table(), *load_contents()]
    number = {row.name: i for i, row in enumerate(materials)}
    named = list(dict.fromkeys(name_things(np.random.default_rng(seed))))
    kinds = list(part_kinds().values())
    ends = [[normalisation.normalise(*end) for end in row_ends(row)] for row in materials]
    low, high = np.array(ends, dtype=np.float32).transpose(1, 0, 2)
    colours = load_colours()
    shades = [colours.get(row.name) for row in materials]
    return RangeTable(
        embedding=embed([thing.text for thing in named]).astype(np.float16),
        kind=np.array([thing.kind for thing in named], dtype=np.int32),
        rows=_padded([[number[m.name] for m in thing.materials] for thing in named]),
        low=low,
        high=high,
        matter=np.array([class_of(row) for row in materials], dtype=np.int32),
        colour=np.array(
            [_NO_COLOUR if c is None else (c.L, c.a, c.b, c.spread) for c in shades],
            dtype=np.float32,
        ),
        kind_rows=_padded([[number[m.name] for m in kind.materials] for kind in kinds]),
    )


def row_ends(row: Material) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Return E [Pa], nu [1], rho [kg/m^3] at the soft and at the stiff end of a row."""
    low, high = ((row.E[i], min(max(row.nu[i], 0.0), NU_CAP), row.rho[i]) for i in (0, 1))
    return low, high


def name_things(rng: np.random.Generator) -> Iterator[Named]:
    """Yield names of parts, of parts of a material, and of materials alone."""
    kinds = list(part_kinds().values())
    seen = [i for i, kind in enumerate(kinds) if not kind.held_out]
    usual: dict[str, list[int]] = {}
    for i, kind in enumerate(kinds):
        for word in kind.words:
            yield Named(word, i, kind.materials)
        for row in kind.materials:
            usual.setdefault(row.name, []).append(i)
    for row in load_table():
        others = rng.choice(seen, size=_PARTS_A_ROW, replace=False).tolist()
        for said in spoken_names(row)[:2]:
            yield Named(said, -1, (row,))
            for i in [*usual.get(row.name, ()), *others]:
                yield Named(_together(said, kinds[i], rng), i, (row,))
    for row in load_contents():
        for said in row.aliases[:2]:
            yield Named(said, -1, (row,))


def _together(material: str, kind: PartKind, rng: np.random.Generator) -> str:
    word = str(rng.choice(kind.words))
    return f"{material} {word}" if rng.random() < 0.5 else f"{word} of {material}"


def _padded(rows: Sequence[Sequence[int]]) -> Int[np.ndarray, "n 6"]:
    out = np.full((len(rows), MOST_ROWS), -1, dtype=np.int32)
    for line, given in zip(out, rows, strict=True):
        line[: len(given)] = given[:MOST_ROWS]
    return out
