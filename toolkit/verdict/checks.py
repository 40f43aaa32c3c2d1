"""Checks of a simulated body, at rest and in motion: number, limit and outcome of each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...fem.laws.law import LAWS
from ...fem.mesh import USUAL_SIZE, TetMesh, edge_fraction, largest_explicit_step
from ...fem.note import Note
from ...fem.safety import Safety, standing_pieces
from ...fem.scene.loads import resultant
from ...fem.scene.scene import Scene
from ...fem.scene.selection import TOUCH
from ...fem.solve.contact import support_polygon
from ...fem.solve.result import (
    BENDS_ALIKE,
    CUBIC,
    LOCKING,
    MOTION_LIMIT,
    SAFETY,
    DiscretisationError,
    LoadFactor,
    Modes,
    MotionResult,
    ParticleRun,
    SagResult,
    StaticResult,
    energy_balance,
    too_coarse,
)
from ...fem.table import load_strengths
from ...fem.uncertainty import Interval, Likely
from ..meshing.messages import listed
from .check import Check, Outcome, si

# A body holds its shape if no point moves more than this fraction of its longest side.
HOLDS = 0.05
CRUMBS = 1e-3  # fraction of the volume that may be attached to nothing that is held
# A displacement is trusted to this discretisation error.
TRUSTED = 0.1
# An error of a factor that is told beside it.
TOLD = 0.01
# A body stands where it buckles under no less than this multiple of its load.
STANDS = 1.0
SLIDES = 0.05  # friction [1] that any ground has but ice; less is not told
TAKEN_UP = 0.5  # fraction of a load that may land on fixed points
# Of its longest side a support may go on past the points that are held: thrice that is what the
# deflection of a cantilever is off by.
UNHELD = 0.02
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
# Where stress has no bound it grows by a third as edges are halved: thrice by an eighth of them.
UNBOUNDED = 3.0
# A part gives way below this safety factor; factors above the other are told as more than it.
SAFE, SAFE_TOLD = 1.0, 1000.0


def percent(value: float) -> str:
    """A fraction in words: two digits, all beyond the whole; never '0.00 %'."""
    if 0 < value < 1e-4:
        return "less than 0.01 %"
    return f"{100 * value:.2g} %" if value < 0.995 else f"{100 * value:,.0f} %"


def times(factor: float, *, passed: bool = False) -> str:
    """A factor in words: three digits, unless it is large or was ``passed``."""
    if passed or factor > SAFE_TOLD:
        return f"more than {min(factor, SAFE_TOLD):.4g}"
    return f"{factor:.3g}"


def _passed(passed: bool) -> Outcome:
    return "passed" if passed else "failed"


def holds_shape(result: SagResult) -> Check:
    """Whether the body keeps its shape under its load: it sags little, and does not buckle."""
    ratio, factor, also = result.sag_ratio, result.load_factor, ""
    if factor is not None and factor.value < STANDS:
        also += Note("checks.and_buckles", factor=factor.value)
    if not (result.trusted or also or ratio > HOLDS):
        said = Note("checks.shape_unknown", moved=percent(ratio), limit=HOLDS)
        return Check("holds shape", "not made", said, ratio, HOLDS)
    if not result.trusted:
        also += Note("checks.rest_unknown")
    passed = ratio <= HOLDS and not also
    told = {"moved": percent(ratio), "limit": HOLDS, "also": also}
    said = Note("checks.holds_shape" if passed else "checks.loses_shape", **told)
    return Check("holds shape", _passed(passed), said, ratio, HOLDS)


def attached(result: SagResult) -> tuple[Check, ...]:
    """Pieces that touch nothing held, and were held where they are; nothing if there are none."""
    if result.assumed <= CRUMBS:
        return ()
    said = Note("checks.attached_to_nothing", fraction=percent(result.assumed))
    return (Check("attached", "failed", said, result.assumed, CRUMBS),)


def discretisation(result: SagResult) -> Check:
    """Whether the mesh is fine enough for the answer."""
    error = result.discretisation_error
    if error.why:
        said = Note("checks.mesh_unmade", why=error.why)
        return Check("discretisation", "not made", said, error.value, TRUSTED, why=error.why)
    about, passed = error.bound, error.bound <= TRUSTED
    by = Note("checks.by_cubic" if error.kind == CUBIC else "checks.by_quadratic")
    by += Note("checks.at_small_strains") if LAWS[result.static.law].finite else ""
    # what rounds to the limit is told with one more digit
    shown = f"{about:.0%}" if round(about, 2) != TRUSTED or passed else f"{about + 5e-4:.1%}"
    told = {"about": shown, "limit": TRUSTED, "by": by}
    told["edge"] = edge_fraction(result.static.mesh)
    said = Note("checks.mesh_fine" if passed else "checks.mesh_coarse", **told)
    if passed and not result.trusted:  # it is the error of an answer that is none
        why = Note("checks.no_rest")
        said = f"{said} {Note('checks.of_linear', why=why)}"
        return Check("discretisation", "doubtful", said, about, TRUSTED, why=why)
    return Check("discretisation", _passed(passed), said, about, TRUSTED)


def buckling(factor: LoadFactor | None, why: str = "", *, ends: Interval | None = None) -> Check:
    """Whether the body takes its load without buckling; without a factor ``why`` is told.

    ``ends`` are the factors of its softest and its stiffest materials: the softest decides. A mesh
    is stiffer than its body, the more so in the finer waves of a shape that buckles: a factor that
    may be below the limit for that is in doubt, by what it is estimated to be off or a tenth.
    """
    if factor is None:
        said = Note("checks.buckling_unmade", why=why)
        return Check("buckling", "not made", said, np.nan, STANDS, why=why)
    least = factor.value if ends is None else min(ends.low, factor.value)
    passed, margin = least >= STANDS, np.fmax(factor.bound, TRUSTED)
    high = Note("checks.too_high", about=percent(factor.error)) if factor.error > TOLD else ""
    told: dict[str, Any] = {"times": times(least, passed=factor.passed and least == factor.value)}
    told |= {"limit": STANDS, "high": high}
    said = Note("checks.stands" if passed else "checks.buckles", **told)
    if least < factor.value:
        said += Note("checks.at_softest", middle=times(factor.value))
    if passed and least < STANDS * (1 + margin):
        why = Note("checks.nearly_buckles", margin=percent(margin))
        return Check("buckling", "doubtful", f"{said} {why}", least, STANDS, why=why)
    return Check("buckling", _passed(passed), said, least, STANDS)


def stays_upright(result: SagResult, scene: Scene) -> tuple[Check, ...]:
    """Whether the body would stand if its base were not held; nothing where it need not."""
    if scene.ground is None or scene.holds:
        return ()
    if not result.trusted or result.assumed:
        why = Note("checks.no_rest")
        return (Check("upright", "not made", Note("checks.upright_unmade", why=why), why=why),)
    pieces = standing_pieces(scene, result.static, GRAVITY)
    inside, friction = min(support_polygon(*piece, scene.up) for piece in pieces)
    passed = bool(inside >= 0)
    slides = Note("checks.slides", friction=friction) if friction > SLIDES else ""
    said = Note("checks.upright" if passed else "checks.tips", away=abs(inside), slides=slides)
    if np.isinf(inside):
        said = Note("checks.lifts_off")
    return (Check("upright", _passed(passed), said, inside, 0.0, "m"),)


def supports_reach(scene: Scene) -> tuple[Check, ...]:
    """Whether points of the mesh are where the supports end; none where their borders cut no tet.

    Points alone are held: what a support has of the tets that its border cuts can move.
    """
    beyond, name = max(((hold.beyond, hold.name) for hold in scene.holds), default=(0.0, ""))
    share = beyond / scene.longest
    if not share > TOUCH:
        return ()
    passed = share <= UNHELD
    told = {"place": name, "beyond": si(beyond, "m"), "share": percent(share)}
    said = Note("checks.supports_reach" if passed else "checks.supports_end", **told)
    return (Check("supports", "passed" if passed else "doubtful", said, share, UNHELD),)


def loads_reach(scene: Scene) -> tuple[Check, ...]:
    """Whether the loads that a user named land on points that can move; none where there are none.

    One of which more than half lands on fixed points is in doubt: their supports take it up.
    """
    shares = [
        (resultant(scene.mesh, load, scene.held).on_fixed, load.name)
        for load in scene.tractions
        if load.name
    ]
    if not shares:
        return ()
    share, name = max(shares)
    outcome: Outcome = "passed" if share <= TAKEN_UP else "doubtful" if share < 1 else "failed"
    told = {"place": name, "share": percent(share)}
    said = Note("checks.loads_reach" if share <= TAKEN_UP else "checks.loads_fixed", **told)
    return (Check("loads", outcome, said, share, TAKEN_UP),)


def first_frequency(modes: Modes | None, why: str = "") -> Check:
    """Whether the body rings rather than wobbles; without modes ``why`` is told."""
    if modes is None:
        said = Note("checks.frequency_unmade", why=why)
        return Check("first frequency", "not made", said, np.nan, WOBBLES, "Hz", why=why)
    value = float(modes.frequencies[0])
    under, outcome = Note("checks.under_load") if modes.loaded else "", _passed(value >= WOBBLES)
    told = {"value": value, "limit": WOBBLES, "under": under}
    said = Note("checks.is_stiff" if value >= WOBBLES else "checks.wobbles", **told)
    if modes.free and modes.held:
        ways = ", ".join(modes.free)
        outcome, said = "failed", Note("checks.moves_freely", ways=ways, **told)
    elif modes.order == 1 and value >= WOBBLES:
        outcome, said = "doubtful", Note("checks.stiff_by_linear", **told)
    elif value >= WOBBLES and SAFETY * modes.error > min(TRUSTED, 1 - WOBBLES / value):
        outcome, why = "doubtful", Note("checks.frequency_error", off=percent(modes.error))
        said = f"{said} {why}"
    return Check("first frequency", outcome, said, value, WOBBLES, "Hz", why=why)


def explicit_step(mesh: TetMesh) -> Check:
    """Whether an explicit simulator with the usual step would be stable."""
    value = largest_explicit_step(mesh)
    passed, told = value >= USUAL_STEP, {"value": value, "limit": USUAL_STEP}
    said = Note("checks.step_usual" if passed else "checks.step_short", **told)
    return Check("explicit step", _passed(passed), said, value, USUAL_STEP, "s")


def distinguishable(one: SagResult, two: SagResult) -> Check:
    """Whether two materials under one scenario can be told apart by eye."""
    low, high = sorted((one.max_displacement, two.max_displacement))
    factor = float(high / low) if low > 0 else np.inf
    seen = high / max(one.height, two.height)
    passed = bool(factor >= DIFFERENT and seen >= VISIBLE)
    told = {"factor": factor, "seen": percent(seen)}
    said = Note("checks.look_different" if passed else "checks.look_alike", **told)
    return Check("distinguishable", _passed(passed), said, factor, DIFFERENT)


def locking(result: StaticResult | MotionResult) -> Check:
    """Whether the elements stand nearly incompressible materials, and bending."""
    fraction = result.locking_fraction
    used = Note("checks.quadratic" if result.order == 2 else "checks.linear")
    moving = isinstance(result, MotionResult)
    if moving and not fraction and (coarse := too_coarse(result.stiffening)):
        said = Note("checks.bends_stiffly", coarse=coarse, limit=BENDS_ALIKE)
        return Check("locking", "failed", said, result.stiffening, BENDS_ALIKE)
    if not moving and result.order == 1 and not fraction:
        why = Note("checks.linear_bends")
        return Check("locking", "doubtful", why, fraction, 0.0, why=why)
    told = {"used": used, "nu": LOCKING, "fraction": fraction}
    said = Note("checks.elements_suit" if fraction == 0 else "checks.elements_lock", **told)
    return Check("locking", _passed(fraction == 0), said, fraction, 0.0)


def usual_size(mesh: TetMesh, *, stated: bool = False) -> Check:
    """Whether the body is as long as things are, or as the user ``stated``.

    Else a unit was likely mistaken.
    """
    longest = float(np.ptp(mesh.bounds, axis=0).max())
    low, high = USUAL_SIZE
    limit, told = high if longest > high else low, {"longest": longest, "mass": mesh.mass}
    if stated or low <= longest <= high:
        return Check("size", "passed", Note("checks.size", **told), longest, limit, "m")
    said = Note("checks.size_large" if longest > high else "checks.size_small", **told)
    return Check("size", "failed", said, longest, limit, "m")


def usual_mass(mesh: TetMesh) -> Check:
    """Whether the body is as heavy as things of its size are; else it is likely hollow."""
    sides = np.ptp(mesh.bounds, axis=0)
    longest = float(sides.max())
    bulky = sides.min() >= BULKY * longest
    size = longest if bulky else 0.0
    low, high = next((low, high) for most, low, high in USUAL_DENSITY if size <= most)
    density = mesh.mass / float(sides.prod())
    limit, told = high if density > high else low, {"density": density, "low": low, "high": high}
    if low <= density <= high:
        return Check("mass", "passed", Note("checks.mass", **told), density, limit, "kg/m^3")
    said = Note("checks.mass_large" if density > high else "checks.mass_small", **told)
    return Check("mass", "failed", said, density, limit, "kg/m^3")


def strength(safety: Safety, error: DiscretisationError | None = None) -> Check:
    """Whether a part stands its stress, in doubt where the ``error`` of the mesh may be its own."""
    factor, place = safety.factor, ", ".join(f"{x:.3g}" for x in safety.place)
    passed, (does, limit) = factor >= SAFE, gives_way(safety)
    told = {"of": limit, "does": does, "times": times(factor), "past": 1 / factor, "at": place}
    said = Note("checks.strong" if passed else "checks.weak", **safety._asdict(), **told)
    where: dict[str, Any] = {"part": safety.part, "place": safety.place}
    outcome, why = _passed(passed), ""
    if passed and error is not None and safety.place is not None:
        from_centre = lambda p: float(np.linalg.norm(np.subtract(safety.place, p.centre)))  # noqa: E731
        here = next((p for p in error.places if from_centre(p) <= p.radius), None)
        if here is not None and factor < UNBOUNDED:
            told = {"kind": here.kind, "share": percent(here.share)}
            outcome, why = "doubtful", Note("checks.singular_stress", **told)
        elif factor < 1 + 2 * error.stress:  # twice the rms covers the largest of 97 in 100
            outcome, why = "doubtful", Note("checks.stress_error", off=percent(error.stress))
    return Check("strength", outcome, f"{said} {why}".strip(), factor, SAFE, **where, why=why)


def strength_unmade(
    parts: Sequence[str], materials: Mapping[str, str], *, rests: bool = True
) -> tuple[Check, ...]:
    """What is said of ``parts`` that have no safety, by the rows that they are of."""
    if not parts:
        return ()
    why = Note("checks.no_rest")
    if rests:
        rows = dict.fromkeys(filter(None, (materials.get(part) for part in parts)))
        unknown = [row for row in rows if row not in load_strengths()]
        if not rows:
            why = Note("checks.no_names")
        elif unknown:
            why = Note("checks.no_strength", materials=", ".join(unknown))
        else:
            why = Note("checks.other_stiffness", materials=", ".join(rows))
    told = {"parts": listed(parts), "give": "give" if len(parts) > 1 else "gives"}
    said = Note("checks.strength_unmade", why=why, **told)
    return (Check("strength", "not made", said, part=", ".join(parts), why=why),)


def gives_way(safety: Safety) -> tuple[str, str]:
    """What a part does past its limit, and what the limit is called, by what is judged there."""
    if safety.side == "equivalent":
        return Note("checks.yields"), Note("checks.yield_strength")
    if safety.side == "shear":
        return Note("checks.splits"), Note("checks.shear_strength")
    across = Note("checks.across_grain") if safety.direction == "across" else ""
    if safety.side == "tension":
        return Note("checks.cracks"), Note("checks.tensile_strength") + across
    return Note("checks.is_crushed"), Note("checks.compressive_strength") + across


def span_of_answers(
    mass: Interval, u: Interval | None, tones: Sequence[Interval], likely: Likely | None = None
) -> Check:
    """What mass, displacement and first frequency may be, by what its materials leave open."""
    inner = likely.words if likely else ("", "", "")
    answers = Note("checks.may_weigh", span=mass.words(".3g"), likely=inner[0])
    if u:
        answers += Note("checks.may_move", span=u.words(".2g"), likely=inner[1])
    if tones:
        answers += Note("checks.may_ring", span=tones[0].words(".3g"), likely=inner[2])
    drawn = Note("checks.and_samples", count=likely.drawn) if likely and likely.drawn else ""
    answer, said = u or (tones[0] if tones else mass), {"answers": answers, "drawn": drawn}
    return Check("range", "passed", Note("checks.range", **said), answer.high / answer.low)


def static_checks(
    result: SagResult, *, size_stated: bool = False, load_factors: Interval | None = None
) -> tuple[Check, ...]:
    """Checks that a static result allows, and whether the user stated the size of its body.

    ``load_factors`` of buckling are those of its softest and its stiffest materials.
    """
    mesh = result.static.mesh
    return (
        holds_shape(result),
        *attached(result),
        buckling(result.load_factor, result.load_factor_unmade, ends=load_factors),
        discretisation(result),
        locking(result.static),
        explicit_step(mesh),
        usual_size(mesh, stated=size_stated),
        usual_mass(mesh),
    )


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
    excess, lost = balance.excess / balance.given, balance.lost / balance.given
    takers: list[str] = [Note("checks.friction")] if scene.friction and scene.obstacles else []
    takers += [Note("checks.flow_and_grid")] if motion.particles is not None else []
    by = Note("checks.takers" if takers else "checks.steps", takers=", ".join(takers))
    told = {"given": balance.given, "excess": balance.excess, "limit": percent(most)}
    told |= {"share": percent(excess), "lost": lost, "by": by}
    said = Note("checks.keeps_energy" if excess <= most else "checks.makes_energy", **told)
    checks = [Check("energy", _passed(excess <= most), said, excess, most)]
    # A frame, where it is one step, that takes most of the energy: an impact, or where nothing is
    # met a swing that begins and ends within few frames
    sudden = balance.dropped / balance.given
    if motion.order and sudden > SUDDEN:
        told = {"dropped": balance.dropped, "given": balance.given}
        told |= {"step": motion.dt, "time": balance.time}
        met = motion.contact_forces.any()
        said = Note("checks.impact" if met else "checks.fast_swing", **told)
        checks.append(Check("impact" if met else "fast swing", "failed", said, sudden, SUDDEN))
    return tuple(checks)


def no_penetration(motion: MotionResult) -> Check:
    """Whether the body kept its distance from every obstacle, and from itself where that was so."""
    gap = motion.smallest_gap
    what = Note("checks.obstacle_or_itself" if motion.kept_apart else "checks.obstacle")
    near = Note("checks.nearest", gap=gap) if np.isfinite(gap) else Note("checks.meets_nothing")
    said = Note("checks.stays_out" if gap > 0 else "checks.goes_into", what=what, nearest=near)
    return Check("no penetration", _passed(gap > 0), said, gap, 0.0, "m")


def follows(motion: MotionResult) -> tuple[Check, ...]:
    """Whether few coordinates move as the full body would; nothing where that is not known."""
    if (error := motion.model_error) is None:
        return ()
    near, coarse = error.share <= MOTION_LIMIT, too_coarse(motion.stiffening)
    told = {"error": error.words, "limit": percent(MOTION_LIMIT)}
    told["but"] = Note("checks.but_coarse", coarse=coarse) if coarse else ""
    said = Note("checks.follows" if near else "checks.strays", **told)
    return (Check("reduced model", _passed(near and not coarse), said, error.share, MOTION_LIMIT),)


def contact_forces(motion: MotionResult, names: Sequence[str], *, falls: bool = False) -> Check:
    """Who presses whom, at most; ``names`` are those of the pieces.

    It is not made where an impact was not resolved, or what ``falls`` onto obstacles meets none;
    and in doubt where that is not known.
    """
    forces = np.linalg.norm(motion.obstacle_forces, axis=2).max(axis=0, initial=0.0)
    impact, pressures = motion.impact, motion.largest_pressures
    met = forces.any() or bool(motion.piece_forces)
    if impact is not None and met:
        forces = np.maximum(forces, impact.forces)
        if kind := impact.unresolved:
            why = {
                "time": Note("checks.unresolved_time", lost=impact.lost),
                "surface": Note("checks.unresolved_surface", barrier=impact.barrier),
                "force": Note("checks.unresolved_force"),
            }[kind]
            return Check("contact", "not made", Note("checks.press_unknown", why=why), why=why)
    pressed: list[str] = []
    for k, force in enumerate(forces):
        if force > 0:
            pressure = f" ({pressures.obstacles[k]:.3g} Pa)" if pressures else ""
            pressed.append(Note("checks.by_obstacle", k=k + 1, force=force, pressure=pressure))
    between = {
        pair: float(np.linalg.norm(force, axis=1).max())
        for pair, force in motion.piece_forces.items()
        if pair[0] < pair[1]
    }
    for (a, b), force in between.items():
        pressed.append(Note("checks.by_piece", on=names[a], by=names[b], force=force))
    if pressures and pressures.own > 0:
        pressed.append(Note("checks.by_itself", pressure=pressures.own))
    if falls and not pressed:
        why = Note("checks.meets_none", time=motion.frames[-1].time)
        return Check("contact", "not made", why, why=why)
    largest = max([*forces.tolist(), *between.values()], default=0.0)
    said = Note("checks.pressed" if pressed else "checks.not_pressed", by="; ".join(pressed))
    doubt = Note("checks.impact_unknown") if met and impact is None else ""
    outcome: Outcome = "doubtful" if doubt else "passed"
    return Check("contact", outcome, f"{said} {doubt}".strip(), largest, unit="N", why=doubt)


def breakage(run: ParticleRun, *, wanted: bool) -> tuple[Check, ...]:
    """What tore, where anything can; ``wanted``: else say that this was not followed."""
    torn = run.breakage
    if not torn.judged:
        return (Check("breakage", "not made", Note("checks.cannot_tear")),) if wanted else ()
    told = {"parts": ", ".join(torn.parts), "pieces": torn.pieces, "before": torn.pieces_before}
    told |= {"fraction": percent(torn.fraction), "judged": percent(torn.judged)}
    place = tuple(torn.place) if torn.fraction else None
    told["place"] = ", ".join(f"{x:.3g}" for x in place or ())
    said = Note("checks.torn" if place else "checks.whole", **told)
    outcome: Outcome = "failed" if place else "passed"
    doubt = ""
    if place is None and torn.crack_energy > 1.1:
        outcome, doubt = "doubtful", Note("checks.costly_cracks", times=torn.crack_energy)
    said = f"{said} {doubt}".strip()
    return (Check("breakage", outcome, said, torn.fraction, 0.0, place=place, why=doubt),)


def in_the_grid(run: ParticleRun) -> Check:
    """Whether all particles stayed in the grid."""
    total, lost = len(run.part), run.outside
    told = {"total": total, "left": total - lost}
    said = Note("checks.some_stay" if lost else "checks.all_stay", **told)
    return Check("particles", _passed(not lost), said, lost, 0)
