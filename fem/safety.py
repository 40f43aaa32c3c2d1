"""Safety of every part: how far its stress is from what its material stands."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from .discrete.strain import von_mises
from .grain import is_of_row
from .result import StaticResult
from .scene.material_properties import Strength, load_strengths
from .scene.mesh import material_of
from .solve.statics import corner_stresses


class Safety(NamedTuple):
    """Largest ``stress`` [Pa] of a ``part`` of ``material`` beside its lowest ``limit`` [Pa].

    ``kind`` is what happens at the limit, ``side`` whether it is pulled or pressed there (bent:
    the equivalent stress of a material that yields); ``place`` (3,) [m] is where.
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
    pull against the tensile and the largest push against the compressive limit. Stresses are those
    at the points, where a bent part has its largest, means of the tets of the part there; of linear
    elements they are constant in a tet. At a sharp inner corner they grow with a finer mesh.
    """
    strengths, found, E = load_strengths(), [], material_of(result.mesh).E
    for part, tets, here in _by_part(result):
        row = materials.get(part, "")
        if row in strengths and is_of_row(E[tets], row):
            found.append(_worst(here, part, row, strengths[row]))
    return tuple(found)


def largest_von_mises(result: StaticResult) -> float:
    """Largest of von Mises' stress [Pa] at the points, found as ``part_safety`` finds its own."""
    return max(float(von_mises(here.stress).max()) for _, _, here in _by_part(result))


class _Stresses(NamedTuple):
    """Cauchy ``stress`` (n, 3, 3) [Pa] at the places ``at`` (n, 3) [m] of a part."""

    stress: np.ndarray
    at: np.ndarray


def _by_part(result: StaticResult) -> Iterator[tuple[str, np.ndarray, _Stresses]]:
    """Name, tets and stresses of every part that has tets."""
    corners = corner_stresses(result) if result.order == 2 else None
    for region, part in enumerate(result.mesh.region_names):
        tets = np.flatnonzero(result.mesh.region == region)
        if tets.size:
            yield part, tets, _part_stresses(result, corners, tets)


def _part_stresses(result: StaticResult, corners: np.ndarray | None, tets: np.ndarray) -> _Stresses:
    """Stress at the points of a part, the mean of its own tets there; of linear elements by tet."""
    mesh = result.mesh
    if corners is None:
        return _Stresses(result.stress[tets], mesh.centroids[tets])
    ids, index = np.unique(mesh.tets[tets], return_inverse=True)
    weight = np.repeat(mesh.volumes[tets], 4)
    flat = corners[tets].reshape(-1, 9) * weight[:, None]
    total = np.stack([np.bincount(index.ravel(), column) for column in flat.T], axis=1)
    mean = total / np.bincount(index.ravel(), weight)[:, None]
    return _Stresses(mean.reshape(-1, 3, 3), mesh.points[ids])


def _worst(found: _Stresses, part: str, row: str, strength: Strength) -> Safety:
    if strength.kind == "yield":
        cases = [("equivalent", von_mises(found.stress), strength.limit())]
    else:
        principal = np.linalg.eigvalsh(found.stress)
        cases = [
            ("tension", principal[:, 2], strength.limit()),
            ("compression", -principal[:, 0], strength.limit(compression=True)),
        ]
    side, values, limit = max(cases, key=lambda case: case[1].max() / case[2])
    worst = int(np.argmax(values))
    place = tuple(found.at[worst].tolist())
    return Safety(part, row, strength.kind, side, max(float(values[worst]), 0.0), limit, place)
