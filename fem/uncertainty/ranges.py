"""What E, nu and rho of a body may be, by the rows of the table and by what a predictor drew."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ..grain import is_of_row
from ..scene.material import ElementMaterial
from ..scene.material_properties import load_grains
from ..scene.materials import FIELDS, NU_CAP, MaterialValue, Span, load_table
from ..scene.mesh import TetMesh, material_of

MIDDLE = (0.05, 0.95)  # quantiles between which an answer is told as likely

Draws = Mapping[str, Sequence[MaterialValue]]
# Which of E, nu and rho of a part were stated in numbers: they have no range.
Exact = Mapping[str, Sequence[str]]


class OpenRange(NamedTuple):
    """Tets (tets,) whose material varies together, and what E [Pa], ``nu`` [1], rho of them may be.

    They are of one row of the table, or of one part of which a predictor drew ``draws`` (n, 3) of
    (E, nu, rho); ``taken`` is what they have.
    """

    tets: np.ndarray
    E: Span
    nu: Span
    rho: Span
    taken: MaterialValue
    grained: bool = False
    draws: Float[np.ndarray, "n 3"] | None = None


def open_ranges(
    mesh: TetMesh,
    materials: Mapping[str, str],
    draws: Draws | None = None,
    exact: Exact | None = None,
) -> tuple[OpenRange, ...]:
    """Ranges of the rows in ``materials`` (part -> row) that are in the table, then of ``draws``.

    Parts of one row vary together where the same of them is ``exact``, which stays as it is.

    An apparent material, of a hollow part that is meshed solid, has no row: it stays as it is.
    """
    material, rows = material_of(mesh), {row.name: row for row in load_table()}
    of_row: dict[tuple[str, frozenset[str]], np.ndarray] = {}
    drawn: dict[str, np.ndarray] = {}
    for region, part in enumerate(mesh.region_names):
        own, row = mesh.region == region, rows.get(materials.get(part, ""))
        if not own.any():
            continue
        if draws and draws.get(part):
            drawn[part] = own
        elif row is not None and is_of_row(material.E[own], row.name):
            alike = row.name, frozenset((exact or {}).get(part, ()))
            of_row[alike] = of_row.get(alike, False) | own
    found = []
    for (name, fixed), own in of_row.items():
        if fixed >= {*FIELDS}:
            continue
        row = rows[name]
        spans = (row.E, Span(*np.clip(row.nu, 0.0, NU_CAP)), row.rho)
        spans = [  # of what is fixed an empty one, which holds what the tets have and no more
            Span(np.inf, -np.inf) if field in fixed else span
            for field, span in zip(FIELDS, spans, strict=True)
        ]
        grained = material.tensor is not None and name in load_grains()
        found.append(_open(material, own, spans)._replace(grained=grained))
    for part, own in drawn.items():
        values = np.array(draws[part] if draws else [])
        values[:, 1] = values[:, 1].clip(0.0, NU_CAP)
        spans = tuple(Span(float(v.min()), float(v.max())) for v in values.T)
        found.append(_open(material, own, spans)._replace(draws=values))
    return tuple(found)


def _open(material: ElementMaterial, own: np.ndarray, spans: Sequence[Span]) -> OpenRange:
    """Spans that hold what the tets have, too."""
    values = [getattr(material, name)[own] for name in FIELDS]
    E, nu, rho = (
        Span(min(span.min, float(x.min())), max(span.max, float(x.max())))
        for span, x in zip(spans, values, strict=True)
    )
    return OpenRange(own, E, nu, rho, MaterialValue(*(float(np.median(x)) for x in values)))


class RangeFactors(NamedTuple):
    """Factors (tets,) [1] to the lowest and the highest E, and to the lowest and highest rho."""

    soft: np.ndarray
    stiff: np.ndarray
    light: np.ndarray
    heavy: np.ndarray

    def changed(self, material: ElementMaterial, *, soft: bool, heavy: bool) -> ElementMaterial:
        """Return ``material`` at one end of its ranges."""
        E = self.soft if soft else self.stiff
        tensor = None if material.tensor is None else material.tensor * E[:, None, None]
        rho = material.rho * (self.heavy if heavy else self.light)
        return replace(material, E=material.E * E, rho=rho, tensor=tensor)


def material_ranges(
    mesh: TetMesh,
    materials: Mapping[str, str],
    draws: Draws | None = None,
    exact: Exact | None = None,
) -> RangeFactors | None:
    """Factors of the parts whose range is known, by ``open_ranges``; None: of none."""
    ranges, material = open_ranges(mesh, materials, draws, exact), material_of(mesh)
    factors = RangeFactors(*np.ones((4, len(mesh.tets))))
    for one in ranges:
        for first, span, values in ((0, one.E, material.E), (2, one.rho, material.rho)):
            own = values[one.tets]
            factors[first][one.tets] = np.minimum(span.min / own, 1)
            factors[first + 1][one.tets] = np.maximum(span.max / own, 1)
    return factors if ranges else None
