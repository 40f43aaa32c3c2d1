"""The table of ranges on the device, with random picks of names by what they speak of."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from ...datasets.lab import D65, LINEAR_OF_XYZ
from ...datasets.ranges import RangeTable

CLASSES = 8


class Picker:
    """Random members of numbered groups."""

    def __init__(self, groups: Sequence[np.ndarray], device: str) -> None:
        count = np.array([len(group) for group in groups])
        flat = np.concatenate([*groups, [-1]])  # the last one stands for an empty group
        self.flat = torch.tensor(flat, device=device)
        self.count = torch.tensor(count, device=device)
        self.first = torch.tensor(np.cumsum(count) - count, device=device)

    def __call__(self, group: Tensor, chance: Tensor) -> Tensor:
        """Return a member of each ``group``, -1 where there is none; ``chance`` in [0, 1)."""
        at = group.clamp(min=0)
        member = self.first[at] + (chance * self.count[at]).long()
        there = (group >= 0) & (self.count[at] > 0)
        return torch.where(there, self.flat[torch.where(there, member, 0)], -1)


class Names:
    """Names, the rows that they leave plausible, and the ranges of those, on the device."""

    def __init__(self, table: RangeTable, device: str) -> None:
        def tensor(array: np.ndarray, kind: torch.dtype = torch.float32) -> Tensor:
            return torch.tensor(array, dtype=kind, device=device)

        self.embedding = tensor(table.embedding, torch.float16)
        self.rows = tensor(table.rows, torch.long)
        self.low, self.high = tensor(table.low), tensor(table.high)
        self.matter = tensor(table.matter, torch.long)
        self.colour = tensor(table.colour)
        single = (table.rows >= 0).sum(1) == 1
        row = np.where(single, table.rows[:, 0], -1)
        kinds = range(len(table.kind_rows))
        of_kind = [table.kind == k for k in kinds]
        usual = [np.isin(row, [r for r in table.kind_rows[k] if r >= 0]) for k in kinds]
        self.plain = Picker([np.flatnonzero(of_kind[k] & ~single) for k in kinds], device)
        self.named = Picker([np.flatnonzero(of_kind[k] & usual[k]) for k in kinds], device)
        self.strange = Picker(
            [np.flatnonzero((of_kind[k] | (table.kind < 0)) & single & ~usual[k]) for k in kinds],
            device,
        )
        self.of_row = Picker([np.flatnonzero(row == r) for r in range(len(table.low))], device)

    def embed(self, name: Tensor) -> Tensor:
        """Unit vectors of names (...,), zero for -1."""
        return self.embedding[name.clamp(min=0)].float() * (name >= 0)[..., None]

    def span(self, name: Tensor) -> tuple[Tensor, Tensor]:
        """Soft and stiff ends (..., 3) of what names (...,) leave plausible, normalised."""
        rows = self.rows[name.clamp(min=0)]
        none = (rows < 0)[..., None]
        low = self.low[rows.clamp(min=0)].masked_fill(none, torch.inf).amin(-2)
        high = self.high[rows.clamp(min=0)].masked_fill(none, -torch.inf).amax(-2)
        return low, high

    def usual_matter(self, name: Tensor) -> Tensor:
        """Most frequent class of the plausible rows of names (...,)."""
        rows = self.rows[name.clamp(min=0)]
        each = torch.nn.functional.one_hot(self.matter[rows.clamp(min=0)], CLASSES)
        return (each * (rows >= 0)[..., None]).sum(-2).argmax(-1)

    def choose_row(self, name: Tensor, chance: Tensor) -> Tensor:
        """One of the plausible rows of each name (...,), all alike."""
        rows = self.rows[name.clamp(min=0)]
        count = (rows >= 0).sum(-1)
        return rows.gather(-1, (chance * count).long()[..., None])[..., 0].clamp(min=0)


def rgb_of_lab(lab: Tensor) -> Tensor:
    """SRGB (..., 3) in [0, 1], clipped, of CIE L*a*b* at D65 (IEC 61966-2-1; CIE 15)."""
    L, a, b = lab.unbind(-1)
    fy = (L + 16) / 116
    f = torch.stack([fy + a / 500, fy, fy - b / 200], -1)
    xyz = torch.where(f > 6 / 29, f**3, 3 * (6 / 29) ** 2 * (f - 4 / 29))
    xyz = xyz * xyz.new_tensor(D65)
    linear = (xyz @ xyz.new_tensor(LINEAR_OF_XYZ).T).clamp(0, 1)
    return torch.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
