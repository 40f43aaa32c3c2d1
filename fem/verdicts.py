"""Verdicts on a simulated body, each with its number, threshold and sentence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from .contact.foothold import foothold
from .laws.law import LAWS
from .model_error import BENDS_ALIKE, too_coarse
from .result import LOCKING, LoadFactor, Modes, MotionResult, SagResult, StaticResult
from .safety import Safety
from .scene.mesh import USUAL_SIZE, TetMesh, edge_share, largest_explicit_step, material_of
from .scene.scene import Scene
from .scene.up import up_vector
from .uncertainty.intervals import Interval
from .uncertainty.likely import Likely

# A body holds its shape if no point moves more than this share of its longest side.
HOLDS = 0.05
CRUMBS = 1e-3  # share of the volume that may be attached to nothing that is held
# A displacement is trusted to this discretisation error.
TRUSTED = 0.1
OFF_BY = {
    "cubic surplus": "by what cubic elements would add to its quadratic ones",
    "P1/P2": "by what quadratic elements add to its linear ones",
}
# A body stands where it buckles under no less than this multiple of its load.
STANDS = 1.0
SLIDES = 0.05  # friction [1] that any ground has but ice; less is not told
GRAVITY = 9.81  # [m/s^2], of a scene that leaves the weight out, as wind and a finger do
# A first frequency below this is seen as wobbling.
WOBBLES = 5.0
# Two materials look different when their largest displacements differ by this factor, and the
# larger one is seen at all: more than this share of the height.
DIFFERENT = 2.0
VISIBLE = 0.005
# Mass [kg] of a thing per volume [m^3] of its box, by the side [m] up to which it holds: what 64
# things that were weighed have (benchmarks/data/known_masses.toml), with room: 26 (a drink can) to
# 12,040 (a gold coin); bulky ones of .3 m 261 to 1,940 (a curling stone), longer than a metre 28 to
# 181 (a pallet). What is slender or flat may be solid at any length: rebar has 6,172.
USUAL_DENSITY = ((0.3, 10.0, 23_000.0), (1.0, 10.0, 3_000.0), (np.inf, 10.0, 1_000.0))
# Bulky: no side of the box is below this share of the longest.
BULKY = 0.1
# A part gives way below this safety factor.
SAFE = 1.0
# What a part does past its limit, and what the limit is called, by what is judged there.
GIVES_WAY = {
    "equivalent": ("yields", "yield strength"),
    "tension": ("cracks", "tensile strength"),
    "compression": ("is crushed", "compressive strength"),
}


Outcome = Literal["passed", "failed", "doubtful", "not made"]


@dataclass(frozen=True)
class Check:
    """One verdict: ``passed`` compares ``value`` with ``threshold``; ``sentence`` says it.

    One that was not ``made`` has not passed, and its sentence says why; ``doubt`` is a sentence on
    what a check that passed cannot know.
    """

    name: str
    passed: bool
    value: float
    threshold: float
    sentence: str
    made: bool = True
    doubt: str = ""

    @property
    def outcome(self) -> Outcome:
        """Which of the four it is."""
        if not self.made:
            return "not made"
        return "failed" if not self.passed else "doubtful" if self.doubt else "passed"


# What no check of a rest is sure of where another one was not made, by the name of that.
DOUBTS = {
    "buckling": "Whether it buckles was not checked.",
    "discretisation": "What the mesh costs was not estimated.",
}
OF_A_REST = ("holds shape", "buckling", "upright", "strength")


def with_unmade(checks: Sequence[Check]) -> list[Check]:
    """``checks`` of a rest, those that passed in doubt where another one was not made."""
    doubts = " ".join(DOUBTS[c.name] for c in checks if not c.made and c.name in DOUBTS)
    return [
        replace(c, doubt=doubts) if doubts and c.passed and c.name in OF_A_REST else c
        for c in checks
    ]


def percent(value: float) -> str:
    """A share in words: two digits, all beyond the whole; never '0.00 %'."""
    if 0 < value < 1e-4:
        return "less than 0.01 %"
    return f"{100 * value:.2g} %" if value < 0.995 else f"{100 * value:,.0f} %"


def holds_shape(result: SagResult) -> Check:
    """Whether the body keeps its shape under its load: it sags little, and does not buckle."""
    ratio, factor = result.sag_ratio, result.load_factor
    buckled, loose = factor is not None and factor.value < STANDS, result.assumed > CRUMBS
    passed = ratio <= HOLDS and not buckled and result.trusted and not loose
    does = "holds its shape" if passed else "does not hold its shape"
    also = f", and it buckles under {factor.value:.3g} times its load" if factor and buckled else ""
    also += "" if result.trusted else "; how it comes to lie was not found"
    also += f"; {percent(result.assumed)} of its volume is attached to nothing" if loose else ""
    return Check(
        "holds shape", passed, ratio, HOLDS,
        f"It {does}: a point moves {percent(ratio)} of its longest side (limit {HOLDS:.0%}){also}.",
    )  # fmt: skip


def discretisation(result: SagResult) -> Check:
    """Whether the mesh is fine enough for the answer."""
    found = result.discretisation_error
    if found.why:
        said = f"How far the mesh is off was not estimated: {found.why}."
        return Check("discretisation", False, found.value, TRUSTED, said, made=False)
    about, passed = found.bound, found.bound <= TRUSTED
    by = OFF_BY[found.kind]
    by += ", at small strains" if LAWS[result.static.law].finite else ""
    shown = f"{about:.0%}" if round(about, 2) != TRUSTED or passed else f"{about + 5e-4:.1%}"
    edge = "" if passed else f"{edge_share(result.static.mesh):.2g}"
    does = f"coarse, its edges {edge} of its diagonal" if edge else "fine enough"
    said = f"largest displacement within about {shown} (limit {TRUSTED:.0%}), {by}"
    said = f"The mesh is {does}: {said}."
    return Check("discretisation", passed, about, TRUSTED, said)


def buckling(factor: LoadFactor | None, why: str = "") -> Check:
    """Whether the body takes its load without buckling; without a factor ``why`` is told."""
    if factor is None:
        said = f"Whether it buckles was not checked: {why}."
        return Check("buckling", False, np.nan, STANDS, said, made=False)
    passed = factor.value >= STANDS
    times = "more than 1000" if np.isinf(factor.value) else f"{factor.value:.3g}"
    return Check(
        "buckling", passed, factor.value, STANDS,
        f"It {'does not buckle' if passed else 'buckles'}: {times} times its load would make it do "
        f"so (limit {STANDS:g}).",
    )  # fmt: skip


def stays_upright(result: SagResult, scene: Scene) -> tuple[Check, ...]:
    """Whether the body would stand if its base were not held; nothing where it need not."""
    if scene.ground is None or scene.holds or not result.trusted or result.assumed:
        return ()
    mesh, held = result.static.mesh, result.static.reaction
    force, moment = -held.sum(axis=0), -np.cross(result.static.space.nodes, held).sum(axis=0)
    if not np.any(scene.gravity_vector):
        mass = mesh.volumes * material_of(mesh).rho
        middle = mass @ mesh.points[mesh.tets].mean(axis=1) / mass.sum()
        weight = -GRAVITY * mass.sum() * up_vector(scene.up)
        force, moment = force + weight, moment + np.cross(middle, weight)
    inside, friction = foothold(mesh.points[result.supported], force, moment, scene.up)
    passed, found = inside >= 0, f"{abs(inside):.2g} m {'within' if inside >= 0 else 'outside'}"
    does = "stays upright" if passed else "would tip over if its base were not held"
    said = f"its load meets the ground {found} its feet"
    said += f", and it slides where friction is below {friction:.2g}" if friction > SLIDES else ""
    if np.isinf(inside):
        does, said = "would lift off if its base were not held", "its load outdoes its weight"
    return (Check("upright", passed, inside, 0.0, f"It {does}: {said}."),)


def first_frequency(modes: Modes) -> Check:
    """Whether the body rings rather than wobbles."""
    value = float(modes.frequencies[0])
    passed = value >= WOBBLES
    does = "is stiff" if passed else "wobbles"
    return Check(
        "first frequency", passed, value, WOBBLES,
        f"It {does}: its first natural frequency is {value:.3g} Hz (limit {WOBBLES:g} Hz).",
    )  # fmt: skip


def explicit_step(mesh: TetMesh, wanted: float = 1e-4) -> Check:
    """Whether an explicit simulator with the step ``wanted`` [s] would be stable."""
    value = largest_explicit_step(mesh)
    passed = value >= wanted
    return Check(
        "explicit step", passed, value, wanted,
        f"An explicit simulator needs steps below {value:.2g} s "
        f"({'within' if passed else 'far from'} the usual {wanted:g} s).",
    )  # fmt: skip


def distinguishable(one: SagResult, two: SagResult) -> Check:
    """Whether two materials under one scenario can be told apart by eye."""
    high = max(one.max_displacement, two.max_displacement)
    low = min(one.max_displacement, two.max_displacement)
    factor = float(high / low) if low > 0 else np.inf
    seen = high >= VISIBLE * max(one.height, two.height)
    passed = bool(factor >= DIFFERENT and seen)
    do = "look different" if passed else "look alike"
    return Check(
        "distinguishable", passed, factor, DIFFERENT,
        f"The two materials {do}: their displacements differ {factor:.3g}-fold, the larger is "
        f"{percent(high / max(one.height, two.height))} of the height.",
    )  # fmt: skip


def locking(result: StaticResult | MotionResult) -> Check:
    """Whether the elements stand nearly incompressible materials, and bending."""
    share, averaged = result.locking_share, isinstance(result, StaticResult) and result.averaged
    used = "quadratic elements" if result.order == 2 else "linear elements"
    used += " with pressures averaged around the nodes" if averaged else ""
    if not share and isinstance(result, MotionResult) and (coarse := too_coarse(result.stiffening)):
        sentence = f"The answer is too stiff: {coarse} (limit {BENDS_ALIKE:g})."
        return Check("locking", False, result.stiffening, BENDS_ALIKE, sentence)
    if share == 0:
        sentence = f"The elements suit the material: {used}."
    else:
        sentence = (
            f"The answer is too stiff: {used} lock where nu is above {LOCKING:g}, "
            f"{share:.0%} of the volume."
        )
    return Check("locking", share == 0, share, 0.0, sentence)


def usual_size(mesh: TetMesh, *, stated: bool = False) -> Check:
    """Whether the body is as long as things are, or as the user ``stated``.

    Else a unit was likely mistaken.
    """
    longest = float(np.ptp(mesh.bounds, axis=0).max())
    low, high = USUAL_SIZE
    passed = stated or low <= longest <= high
    unit = "--units mm (or cm)" if longest > high else "--units m (or --size METRES)"
    doubt = f": the file's numbers are likely in another unit. Convert with {unit}"
    return Check(
        "size", passed, longest, high if longest > high else low,
        f"It is {longest:.3g} m long and weighs {mesh.mass:.3g} kg{'' if passed else doubt}.",
    )  # fmt: skip


def usual_mass(mesh: TetMesh) -> Check:
    """Whether the body is as heavy as things of its size are; else it is likely hollow."""
    sides = np.ptp(mesh.bounds, axis=0)
    longest = float(sides.max())
    bulky = sides.min() >= BULKY * longest
    size = longest if bulky else 0.0
    low, high = next((low, high) for most, low, high in USUAL_DENSITY if size <= most)
    density = mesh.mass / float(sides.prod())
    passed = bool(low <= density <= high)
    heavy = density > high
    said = "usual for its size" if passed else f"far {'more' if heavy else 'less'} than is usual"
    question = "" if passed else " Is it solid throughout?" if heavy else " Is it so light?"
    return Check(
        "mass", passed, density, high if heavy else low,
        f"Its mass is {said}: {density:.3g} kg per m3 of its box "
        f"(things of that size: {low:.0f} to {high:,.0f}).{question}",
    )  # fmt: skip


def strength(safety: Safety) -> Check:
    """Whether a part stands its stress."""
    passed = safety.factor >= SAFE
    gives_way, kind = GIVES_WAY[safety.side]
    if passed:
        times = "more than 1000" if safety.factor > 1e3 else f"{safety.factor:.3g}"
        found = f"holds: safety factor {times} against {kind}"
    else:
        found = f"{gives_way}: past {kind}, {1 / safety.factor:.2g} x"
    place = ", ".join(f"{x:.3g}" for x in safety.place)
    return Check(
        "strength", passed, safety.factor, SAFE,
        f"{safety.part} ({safety.material}) {found}: {safety.side} stress {safety.stress:.3g} Pa "
        f"at ({place}), lowest {kind} {safety.limit:.3g} Pa.",
    )  # fmt: skip


def span_of_answers(
    mass: Interval, u: Interval | None, tones: Sequence[Interval], likely: Likely | None = None
) -> Check:
    """What mass, displacement and first frequency may be, by what its materials leave open."""
    inner = likely.words if likely else ("", "", "")
    said = [f"it weighs {mass.words('.3g')} kg{inner[0]}"]
    said += [f"moves by {u.words('.2g')} m{inner[1]}"] if u else []
    said += [f"rings first at {tones[0].words('.3g')} Hz{inner[2]}"] if tones else []
    drawn = f" and by {likely.drawn} samples of what is unknown" if likely and likely.drawn else ""
    answer, apart = u or (tones[0] if tones else mass), "mesh, grain and guessed matter come on top"
    return Check(
        "range", True, answer.high / answer.low, np.inf,
        f"By the ranges of E and rho of its materials{drawn} {' and '.join(said)}; {apart}.",
    )  # fmt: skip


def static_checks(result: SagResult, *, size_stated: bool = False) -> tuple[Check, ...]:
    """Verdicts that a static result allows, and whether the user stated the size of its body."""
    mesh = result.static.mesh
    checks = (
        holds_shape(result),
        buckling(result.load_factor, result.load_factor_unmade),
        discretisation(result),
        locking(result.static),
        explicit_step(mesh),
        usual_size(mesh, stated=size_stated),
        usual_mass(mesh),
    )
    return tuple(with_unmade(checks))
