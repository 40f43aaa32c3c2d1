"""Three biases of proposals, counted as they were made (UniPixie supplement, table S1).

Each is a count over parts or pairs of parts that could show it, so that a share can be told from
a proposal that gave no occasion.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import permutations
from typing import NamedTuple

from ....fem.table import Band, Material, Span
from ..parts import part_kinds
from .actor import AuditObject, band_of
from .proposal import PartRange, Proposal

NARROW = 1.5  # a range of E whose ends are less than this factor apart is nearly one number


class Bias(NamedTuple):
    """How often a bias was ``found``, out of how many ``occasions``, and ``what`` was counted."""

    name: str
    found: int
    occasions: int
    what: str


def count_biases(made: Iterable[tuple[AuditObject, Proposal]]) -> list[Bias]:
    """Count the three biases over the first proposals for objects."""
    made = list(made)
    prior = [_is_of_one_row(*part) for part in _open_parts(made)]
    order = [_overlaps(*pair) for pair in _ordered_pairs(made)]
    collapse = [_is_narrow(part.band.E) for part, _ in _open_parts(made)]
    return [
        Bias("category prior", sum(prior), len(prior),
             "parts whose name states no matter, with the range of one usual row alone"),
        Bias("structural hierarchy", sum(order), len(order),
             "pairs of parts whose matter the table orders by E, with ranges that overlap"),
        Bias("ambiguity collapse", sum(collapse), len(collapse),
             f"parts whose name states no matter, with an E known to a factor of {NARROW:g}"),
    ]  # fmt: skip


def _open_parts(
    made: Iterable[tuple[AuditObject, Proposal]],
) -> Iterator[tuple[PartRange, tuple[Material, ...]]]:
    """Parts whose name states no matter, with the rows of their kind."""
    for thing, proposal in made:
        for name, named in thing.parts.items():
            if len(named.materials) > 1:
                yield proposal.parts[name], part_kinds()[name].materials


def _ordered_pairs(made: Iterable[tuple[AuditObject, Proposal]]) -> Iterator[tuple[Span, Span]]:
    """E of pairs of parts, the first of which is stiffer by all that the table says of both."""
    for thing, proposal in made:
        truth = {name: band_of(named.materials).E for name, named in thing.parts.items()}
        for a, b in permutations(truth, 2):
            if truth[a].min > truth[b].max:
                yield proposal.parts[a].band.E, proposal.parts[b].band.E


def _is_of_one_row(part: PartRange, rows: tuple[Material, ...]) -> bool:
    """Whether the range of E lies within that of one row while the kind's reaches further."""
    whole: Band = band_of(rows)
    return any(
        row.E.min <= part.band.E.min and part.band.E.max <= row.E.max and row.E != whole.E
        for row in rows
    )


def _overlaps(stiffer: Span, softer: Span) -> bool:
    return stiffer.min < softer.max


def _is_narrow(E: Span) -> bool:
    return E.max < NARROW * E.min
