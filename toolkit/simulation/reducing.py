"""The verbs reduce and match, and their answers: a body in few coordinates, moduli of a motion."""

from __future__ import annotations

import csv
import math
import time
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ...converters.archives import save_fits, save_reduced, save_springs
from ...converters.mesh.vtk import read_pvd
from ...fem.elements.space import LARGEST_MOVING, affordable_order, make_space
from ...fem.errors import InputError, UsageError
from ...fem.identify import MotionFit, ObservedMotion, fit_motion, fit_warnings
from ...fem.mesh import TetMesh
from ...fem.note import Note
from ...fem.reduced.basis import accuracy_warnings, measured
from ...fem.reduced.model import ReducedModel
from ...fem.reduced.motion import model_in_words, nodal_forces_of, start_velocity, with_motion_error
from ...fem.reduced.sweep import WhatIf, WhatIfError, what_if, what_if_error
from ...fem.scene.scene import Scene
from ...fem.solve.error import linear_stiffening, motion_order
from ...fem.solve.modal import natural_modes
from ...fem.solve.result import MOTION_LIMIT, too_coarse
from ...fem.solve.schemes import Scheme
from ...fem.springs.body import spring_body
from ...fem.springs.fit import SpringFit, fit_both_ends, fit_to_motion, spring_warnings
from ...predictors.asset import UpAxis
from ..asset import path_of
from ..asset.document import check_file, read_known
from ..options import SimulateOptions
from .scenario import (
    Progress,
    announce,
    changed_options,
    frames_told,
    reduced_method,
    scene_of_options,
)


@dataclass(frozen=True, kw_only=True, eq=False)
class FewNumbers(ABC):
    """An answer of `reduce` or `match`: ``seconds`` it took, ``files``, what was ``assumed``."""

    seconds: float
    files: tuple[Path, ...] = ()
    assumed: tuple[str, ...] = ()

    # Name of the answer in the document.
    verb: ClassVar[str]

    @property
    @abstractmethod
    def summary(self) -> str:
        """The answer in a line."""

    @property
    @abstractmethod
    def numbers(self) -> dict[str, Any]:
        """What the document says beside the summary."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was assumed, and what is not as it should be."""
        return self.assumed

    def document(self) -> dict[str, Any]:
        """Return what ``--json`` prints."""
        return {
            "files": self.files,
            self.verb: {"summary": self.summary, **self.numbers},
            "seconds": self.seconds,
            "warnings": self.warnings,
        }


