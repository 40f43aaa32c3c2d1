"""Reduced bodies as a method of the scene: its motion in a few coordinates."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from ..contact.barrier import Contact
from ..device import one_thread
from ..discrete.assembly import discretise
from ..discrete.forces import load_vector
from ..discrete.space import Space, extend_linear, make_space
from ..errors import UsageError
from ..laws.law import Law
from ..model_error import MOTION_LIMIT, ModelError
from ..result import Motion, MotionResult, locking_share
from ..scene.scene import Scene
from ..solve.method import FrameProgress, halving_notes
from ..solve.schemes import Scheme
from ..validation import checked_count, checked_positive
from .error import motion_error
from .model import ReducedModel, Subspace
from .reduction import CELLS, accuracy_warnings, reduce_body
from .rest import reduced_frequencies
from .skinning import HANDLES
from .step import ReducedDynamics

# Derived fields that a motion has: with 21 a bonsai's swings were 4.4 % off, with 36 1.3 %.
DERIVED_IN_MOTION = 45
# The motion that a model is measured by: so many of its slowest periods, in so many steps each.
PERIODS, PER_PERIOD = 2, 30


@dataclass(frozen=True, kw_only=True)
class ReducedMethod:
    """Motion of a scene by a reduced body.

    Parameters
    ----------
    kind
        What the coordinates move: fields of vectors, of a free body their components, or handles.
    handles
        Handles of a skinned body.
    most_cells
        Most tets that the elastic energy is summed over; 0: all.
    scale, nu
        What E is multiplied by [1], and Poisson's ratio [1] in place of the body's own: fitted.
    announce
        Hears of the model, in words, before the motion.
    """

    kind: Subspace = Subspace.VECTOR
    handles: int = HANDLES
    most_cells: int = CELLS[-1]
    scale: float = 1.0
    nu: float | None = None
    announce: Callable[[str], None] | None = None

    laws: tuple[str, ...] = ()

    def solve(
        self,
        scene: Scene,
        *,
        law: str | None = None,
        order: int | None = None,
        device: str = "cpu",
        progress: FrameProgress | None = None,
        scheme: Scheme = Scheme.BDF2,
    ) -> MotionResult:
        """Follow the scene for its duration, one step of ``scheme`` a frame.

        Raises
        ------
        UsageError
            Where a GPU is asked for.
        """
        if device != "cpu":
            raise UsageError("a reduced body moves on the CPU: leave the device out")
        frames = checked_count("frames", scene.frames)
        dt = checked_positive("duration", scene.duration, "s") / frames
        model = self.model_of(scene, order)
        if self.announce is not None:
            self.announce(model_in_words(model))
        law = law or Law.NEO_HOOKEAN
        body = reduced_dynamics(scene, model, law=law, scheme=scheme)
        states, halved = [body.state], 0
        for frame in range(1, frames + 1):
            states.append(body.step(dt))
            halved += body.last_dt != dt
            if progress is not None:
                progress(frame, frames)
        error = scene_error(scene, model, states, law=law, scheme=scheme)
        return MotionResult(
            tuple(states),
            dt,
            len(scene.mesh.points),
            model.order,
            locking_share(scene.mesh) if model.order == 1 else 0.0,
            notes=(
                *accuracy_warnings(model),
                *error_notes(error),
                *halving_notes(halved, frames),
                *_dents(scene, model),
            ),
            solution=(("reduced model", model_in_words(model)),),
            model_error=error,
            stiffening=model.accuracy.stiffening,
        )

    def model_of(self, scene: Scene, order: int | None = None) -> ReducedModel:
        """Reduced model of the body as the ``scene`` holds it; see ``reduce_body``."""
        if self.kind is Subspace.VECTOR and self.handles != HANDLES:
            raise UsageError("fields of vectors have no handles: leave them out, or take skinning")
        model = reduce_body(
            scene.mesh,
            scene.supports,
            gravity_vector=scene.gravity_vector,
            traction=scene.tractions,
            forces=scene.forces,
            order=order,
            kind=self.kind,
            derived=DERIVED_IN_MOTION,
            handles=self.handles,
            most_cells=self.most_cells,
        )
        nu = None if self.nu is None else np.full_like(model.nu, self.nu)
        return model.with_moduli(self.scale * model.E, nu)


METHOD = ReducedMethod()


def reduced_dynamics(
    scene: Scene, model: ReducedModel, *, law: str, scheme: Scheme = Scheme.BDF2
) -> ReducedDynamics:
    """The body of ``scene`` at its start, moved by ``model``."""
    space, dead = make_space(scene.mesh, model.order), stated_forces(scene, model.order)
    with one_thread():
        return ReducedDynamics(
            model,
            load=model.weight(scene.gravity_vector) + model.pull_back(dead),
            velocity=model.coordinates(start_velocity(scene, space)),
            contact=_contact_of(scene, space),
            law=law,
            scheme=scheme,
        )


def _contact_of(scene: Scene, space: Space) -> Contact:
    """The obstacles of ``scene`` against the nodes of the body."""
    return Contact(scene.mesh, space, scene.obstacles, scene.friction)


def scene_error(
    scene: Scene,
    model: ReducedModel,
    states: Sequence[Motion],
    *,
    law: str,
    scheme: Scheme = Scheme.BDF2,
) -> ModelError | None:
    """How far a motion of ``scene`` by ``model`` is from the full body's; see ``motion_error``."""
    weight = model.mass[:, None] * np.asarray(scene.gravity_vector)
    space = make_space(scene.mesh, model.order)
    return motion_error(
        scene.mesh,
        scene.supports,
        states,
        load=weight + stated_forces(scene, model.order),
        velocity=start_velocity(scene, space),
        law=law,
        scheme=scheme,
        order=model.order,
        contact=_contact_of(scene, space),
    )


