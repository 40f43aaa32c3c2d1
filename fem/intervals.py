"""Intervals: what the ranges of E and rho in the material table leave open in an answer.

E and rho of a part are one value of the range of its row. Solved again with all of them soft and
heavy, or stiff and light, the answer gets a lowest and a highest value; Poisson's ratio stays.
What is likely are quantiles of many bodies, each row's E, nu and rho drawn from their ranges.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from .discrete.assembly import discretise, linear_stiffness
from .discrete.forces import load_vector
from .discrete.mass import consistent_mass
from .errors import ConvergenceError
from .grain import is_of_row
from .laws.law import Law
from .reduced.family import LinearFamily, Member
from .result import Modes, SagResult
from .scene.material import ElementMaterial
from .scene.material_properties import load_grains
from .scene.materials import NU_CAP, Material, MaterialValue, Span, load_table
from .scene.mesh import TetMesh, material_of
from .scene.scene import Scene
from .scene.supports import Supports
from .solve.statics import check_held, solve_static

# Draws of E, nu and rho; frequencies, and what of the answers, that are told as likely.
TONES = 3
SAMPLES, MIDDLE = 256, (0.05, 0.95)
# The basis learns all soft and heavy, all stiff and light, then so many draws at once until it
# would have known them to this share, at most so many.
ENDS = ((0.0, 0.0, 1.0), (1.0, 1.0, 0.0))
COMPARED, MOST_COMPARED, LEARNED = 3, 12, 5e-3


class Interval(NamedTuple):
    """Lowest and highest value that an answer may have."""

    low: float
    high: float

    def words(self, form: str) -> str:
        """Both ends, in a format of numbers."""
        return f"{self.low:{form}} to {self.high:{form}}"


class RowFactors(NamedTuple):
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


class Likely(NamedTuple):
    """Middle nine tenths of the answers of so many ``samples`` of E, nu and rho.

    ``max_displacement`` [m] is None where it is not known, ``frequencies`` [Hz] of the first
    vibrations; ``error`` [1] is the reduced bodies' largest, against some that were solved in full.
    """

    max_displacement: Interval | None
    frequencies: tuple[Interval, ...]
    samples: int
    error: float

    @property
    def words(self) -> tuple[str, str]:
        """Of the displacement and of the first frequency, to be put behind their ends."""
        first = self.frequencies[0] if self.frequencies else None
        known = ((self.max_displacement, ".2g"), (first, ".3g"))
        u, tone = (f" (nine times in ten {x.words(form)})" if x else "" for x, form in known)
        return u, tone


def likely_answers(
    scene: Scene,
    materials: Mapping[str, str],
    *,
    result: SagResult | None = None,
    modes: Modes | None = None,
    samples: int = SAMPLES,
    seed: int = 0,
) -> Likely | None:
    """What displacement and frequencies likely are; None where no row, or no member, is known.

    E and rho are drawn evenly in their logarithm, nu evenly, independent of each other and the same
    for all parts of one row, by a Latin hypercube (McKay et al. 1979). How much the answers change
    is found with linear elements, as in ``displacement_interval``.
    """
    mesh, held = scene.mesh, scene.held
    rows = row_ranges(mesh, materials)
    if not rows or (held.values * held.fixed).any() or not _stands(mesh, held):
        return None
    points, grid = len(mesh.points), discretise(mesh, 1)
    family = LinearFamily(
        mesh,
        held,
        np.stack([row.tets for row in rows]),
        grained=np.array(
            [material_of(mesh).tensor is not None and row.row.name in load_grains() for row in rows]
        ),
        forces=load_vector(mesh, grid, traction=scene.tractions, forces=scene.forces),
        gravity_vector=np.asarray(scene.gravity_vector, dtype=float),
        shapes=np.zeros((0, points, 3)) if modes is None else modes.shapes[:TONES, :points],
    )
    if not family.affordable():
        return None
    rng = np.random.default_rng(seed)
    parts = rng.permuted(np.tile(np.arange(samples), (3 * len(rows), 1)), axis=1).T
    drawn = (parts + rng.random(parts.shape)) / samples
    members = [_member(rows, shares) for shares in drawn]
    ends = [_member(rows, np.tile(end, (len(rows), 1)).ravel()) for end in ENDS]
    try:
        family.add([_as_taken(rows), *ends])
        error = _learned(family, members)
        found = [family.answers(member) for member in members]
        as_taken = family.answers(_as_taken(rows))
    except ConvergenceError:
        return None
    sizes = np.array([np.linalg.norm(u, axis=1).max() for u, _ in [as_taken, *found]])
    u = None
    if result is not None and result.static.law == Law.LINEAR and result.trusted and sizes[0] > 0:
        u = _middle(result.max_displacement * sizes[1:] / sizes[0])
    tones = np.array([f for _, f in found]) / as_taken[1]
    known = () if modes is None else modes.frequencies[:TONES]
    return Likely(
        u, tuple(_middle(f * t) for f, t in zip(known, tones.T, strict=True)), samples, error
    )


class RowRange(NamedTuple):
    """Tets (tets,) of one ``row`` of the table, and what E [Pa], ``nu`` [1], rho of them may be."""

    row: Material
    tets: np.ndarray
    E: Span
    nu: Span
    rho: Span
    taken: MaterialValue


def row_ranges(mesh: TetMesh, materials: Mapping[str, str]) -> tuple[RowRange, ...]:
    """Ranges of the rows in ``materials`` (part -> row) that are in the table.

    An apparent material, of a hollow part that is meshed solid, has no row: it stays as it is.
    """
    material, rows = material_of(mesh), {row.name: row for row in load_table()}
    tets: dict[str, np.ndarray] = {}
    for region, part in enumerate(mesh.region_names):
        own, row = mesh.region == region, rows.get(materials.get(part, ""))
        if row is not None and own.any() and is_of_row(material.E[own], row.name):
            tets[row.name] = tets.get(row.name, False) | own
    found = []
    for name, own in tets.items():
        row, values = rows[name], (material.E[own], material.nu[own], material.rho[own])
        spans = (row.E, Span(*np.clip(row.nu, 0.0, NU_CAP)), row.rho)
        E, nu, rho = (
            Span(min(span.min, x.min()), max(span.max, x.max()))
            for span, x in zip(spans, values, strict=True)
        )
        taken = MaterialValue(*map(np.median, values))
        found.append(RowRange(row, own, E, nu, rho, taken))
    return tuple(found)


def _as_taken(rows: Sequence[RowRange]) -> Member:
    """The body as it is."""
    return Member(np.ones(len(rows)), np.array([r.taken.nu for r in rows]), np.ones(len(rows)))


def _member(rows: Sequence[RowRange], shares: np.ndarray) -> Member:
    """Body whose E, nu and rho lie at ``shares`` (3 rows,) [0 to 1] of their ranges."""
    E, nu, rho = np.empty((3, len(rows)))
    for k, (row, share) in enumerate(zip(rows, shares.reshape(-1, 3), strict=True)):
        E[k] = row.E.min ** (1 - share[0]) * row.E.max ** share[0] / row.taken.E
        nu[k] = row.nu.min + share[1] * (row.nu.max - row.nu.min)
        rho[k] = row.rho.min ** (1 - share[2]) * row.rho.max ** share[2] / row.taken.rho
    return Member(E, nu, rho)


def _learned(family: LinearFamily, members: Sequence[Member]) -> float:
    """Largest error of the last members that were compared, before they were taken in too."""
    error = np.inf
    for first in range(0, MOST_COMPARED, COMPARED):
        these = members[first : first + COMPARED]
        before = [family.answers(member) for member in these]
        rests = family.add(these)
        after = [family.answers(member)[1] for member in these]
        errors = [
            max(_apart(u, rest), float(np.abs(f / g - 1).max(initial=0.0)))
            for (u, f), rest, g in zip(before, rests, after, strict=True)
        ]
        error = max(errors)
        if error <= LEARNED:
            break
    return error


def _apart(u: np.ndarray, wanted: np.ndarray) -> float:
    size = float(np.linalg.norm(wanted))
    return float(np.linalg.norm(u - wanted)) / size if size else 0.0


def _middle(values: np.ndarray) -> Interval:
    low, high = np.quantile(values, MIDDLE)
    return Interval(float(low), float(high))


def _stands(mesh: TetMesh, held: Supports) -> bool:
    """Whether every piece is held."""
    try:
        check_held(mesh, held)
    except ConvergenceError:
        return False
    return bool(held.fixed.any() or held.springs.any())


def material_ranges(mesh: TetMesh, materials: Mapping[str, str]) -> RowFactors | None:
    """Factors of the parts whose row in ``materials`` is in the table; None: of none."""
    rows, material = row_ranges(mesh, materials), material_of(mesh)
    factors = RowFactors(*np.ones((4, len(mesh.tets))))
    for row in rows:
        for first, span, values in ((0, row.row.E, material.E), (2, row.row.rho, material.rho)):
            own = values[row.tets]
            factors[first][row.tets] = np.minimum(span.min / own, 1)
            factors[first + 1][row.tets] = np.maximum(span.max / own, 1)
    return factors if rows else None


def mass_range(mesh: TetMesh, ranges: RowFactors) -> Interval:
    """Mass [kg] of the body."""
    each = material_of(mesh).rho * mesh.volumes
    return Interval(float(each @ ranges.light), float(each @ ranges.heavy))


def displacement_interval(scene: Scene, result: SagResult, ranges: RowFactors) -> Interval | None:
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
        ends = [
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


def frequency_intervals(mesh: TetMesh, modes: Modes, ranges: RowFactors) -> tuple[Interval, ...]:
    """Every natural frequency [Hz], by Rayleigh's quotient: exact for one material."""
    material = material_of(mesh)
    order = 1 if modes.shapes.shape[1] == len(mesh.points) else 2
    grid = discretise(mesh, order)

    def quotients(taken: ElementMaterial) -> Float[np.ndarray, "modes"]:
        body = mesh.with_material(taken)
        stiffness, mass = linear_stiffness(grid, taken), consistent_mass(body, grid)
        return np.array(
            [(x * stiffness.times(x)).sum() / (x * (mass @ x)).sum() for x in modes.shapes]
        )

    as_taken = quotients(material)
    low, high = (
        modes.frequencies * np.sqrt(quotients(ranges.changed(material, soft=s, heavy=s)) / as_taken)
        for s in (True, False)
    )
    return tuple(Interval(float(a), float(b)) for a, b in zip(low, high, strict=True))
