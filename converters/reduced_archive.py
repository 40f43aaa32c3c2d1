"""A reduced model as an .npz: the arrays of ``ReducedModel`` by name, and what is not an array."""

from __future__ import annotations

import json
import os
from dataclasses import fields

import numpy as np

from ..fem.errors import InputError
from ..fem.reduced.model import Accuracy, ReducedModel, Subspace
from .files import reading
from .npz import load_npz, save_npz

VERSION = 1
KIND = "ReducedModel"
UNITS = {
    "points": "m", "mass": "kg", "basis": "kg^-1/2", "weights": "m^3",
    "gradients": "m^-1 kg^-1/2", "E": "Pa", "nu": "1", "springs": "s^-2",
}  # fmt: skip
_ARRAYS = [field.name for field in fields(ReducedModel) if "ndarray" in str(field.type)]


def save_reduced(path: str | os.PathLike, model: ReducedModel) -> None:
    """Save ``model``; ``load_reduced`` gives it back exactly."""
    meta = {
        "kind": KIND,
        "version": VERSION,
        "units": UNITS,
        "subspace": model.kind.value,
        "region_names": model.region_names,
        "accuracy": model.accuracy._asdict(),
    }
    arrays = {name: getattr(model, name) for name in _ARRAYS}
    save_npz(path, **arrays, meta=np.array(json.dumps(meta)))


def load_reduced(path: str | os.PathLike) -> ReducedModel:
    """Load what ``save_reduced`` wrote, checked as on construction.

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
        if meta["version"] != VERSION:
            raise InputError(f"{source} has version {meta['version']}, wanted {VERSION}")
        if missing := set(_ARRAYS) - set(arrays):
            raise InputError(f"{source} has no {', '.join(sorted(missing))}")
        return ReducedModel(
            kind=Subspace(meta["subspace"]),
            region_names=tuple(meta["region_names"]),
            accuracy=Accuracy(**meta["accuracy"]),
            **{name: arrays[name] for name in _ARRAYS},
        )
