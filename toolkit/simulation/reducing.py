"""The verbs reduce and match: a body in few coordinates, and its moduli after a motion."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...converters.mesh.pvd import read_pvd
from ...converters.reduced_archive import save_fit, save_reduced
from ...fem.errors import InputError, UsageError
from ...fem.matching import ObservedMotion, fit_motion
from ...fem.reduced.method import stated_forces
from ...fem.reduced.reduction import measured
from ...fem.scene.mesh import TetMesh
from ...fem.scene.scene import Scene
from ...fem.solve.schemes import Scheme
from ...predictors.asset import UpAxis
from ..io.outputs import check_file
from ..io.sidecar import read_known
from ..options import SimulateOptions
from ..results.reduction import Match, Reduction
from .conditions import changed_options
from .scenario import stated_scene
from .solvers import reduced_method

# Frames of a motion are at equal times to this share of their distance.
EVEN = 1e-3


def reduce(
    mesh: str | Path | TetMesh,
    *,
    output: Path | None = None,
    up: UpAxis | None = None,
    options: SimulateOptions | None = None,
    **given: Any,
) -> Reduction:
    """Reduce a mesh with materials, held and loaded as the scenario says, and measure the model.

    Options may be ``given`` by name, as for ``simulate``; ``output`` is the .npz of the model.
    """
    options = replace(changed_options(options or SimulateOptions(), given), solver="lbs")
    if output is not None:
        check_file(output, (".npz",))
    started = time.perf_counter()
    scene = _scene(mesh, options, up)
    model = reduced_method(options).model_of(scene)
    if scene.supports is not None and np.any(scene.gravity_vector):
        model = measured(model, scene.mesh, scene.held, scene.gravity_vector)
    if output is not None:
        save_reduced(output, model)
    files = () if output is None else (output,)
    seconds = time.perf_counter() - started
    return Reduction(model=model, seconds=seconds, files=files, assumed=scene.warnings)


def match(
    mesh: str | Path | TetMesh,
    motion: Path,
    *,
    output: Path | None = None,
    up: UpAxis | None = None,
    with_nu: bool = False,
    options: SimulateOptions | None = None,
    **given: Any,
) -> Match:
    """Fit the scale of E, and nu on request, of a reduced body to a motion of the same scene.

    ``motion`` is a .pvd with displacements on the points of ``mesh``, as ``simulate`` writes. It is
    fitted by implicit Euler and by BDF2, one step a frame, and the nearer of the two is kept.
    ``output`` is the .npz of the parameters.
    """
    options = changed_options(options or SimulateOptions(), given)
    if options.solver not in ("fem", "lbs"):
        raise UsageError(f"match --solver {options.solver}: wanted lbs")
    options = replace(options, solver="lbs")
    if output is not None:
        check_file(output, (".npz",))
    started = time.perf_counter()
    scene = _scene(mesh, options, up)
    if scene.obstacles:
        raise UsageError(f"match: --scenario {options.scenario} has obstacles, wanted none")
    frames = read_motion(motion, len(scene.mesh.points))
    model = reduced_method(options).model_of(scene)
    start = np.broadcast_to(np.asarray(scene.velocity, dtype=float), model.points.shape)
    observed = ObservedMotion(
        displacement=frames.displacement,
        dt=frames.dt,
        load=model.weight(scene.gravity_vector) + model.pull_back(stated_forces(scene)),
        velocity=model.coordinates(start),
    )
    fits = [
        fit_motion(model, observed, with_nu=with_nu, scheme=scheme)
        for scheme in (Scheme.IMPLICIT_EULER, Scheme.BDF2)
    ]
    fit = min(fits, key=lambda fit: fit.error)
    if output is not None:
        save_fit(output, fit)
    files = () if output is None else (output,)
    seconds = time.perf_counter() - started
    return Match(fit=fit, seconds=seconds, files=files, assumed=scene.warnings)


class EvenMotion(NamedTuple):
    """Displacement (frames, points, 3) [m] every ``dt`` [s]."""

    displacement: np.ndarray
    dt: float


def read_motion(path: Path, points: int) -> EvenMotion:
    """Displacements of a .pvd at equal times; ``InputError`` where they are none or uneven."""
    times, frames = [], []
    for moment, data in read_pvd(path):
        u = data.point_data.get("displacement")
        if u is None or u.shape != (points, 3):
            raise InputError(
                f"{path}: frame {len(frames)} has no displacement of {points} points: wanted a "
                "motion of this mesh, as `simulate -o MOTION.pvd` writes"
            )
        times.append(moment)
        frames.append(np.asarray(u, dtype=float))
    steps = np.diff(times)
    if len(steps) < 2 or not np.ptp(steps) <= EVEN * steps.mean():
        raise InputError(f"{path}: {len(times)} frames: wanted three or more at equal times")
    return EvenMotion(np.stack(frames), float(steps.mean()))


def _scene(mesh: str | Path | TetMesh, options: SimulateOptions, up: UpAxis | None) -> Scene:
    found, sidecar, *_ = read_known(mesh, None)
    if found.material is None:
        raise InputError("the mesh has no E, nu and rho: run `autophyx-tet assign` on it first")
    return stated_scene(found, options, up=up or sidecar.up)
