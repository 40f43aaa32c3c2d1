"""One picture of a simulation: its last state as PNG, its whole motion as GIF or WebP.

Particles are drawn as balls: in a crack the surface of a mesh is stretched, they are apart.
"""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

import numpy as np

from ....converters.points.splats.gaussians import SH_C0, standard_columns
from ....converters.points.splats.splat_views import splat_view
from ....converters.points.table import XYZ, PointTable
from ....fem.particle_run import ParticleRun
from ....predictors.asset import UpAxis
from ....predictors.images.cameras import hemisphere
from ...results.simulation import Simulation
from ..scale import PARTS, Scale, rgb
from .panels import Panel, exaggeration, mesh_panel, render_animation, render_png

STILL = ".png"
SUFFIXES = (STILL, ".gif", ".webp")
# A loop of this many frames looks smooth, takes about ten seconds of a core and stays near 1 MB.
FRAMES = 24
PARTICLES = "The particles in motion, coloured by part"
# Standard deviation of a particle's ball in spacings of the grid: particles are half of one apart.
BALL = 0.22
# Particles differ in brightness by up to this share, or nobody would see them move.
GRAIN = 0.3


def write_picture(path: Path, simulation: Simulation, *, up: UpAxis) -> Path:
    """Write what becomes of a mesh, beside its stiffness where the picture stands still."""
    if path.suffix.lower() == STILL:
        panels = [_stiffness(simulation), _answer(simulation, simulation.displacement[None])]
        return render_png(path, panels, up=up)
    frames = simulation.animation.displacement
    shown = np.linspace(0, len(frames) - 1, min(FRAMES, len(frames))).round().astype(int)
    return render_animation(path, [_answer(simulation, frames[shown])], up=up)


def _stiffness(simulation: Simulation) -> Panel:
    mesh = simulation.mesh
    assert mesh.material is not None, "a simulated mesh has a material"
    E = mesh.material.E
    scale = Scale.around(E, label="Young's modulus", unit="Pa", palette="E", log=True)
    return mesh_panel(mesh, E, scale=scale, title="Stiffness")


def _answer(simulation: Simulation, displacement: np.ndarray) -> Panel:
    """The moving mesh, coloured by how far its points are from where they were."""
    mesh, moved = simulation.mesh, np.linalg.norm(displacement, axis=-1)
    factor = exaggeration(mesh, displacement)
    drawn = f", drawn {factor:g} times larger" if factor > 1 else ""
    return mesh_panel(
        mesh,
        moved,
        on="points",
        scale=Scale.around(moved, label="Displacement", unit="m", palette="displacement"),
        title=f"{simulation.title}{drawn}",
        displacement=displacement,
        factor=factor,
    )


def particle_film(run: ParticleRun, *, up: UpAxis) -> bytes:
    """GIF of about ``FRAMES`` frames of a run, from aside and above."""
    from PIL import Image

    shown = np.linspace(0, len(run.positions) - 1, min(FRAMES, len(run.positions)))
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
    each = round(2000 / len(sheets))  # two seconds, as other loops
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
