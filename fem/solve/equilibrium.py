"""Method of statics: linear with its errors; followed where the linear law is not enough."""

from __future__ import annotations

import logging
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ..elements.assembly import discretise, node_supports
from ..elements.elastic import ElasticBody, constrained_stiffness, displacement_gradients
from ..elements.space import CENTROID
from ..errors import ConvergenceError, UsageError
from ..laws.law import LAWS, Law
from ..linalg.cholesky import planned_elimination
from ..linalg.solver import MOST_ENTRIES
from ..note import Note
from ..scene.obstacles import Plane
from ..scene.scene import Scene
from .contact import barrier_thickness
from .error import find_discretisation_error
from .method import FrameProgress
from .modal import constrained_inverse, find_load_factor
from .nonlinear import solve_nonlinear
from .result import LoadFactor, SagResult, StaticResult
from .statics import solve_static

logger = logging.getLogger(__name__)

# The linear law is enough up to this strain [1] and this rotation of a tet [rad], which makes half
# its square of strain, and where the next terms of the load change no displacement by more than
# this share of the largest: what is printed is good to a percent at best.
LINEAR_STRAIN, LINEAR_TURN, LINEAR_CHANGE = 0.05, 0.1, 0.01
# More than that where it is small beside what the mesh leaves: this share of it, at most so much.
OF_MESH, MOST_CHANGE = 1 / 3, 0.03
# Strain [1] at which these terms are differenced.
DIFFERENCED = 1e-2
# Unknowns up to which a body is followed beyond the linear law, and up to which it is relaxed where
# its path ends: tens and hundreds of factors. A path has thirty at least: of so many operations
# they are three minutes of a core.
FOLLOWED, RELAXED, FOLLOWED_OPERATIONS = 300_000, 15_000, 2e11
# CG's relative residual of those terms where no factor is affordable.
ROUGH = 1e-3


