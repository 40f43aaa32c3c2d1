"""Particles in motion as a GIF: in a crack the surface of a mesh is stretched, they are apart."""

from __future__ import annotations

from io import BytesIO

import numpy as np

from ...converters.points.splats.gaussians import SH_C0, standard_columns
from ...converters.points.splats.splat_views import splat_view
from ...converters.points.table import XYZ, PointTable
from ...fem.particle_run import ParticleRun
from ...predictors.asset import UpAxis
from ...predictors.images.cameras import hemisphere
from .scale import PARTS, rgb

CAPTION = "The particles in motion, coloured by part"
SHOWN, SECONDS = 24, 2.0
# Standard deviation of a particle's ball in spacings of the grid: particles are half of one apart.
BALL = 0.22
# Particles differ in brightness by up to this share, or nobody would see them move.
GRAIN = 0.3


def particle_film(run: ParticleRun, *, up: UpAxis) -> bytes:
    """GIF of about ``SHOWN`` frames of a run, from aside and above."""
    from PIL import Image

    shown = np.linspace(0, len(run.positions) - 1, min(SHOWN, len(run.positions)))
    states = run.positions[shown.round().astype(int)]
    ends = np.stack([states.min(axis=(0, 1)), states.max(axis=(0, 1))]).astype(np.float64)
    camera = hemisphere(ends, count=5, up=up)[1]
    table = PointTable(_balls(run))
    sheets = []
    for places in states:
        moved = table.with_columns(dict(zip(XYZ, places.T, strict=True)))
        drawn = splat_view(moved, camera)
        sheets.append(Image.fromarray((255 * drawn).round().astype(np.uint8)))
    out = BytesIO()
    each = round(1000 * SECONDS / len(sheets))
    sheets[0].save(out, "GIF", save_all=True, append_images=sheets[1:], duration=each, loop=0)
    return out.getvalue()


def _balls(run: ParticleRun) -> dict[str, np.ndarray]:
    """Columns of splats: a round one at every particle, of the colour of its part."""
    count = len(run.part)
    colours = np.array([rgb(colour) for colour in PARTS])[run.part % len(PARTS)]
    shade = 1 - GRAIN * np.random.default_rng(0).random((count, 1))
    return standard_columns(
        means=run.positions[0],
        log_scales=np.full((count, 3), np.log(BALL * run.spacing)),
        rotations=np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
        opacity=np.full(count, 0.95),
        f_dc=(shade * colours - 0.5) / SH_C0,
    )
