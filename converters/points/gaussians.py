"""3D Gaussian splats: what their columns mean.

Columns follow the common PLY: opacity is a logit, scales are logs, rotations are quaternions wxyz,
colours are spherical harmonics with f_rest channel after channel.
"""

from __future__ import annotations

import os
from functools import cache
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from ...fem.errors import InputError
from ...fem.note import Note
from ..files import reading
from ..registry import Format
from .table import PointTable

SH_C0 = 0.28209479177387814
"""The constant spherical harmonic [1], 1 / (2 sqrt(pi))."""
FLAT_SIGMA = 1e-6  # m: the third of a surfel
LARGEST_LOG = 700.0  # of what exp still is a number of
MOST_SIGMA = 1e12  # in the unit of the file, as of coordinates
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
    """Gaussians of a table of splats; a surfel of two scales is as flat as ``FLAT_SIGMA``."""
    if not table.is_splat:
        raise InputError("gaussians.splats_columns", columns=list(table.columns))

    def columns(name: str, count: int) -> np.ndarray:
        return np.stack([np.float64(table.columns[f"{name}_{i}"]) for i in range(count)], axis=1)

    plain = is_activated(table)
    scales = columns("scale", 3 if "scale_2" in table.columns else 2)
    sigmas = scales if plain else np.exp(np.minimum(scales, LARGEST_LOG))
    if sigmas.shape[1] == 2:
        sigmas = np.column_stack([sigmas, np.full(len(sigmas), FLAT_SIGMA)])
    opacity = np.asarray(table.columns["opacity"], dtype=np.float64)
    if not plain:
        opacity = 1 / (1 + np.exp(-np.clip(opacity, -80, 80)))
    return Gaussians(table.positions, sigmas, normalised(columns("rot", 4)), opacity)


def is_activated(table: PointTable) -> bool:
    """Whether opacities are shares and scales lengths, where the common PLY has logits and logs.

    Read as logs, lengths would make most splats larger than half of what they show.
    """
    scales = [np.asarray(v) for name, v in table.columns.items() if name.startswith("scale_")]
    opacity = np.asarray(table.columns["opacity"])
    if not ((opacity >= 0) & (opacity <= 1)).all() or not all((s > 0).all() for s in scales):
        return False
    positions = table.positions[np.isfinite(table.positions).all(axis=1)]
    extent = (
        np.ptp(np.quantile(positions, (0.01, 0.99), axis=0), axis=0).max()
        if len(positions)
        else 0.0
    )
    largest = np.minimum(np.max(scales, axis=0), LARGEST_LOG)
    return bool(np.median(np.exp(largest)) > extent / 2)


def sound_splats(table: PointTable) -> tuple[Bool[np.ndarray, "n"], list[str]]:
    """Which splats have finite numbers, and what to say of the others."""
    with np.errstate(over="ignore"):
        found = gaussians(table)
    finite = np.isfinite(found.means).all(axis=1) & np.isfinite(found.opacity)
    finite &= (np.isfinite(found.sigmas) & (found.sigmas < MOST_SIGMA)).all(axis=1)
    warnings: list[str] = [Note("gaussians.activated")] if is_activated(table) else []
    if lost := int((~finite).sum()):
        warnings.append(Note("gaussians.not_finite", lost=lost, count=len(table)))
    return finite, warnings


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
    """Columns of Gaussian splats as the common PLY has them, float32.

    Parameters
    ----------
    means
        Centres [m], shape (n, 3).
    log_scales
        Natural logarithms of the standard deviations [m], shape (n, 3).
    rotations
        Quaternions w, x, y, z, shape (n, 4).
    opacity
        In [0, 1], shape (n,); the file has its logit.
    f_dc
        Colour of each: (RGB - 1/2) / ``SH_C0``, shape (n, 3).
    f_rest
        Higher harmonics, shape (n, 3, k), by channel.

    Returns
    -------
    dict
        Columns by name, for ``PointTable``.

    Examples
    --------
    >>> import numpy as np
    >>> from autophyx_tet.converters import standard_columns
    >>> one, turn = np.zeros((1, 3)), np.array([[1.0, 0, 0, 0]])
    >>> columns = standard_columns(one, one - 3, turn, np.full(1, 0.5), one)
    >>> columns["scale_0"].tolist(), columns["opacity"].tolist()  # log m, logit of a half
    ([-3.0], [0.0])
    """
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


# Covariances of splats under a deformation: Sigma' = F Sigma F^T, as scales and rotations.

# Sweeps of Jacobi's method: six reach round-off from any start, and a rigid motion needs none.
SWEEPS = 8
PLANES = ((0, 1), (0, 2), (1, 2))
# Below this ratio of its stretches a tet is flat: F^T F has no digits left for the smallest.
FLAT = 1e-4


class Ellipsoids(NamedTuple):
    """Standard deviations ``sigmas`` (n, 3) [m] along the columns of ``axes`` (n, 3, 3)."""

    sigmas: np.ndarray
    axes: np.ndarray


