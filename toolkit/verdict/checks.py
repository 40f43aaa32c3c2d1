"""Verdicts on a simulated body, at rest and in motion: number, threshold and sentence of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ...fem.laws.law import LAWS
from ...fem.mesh import USUAL_SIZE, TetMesh, edge_fraction, largest_explicit_step, material_of
from ...fem.safety import Safety
from ...fem.scene.scene import Scene
from ...fem.scene.up import up_vector
from ...fem.solve.contact import support_polygon
from ...fem.solve.result import (
    BENDS_ALIKE,
    LOCKING,
    MOTION_LIMIT,
    LoadFactor,
    Modes,
    MotionResult,
    ParticleRun,
    SagResult,
    StaticResult,
    energy_balance,
    too_coarse,
)
from ...fem.uncertainty import Interval, Likely

# A body holds its shape if no point moves more than this fraction of its longest side.
HOLDS = 0.05
CRUMBS = 1e-3  # fraction of the volume that may be attached to nothing that is held
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
USUAL_STEP = 1e-4  # [s], of explicit simulators
# A first frequency below this is seen as wobbling.
WOBBLES = 5.0
# Two materials look different when their largest displacements differ by this factor, and the
# larger one is seen at all: more than this fraction of the height.
DIFFERENT = 2.0
VISIBLE = 0.005
# Mass [kg] of a thing per volume [m^3] of its box, by the side [m] up to which it holds: what 64
# things that were weighed have (benchmarks/data/known_masses.toml), with room: 26 (a drink can) to
# 12,040 (a gold coin); bulky ones of .3 m 261 to 1,940 (a curling stone), longer than a metre 28 to
# 181 (a pallet). What is slender or flat may be solid at any length: rebar has 6,172.
USUAL_DENSITY = ((0.3, 10.0, 23_000.0), (1.0, 10.0, 3_000.0), (np.inf, 10.0, 1_000.0))
# Bulky: no side of the box is below this fraction of the longest.
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
    """A fraction in words: two digits, all beyond the whole; never '0.00 %'."""
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
    error = result.discretisation_error
    if error.why:
        said = f"How far the mesh is off was not estimated: {error.why}."
        return Check("discretisation", False, error.value, TRUSTED, said, made=False)
    about, passed = error.bound, error.bound <= TRUSTED
    by = OFF_BY[error.kind]
    by += ", at small strains" if LAWS[result.static.law].finite else ""
    shown = f"{about:.0%}" if round(about, 2) != TRUSTED or passed else f"{about + 5e-4:.1%}"
    edge = "" if passed else f"{edge_fraction(result.static.mesh):.2g}"
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
    inside, friction = support_polygon(mesh.points[result.supported], force, moment, scene.up)
    passed, where = inside >= 0, f"{abs(inside):.2g} m {'within' if inside >= 0 else 'outside'}"
    does = "stays upright" if passed else "would tip over if its base were not held"
    said = f"its load meets the ground {where} its feet"
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


def explicit_step(mesh: TetMesh) -> Check:
    """Whether an explicit simulator with the usual step would be stable."""
    value = largest_explicit_step(mesh)
    passed = value >= USUAL_STEP
    return Check(
        "explicit step", passed, value, USUAL_STEP,
        f"An explicit simulator needs steps below {value:.2g} s "
        f"({'within' if passed else 'far from'} the usual {USUAL_STEP:g} s).",
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
    fraction = result.locking_fraction
    used = f"{'quadratic' if result.order == 2 else 'linear'} elements"
    moving = isinstance(result, MotionResult)
    if moving and not fraction and (coarse := too_coarse(result.stiffening)):
        sentence = f"The answer is too stiff: {coarse} (limit {BENDS_ALIKE:g})."
        return Check("locking", False, result.stiffening, BENDS_ALIKE, sentence)
    if fraction == 0:
        sentence = f"The elements suit the material: {used}."
    else:
        sentence = (
            f"The answer is too stiff: {used} lock where nu is above {LOCKING:g}, "
            f"{fraction:.0%} of the volume."
        )
    return Check("locking", fraction == 0, fraction, 0.0, sentence)


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
        does = f"holds: safety factor {times} against {kind}"
    else:
        does = f"{gives_way}: past {kind}, {1 / safety.factor:.2g} x"
    place = ", ".join(f"{x:.3g}" for x in safety.place)
    return Check(
        "strength", passed, safety.factor, SAFE,
        f"{safety.part} ({safety.material}) {does}: {safety.side} stress {safety.stress:.3g} Pa "
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


# A motion may have this fraction more energy than it was given. Elements and reduced bodies: 1 % is
# what BDF2 is inexact by in an impact (tests/fem/test_energy.py), twice that the limit.
EXCESS = 0.02
# Springs: explicit steps show their fastest vibrations with too much; falls, spins, bounces and
# wobbles that keep their energy had up to 1.8 % more, steps that are too long 4 to 28 %.
SPRING_EXCESS = 0.03
# Particles: their grid only takes; what keeps its energy had at most .013 % more.
PARTICLE_EXCESS = 0.001
# A frame that loses more than this fraction has an impact in it that is shorter than the frame.
SUDDEN = 0.25


def keeps_energy(motion: MotionResult, scene: Scene) -> tuple[Check, ...]:
    """Whether no energy is made of nothing, and what is lost; whether its impacts are followed."""
    if (balance := energy_balance(motion, scene)) is None:
        return ()
    most = EXCESS if motion.order else SPRING_EXCESS
    if motion.particles is not None:
        most = PARTICLE_EXCESS
    excess, limit = balance.excess / balance.given, f"(limit {percent(most)})"
    passed = excess <= most
    if passed:
        takers = ["friction"] if scene.friction and scene.obstacles else []
        if motion.particles is not None:
            takers += ["flow, cracks, damping", "what its grid does not carry"]
        by = f"{', '.join(takers)} and its time steps" if takers else "its time steps"
        said = f"It never has more energy than the {balance.given:.3g} J that it was given {limit}"
        said += f"; {balance.lost / balance.given:.1%} of that is lost at the end, to {by}."
    else:
        said = (
            f"It has {balance.excess:.3g} J more than the {balance.given:.3g} J that it was given: "
        )
        said += f"{percent(excess)} too much {limit}. Its steps make energy of nothing."
    checks = [Check("energy", passed, excess, most, said)]
    # A frame, where it is one step, that takes most of the energy: an impact, or where nothing is
    # met a swing that begins and ends within few frames
    sudden = balance.dropped / balance.given
    if motion.order and sudden > SUDDEN:
        lost = (
            f"{balance.dropped:.3g} J of {balance.given:.3g} J are lost in the one step of "
            f"{motion.dt:.2g} s that ends at {balance.time:.3g} s"
        )
        name, said = "fast swing", f"It swings faster than its steps show: {lost}."
        if motion.contact_forces.any():
            name = "impact"
            said = f"An impact is not followed: {lost}; it does not rebound as it would."
        checks.append(Check(name, False, sudden, SUDDEN, said))
    return tuple(checks)


def no_penetration(motion: MotionResult) -> Check:
    """Whether the body kept its distance from every obstacle, and from itself where that was so."""
    gap = motion.smallest_gap
    passed = gap > 0
    what = "an obstacle or itself" if motion.kept_apart else "an obstacle"
    nearest = f"the smallest distance is {gap:.2g} m" if np.isfinite(gap) else "it meets nothing"
    return Check(
        "no penetration", passed, gap, 0.0,
        f"It {'never goes into' if passed else 'goes into'} {what}: {nearest}.",
    )  # fmt: skip


def follows(motion: MotionResult) -> tuple[Check, ...]:
    """Whether few coordinates move as the full body would; nothing where that is not known."""
    if (error := motion.model_error) is None:
        return ()
    near, coarse = error.share <= MOTION_LIMIT, too_coarse(motion.stiffening)
    do = "follow" if near else "do not follow"
    limit = percent(MOTION_LIMIT)
    said = (
        f"Its few coordinates {do} the full body of the same elements: off by {error.words} "
        f"(limit {limit})" + (f"; but {coarse}." if coarse else ".")
    )
    return (Check("reduced model", near and not coarse, error.share, MOTION_LIMIT, said),)


def contact_forces(motion: MotionResult, names: Sequence[str]) -> Check:
    """Who presses whom, at most; ``names`` are those of the pieces."""
    forces = np.linalg.norm(motion.obstacle_forces, axis=2).max(axis=0, initial=0.0)
    pressures = motion.largest_pressures
    said = [
        f"obstacle {k + 1} with {force:.3g} N"
        + (f" ({pressures.obstacles[k]:.3g} Pa)" if pressures else "")
        for k, force in enumerate(forces)
        if force > 0
    ]
    between = {
        pair: float(np.linalg.norm(force, axis=1).max())
        for pair, force in motion.piece_forces.items()
        if pair[0] < pair[1]
    }
    said += [f"{names[b]} on {names[a]} with {size:.3g} N" for (a, b), size in between.items()]
    if pressures and pressures.own > 0:
        said.append(f"the body itself with up to {pressures.own:.3g} Pa")
    largest = max([*forces.tolist(), *between.values()], default=0.0)
    return Check(
        "contact", True, largest, np.inf,
        f"At most it is pressed by {'; '.join(said)}." if said else "Nothing presses on it.",
    )  # fmt: skip


def in_the_grid(run: ParticleRun) -> Check:
    """Whether all particles stayed in the grid."""
    total, lost = len(run.part), run.outside
    return Check(
        "particles", not lost, lost, 0,
        f"{'All' if not lost else f'{total - lost:,} of'} {total:,} particles stay in the grid.",
    )  # fmt: skip
