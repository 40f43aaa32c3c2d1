"""What if: one body under many loads and moduli, by its reduced model."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ..device import single_threaded
from ..errors import ConvergenceError, InputError
from ..laws.law import Law
from ..scene.mesh import TetMesh, material_of
from ..scene.supports import Supports
from ..solve.modal import natural_modes
from ..solve.nonlinear import solve_nonlinear
from .elasticity import ReducedElasticity
from .model import ReducedModel
from .reduction import relative_error
from .rest import reduced_frequencies, reduced_rest

# Where a load is too much for Newton's method at once it comes on in so many steps.
LOAD_STEPS = 4


class WhatIf(NamedTuple):
    """Answers of every run.

    ``coordinates`` (runs, dofs) [m sqrt(kg)] at rest, ``largest`` (runs,) displacement of a point
    [m], ``frequency`` (runs,) the first one about the unloaded body [Hz]. NaN: no rest was found.
    """

    coordinates: np.ndarray
    largest: np.ndarray
    frequency: np.ndarray


class WhatIfError(NamedTuple):
    """Reduced runs beside the full body's, for those ``runs`` that were solved in full too.

    Relative errors [1] of the displacement at ``rest``, in the norm of mass, and of the first
    ``frequency``, each (runs,).
    """

    runs: np.ndarray
    rest: np.ndarray
    frequency: np.ndarray


@single_threaded
def what_if(
    model: ReducedModel,
    *,
    scales: Float[np.ndarray, "runs parts"],
    loads: Float[np.ndarray, "runs dofs"],
    law: str = Law.NEO_HOOKEAN,
) -> WhatIf:
    """Rest and first frequency of a body in many runs.

    Parameters
    ----------
    model
        Reduced model of the body as it is held.
    scales
        Factor [1] to E of every part, in the order of ``model.region_names``.
    loads
        Dead forces on the coordinates [N/sqrt(kg)]; see ``ReducedModel.weight`` and ``pull_back``.
    law
        Name of the elastic law.
    """
    wanted = f"wanted a positive number for each of {len(model.region_names)} part(s)"
    if scales.shape != (len(loads), len(model.region_names)):
        raise InputError(f"scales {scales.shape} of {len(loads)} runs: {wanted}")
    if (wrong := np.argwhere(~(scales > 0))).size:
        run, part = wrong[0]
        raise InputError(
            f"run {run + 1}: factor {scales[run, part]:g} of {model.region_names[part]!r}: {wanted}"
        )
    elasticity = ReducedElasticity(model, law)
    found = np.full(loads.shape, np.nan)
    frequency = np.empty(len(loads))
    for run, (scale, load) in enumerate(zip(scales, loads, strict=True)):
        elasticity.set_moduli(model.E * scale[model.region], model.nu)
        frequency[run] = reduced_frequencies(elasticity)[0]
        try:
            found[run] = _rest_in_steps(elasticity, load)
        except ConvergenceError:
            continue
    largest = np.array([np.linalg.norm(model.displacement(q), axis=1).max() for q in found])
    return WhatIf(found, largest, frequency)


def _rest_in_steps(elasticity: ReducedElasticity, load: np.ndarray) -> np.ndarray:
    try:
        return reduced_rest(elasticity, load, tolerance=1e-6).u
    except ConvergenceError:
        q = np.zeros_like(load)
        for share in np.arange(1, LOAD_STEPS + 1) / LOAD_STEPS:
            q = reduced_rest(elasticity, share * load, start=q, tolerance=1e-6).u
        return q


def what_if_error(
    model: ReducedModel,
    found: WhatIf,
    mesh: TetMesh,
    supports: Supports,
    *,
    scales: Float[np.ndarray, "runs parts"],
    forces: Callable[[int], Float[np.ndarray, "nodes 3"]],
    count: int = 4,
    order: int = 1,
    seed: int = 0,
    law: str = Law.NEO_HOOKEAN,
) -> WhatIfError:
    """Solve ``count`` runs, the one that moves farthest among them, by the full body too.

    It has elements of ``order``, at least the model's: with 2 what linear ones lock is in the
    error. ``forces`` gives what the load of a run was pulled back from: [N] at the model's nodes.

    Raises
    ------
    ConvergenceError
        Where no run has a rest, or the full body finds none.
    """
    if not np.isfinite(found.largest).any():
        raise ConvergenceError(f"none of {len(found.largest)} runs has a rest: wanted less load")
    farthest = int(np.nanargmax(found.largest))
    others = np.setdiff1d(np.flatnonzero(np.isfinite(found.largest)), [farthest])
    drawn = np.random.default_rng(seed).permutation(others)[: count - 1]
    runs = np.array([farthest, *drawn])
    rest, frequency = np.empty(len(runs)), np.empty(len(runs))
    for i, run in enumerate(runs):
        material = material_of(mesh)
        moduli = type(material)(material.E * scales[run][mesh.region], material.nu, material.rho)
        body = mesh.with_material(moduli)
        known = {"forces": forces(int(run)), "law": law, "order": order}
        full = solve_nonlinear(body, supports, **known).node_displacement[: len(model.points)]
        rest[i] = relative_error(model, model.displacement(found.coordinates[run]), full)
        modes = natural_modes(body, 1, supports=supports, order=order, lumped=order == 1)
        frequency[i] = found.frequency[run] / modes.frequencies[0] - 1
    return WhatIfError(runs, rest, frequency)
