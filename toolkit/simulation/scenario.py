"""Options of a scenario become its answer: a body settles, moves or rings."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from difflib import get_close_matches
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np

from ...fem.errors import ConvergenceError, InputError, UsageError
from ...fem.grain import Grained, grained_parts, parts_of_grain, with_grains
from ...fem.identify import MotionFit
from ...fem.mesh import TetMesh, join_meshes, material_of
from ...fem.mpm.materials import (
    MaterialClass,
    Substance,
    class_of,
    triaxial_angle,
    triaxial_friction,
)
from ...fem.note import Note
from ...fem.reduced.model import Subspace
from ...fem.reduced.motion import ROUNDS, ReducedMethod
from ...fem.scene.conditions import (
    KINDS,
    LOADS,
    BoundaryConditions,
    ConditionsFile,
    entries,
    numbers,
    read_conditions,
)
from ...fem.scene.scene import Scene
from ...fem.solve.error import refine_scene
from ...fem.solve.method import METHODS, SCENARIOS, Method, Scenario
from ...fem.solve.modal import QUICK, factor_fits, natural_modes
from ...fem.solve.result import Modes, MotionResult, SagResult
from ...fem.table import Span, key, load_contents, load_flows, load_strengths, load_table
from ...predictors.asset import UpAxis
from ..asset.document import BodyRecord, read_known
from ..options import EXPECTED, SimulateOptions, with_given
from ..verdict.simulation import ModalSimulation, MotionSimulation, Simulation, StaticSimulation
from .budget import Plan, check_budget, paced, planned

if TYPE_CHECKING:
    from ...fem.mpm.method import MpmMethod
    from ...fem.springs.body import SpringMethod


STANDING_MODES = 3
RECENT = 3  # frames whose pace is that of what goes on now
# Methods in which one body meets another.
MEETING = ("dynamics", "mpm")

# Classes that a part is of by its material, without a word: what flows. Metals are too stiff to
# yield here, all else springs back.
FLOWING = (MaterialClass.SAND, MaterialClass.VISPLAS, MaterialClass.FLUID, MaterialClass.SNOW)
# Whose numbers a class takes where the tables have none of a material.
LIKE = {"sand": "sand (uniform)"}
# A jelly that tears, and what a class cannot do without.
BRITTLE = "brittle"
WANTED = {
    "metal": ("yield_stress",),
    "sand": ("friction",),
    "visplas": ("yield_stress", "viscosity"),
    BRITTLE: ("tension", "fracture_energy"),
}
Progress = Callable[[str, float], None]  # called with (stage, seconds so far)


def run_scenario(
    mesh: TetMesh,
    options: SimulateOptions,
    *,
    up: UpAxis,
    materials: Mapping[str, str] | None = None,
    classes: Mapping[str, str] | None = None,
    progress: Progress | None = None,
) -> Simulation:
    """Solve the scenario of ``options`` on a mesh with a material.

    ``classes`` are those of the material point method by part, where they were found; ``progress``
    hears of the scenario, and of every frame of a motion.

    Raises UsageError: Where the scenario cannot use the law.
    Raises ConvergenceError: Where the solver does not reach its tolerance.
    """
    started = time.perf_counter()
    if progress is not None:
        progress(f"{options.scenario}, {len(mesh.tets):,} tets", 0.0)
    stated = conditions_of_options(options)
    mesh, rows = _with_bodies(mesh, materials or {}, stated.bodies)
    scenario = _scenario(options, stated.gravity)
    kind = method_name(options, scenario)
    tell = announce(progress, started)
    if kind == "mpm":
        method: Method = particle_method(options, rows, tell, classes=classes)
    elif kind == "spring":
        method = spring_method(options, tell)
    else:
        method = reduced_method(options, tell) if kind == "lbs" else METHODS[kind]
    if options.law and method.laws and options.law not in method.laws:
        known = {"scenario": options.scenario, "laws": ", ".join(method.laws), "law": options.law}
        raise UsageError("scenario.laws", **known)
    scene = scene_of_options(mesh, options, up=up, materials=rows)
    if options.budget is not None:
        scene = paced(scene, options)
    if options.refine is not None:
        scene = _refined(scene, options, kind)
    result = method.solve(
        scene,
        law=options.law,
        order=options.order,
        device=options.device,
        progress=frames_told(options.scenario, progress, started),
    )
    known: Any = {"stated": bool(stated.conditions), "materials": rows}
    if isinstance(result, MotionResult):
        answer = MotionSimulation(scene, options.scenario, **known, motion=result)
    elif isinstance(result, Modes):
        answer = ModalSimulation(scene, options.scenario, **known, modes=result)
    else:
        answer = StaticSimulation(scene, options.scenario, **known, solved=result)
        # First vibrations of the body as it lies and is held, where a factor finds them
        if scenario.with_modes:
            answer = replace(answer, **standing_modes(scene, result, options.device))
    return replace(answer, seconds=time.perf_counter() - started)


def _refined(scene: Scene, options: SimulateOptions, kind: str) -> Scene:
    """The scene on a mesh that is fine enough, or a warning of why it is not."""
    percent = cast("float", options.refine)
    if kind != "statics" or options.order == 1:
        raise UsageError("scenario.refine_rest")
    if not 0.01 <= percent <= 100:
        raise UsageError("scenario.refine_percent", percent=percent)
    refined = refine_scene(scene, percent / 100, device=options.device)
    before, after = len(scene.mesh.tets), len(refined.scene.mesh.tets)
    values: Any = {"before": before, "after": after, "error": refined.error, "goal": percent / 100}
    if refined.why:
        note = Note("scenario.refined_short", why=refined.why, **values)
    elif not refined.error <= percent / 100:
        note = Note("scenario.refined_unknown", goal=percent / 100)
    else:
        note = Note("scenario.refined", **values)
    return replace(refined.scene, warnings=(*scene.warnings, note))


def film_plan(
    mesh: TetMesh,
    options: SimulateOptions,
    *,
    picture: float,
    spent: float = 0.0,
    up: UpAxis,
    materials: Mapping[str, str] | None = None,
    classes: Mapping[str, str] | None = None,
) -> Plan:
    """What drives a film within ``options.budget``, and what it will take.

    ``picture`` [s] is the time that one picture of it takes, ``spent`` [s] that of all before.
    """
    check_budget(options)
    scenario = _scenario(options, conditions_of_options(options).gravity)
    method = method_name(options, scenario)
    scene = scene_of_options(mesh, options, up=up, materials=materials)
    said = substances(options.matter, materials)
    left = {part: row for part, row in (materials or {}).items() if part not in said}
    flowing = {**flowing_substances(left, classes or {})[0], **said}
    known: Any = {"picture": picture, "spent": spent, "substances": flowing}
    return planned(paced(scene, options), options, method=method, **known)


def standing_modes(scene: Scene, result: SagResult, device: str) -> dict[str, Any]:
    """First vibrations of a body at rest, or why there are none."""
    static = result.static
    if not result.trusted:
        return {"modes_unmade": Note("checks.no_rest")}
    if not factor_fits(scene.mesh, order=static.order, most=QUICK):
        return {"modes_unmade": Note("checks.modes_too_long")}
    known: Any = {"order": static.order, "rest": static, "device": device}
    known |= {"supports": scene.held, "tractions": scene.tractions}
    try:
        return {"modes": natural_modes(scene.mesh, STANDING_MODES, **known)}
    except (ConvergenceError, InputError) as error:  # or too few unknowns for so many modes
        return {"modes_unmade": error.note}


def scene_of_options(
    mesh: TetMesh,
    options: SimulateOptions,
    *,
    up: UpAxis,
    materials: Mapping[str, str] | None = None,
) -> Scene:
    """Scene of ``mesh``, all its bodies, that the options state for the method that they name."""
    stated = conditions_of_options(options)
    scenario = _scenario(options, stated.gravity)
    kind = method_name(options, scenario)
    # Say what a method cannot follow, rather than leave it out in silence
    conditions = stated.conditions
    if kind in ("dynamics", "spring", "lbs") and conditions.move:
        what = f"--scenario {options.scenario}" if kind == "dynamics" else f"--solver {kind}"
        raise UsageError(f"--move is for bodies at rest: {what} is a motion")
    if conditions.fix and options.supports != SimulateOptions.supports:
        raise UsageError(f"--supports {options.supports}: --fix takes its place")
    if kind in ("statics", "modal") and conditions.obstacle:
        raise UsageError("scenario.obstacle_at_rest")
    for load in (*LOADS, "move") if kind == "modal" else ():
        if getattr(conditions, load):
            raise UsageError(f"--{load}: loads do not change vibrations; --fix does")
    if stated.bodies and kind not in MEETING:
        raise UsageError("--body: bodies meet in motions: --scenario drop ..., --solver fem or mpm")
    mesh, notes = grained(mesh, options, materials or {}, method=kind)
    scene = conditions.applied(scenario.scene(mesh, up=up))
    held = scene.held
    if held.fixed.all() and not held.values.any():
        raise UsageError("scenario.all_held")
    if options.scenario == "drop" and held.fixed.any():
        notes = (*notes, Note("scenario.swings"))
    return replace(scene, self_contact=options.self_contact, warnings=(*scene.warnings, *notes))


def _scenario(options: SimulateOptions, gravity: float | None) -> Scenario:
    """The scenario with its numbers: field F of scenario N is the option ``N_F``, or ``F``."""
    name, kind = options.scenario, SCENARIOS[options.scenario]
    given: dict[str, Any] = {}
    known = [field.name for field in fields(kind)]  # type: ignore  (a scenario is a dataclass)
    for field in known:
        for option in (f"{name}_{field}", field):
            if hasattr(options, option):
                given[field] = getattr(options, option)
                break
    given.pop("gravity", None)
    if gravity is not None:
        if "gravity" not in known:
            raise UsageError(f"--gravity: --scenario {name} leaves the weight out")
        given["gravity"] = gravity
    return kind(**given)


def announce(progress: Progress | None, started: float) -> Callable[[str], None] | None:
    """Callback of a method that says what it is about to do."""
    if progress is None:
        return None
    return lambda plan: progress(EXPECTED + plan, time.perf_counter() - started)


def frames_told(scenario: str, progress: Progress | None, started: float) -> Any:
    """Callback of every frame that says how long the rest will take, by the slower of two paces.

    They are that of all frames and that of the last few: one in contact takes ten times as long as
    one in free fall, and the rest of a drop is in contact.
    """
    if progress is None:
        return None
    ends = deque([started], maxlen=RECENT + 1)

    def frame_done(frame: int, frames: int) -> None:
        ends.append(time.perf_counter())
        seconds = ends[-1] - started
        pace = max(seconds / frame, (ends[-1] - ends[0]) / (len(ends) - 1))
        left = f"{pace * (frames - frame):.0f} s left at this pace"
        progress(f"{scenario}: frame {frame} of {frames}, {left}", seconds)

    return frame_done


def _with_bodies(
    mesh: TetMesh, materials: Mapping[str, str], entries: Sequence[str]
) -> tuple[TetMesh, dict[str, str]]:
    """Join the meshes of ``entries``, 'FILE' or 'FILE=x,y,z' [m], to ``mesh``, and their rows."""
    rows = dict(materials)
    for entry in entries:
        path, equals, place = entry.rpartition("=")
        shift = numbers(place, 3, f"--body {entry}") if equals else numbers("0,0,0", 3, entry)
        other, sidecar, *_ = read_known(path if equals else entry, None)
        if other.material is None:
            raise InputError(f"--body {entry}: it has no E, nu and rho: run `assign` on it first")
        known, before = BodyRecord.of(sidecar).materials, len(mesh.region_names)
        mesh = join_meshes(mesh, other, shift)
        renamed = zip(other.region_names, mesh.region_names[before:], strict=True)
        rows |= {new: known[old] for old, new in renamed if old in known}
    return mesh, rows


# What solvers beside finite elements cannot do, by name of the scenario's own method or scenario.
REFUSED = {
    ("mpm", "modal"): "particles do not ring",
    ("spring", "modal"): "springs are followed in time",
    ("spring", "tear"): "springs do not tear",
    ("lbs", "modal"): "a reduced body is followed in time",
    ("lbs", "tear"): "a reduced body does not tear",
}
# Options that only some solvers have: with another they would be left out in silence.
OWNED = {
    **dict.fromkeys(("grid", "stiff", "matter", "damping", "preset", "threads"), ("mpm",)),
    **dict.fromkeys(("anchors", "neighbours", "eta"), ("spring",)),
    **dict.fromkeys(("basis", "handles"), ("lbs",)),
    **dict.fromkeys(("parameters", "parameters_alpha"), ("lbs", "spring")),
    "order": ("fem", "lbs"),
}
# Options that are a scenario's numbers, those of N named N_...: as they would be beside another.
STAGED = {"supports": "sag", "modes": "modal"} | {
    field.name: scenario
    for field in fields(SimulateOptions)
    for scenario in SCENARIOS.names
    if field.name.startswith(f"{scenario}_")
}


def method_name(options: SimulateOptions, scenario: Scenario) -> str:
    """Name of the method of ``--solver`` for ``scenario``; ``UsageError`` where it cannot."""
    # Refuse what neither the solver nor the scenario would read, rather than leave it out
    solver = "mpm" if scenario.method == "mpm" else options.solver
    known = [field.name for field in fields(scenario)]  # type: ignore  (a scenario is a dataclass)
    read = {*known, *(f"{options.scenario}_{name}" for name in known)}
    for name in (*OWNED, *STAGED):
        if getattr(options, name) == getattr(SimulateOptions, name):
            continue
        option = name.replace("_", "-")
        owners = OWNED.get(name, ())
        if owners and solver not in owners:
            raise UsageError(f"--{option}: wanted --solver {' or '.join(owners)}, not {solver}")
        if name in STAGED and name not in read:
            wanted = f"wanted --scenario {STAGED[name]}, not {options.scenario}"
            raise UsageError(f"--{option}: {wanted}")
    if options.solver == "fem":
        return scenario.method
    why = REFUSED.get((options.solver, options.scenario))
    if why is not None:
        other = "mpm" if scenario.method == "mpm" else "fem"
        raise UsageError(f"--scenario {options.scenario}: {why}; --solver {other}")
    return options.solver


def reduced_method(
    options: SimulateOptions, announce: Callable[[str], None] | None = None
) -> ReducedMethod:
    """Reduced bodies of the kind and size, and with the fitted moduli, that the options name."""
    from ...converters.archives import load_fits

    _check_parameters(options)
    moduli = Moduli(1.0, None)
    if options.parameters is not None:
        moduli = moduli_between(load_fits(options.parameters), options.parameters_alpha)
    return ReducedMethod(
        rounds=ROUNDS if options.budget is None else 0,  # its cost is foretold
        rough=options.budget is not None,
        kind=Subspace(options.basis),
        handles=options.handles,
        scale=moduli.scale,
        nu=moduli.nu,
        announce=announce,
    )


def spring_method(
    options: SimulateOptions, announce: Callable[[str], None] | None = None
) -> SpringMethod:
    """Springs of the network that the options name, or of the one that was fitted."""
    from ...converters.archives import load_springs
    from ...fem.springs.body import SpringMethod

    _check_parameters(options)
    if options.parameters is None:
        network: dict[str, Any] = {
            "anchors": options.anchors,
            "neighbours": options.neighbours,
            "eta": options.eta,
        }
        return SpringMethod(**network, announce=announce)
    fit = load_springs(options.parameters)
    for name in ("anchors", "neighbours", "eta"):
        asked, fitted = getattr(options, name), getattr(fit, name)
        if asked not in (fitted, getattr(SimulateOptions, name)):
            raise UsageError("scenario.fitted_with", name=name, asked=asked, fitted=fitted)
    network: dict[str, Any] = {"anchors": fit.anchors, "neighbours": fit.neighbours, "eta": fit.eta}
    ends = 1 if isnan(fit.stiffer) else 2
    alpha = checked_alpha(options.parameters_alpha, ends)
    stiffer = None if ends == 1 else fit.stiffer**alpha
    found: dict[str, Any] = {"scale": fit.scale, "surface": fit.surface, "stiffer": stiffer}
    return SpringMethod(**network, **found, announce=announce)


def _check_parameters(options: SimulateOptions) -> None:
    if options.parameters is None and options.parameters_alpha is not None:
        raise UsageError("--parameters-alpha: wanted --parameters of `match --to-stiff` with it")


def particle_method(
    options: SimulateOptions,
    materials: Mapping[str, str],
    announce: Callable[[str], None] | None = None,
    *,
    classes: Mapping[str, str] | None = None,
) -> MpmMethod:
    """The method that the options ask for; ``announce`` hears what it will cost.

    ``materials`` are the rows of the table that parts are of: numbers that are not said are theirs.
    ``classes`` are those that a predictor found, by part; else a part that flows has its row's.
    """
    from ...fem.mpm.method import PRESETS, MpmMethod
    from ...fem.mpm.rigid import Stiff

    if options.grid < 4:
        raise UsageError(f"--grid {options.grid}: wanted at least 4 cells along the longest side")
    if options.preset:
        # Say which number a preset would leave out in silence
        for name in ("grid", "stiff", "damping"):
            if getattr(options, name) != getattr(SimulateOptions, name):
                raise UsageError("scenario.preset_has", preset=options.preset, name=name)
    if not (np.isfinite(options.damping) and options.damping >= 0):
        raise UsageError(f"--damping {options.damping:g}: wanted a rate >= 0 [1/s]")
    own = MpmMethod(grid=options.grid, stiff=Stiff(options.stiff), damping=options.damping)
    said = substances(options.matter, materials)
    left = {part: row for part, row in materials.items() if part not in said}
    flowing, notes = flowing_substances(left, classes or {})
    # A slope is easily taken for the angle or its tangent: .6 is steeper than sand ever is
    steep = {part: one.friction for part, one in said.items() if one.kind is MaterialClass.SAND}
    notes += tuple(
        Note("scenario.slope", part=part, slope=slope, angle=np.rad2deg(triaxial_angle(slope)))
        for part, slope in steep.items()
    )
    return replace(
        PRESETS[options.preset] if options.preset else own,
        substances=flowing | said,
        notes=notes,
        threads=options.threads,
        announce=announce,
    )


def substances(
    entries: Sequence[str], materials: Mapping[str, str] | None = None
) -> dict[str, Substance]:
    """Matter by name of part, of entries such as 'bread=brittle,tension=5e3,fracture_energy=20'.

    What is not said is taken from the tables of strength and flow, for the row in ``materials``:
    the middle of its range. ``brittle`` is jelly that tears.
    """
    known = {field.name for field in fields(Substance)} - {"kind", "corotated"}
    names = ", ".join(sorted(known))
    found = {}
    for entry in entries:
        part, equals, said = entry.partition("=")
        name, *numbers = [word.strip() for word in said.split(",")]
        if not equals or name.upper() not in (*MaterialClass.__members__, BRITTLE.upper()):
            classes = ", ".join([*(kind.name.lower() for kind in MaterialClass), BRITTLE])
            raise UsageError(f"--matter {entry!r}: wanted PART=CLASS[,name=value] of {classes}")
        values: dict[str, Any] = {}
        for pair in numbers:
            number, _, text = pair.partition("=")
            number = number.strip()
            if number not in known:
                near = get_close_matches(number, known, n=1)
                hint = f"; did you mean {near[0]!r}?" if near else f": known are {names}"
                raise UsageError(f"--matter {entry!r}: no number {number!r}{hint}")
            try:
                values[number] = float(text)
            except ValueError as error:
                raise UsageError(f"--matter {entry!r}: {text!r} is no number") from error
        row = (materials or {}).get(part.strip(), "")
        values = _from_tables(name, row) | values
        missing = [number for number in WANTED.get(name, ()) if number not in values]
        if missing:
            where = f"the tables know none of {row!r}" if row else "its material is not known"
            raise UsageError(f"--matter {entry!r}: give {missing[0]}=...: {where}")
        kind = MaterialClass.JELLY if name == BRITTLE else MaterialClass[name.upper()]
        values["seed"] = int(values.get("seed", 0))
        found[part.strip()] = Substance(kind=kind, **values)  # type: ignore
    return found


def flowing_substances(
    materials: Mapping[str, str], classes: Mapping[str, str]
) -> tuple[dict[str, Substance], tuple[str, ...]]:
    """Matter by name of the parts that flow, and what to say of it: by ``classes``, else by row."""
    found: dict[str, Substance] = {}
    notes: list[str] = []
    for part, row in materials.items():
        own = row.removeprefix("like ")
        name = classes.get(part)
        if not name:
            tables = load_table().phrases, load_contents().phrases
            known = next((rows[key(own)] for rows in tables if key(own) in rows), None)
            name = (MaterialClass.JELLY if known is None else class_of(known)).name.lower()
        if MaterialClass[name.upper()] not in FLOWING:
            continue
        values: dict[str, Any] = _from_tables(name, LIKE.get(name, own)) | _from_tables(name, own)
        missing = [number for number in WANTED.get(name, ()) if number not in values]
        if missing:
            known = {"part": part, "row": row, "name": name, "number": missing[0]}
            notes.append(Note("scenario.stays_elastic", **known))
            continue
        numbers = "".join(f", {number} {value:.3g}" for number, value in values.items())
        notes.append(f"{part}: {name} as {row} is{numbers}; --matter {part}=jelly keeps it elastic")
        found[part] = Substance(kind=MaterialClass[name.upper()], **values)
    return found, tuple(notes)


def _from_tables(name: str, row: str) -> dict[str, float]:
    """Numbers of a class from the rows of strength and flow: the middle of what is sourced."""
    flow, strength = load_flows().get(row), load_strengths().get(row)
    found: dict[str, Span | None] = {}
    if name == "metal" and strength is not None and strength.kind == "yield":
        found["yield_stress"] = strength.tension
    if name == BRITTLE and strength is not None:
        found["tension"] = strength.tension
    if flow is not None:
        if name == BRITTLE:
            found["fracture_energy"] = flow.fracture
        if name in ("visplas", "fluid"):
            found["viscosity"] = flow.viscosity
        if name == "visplas":
            found["yield_stress"] = flow.yield_stress
    values = {number: (span.min + span.max) / 2 for number, span in found.items() if span}
    if name == "sand" and flow is not None and flow.friction is not None:
        angle = np.deg2rad((flow.friction.min + flow.friction.max) / 2)
        values["friction"] = triaxial_friction(angle)
    return values


class Moduli(NamedTuple):
    """What E of all cells is multiplied by [1], and their Poisson's ratio [1] where it is known."""

    scale: float
    nu: float | None


