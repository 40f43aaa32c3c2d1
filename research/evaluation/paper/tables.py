"""The tables by name, each from the same few things."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple

from ....predictors.unipixie.predictor import WEIGHTS
from ...training.unipixie.config import MatterConfig

TableName = Literal["S3", "S5", "S6", "S7", "theta", "springs"]
# Bodies that heads of skinning are trained on, and cells along a side, where there is no GPU.
FEW_BODIES, COARSE = 64, 10


@dataclass(frozen=True, kw_only=True)
class TableRun:
    """What a table is made from.

    Parameters
    ----------
    base
        The run that its trained rows share.
    ranges, real
        Files of the table of ranges, and of real objects to train on.
    objects
        How many are scored of each split.
    weights
        Of the network that is asked as it is.
    progress
        Called with what comes next.
    """

    base: MatterConfig
    ranges: Path
    real: Path | None = None
    objects: int = 64
    weights: Path = WEIGHTS
    progress: Callable[[str], None] | None = None

    @property
    def bodies(self) -> dict[str, Any]:
        """How many bodies skinning is trained on and how fine they are, if not as by default."""
        return {} if self.base.options.on_gpu else {"bodies": FEW_BODIES, "cells": COARSE}


class PrintedTable(NamedTuple):
    """Rows of ours, named tuples, and the paper's figures by the name of their row."""

    rows: list[Any]
    papers: Mapping[str, tuple]


def table_of(name: TableName, run: TableRun) -> PrintedTable:
    """Make a table: S3, S6 and S7 train networks, theta a head, S5 and springs train nothing."""
    common: Any = {"ranges": run.ranges, "objects": run.objects, "progress": run.progress}
    if name == "S3":
        from .joint import PAPER_S3, joint_table

        return PrintedTable(joint_table(run.base, **common, **run.bodies), PAPER_S3)
    if name == "S5":
        from .feedback import PAPER_S5, feedback_table

        return PrintedTable(feedback_table(**common, weights=run.weights), PAPER_S5)
    if name == "theta":
        from .theta import theta_table

        rows = theta_table(run.base, **common, **run.bodies, weights=run.weights)
        return PrintedTable(rows, {})
    if name == "springs":
        from .springs import springs_table

        return PrintedTable(springs_table(**common), {})
    from .networks import PAPER_TABLES, paper_table

    return PrintedTable(paper_table(name, run.base, **common, real=run.real), PAPER_TABLES[name])
