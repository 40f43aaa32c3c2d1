"""Solids as ordered lists of primitives, and their rasteriser: part labels on a cube of voxels.

A later primitive overrides an earlier one where they overlap; one without a part carves. The
rasteriser evaluates the implicit functions of many objects at once, on a CPU or a GPU.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import torch

BOX, CYLINDER, ELLIPSOID, TORUS, NOTHING = range(5)
EMPTY = 255  # label of a voxel outside every part
MAX_PARTS = 6
# A part thinner than this many cells would vanish between voxel centres.
MIN_HALF_CELLS = 0.72
_WIDTH = 18  # kind, part, centre (3), rotation (9), half sizes (3), taper


def rotation_about(axis: str, degrees: float) -> np.ndarray:
    """Rotation matrix about a coordinate axis, (3, 3)."""
    i = "xyz".index(axis)
    j, k = (i + 1) % 3, (i + 2) % 3
    angle = np.radians(degrees)
    out = np.eye(3)
    out[j, j] = out[k, k] = np.cos(angle)
    out[k, j], out[j, k] = np.sin(angle), -np.sin(angle)
    return out


def along(direction) -> np.ndarray:
    """Return a rotation that takes the local z axis to ``direction``, (3, 3)."""
    z = np.asarray(direction, dtype=np.float64)
    z = z / np.linalg.norm(z)
    x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)


@dataclass
class Solid:
    """An object under construction: z is up, the unit of length is free."""

    parts: list[str] = field(default_factory=list)
    rows: list[np.ndarray] = field(default_factory=list)

    def _add(self, kind: int, part: str | None, center, half, turn, taper: float = 1.0) -> None:
        if part is not None and part not in self.parts:
            self.parts.append(part)
        index = -1 if part is None else self.parts.index(part)
        turn = np.eye(3) if turn is None else turn
        values = [kind, index, *center, *turn.ravel(), *half, taper]
        self.rows.append(np.array(values, dtype=np.float32))

    def box(self, part: str | None, center, half, turn=None) -> None:
        """Add a box with half sizes ``half``."""
        self._add(BOX, part, center, half, turn)

    def ball(self, part: str | None, center, half, turn=None) -> None:
        """Add an ellipsoid with half axes ``half`` (a number for a sphere)."""
        self._add(ELLIPSOID, part, center, np.broadcast_to(half, 3), turn)

    def ring(self, part: str | None, center, radius, thickness, turn=None) -> None:
        """Add a torus about the local z axis."""
        self._add(TORUS, part, center, (radius, radius, thickness), turn)

    def rod(self, part: str | None, start, end, radius, taper: float = 1.0) -> None:
        """Add a round rod; its radius at ``end`` is ``taper`` times that at ``start``."""
        start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
        half = (radius, radius, np.linalg.norm(end - start) / 2)
        self._add(CYLINDER, part, (start + end) / 2, half, along(end - start), taper)

    def tub(self, part: str, start, end, radius, taper: float, wall: float) -> None:
        """Add a round vessel with a floor, open at ``end``."""
        start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
        self.rod(part, start, end, radius, taper)
        lift = (end - start) / np.linalg.norm(end - start) * wall
        self.rod(None, start + lift, end + lift, radius - wall, taper)

    @property
    def bounds(self) -> np.ndarray:
        """Box around all primitives that add matter, (2, 3)."""
        boxes = []
        for row in self.rows:
            if row[1] >= 0:
                half = row[14:17].copy()
                if row[0] == TORUS:
                    half = np.array([row[14] + row[16], row[14] + row[16], row[16]])
                if row[0] == CYLINDER:
                    half[:2] *= max(1.0, row[17])
                reach = np.abs(row[5:14].reshape(3, 3)) @ half
                boxes.append((row[2:5] - reach, row[2:5] + reach))
        low, high = np.array(boxes).transpose(1, 0, 2)
        return np.stack([low.min(axis=0), high.max(axis=0)])


def pack(solids: list[Solid]) -> np.ndarray:
    """Primitives of many solids, scaled into the cube [-1, 1]^3, shape (n, most rows, 18)."""
    most = max(len(solid.rows) for solid in solids)
    out = np.zeros((len(solids), most, _WIDTH), dtype=np.float32)
    out[:, :, 0] = NOTHING
    for solid, rows in zip(solids, out, strict=True):
        low, high = solid.bounds
        scale = 2 / (high - low).max()
        packed = np.stack(solid.rows)
        packed[:, 2:5] = (packed[:, 2:5] - (low + high) / 2) * scale
        packed[:, 14:17] *= scale
        rows[: len(packed)] = packed
    return out


def rasterise(rows: torch.Tensor, *, cells: int, pad: int = 1) -> torch.Tensor:
    """Part labels (n, cells, cells, cells) uint8 of packed primitives; ``EMPTY`` outside.

    The longest side of an object spans ``cells - 2 pad`` cells. Axis order is x, y, z.
    """
    import torch

    n = rows.shape[0]
    line = (torch.arange(cells, device=rows.device, dtype=torch.float32) + 0.5) / cells * 2 - 1
    line = line * cells / (cells - 2 * pad)
    points = torch.stack(torch.meshgrid(line, line, line, indexing="ij"), dim=-1).reshape(-1, 3)
    label = torch.full((n, points.shape[0]), EMPTY, dtype=torch.uint8, device=rows.device)
    thin = MIN_HALF_CELLS * 2 / (cells - 2 * pad)
    for index in range(rows.shape[1]):
        row = rows[:, index]
        inside = _inside(row, points, thin) & (row[:, :1] != NOTHING)
        part = torch.where(row[:, 1] < 0, EMPTY, row[:, 1]).to(torch.uint8)
        label = torch.where(inside, part[:, None], label)
    return label.reshape(n, cells, cells, cells)


def _inside(row: torch.Tensor, points: torch.Tensor, thin: float) -> torch.Tensor:
    """Whether each point lies in one primitive of each object, (n, points)."""
    import torch

    turn = row[:, 5:14].reshape(-1, 3, 3)
    # Local coordinates R^T (x - c), (n, 3, points).
    local = torch.einsum("nij,pi->njp", turn, points) - torch.einsum(
        "nij,ni->nj", turn, row[:, 2:5]
    ).unsqueeze(-1)
    solid = row[:, 1:2] >= 0
    half = torch.where(solid, row[:, 14:17].clamp(min=thin), row[:, 14:17].clamp(min=1e-6))
    x, y, z = (local / half.unsqueeze(-1)).abs().unbind(1)
    kind = row[:, :1]
    height = (local[:, 2] / half[:, 2:3]).clamp(-1, 1)
    girth = 1 + (row[:, 17:18] - 1) * (height + 1) / 2
    box = torch.maximum(torch.maximum(x, y), z) <= 1
    tube = (x * x + y * y <= girth * girth) & (z <= 1)
    ball = x * x + y * y + z * z <= 1
    flat = (local[:, 0] ** 2 + local[:, 1] ** 2).sqrt() - half[:, :1]
    ring = flat * flat + local[:, 2] ** 2 <= half[:, 2:3] ** 2
    return torch.where(
        kind == BOX,
        box,
        torch.where(kind == CYLINDER, tube, torch.where(kind == TORUS, ring, ball)),
    )
