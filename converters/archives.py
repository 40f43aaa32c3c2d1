"""Reduced models, and moduli fitted with them, as .npz: arrays by name, and ``meta``."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from ..fem.errors import InputError
from ..fem.identify import MotionFit
from ..fem.reduced.model import Accuracy, ReducedModel, Subspace
from ..fem.solve.schemes import Scheme
from ..fem.springs.fit import SpringFit
from ..predictors.unipixie.simplicits import Theta
from .files import load_npz, reading, save_npz

VERSION = 1
# Of models: the second has the nodes of quadratic elements too.
MODEL_VERSION = 2
# Of fits: the second has a soft and a stiff end.
FIT_VERSION = 2
KIND = "ReducedModel"
UNITS = {
    "points": "m", "mass": "kg", "basis": "kg^-1/2", "weights": "m^3",
    "gradients": "m^-1 kg^-1/2", "E": "Pa", "nu": "1", "springs": "s^-2",
}  # fmt: skip
_NUMBERS = ("scale", "nu", "error", "unfitted_error", "outside", "frequency_ratio", "runs")
_ARRAYS = [field.name for field in fields(ReducedModel) if "ndarray" in str(field.type)]


def save_reduced(path: str | os.PathLike, model: ReducedModel) -> None:
    """Save ``model``; ``load_reduced`` gives it back exactly."""
    meta = {
        "kind": KIND,
        "version": MODEL_VERSION,
        "units": UNITS,
        "subspace": model.kind.value,
        "region_names": model.region_names,
        "accuracy": model.accuracy._asdict(),
    }
    arrays = {name: getattr(model, name) for name in _ARRAYS}
    save_npz(path, **arrays, meta=np.array(json.dumps(meta)))


def load_reduced(path: str | os.PathLike) -> ReducedModel:
    """Load what ``save_reduced`` wrote, checked.

    Raises
    ------
    InputError
        If it is no reduced model, of another version, or not whole.
    """
    arrays = load_npz(path)
    with reading(path, "a reduced model saved by this package") as source:
        meta = json.loads(str(arrays.pop("meta", "{}")))
        if meta.get("kind") != KIND:
            raise InputError(f"{source} holds {meta.get('kind', 'no meta')!r}, wanted a {KIND}")
        if meta["version"] != MODEL_VERSION:
            raise InputError(f"{source} has version {meta['version']}, wanted {MODEL_VERSION}")
        if missing := set(_ARRAYS) - set(arrays):
            raise InputError(f"{source} has no {', '.join(sorted(missing))}")
        held: dict[str, Any] = {name: arrays[name] for name in _ARRAYS}
        return ReducedModel(
            kind=Subspace(meta["subspace"]),
            region_names=tuple(meta["region_names"]),
            accuracy=Accuracy(**meta["accuracy"]),
            **held,
        ).checked()


def save_fits(path: str | os.PathLike, fits: Sequence[MotionFit]) -> None:
    """Save moduli fitted to a motion, or to a soft and a stiff one; nu not fitted is no number."""
    numbers = {n: np.array([getattr(f, n) for f in fits], dtype=float) for n in _NUMBERS}
    numbers["covariance"] = np.stack([fit.covariance for fit in fits])
    schemes = [fit.scheme.name for fit in fits]
    meta = {"kind": "MotionFit", "version": FIT_VERSION, "schemes": schemes}
    save_npz(path, **numbers, meta=np.array(json.dumps(meta)))


def load_fits(path: str | os.PathLike) -> tuple[MotionFit, ...]:
    """Load what ``save_fits`` wrote, the soft end first; ``InputError`` if it is another file."""
    arrays = load_npz(path)
    with reading(path, "parameters that `match` saved") as source:
        meta = json.loads(str(arrays.pop("meta", "{}")))
        if meta.get("kind") != "MotionFit" or meta["version"] != FIT_VERSION:
            raise InputError(f"{source} holds {meta.get('kind', 'no meta')!r}, wanted a MotionFit")
        fits = []
        for end, scheme in enumerate(meta["schemes"]):
            numbers = {name: float(arrays[name][end]) for name in _NUMBERS}
            nu, runs = numbers.pop("nu"), int(numbers.pop("runs"))
            known = {"runs": runs, "nu": None if np.isnan(nu) else nu, "scheme": Scheme[scheme]}
            fits.append(MotionFit(**numbers, **known, covariance=arrays["covariance"][end]))
        return tuple(fits)


def save_theta(path: str | os.PathLike, theta: Theta) -> None:
    """Save skinning weights as numbers of the frozen body's head, with the hash of that body."""
    meta = {"kind": "Theta", "version": VERSION, "body_hash": theta.body_hash}
    arrays = {"numbers": theta.numbers, "lo": theta.lo, "hi": theta.hi}
    arrays["residual"] = np.array(theta.residual)
    save_npz(path, **arrays, meta=np.array(json.dumps(meta)))


def load_theta(path: str | os.PathLike) -> Theta:
    """Load what ``save_theta`` wrote; ``InputError`` where it belongs to another body."""
    arrays = load_npz(path)
    with reading(path, "skinning weights saved by this package") as source:
        meta = json.loads(str(arrays.pop("meta", "{}")))
        if meta.get("kind") != "Theta" or meta["version"] != VERSION:
            raise InputError(f"{source} holds {meta.get('kind', 'no meta')!r}, wanted a Theta")
        residual = float(arrays.pop("residual"))
        return Theta(**arrays, residual=residual, body_hash=meta["body_hash"])


# Springs fitted to a motion, as .npz: numbers by name, and ``meta``.

SPRINGS, SPRINGS_VERSION = "SpringFit", 3
_SPRING_NUMBERS = [field.name for field in fields(SpringFit)]


def save_springs(path: str | os.PathLike, fit: SpringFit) -> None:
    """Save ``fit``; ``load_springs`` gives it back exactly."""
    numbers = {name: np.array(getattr(fit, name)) for name in _SPRING_NUMBERS}
    save_npz(
        path, **numbers, meta=np.array(json.dumps({"kind": SPRINGS, "version": SPRINGS_VERSION}))
    )


def load_springs(path: str | os.PathLike) -> SpringFit:
    """Load what ``save_springs`` wrote; ``InputError`` if it is something else."""
    arrays = load_npz(path)
    with reading(path, "parameters that `match --solver spring` saved") as source:
        meta = json.loads(str(arrays.pop("meta", "{}")))
        if meta.get("kind") != SPRINGS or meta["version"] != SPRINGS_VERSION:
            raise InputError(f"{source} holds {meta.get('kind', 'no meta')!r}, wanted a {SPRINGS}")
        return SpringFit(**{name: arrays[name].item() for name in _SPRING_NUMBERS})
