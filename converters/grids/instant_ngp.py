"""The density of an instant-ngp snapshot, in the axes of its dataset."""

from __future__ import annotations

import gzip
import os
from functools import partial
from itertools import islice

import numpy as np

from ...fem.errors import InputError
from ..files import reading
from ..registry import Format
from .density import DensityGrid

# instant-ngp stores density times its smallest step through the unit cube.
_NGP_STEP = 3**0.5 / 1024
_NGP_THRESHOLD = 0.01  # of that product: instant-ngp's own for an occupied cell
_PIECE = 1 << 20  # bytes unpacked at a time
_MAX_BYTES = 1 << 32  # unpacked snapshot


def read_instant_ngp(path: str | os.PathLike) -> DensityGrid:
    """Read the density of an instant-ngp snapshot, finest cascade, in the axes of its dataset."""
    with reading(path, "an instant-ngp snapshot (.ingp, .msgpack)") as source:
        try:
            import msgpack
        except ImportError as error:
            raise InputError("snapshots need msgpack: pip install 'autophyx-tet[nerf]'") from error
        content = source.read_bytes()
        if content[:2] == b"\x1f\x8b":
            with gzip.open(source) as file:  # a read of all would set the whole bound aside
                pieces = iter(partial(file.read, _PIECE), b"")
                content = b"".join(islice(pieces, _MAX_BYTES // _PIECE))
        snapshot = msgpack.unpackb(content, strict_map_key=False)["snapshot"]
        n = int(snapshot["density_grid_size"])
        raw = np.frombuffer(snapshot["density_grid_binary"], dtype="<f2")
        if n < 1 or n & (n - 1) or raw.size < n**3:
            raise InputError(f"{raw.size} densities of a grid of {n}^3; wanted a power of two")
        cube = raw[_morton(n)].astype(np.float32) / np.float32(_NGP_STEP)
        dataset = snapshot.get("nerf", {}).get("dataset", {})
        scale, offset = float(dataset.get("scale", 1.0)), np.array(dataset.get("offset", [0.0] * 3))
        # The snapshot's axes are the dataset's y, z, x; its unit cube is scale x + offset.
        return DensityGrid(
            (0.0 - offset) / scale,
            (1.0 - offset) / scale,
            np.ascontiguousarray(cube.transpose(2, 0, 1)) * np.float32(scale),
            threshold=_NGP_THRESHOLD / _NGP_STEP * scale,
        )


INSTANT_NGP = Format("instant-ngp snapshot", (".ingp", ".msgpack"), read_instant_ngp)


def _morton(n: int) -> np.ndarray:
    """Place of cell (x, y, z) in Morton order, x the lowest bit, shape (n, n, n)."""
    axis = np.arange(n)
    spread = np.zeros(n, dtype=np.int64)
    for bit in range(n.bit_length()):
        spread |= (axis >> bit & 1) << 3 * bit
    return spread[:, None, None] | spread[None, :, None] << 1 | spread[None, None, :] << 2
