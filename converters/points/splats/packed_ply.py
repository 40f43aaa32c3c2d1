"""SuperSplat's packed PLY: chunks of 256 splats, values as bits between the bounds of a chunk."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ....fem.errors import InputError
from .gaussians import SH_C0, standard_columns

_CHUNK = 256  # splats a chunk
Elements = Mapping[str, np.ndarray]


def is_packed(elements: Elements) -> bool:
    """Whether the elements of a PLY are splats packed in chunks of 256."""
    return "chunk" in elements and "packed_position" in (elements["vertex"].dtype.names or ())


def unpack(elements: Elements) -> dict[str, np.ndarray]:
    """Columns of a chunk-packed PLY: 11-10-11 bit positions and scales between chunk bounds."""
    chunk, vertex = elements["chunk"], elements["vertex"]
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
    if "sh" in elements:
        harmonics = elements["sh"]
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
