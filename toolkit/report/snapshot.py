"""One picture of a simulation: its last state as PNG, or its whole motion as GIF or WebP."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...predictors.asset import UpAxis
from ..results.simulation import Simulation
from .picture import Panel, exaggeration, mesh_panel, render_animation, render_png
from .scale import Scale

STILL = ".png"
SUFFIXES = (STILL, ".gif", ".webp")
# A loop of this many frames looks smooth, takes about ten seconds of a core and stays near 1 MB.
FRAMES = 24


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
