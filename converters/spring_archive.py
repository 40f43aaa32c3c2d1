"""Springs fitted to a motion, as .npz: numbers by name, and ``meta``."""

from __future__ import annotations

import json
import os
from dataclasses import fields

import numpy as np

from ..fem.errors import InputError
from ..fem.springs.fit import SpringFit
from .files import reading
from .npz import load_npz, save_npz

KIND, VERSION = "SpringFit", 3
_NUMBERS = [field.name for field in fields(SpringFit)]


def save_springs(path: str | os.PathLike, fit: SpringFit) -> None:
    """Save ``fit``; ``load_springs`` gives it back exactly."""
    numbers = {name: np.array(getattr(fit, name)) for name in _NUMBERS}
    save_npz(path, **numbers, meta=np.array(json.dumps({"kind": KIND, "version": VERSION})))


def load_springs(path: str | os.PathLike) -> SpringFit:
    """Load what ``save_springs`` wrote; ``InputError`` if it is something else."""
    arrays = load_npz(path)
    with reading(path, "parameters that `match --solver spring` saved") as source:
        meta = json.loads(str(arrays.pop("meta", "{}")))
        if meta.get("kind") != KIND or meta["version"] != VERSION:
            raise InputError(f"{source} holds {meta.get('kind', 'no meta')!r}, wanted a {KIND}")
        return SpringFit(**{name: arrays[name].item() for name in _NUMBERS})
