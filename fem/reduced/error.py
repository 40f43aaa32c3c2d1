"""How far a reduced motion is from the full body's, followed beside it a posteriori.

What the coordinates leave unbalanced is a force on the full mesh, r = M a + f(u) + S u - load. The
error e of the motion answers to it, M e'' + K e = -r, by the same steps, K the tangent about the
reduced motion, with that of the ground where it stands: dead forces would tip it over. One factor
serves as long as the body stays near where it was made: all frames of a stiff body. Exact for the
linear law, for others to the first order in e.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float

from ..cholesky.elimination import planned_elimination
from ..cholesky.factor import CholeskyFactor, NotPositive
from ..contact.barrier import Contact
from ..device import single_threaded
from ..discrete.assembly import Discretisation, discretise
from ..discrete.block_matrix import add_diagonal
from ..discrete.constraints import apply_supports, node_supports
from ..discrete.elastic import ElasticBody
from ..discrete.mass import lumped_mass
from ..errors import ConvergenceError
from ..linalg.solver import MOST_ENTRIES
from ..model_error import ModelError
from ..result import Motion
from ..scene.mesh import TetMesh, material_of
from ..scene.supports import Supports
from ..solve.schemes import Kinematics, Scheme, Step

# A tangent serves until a point has moved so far since, in shares of the body's longest side.
NEAR = 0.02
# And until obstacles press by so much more or less, in shares of their stiffness.
ALIKE = 0.5


@single_threaded
def missed_motion(
    mesh: TetMesh,
    supports: Supports | None,
    states: Sequence[Motion],
    *,
    load: Float[np.ndarray, "nodes 3"],
    velocity: Float[np.ndarray, "nodes 3"],
    law: str,
    scheme: Scheme = Scheme.BDF2,
    contact: Contact | None = None,
    order: int = 1,
) -> Float[np.ndarray, "frames nodes 3"] | None:
    """What a reduced motion lacks of the full body's [m], of every frame but the start.

    An estimate; None where the mesh is too large for a factor.

    Parameters
    ----------
    mesh, supports
        The full body.
    states
        Its reduced motion at equal times, the start first; their contact forces are taken as given.
    load, velocity
        Dead forces [N] and initial velocity [m/s] of the nodes.
    law, scheme, order
        Name of the elastic law, the time integration that made the motion, and its elements.
    contact
        The obstacles that it met.
    """
    full = _FullBody(mesh, supports, law, load, order, contact)
    if full.too_large or len(states) < 2:
        return None
    dt = states[1].time - states[0].time
    rest = np.zeros_like(load)
    late = np.where(full.fixed, 0.0, velocity - states[0].v)
    now, before = Kinematics(rest, late, full.per_mass(-full.unbalanced(states[0]))), None
    errors = []
    for state in states[1:]:
        step = Step.of(scheme, dt, now, before)
        inertia = step.factor * full.mass[:, None]
        push = np.where(full.fixed, 0.0, inertia * step.target - full.unbalanced(state))
        e = full.solve(step.factor, state, push)
        now, before = step.ended(e), now
        errors.append(e)
    return np.stack(errors)


def error_of(
    missed: Float[np.ndarray, "frames nodes 3"],
    states: Sequence[Motion],
    mass: Float[np.ndarray, "nodes"],
) -> ModelError:
    """Size of what was ``missed`` [m] by ``states``, the start first, with the ``mass`` [kg]."""
    moved = np.stack([state.u for state in states[1:]])
    size, wanted = (float(np.sqrt((mass[:, None] * x**2).sum())) for x in (missed, moved))
    largest = float(np.linalg.norm(missed, axis=2).max())
    return ModelError(size / wanted if wanted else 0.0, largest)


class _FullBody:
    """The full body: its forces, and (c M + K)^-1 about rest for every factor c [1/s^2]."""

    def __init__(
        self,
        mesh: TetMesh,
        supports: Supports | None,
        law: str,
        load: np.ndarray,
        order: int,
        contact: Contact | None,
    ) -> None:
        self.mesh, self.load = mesh, load
        self.contact = contact if contact is not None and contact.obstacles else None
        self.grid: Discretisation = discretise(mesh, order)
        self.mass = lumped_mass(mesh, self.grid.space)
        self.elastic = ElasticBody(self.grid, material_of(mesh), law)
        held = node_supports(supports or Supports.none(len(mesh.points)), self.grid.space)
        self.fixed, self.springs = held.fixed | (self.mass == 0)[:, None], held.springs
        self.reach = NEAR * float(np.ptp(mesh.bounds, axis=0).max())
        self.plan = planned_elimination(self.grid.pattern, self.grid.space.edges)
        self._about: np.ndarray | None = None
        self._factor, self._pressed = 0.0, np.zeros((1, 3, 3))

    @property
    def too_large(self) -> bool:
        return self.plan.entries > MOST_ENTRIES

    def unbalanced(self, state: Motion) -> Float[np.ndarray, "nodes 3"]:
        """Force [N] that the coordinates leave at the nodes that are free."""
        force = self.mass[:, None] * state.a + self.elastic.response(state.u).force
        force += self.springs * state.u - self.load - state.contact_force
        return np.where(self.fixed, 0.0, force)

    def per_mass(self, force: np.ndarray) -> np.ndarray:
        return force / np.where(self.mass > 0, self.mass, 1.0)[:, None]

    def solve(self, factor: float, state: Motion, b: np.ndarray) -> Float[np.ndarray, "nodes 3"]:
        """(c M + K)^-1 b for the ``factor`` c [1/s^2], K about a state near to ``state``."""
        u, ground = state.u, self._ground(state)
        near = self._about is not None and np.abs(u - self._about).max() <= self.reach
        changed = np.linalg.norm(ground - self._pressed)
        near = near and changed <= ALIKE * np.linalg.norm(self._pressed)
        if not near or factor != self._factor:
            self._about, self._factor, self._pressed = u, factor, ground
            self._inverse = self._factored(factor, u)
        return self._inverse(b)

    def _ground(self, state: Motion) -> np.ndarray:
        """Stiffness [N/m] of the obstacles at every point, which they have at ``state``."""
        if self.contact is None:
            return np.zeros((1, 3, 3))
        self.contact.begin(state.u, state.time, 1.0)
        return self.contact.hessian_blocks(state.u)[0]

    def _factored(self, factor: float, u: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        for projected in (False, True):
            matrix = self.elastic.tangent(u, projected=projected)
            if self.contact is not None:
                matrix = self.contact.with_hessian(u, matrix)
            add_diagonal(matrix, (factor * self.mass)[:, None, None] * np.eye(3))
            apply_supports(matrix, self.fixed, self.springs)
            try:
                return CholeskyFactor(matrix, self.plan).solve
            except NotPositive:
                continue
        raise ConvergenceError("the full body's stiffness about the reduced motion is not positive")
