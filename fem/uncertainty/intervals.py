"""Lowest and highest answers, by the ranges of E and rho of a body's materials.

E and rho of a part are one value of its range. Solved again with all of them soft and heavy, or
stiff and light, the answer gets a lowest and a highest value; Poisson's ratio stays.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ..discrete.assembly import discretise
from ..discrete.elastic import ElasticBody
from ..discrete.mass import squared_masses
from ..errors import ConvergenceError
from ..laws.law import Law
from ..result import Modes, SagResult
from ..scene.material import ElementMaterial
from ..scene.mesh import TetMesh, material_of
from ..scene.scene import Scene
from ..solve.statics import solve_static
from .ranges import RangeFactors


class Interval(NamedTuple):
    """Lowest and highest value that an answer may have."""

    low: float
    high: float

    def holding(self, other: Interval | None) -> Interval:
        """Return the interval that holds both."""
        return Interval(min(self.low, other.low), max(self.high, other.high)) if other else self

    def words(self, form: str) -> str:
        """Both ends, in a format of numbers."""
        return f"{self.low:{form}} to {self.high:{form}}"


def mass_range(mesh: TetMesh, ranges: RangeFactors) -> Interval:
    """Mass [kg] of the body."""
    each = material_of(mesh).rho * mesh.volumes
    return Interval(float(each @ ranges.light), float(each @ ranges.heavy))


def displacement_interval(scene: Scene, result: SagResult, ranges: RangeFactors) -> Interval | None:
    """Largest displacement [m] of a linear answer; None of another, or where a solve fails.

    How much it changes is found with linear elements: they are cheap, and as much too stiff always.
    """
    if result.static.law != Law.LINEAR or not result.trusted:
        return None
    loads = {"traction": scene.tractions, "forces": scene.forces, "order": 1}
    loads["gravity_vector"] = scene.gravity_vector
    material = material_of(scene.mesh)

    def largest(taken: ElementMaterial) -> float:
        found = solve_static(scene.mesh.with_material(taken), scene.held, **loads)
        return float(np.linalg.norm(found.displacement, axis=1).max())

    try:
        as_taken = largest(material)
        ends = [  # soft ones after each other, and stiff ones: their stiffness is made once
            largest(ranges.changed(material, soft=soft, heavy=heavy))
            for soft in (True, False)
            for heavy in (True, False)
        ]
    except ConvergenceError:
        return None
    if not as_taken > 0:
        return None
    ratios = np.array([as_taken, *ends]) / as_taken
    return Interval(*(result.max_displacement * float(r) for r in (ratios.min(), ratios.max())))


def frequency_intervals(mesh: TetMesh, modes: Modes, ranges: RangeFactors) -> tuple[Interval, ...]:
    """Every natural frequency [Hz], by Rayleigh's quotient: exact for one material."""
    order = 1 if modes.shapes.shape[1] == len(mesh.points) else 2
    grid = discretise(mesh, order)
    body = ElasticBody(grid, material_of(mesh), Law.LINEAR)

    def interval(frequency: float, shape: Float[np.ndarray, "nodes 3"]) -> Interval:
        elastic, kinetic = body.energies(shape), squared_masses(mesh, grid.space, shape)
        taken = elastic.sum() / kinetic.sum()
        ends = (
            (elastic @ E) / (kinetic @ rho) / taken
            for E, rho in ((ranges.soft, ranges.heavy), (ranges.stiff, ranges.light))
        )
        return Interval(*(float(frequency * np.sqrt(end)) for end in ends))

    return tuple(map(interval, modes.frequencies, modes.shapes))
