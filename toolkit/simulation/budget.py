"""A film within a budget: a coarse body drives it, by the method that the time allows.

A film of splats wants some thousand tets or particles, since the splats are the fine picture. What
moves is small against what a mesh for stresses resolves: ``benchmarks/splat_films.py --drivers``
measures first frequencies and amplitudes of such bodies beside those of fine ones.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ...fem.material import wave_speed
from ...fem.mesh import TetMesh, boundary_faces, face_components, material_of
from ...fem.mpm.method import COST, OVERHEAD
from ...fem.mpm.time_step import BUDGET, COURANT, largest_modulus
from ...fem.note import Note
from ...fem.scene.scene import Scene
from ...predictors.asset import Asset, Part, PlainMesh
from ..options import SimulateOptions

FPS = 30
# Most tets of a driver, and the share of the budget that its motion may take.
MOST_TETS, SHARE = 6_000, 0.45
# Cells of the grids that are tried, the finest first; a body as thin as this many of them bends.
GRIDS = (48, 40, 32, 28, 24, 20, 16)
# Steps of a reduced body in a frame: a swing of 3 Hz keeps its height over two seconds.
STEPS = 2
# CPU seconds of one core (61,000 splats; reduced bodies of 3,343 and 5,313 tets): of a frame, of a
# splat in it by a mesh and by particles, of a reduced body, and of each of its tets in 120 steps.
FRAME, SPLAT, PARTICLE_SPLAT = 0.10, 2.6e-6, 5.0e-6
REDUCED, REDUCED_TET = 6.0, 1.2e-3


class Plan(NamedTuple):
    """The driver of a film: ``options`` that name it, ``cells`` of its grid or tets, CPU seconds.

    ``solve`` [s] is what the motion takes, ``draw`` [s] what its pictures do.
    """

    options: SimulateOptions
    cells: int
    solve: float
    draw: float

    @property
    def words(self) -> str:
        """Driver and cost in a line."""
        told = {"cells": self.cells, "solve": self.solve, "draw": self.draw}
        told["total"] = self.solve + self.draw
        reduced = self.options.solver == "lbs"
        return Note("budget.lbs", **told) if reduced else Note("budget.mpm", **told)


def planned(
    scene: Scene, options: SimulateOptions, *, method: str, splats: int, flows: bool = False
) -> Plan:
    """Choose what drives a film of ``splats`` splats in the time that ``options.budget`` allows.

    A body that is held and meets nothing is reduced; what falls, tears or ``flows`` is particles,
    on the finest grid that fits. What is too stiff for their steps is rigid there. ``method`` is
    the one that the options name.
    """
    frames = round(FPS * options.seconds)
    mesh, limit = scene.mesh, SHARE * float(options.budget or np.inf)
    tets = len(mesh.tets)
    if method != "mpm" and not flows and scene.held.fixed.any() and not scene.obstacles:
        draw = frames * (FRAME + SPLAT * splats)
        solve = REDUCED + REDUCED_TET * tets * (frames * STEPS / 120)
        return Plan(replace(options, solver="lbs"), tets, solve, draw)
    draw = frames * (FRAME + PARTICLE_SPLAT * splats)
    material = material_of(mesh)
    for grid in GRIDS:
        spacing = scene.longest / grid
        soft = material.E <= largest_modulus(material.nu, material.rho, spacing, 1 / BUDGET)
        waves = wave_speed(material.E, material.nu, material.rho)[soft]
        speed = float(waves.max(initial=0.0)) + 2 * scene.longest / scene.duration
        steps = scene.duration * speed / (COURANT * spacing)
        particles = 8 * mesh.volumes.sum() / spacing**3
        solve = steps * (OVERHEAD + COST * particles)
        if solve <= limit:
            break
    return Plan(replace(options, solver="mpm", grid=grid), grid, solve, draw)


def paced(scene: Scene, options: SimulateOptions) -> Scene:
    """The scene over a film of ``options.seconds``: as long, or slower where it is over sooner."""
    frames = round(FPS * options.seconds)
    duration = min(scene.duration, options.seconds)
    steps = STEPS if options.solver == "lbs" else 1
    return replace(scene, duration=duration, frames=frames * steps)


def shown_states(states: Any, options: SimulateOptions) -> Any:
    """The states of a motion that are frames of its film, the first at rest."""
    return states[1 :: STEPS if options.solver == "lbs" else 1]


def coarsened(mesh: TetMesh, *, most: int = MOST_TETS) -> TetMesh:
    """A lattice body of at most so many tets in the surface of a mesh, with its materials by place.

    Parts keep their names. A mesh of less than twice as many stays, and one whose lattice falls
    into more pieces: what hangs together in it is thinner than the lattice's edge.
    """
    from scipy.spatial import KDTree

    from ..meshing.convert import tetrahedralize

    if len(mesh.tets) <= 2 * most:
        return mesh
    parts = []
    for number, name in enumerate(mesh.region_names):
        tets = mesh.tets[mesh.region == number]
        if len(tets):
            faces = boundary_faces(tets).faces
            used = np.unique(faces)
            surface = PlainMesh(mesh.points[used], np.searchsorted(used, faces))
            parts.append(Part(name, surface))
    asset, edge = Asset("body", tuple(parts)), driver_edge(mesh.volume, most)
    body, _ = tetrahedralize(asset, mesher="stuffing", edge_length=edge, accept_broken=True)
    if face_components(body).max() > face_components(mesh).max():
        return mesh
    near = KDTree(mesh.centroids).query(body.centroids)[1]
    material = material_of(mesh)
    known: Any = {name: getattr(material, name)[near] for name in ("E", "nu", "rho")}
    return body.with_material(type(material)(**known))


def driver_edge(volume: float, most: int = MOST_TETS) -> float:
    """Edge [m] of a lattice of about ``most`` tets in so much volume [m^3], a half of them small.

    Examples
    --------
    >>> round(driver_edge(1e-3, 6000), 4)
    0.0126
    """
    return float((12 * volume / most) ** (1 / 3))
