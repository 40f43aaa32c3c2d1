"""Options of a scenario become its answer: a body settles, moves or rings."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from typing import Any

from ...fem.conditions.boundary_conditions import LOADS, BoundaryConditions
from ...fem.errors import ConvergenceError, InputError, UsageError
from ...fem.result import Modes, MotionResult, SagResult
from ...fem.scenarios.scenario import SCENARIOS, Scenario
from ...fem.scene.mesh import TetMesh
from ...fem.scene.scene import Scene
from ...fem.solve.method import METHODS, Method
from ...predictors.asset import UpAxis
from ..options import EXPECTED, SimulateOptions
from ..results.moving import Moving
from ..results.ringing import Ringing
from ..results.settled import Settled
from ..results.simulation import Simulation
from .bodies import with_bodies
from .conditions import stated_conditions
from .grain import grained
from .solvers import chosen_method, method_name

STANDING_MODES = 3
RECENT = 3  # frames whose pace is that of what goes on now
# Methods in which one body meets another.
MEETING = ("dynamics", "mpm")

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

    Raises
    ------
    UsageError
        Where the scenario cannot use the law.
    ConvergenceError
        Where the solver does not reach its tolerance.
    """
    started = time.perf_counter()
    if progress is not None:
        progress(f"{options.scenario}, {len(mesh.tets):,} tets", 0.0)
    stated = stated_conditions(options)
    mesh, rows = with_bodies(mesh, materials or {}, stated.bodies)
    scenario = _scenario(options, stated.gravity)
    kind = method_name(options, scenario)
    method = chosen_method(kind, options, rows, announce(progress, started), classes=classes)
    _check_law(options, method)
    scene = stated_scene(mesh, options, up=up, materials=rows)
    result = method.solve(
        scene,
        law=options.law,
        order=options.order,
        device=options.device,
        progress=frames_told(options.scenario, progress, started),
    )
    changed = bool(stated.conditions)
    found = _answer(scene, options.scenario, result, stated=changed)
    if scenario.with_modes and isinstance(found, Settled):
        found = replace(found, modes=_standing_modes(scene, options.device))
    return replace(found, materials=rows, seconds=time.perf_counter() - started)


def stated_scene(
    mesh: TetMesh,
    options: SimulateOptions,
    *,
    up: UpAxis,
    materials: Mapping[str, str] | None = None,
) -> Scene:
    """Scene of ``mesh``, all its bodies, that the options state for the method that they name."""
    stated = stated_conditions(options)
    scenario = _scenario(options, stated.gravity)
    kind = method_name(options, scenario)
    if kind != "mpm":
        _check_conditions(options, stated.conditions, kind)
    if stated.bodies and kind not in MEETING:
        raise UsageError("--body: bodies meet in motions: --scenario drop ..., --solver fem or mpm")
    mesh, notes = grained(mesh, options, materials or {}, method=kind)
    scene = stated.conditions.applied(scenario.scene(mesh, up=up))
    notes = (*scene.warnings, *notes, *_held_notes(scene, options.scenario))
    return replace(scene, self_contact=options.self_contact, warnings=notes)


def _held_notes(scene: Scene, scenario: str) -> tuple[str, ...]:
    """Say that what is to fall is held; refuse a body of which nothing can move."""
    held = scene.held
    if held.fixed.all() and not held.values.any():
        raise UsageError(
            "every point of the body is held: nothing can move, wanted a smaller --fix"
        )
    if scenario == "drop" and held.fixed.any():
        return ("drop: the body is held, so that it does not fall, but swings under its weight",)
    return ()


def _answer(
    scene: Scene, scenario: str, result: SagResult | MotionResult | Modes, *, stated: bool
) -> Simulation:
    """What is told of a scene, by the kind of its result, whatever the method."""
    if isinstance(result, SagResult):
        return Settled(scene, scenario, stated, solved=result)
    if isinstance(result, MotionResult):
        return Moving(scene, scenario, stated, motion=result)
    return Ringing(scene, scenario, stated, modes=result)


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


def _check_conditions(
    options: SimulateOptions, conditions: BoundaryConditions, method: str
) -> None:
    """Say what a method cannot follow, rather than leave it out in silence."""
    if method in ("dynamics", "spring", "lbs") and conditions.move:
        what = f"--scenario {options.scenario}" if method == "dynamics" else f"--solver {method}"
        raise UsageError(f"--move is for bodies at rest: {what} is a motion")
    if method in ("statics", "modal") and conditions.obstacle:
        raise UsageError(
            "--obstacle: only motions meet obstacles: --scenario drop, squeeze ... or --solver mpm"
        )
    if method == "modal":
        for kind in (*LOADS, "move"):
            if getattr(conditions, kind):
                raise UsageError(f"--{kind}: loads do not change vibrations; --fix does")


def _check_law(options: SimulateOptions, method: Method) -> None:
    if options.law and method.laws and options.law not in method.laws:
        raise UsageError(
            f"--scenario {options.scenario} knows only --law {', '.join(method.laws)}, "
            f"got {options.law!r}"
        )


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


def _standing_modes(scene: Scene, device: str) -> Any:
    """First vibrations of a body as it is held, where a direct factor finds them; else None."""
    from ...fem.scenarios.vibration import Vibration
    from ...fem.solve.modal import quick_order

    order = quick_order(scene.mesh)
    if order is None:
        return None
    try:
        wanted = replace(scene, modes=STANDING_MODES)
        return METHODS[Vibration.method].solve(wanted, order=order, device=device)
    except (ConvergenceError, InputError):  # too few unknowns for so many modes
        return None