class WhatIfTable(NamedTuple):
    """Runs of a table: ``header`` and ``rows`` of numbers, their answers, and how long they took.

    ``error`` is of the runs that the full body solved too, ``seconds`` without these.
    """

    header: tuple[str, ...]
    rows: np.ndarray
    found: WhatIf
    error: WhatIfError
    seconds: float

    @property
    def summary(self) -> str:
        """Runs, time and errors in a line."""
        errors = (self.error.rest, self.error.frequency)
        rest, tone = (float(np.abs(e).max(initial=0.0)) for e in errors)
        count = {"runs": len(self.rows), "compared": len(self.error.runs)}
        return Note("reduction.runs", **count, seconds=self.seconds, rest=rest, tone=tone)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Runs without an answer, and errors beyond the limit."""
        found: list[str] = []
        if count := self.numbers["without_rest"]:
            found.append(Note("reduction.without_rest", count=count, runs=len(self.rows)))
        if count := self.error.unsolved:
            found.append(Note("reduction.unsolved", count=count))
        errors = (self.error.rest, self.error.frequency)
        if max(np.abs(e).max(initial=0.0) for e in errors) > MOTION_LIMIT:
            found.append(Note("reduction.strays", summary=self.summary))
        return tuple(found)

    @property
    def numbers(self) -> dict[str, Any]:
        """Counts, time and errors."""
        return {
            "runs": len(self.rows),
            "without_rest": int(np.isnan(self.found.largest).sum()),
            "seconds": self.seconds,
            "compared": self.error.runs,
            "rest_error": self.error.rest,
            "frequency_error": self.error.frequency,
            "unsolved": self.error.unsolved,
        }

    def write(self, path: Path) -> None:
        """Write the table with its answers, ``max_displacement_m`` and ``first_frequency_Hz``."""
        with path.open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow([*self.header, "max_displacement_m", "first_frequency_Hz"])
            answers = zip(self.rows, self.found.largest, self.found.frequency, strict=True)
            for row, u, f in answers:
                writer.writerow([*row, "" if np.isnan(u) else u, f])


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Reduction(FewNumbers):
    """A reduced ``model``, and the ``table`` of what-if runs that it answered."""

    model: ReducedModel
    table: WhatIfTable | None = None

    verb = "reduced"

    @property
    def summary(self) -> str:
        """Kind, coordinates, cells and errors, and of a table its runs, in a line."""
        runs = "" if self.table is None else f"; {self.table.summary}"
        return model_in_words(self.model) + runs

    @property
    def numbers(self) -> dict[str, Any]:
        """Kind, size and accuracy; of a table counts, times and errors."""
        model, table = self.model, self.table
        return {
            "kind": model.kind.value,
            "dofs": model.dofs,
            "cells": len(model.cells),
            "accuracy": model.accuracy,
            "what_if": None if table is None else table.numbers,
        }

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was assumed of the scene, what the model gets wrong, runs without an answer."""
        return (
            *self.assumed,
            *accuracy_warnings(self.model),
            *(() if self.table is None else self.table.warnings),
        )


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Match(FewNumbers):
    """Moduli of a reduced body after a motion: the ``fit``, and that of a ``stiff`` one."""

    fit: MotionFit
    stiff: MotionFit | None = None

    verb = "match"

    @property
    def summary(self) -> str:
        """Scale of E, nu, errors and the ratio of frequencies, in a line, at both ends."""
        lines = []
        for fit in filter(None, (self.fit, self.stiff)):
            nu = "" if fit.nu is None else Note("reduction.nu", fit=fit)
            lines.append(Note("reduction.moduli", fit=fit, nu=nu))
        return "; stiff: ".join(lines)

    @property
    def numbers(self) -> dict[str, Any]:
        """Moduli, errors, covariance, and how they were found; those of the stiff end beside."""
        stiff = None if self.stiff is None else self._numbers(self.stiff)
        return {**self._numbers(self.fit), "stiff": stiff}

    @staticmethod
    def _numbers(fit: MotionFit) -> dict[str, Any]:
        known = ("scale", "nu", "error", "unfitted_error", "outside", "frequency_ratio", "runs")
        return {
            **{name: getattr(fit, name) for name in known},
            "deviation": fit.deviation,
            "covariance": fit.covariance,
            "scheme": fit.scheme.value,
        }


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class SpringMatch(FewNumbers):
    """Stiffness of a network of springs after a motion: the ``fit``."""

    fit: SpringFit

    verb = "match"

    @property
    def summary(self) -> str:
        """Scale and profile of k, errors and the ratio of frequencies, in a line."""
        stiff = "" if math.isnan(self.fit.stiffer) else Note("reduction.stiff", fit=self.fit)
        return Note("reduction.springs", fit=self.fit, at=math.exp(self.fit.surface), stiff=stiff)

    @property
    def numbers(self) -> dict[str, Any]:
        """All that the fit holds."""
        return asdict(self.fit)


def reduce(
    mesh: str | Path | TetMesh,
    *,
    output: str | Path | None = None,
    what_if: str | Path | None = None,
    up: UpAxis | None = None,
    options: SimulateOptions | None = None,
    **given: Any,
) -> Reduction:
    """Reduce a body to a few coordinates, as its scenario holds and loads it, and measure that.

    Options may be ``given`` by name, as for ``simulate``: ``reduce("bar.msh", scenario="poke")``.

    Parameters
    ----------
    mesh
        Mesh [m] with E [Pa], nu [1] and rho [kg/m^3] on its tets, or a file of one.
    output
        The .npz of the model to write, which ``load_reduced`` of ``autophyx_tet.converters`` reads.
    what_if
        Table (.csv) of runs to answer, a row each: factors [1] to E by part and to the ``load``,
        and gravity ``gx``, ``gy``, ``gz`` [m/s^2]. Answers go to STEM.what_if.csv beside the model.
    up
        Axis that points up; by default what the mesh's sidecar says, else z.
    options
        Scenario and kind of basis; ``solver`` is "lbs" in any case.

    Returns
    -------
    Reduction
        ``model``, a ``ReducedModel`` with its accuracy; ``seconds`` [s]; ``table``, the answers.

    Raises
    ------
    InputError
        Where the mesh has no material, or a file cannot be read or written.
    UsageError
        Where an option is unknown or is for another solver.

    Examples
    --------
    >>> import autophyx_tet as apx
    >>> from autophyx_tet.fem import ElementMaterial, box_mesh
    >>> bar = box_mesh((0.1, 0.1, 0.4), (1, 1, 4))
    >>> bar = bar.with_material(ElementMaterial.uniform(24, E=1e6, nu=0.3, rho=1e3))
    >>> model = apx.reduce(bar).model
    >>> round(float(model.mass.sum()), 9), bool(abs(model.accuracy.frequency - 1) < 0.01)  # kg, 1
    (4.0, True)
    """
    options = changed_options(options or SimulateOptions(), given)
    if options.solver not in ("fem", "lbs"):
        raise UsageError(f"reduce --solver {options.solver}: a reduced model is for --solver lbs")
    options = replace(options, solver="lbs")
    output, what_if = path_of(output), path_of(what_if)
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
    table = None if what_if is None else answer_table(what_if, model, scene)
    if table is not None and output is not None:
        files.append(output.with_suffix(".what_if.csv"))
        table.write(files[-1])
    told = {"files": tuple(files), "assumed": scene.warnings, "table": table}
    return Reduction(model=model, seconds=time.perf_counter() - started, **told)


