"""Clauses about parts that no part is called after: given to the parts that nothing speaks of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ...fem.scene.materials import MaterialTable
from ..hearing.binding import NamedPart, allocate
from ..hearing.clauses import HeardClause
from ..language.clauses import Clause
from .decision import PartStatement
from .kernel import RowKernel


def allot(
    parts: Sequence[NamedPart],
    statements: Sequence[PartStatement],
    lost: Sequence[Clause],
    table: MaterialTable,
    kernel: RowKernel,
) -> list[PartStatement]:
    """Return what is said of each part once the ``lost`` clauses are given out.

    They go to the parts without a word, so that all fit best together; this is a guess, which a
    predictor that sees shapes may better: all that was not said of a part by its name is open.
    """
    out = list(statements)
    naming = [clause for clause in lost if clause.material]
    free = [i for i, said in enumerate(out) if not said.clauses]
    if not lost:
        return out
    given = allocate(
        [HeardClause.of(clause) for clause in naming],
        [parts[i] for i in free],
        similarity=kernel.similarity,
        category=lambda phrase: table.exact(phrase).category,
    )
    for i, k in zip(free, given, strict=True):
        if k is not None:
            out[i] = PartStatement((naming[k],), borrowed=True)
    return [replace(said, open=said.borrowed or not said.clauses) for said in out]
