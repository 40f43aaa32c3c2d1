"""A reduced body, and what was fitted to a motion, as `reduce` and `match` return them."""

from __future__ import annotations

import csv
import math
from abc import ABC, abstractmethod
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ...fem.identify import MotionFit
from ...fem.note import Note
from ...fem.reduced.basis import accuracy_warnings
from ...fem.reduced.method import model_in_words
from ...fem.reduced.model import ReducedModel
from ...fem.reduced.sweep import WhatIf, WhatIfError
from ...fem.solve.result import MOTION_LIMIT
from ...fem.springs.fit import SpringFit


@dataclass(frozen=True, kw_only=True, eq=False)
class FewNumbers(ABC):
    """An answer of `reduce` or `match`: ``seconds`` it took, ``files``, what was ``assumed``."""

    seconds: float
    files: tuple[Path, ...] = ()
    assumed: tuple[str, ...] = ()

    # Name of the answer in the document.
    verb: ClassVar[str]

    @property
    @abstractmethod
    def summary(self) -> str:
        """The answer in a line."""

    @property
    @abstractmethod
    def numbers(self) -> dict[str, Any]:
        """What the document says beside the summary."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was assumed, and what is not as it should be."""
        return self.assumed

    def document(self) -> dict[str, Any]:
        """Return what ``--json`` prints."""
        return {
            "files": self.files,
            self.verb: {"summary": self.summary, **self.numbers},
            "seconds": self.seconds,
            "warnings": self.warnings,
        }


class WhatIfTable(NamedTuple):
    """Runs of a table: ``header`` and ``rows`` of numbers, their answers, and how long they took.

    ``error`` is of the runs that the full body solved too, ``seconds`` without these.
    """

    header: tuple[str, ...]
    rows: np.ndarray
    found: WhatIf
    error: WhatIfError
    seconds: float

    @property
    def summary(self) -> str:
        """Runs, time and errors in a line."""
        errors = (self.error.rest, self.error.frequency)
        rest, tone = (float(np.abs(e).max(initial=0.0)) for e in errors)
        count = {"runs": len(self.rows), "compared": len(self.error.runs)}
        return Note("reduction.runs", **count, seconds=self.seconds, rest=rest, tone=tone)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Runs without an answer, and errors beyond the limit."""
        found: list[str] = []
        if count := self.numbers["without_rest"]:
            found.append(Note("reduction.without_rest", count=count, runs=len(self.rows)))
        if count := self.error.unsolved:
            found.append(Note("reduction.unsolved", count=count))
        errors = (self.error.rest, self.error.frequency)
        if max(np.abs(e).max(initial=0.0) for e in errors) > MOTION_LIMIT:
            found.append(Note("reduction.strays", summary=self.summary))
        return tuple(found)

    @property
    def numbers(self) -> dict[str, Any]:
        """Counts, time and errors."""
        return {
            "runs": len(self.rows),
            "without_rest": int(np.isnan(self.found.largest).sum()),
            "seconds": self.seconds,
            "compared": self.error.runs,
            "rest_error": self.error.rest,
            "frequency_error": self.error.frequency,
            "unsolved": self.error.unsolved,
        }

    def write(self, path: Path) -> None:
        """Write the table with its answers, ``max_displacement_m`` and ``first_frequency_Hz``."""
        with path.open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow([*self.header, "max_displacement_m", "first_frequency_Hz"])
            answers = zip(self.rows, self.found.largest, self.found.frequency, strict=True)
            for row, u, f in answers:
                writer.writerow([*row, "" if np.isnan(u) else u, f])


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Reduction(FewNumbers):
    """A reduced ``model``, and the ``table`` of what-if runs that it answered."""

    model: ReducedModel
    table: WhatIfTable | None = None

    verb = "reduced"

    @property
    def summary(self) -> str:
        """Kind, coordinates, cells and errors, and of a table its runs, in a line."""
        runs = "" if self.table is None else f"; {self.table.summary}"
        return model_in_words(self.model) + runs

    @property
    def numbers(self) -> dict[str, Any]:
        """Kind, size and accuracy; of a table counts, times and errors."""
        model, table = self.model, self.table
        return {
            "kind": model.kind.value,
            "dofs": model.dofs,
            "cells": len(model.cells),
            "accuracy": model.accuracy,
            "what_if": None if table is None else table.numbers,
        }

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was assumed of the scene, what the model gets wrong, runs without an answer."""
        return (
            *self.assumed,
            *accuracy_warnings(self.model),
            *(() if self.table is None else self.table.warnings),
        )


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Match(FewNumbers):
    """Moduli of a reduced body after a motion: the ``fit``, and that of a ``stiff`` one."""

    fit: MotionFit
    stiff: MotionFit | None = None

    verb = "match"

    @property
    def summary(self) -> str:
        """Scale of E, nu, errors and the ratio of frequencies, in a line, at both ends."""
        lines = []
        for fit in filter(None, (self.fit, self.stiff)):
            nu = "" if fit.nu is None else Note("reduction.nu", fit=fit)
            lines.append(Note("reduction.moduli", fit=fit, nu=nu))
        return "; stiff: ".join(lines)

    @property
    def numbers(self) -> dict[str, Any]:
        """Moduli, errors, covariance, and how they were found; those of the stiff end beside."""
        stiff = None if self.stiff is None else self._numbers(self.stiff)
        return {**self._numbers(self.fit), "stiff": stiff}

    @staticmethod
    def _numbers(fit: MotionFit) -> dict[str, Any]:
        known = ("scale", "nu", "error", "unfitted_error", "outside", "frequency_ratio", "runs")
        return {
            **{name: getattr(fit, name) for name in known},
            "deviation": fit.deviation,
            "covariance": fit.covariance,
            "scheme": fit.scheme.value,
        }


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class SpringMatch(FewNumbers):
    """Stiffness of a network of springs after a motion: the ``fit``."""

    fit: SpringFit

    verb = "match"

    @property
    def summary(self) -> str:
        """Scale and profile of k, errors and the ratio of frequencies, in a line."""
        stiff = "" if math.isnan(self.fit.stiffer) else Note("reduction.stiff", fit=self.fit)
        return Note("reduction.springs", fit=self.fit, at=math.exp(self.fit.surface), stiff=stiff)

    @property
    def numbers(self) -> dict[str, Any]:
        """All that the fit holds."""
        return asdict(self.fit)
