"""3D Gaussian splats: what their columns mean.

Columns follow the common PLY: opacity is a logit, scales are logs, rotations are quaternions wxyz,
colours are spherical harmonics with f_rest channel after channel.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ....fem.errors import InputError
from ..table import PointTable

SH_C0 = 0.28209479177387814  # 1 / (2 sqrt(pi)), the constant spherical harmonic
_LOGIT_EDGE = 1e-6  # opacities 0 and 1 are kept this far from an infinite logit


class Gaussians(NamedTuple):
    """Splats in plain units.

    ``means`` [m] (n, 3), ``sigmas`` standard deviations [m] (n, 3), ``rotations`` unit quaternions
    wxyz (n, 4), ``opacity`` in [0, 1] (n,).
    """

    means: Float[np.ndarray, "n 3"]
    sigmas: Float[np.ndarray, "n 3"]
    rotations: Float[np.ndarray, "n 4"]
    opacity: Float[np.ndarray, "n"]

    @property
    def volumes(self) -> Float[np.ndarray, "n"]:
        """Opacity-weighted volume [m^3] of each: its opacity integrated over space."""
        return self.opacity * (2 * np.pi) ** 1.5 * self.sigmas.prod(axis=1)


def gaussians(table: PointTable) -> Gaussians:
    """Gaussians of a table of splats."""
    if not table.is_splat:
        raise InputError(
            f"no splats: columns opacity, scale_*, rot_* wanted, {list(table.columns)}"
        )

    def columns(name: str, count: int) -> np.ndarray:
        return np.stack([np.float64(table.columns[f"{name}_{i}"]) for i in range(count)], axis=1)

    rotations = normalised(columns("rot", 4))
    opacity = 1 / (1 + np.exp(-np.clip(np.float64(table.columns["opacity"]), -80, 80)))
    return Gaussians(table.positions, np.exp(columns("scale", 3)), rotations, opacity)


def normalised(rotations: np.ndarray) -> np.ndarray:
    """Quaternions of length 1; one of length 0 becomes the identity."""
    length = np.linalg.norm(rotations, axis=1, keepdims=True)
    return np.where(length > 0, rotations / np.where(length > 0, length, 1), [1.0, 0, 0, 0])


def standard_columns(
    means: np.ndarray,
    log_scales: np.ndarray,
    rotations: np.ndarray,
    opacity: np.ndarray,
    f_dc: np.ndarray,
    f_rest: np.ndarray | None = None,
) -> dict[str, np.ndarray]:
    """Columns of the common PLY, float32: opacity in [0, 1], ``f_rest`` (n, 3, k) by channel."""
    opacity = np.clip(opacity, _LOGIT_EDGE, 1 - _LOGIT_EDGE)
    columns = dict(zip("xyz", means.T, strict=True))
    columns |= {f"f_dc_{i}": f_dc[:, i] for i in range(3)}
    if f_rest is not None:
        flat = f_rest.reshape(len(means), -1)
        columns |= {f"f_rest_{i}": flat[:, i] for i in range(flat.shape[1])}
    columns |= {"opacity": np.log(opacity / (1 - opacity))}
    columns |= {f"scale_{i}": log_scales[:, i] for i in range(3)}
    columns |= {f"rot_{i}": rotations[:, i] for i in range(4)}
    return {name: np.ascontiguousarray(v, dtype=np.float32) for name, v in columns.items()}
