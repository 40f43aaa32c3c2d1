"""A body to pull on the page: its reduced model, how large and how slowly it is shown."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...fem.errors import ConvergenceError, InputError, UsageError
from ...fem.reduced.elasticity import ReducedElasticity
from ...fem.reduced.model import ReducedModel, Subspace
from ...fem.reduced.reduction import reduce_body
from ...fem.reduced.rest import reduced_frequencies
from ...fem.scene.scene import Scene
from ...fem.scene.up import up_vector

# What a page can step sixty times a second.
MOST_CELLS, MOST_DOFS = 250, 40
# The force [N] of a finger moves the softest place by this share of the diagonal, as it is shown.
FINGER, SHOWN = 10.0, 0.1
# The slowest vibration takes at least so long [s] on the page.
SLOWEST = 0.5


class TouchBody(NamedTuple):
    """A body to pull.

    ``magnification`` and ``slowness`` [1] are how many times larger and slower than it is it is
    shown; ``moved`` [m] is how far ``FINGER`` N move its softest place.
    """

    model: ReducedModel
    magnification: float
    slowness: float
    moved: float

    @property
    def words(self) -> str:
        """How it is shown, in words."""
        size = "as large as it is"
        if self.magnification > 1:
            size = f"magnified {self.magnification:,.0f} times"
        pace = "in its own time" if self.slowness == 1 else f"{self.slowness:,.0f} times slower"
        return f"Its motion is shown {size} and {pace}."


def touch_of(scene: Scene) -> TouchBody:
    """Body of ``scene`` as it is held, without its loads, to be pulled.

    Raises
    ------
    UsageError
        Where it cannot be, and why.
    """
    if not scene.held.fixed.any():
        raise UsageError("nothing holds it: there is nothing to pull at")
    mesh, down = scene.mesh, -9.81 * up_vector(scene.up)
    try:
        model = reduce_body(
            mesh, scene.held, gravity_vector=down, kind=Subspace.VECTOR, most_cells=MOST_CELLS
        )
    except (InputError, ConvergenceError) as error:
        raise UsageError(f"it has no reduced model: {error}") from error
    if model.dofs > MOST_DOFS or len(model.cells) > MOST_CELLS:
        raise UsageError(
            f"{model.dofs} coordinates and {len(model.cells)} cells are too many for a page"
        )
    return shown(model)


def shown(model: ReducedModel) -> TouchBody:
    """Magnification and pace at which a reader sees ``model`` give way and swing."""
    elasticity = ReducedElasticity(model)
    surface = model.basis[np.unique(model.faces)]
    K = elasticity.tangent(np.zeros(model.dofs))
    soft = np.einsum("nia,ab,njb->nij", surface, np.linalg.inv(K), surface, optimize=True)
    moved = FINGER * float(np.linalg.eigvalsh(soft)[:, -1].max())
    diagonal = float(np.linalg.norm(np.ptp(model.points[model.mass > 0], axis=0)))
    slow = SLOWEST * float(reduced_frequencies(elasticity)[0])
    return TouchBody(model, _plain(SHOWN * diagonal / moved), _plain(slow), moved)


def _plain(value: float) -> float:
    """Nearest 1, 2 or 5 times a power of ten, at least 1."""
    steps = np.array([1, 2, 5, 10]) * 10.0 ** np.floor(np.log10(max(value, 1.0)))
    return float(steps[np.argmin(np.abs(np.log(steps / max(value, 1.0))))])
