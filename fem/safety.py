"""Safety of every part: how far its stress is from what its material stands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from .elements.elastic import von_mises
from .grain import is_of_row
from .mesh import material_of
from .solve.result import StaticResult
from .solve.statics import corner_stresses
from .table import load_strengths


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


class PartStresses(NamedTuple):
    """Cauchy ``stress`` (n, 3, 3) [Pa] at the places ``at`` (n, 3) [m] of a ``part``'s ``tets``."""

    part: str
    tets: np.ndarray
    stress: np.ndarray
    at: np.ndarray

    @property
    def largest(self) -> float:
        """Largest of von Mises' stress [Pa]."""
        return float(von_mises(self.stress).max())


def part_safety(
    result: StaticResult,
    materials: Mapping[str, str],
    stresses: Sequence[PartStresses] | None = None,
) -> tuple[Safety, ...]:
    """Safety of every part whose row in ``materials`` (part -> row) has a strength.

    What yields is judged by von Mises' stress, what breaks by the principal stresses, the largest
    pull against the tensile and the largest push against the compressive limit. Stresses are those
    at the points, where a bent part has its largest, means of the tets of the part there; of linear
    elements they are constant in a tet. At a sharp inner corner they grow with a finer mesh.
    ``stresses`` are the ``part_stresses`` of the result, where they are known.
    """
    strengths, judged, E = load_strengths(), [], material_of(result.mesh).E
    for here in part_stresses(result) if stresses is None else stresses:
        row = materials.get(here.part, "")
        if row in strengths and is_of_row(E[here.tets], row):
            strength = strengths[row]
            if strength.kind == "yield":
                cases = [("equivalent", von_mises(here.stress), strength.limit())]
            else:
                principal = np.linalg.eigvalsh(here.stress)
                cases = [
                    ("tension", principal[:, 2], strength.limit()),
                    ("compression", -principal[:, 0], strength.limit(compression=True)),
                ]
            side, values, limit = max(cases, key=lambda case: case[1].max() / case[2])
            worst = int(np.argmax(values))
            stress, place = max(float(values[worst]), 0.0), tuple(here.at[worst].tolist())
            judged.append(Safety(here.part, row, strength.kind, side, stress, limit, place))
    return tuple(judged)


def part_stresses(result: StaticResult) -> tuple[PartStresses, ...]:
    """Stresses at the points of every part that has tets; of linear elements by tet."""
    mesh, stresses = result.mesh, []
    corners = corner_stresses(result) if result.order == 2 else None
    for region, part in enumerate(mesh.region_names):
        tets = np.flatnonzero(mesh.region == region)
        if not tets.size:
            continue
        if corners is None:
            stress, at = result.stress[tets], mesh.centroids[tets]
        else:  # the mean of its own tets at every point
            ids, index = np.unique(mesh.tets[tets], return_inverse=True)
            weight = np.repeat(mesh.volumes[tets], 4)
            flat = corners[tets].reshape(-1, 9) * weight[:, None]
            total = np.stack([np.bincount(index.ravel(), column) for column in flat.T], axis=1)
            mean = total / np.bincount(index.ravel(), weight)[:, None]
            stress, at = mean.reshape(-1, 3, 3), mesh.points[ids]
        stresses.append(PartStresses(part, tets, stress, at))
    return tuple(stresses)