class Polar(NamedTuple):
    """Factors of F = R U: ``rotation`` (n, 3, 3) and symmetric ``stretch`` (n, 3, 3)."""

    rotation: np.ndarray
    stretch: np.ndarray


def polar(F: Float[np.ndarray, "n 3 3"]) -> Polar:
    """Polar decomposition; the rotation is proper even where F turns a tet inside out."""
    squares, basis = _diagonalised(F.transpose(0, 2, 1) @ F)
    sizes = np.sqrt(np.maximum(squares, 0.0))
    flat = sizes.min(axis=1) < FLAT * sizes.max(axis=1)
    inverse = 1 / np.where(flat[:, None], 1.0, sizes)
    rotation = F @ _symmetric(basis, inverse)
    stretch = _symmetric(basis, sizes)
    odd = flat | (np.linalg.det(F) <= 0)
    if odd.any():
        # Polar decomposition by singular values, the smallest of them negative where det F is
        left, sizes, right = np.linalg.svd(F[odd])
        flip = np.sign(np.linalg.det(left @ right))
        sizes[:, 2] *= flip
        left[:, :, 2] *= flip[:, None]
        rotation[odd], stretch[odd] = Polar(
            left @ right, right.transpose(0, 2, 1) @ (sizes[:, :, None] * right)
        )
    return Polar(rotation, stretch)


def _symmetric(basis: np.ndarray, values: np.ndarray) -> np.ndarray:
    return (basis * values[:, None, :]) @ basis.transpose(0, 2, 1)


def stretched(
    sigmas: Float[np.ndarray, "n 3"],
    axes: Float[np.ndarray, "n 3 3"],
    rotation: Float[np.ndarray, "n 3 3"],
    stretch: Float[np.ndarray, "n 3 3"],
) -> Ellipsoids:
    """Ellipsoids after F = ``rotation`` ``stretch``, each axis the one that it was before.

    Jacobi's method in the turned axes of the start: what does not stretch keeps its order and sign.
    """
    root = axes.transpose(0, 2, 1) @ stretch @ axes * sigmas[:, None, :]
    square, basis = _diagonalised(root @ root.transpose(0, 2, 1))
    return Ellipsoids(np.sqrt(np.maximum(square, 0.0)), rotation @ axes @ basis)


def _diagonalised(a: Float[np.ndarray, "n 3 3"]) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues (n, 3) and eigenvectors (n, 3, 3) of symmetric matrices, near to the axes."""
    rows = np.ascontiguousarray(a.transpose(1, 2, 0))  # entry by entry: n lies innermost
    basis = np.zeros_like(rows)
    basis[[0, 1, 2], [0, 1, 2]] = 1.0
    size = np.einsum("iin->n", rows)
    for _ in range(SWEEPS):
        off = max(np.abs(rows[p, q] / np.where(size > 0, size, 1.0)).max() for p, q in PLANES)
        if off < np.finfo(float).eps:
            break
        for p, q in PLANES:
            _rotate(rows, basis, p, q)
    return np.einsum("iin->ni", rows), basis.transpose(2, 0, 1)


def _rotate(rows: np.ndarray, basis: np.ndarray, p: int, q: int) -> None:
    """One Jacobi rotation in the plane (p, q), in place (Golub & Van Loan, 8.5.2)."""
    r, off = 3 - p - q, rows[p, q].copy()
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        tau = (rows[q, q] - rows[p, p]) / (2 * off)
        t = np.where(off == 0, 0.0, np.where(tau < 0, -1.0, 1.0) / (np.abs(tau) + np.hypot(1, tau)))
    c = 1 / np.hypot(1.0, t)
    s = t * c
    rows[p, p] -= t * off
    rows[q, q] += t * off
    rows[p, q] = rows[q, p] = 0.0
    with_p, with_q = rows[r, p].copy(), rows[r, q].copy()
    rows[r, p] = rows[p, r] = c * with_p - s * with_q
    rows[r, q] = rows[q, r] = s * with_p + c * with_q
    first, second = basis[:, p].copy(), basis[:, q].copy()
    basis[:, p], basis[:, q] = c * first - s * second, s * first + c * second


def matrices_of(rotations: Float[np.ndarray, "n 4"]) -> Float[np.ndarray, "n 3 3"]:
    """Rotation matrices of unit quaternions wxyz."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(rotations, scalar_first=True).as_matrix()


