"""What `assign` returns: a mesh with E, nu and rho, and why each part got them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...fem.errors import BandError, UsageError
from ...fem.mesh import TetMesh, material_of
from ...fem.note import Note, severity_of
from ...fem.table import AS_STATED, FIELDS, MaterialValue, Span, outside_band
from ...fem.uncertainty import MIDDLE
from ...predictors.construction import MassInterval
from ...predictors.field import MaterialField
from ...predictors.prediction import Numbered, PartChoice
from ..asset.document import BodyRecord, Sidecar, is_guess, mesh_document
from ..meshing.messages import listed
from .check import Check, as_table, in_a_line

if TYPE_CHECKING:
    from ...converters.transfer import SampledMesh
    from ..walls import BuiltPart

# A network's own E that leaves the range of the nearest row by more than this is told.
UNLIKE = 2.0
# What is said of numbers that the matter does not have which is said of the same part
AGAINST = {"numbers.part_odd", "numbers.part_density", "numbers.part_mass"}
FAR_APART = 2.0  # high / low: below it a mass is known well enough to say nothing


@dataclass(frozen=True, eq=False)
class Assignment:
    """A mesh with E, nu, rho on every tet, their field, and the choice made for every part.

    ``doubts`` are those of the ``warnings`` that are about words: not understood, or a guess.
    """

    mesh: TetMesh
    text: str
    field: MaterialField
    choices: tuple[PartChoice, ...]
    sampling: SampledMesh
    sidecar: Sidecar
    built: tuple[BuiltPart, ...]
    regions: Numbered | None = None
    warnings: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    files: tuple[Path, ...] = ()

    def __repr__(self) -> str:
        return in_a_line(self)

    _repr_html_ = as_table

    def part_rows(self) -> list[dict[str, Any]]:
        """One row a part: material, values, ranges, source, why, volume [m^3], mass [kg].

        Values are those of the material that is said; where its walls are smeared over the mesh,
        ``construction`` has the apparent ones, and ``mass_interval`` [kg] what it may weigh.
        """
        volumes = self.mesh.region_volumes()
        masses = np.bincount(
            self.mesh.region,
            weights=material_of(self.mesh).rho * self.mesh.volumes,
            minlength=len(volumes),
        )
        rows = []
        for choice, built, volume, mass in zip(
            self.choices, self.built, volumes, masses, strict=True
        ):
            # what E, nu and rho may be: as the row says, but those that were stated in numbers
            ranges = {name: getattr(choice.row, name) for name in FIELDS}
            values = choice.value._asdict()
            ranges |= {name: Span(values[name], values[name]) for name in choice.exact}
            rows.append(
                {
                    "name": choice.part,
                    "material": choice.material,
                    "class": choice.matter_class,
                    **values,
                    "ranges": ranges,
                    "source": choice.source,
                    "estimated": choice.row.estimated,
                    "why": choice.why,
                    "derivation": choice.derivation,
                    "exact": choice.exact,
                    "guessed": choice.guessed,
                    "understood": choice.understood,
                    "weight": choice.weight,
                    "binding": choice.binding,
                    "draws": self.draws.get(choice.part, ()),
                    "volume": volume,
                    "mass": mass,
                    "mass_interval": list(built.mass),
                    "construction": built.row(),
                }
            )
        return rows

    @property
    def record(self) -> BodyRecord:
        """What those that solve the body take of it: that of its mesh, and of its parts."""
        return replace(
            BodyRecord.of(self.sidecar),
            materials={choice.part: choice.material for choice in self.choices},
            classes={choice.part: choice.matter_class for choice in self.choices},
            draws=self.draws,
            exact={choice.part: choice.exact for choice in self.choices if choice.exact},
            guesses=tuple(row["name"] for row in self.part_rows() if is_guess(row)),
        )

    @property
    def draws(self) -> dict[str, tuple[MaterialValue, ...]]:
        """Materials that a predictor drew, by part; where its walls are smeared, apparent ones."""
        return {
            choice.part: tuple(map(built.as_built, choice.draws))
            for choice, built in zip(self.choices, self.built, strict=True)
            if choice.draws
        }

    def region_rows(self) -> list[dict[str, Any]]:
        """One row a region of like look, by number: its part, fraction of the cells, middle [m].

        The middle is that of the region's cell which is nearest to the mean of all, so that
        ``--at`` finds the region there, be it a ring around another.
        """
        if self.regions is None or self.field.part is None:
            return []
        number, grid = self.regions.number, self.field.grid
        inside = number > 0
        cells, own = np.argwhere(inside), number[inside] - 1
        size = np.bincount(own)
        part = np.zeros((len(size), len(self.field.part_names)), dtype=int)
        np.add.at(part, (own, self.field.part[inside]), 1)
        places = grid.to_world(cells)
        mean = np.stack([np.bincount(own, axis) for axis in places.T], axis=1)
        away = np.linalg.norm(places - (mean / size.clip(min=1)[:, None])[own], axis=1)
        order = np.lexsort((away, own))
        middle = places[order[np.searchsorted(own[order], np.arange(len(size)))]]
        material = {choice.part: choice.material for choice in self.choices}
        return [
            {
                "number": k + 1,
                "part": self.field.part_names[part[k].argmax()],
                "material": material[self.field.part_names[part[k].argmax()]],
                "fraction": float(size[k] / len(own)),
                "middle": middle[k].tolist(),
                "colour": "#" + "".join(f"{round(255 * float(c)):02x}" for c in colour),
            }
            for k, colour in enumerate(self.regions.colours.clip(0, 1))
            if size[k]
        ]

    def mass_interval(self) -> MassInterval:
        """Masses [kg] between which the whole lies."""
        return MassInterval(
            *(sum(ends) for ends in zip(*(b.mass for b in self.built), strict=True))
        )

    def check_bands(self) -> None:
        """Raise ``BandError`` where a part's E, nu or rho leave the band of its category."""
        for choice in self.choices:
            complaints = outside_band(choice.row.category, *choice.value)
            if complaints and not choice.is_cellular:
                raise BandError(f"part {choice.part!r}, {choice.material}: {'; '.join(complaints)}")

    def check_doubts(self) -> None:
        """Raise ``UsageError`` where anything was not understood, not used, or is a guess."""
        if self.doubts:
            first, *others = self.doubts
            more = f" (and {len(others)} more)" if others else ""
            raise UsageError(f"--strict: {first}{more}")

    def verdicts(self) -> list[Check]:
        """Whether E, nu and rho are usual, and how well the mass is known."""
        # Whether the E, nu and rho of every part are usual for its category
        odd: list[tuple[str, str]] = [
            (choice.part, Note("checks.outside_band", part=choice.part, complaint=complaint))
            for choice in self.choices
            for complaint in outside_band(choice.row.category, *choice.value)
            if not choice.is_cellular
        ]
        # and a network's own E near the row that it is said to be like
        for choice in self.choices:
            E, row = choice.value.E, choice.row
            if choice.network and not row.E.min / UNLIKE <= E <= row.E.max * UNLIKE:
                span = {"E": E, "row": row.name, "low": row.E.min, "high": row.E.max}
                odd.append((choice.part, Note("checks.unlike_row", part=choice.part, **span)))
        found = [Check("inside band", "failed", said, part=part) for part, said in odd]
        stated = [repr(c.part) for c in self.choices if c.row.category == AS_STATED]
        against = [x for x in self.warnings if isinstance(x, Note) and x.kind in AGAINST]
        if against and not found:
            parts = listed([*dict.fromkeys(line.values["part"] for line in against)])
            said = Note("checks.unlike_named", parts=parts)
            found.append(Check("inside band", "doubtful", said, part=parts))
        guesses = self.record.guesses
        if guesses:
            said = Note("checks.guessed_kind", parts=listed(guesses))
            found.append(Check("inside band", "doubtful", said, part=", ".join(guesses)))
        elif len(stated) < len(self.choices) and not found:
            found.append(Check("inside band", "passed", Note("checks.inside_band")))
        if stated:
            said = Note("checks.as_stated", parts=", ".join(stated))
            found.append(Check("as stated", "not made", said))
        # How far the mass may be off, where nothing says whether parts are hollow
        low, high = self.mass_interval()
        parts = [b.construction.part for b in self.built if b.construction.form == "unknown"]
        if parts and high > FAR_APART * low:
            told: dict[str, Any] = {"mass": self.mesh.mass, "low": low, "high": high}
            told |= {"parts": listed(parts), "are": "are" if len(parts) > 1 else "is"}
            said = Note("checks.may_be_hollow", **told)
            found.append(Check("mass", "failed", said, high, FAR_APART * low, "kg"))
        return found

    def _drawn_mass(self) -> Iterator[Check]:
        """What it weighs in nine of ten samples of what is unknown."""
        draws = self.draws
        if not draws:
            return
        each = {row["name"]: row["mass"] for row in self.part_rows()}
        total: Any = sum(mass for name, mass in each.items() if name not in draws)
        for choice, built in zip(self.choices, self.built, strict=True):
            if choice.part in draws:
                rho = np.array([value.rho for value in draws[choice.part]])
                total = total + each[choice.part] / built.as_built(choice.value).rho * rho
        low, high = np.quantile(total, MIDDLE)
        said = Note("checks.drawn_mass", count=len(total), low=low, high=high)
        yield Check("range", "passed", said, high / low)

    def described(self) -> Sidecar:
        """Return the sidecar of the mesh, with the choices on record."""
        return self.sidecar.with_record(assign=self.document())

    def document(self) -> dict[str, Any]:
        """Return what ``assign --json`` prints."""
        return {
            "files": self.files,
            "text": self.text,
            **mesh_document(self.mesh),
            "mass_interval": list(self.mass_interval()),
            "parts": self.part_rows(),
            "regions_by_look": self.region_rows(),
            "verdicts": [one.document() for one in (*self.verdicts(), *self._drawn_mass())],
            "doubts": self.doubts,
            "notes": [line for line in self.warnings if severity_of(line) == "note"],
            "warnings": self.warnings,
        }
