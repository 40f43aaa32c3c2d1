"""Real objects as voxels: slots of one material each, with their names, colours and known kinds."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Float16, UInt8

from ...fem.errors import InputError
from ...fem.table import Material, load_table
from ...predictors.appearance.features import cell_appearance
from ...predictors.appearance.surface import (
    SPACING,
    material_name,
    random_points,
    skin_of,
    surface_samples,
)
from ...predictors.asset import Asset, Part, upright
from ...predictors.matter import FEATURES, measure
from ...predictors.text.parts import KINDS, Vocabulary, kind_of
from .shapes import EMPTY, MAX_PARTS

CELLS = 64
_PAD = 1
_COLOUR_SAMPLES = 4_000  # of each part, for its mean colour


@dataclass(frozen=True, eq=False)
class RealObject:
    """One object on a cube of ``CELLS``^3 voxels, z up.

    Parameters
    ----------
    name, source
        What it is ("Kitchen chair") and the collection it comes from.
    label
        Slot of every voxel, ``EMPTY`` outside, uint8.
    slots
        Names of the slots as the file has them.
    colours
        Mean colour of each slot in [0, 1].
    features
        Mean unit vector of what an image encoder saw of each slot, None if it did not look.
    looks
        What is measured of each slot by ``matter.looks``, None if it was not.
    seen
        Look of each cell, in C order; not kept in files.
    """

    name: str
    source: str
    label: UInt8[np.ndarray, "cells cells cells"]
    slots: tuple[str, ...]
    colours: Float[np.ndarray, "slots 3"]
    features: Float16[np.ndarray, "slots dim"] | None = None
    looks: Float[np.ndarray, "slots measures"] | None = None
    seen: Float16[np.ndarray, "n look"] | None = None

    def materials(self) -> list[Material | None]:
        """Row of the table for each slot, where its name tells."""
        return [slot_material(slot) for slot in self.slots]


def slot_material(name: str) -> Material | None:
    """Row of the table that a slot's name speaks of: a material word, else a kind of material."""
    table = load_table()
    kind = kind_of(name)
    if kind is None:
        return None
    phrase = Vocabulary(table.phrases).in_name(name)
    if phrase and kind_of(phrase) == kind:
        return table.exact(phrase)
    return table.exact("leaf" if kind == "plant" else kind)


def kind_index(name: str) -> int:
    """Index into ``KINDS`` of a slot's name, -1 where it does not tell."""
    kind = kind_of(name)
    return -1 if kind is None else KINDS.index(kind)


def voxelise(asset: Asset, name: str, source: str) -> RealObject:
    """Return the asset filled with voxels; cavities are filled, labels come from the surface."""
    from scipy.ndimage import binary_fill_holes, distance_transform_edt

    lo, h = cube(asset)
    label = np.full((CELLS,) * 3, EMPTY, dtype=np.uint8)
    slots, colours = [], []
    for slot, parts in _slots(asset.parts).items():
        index = len(slots)
        if index == MAX_PARTS:
            break
        for part in parts:
            # Closer than half a cell: two neighbours on either side of a face are not both missed.
            for points in surface_samples(part.mesh, SPACING * h):
                cells = np.floor((upright(points, asset.up) - lo) / h).astype(int)
                label[tuple(cells.clip(0, CELLS - 1).T)] = index
        slots.append(slot)
        colours.append(_mean_colour(parts))
    shell = label != EMPTY
    inside = np.asarray(binary_fill_holes(shell))
    nearest: Any = distance_transform_edt(~shell, return_distances=False, return_indices=True)
    label = np.where(inside, label[tuple(nearest)], EMPTY).astype(np.uint8)
    cells = np.argwhere(inside)
    seen, _ = cell_appearance(asset, lo + (cells + 0.5) * h, turned=True)
    looks = _measured(cells, seen, label[inside], len(slots))
    return RealObject(
        name, source, label, tuple(slots), np.array(colours), looks=looks,
        seen=seen.astype(np.float16),
    )  # fmt: skip