def quaternions_of(matrices: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, "n 4"]:
    """Unit quaternions wxyz of rotation matrices."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(matrices).as_quat(scalar_first=True)


# Spherical harmonics of splats and how they turn: band by band, exactly.

# Bands above the constant one and their coefficients: 3DGS has up to 3, .spz up to 4.
BANDS = (3, 5, 7, 9)
COUNTS = tuple(int(count) for count in np.cumsum(BANDS))


def band_values(degree: int, directions: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n m"]:
    """Real harmonics of one ``degree`` (1 to 4) in unit ``directions``, in the order of 3DGS.

    Signs and order are those of Kerbl et al. (2023), gaussian-splatting/utils/sh_utils.py; the
    fourth band is that of PlenOctrees (Yu et al. 2021), of which the file is taken.
    """
    x, y, z = np.moveaxis(directions, -1, 0)
    xx, yy, zz = x * x, y * y, z * z
    if degree == 1:
        values = [-y, z, -x]
        factors = [0.4886025119029199] * 3
    elif degree == 2:
        values = [x * y, y * z, 2 * zz - xx - yy, x * z, xx - yy]
        factors = [1.0925484305920792, -1.0925484305920792, 0.31539156525252005,
                   -1.0925484305920792, 0.5462742152960396]  # fmt: skip
    elif degree == 3:
        values = [y * (3 * xx - yy), x * y * z, y * (4 * zz - xx - yy),
                  z * (2 * zz - 3 * xx - 3 * yy), x * (4 * zz - xx - yy), z * (xx - yy),
                  x * (xx - 3 * yy)]  # fmt: skip
        factors = [-0.5900435899266435, 2.890611442640554, -0.4570457994644658,
                   0.3731763325901154, -0.4570457994644658, 1.445305721320277,
                   -0.5900435899266435]  # fmt: skip
    else:
        values = [x * y * (xx - yy), y * z * (3 * xx - yy), x * y * (7 * zz - 1),
                  y * z * (7 * zz - 3), zz * (35 * zz - 30) + 3, x * z * (7 * zz - 3),
                  (xx - yy) * (7 * zz - 1), x * z * (xx - 3 * yy),
                  xx * (xx - 3 * yy) - yy * (3 * xx - yy)]  # fmt: skip
        factors = [2.5033429417967046, -1.7701307697799304, 0.9461746957575601,
                   -0.6690465435572892, 0.10578554691520431, -0.6690465435572892,
                   0.47308734787878004, -1.7701307697799304, 0.6258357354491761]  # fmt: skip
    return np.stack([f * v for f, v in zip(factors, values, strict=True)], axis=-1)


def band_rotations(
    degree: int, rotations: Float[np.ndarray, "n 3 3"]
) -> Float[np.ndarray, "n m m"]:
    """Matrices D that turn the coefficients of a band: Y(d) . D c = Y(R^T d) . c for all d.

    A band is closed under rotation, so 2 l + 1 directions decide: D = Y(P)^-1 Y(P R).
    """
    directions, inverse = _sampled(degree)
    return inverse @ band_values(degree, directions @ rotations)


def turned_harmonics(
    harmonics: Float[np.ndarray, "n channels k"], rotations: Float[np.ndarray, "n 3 3"]
) -> Float[np.ndarray, "n channels k"]:
    """Coefficients above the constant one, turned by the rotation of every splat."""
    result, start = np.empty_like(harmonics), 0
    for degree, width in enumerate(BANDS, 1):
        if start >= harmonics.shape[2]:
            break
        band = slice(start, start + width)
        matrices = band_rotations(degree, rotations).astype(harmonics.dtype)
        result[:, :, band] = harmonics[:, :, band] @ matrices.transpose(0, 2, 1)
        start += width
    return result


@cache
def _sampled(degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Directions that tell a band's functions apart, and the inverse of its values there.

    Of fifty draws with a fixed seed the best conditioned one.
    """
    rng = np.random.default_rng(0)
    draws = rng.normal(size=(50, BANDS[degree - 1], 3))
    draws /= np.linalg.norm(draws, axis=2, keepdims=True)
    best = min(draws, key=lambda d: np.linalg.cond(band_values(degree, d)))
    return best, np.linalg.inv(band_values(degree, best))


# .splat: rows of 32 bytes, a Gaussian each, without harmonics.


def read_splat(path: str | os.PathLike) -> PointTable:
    """Read .splat: rows of 32 bytes, position, scale, RGBA and rotation as bytes."""
    with reading(path, Note("gaussians.splat_file")) as source:
        if source.stat().st_size % 32:
            raise InputError("gaussians.bytes_wanted", path=path, st_size=source.stat().st_size)
        dtype = [("p", "<f4", 3), ("s", "<f4", 3), ("rgba", "u1", 4), ("q", "u1", 4)]
        rows = np.fromfile(source, dtype=dtype)
        rotations = normalised((rows["q"] - 128.0) / 128)
        with np.errstate(divide="ignore"):  # a flat splat has scale 0: its log is -inf
            log_scales = np.log(rows["s"])
        colour = (rows["rgba"][:, :3] / 255 - 0.5) / SH_C0
        alpha = rows["rgba"][:, 3] / 255
        return PointTable(standard_columns(rows["p"], log_scales, rotations, alpha, colour))


SPLAT_ROWS = Format("32-byte splats", (".splat",), read_splat)
