"""Pieces of parts, one a clause: words then settle them as the parts that an asset names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...fem.note import Note
from ...fem.table import MaterialTable
from ..encoders import TextEncoder
from ..grid import PartVoxels
from ..partition import piece_name
from ..prediction import Binding
from ..text.clauses import Bound, BoundPart, Sentence
from ..text.english import words
from .division import WHOLE, Regions, divide, said_by


class Pieces(NamedTuple):
    """Parts divided by the clauses that speak of them.

    parts: The given parts, and their pieces.
    parents: For each the given part that it is, or is a piece of.
    bound: The sentence, and which of its clauses speak of each.
    bindings: What was understood of those that were divided, by number.
    unsaid: Numbers of pieces of which no clause says a matter.
    notes: Why a thing was left whole.
    """

    parts: PartVoxels
    parents: tuple[int, ...]
    bound: Bound
    bindings: dict[int, Binding]
    unsaid: tuple[int, ...]
    notes: tuple[str, ...]


def carve(parts: PartVoxels, cells: dict[str, np.ndarray]) -> tuple[PartVoxels, tuple[int, ...]]:
    """Return the parts with these cells (nx, ny, nz) as parts of their own, by name; and parents.

    A name that is taken is an error of ``PartVoxels``; cells of several parts belong to the first.
    """
    label, names, labels = parts.part.copy(), list(parts.part_names), list(parts.labels)
    parents = list(range(len(names)))
    for name, mine in cells.items():
        parents.append(int(parts.part[mine].min()))
        label[mine] = len(names)
        names.append(name)
        labels.append(())
    return PartVoxels(parts.grid, label, tuple(names), tuple(labels)), tuple(parents)


def of_matters(sentence: Sentence) -> list[int]:
    """Numbers of the clauses that say a matter, where they name two or more; else none."""
    clauses, is_said_to_be = sentence.clauses, {*words()["roles"]["is"]}
    stated = [
        k for k, one in enumerate(clauses)
        if one.says_matter and not one.excluded
        # "the glass is soda-lime glass": the next clause says which glass
        and not (
            k + 1 < len(clauses) and not (one.subject.names or clauses[k + 1].subject.names)
            and sentence.text[one.span[1] : clauses[k + 1].span[0]].strip() in is_said_to_be
        )
    ]  # fmt: skip
    named = {(one.material, one.phrase) for one in sentence.clauses if one.material}
    return stated if len(named) > 1 else []


def divided(
    parts: PartVoxels,
    left_open: Sequence[int],
    bound: Bound,
    stated: Sequence[int],
    regions: Regions,
    *,
    of: Sequence[int],
    told: Mapping[int, str],
    encoder: TextEncoder,
    table: MaterialTable,
) -> Pieces:
    """Divide what words left open among the clauses that say a matter, their numbers ``stated``.

    regions: Of all occupied cells, in C order.
    of: The thing that each part was before a user took regions out of it: it is seen as it was.
    told: The row of the table of each part that a user so took, by number: what is like it is
        likely of its clause.
    """
    sentence = bound.sentence
    of_cell, thing = parts.part[parts.occupied], np.asarray(of)
    mine = np.isin(thing[of_cell], thing[list(left_open)])
    said = [said_by(sentence.clauses[k], sentence) for k in stated]
    # numbered anew: a region of another part has no cell here
    plain, region = (
        np.unique(x[mine], return_inverse=True)[1].ravel() for x in (regions.plain, regions.region)
    )
    ours = Regions(regions.cells[mine], regions.looks[mine], plain, region, regions.shells)
    of_user = np.full(len(region), -1)
    for part, row in told.items():
        same = [k for k, one in enumerate(said) if one.row and table.exact(one.row).name == row]
        if len(same) < 2:  # of two clauses of one matter either may be meant
            of_user[of_cell[mine] == part] = same[0] if same else len(said)
    found = divide(ours, said, encoder=encoder, table=table, told=of_user)
    owner, share, notes = found.owner, found.share, ()
    if found.certainty < WHOLE:
        first = next(i for i, k in enumerate(stated) if sentence.clauses[k].material)
        owner = np.full_like(owner, first)
        texts = ", ".join(repr(sentence.clauses[k].text) for k in stated)
        whole = sentence.clauses[stated[first]].material
        known = {"texts": texts, "material": whole, "certainty": found.certainty}
        notes = (Note("regions.whole", **known),)
    label, names, labels = of_cell.copy(), list(parts.part_names), list(parts.labels)
    parents, clauses = list(range(len(names))), list(bound.parts)
    bindings, unsaid = {}, []
    for i in left_open:
        here = of_cell[mine] == i
        owners, counts = np.unique(owner[here], return_counts=True)
        for rank, k in enumerate(owners[np.argsort(-counts, kind="stable")]):
            cells = np.flatnonzero(mine)[here & (owner == k)]
            clause = None if k == len(stated) else sentence.clauses[stated[k]]
            number = i if rank == 0 else len(names)
            if rank:
                names.append("")
                labels.append(parts.labels[i])
                parents.append(i)
                clauses.append(BoundPart())
            label[cells] = number
            if len(owners) > 1 and clause is not None:
                names[number] = piece_name(parts.part_names[i], clause, names)
            elif rank:
                names[number] = f"{parts.part_names[i]} rest"
            text = None if clause is None else clause.text
            sure = float(share[here & (owner == k)].mean())
            bindings[number] = Binding(text, sure, len(cells), 0.0, found.certainty)
            if clause is None:
                clauses[number] = BoundPart()
                unsaid.append(number)
            else:
                clauses[number] = BoundPart((stated[k],), ("name",))
                if not (clause.material or clause.kind or clause.unknown or clause.numbers):
                    unsaid.append(number)
    part = parts.part.copy()
    part[parts.occupied] = label
    made = PartVoxels(parts.grid, part, tuple(names), tuple(labels))
    heard = replace(bound, parts=tuple(clauses), unbound=())
    return Pieces(made, tuple(parents), heard, bindings, tuple(unsaid), notes)