def checked_alpha(alpha: float | None, ends: int) -> float:
    """Where between a soft end (0) and a stiff one (1), by default the middle; of one end, 0."""
    if alpha is not None and (ends < 2 or not 0 <= alpha <= 1):
        raise UsageError("scenario.alpha", alpha=alpha)
    return 0.0 if ends < 2 else 0.5 if alpha is None else alpha


def moduli_between(ends: Sequence[MotionFit], alpha: float | None = None) -> Moduli:
    """Moduli at ``alpha`` between fits to a soft and to a stiff motion: even in log E, and in nu.

    Raises UsageError: Where there is one end only, or ``alpha`` lies beyond them.
    """
    share = checked_alpha(alpha, len(ends))
    soft, stiff = ends[0], ends[-1]
    scale = float(soft.scale ** (1 - share) * stiff.scale**share)
    if soft.nu is None or stiff.nu is None:
        return Moduli(scale, None)
    return Moduli(scale, (1 - share) * soft.nu + share * stiff.nu)


METHODS_WITH_GRAIN = ("statics", "modal", "dynamics")


def grained(
    mesh: TetMesh, options: SimulateOptions, materials: Mapping[str, str], *, method: str
) -> Grained:
    """Give the parts of ``mesh`` their grain where the ``method`` knows one, or say so.

    ``materials`` are the rows of the table by part.

    Raises UsageError: Where ``--grain`` is not understood, or cannot be followed.
    """
    stated = grains_of_options(mesh, options.grain)
    if method in METHODS_WITH_GRAIN:
        return with_grains(mesh, materials, stated)
    if stated:
        raise UsageError("--grain: springs, particles and reduced bodies know none")
    note = "wood is taken as stiff across its grain as along it: this method knows no grain"
    known = grained_parts(mesh) or parts_of_grain(materials)
    return Grained(mesh.with_material(material_of(mesh).without_grain()), (note,) if known else ())


