"""What is likely of mass, displacement and frequencies: quantiles of many bodies.

Each row's E, nu and rho are drawn from their ranges; parts of which a predictor drew have its
draws, one after the other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from .device import single_threaded
from .elements.assembly import discretise
from .elements.elastic import ElasticBody
from .elements.forces import load_vector, squared_masses
from .elements.space import extend_linear
from .errors import ConvergenceError
from .grain import is_of_row
from .laws.law import Law
from .linalg.cholesky import planned_elimination
from .mesh import TetMesh, material_of
from .note import Note
from .reduced.sweep import LinearFamily, Member
from .scene.scene import Scene
from .solve.modal import find_load_factor
from .solve.result import LOCKING, Modes, SagResult, locking_fraction
from .solve.statics import check_held, solve_static
from .table import FIELDS, NU_CAP, MaterialValue, Span, load_grains, load_table

# Draws of E, nu and rho; frequencies that are told as likely.
TONES = 3
SAMPLES = 256
# The basis learns all soft and heavy, all stiff and light, then so many draws at once until it
# would have known them to this fraction, at most so many.
ENDS = ((0.0, 0.0, 1.0), (1.0, 1.0, 0.0))
COMPARED, MOST_COMPARED, LEARNED = 3, 12, 5e-3


class Likely(NamedTuple):
    """Middle nine tenths of the answers of so many ``samples`` of E, nu and rho.

    ``mass`` [kg]; ``max_displacement`` [m] is None where it is not known, ``frequencies`` [Hz] of
    the first vibrations; ``error`` [1] is the reduced bodies' largest, against some that were
    solved in full. ``drawn`` is how many matters a predictor drew of a part, 0 for none.
    """

    mass: Interval
    max_displacement: Interval | None
    frequencies: tuple[Interval, ...]
    samples: int
    error: float
    drawn: int = 0

    @property
    def words(self) -> tuple[str, str, str]:
        """Of mass, displacement and first frequency, to be put behind their ends."""
        first = self.frequencies[0] if self.frequencies else None
        answers = ((self.mass, ".3g"), (self.max_displacement, ".2g"), (first, ".3g"))
        mass, u, tone = (
            Note("uncertainty.nine_times", words=x.words(form)) if x else "" for x, form in answers
        )
        return mass, u, tone


@single_threaded
def likely_answers(
    scene: Scene,
    materials: Mapping[str, str],
    *,
    draws: Draws | None = None,
    exact: Exact | None = None,
    result: SagResult | None = None,
    modes: Modes | None = None,
) -> Likely | None:
    """What mass, displacement and frequencies likely are; None: of no range, or of no member.

    E and rho of a row are drawn evenly in their logarithm, nu evenly, independent of each other and
    the same for all parts of one row, by ``shifted_lattice``. Parts of ``draws`` have the first of
    theirs in the first body, the second in the second, and so on around; without any row there are
    as many bodies as draws; what is ``exact`` of a part stays. How much the answers change is found
    with linear elements, and with quadratic ones where nu may be near a half, at which linear ones
    lock; where those would take long nu stays what it is.
    """
    mesh, held = scene.mesh, scene.held
    ranges = open_ranges(mesh, materials, draws, exact)
    loose = not (held.fixed.any() or held.springs.any())
    if not ranges or loose or held.fixed.all() or (held.values * held.fixed).any():
        return None
    try:
        check_held(mesh, held)
    except ConvergenceError:  # a piece of it is held by nothing
        return None
    locks = max(one.nu.max for one in ranges) > LOCKING
    order = unlocked_order(mesh) if locks else 1
    grid = discretise(mesh, order)
    shapes = np.zeros((0, len(grid.space.nodes), 3))
    if modes is not None:
        shapes = modes.shapes[:TONES, : len(grid.space.nodes)]
        if shapes.shape[1] < len(grid.space.nodes):
            shapes = np.stack([extend_linear(grid.space, shape) for shape in shapes])
    family = LinearFamily(
        mesh,
        held,
        np.stack([one.tets for one in ranges]),
        grained=np.array([one.grained for one in ranges]),
        forces=load_vector(mesh, grid, traction=scene.tractions, forces=scene.forces),
        gravity_vector=np.asarray(scene.gravity_vector, dtype=float),
        shapes=shapes,
        order=order,
    )
    if not family.affordable():
        return None
    # Bodies: rows by a lattice, even in nu and in log E and log rho; drawn parts as drawn, in order
    of_rows = np.array([one.draws is None for one in ranges])
    drawn = max((len(one.draws) for one in ranges if one.draws is not None), default=0)
    count = max(SAMPLES, drawn) if of_rows.any() else drawn
    places = np.zeros((count, len(ranges), 3))
    if of_rows.any():
        rng, wide = np.random.default_rng(0), 3 * int(of_rows.sum())
        places[:, of_rows] = shifted_lattice(count, wide, rng).reshape(count, -1, 3)
    places = np.concatenate([np.tile(np.array(ENDS)[:, None], (len(ranges), 1)), places])
    taken = np.array([one.taken for one in ranges])
    low, high = np.moveaxis(np.array([(one.E, one.nu, one.rho) for one in ranges]), 2, 0)
    values = low + places * (high - low)
    values[..., ::2] = low[:, ::2] * (high[:, ::2] / low[:, ::2]) ** places[..., ::2]
    if locks and order == 1:  # what linear elements say of a nu near a half is their locking
        values[..., 1] = taken[:, 1]
    for k, one in enumerate(ranges):
        if one.draws is not None:
            values[len(ENDS) :, k] = one.draws[np.arange(count) % len(one.draws)]
    members = [Member(E / taken[:, 0], nu, rho / taken[:, 2]) for E, nu, rho in values.mT]
    ends, members = members[: len(ENDS)], members[len(ENDS) :]
    as_taken = Member(np.ones(len(ranges)), taken[:, 1], np.ones(len(ranges)))
    try:
        family.add([as_taken, *ends])
        # Largest error of the last members that were compared, before they were taken in too
        error = np.inf
        for first in range(0, MOST_COMPARED, COMPARED):
            these = members[first : first + COMPARED]
            before = [family.answers(member) for member in these]
            rests = family.add(these)
            after = [family.answers(member)[1] for member in these]
            error = 0.0
            for (u, f), rest, g in zip(before, rests, after, strict=True):
                size = float(np.linalg.norm(rest))
                apart = float(np.linalg.norm(u - rest)) / size if size else 0.0
                error = max(error, apart, float(np.abs(f / g - 1).max(initial=0.0)))
            if error <= LEARNED:
                break
        sizes, tones = family.largest([as_taken, *members])
    except ConvergenceError:
        return None
    u = None
    if result is not None and result.static.law == Law.LINEAR and result.trusted and sizes[0] > 0:
        u = _middle(result.max_displacement * sizes[1:] / sizes[0])
    tones_known = () if modes is None else modes.frequencies[:TONES]
    ratios = (tones[1:] / tones[0]).T
    frequencies = tuple(_middle(f * ratio) for f, ratio in zip(tones_known, ratios, strict=True))
    mass = _middle(np.array([family.mass(member).sum() for member in members]))
    return Likely(mass, u, frequencies, len(members), error, drawn)


def ranged_answers(
    scene: Scene,
    materials: Mapping[str, str],
    *,
    draws: Draws | None = None,
    exact: Exact | None = None,
    result: SagResult | None = None,
    modes: Modes | None = None,
) -> dict[str, Any] | None:
    """Lowest and highest mass [kg], displacement [m] and frequencies [Hz], and what is likely.

    A displacement and the load factor of buckling [1] are told of a ``result``, frequencies of
    ``modes``. None: no range is known.
    """
    ranges = material_ranges(scene.mesh, materials, draws, exact)
    if ranges is None:
        return None
    if modes is not None and modes.loaded:  # they do not go with E alone
        modes = None
    ends: dict[str, Any] = {"mass": mass_range(scene.mesh, ranges)}
    if result is not None:
        ends["max_displacement"] = displacement_interval(scene, result, ranges)
        ends["load_factor"] = load_factor_interval(scene, result, ranges)
    ends["frequencies"] = frequency_intervals(scene.mesh, modes, ranges) if modes else ()
    likely = likely_answers(scene, materials, draws=draws, exact=exact, result=result, modes=modes)
    return with_likely(ends, likely)


def with_likely(ends: Mapping[str, Any], likely: Likely | None) -> dict[str, Any]:
    """Lowest and highest answers by their names, and what is likely, which they hold.

    They leave Poisson's ratio as it is; what is likely does not.
    """
    held = dict(ends)
    for name in held.keys() - {"load_factor"} if likely else ():
        inner = getattr(likely, name)
        if name == "frequencies":
            rest = held[name][len(inner) :]
            held[name] = (*(a.holding(b) for a, b in zip(held[name], inner, strict=False)), *rest)
        elif held[name] is not None:
            held[name] = held[name].holding(inner)
    return {**held, "likely": likely}


def _middle(values: np.ndarray) -> Interval:
    low, high = np.quantile(values, MIDDLE)
    return Interval(float(low), float(high))


# Lowest and highest answers, by the ranges of E and rho of a body's materials.
#
# E and rho of a part are one value of its range. Solved again with all of them soft and heavy, or
# stiff and light, the answer gets a lowest and a highest value; Poisson's ratio stays.


# A load factor above this is told as it is: its range is of no concern.
NEARBY = 5.0


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

    How much it changes is found with linear elements where they do not lock: they are cheap, and as
    much too stiff always.
    """
    if result.static.law != Law.LINEAR or not result.trusted:
        return None
    loads: dict[str, Any] = scene.loads | {"order": _order_of(scene.mesh)}
    material = material_of(scene.mesh)

    def largest(E: np.ndarray | float, rho: np.ndarray | float) -> float:
        taken = replace(material.times(E), rho=material.rho * rho)
        solved = solve_static(scene.mesh.with_material(taken), scene.held, **loads)
        return float(np.linalg.norm(solved.displacement, axis=1).max())

    stiffnesses, weights = (ranges.soft, ranges.stiff), (ranges.heavy, ranges.light)
    try:  # those of one stiffness after each other: its factor is made once
        sizes = np.array([largest(1, 1), *(largest(E, w) for E in stiffnesses for w in weights)])
    except ConvergenceError:
        return None
    if not sizes[0] > 0:
        return None
    low, high = result.max_displacement * sizes[[sizes.argmin(), sizes.argmax()]] / sizes[0]
    return Interval(float(low), float(high))


