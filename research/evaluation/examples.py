"""Objects with texts and true values in files of their own, so that anyone can score on theirs.

One ``NAME.safetensors`` an object. Tensors: ``part`` int16 (nx, ny, nz), the index of the part that
fills each cell, -1 outside; ``E`` [Pa], ``nu`` [1], ``rho`` [kg/m^3], float64 (texts, parts), NaN
where unknown; optionally ``colour`` float32 (parts, 3) in [0, 1]. Metadata, each a JSON value:
``h``, edge of a cell [m]; ``part_names``; ``texts``; ``up``, "x", "y" or "z"; optionally ``mass``,
the weighed mass of the object [kg].
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from ...fem.errors import InputError
from ...predictors.asset import UpAxis
from ...predictors.grid import Grid, PartVoxels

SUFFIX = ".safetensors"


@dataclass(frozen=True, eq=False)
class Example:
    """One object under one or more texts.

    Parameters
    ----------
    name, parts, up
        The object on its grid.
    texts
        What is said of it.
    values
        (E [Pa], nu [1], rho [kg/m^3]) of every part under every text, NaN where unknown.
    colours
        Mean colour of every part in [0, 1], if known.
    mass
        Weighed mass [kg], if known.
    """

    name: str
    parts: PartVoxels
    texts: tuple[str, ...]
    values: Float[np.ndarray, "texts parts 3"]
    up: UpAxis = "z"
    colours: Float[np.ndarray, "parts 3"] | None = None
    mass: float | None = None


def save_example(path: Path, example: Example) -> None:
    """Write one object."""
    from safetensors.numpy import save_file

    tensors: dict[str, np.ndarray] = {"part": example.parts.part.astype(np.int16)}
    for axis, name in enumerate(("E", "nu", "rho")):
        tensors[name] = np.ascontiguousarray(example.values[..., axis], dtype=np.float64)
    if example.colours is not None:
        tensors["colour"] = example.colours.astype(np.float32)
    facts = {
        "h": example.parts.grid.h,
        "part_names": example.parts.part_names,
        "texts": example.texts,
        "up": example.up,
        "mass": example.mass,
    }
    save_file(tensors, path, metadata={key: json.dumps(value) for key, value in facts.items()})


def load_example(path: Path) -> Example:
    """Read one object; a file of another kind is an ``InputError``."""
    from safetensors import SafetensorError, safe_open

    try:
        with safe_open(path, framework="np") as file:
            facts = {key: json.loads(value) for key, value in file.metadata().items()}
            part = file.get_tensor("part").astype(np.int64)
            values = np.stack([file.get_tensor(name) for name in ("E", "nu", "rho")], axis=-1)
            colours = file.get_tensor("colour") if "colour" in file.keys() else None
        grid = Grid(np.zeros(3), float(facts["h"]), part.shape)
        parts = PartVoxels(grid, part, tuple(facts["part_names"]))
        texts, mass = tuple(facts["texts"]), facts.get("mass")
    except (SafetensorError, OSError, AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path} is not an object with texts and values: {error}") from error
    if values.shape != (len(texts), len(parts.part_names), 3) or not texts:
        raise InputError(
            f"{path}: E, nu and rho have shape {values.shape[:2]}, wanted (texts, parts) = "
            f"({len(texts)}, {len(parts.part_names)}) with at least one text"
        )
    return Example(path.stem, parts, texts, values, facts.get("up", "z"), colours, mass)


def load_examples(folder: Path) -> Sequence[Example]:
    """Read all objects of a folder, sorted by name."""
    paths = sorted(folder.glob(f"*{SUFFIX}"))
    if not paths:
        raise InputError(f"{folder} holds no {SUFFIX} file: wanted one for each object")
    return [load_example(path) for path in paths]