def match(
    mesh: str | Path | TetMesh,
    to: str | Path,
    *,
    to_stiff: str | Path | None = None,
    output: str | Path | None = None,
    up: UpAxis | None = None,
    with_nu: bool = False,
    options: SimulateOptions | None = None,
    progress: Progress | None = None,
    **given: Any,
) -> Match | SpringMatch:
    """Fit the scale of E, and nu on request, of a reduced body to a motion of the same scene.

    Of springs it is the scale of their stiffness. A motion is fitted by implicit Euler and by BDF2,
    one step a frame, and the nearer of the two is kept. Options may be ``given`` by name, as for
    ``simulate``: ``match("bar.msh", "motion.pvd", solver="lbs", scenario="poke")``.

    Parameters
    ----------
    mesh
        Mesh [m] with E [Pa], nu [1] and rho [kg/m^3] on its tets, or a file of one.
    to
        Motion to fit to: a .pvd with displacements (points, 3) [m] at equal times [s], as
        ``simulate`` writes it.
    to_stiff
        Motion of a stiffer body in the same scene: what lies between is ``parameters_alpha``.
    output
        The .npz of the parameters to write, for ``simulate(parameters=...)``.
    up
        Axis that points up; by default what the mesh's sidecar says, else z.
    with_nu
        Whether Poisson's ratio is fitted too.
    options
        Scenario, and ``solver``: "lbs" or "spring".
    progress
        Called with what the fit will take, and then with its stage and the seconds [s] so far.

    Returns
    -------
    Match or SpringMatch
        ``fit`` with ``scale`` [1], by which E (of springs: their stiffness) is multiplied, and how
        far the motion is still off; ``seconds`` [s].

    Raises
    ------
    InputError
        Where the mesh has no material, or a motion is not one of this mesh at equal times.
    UsageError
        Where the solver has nothing to fit, or the scene has obstacles.
    """
    options = changed_options(options or SimulateOptions(), given)
    to, to_stiff, output = path_of(to), path_of(to_stiff), path_of(output)
    # Refuse what no fit does
    if options.solver not in ("lbs", "spring"):
        raise UsageError("match.nothing_to_fit", solver=options.solver)
    if options.parameters is not None:
        raise UsageError("match --parameters: it is what a match writes")
    springs = options.solver == "spring"
    if springs and with_nu:
        raise UsageError("match --with-nu: springs have nu = 1/4")
    if springs and to_stiff is not None and options.eta != SimulateOptions.eta:
        raise UsageError("match --to-stiff: eta goes from soft to stiff, leave --eta out")
    if output is not None:
        check_file(output, (".npz",))
    started = time.perf_counter()
    scene = _scene(mesh, options, up)
    if scene.obstacles:
        raise UsageError(f"match: --scenario {options.scenario} has obstacles, wanted none")
    points = len(scene.mesh.points)
    motions = [read_motion(path, points) for path in (to, to_stiff) if path is not None]
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


def _fitted_moduli(
    scene: Scene, model: ReducedModel, frames: EvenMotion, *, with_nu: bool
) -> MotionFit:
    """Moduli of ``model`` after the motion of ``frames``, by the nearer of two schemes."""
    start = start_velocity(scene, make_space(scene.mesh, model.order))
    dead = model.pull_back(nodal_forces_of(scene, model.order))
    observed = ObservedMotion(
        displacement=frames.displacement, dt=frames.dt, load=dead, velocity=model.coordinates(start)
    )
    fits = [
        fit_motion(model, observed, with_nu=with_nu, scheme=scheme)
        for scheme in (Scheme.IMPLICIT_EULER, Scheme.BDF2)
    ]
    return min(fits, key=lambda fit: fit.error)


