"""3D Gaussian splats: what their columns mean, packed and 32-byte files, volumes, opacity grid.

Columns follow the common PLY: opacity is a logit, scales are logs, rotations are quaternions wxyz,
colours are spherical harmonics with f_rest channel after channel.
"""

from __future__ import annotations

import os
from typing import NamedTuple

import numpy as np

from ...fem.device import start_warp
from ...fem.errors import InputError
from ...predictors.grid import Grid
from ..files import reading
from .ply import Ply
from .table import PointTable

SH_C0 = 0.28209479177387814  # 1 / (2 sqrt(pi)), the constant spherical harmonic
_CHUNK = 256  # splats a chunk of a packed PLY
_LOGIT_EDGE = 1e-6  # opacities 0 and 1 are kept this far from an infinite logit
REACH = 3.0  # standard deviations at which a Gaussian ends: opacity 1 % of its peak
MAX_CELLS = 8  # a Gaussian covers at most this many cells on either side: bad fits are clamped


class Gaussians(NamedTuple):
    """Splats in plain units.

    ``means`` [m] (n, 3), ``sigmas`` standard deviations [m] (n, 3), ``rotations`` unit quaternions
    wxyz (n, 4), ``opacity`` in [0, 1] (n,).
    """

    means: np.ndarray
    sigmas: np.ndarray
    rotations: np.ndarray
    opacity: np.ndarray

    @property
    def volumes(self) -> np.ndarray:
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

    rotations = _normalised(columns("rot", 4))
    opacity = 1 / (1 + np.exp(-np.clip(np.float64(table.columns["opacity"]), -80, 80)))
    return Gaussians(table.positions, np.exp(columns("scale", 3)), rotations, opacity)


def _normalised(rotations: np.ndarray) -> np.ndarray:
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


def read_splat(path: str | os.PathLike) -> PointTable:
    """Read .splat: rows of 32 bytes, position, scale, RGBA and rotation as bytes."""
    with reading(path, "a .splat file of 32-byte rows") as source:
        if source.stat().st_size % 32:
            raise InputError(f"{path} has {source.stat().st_size} bytes, wanted a multiple of 32")
        dtype = [("p", "<f4", 3), ("s", "<f4", 3), ("rgba", "u1", 4), ("q", "u1", 4)]
        rows = np.fromfile(source, dtype=dtype)
        rotations = _normalised((rows["q"] - 128.0) / 128)
        with np.errstate(divide="ignore"):  # a flat splat has scale 0: its log is -inf
            log_scales = np.log(rows["s"])
        colour = (rows["rgba"][:, :3] / 255 - 0.5) / SH_C0
        alpha = rows["rgba"][:, 3] / 255
        return PointTable(standard_columns(rows["p"], log_scales, rotations, alpha, colour))


def is_packed(ply: Ply) -> bool:
    """Whether a PLY holds splats packed in chunks of 256."""
    return "chunk" in ply.elements and "packed_position" in (ply.vertex.dtype.names or ())


def unpack(ply: Ply) -> dict[str, np.ndarray]:
    """Columns of a chunk-packed PLY: 11-10-11 bit positions and scales between chunk bounds."""
    chunk, vertex = ply.elements["chunk"], ply.vertex
    if len(chunk) * _CHUNK < len(vertex):
        raise InputError(f"{len(vertex)} packed splats need more than {len(chunk)} chunks of 256")
    of = np.arange(len(vertex)) // _CHUNK

    def between(names: str, share: np.ndarray) -> np.ndarray:
        low, high = (
            np.stack([chunk[f"{end}_{name}"][of] for name in names.split()], axis=1)
            for end in ("min", "max")
        )
        return low * (1 - share) + high * share

    colour = _bits(vertex["packed_color"], (8, 8, 8, 8))
    rgb = colour[:, :3]
    if "min_r" in (chunk.dtype.names or ()):
        rgb = between("r g b", rgb)
    rest = None
    if "sh" in ply.elements:
        harmonics = ply.elements["sh"]
        level = np.stack([harmonics[name] for name in harmonics.dtype.names or ()], axis=1)
        inner = (level + 0.5) / 256
        rest = (np.where(level == 0, 0, np.where(level == 255, 1, inner)) - 0.5) * 8
    return standard_columns(
        between("x y z", _bits(vertex["packed_position"], (11, 10, 11))),
        between("scale_x scale_y scale_z", _bits(vertex["packed_scale"], (11, 10, 11))),
        _smallest_three(vertex["packed_rotation"]),
        colour[:, 3],
        (rgb - 0.5) / SH_C0,
        rest,
    )


def _bits(packed: np.ndarray, widths: tuple[int, ...]) -> np.ndarray:
    """Bit fields of uint32, highest first, each as a share of its largest value."""
    shifts = np.cumsum((0, *widths[:0:-1]))[::-1]
    fields = [
        packed >> np.uint32(s) & np.uint32(2**w - 1) for s, w in zip(shifts, widths, strict=True)
    ]
    return np.stack(fields, axis=1) / (2.0 ** np.array(widths) - 1)


def _smallest_three(packed: np.ndarray) -> np.ndarray:
    """Quaternions wxyz from the index of the largest component and the others, 10 bits each."""
    three = (_bits(packed, (2, 10, 10, 10))[:, 1:] - 0.5) * 2**0.5
    largest = np.sqrt(np.maximum(0, 1 - (three**2).sum(axis=1)))
    place = (packed >> np.uint32(30)).astype(np.int64)
    result = np.empty((len(packed), 4))
    others = np.array([[j for j in range(4) if j != i] for i in range(4)])[place]
    np.put_along_axis(result, others, three, axis=1)
    np.put_along_axis(result, place[:, None], largest[:, None], axis=1)
    return result


def opacity_grid(splats: Gaussians, grid: Grid) -> np.ndarray:
    """Summed opacity at the centre of every cell: sum of opacity exp(-d^T S^-1 d / 2).

    Each Gaussian is widened by half a cell, so that none falls between centres, and ends at three
    standard deviations or ``MAX_CELLS`` cells.
    """
    from ..grids.kernels_volume import add_gaussians

    warp = start_warp()
    sigmas = np.clip(np.hypot(splats.sigmas / grid.h, 0.5), None, MAX_CELLS / REACH)  # in cells
    axes = _rotation_matrices(splats.rotations)
    means = grid.to_index(splats.means)
    reach = REACH * np.sqrt(np.einsum("nij,nj->ni", axes**2, sigmas**2))  # of the box around each
    lower = np.clip(np.ceil(means - reach), 0, grid.shape)
    upper = np.clip(np.floor(means + reach), -1, np.array(grid.shape) - 1)
    whiten = axes.transpose(0, 2, 1) / sigmas[:, :, None]
    density = warp.zeros(grid.shape, dtype=warp.float64, device="cpu")
    warp.launch(
        add_gaussians,
        len(means),
        [
            warp.array(means, dtype=warp.vec3d, device="cpu"),
            warp.array(whiten, dtype=warp.mat33d, device="cpu"),
            warp.array(splats.opacity, dtype=warp.float64, device="cpu"),
            warp.array(lower.astype(np.int32), dtype=warp.vec3i, device="cpu"),
            warp.array(upper.astype(np.int32), dtype=warp.vec3i, device="cpu"),
            warp.float64(REACH),
        ],
        [density],
        device="cpu",
    )
    return density.numpy()


def _rotation_matrices(q: np.ndarray) -> np.ndarray:
    """Rotation matrices (n, 3, 3) of unit quaternions wxyz; columns are the axes."""
    w, x, y, z = q.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