def grains_of_options(mesh: TetMesh, entries: Sequence[str]) -> dict[str, np.ndarray]:
    """Directions by part of what ``--grain`` says; ``UsageError`` where it is not understood."""
    found = {}
    for entry in entries:
        place, equals, value = entry.rpartition("=")
        kind, _, part = place.strip().partition(":")
        if not equals or kind != "part" or part not in mesh.region_names:
            known = ", ".join(mesh.region_names)
            raise UsageError(f"--grain {entry!r}: wanted part:NAME=x,y,z; parts are {known}")
        found[part] = numbers(value, 3, f"--grain {entry}")
        if not found[part].any():
            raise UsageError(f"--grain {entry!r}: wanted a direction, not zero")
    return found


def conditions_of_options(options: SimulateOptions) -> ConditionsFile:
    """Conditions of the file of ``--scene`` and then of the options, and gravity [m/s^2] if said.

    Raises UsageError: Where gravity is negative, or a number is none.
    """
    read = ConditionsFile(BoundaryConditions(), None)
    if options.scene is not None:
        read = read_conditions(Path(options.scene))
    both: dict[str, Any] = {
        kind: (*getattr(read.conditions, kind), *getattr(options, kind)) for kind in KINDS
    }
    if options.gravity_dir is not None:
        way = numbers(options.gravity_dir, 3, f"--gravity-dir {options.gravity_dir}")
        both["gravity_dir"] = tuple(way.tolist())
    gravity = read.gravity if options.gravity is None else options.gravity
    if gravity is not None and not gravity >= 0:
        raise UsageError(f"--gravity {gravity:g}: wanted >= 0; --gravity-dir says where it pulls")
    bodies = (*read.bodies, *options.body)
    return ConditionsFile(replace(read.conditions, **both), gravity, bodies)


def changed_options(options: SimulateOptions, given: Mapping[str, Any]) -> SimulateOptions:
    """Return the options with those ``given`` by name, as Python users write them."""
    repeated = (*KINDS, "body", "grain")
    plain = {name: entries(value) if name in repeated else value for name, value in given.items()}
    way = plain.get("gravity_dir")
    if way is not None and not isinstance(way, str):
        plain["gravity_dir"] = ",".join(repr(float(x)) for x in way)
    return with_given(options, plain, verb="simulate")
