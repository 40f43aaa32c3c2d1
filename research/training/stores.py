"""Stores of voxelised objects on the device, from which training draws shapes."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from ...predictors.field import Normalisation
from ..datasets.objects import Objects
from ..datasets.real import RealObject, kind_index
from ..datasets.shapes import EMPTY, MAX_PARTS, rasterise
from ..datasets.text_table import TextTable

_CHUNK = 64  # objects rasterised at once


class Store(NamedTuple):
    """Voxelised objects on the device.

    ``label`` (n, cells, cells, cells) uint8; ``kinds`` (n, 6): part kinds, or kinds of matter of
    real objects, -1 where unknown; ``category`` (n,); ``value`` (n, 6, 3) and ``colour`` (n, 6, 3)
    of real slots, NaN elsewhere; ``text`` (n, 7): rows of the default template and the slot names;
    ``look`` (n, 6): row of what an image encoder saw of real slots, -1 elsewhere.
    """

    label: Tensor
    kinds: Tensor
    category: Tensor
    value: Tensor
    colour: Tensor
    text: Tensor
    look: Tensor


def procedural_store(objects: Objects, *, cells: int, device: str) -> Store:
    """Rasterise objects onto ``cells``^3 voxels."""
    label = procedural_labels(objects, cells=cells, device=device)
    n = len(label)
    nan = torch.full((n, MAX_PARTS, 3), torch.nan, device=device)
    none = torch.full((n, 1 + MAX_PARTS), -1, device=device)
    kinds = torch.tensor(objects.kinds, device=device)
    category = torch.tensor(objects.category, device=device)
    return Store(label, kinds, category, nan, nan, none, none[:, 1:])


def procedural_labels(objects: Objects, *, cells: int, device: str) -> Tensor:
    """Part of every voxel (n, cells, cells, cells) of objects, uint8."""
    rows = torch.tensor(objects.rows, device=device)
    return torch.cat([rasterise(chunk, cells=cells) for chunk in rows.split(_CHUNK)])


def real_store(objects: list[RealObject], table: TextTable, *, cells: int, device: str) -> Store:
    """Bring real objects to ``cells``^3 voxels."""
    label = coarsened(torch.tensor(np.stack([o.label for o in objects]), device=device), cells)
    kinds, value, colour = slot_columns(objects, table.normalisation)
    names = table.real_names.astype(int)
    columns = (kinds, np.full(len(objects), -1), value, colour, names, look_rows(objects))
    return Store(label, *(torch.tensor(column, device=device) for column in columns))


def slot_columns(
    objects: list[RealObject], normalisation: Normalisation
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Kinds (n, 6), normalised values and colours, both (n, 6, 3), of the slots of real objects."""
    n = len(objects)
    kinds = np.full((n, MAX_PARTS), -1)
    value, colour = (np.full((n, MAX_PARTS, 3), np.nan, dtype=np.float32) for _ in range(2))
    for i, o in enumerate(objects):
        colour[i, : len(o.slots)] = o.colours
        for j, (slot, row) in enumerate(zip(o.slots, o.materials(), strict=True)):
            kinds[i, j] = kind_index(slot)
            if row is not None:
                value[i, j] = normalisation.normalise(*row.value())
    return kinds, value, colour


def look_rows(objects: list[RealObject]) -> np.ndarray:
    """Row of each slot (n, 6) among the slots of all objects, -1 where nothing was looked at."""
    out, start = np.full((len(objects), MAX_PARTS), -1), 0
    for row, o in zip(out, objects, strict=True):
        if o.features is not None:
            row[: len(o.slots)] = np.arange(start, start + len(o.slots))
        start += len(o.slots)
    return out


def coarsened(label: Tensor, cells: int) -> Tensor:
    """Labels (n, x, y, z) on ``cells``^3 voxels."""
    if cells == label.shape[1]:
        return label
    return torch.cat([_coarsen(chunk, cells) for chunk in label.split(_CHUNK)])


def _coarsen(label: Tensor, cells: int) -> Tensor:
    """Most frequent slot of the occupied voxels in each coarser cell."""
    factor = label.shape[1] // cells
    count = [F.avg_pool3d((label == p).float(), factor) for p in range(MAX_PARTS)]
    stacked = torch.stack(count)
    best = stacked.argmax(0).to(torch.uint8)
    return torch.where(stacked.sum(0) > 0, best, EMPTY)


def parts_that_exist(item: Store) -> Tensor:
    """Whether each part has a voxel, (n, 6)."""
    return torch.stack([(item.label == p).any(3).any(2).any(1) for p in range(MAX_PARTS)], 1)


def take(store: Store, n: int, rand: Callable[[int], Tensor]) -> Store:
    """Return ``n`` random objects; ``rand`` gives numbers in [0, 1)."""
    index = (rand(n) * len(store.label)).long()
    return Store(*(column[index] for column in store))
