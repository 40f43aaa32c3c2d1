"""What of a body sees what: segments that leave its tets, and depths below its surface."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from ..device import start_warp

# Ends of a segment may lie on the surface: this share [1] of its length is not looked at there.
TRIMMED = 2e-3


class Sight:
    """The boundary of tets in a tree of boxes, in single precision of the body's own size.

    Parameters
    ----------
    points
        Positions [m], shape (points, 3).
    faces
        Corners of the boundary's faces, shape (faces, 3).
    """

    def __init__(self, points: Float[np.ndarray, "n 3"], faces: Int[np.ndarray, "faces 3"]) -> None:
        used = points[np.unique(faces)]
        self._centre = used.mean(axis=0)
        self._size = float(np.ptp(used, axis=0).max())
        wp = start_warp()
        corners = wp.array(faces.astype(np.int32).ravel(), dtype=int, device="cpu")
        self._mesh = wp.Mesh(points=self._vectors(points), indices=corners)

    def _vectors(self, points: np.ndarray):
        wp = start_warp()
        scaled = ((points - self._centre) / self._size).astype(np.float32)
        return wp.array(scaled, dtype=wp.vec3, device="cpu")

    def crossed(
        self, start: Float[np.ndarray, "n 3"], end: Float[np.ndarray, "n 3"]
    ) -> Bool[np.ndarray, "n"]:
        """Whether the segments between points [m] in the body, or on it, leave it."""
        from . import kernels_springs as k

        wp, trim = start_warp(), TRIMMED * (end - start)
        hit = wp.zeros(len(start), dtype=int, device="cpu")
        ends = [self._vectors(start + trim), self._vectors(end - trim)]
        wp.launch(k.crosses, len(start), inputs=[self._mesh.id, *ends, hit], device="cpu")
        return hit.numpy().astype(bool)

    def depth(self, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
        """Distance [m] of points from the surface."""
        from . import kernels_springs as k

        wp = start_warp()
        out = wp.zeros(len(points), dtype=wp.float32, device="cpu")
        inputs = [self._mesh.id, self._vectors(points), out]
        wp.launch(k.depths, len(points), inputs=inputs, device="cpu")
        return self._size * out.numpy().astype(np.float64)
