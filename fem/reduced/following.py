"""A scene followed by a reduced body, and again in fields of what the first motion missed.

A basis is made before any motion, of vibrations and of how they bend on. What it lacks is small and
stiff, and is not known before; the error that is estimated beside a motion is an answer of the full
body to what the coordinates leave unbalanced, so that it lies where they lack. Its principal
components join them. Of the linear law all of it is the full body's motion.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ..contact.barrier import Contact
from ..device import one_thread, single_threaded
from ..discrete.assembly import discretise
from ..discrete.forces import load_vector
from ..discrete.space import Space, extend_linear, make_space
from ..laws.law import Law
from ..model_error import MOTION_LIMIT, ModelError
from ..result import Motion
from ..scene.scene import Scene
from ..solve.method import FrameProgress
from ..solve.schemes import Scheme
from .cubature import CELLS
from .error import error_of, missed_motion
from .model import ReducedModel, Subspace
from .reduction import on_few_cells, whole_model
from .step import ReducedDynamics
from .subspace import linear_body, orthonormal_fields, principal_fields

# A motion that is off by more than the limit is followed again so often, with so many fields more:
# the swing of a soft bonsai in 34 coordinates is 26 % off, in 46 then 8, in 58 2 %.
ROUNDS, JOINING = 2, 12


class Followed(NamedTuple):
    """A motion, the model that made it, its error (None: not known), and steps halved.

    ``before`` are the errors [1] of the motions that were given up for it.
    """

    model: ReducedModel
    states: tuple[Motion, ...]
    error: ModelError | None
    halved: int
    before: tuple[float, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Following:
    """How a scene is followed: by intervals of ``dt`` [s], a law and a scheme.

    ``rounds`` are how often at most it is followed again, ``most_cells`` those of the models of
    these (0: all). ``announce`` hears of each before, in words.
    """

    dt: float
    frames: int
    law: str = Law.NEO_HOOKEAN
    scheme: Scheme = Scheme.BDF2
    most_cells: int = CELLS[-1]
    rounds: int = ROUNDS
    announce: Callable[[str], None] | None = None
    progress: FrameProgress | None = None

    def of(self, scene: Scene, model: ReducedModel) -> Followed:
        """The motion of ``scene`` by ``model``, or by what it is made of what that missed."""
        found, missed = self._once(scene, model)
        for _ in range(self.rounds):
            error = found.error
            if missed is None or error is None or error.share <= MOTION_LIMIT:
                break
            if model.kind is not Subspace.VECTOR:
                break
            if self.announce is not None:
                self.announce(f"off by {error.words}: once more, with {JOINING} coordinates more")
            wider = enriched(found.model, scene, missed, most_cells=self.most_cells)
            again, missed = self._once(scene, wider)
            if again.error is None or again.error.share >= error.share:
                break
            found = again._replace(before=(*found.before, error.share))
        return found

    def _once(self, scene: Scene, model: ReducedModel) -> tuple[Followed, np.ndarray | None]:
        """The motion by ``model``, and what it missed (frames, nodes, 3) [m]."""
        body = reduced_dynamics(scene, model, law=self.law, scheme=self.scheme)
        states, halved = [body.state], 0
        for frame in range(1, self.frames + 1):
            states.append(body.step(self.dt))
            halved += body.last_dt != self.dt
            if self.progress is not None:
                self.progress(frame, self.frames)
        space = make_space(scene.mesh, model.order)
        missed = missed_motion(
            scene.mesh,
            scene.supports,
            states,
            load=_acting(scene, model),
            velocity=start_velocity(scene, space),
            law=self.law,
            scheme=self.scheme,
            order=model.order,
            contact=_contact_of(scene, space),
        )
        error = None if missed is None else error_of(missed, states, model.mass)
        return Followed(model, tuple(states), error, halved), missed


@single_threaded
def enriched(
    model: ReducedModel,
    scene: Scene,
    missed: Float[np.ndarray, "frames nodes 3"],
    *,
    joining: int = JOINING,
    most_cells: int = CELLS[-1],
) -> ReducedModel:
    """Model of the held body of ``scene``, with principal components of what a motion ``missed``.

    These [m] join its fields. Cells are chosen anew, and accepted by the scene's forces.
    """
    body = linear_body(scene.mesh, scene.supports, order=model.order)
    joined = principal_fields(np.moveaxis(missed, 0, 2), model.basis, model.mass, joining)
    basis = orthonormal_fields(np.concatenate([model.basis, joined], axis=2), model.mass)
    whole = whole_model(body, basis, Subspace.VECTOR)
    stiffening = model.accuracy.stiffening
    return on_few_cells(whole, _acting(scene, model), most_cells, stiffening=stiffening)


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


def start_velocity(scene: Scene, space: Space) -> Float[np.ndarray, "nodes 3"]:
    """Velocity [m/s] of the nodes that the scene starts with."""
    given = np.asarray(scene.velocity, dtype=float)
    at_points = np.broadcast_to(given, scene.mesh.points.shape)
    return extend_linear(space, at_points)


def stated_forces(scene: Scene, order: int) -> Float[np.ndarray, "nodes 3"]:
    """Forces [N] at the nodes of elements of ``order``, of all that acts but gravity."""
    grid = discretise(scene.mesh, order)
    return load_vector(scene.mesh, grid, traction=scene.tractions, forces=scene.forces)


def _acting(scene: Scene, model: ReducedModel) -> Float[np.ndarray, "nodes 3"]:
    """All dead forces [N] at the nodes."""
    weight = model.mass[:, None] * np.asarray(scene.gravity_vector)
    return weight + stated_forces(scene, model.order)


def _contact_of(scene: Scene, space: Space) -> Contact:
    """The obstacles of ``scene`` against the nodes of the body."""
    return Contact(scene.mesh, space, scene.obstacles, scene.friction, scene.thickness)
