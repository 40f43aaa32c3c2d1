"""Encoders without weights: colour and mere presence, the paper's ablation inputs."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

CELL = 4  # pixels averaged along a side: the resolution of the embedded encoder


class Rgb:
    """The colour itself, averaged over 4 x 4 pixels."""

    name = "rgb"
    dim = 3

    def dense(
        self, images: Float[np.ndarray, "views height width channels"]
    ) -> Float[np.ndarray, "views rows columns dim"]:
        """Mean colour of every cell; pixels of an incomplete last cell are left out."""
        views, height, width = images.shape[:3]
        rows, columns = height // CELL, width // CELL
        cut = images[:, : rows * CELL, : columns * CELL, :3]
        cells = cut.reshape(views, rows, CELL, columns, CELL, 3)
        return cells.mean(axis=(2, 4)).astype(np.float32)


class Occupancy:
    """The number 1 wherever something is seen."""

    name = "occupancy"
    dim = 1

    def dense(
        self, images: Float[np.ndarray, "views height width channels"]
    ) -> Float[np.ndarray, "views rows columns dim"]:
        """Ones, at the resolution of ``Rgb``."""
        views, height, width = images.shape[:3]
        return np.ones((views, height // CELL, width // CELL, 1), dtype=np.float32)
