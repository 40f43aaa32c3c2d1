"""Parts said to be stiffer or lighter than others: values that keep these relations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from typing import NamedTuple

from ...fem.scene.materials import Material, MaterialValue
from ..prediction import PartChoice
from ..quantities.quantity import Comparison


class _Beside(NamedTuple):
    """What a part is compared with: a part with its row, or a row that it need not be of."""

    name: str
    value: MaterialValue
    row: Material | None


def with_relations(
    choices: Sequence[PartChoice],
    relations: Sequence[Sequence[Comparison]],
    parts_called: Callable[[tuple[str, ...]], Sequence[int]],
    row_called: Callable[[tuple[str, ...]], Material | None] = lambda _: None,
    *,
    named: Sequence[bool],
) -> tuple[list[PartChoice], list[str]]:
    """Return choices that keep what is said of parts beside each other, and what to warn of.

    Parameters
    ----------
    choices
        What is chosen for each part so far.
    relations
        For each part what is said of it beside others.
    parts_called
        Indices of the parts that words name.
    row_called
        The row of a table that words name: "as dense as water", where no part is called so.
    named
        Whether each part's material is said, or told by the asset: it then keeps its row.
    """
    out, told, called = list(choices), [], cache(parts_called)
    others = [
        [_others(relation, called, i, len(out)) for relation in said]
        for i, said in enumerate(relations)
    ]
    waiting = {i: None for i, said in enumerate(relations) if said}  # in order
    while waiting:
        ready = [i for i in waiting if not any(k in waiting for ks in others[i] for k in ks)]
        if not ready:
            names = ", ".join(repr(out[i].part) for i in waiting)
            told.append(f"parts {names} are compared with each other in a circle: not used")
            break
        for i in ready:
            for relation, found in zip(relations[i], others[i], strict=True):
                row = None if found else row_called(relation.other)
                if found:
                    beside = [_Beside(repr(out[k].part), out[k].value, out[k].row) for k in found]
                    out[i] = _related(out[i], relation, beside, named=named[i])
                elif row:
                    beside = [_Beside(row.name, row.value(), None)]
                    out[i] = _related(out[i], relation, beside, named=named[i])
                else:
                    told.append(
                        f"part {out[i].part!r} is compared with {' '.join(relation.other)!r}, "
                        "and no part is called so: not used"
                    )
        for i in ready:
            del waiting[i]
    return out, told


def _others(
    relation: Comparison,
    parts_called: Callable[[tuple[str, ...]], Sequence[int]],
    part: int,
    count: int,
) -> list[int]:
    found = parts_called(relation.other) if relation.other else range(count)
    return [k for k in found if k != part]


def _related(
    choice: PartChoice, relation: Comparison, others: Sequence[_Beside], *, named: bool
) -> PartChoice:
    """Return a choice that keeps one relation, by its own row if one is named."""
    measure, more = relation.measure, relation.factor >= 1
    values = [getattr(other.value, measure) for other in others]
    reference = others[values.index(max(values) if more else min(values))]
    wanted = relation.factor * getattr(reference.value, measure)
    if not named and reference.row:
        choice = replace(
            choice, row=reference.row, value=reference.value, doubts=(), settled=True, weight=1.0,
            guessed=not (relation.exact and choice.understood), network="",
        )  # fmt: skip
    own = getattr(choice.value, measure)
    if named and not relation.exact:  # no more than a word: a row that is named keeps its range
        span = getattr(choice.row, measure)
        wanted = min(max(wanted, span.min), span.max)
    if named and not relation.exact and ((own >= wanted) if more else (own <= wanted)):
        return choice
    how = (
        f"{measure} = {wanted:.3g}, {relation.factor:.3g} times that of {reference.name}: "
        f"{'said so' if relation.exact else 'only more or less is said'}"
    )
    return replace(
        choice, value=choice.value._replace(**{measure: wanted}),
        derivation=(*choice.derivation, how),
    )  # fmt: skip