def _measured(
    cells: np.ndarray, seen: np.ndarray, slot: np.ndarray, slots: int
) -> Float[np.ndarray, "slots measures"]:
    """``matter.looks.measure`` of each slot, NaN of those without cells."""
    there, piece = np.unique(slot, return_inverse=True)
    out = np.full((slots, len(FEATURES)), np.nan)
    out[there] = measure(cells, seen, piece.ravel())
    return out


def cube(asset: Asset) -> tuple[Float[np.ndarray, "3"], float]:
    """Lower corner and cell [m] of the cube that holds an asset, upright."""
    lo, hi = np.sort(upright(asset.bounds, asset.up), axis=0)
    h = float((hi - lo).max()) / (CELLS - 2 * _PAD)
    return (lo + hi) / 2 - CELLS * h / 2, h


def _slots(parts: Sequence[Part]) -> dict[str, list[Part]]:
    """Parts by the name of their material, the largest surface first."""
    groups: dict[str, list[Part]] = {}
    for part in parts:
        groups.setdefault(material_name(part.mesh) or part.name, []).append(part)

    def area(group: Sequence[Part]) -> float:
        return -sum(float(part.mesh.area) for part in group)

    return dict(sorted(groups.items(), key=lambda item: area(item[1])))


def _mean_colour(parts: Sequence[Part]) -> np.ndarray:
    """Mean colour (3,) of a slot, in 0 ... 1, by area."""
    rng, total = np.random.default_rng(0), np.zeros(3)
    for part in parts:
        colours = skin_of(part.mesh)(*random_points(part.mesh, _COLOUR_SAMPLES, rng)[:2])
        total += float(part.mesh.area) * colours[:, :3].mean(axis=0)
    return total / sum(float(part.mesh.area) for part in parts)


def save_real(path: Path, objects: Iterable[RealObject]) -> None:
    """Write objects to one compact safetensors file: their labels are run-length coded."""
    from safetensors.numpy import save_file

    objects = list(objects)
    runs = [_encode(o.label) for o in objects]
    described = [
        {
            "name": o.name,
            "source": o.source,
            "slots": o.slots,
            "colours": o.colours.round(3).tolist(),
            "looked": o.features is not None,
            "measured": o.looks is not None,
        }
        for o in objects
    ]
    looked = [o.features for o in objects if o.features is not None]
    measures = [o.looks.astype(np.float32) for o in objects if o.looks is not None]
    save_file(
        {
            "values": np.concatenate([value for value, _ in runs]),
            "lengths": np.concatenate([length for _, length in runs]),
            "counts": np.array([len(value) for value, _ in runs], dtype=np.int32),
            **({"features": np.concatenate(looked)} if looked else {}),
            **({"looks": np.concatenate(measures)} if measures else {}),
        },
        path,
        metadata={"objects": json.dumps(described)},
    )


def load_real(path: Path) -> list[RealObject]:
    """Read what ``save_real`` wrote."""
    from safetensors import SafetensorError, safe_open

    try:
        with safe_open(path, framework="np") as file:
            described = json.loads(file.metadata()["objects"])
            values, lengths, counts = (file.get_tensor(k) for k in ("values", "lengths", "counts"))
            seen, measures = (
                iter(file.get_tensor(k) if k in file.keys() else ()) for k in ("features", "looks")
            )
    except (SafetensorError, OSError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path} is not a file of voxelised objects: {error}") from error
    ends = np.cumsum(counts)
    return [
        RealObject(
            data["name"],
            data["source"],
            np.repeat(values[end - n : end], lengths[end - n : end]).reshape((CELLS,) * 3),
            tuple(data["slots"]),
            np.array(data["colours"], dtype=np.float64).reshape(-1, 3),
            np.array(list(islice(seen, len(data["slots"])))) if data.get("looked") else None,
            np.array(list(islice(measures, len(data["slots"])))) if data.get("measured") else None,
        )
        for data, n, end in zip(described, counts, ends, strict=True)
    ]


def _encode(label: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values and lengths of the runs of equal labels; a run ends at the end of a plane."""
    flat = label.ravel()
    change = np.concatenate([[True], flat[1:] != flat[:-1]])
    change[:: CELLS * CELLS] = True  # so that every length fits 16 bits
    starts = np.flatnonzero(change)
    lengths = np.diff(np.concatenate([starts, [flat.size]]))
    return flat[starts], lengths.astype(np.uint16)