def load_factor_interval(scene: Scene, result: SagResult, ranges: RangeFactors) -> Interval | None:
    """Multiple of the load at which the body buckles, soft and heavy or stiff and light.

    None where it is not known, or cannot come near ``NEARBY``. As for the displacement, linear
    elements tell how much it changes.
    """
    known, material = result.load_factor, material_of(scene.mesh)
    if known is None or result.static.law != Law.LINEAR:
        return None
    if not known.value * ranges.soft.min() / ranges.heavy.max() < NEARBY:
        return None
    loads: dict[str, Any] = scene.loads | {"order": _order_of(scene.mesh)}
    one, factors = np.ones(1), []
    ends = ((one, one), (ranges.soft, ranges.heavy), (ranges.stiff, ranges.light))
    try:
        for E, rho in ends:
            taken = replace(material.times(E), rho=material.rho * rho)
            rest = solve_static(scene.mesh.with_material(taken), scene.held, **loads)
            factors.append(find_load_factor(rest, scene.held).value)
    except ConvergenceError:
        return None
    return Interval(*(known.value * factor / factors[0] for factor in factors[1:]))


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


# Points that fill a cube evenly: a lattice of rank one, shifted at random.


def shifted_lattice(
    count: int, dimensions: int, rng: np.random.Generator
) -> Float[np.ndarray, "count dimensions"]:
    """``count`` points in [0, 1), each evenly distributed over the cube (Cranley & Patterson 1976).

    Their statistics scatter as little as those of a scrambled Sobol sequence of as many.
    """
    steps = np.arange(count)[:, None] * lattice_generator(count, dimensions) % count
    return (steps / count + rng.random(dimensions)) % 1.0


