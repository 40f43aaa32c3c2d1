"""Options of a scenario become its answer: a body settles, moves or rings."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from ..fem.discrete.elastic import Law
from ..fem.errors import ConvergenceError, InputError, UsageError
from ..fem.scene.mesh import TetMesh
from ..predictors.asset import UpAxis
from .options import SimulateOptions
from .results.simulation import Moving, Ringing, Settled, Simulation

LAWS = {"linear": Law.LINEAR, "neohookean": Law.NEO_HOOKEAN}
STATIC = ("sag", "hang", "wind", "poke")
# Unknowns up to which a settled body's frequencies are found too: a few seconds.
QUICK = 60_000
STANDING_MODES = 3

Progress = Callable[[str, float], None]  # called with (stage, seconds so far)


def solve(
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
    if options.scenario in STATIC:
        found = _settle(mesh, options, up)
    elif options.scenario == "modal":
        found = _ring(mesh, options, up)
    else:
        found = _move(mesh, options, up, progress)
    return replace(found, seconds=time.perf_counter() - started)


def _settle(mesh: TetMesh, options: SimulateOptions, up: UpAxis) -> Settled:
    from ..fem.scenarios import static as scenarios

    law = LAWS[options.law] if options.law else None
    common: dict[str, Any] = {"up": up, "device": options.device, "law": law}
    common["order"] = _order(mesh, options)
    modes = None
    match options.scenario:
        case "hang":
            solved = scenarios.hang(mesh, gravity=options.gravity, **common)
        case "wind":
            solved = scenarios.wind(mesh, speed=options.wind_speed, **common)
        case "poke":
            solved = scenarios.poke(mesh, force=options.poke_force, **common)
        case _:
            common |= {"supports": options.supports, "gravity": options.gravity}
            solved = scenarios.sag(mesh, **common)
            modes = _quick_modes(mesh, options, up)
    return Settled(mesh, options.scenario, solved=solved, modes=modes)


def _ring(mesh: TetMesh, options: SimulateOptions, up: UpAxis) -> Ringing:
    _only_law(options, "linear")
    order = _order(mesh, options)
    modes = _modes(mesh, up, options.modes, order=order, device=options.device)
    return Ringing(mesh, options.scenario, modes=modes)


def _move(mesh: TetMesh, options: SimulateOptions, up: UpAxis, progress: Progress | None) -> Moving:
    from ..fem.scenarios import motions

    started = time.perf_counter()

    def tell(frame: int, frames: int) -> None:
        if progress is not None:
            seconds = time.perf_counter() - started
            left = seconds / frame * (frames - frame)
            progress(f"{options.scenario}: frame {frame} of {frames}, {left:.0f} s left", seconds)

    law = LAWS[options.law or "neohookean"]
    common: dict[str, Any] = {"order": options.order or 1, "device": options.device, "law": law}
    common["tell"] = tell
    if options.scenario == "drop":
        common |= {"height": options.drop_height, "gravity": options.gravity}
        motion = motions.drop(mesh, up=up, **common)
    else:
        motion = motions.squeeze(mesh, axis=_across(up), share=options.squeeze_share, **common)
    return Moving(mesh, options.scenario, motion=motion)


def _modes(mesh: TetMesh, up: UpAxis, count: int, *, order: int, device: str):
    from ..fem.scene.support_finder import rest, up_axis
    from ..fem.solve.modal import natural_modes

    held, _ = rest(mesh, up_axis(up))
    return natural_modes(mesh, count, supports=held, order=order, device=device)


def _quick_modes(mesh: TetMesh, options: SimulateOptions, up: UpAxis):
    """First vibrations of a standing body where a direct factor finds them quickly, else None."""
    from ..fem.solve.discretisation_error import p2_unknowns
    from ..fem.solve.modal import is_factored

    sizes = {2: p2_unknowns(mesh), 1: 3 * len(mesh.points)}
    quick = [order for order, n in sizes.items() if n <= QUICK and is_factored(mesh, n)]
    if not quick:
        return None
    try:
        return _modes(mesh, up, STANDING_MODES, order=quick[0], device=options.device)
    except (ConvergenceError, InputError):  # too few unknowns for so many modes
        return None


def _order(mesh: TetMesh, options: SimulateOptions) -> int:
    """Quadratic elements while they are affordable: linear ones are far too stiff on thin parts."""
    from ..fem.solve.discretisation_error import LARGEST_P2, p2_unknowns

    return options.order or (2 if p2_unknowns(mesh) <= LARGEST_P2 else 1)


def _across(up: UpAxis) -> UpAxis:
    """The first horizontal axis."""
    return "x" if up != "x" else "y"


def _only_law(options: SimulateOptions, law: str) -> None:
    if options.law not in (None, law):
        raise UsageError(
            f"--scenario {options.scenario} knows only --law {law}, got {options.law!r}"
        )
