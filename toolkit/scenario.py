"""Options of a scenario become its answer: a body settles, moves or rings."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

from ..fem.errors import ConvergenceError, InputError, UsageError
from ..fem.scenarios.scenario import SCENARIOS, Scenario
from ..fem.scene.mesh import TetMesh
from ..fem.solve.method import METHODS, Method
from ..predictors.asset import UpAxis
from .options import SimulateOptions
from .results.simulation import Settled, Simulation, simulation_of

# Unknowns up to which a settled body's frequencies are found too: a few seconds.
QUICK = 60_000
STANDING_MODES = 3

Progress = Callable[[str, float], None]  # called with (stage, seconds so far)


def run_scenario(
    mesh: TetMesh, options: SimulateOptions, *, up: UpAxis, progress: Progress | None = None
) -> Simulation:
    """Solve the scenario of ``options`` on a mesh with a material.

    ``progress`` hears of the scenario, and of every frame of a motion.

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
    scenario = _scenario(options)
    method = METHODS[scenario.method]
    _check_law(options, method)
    result = method.solve(
        scenario.scene(mesh, up=up),
        law=options.law,
        order=options.order,
        device=options.device,
        progress=_frames(options.scenario, progress, started),
    )
    found = simulation_of(mesh, options.scenario, result)
    if scenario.with_modes and isinstance(found, Settled):
        found = replace(found, modes=_standing_modes(mesh, up, options.device))
    return replace(found, seconds=time.perf_counter() - started)


def _scenario(options: SimulateOptions) -> Scenario:
    """The scenario with its numbers: field F of scenario N is the option ``N_F``, or ``F``."""
    name, kind = options.scenario, SCENARIOS[options.scenario]
    given: dict[str, Any] = {}
    for field in fields(kind):  # type: ignore  (a scenario is a dataclass)
        for option in (f"{name}_{field.name}", field.name):
            if hasattr(options, option):
                given[field.name] = getattr(options, option)
                break
    return kind(**given)


def _check_law(options: SimulateOptions, method: Method) -> None:
    if options.law and method.laws and options.law not in method.laws:
        raise UsageError(
            f"--scenario {options.scenario} knows only --law {', '.join(method.laws)}, "
            f"got {options.law!r}"
        )


def _frames(scenario: str, progress: Progress | None, started: float) -> Any:
    """Callback of every frame that says how long the rest will take."""
    if progress is None:
        return None

    def frame_done(frame: int, frames: int) -> None:
        seconds = time.perf_counter() - started
        left = seconds / frame * (frames - frame)
        progress(f"{scenario}: frame {frame} of {frames}, {left:.0f} s left", seconds)

    return frame_done


def _standing_modes(mesh: TetMesh, up: UpAxis, device: str) -> Any:
    """First vibrations of a standing body where a direct factor finds them quickly, else None."""
    from ..fem.scenarios.vibration import Vibration
    from ..fem.solve.discretisation_error import p2_unknowns
    from ..fem.solve.modal import is_factored

    sizes = {2: p2_unknowns(mesh), 1: 3 * len(mesh.points)}
    quick = [order for order, n in sizes.items() if n <= QUICK and is_factored(mesh, n)]
    if not quick:
        return None
    scene = Vibration(STANDING_MODES).scene(mesh, up=up)
    try:
        return METHODS[Vibration.method].solve(scene, order=quick[0], device=device)
    except (ConvergenceError, InputError):  # too few unknowns for so many modes
        return None