def lattice_generator(count: int, dimensions: int) -> Int[np.ndarray, "dimensions"]:
    """Steps of a lattice of ``count`` points, each the best beside those before it.

    Component by component (Sloan & Reztsov 2002), by the worst error of periodic functions with
    square-integrable derivatives whose j-th direction weighs 1 / j^2.
    """
    whole = np.arange(1, max(count // 2, 1) + 1)
    whole = whole[np.gcd(whole, count) == 1]
    place = np.arange(count)[:, None] * whole % count / count
    kernel = 2 * np.pi**2 * (place * (place - 1) + 1 / 6)  # Bernoulli's second polynomial
    so_far, steps = np.ones(count), []
    for weight in 1 / np.arange(1, dimensions + 1) ** 2:
        best = int(np.argmin(so_far @ kernel))
        so_far = so_far * (1 + weight * kernel[:, best])
        steps.append(whole[best])
    return np.array(steps, dtype=np.int64)


# What E, nu and rho of a body may be, by the rows of the table and by what a predictor drew.

MIDDLE = (0.05, 0.95)  # quantiles between which an answer is told as likely

Draws = Mapping[str, Sequence[MaterialValue]]
# Which of E, nu and rho of a part were stated in numbers: they have no range.
Exact = Mapping[str, Sequence[str]]


# Numbers of a quadratic body's factor up to which a dozen of them take a few seconds.
CHEAP = 2_000_000


def unlocked_order(mesh: TetMesh) -> int:
    """Order of elements that do not lock near a nu of a half: 2, where a dozen solves are cheap."""
    grid = discretise(mesh, 2)
    return 2 if planned_elimination(grid.pattern, grid.space.edges).entries <= CHEAP else 1


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
        tets, row = mesh.region == region, rows.get(materials.get(part, ""))
        if not tets.any():
            continue
        if draws and draws.get(part):
            drawn[part] = tets
        elif row is not None and is_of_row(material.E[tets], row.name):
            alike = row.name, frozenset((exact or {}).get(part, ()))
            of_row[alike] = of_row.get(alike, False) | tets
    known: list[tuple[np.ndarray, Sequence[Span], bool, np.ndarray | None]] = []
    for (name, fixed), tets in of_row.items():
        row = rows[name]
        open_spans = (row.E, Span(*np.clip(row.nu, 0.0, NU_CAP)), row.rho)
        spans = [  # of what is fixed an empty one, which holds what the tets have and no more
            Span(np.inf, -np.inf) if field in fixed else span
            for field, span in zip(FIELDS, open_spans, strict=True)
        ]
        if not fixed >= {*FIELDS}:
            known.append((tets, spans, material.tensor is not None and name in load_grains(), None))
    for part, tets in drawn.items():
        values = np.array(draws[part] if draws else [])
        values[:, 1] = values[:, 1].clip(0.0, NU_CAP)
        known.append(
            (tets, [Span(*ends) for ends in np.quantile(values, (0, 1), 0).T], False, values)
        )
    ranges = []
    for tets, spans, grained, values in known:  # what the tets have is in their ranges too
        own = [getattr(material, field)[tets] for field in FIELDS]
        E, nu, rho = (
            Span(min(low, float(x.min())), max(high, float(x.max())))
            for (low, high), x in zip(spans, own, strict=True)
        )
        taken = MaterialValue(*(float(np.median(x)) for x in own))
        ranges.append(OpenRange(tets, E, nu, rho, taken, grained, values))
    return tuple(ranges)


def _order_of(mesh: TetMesh) -> int:
    """Order of the elements that tell how much an answer changes with E and rho."""
    return unlocked_order(mesh) if locking_fraction(mesh) else 1


class RangeFactors(NamedTuple):
    """Factors (tets,) [1] to the lowest and the highest E, and to the lowest and highest rho."""

    soft: np.ndarray
    stiff: np.ndarray
    light: np.ndarray
    heavy: np.ndarray


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
            taken = values[one.tets]
            factors[first][one.tets] = np.minimum(span.min / taken, 1)
            factors[first + 1][one.tets] = np.maximum(span.max / taken, 1)
    return factors if ranges else None
