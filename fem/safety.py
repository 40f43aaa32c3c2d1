"""Safety of every part: how far its stress is from what its material stands."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from .grain import is_of_row
from .result import StaticResult
from .scene.material_properties import Strength, load_strengths
from .scene.mesh import material_of


class Safety(NamedTuple):
    """Largest ``stress`` [Pa] of a ``part`` of ``material`` beside its lowest ``limit`` [Pa].

    ``kind`` is what happens at the limit, ``side`` whether it is pulled or pressed there (bent:
    the equivalent stress of a material that yields); ``place`` (3,) [m] is the worst tet.
    """

    part: str
    material: str
    kind: str
    side: str
    stress: float
    limit: float
    place: tuple[float, ...]

    @property
    def factor(self) -> float:
        """Safety factor [1]: below one the material gives way."""
        return self.limit / self.stress if self.stress > 0 else np.inf


def part_safety(result: StaticResult, materials: Mapping[str, str]) -> tuple[Safety, ...]:
    """Safety of every part whose row in ``materials`` (part -> row) has a strength.

    What yields is judged by von Mises' stress, what breaks by the principal stresses, the largest
    pull against the tensile and the largest push against the compressive limit. Stresses are means
    over a tet, the largest of the part; at a sharp inner corner they grow with a finer mesh.
    """
    mesh, strengths, found = result.mesh, load_strengths(), []
    E = material_of(mesh).E
    for region, part in enumerate(mesh.region_names):
        row = materials.get(part, "")
        tets = np.flatnonzero(mesh.region == region)
        if row in strengths and tets.size and is_of_row(E[tets], row):
            found.append(_worst(result, tets, part, row, strengths[row]))
    return tuple(found)


def _worst(
    result: StaticResult, tets: np.ndarray, part: str, row: str, strength: Strength
) -> Safety:
    stress = result.stress[tets]
    if strength.kind == "yield":
        cases = [("equivalent", result.von_mises[tets], strength.limit())]
    else:
        principal = np.linalg.eigvalsh(stress)
        cases = [
            ("tension", principal[:, 2], strength.limit()),
            ("compression", -principal[:, 0], strength.limit(compression=True)),
        ]
    side, values, limit = max(cases, key=lambda case: case[1].max() / case[2])
    worst = int(np.argmax(values))
    place = tuple(result.mesh.centroids[tets[worst]].tolist())
    return Safety(part, row, strength.kind, side, max(float(values[worst]), 0.0), limit, place)
