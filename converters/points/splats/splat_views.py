"""Pictures of Gaussian splats on a CPU: projected ellipses (EWA), sorted by depth, blended.

After Zwicker et al. 2001 and Kerbl et al. 2023, whose rasterisers want CUDA.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ....predictors.images.cameras import Camera
from ..table import PointTable
from .covariances import matrices_of
from .gaussians import SH_C0, gaussians
from .harmonics import BANDS, COUNTS, band_values

# Every ellipse is widened by this variance [px^2], so that none falls between the pixels.
WIDENED = 0.3
# Splats nearer than this share of the camera's distance from the origin of depths are left out.
NEAREST = 0.01
# Standard deviations to which an ellipse is drawn: fainter than 1/255 beyond, if it is opaque.
DEVIATIONS = 3.33


class Ellipses(NamedTuple):
    """Splats in a picture, the nearest first.

    ``rows`` of the table, ``centre`` [px] (n, 2), ``conic`` (n, 3) the entries xx, xy, yy of the
    inverse covariance [1/px^2], ``reach`` (n, 2) half sides of the box [px].
    """

    rows: np.ndarray
    centre: np.ndarray
    conic: np.ndarray
    reach: np.ndarray


def splat_view(
    table: PointTable, camera: Camera, *, background: float = 1.0
) -> Float[np.ndarray, "height width 3"]:
    """Picture of splats with values in [0, 1] on a grey ``background``, as the camera sees them.

    ``InputError`` where the table has no splats.
    """
    from ....fem.device import start_warp

    wp = start_warp()
    from .kernels_splats import blend

    found = gaussians(table)
    roots = matrices_of(found.rotations) * found.sigmas[:, None, :]
    drawn = _ellipses(found.means, roots, camera)
    image = np.zeros((*camera.size, 4), dtype=np.float32)
    image[..., 3] = 1.0
    canvas = wp.array(image, dtype=wp.vec4, device="cpu")
    if len(drawn.rows):
        colours = _colours(table, found.means, camera)
        given = [
            wp.array(np.ascontiguousarray(values, dtype=np.float32), dtype=kind, device="cpu")
            for values, kind in (
                (drawn.centre, wp.vec2),
                (drawn.conic, wp.vec3),
                (drawn.reach, wp.vec2),
                (found.opacity[drawn.rows], float),
                (colours[drawn.rows], wp.vec3),
            )
        ]
        wp.launch(blend, 1, [*given, canvas], device="cpu")
    seen = canvas.numpy().astype(np.float64)
    return np.clip(seen[..., :3] + background * seen[..., 3:], 0.0, 1.0)


def _ellipses(
    means: Float[np.ndarray, "n 3"], roots: Float[np.ndarray, "n 3 3"], camera: Camera
) -> Ellipses:
    """Project: J W Sigma W^T J^T of the camera's axes W and of the perspective's derivative J.

    ``roots`` are A of Sigma = A A^T.
    """
    seen = camera.project(means)
    depth = seen[:, 2]
    finite = np.isfinite(seen).all(axis=1) & np.isfinite(roots).all(axis=(1, 2))
    ahead = depth > NEAREST * np.median(np.abs(depth[finite])) if finite.any() else finite
    rows = np.flatnonzero(finite & ahead)
    rows = rows[np.argsort(depth[rows], kind="stable")]
    turned = camera.pose[:3, :3].T @ roots.transpose(1, 2, 0).reshape(3, -1)
    right, above, behind = turned.reshape(3, 3, -1)  # by column of a root, and splat
    (fx, fy), (middle_x, middle_y) = camera.focal, camera.center
    with np.errstate(all="ignore"):  # of what is not in ``rows``
        across = (fx * right + (seen[:, 0] - middle_x) * behind) / depth
        up = ((seen[:, 1] - middle_y) * behind - fy * above) / depth
        a, c = (across**2).sum(axis=0) + WIDENED, (up**2).sum(axis=0) + WIDENED
        b = (across * up).sum(axis=0)
        conic = np.stack([c, -b, a]) / (a * c - b * b)
        reach = DEVIATIONS * np.sqrt(np.stack([a, c]))
    return Ellipses(rows, seen[rows, :2], conic[:, rows].T, reach[:, rows].T)


def _colours(
    table: PointTable, means: Float[np.ndarray, "n 3"], camera: Camera
) -> Float[np.ndarray, "n 3"]:
    """Colours in [0, 1] of splats as seen from the camera; grey where the table has none."""
    if "f_dc_0" not in table.columns:
        return np.full((len(means), 3), 0.5)
    base = np.stack([np.float64(table.columns[f"f_dc_{i}"]) for i in range(3)], axis=1)
    colours = 0.5 + SH_C0 * base
    count = sum(name.startswith("f_rest_") for name in table.columns) // 3
    if count in COUNTS:
        rest = np.stack([table.columns[f"f_rest_{i}"] for i in range(3 * count)], axis=1)
        rest = rest.reshape(len(means), 3, count)
        away = means - camera.position
        away /= np.linalg.norm(away, axis=1, keepdims=True)
        start = 0
        for degree, width in enumerate(BANDS[: COUNTS.index(count) + 1], 1):
            values = band_values(degree, away)
            colours += np.einsum("nck,nk->nc", rest[:, :, start : start + width], values)
            start += width
    return np.clip(colours, 0.0, 1.0)
