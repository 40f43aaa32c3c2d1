"""Method of statics: linear, with its discretisation error, and again where strains are large."""

from __future__ import annotations

import logging
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ..errors import ConvergenceError, UsageError
from ..laws.law import LAWS, Law
from ..note import Note
from ..scene.scene import Scene
from .buckling import find_load_factor
from .contact import barrier_thickness
from .error import find_discretisation_error
from .method import FrameProgress
from .nonlinear import solve_nonlinear
from .result import SagResult, StaticResult
from .statics import solve_static

logger = logging.getLogger(__name__)

# Beyond this strain the linear law is not enough.
LINEAR_LIMIT = 0.05
# Share of the longest side beyond which a linear displacement means collapse: large strains would
# have to be followed through folding and self-contact, minutes for what the eye has seen already.
COLLAPSE = 0.5
# Newton steps of the repeat: one that converges takes 5 to 15.
ITERATIONS = 30
# Unknowns up to which a body that Newton does not bring to rest is relaxed: hundreds of factors.
RELAXED = 15_000


class StaticMethod:
    """Equilibrium under dead loads.

    Without a law: the linear one, and neo-Hookean where the linear answer strains more than 5 %;
    with a finite law that one is taken there; ``Law.LINEAR`` is never repeated.
    """

    laws: tuple[str, ...] = ()

    def solve(
        self,
        scene: Scene,
        *,
        law: str | None = None,
        order: int | None = None,
        device: str = "cpu",
        progress: FrameProgress | None = None,
    ) -> SagResult:
        """Body at rest; by default with quadratic elements while they are affordable.

        Raises UsageError: If the scene has obstacles or a velocity: it needs a motion.
        Raises ConvergenceError: If the linear solve does not reach its tolerance.
        """
        if scene.obstacles or np.any(scene.velocity):
            raise UsageError("equilibrium.statics_knows")
        acts = np.any(scene.gravity_vector) or scene.tractions or scene.held.values.any()
        if not (acts or (scene.forces is not None and np.any(scene.forces))):
            raise UsageError("equilibrium.nothing_acts")
        warnings = [*scene.warnings]
        loads = {
            "gravity_vector": scene.gravity_vector,
            "traction": scene.tractions,
            "forces": scene.forces,
            "device": device,
        }
        solve = partial(solve_static, scene.mesh, scene.held, **loads)
        static = solve(order=order)
        found = find_discretisation_error(static, scene.held, solve, **loads)
        static = replace(static, cycle=None)  # and its memory
        factor, load_factor_unmade = None, ""  # of buckling, or why there is none
        if static.order == 1:
            load_factor_unmade = Note("equilibrium.linear_elements")
        else:
            try:
                factor = find_load_factor(static, scene.held)
            except ConvergenceError as error:
                load_factor_unmade = str(error)
        trusted = True
        if law is None or LAWS[law].finite:
            name = law or Law.NEO_HOOKEAN
            static, trusted = _checked_strain(scene, static, name, warnings, loads)
        for warning in warnings:
            logger.warning(warning)
        largest = float(np.linalg.norm(static.displacement, axis=1).max())
        return SagResult(
            static,
            scene.height,
            largest,
            largest / scene.longest,
            found.relative,
            np.asarray(scene.held.fixed.any(axis=1)),
            tuple(warnings),
            load_factor=factor,
            load_factor_unmade=load_factor_unmade,
            trusted=trusted,
            assumed=scene.held.assumed,
            error_shares=found.shares,
            reaction_error=found.reaction,
        )


METHOD = StaticMethod()


def _checked_strain(
    scene: Scene, linear: StaticResult, law: str, warnings: list[str], loads: dict[str, Any]
) -> tuple[StaticResult, bool]:
    """Answer under ``law`` where the linear one strains or sinks too much; whether to trust it."""
    fraction = float(np.linalg.norm(linear.displacement, axis=1).max()) / scene.longest
    if fraction > COLLAPSE:
        warnings.append(Note("equilibrium.collapses_linear", fraction=fraction))
        return linear, False
    ground = scene.ground
    if ground is not None:  # so low that it does not push the body yet
        normal = np.asarray(ground.normal, dtype=float)
        normal /= np.linalg.norm(normal)
        lowered = ground.point - barrier_thickness(scene.mesh) * normal
        ground = replace(ground, point=tuple(lowered))
    if linear.max_strain > LINEAR_LIMIT:
        why = Note(
            "equilibrium.linear_answer", max_strain=linear.max_strain, linear_limit=LINEAR_LIMIT
        )
    elif ground and not ground.distance(scene.mesh.points + linear.displacement).gap.min() > 0:
        why = Note("equilibrium.linear_answer_sinks")
    else:
        return linear, True
    title = LAWS[law].title
    options = {"law": law, "order": linear.order, "iterations": ITERATIONS}
    options["obstacles"] = (ground,) if ground else ()
    options["relaxation"] = linear.node_displacement.size <= RELAXED
    try:
        static = solve_nonlinear(scene.mesh, scene.held, **options, **loads)
    except ConvergenceError as error:
        warnings.append(Note("equilibrium.trusted_newton", why=why, title=title, error=error))
        return linear, False
    warnings.append(Note("equilibrium.repeated_law", why=why, title=title))
    return static, True
