"""What is likely of mass, displacement and frequencies: quantiles of many bodies.

Each row's E, nu and rho are drawn from their ranges; parts of which a predictor drew have its
draws, one after the other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ..device import single_threaded
from ..discrete.assembly import discretise
from ..discrete.forces import load_vector
from ..errors import ConvergenceError
from ..laws.law import Law
from ..reduced.family import LinearFamily, Member
from ..result import Modes, SagResult
from ..scene.mesh import TetMesh
from ..scene.scene import Scene
from ..scene.supports import Supports
from ..solve.statics import check_held
from .intervals import Interval, displacement_interval, frequency_intervals, mass_range
from .lattice import shifted_lattice
from .ranges import MIDDLE, Draws, Exact, OpenRange, material_ranges, open_ranges

# Draws of E, nu and rho; frequencies that are told as likely.
TONES = 3
SAMPLES = 256
# The basis learns all soft and heavy, all stiff and light, then so many draws at once until it
# would have known them to this share, at most so many.
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
        known = ((self.mass, ".3g"), (self.max_displacement, ".2g"), (first, ".3g"))
        mass, u, tone = (f" (nine times in ten {x.words(form)})" if x else "" for x, form in known)
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
    samples: int = SAMPLES,
    seed: int = 0,
) -> Likely | None:
    """What mass, displacement and frequencies likely are; None: of no range, or of no member.

    E and rho of a row are drawn evenly in their logarithm, nu evenly, independent of each other and
    the same for all parts of one row, by ``shifted_lattice``. Parts of ``draws`` have the first of
    theirs in the first body, the second in the second, and so on around; without any row there are
    as many bodies as draws; what is ``exact`` of a part stays. How much the answers change is found
    with linear elements, as in ``displacement_interval``.
    """
    mesh, held = scene.mesh, scene.held
    ranges = open_ranges(mesh, materials, draws, exact)
    if not ranges or (held.values * held.fixed).any() or not _stands(mesh, held):
        return None
    if held.fixed.all():  # nothing moves
        return None
    family = _family(scene, ranges, modes)
    if not family.affordable():
        return None
    counts = [len(one.draws) for one in ranges if one.draws is not None]
    of_rows = len(ranges) - len(counts)
    drawn = max(counts, default=0)
    members = _members(ranges, max(samples, drawn) if of_rows else drawn, seed)
    ends = [_member(ranges, np.tile(end, (len(ranges), 1))) for end in ENDS]
    try:
        family.add([_as_taken(ranges), *ends])
        error = _learned(family, members)
        sizes, tones = family.largest([_as_taken(ranges), *members])
    except ConvergenceError:
        return None
    u = None
    if result is not None and result.static.law == Law.LINEAR and result.trusted and sizes[0] > 0:
        u = _middle(result.max_displacement * sizes[1:] / sizes[0])
    known = () if modes is None else modes.frequencies[:TONES]
    ratios = (tones[1:] / tones[0]).T
    frequencies = tuple(_middle(f * ratio) for f, ratio in zip(known, ratios, strict=True))
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

    A displacement is told of a ``result``, frequencies of ``modes``. None: no range is known.
    """
    ranges = material_ranges(scene.mesh, materials, draws, exact)
    if ranges is None:
        return None
    ends: dict[str, Any] = {"mass": mass_range(scene.mesh, ranges)}
    if result is not None:
        ends["max_displacement"] = displacement_interval(scene, result, ranges)
    ends["frequencies"] = frequency_intervals(scene.mesh, modes, ranges) if modes else ()
    known = {"draws": draws, "exact": exact, "result": result, "modes": modes}
    return with_likely(ends, likely_answers(scene, materials, **known))


def with_likely(ends: Mapping[str, Any], likely: Likely | None) -> dict[str, Any]:
    """Lowest and highest answers by their names, and what is likely, which they hold.

    They leave Poisson's ratio as it is; what is likely does not.
    """
    held = dict(ends)
    for name in held if likely else ():
        inner = getattr(likely, name)
        if name == "frequencies":
            rest = held[name][len(inner) :]
            held[name] = (*(a.holding(b) for a, b in zip(held[name], inner, strict=False)), *rest)
        elif held[name] is not None:
            held[name] = held[name].holding(inner)
    return {**held, "likely": likely}


def _family(scene: Scene, ranges: Sequence[OpenRange], modes: Modes | None) -> LinearFamily:
    """Bodies whose material lies in the ranges, held and loaded as the scene says."""
    mesh = scene.mesh
    grid, points = discretise(mesh, 1), len(mesh.points)
    return LinearFamily(
        mesh,
        scene.held,
        np.stack([one.tets for one in ranges]),
        grained=np.array([one.grained for one in ranges]),
        forces=load_vector(mesh, grid, traction=scene.tractions, forces=scene.forces),
        gravity_vector=np.asarray(scene.gravity_vector, dtype=float),
        shapes=np.zeros((0, points, 3)) if modes is None else modes.shapes[:TONES, :points],
    )


def _as_taken(ranges: Sequence[OpenRange]) -> Member:
    """The body as it is."""
    ones = np.ones(len(ranges))
    return Member(ones, np.array([one.taken.nu for one in ranges]), ones)


def _members(ranges: Sequence[OpenRange], count: int, seed: int) -> list[Member]:
    """So many bodies: rows by a lattice, drawn parts as they were drawn, in order."""
    shares = np.zeros((count, len(ranges), 3))
    of_rows = np.array([one.draws is None for one in ranges])
    if of_rows.any():
        rng, wide = np.random.default_rng(seed), 3 * int(of_rows.sum())
        shares[:, of_rows] = shifted_lattice(count, wide, rng).reshape(count, -1, 3)
    members = []
    for number, share in enumerate(shares):
        member = _member(ranges, share)
        for k, one in enumerate(ranges):
            if one.draws is not None:
                E, nu, rho = one.draws[number % len(one.draws)]
                for values, value in zip(
                    member, (E / one.taken.E, nu, rho / one.taken.rho), strict=True
                ):
                    values[k] = value
        members.append(member)
    return members


def _member(ranges: Sequence[OpenRange], shares: Float[np.ndarray, "ranges 3"]) -> Member:
    """Body whose E, nu and rho lie at ``shares`` [0 to 1] of their ranges."""
    E, nu, rho = np.empty((3, len(ranges)))
    for k, (one, share) in enumerate(zip(ranges, shares, strict=True)):
        E[k] = one.E.min ** (1 - share[0]) * one.E.max ** share[0] / one.taken.E
        nu[k] = one.nu.min + share[1] * (one.nu.max - one.nu.min)
        rho[k] = one.rho.min ** (1 - share[2]) * one.rho.max ** share[2] / one.taken.rho
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
