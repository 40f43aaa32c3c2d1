"""The verb match for springs: the scale of k after a motion of the same scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ...fem.model_error import too_coarse
from ...fem.scene.scene import Scene
from ...fem.solve.discretisation_error import linear_stiffening, motion_order
from ...fem.solve.modal import natural_modes
from ...fem.springs.body import spring_body
from ...fem.springs.fit import SpringFit, fit_both_ends, fit_to_motion, spring_warnings
from ..options import SimulateOptions
from .motion_reading import EvenMotion


def fitted_springs(
    scene: Scene, motions: Sequence[EvenMotion], options: SimulateOptions, **told: Any
) -> tuple[SpringFit, tuple[str, ...]]:
    """Fit of the network of ``options`` to a motion, or to a soft and a stiff one.

    And what it does not know of the body. The fit is ``told`` of, as ``fit_to_motion`` does.
    The frequency that it is compared with is that of the elements which motions are made with.
    """
    body = spring_body(scene, options.anchors, options.neighbours)
    order = motion_order(scene.mesh)
    modes = natural_modes(scene.mesh, 1, supports=scene.supports, order=order)
    frequency = float(modes.frequencies[0])
    one, *others = motions
    if others:
        (soft, dt), (stiff, stiff_dt) = one, others[0]
        fit = fit_both_ends(body, soft, stiff, (dt, stiff_dt), frequency=frequency, **told)
    else:
        u, dt = one
        fit = fit_to_motion(body, u, dt, eta=options.eta, frequency=frequency, **told)
    coarse = too_coarse(linear_stiffening(scene.mesh, scene.supports)) if order == 1 else None
    notes = () if coarse is None else (f"the frequency it is compared with is too high: {coarse}",)
    return fit, (*notes, *body.notes, *spring_warnings(fit))
