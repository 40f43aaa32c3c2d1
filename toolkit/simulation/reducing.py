"""The verbs reduce and match: a body in few coordinates, and its moduli after a motion."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...converters.reduced_archive import save_fits, save_reduced
from ...converters.spring_archive import save_springs
from ...fem.discrete.space import make_space
from ...fem.errors import InputError, UsageError
from ...fem.matching import MotionFit, ObservedMotion, fit_motion, fit_warnings
from ...fem.reduced.following import start_velocity, stated_forces
from ...fem.reduced.method import with_motion_error
from ...fem.reduced.model import ReducedModel
from ...fem.reduced.reduction import accuracy_warnings, measured
from ...fem.scene.mesh import TetMesh
from ...fem.scene.scene import Scene
from ...fem.solve.schemes import Scheme
from ...predictors.asset import UpAxis
from ..io.outputs import check_file
from ..io.sidecar import read_known
from ..options import SimulateOptions
from ..results.reduction import Match, Reduction, SpringMatch
from .conditions import changed_options
from .motion_reading import EvenMotion, read_motion
from .scenario import Progress, announce, frames_told, stated_scene
from .solvers import reduced_method
from .spring_matching import fitted_springs
from .what_if_table import answer_table


def reduce(
    mesh: str | Path | TetMesh,
    *,
    output: Path | None = None,
    runs: Path | None = None,
    up: UpAxis | None = None,
    options: SimulateOptions | None = None,
    **given: Any,
) -> Reduction:
    """Reduce a mesh with materials, held and loaded as the scenario says, and measure the model.

    Options may be ``given`` by name, as for ``simulate``; ``output`` is the .npz of the model.
    ``runs`` is a table (.csv) of what-if runs, see ``what_if_table``; their answers are written
    beside ``output``.
    """
    options = changed_options(options or SimulateOptions(), given)
    if options.solver not in ("fem", "lbs"):
        raise UsageError(f"reduce --solver {options.solver}: a reduced model is for --solver lbs")
    options = replace(options, solver="lbs")
    if output is not None:
        check_file(output, (".npz",))
    started = time.perf_counter()
    scene = _scene(mesh, options, up)
    model = reduced_method(options).model_of(scene, options.order)
    if scene.supports is not None and np.any(scene.gravity_vector):
        model = with_motion_error(model, scene)
        model = measured(model, scene.mesh, scene.held, scene.gravity_vector)
    if output is not None:
        save_reduced(output, model)
    files = [] if output is None else [output]
    table = None if runs is None else answer_table(runs, model, scene)
    if table is not None and output is not None:
        files.append(output.with_suffix(".what_if.csv"))
        table.write(files[-1])
    told = {"files": tuple(files), "assumed": scene.warnings, "table": table}
    return Reduction(model=model, seconds=time.perf_counter() - started, **told)


def match(
    mesh: str | Path | TetMesh,
    motion: Path,
    *,
    stiff: Path | None = None,
    output: Path | None = None,
    up: UpAxis | None = None,
    with_nu: bool = False,
    options: SimulateOptions | None = None,
    progress: Progress | None = None,
    **given: Any,
) -> Match | SpringMatch:
    """Fit the scale of E, and nu on request, of a reduced body to a motion of the same scene.

    Of springs it is the scale of their stiffness: ``solver`` is "lbs" or "spring".

    ``motion`` is a .pvd with displacements on the points of ``mesh``, as ``simulate`` writes. It is
    fitted by implicit Euler and by BDF2, one step a frame, and the nearer of the two is kept.
    ``stiff`` is another motion of the same scene, of a stiffer body: what lies between the two is
    then known (``--parameters-alpha``). ``output`` is the .npz of the parameters. ``progress`` is
    called with what the fit will take, and then with its stage and the seconds so far.
    """
    options = changed_options(options or SimulateOptions(), given)
    _check_options(options, stiff, with_nu=with_nu)
    if output is not None:
        check_file(output, (".npz",))
    started = time.perf_counter()
    scene = _scene(mesh, options, up)
    if scene.obstacles:
        raise UsageError(f"match: --scenario {options.scenario} has obstacles, wanted none")
    points = len(scene.mesh.points)
    motions = [read_motion(path, points) for path in (motion, stiff) if path is not None]
    files = () if output is None else (output,)
    if options.solver == "spring":
        told = {
            "announce": announce(progress, started),
            "progress": frames_told("fit", progress, started),
        }
        found, notes = fitted_springs(scene, motions, options, **told)
        _check_ends(found.stiffer)
        if output is not None:
            save_springs(output, found)
        told = {"files": files, "assumed": (*scene.warnings, *notes)}
        return SpringMatch(fit=found, seconds=time.perf_counter() - started, **told)
    if progress is not None:
        progress("reduced body", time.perf_counter() - started)
    model = reduced_method(options).model_of(scene, options.order)
    if progress is not None:
        progress("fit", time.perf_counter() - started)
    fits = [_fitted_moduli(scene, model, frames, with_nu=with_nu) for frames in motions]
    _check_ends(fits[-1].scale / fits[0].scale if len(fits) > 1 else np.nan)
    if output is not None:
        save_fits(output, fits)
    told = {"files": files, "seconds": time.perf_counter() - started}
    notes = [warning for fit in fits for warning in fit_warnings(fit)]
    warnings = (*scene.warnings, *accuracy_warnings(model), *notes)
    return Match(fit=fits[0], stiff=None if len(fits) < 2 else fits[1], assumed=warnings, **told)


def _check_options(options: SimulateOptions, stiff: Path | None, *, with_nu: bool) -> None:
    """Refuse what no fit does."""
    if options.solver not in ("lbs", "spring"):
        raise UsageError(
            f"match has nothing to fit of --solver {options.solver}: wanted --solver lbs or spring"
        )
    if options.parameters is not None:
        raise UsageError("match --parameters: it is what a match writes")
    springs = options.solver == "spring"
    if springs and with_nu:
        raise UsageError("match --with-nu: springs have nu = 1/4")
    if springs and stiff is not None and options.eta != SimulateOptions.eta:
        raise UsageError("match --to-stiff: eta goes from soft to stiff, leave --eta out")


def _fitted_moduli(
    scene: Scene, model: ReducedModel, frames: EvenMotion, *, with_nu: bool
) -> MotionFit:
    """Moduli of ``model`` after the motion of ``frames``, by the nearer of two schemes."""
    start = start_velocity(scene, make_space(scene.mesh, model.order))
    dead = model.pull_back(stated_forces(scene, model.order))
    observed = ObservedMotion(
        displacement=frames.displacement,
        dt=frames.dt,
        load=model.weight(scene.gravity_vector) + dead,
        velocity=model.coordinates(start),
    )
    fits = [
        fit_motion(model, observed, with_nu=with_nu, scheme=scheme)
        for scheme in (Scheme.IMPLICIT_EULER, Scheme.BDF2)
    ]
    return min(fits, key=lambda fit: fit.error)


def _check_ends(stiffer: float) -> None:
    """Refuse a stiff end that is so many times as stiff [1] as the soft one, less than once."""
    if stiffer < 1:
        raise InputError(
            f"the motion of --to-stiff is {stiffer:.3g} times as stiff as that of --to: wanted "
            "the softer one first"
        )


def _scene(mesh: str | Path | TetMesh, options: SimulateOptions, up: UpAxis | None) -> Scene:
    found, sidecar, *_ = read_known(mesh, None)
    if found.material is None:
        raise InputError("the mesh has no E, nu and rho: run `autophyx-tet assign` on it first")
    return stated_scene(found, options, up=up or sidecar.up)
