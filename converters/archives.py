"""Reduced models, moduli and springs fitted to motions, as .npz: arrays by name, and ``meta``."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields
from typing import Any

import numpy as np

from ..fem.errors import InputError
from ..fem.identify import MotionFit
from ..fem.note import Note
from ..fem.reduced.model import Accuracy, ReducedModel, Subspace
from ..fem.solve.schemes import Scheme
from ..fem.springs.fit import SpringFit
from .files import reading
from .npz import load_npz, save_npz

# By kind: of models the second has the nodes of quadratic elements too, of fits a soft and a stiff
# end.
VERSIONS = {"ReducedModel": 2, "MotionFit": 2, "SpringFit": 3}
UNITS = {
    "points": "m", "mass": "kg", "basis": "kg^-1/2", "weights": "m^3",
    "gradients": "m^-1 kg^-1/2", "E": "Pa", "nu": "1", "springs": "s^-2",
}  # fmt: skip
_NUMBERS = ("scale", "nu", "error", "unfitted_error", "outside", "frequency_ratio", "runs")
_ARRAYS = [field.name for field in fields(ReducedModel) if "ndarray" in str(field.type)]
_SPRING_NUMBERS = [field.name for field in fields(SpringFit)]


def save_reduced(path: str | os.PathLike, model: ReducedModel) -> None:
    """Save a reduced model; ``load_reduced`` gives it back exactly.

    Parameters
    ----------
    path
        File to write, .npz.
    model
        The model, in SI: points [m], mass [kg], E [Pa] ...

    Returns
    -------
    None
        The file is whole, or not there.

    Raises
    ------
    InputError
        Where the file cannot be written.

    Examples
    --------
    >>> from autophyx_tet.converters import load_reduced, save_reduced
    >>> from autophyx_tet.fem import ElementMaterial, Supports, box_mesh, reduce_body
    >>> bar = box_mesh((0.1, 0.1, 0.4), (1, 1, 4))
    >>> bar = bar.with_material(ElementMaterial.uniform(24, E=1e6, nu=0.3, rho=1e3))
    >>> held = Supports.clamp(len(bar.points), bar.points[:, 2] == 0)
    >>> save_reduced("bar.npz", reduce_body(bar, held))
    >>> round(float(load_reduced("bar.npz").mass.sum()), 9)  # kg: rho V
    4.0
    """
    _save(
        path,
        "ReducedModel",
        {name: getattr(model, name) for name in _ARRAYS},
        units=UNITS,
        subspace=model.kind.value,
        region_names=model.region_names,
        accuracy=model.accuracy._asdict(),
    )


def load_reduced(path: str | os.PathLike) -> ReducedModel:
    """Load what ``save_reduced`` wrote, checked.

    Parameters
    ----------
    path
        File, .npz.

    Returns
    -------
    ReducedModel
        Points [m], mass [kg], basis, and the cells that the elastic energy [J] is summed over.

    Raises
    ------
    InputError
        If it is no reduced model, of another version, or not whole.

    Examples
    --------
    >>> from autophyx_tet.converters import load_reduced, save_reduced
    >>> from autophyx_tet.fem import ElementMaterial, Supports, box_mesh, reduce_body
    >>> bar = box_mesh((0.1, 0.1, 0.4), (1, 1, 4))
    >>> bar = bar.with_material(ElementMaterial.uniform(24, E=1e6, nu=0.3, rho=1e3))
    >>> held = Supports.clamp(len(bar.points), bar.points[:, 2] == 0)
    >>> save_reduced("bar.npz", reduce_body(bar, held))
    >>> round(float(load_reduced("bar.npz").mass.sum()), 9)  # kg: rho V
    4.0
    """
    with _loaded(path, "ReducedModel", Note("archives.reduced_model")) as (arrays, meta):
        if missing := set(_ARRAYS) - set(arrays):
            raise InputError(f"{path} has no {', '.join(sorted(missing))}")
        return ReducedModel(
            kind=Subspace(meta["subspace"]),
            region_names=tuple(meta["region_names"]),
            accuracy=Accuracy(**meta["accuracy"]),
            **{name: arrays[name] for name in _ARRAYS},
        ).checked()


def save_fits(path: str | os.PathLike, fits: Sequence[MotionFit]) -> None:
    """Save moduli fitted to a motion, or to a soft and a stiff one; nu not fitted is no number."""
    numbers = {n: np.array([getattr(f, n) for f in fits], dtype=float) for n in _NUMBERS}
    numbers["covariance"] = np.stack([fit.covariance for fit in fits])
    _save(path, "MotionFit", numbers, schemes=[fit.scheme.name for fit in fits])


def load_fits(path: str | os.PathLike) -> tuple[MotionFit, ...]:
    """Load what ``save_fits`` wrote, the soft end first; ``InputError`` if it is another file."""
    with _loaded(path, "MotionFit", Note("archives.parameters_match_saved")) as (arrays, meta):
        fits = []
        for end, scheme in enumerate(meta["schemes"]):
            numbers: dict[str, Any] = {name: float(arrays[name][end]) for name in _NUMBERS}
            nu, runs = numbers.pop("nu"), int(numbers.pop("runs"))
            others: dict[str, Any] = {
                "runs": runs,
                "nu": None if np.isnan(nu) else nu,
                "scheme": Scheme[scheme],
            }
            fits.append(MotionFit(**numbers, **others, covariance=arrays["covariance"][end]))
        return tuple(fits)


def save_springs(path: str | os.PathLike, fit: SpringFit) -> None:
    """Save ``fit``; ``load_springs`` gives it back exactly."""
    _save(path, "SpringFit", {name: np.array(getattr(fit, name)) for name in _SPRING_NUMBERS})


def load_springs(path: str | os.PathLike) -> SpringFit:
    """Load what ``save_springs`` wrote; ``InputError`` if it is something else."""
    wanted = Note("archives.parameters_match")
    with _loaded(path, "SpringFit", wanted) as (arrays, _):
        return SpringFit(**{name: arrays[name].item() for name in _SPRING_NUMBERS})


def _save(
    path: str | os.PathLike, kind: str, arrays: Mapping[str, np.ndarray], **meta: Any
) -> None:
    meta = {"kind": kind, "version": VERSIONS[kind], **meta}
    save_npz(path, **arrays, meta=np.array(json.dumps(meta)))


@contextmanager
def _loaded(
    path: str | os.PathLike, kind: str, wanted: str
) -> Iterator[tuple[dict[str, Any], dict[str, Any]]]:
    """Arrays and ``meta`` of an archive of a kind, for a block that takes them apart."""
    arrays = load_npz(path)
    with reading(path, wanted) as source:
        meta = json.loads(str(arrays.pop("meta", "{}")))
        if meta.get("kind") != kind:
            raise InputError(
                "archives.holds_wanted", source=source, get=meta.get("kind", "no meta"), kind=kind
            )
        if meta["version"] != VERSIONS[kind]:
            raise InputError(
                "archives.version_wanted",
                source=source,
                meta=meta["version"],
                versions=VERSIONS[kind],
            )
        yield arrays, meta