def _check_ends(stiffer: float) -> None:
    """Refuse a stiff end that is so many times as stiff [1] as the soft one, less than once."""
    if stiffer < 1:
        raise InputError("match.order", stiffer=stiffer)


def _scene(mesh: str | Path | TetMesh, options: SimulateOptions, up: UpAxis | None) -> Scene:
    found, sidecar, *_ = read_known(mesh, None)
    if found.material is None:
        raise InputError("the mesh has no E, nu and rho: run `autophyx-tet assign` on it first")
    return scene_of_options(found, options, up=up or sidecar.up)


# The verb match for springs: the scale of k after a motion of the same scene.


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


# Motions out of files: displacements at equal times, to be fitted to.

# Frames of a motion are at equal times to this share of their distance.
EVEN = 1e-3


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
            raise InputError("match.other_mesh", path=path, frame=len(frames), points=points)
        times.append(moment)
        frames.append(np.asarray(u, dtype=float))
    steps = np.diff(times)
    if len(steps) < 2 or not np.ptp(steps) <= EVEN * steps.mean():
        raise InputError(f"{path}: {len(times)} frames: wanted three or more at equal times")
    return EvenMotion(np.stack(frames), float(steps.mean()))


# A table of what-if runs: E of every part and the load, a row a run, answered by a reduced model.
#
# Columns are names of parts (a factor to their E), ``load`` (one to all that acts) and ``gx``,
# ``gy``, ``gz`` [m/s^2] (gravity instead of the scenario's); what a table does not name stays.

LOAD, GRAVITY = "load", ("gx", "gy", "gz")


def answer_table(path: Path, model: ReducedModel, scene: Scene) -> WhatIfTable:
    """Answer every row of the table at ``path`` by ``model``, and some by the full body.

    Raises InputError: Where the table is empty, names what is no part, or holds what is no number.
    """
    header, rows = _read(path, model.region_names)
    columns = dict(zip(header, rows.T, strict=True))
    runs, ones = len(rows), np.ones(len(rows))
    scales = np.stack([columns.get(part, ones) for part in model.region_names], axis=1)
    usual = np.asarray(scene.gravity_vector, dtype=float)
    pairs = zip(GRAVITY, usual, strict=True)
    gravity = np.stack([columns.get(name, g * ones) for name, g in pairs], axis=1)
    share, loads = columns.get(LOAD, ones), (*np.eye(3), np.zeros(3))
    # What every metre a second squared of gravity along x, y, z does, over all else that acts
    *weighs, dead = (nodal_forces_of(replace(scene, gravity_vector=g), model.order) for g in loads)
    weighs = np.stack(weighs) - dead

    def forces(run: int) -> np.ndarray:
        return share[run] * (np.tensordot(gravity[run], weighs, axes=1) + dead)

    weights = np.stack([model.pull_back(w) for w in weighs])
    loads = share[:, None] * (gravity @ weights + model.pull_back(dead))
    started = time.perf_counter()
    found = what_if(model, scales=scales, loads=loads)
    seconds = time.perf_counter() - started
    error = what_if_error(
        model,
        found,
        scene.mesh,
        scene.held,
        scales=scales,
        forces=forces,
        count=min(4, runs),
        order=affordable_order(scene.mesh, LARGEST_MOVING),
    )
    return WhatIfTable(header, rows, found, error, seconds)


def _read(path: Path, parts: tuple[str, ...]) -> tuple[tuple[str, ...], np.ndarray]:
    try:
        with path.open(newline="") as file:
            header, *lines = [row for row in csv.reader(file) if row]
        rows = np.array(lines, dtype=float).reshape(len(lines), len(header))
    except (OSError, ValueError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: wanted a table of numbers with a header: {error}") from error
    header = tuple(name.strip() for name in header)
    unknown = [name for name in header if name not in (*parts, LOAD, *GRAVITY)]
    if unknown or len(set(header)) < len(header):
        known = ", ".join((*parts, LOAD, *GRAVITY))
        wrong = ", ".join(unknown or header)
        raise InputError(f"{path}: columns {wrong}: wanted each once of {known}")
    if not len(rows) or not np.isfinite(rows).all():
        raise InputError(f"{path}: wanted a row of finite numbers for every run")
    return header, rows