class StaticMethod:
    """Equilibrium as the load comes on slowly; pressures and torques follow their faces.

    Without a law: the linear one, and neo-Hookean where that strains or turns a body too far, or
    its stress changes its stiffness. A finite law that is asked for is followed at once, and
    ``Law.LINEAR`` never left.
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
        loads = scene.loads | {"device": device}
        solve = partial(solve_static, scene.mesh, scene.held, **loads)
        static = solve(order=order)
        error = find_discretisation_error(static, scene.held, solve, **loads).relative
        static = replace(static, cycle=None)  # and its memory
        why = None if law is None else Note("equilibrium.law_asked")
        if law is None:
            why = _beyond_linear(static, scene, error.value)
        elif not LAWS[law].finite:
            why = None
        factor, unmade, trusted = None, "", True
        if why is not None:
            static, trusted = _followed(scene, static, law or Law.NEO_HOOKEAN, why, warnings, loads)
        try:
            if static.order == 1:
                raise ConvergenceError("equilibrium.linear_elements")
            if why is None or not trusted:
                factor = find_load_factor(static, scene.held, traction=scene.tractions)
            elif static.path is None:  # by contact with the ground, it is not followed
                raise ConvergenceError("equilibrium.on_the_ground")
            elif np.isfinite(static.path.end):
                shape = static.path.softest()[: len(scene.mesh.points)]
                factor = LoadFactor(static.path.end, shape / np.abs(shape).max())
            else:
                factor = static.path.load_factor()
        except ConvergenceError as stopped:
            unmade = str(stopped)
        for warning in warnings:
            logger.warning(warning)
        largest = float(np.linalg.norm(static.displacement, axis=1).max())
        return SagResult(
            static,
            scene.height,
            largest,
            largest / scene.longest,
            error,
            np.asarray(scene.held.fixed.any(axis=1)),
            tuple(warnings),
            load_factor=factor,
            load_factor_unmade=unmade,
            trusted=trusted,
            assumed=scene.held.assumed,
        )


METHOD = StaticMethod()


def _beyond_linear(linear: StaticResult, scene: Scene, error: float) -> Note | None:
    """Why the ``linear`` rest, which the mesh leaves off by ``error``, is not enough; None: it is.

    Its rotation, its strain, and what the second and third order in the load add to it, K^-1 of the
    forces that the finite law makes of it: the ratio of K_sigma to K along the displacement is
    theirs, and what membranes and turned levers add.
    """
    u, mesh = linear.node_displacement, scene.mesh
    if not u.any():
        return None
    if linear.max_strain > LINEAR_STRAIN:
        value, limit = linear.max_strain, LINEAR_STRAIN
        return Note("equilibrium.linear_answer", max_strain=value, linear_limit=limit)
    body, space = linear.body, linear.space
    H = displacement_gradients(body.grid, u, CENTROID)[:, 0]
    turn = float(np.linalg.norm(H - H.transpose(0, 2, 1), axis=(1, 2)).max() / np.sqrt(8))
    if turn > LINEAR_TURN:
        return Note("equilibrium.linear_turns", turn=turn, limit=LINEAR_TURN)
    ground = _lowered(scene)
    if ground and not ground.distance(mesh.points + linear.displacement).gap.min() > 0:
        return Note("equilibrium.linear_answer_sinks")
    held, sizes = node_supports(scene.held, space), np.linalg.norm(u, axis=1)
    inverse = constrained_inverse(constrained_stiffness(body, held), space, held, rough=ROUGH)
    assert inverse is not None  # it may be rough
    solve = lambda force: inverse.solve(np.where(held.fixed, 0.0, -force))  # noqa: E731
    finite = ElasticBody(body.grid, body.material, Law.NEO_HOOKEAN)
    force = lambda x: finite.response(x).force  # noqa: E731
    e = DIFFERENCED / max(float(np.abs(H).max()), DIFFERENCED)
    second = solve((force(e * u) + force(-e * u)) / (2 * e**2))
    odd = (force(e * u + e**2 * second) - force(-e * u + e**2 * second)) / (2 * e)
    third = solve((odd - body.response(u).force) / e**2)
    change = np.abs(np.linalg.norm(u + second + third, axis=1) - sizes).max() / sizes.max()
    limit = float(np.clip(np.nan_to_num(error) * OF_MESH, LINEAR_CHANGE, MOST_CHANGE))
    if not change <= limit:
        return Note("equilibrium.linear_changes", limit=limit)
    return None


def _lowered(scene: Scene) -> Plane | None:
    """The ground, so low that it does not push the body yet."""
    if (ground := scene.ground) is None:
        return None
    normal = np.asarray(ground.normal, dtype=float)
    lowered = ground.point - barrier_thickness(scene.mesh) * normal / np.linalg.norm(normal)
    return replace(ground, point=tuple(lowered))


def _followed(
    scene: Scene,
    linear: StaticResult,
    law: str,
    why: Note,
    warnings: list[str],
    loads: dict[str, Any],
) -> tuple[StaticResult, bool]:
    """Rest under the finite ``law`` and whether to trust it; ``linear`` where none was found."""
    title, unknowns = LAWS[law].title, linear.node_displacement.size
    grid = discretise(scene.mesh, linear.order)
    plan = planned_elimination(grid.pattern, grid.space.edges)
    affordable = plan.entries <= MOST_ENTRIES and plan.operations <= FOLLOWED_OPERATIONS
    if unknowns > FOLLOWED or not affordable:
        warnings.append(Note("equilibrium.too_large", why=why, unknowns=unknowns))
        return linear, False
    relaxation = unknowns <= RELAXED
    solve = partial(solve_nonlinear, scene.mesh, scene.held, law=law, order=linear.order, **loads)
    try:
        static = solve(relaxation=relaxation)
        ground = _lowered(scene)
        if ground and not ground.distance(scene.mesh.points + static.displacement).gap.min() > 0:
            if static.path is not None and static.path.end < 1:
                raise ConvergenceError("equilibrium.falls_over", end=static.path.end)
            why = Note("equilibrium.linear_answer_sinks")
            static = solve(obstacles=(ground,), relaxation=relaxation)
    except ConvergenceError as error:
        warnings.append(Note("equilibrium.not_followed", why=why, title=title, error=error))
        return linear, False
    warnings.append(Note("equilibrium.repeated_law", why=why, title=title))
    if (path := static.path) is not None and path.end < 1:
        if path.turns:
            warnings.append(Note("equilibrium.snaps", end=path.end))
        else:
            warnings.append(Note("equilibrium.buckles", end=path.end))
    return static, True
