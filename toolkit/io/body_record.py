"""What is known of a body beside its tets: how its mesh was made, and of what its parts are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from ...fem.scene.materials import MaterialValue
from ...fem.uncertainty.ranges import Draws, Exact
from .sidecar import Sidecar


@dataclass(frozen=True, kw_only=True)
class BodyRecord:
    """What ``convert`` and ``assign`` found, for those that solve the body.

    Parameters
    ----------
    materials, classes
        Row of the material table, and class of matter, of every part.
    draws
        Matters that a predictor drew of parts.
    exact
        Which of E, nu and rho of parts were stated in numbers.
    differences
        What the mesh has otherwise than its file.
    size_stated
        Whether the user gave the size or the unit of the file.
    """

    materials: Mapping[str, str] = field(default_factory=dict)
    classes: Mapping[str, str] = field(default_factory=dict)
    draws: Draws = field(default_factory=dict)
    exact: Exact = field(default_factory=dict)
    differences: tuple[str, ...] = ()
    size_stated: bool = False

    @classmethod
    def of(cls, sidecar: Sidecar | None) -> BodyRecord:
        """Return what is on record beside a mesh; nothing of what was not written down."""
        if sidecar is None:
            return cls()
        parts: list[dict[str, Any]] = sidecar.record.get("assign", {}).get("parts", [])
        draws = {
            part["name"]: tuple(MaterialValue(**one) for one in part["draws"])
            for part in parts
            if part.get("draws")
        }
        report = sidecar.record.get("convert", {}).get("report", {})
        return cls(
            materials={part["name"]: part["material"] for part in parts},
            classes={part["name"]: part["class"] for part in parts if part.get("class")},
            draws=draws,
            exact={part["name"]: tuple(part["exact"]) for part in parts if part.get("exact")},
            differences=tuple(report.get("differences", ())),
            size_stated=sidecar.source.get("size_stated", False),
        )

    def of_other_materials(self, materials: Mapping[str, str]) -> BodyRecord:
        """Return the record with other rows: what was found of the parts' own goes."""
        return BodyRecord(
            materials=materials, differences=self.differences, size_stated=self.size_stated
        )