def error_notes(error: ModelError | None) -> tuple[str, ...]:
    """Say that a motion is not the full body's, or that this was not measured."""
    if error is None:
        return ("how far the motion is from the full body's is not known: the mesh is too large",)
    if not error.share <= MOTION_LIMIT:
        return (f"the reduced motion is not the full body's: off by {error.words}",)
    return ()


def with_motion_error(model: ReducedModel, scene: Scene) -> ReducedModel:
    """The same model with the error of a motion: the held body let go in the scene."""
    body = reduced_dynamics(replace(scene, obstacles=()), model, law=Law.NEO_HOOKEAN)
    if not body.load.any() and not body.now.v.any():
        return model
    period = 1 / float(reduced_frequencies(body.elasticity)[0])
    states = [body.state, *(body.step(period / PER_PERIOD) for _ in range(PERIODS * PER_PERIOD))]
    error = scene_error(scene, model, states, law=Law.NEO_HOOKEAN)
    share = np.nan if error is None else error.share
    return replace(model, accuracy=model.accuracy._replace(motion=share))


def start_velocity(scene: Scene, space: Space) -> Float[np.ndarray, "nodes 3"]:
    """Velocity [m/s] of the nodes that the scene starts with."""
    given = np.asarray(scene.velocity, dtype=float)
    at_points = np.broadcast_to(given, scene.mesh.points.shape)
    return extend_linear(space, at_points)


def stated_forces(scene: Scene, order: int) -> Float[np.ndarray, "nodes 3"]:
    """Forces [N] at the nodes of elements of ``order``, of all that acts but gravity."""
    grid = discretise(scene.mesh, order)
    return load_vector(scene.mesh, grid, traction=scene.tractions, forces=scene.forces)


def model_in_words(model: ReducedModel) -> str:
    """Kind, coordinates, cells and lowest frequency of a model, in a line."""
    basis = "functions along three axes" if model.kind is Subspace.SKINNING else "fields of vectors"
    of = "linear" if np.isnan(model.accuracy.stiffening) else "quadratic"
    return (
        f"{model.dofs} coordinates of {basis}, {len(model.cells):,} cells; lowest frequency "
        f"{model.accuracy.best_frequency:.3f} of the full body's with {of} elements"
    )


def _dents(scene: Scene, model: ReducedModel) -> tuple[str, ...]:
    """Say that what an obstacle does to a small place is not followed."""
    if not scene.obstacles:
        return ()
    return (
        f"{model.dofs} coordinates follow how the body bends as a whole, not the dents that "
        "obstacles make",
    )
