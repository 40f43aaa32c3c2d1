"""Reduced bodies as a method of the scene: its motion in a few coordinates."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..errors import UsageError
from ..laws.law import Law
from ..note import Note
from ..scene.scene import Scene
from ..solve.method import FrameProgress, halving_notes
from ..solve.result import MOTION_LIMIT, MotionResult, locking_fraction
from ..solve.schemes import Scheme
from ..validation import checked_count, checked_positive
from .basis import CELLS, HANDLES, accuracy_warnings, reduce_body
from .elasticity import reduced_frequencies
from .model import ReducedModel, Subspace
from .motion import ROUNDS, Following, impact_of, reduced_dynamics

# Derived fields that a motion has: with 21 a bonsai's swings were 4.4 % off, with 36 1.3 %.
DERIVED_IN_MOTION = 45
# The motion that a model is measured by: so many of its slowest periods, in so many steps each.
PERIODS, PER_PERIOD = 2, 30


@dataclass(frozen=True, kw_only=True)
class ReducedMethod:
    """Motion of a scene by a reduced body.

    kind: What the coordinates move: fields of vectors, of a free body their components, or handles.
    handles: Handles of a skinned body.
    most_cells: Most tets that the elastic energy is summed over; 0: all.
    scale, nu: What E is multiplied by [1], and Poisson's ratio [1] in place of the body's own:
        fitted.
    rounds: How often at most a motion that is off is followed again, with more coordinates.
    rough: Whether the motion is checked roughly, in a quarter of the time.
    announce: Hears of the model, in words, before the motion.
    """

    kind: Subspace = Subspace.VECTOR
    handles: int = HANDLES
    most_cells: int = CELLS[-1]
    scale: float = 1.0
    nu: float | None = None
    rounds: int = ROUNDS
    rough: bool = False
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

        Raises UsageError: Where a GPU is asked for.
        """
        if device != "cpu":
            raise UsageError("method.reduced_body")
        frames = checked_count("frames", scene.frames)
        dt = checked_positive("duration", scene.duration, "s") / frames
        model = self.model_of(scene, order)
        if self.announce is not None:
            self.announce(model_in_words(model))
        fitted = self.scale != 1 or self.nu is not None
        followed = Following(
            dt=dt,
            frames=frames,
            law=law or Law.NEO_HOOKEAN,
            scheme=scheme,
            most_cells=self.most_cells,
            rounds=0 if fitted else self.rounds,
            rough=self.rough,
            announce=self.announce,
            progress=progress,
        ).of(scene, model)
        model, solution = followed.model, [("reduced model", model_in_words(followed.model))]
        if followed.before:
            before = ", then by ".join(f"{100 * error:.2g} %" for error in followed.before)
            again = Note("method.motion_before", before=before)
            solution.append(("followed again", again))
        notes, error = [*accuracy_warnings(model)], followed.error
        if error is None:
            notes.append(Note("method.how_far"))
        elif not error.share <= MOTION_LIMIT:
            notes.append(Note("method.reduced_motion", words=error.words))
        notes += halving_notes(followed.halved, frames)
        if scene.obstacles:
            notes.append(Note("method.coordinates_follow", dofs=model.dofs))
        return MotionResult(
            followed.states,
            dt,
            len(scene.mesh.points),
            model.order,
            locking_fraction(scene.mesh) if model.order == 1 else 0.0,
            notes=tuple(notes),
            solution=tuple(solution),
            model_error=error,
            stiffening=model.accuracy.stiffening,
            impact=impact_of(followed.states) if scene.obstacles else None,
        )

    def model_of(self, scene: Scene, order: int | None = None) -> ReducedModel:
        """Reduced model of the body as the ``scene`` holds it; see ``reduce_body``."""
        if self.kind is Subspace.VECTOR and self.handles != HANDLES:
            raise UsageError("method.fields_vectors_handles")
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


def with_motion_error(model: ReducedModel, scene: Scene) -> ReducedModel:
    """The model, with the error of a motion: the held body let go in the scene.

    Where that is off, coordinates of what it missed join it.
    """
    loose = replace(scene, obstacles=())
    body = reduced_dynamics(loose, model, law=Law.NEO_HOOKEAN)
    if not body.load.any() and not body.now.v.any():
        return model
    period = 1 / float(reduced_frequencies(body.elasticity)[0])
    followed = Following(dt=period / PER_PERIOD, frames=PERIODS * PER_PERIOD).of(loose, model)
    error = np.nan if followed.error is None else followed.error.share
    return replace(followed.model, accuracy=followed.model.accuracy._replace(motion=error))


def model_in_words(model: ReducedModel) -> str:
    """Kind, coordinates, cells and lowest frequency of a model, in a line."""
    basis = (
        Note("method.functions_along")
        if model.kind is Subspace.SKINNING
        else Note("method.fields_vectors")
    )
    of = "linear" if np.isnan(model.accuracy.stiffening) else "quadratic"
    return Note(
        "method.coordinates_cells",
        dofs=model.dofs,
        basis=basis,
        count=len(model.cells),
        best_frequency=model.accuracy.best_frequency,
        of=of,
    )
