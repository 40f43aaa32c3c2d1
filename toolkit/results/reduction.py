"""A reduced body, and what was fitted to a motion, as `reduce` and `match` return them."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ...fem.matching import MotionFit
from ...fem.reduced.method import model_in_words
from ...fem.reduced.model import ReducedModel
from ...fem.reduced.reduction import accuracy_warnings
from ...fem.springs.fit import SpringFit


@dataclass(frozen=True, kw_only=True, eq=False)
class Reduction:
    """A reduced ``model``, the ``seconds`` it took, ``files`` written and the scene's warnings."""

    model: ReducedModel
    seconds: float
    files: tuple[Path, ...] = ()
    assumed: tuple[str, ...] = ()

    def document(self) -> dict[str, Any]:
        """Return what ``reduce --json`` prints."""
        model = self.model
        return {
            "files": self.files,
            "reduced": {
                "summary": model_in_words(model),
                "kind": model.kind.value,
                "dofs": model.dofs,
                "cells": len(model.cells),
                "accuracy": model.accuracy,
            },
            "seconds": self.seconds,
            "warnings": (*self.assumed, *accuracy_warnings(model)),
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class Match:
    """Moduli of a reduced body after a motion: ``fit``, and what ``Reduction`` has."""

    fit: MotionFit
    seconds: float
    files: tuple[Path, ...] = ()
    assumed: tuple[str, ...] = ()

    @property
    def summary(self) -> str:
        """Scale of E, nu, errors and the ratio of frequencies, in a line."""
        fit = self.fit
        nu = "" if fit.nu is None else f", nu {fit.nu:.4f} (correlation {fit.correlation:.3f})"
        return (
            f"E x {fit.scale:.4f} (+-{fit.deviation[0]:.2%} if the misfit is noise){nu}; error "
            f"{fit.error:.2%}, before {fit.unfitted_error:.2%}; first frequency "
            f"{fit.frequency_ratio:.3f} of the full body's; {fit.scheme.value}"
        )

    def document(self) -> dict[str, Any]:
        """Return what ``match --json`` prints."""
        fit = self.fit
        numbers = ("scale", "nu", "error", "unfitted_error", "outside", "frequency_ratio", "runs")
        return {
            "files": self.files,
            "match": {
                "summary": self.summary,
                **{name: getattr(fit, name) for name in numbers},
                "deviation": fit.deviation,
                "covariance": fit.covariance,
                "scheme": fit.scheme.value,
            },
            "seconds": self.seconds,
            "warnings": self.assumed,
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class SpringMatch:
    """The ``fit``, the ``seconds`` it took, ``files`` written, and what was ``assumed``."""

    fit: SpringFit
    seconds: float
    files: tuple[Path, ...] = ()
    assumed: tuple[str, ...] = ()

    @property
    def summary(self) -> str:
        """Scale of k, errors and the ratio of frequencies, in a line."""
        fit = self.fit
        return (
            f"k x {fit.scale:.4f}; error {fit.error:.2%}, calibrated from E alone "
            f"{fit.calibrated_error:.2%}; first frequency {fit.frequency_ratio:.3f} of the finite "
            "elements'"
        )

    def document(self) -> dict[str, Any]:
        """Return what ``match --json`` prints."""
        return {
            "files": self.files,
            "match": {"summary": self.summary, **asdict(self.fit)},
            "seconds": self.seconds,
            "warnings": self.assumed,
        }
