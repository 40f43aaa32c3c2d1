"""What is measured of a piece's cells: colour, opacity, finish, and its form in the whole."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

# Of a cell: red, green, blue and opacity in [0, 1], then ``surface_colour.Finish``.
LOOK = 7
# Of a piece. The seven of opacity and finish, which a scan lacks, are the last.
FEATURES = (
    "L", "a", "b", "chroma", "a of chroma", "b of chroma", "L deviation", "a deviation",
    "b deviation", "share", "log share", "log thickness", "log greatest thickness", "log pieces",
    "log variance 1", "log variance 2", "log variance 3", "height", "lowest", "highest",
    "width", "depth", "tallness", "log fill", "opacity", "opacity deviation", "metallic",
    "reflectance", "roughness",
)  # fmt: skip
PLAIN = 24
_GREY = 20.0  # of chroma: below, a hue says little
_CONNECTED = np.ones((3, 3, 3))
# sRGB to XYZ under D65, IEC 61966-2-1, over the white point.
_XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.072175],
     [0.0193339, 0.119192, 0.9503041]]
) / np.array([[0.95047], [1.0], [1.08883]])  # fmt: skip


def lab(rgb: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """CIE L*, a*, b* of sRGB colours in [0, 1] (CIE 15:2004)."""
    c = np.clip(rgb, 0.0, 1.0)
    linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    t = linear @ _XYZ.T
    f = np.where(t > 216 / 24389, np.cbrt(t), (24389 / 27 * t + 16) / 116)
    x, y, z = f.T
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=1)


def measure(
    cells: Int[np.ndarray, "n 3"], looks: Float[np.ndarray, "n look"], piece: Int[np.ndarray, "n"]
) -> Float[np.ndarray, "pieces features"]:
    """Return ``FEATURES`` of every piece; of lengths, over the longest side of the whole.

    Parameters
    ----------
    cells
        Indices of a thing's cells on an upright grid.
    looks
        ``LOOK`` numbers of each.
    piece
        The piece of each, from 0, none empty.
    """
    low, high = cells.min(axis=0), cells.max(axis=0) + 1
    sides = high - low
    colours = lab(looks[:, :3])
    rows = []
    for k in range(int(piece.max()) + 1):
        mine = piece == k
        seen = looks[mine, 3:].astype(np.float64)
        form = _form(cells[mine], len(cells), low, sides)
        rows.append([*_colour(colours[mine]), *form, seen[:, 0].mean(), seen[:, 0].std(),
                     *seen[:, 1:].mean(axis=0)])  # fmt: skip
    return np.array(rows)


def _colour(colours: Float[np.ndarray, "n 3"]) -> list[float]:
    mean = colours.mean(axis=0)
    chroma = float(np.hypot(*mean[1:]))
    return [*mean, chroma, *(mean[1:] / max(chroma, _GREY)), *colours.std(axis=0)]


def _form(
    cells: Int[np.ndarray, "n 3"], total: int, low: np.ndarray, sides: np.ndarray
) -> list[float]:
    """Share, thickness, pieces, extents and place of a piece in its whole."""
    from scipy.ndimage import distance_transform_edt, label

    longest = sides.max()
    first, last = cells.min(axis=0), cells.max(axis=0) + 1
    box = np.pad(np.zeros(last - first, dtype=bool), 1)
    box[tuple((cells - first + 1).T)] = True
    depth = np.asarray(distance_transform_edt(box))[box]
    _, pieces = label(box, structure=_CONNECTED)  # type: ignore
    spread = (cells - cells.mean(axis=0)) / longest
    # 1e-5: of a sheet one cell thick a variance is nothing; (1/64)^2 / 12 is 2e-5.
    variance = np.linalg.eigvalsh(spread.T @ spread / len(cells) + 1e-5 * np.eye(3))[::-1]
    share = len(cells) / total
    heights = (np.array([cells[:, 2].mean(), first[2], last[2]]) - low[2]) / sides[2]
    return [
        share, np.log(share), np.log(depth.mean() / longest), np.log(depth.max() / longest),
        np.log(pieces), *np.log(variance), *heights, *(sides / longest),
        np.log(len(cells) / np.prod(last - first)),
    ]  # fmt: skip
