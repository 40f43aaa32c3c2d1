"""A film within a budget: a coarse body drives it, by the method that the time allows.

A film of splats wants some thousand tets or particles, since the splats are the fine picture. What
moves is small against what a mesh for stresses resolves: ``benchmarks/splat_films.py --drivers``
measures first frequencies and amplitudes of such bodies beside those of fine ones.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ...converters.points.table import PointTable
from ...fem.device import one_thread
from ...fem.elements.assembly import apply_supports, discretise, linear_stiffness, node_supports
from ...fem.elements.space import affordable_order
from ...fem.errors import UsageError
from ...fem.linalg.cholesky import NotPositive, cached_factor, planned_elimination
from ...fem.linalg.solver import MOST_ENTRIES
from ...fem.material import wave_speed
from ...fem.mesh import TetMesh, boundary_faces, face_components, material_of
from ...fem.mpm.boundaries import CLEAR, flight_time, grid_around
from ...fem.mpm.materials import Substance
from ...fem.mpm.particles import JELLY, Particles, block_places
from ...fem.mpm.time_step import BUDGET, COURANT, OVERHEAD, largest_modulus
from ...fem.note import Note
from ...fem.scene.scene import Scene
from ...predictors.asset import Asset, Part, PlainMesh
from ..options import SimulateOptions

FPS = 30
# Most tets of a driver, and particles where a coarser grid is left: a bear of gelatin of 11,332 is
# pressed as flat as one of 46,325 and rebounds as high (1 and 2 %), one of 2,456 to 5 %.
MOST_TETS, MOST_PARTICLES = 6_000, 12_000
# What is foretold is right within this factor: so much less than the budget is aimed at.
WITHIN = 1.5
# Cells of the grids that are tried, the finest first; a body as thin as this many of them bends.
GRIDS = (48, 40, 32, 28, 24, 20, 16)
# Steps of a reduced body in a frame: a swing of 3 Hz keeps its height over two seconds.
STEPS = 2
# What the motion of a reduced body costs: factors of its quadratic elements, of these so many for
# each of 60 frames, and products of so many rows of its coordinates; frames and parts of them by
# the time of a picture (`splat_films.py`).
BASIS, CHECKED, PRODUCTS, PRODUCT = 6.0, 12.0, 5_500.0, (13_500, 57)
DRAWN, DRAWN_PARTICLES, FIRST = 1.4, 1.6, 6.0
# Steps of particles beyond those at rest: a bear of gelatin that is dropped takes 1.68 times as
# many, one of rubber 1.07, what tears 1.7; and cells of the block that their cost is measured with,
# its steps.
MORE_STEPS, BLOCK, TRIED = 1.7, 12, 8


class Plan(NamedTuple):
    """The driver of a film: ``options`` that name it, ``cells`` of its grid or tets, CPU seconds.

    ``solve`` [s] is what the motion takes, ``draw`` [s] what its pictures do; ``fits`` whether the
    budget allows it.
    """

    options: SimulateOptions
    cells: int
    solve: float
    draw: float
    fits: bool

    @property
    def words(self) -> str:
        """Driver and cost in a line."""
        told = {"cells": self.cells, "solve": self.solve, "draw": self.draw}
        told["total"] = self.solve + self.draw
        reduced = self.options.solver == "lbs"
        return Note("budget.lbs", **told) if reduced else Note("budget.mpm", **told)


def planned(
    scene: Scene,
    options: SimulateOptions,
    *,
    method: str,
    picture: float,
    spent: float = 0.0,
    substances: Mapping[str, Substance] | None = None,
) -> Plan:
    """Choose what drives a film in the time that ``options.budget`` allows, and foretell its cost.

    A body that is held and meets nothing is reduced, in quadratic elements; what falls, tears or
    flows, as ``substances`` of parts say, is particles, on the finest grid that fits and has no
    more of them than a film needs. What is too stiff for their steps is rigid there: where a
    coarser grid fits on which it bends, that is taken. ``method`` is the one that the options name,
    ``picture`` [s] the time of drawing one, ``spent`` [s] that of all before. All costs are
    measured: of a factor of this body, of steps of such particles.
    """
    frames = round(FPS * options.seconds)
    mesh, held, matter = scene.mesh, scene.held, substances or {}
    limit = float(options.budget or np.inf) / WITHIN - spent
    if method != "mpm" and not matter and held.fixed.any() and not scene.obstacles:
        scene, draw = scene.moving(), picture * (DRAWN * frames + FIRST)
        solve = factor_seconds(scene) * (BASIS + CHECKED * frames / 60)
        solve += PRODUCTS * product_seconds()
        order = 2 if affordable_order(scene.mesh) == 2 else options.order
        options = replace(options, solver="lbs", order=order)
        return Plan(options, len(scene.mesh.tets), solve, draw, solve + draw <= limit)
    from ...fem.mpm.solver import RELIST

    draw = picture * (DRAWN_PARTICLES * frames + FIRST)
    limit = max(0.0, limit - draw)
    material = material_of(mesh)
    cost = max(particle_seconds(one) for one in set(matter.values()) or {JELLY})
    met = [*scene.obstacles, *([scene.ground] if scene.ground else [])]
    v, pull = np.asarray(scene.velocity, float), np.asarray(scene.gravity_vector, float)
    speed = 2 * scene.longest / scene.duration
    coarsest = scene.longest / min(GRIDS)
    bends = material.E <= largest_modulus(material.nu, material.rho, coarsest, 1 / BUDGET)
    plans = []
    for grid in GRIDS:
        spacing, flight = scene.longest / grid, 0.0
        if v.ndim == 1 and not held.fixed.any():
            falls = (v, pull, scene.duration)
            flight = flight_time(mesh.points, met, *falls, room=CLEAR * spacing)
        soft = material.E <= largest_modulus(material.nu, material.rho, spacing, 1 / BUDGET)
        waves = wave_speed(material.E, material.nu, material.rho)[soft]
        left = scene.duration - flight
        fastest = max(speed, float(np.linalg.norm(v + flight * pull)) / 2 if v.ndim == 1 else 0.0)
        steps = MORE_STEPS * left * (float(waves.max(initial=0.0)) + fastest) / (COURANT * spacing)
        lists = fastest / 2 * left / (RELIST * spacing)
        particles = 8 * mesh.volumes.sum() / spacing**3
        if particles > MOST_PARTICLES and grid > min(GRIDS):
            continue
        solve = steps * (OVERHEAD + cost.step * particles) + MORE_STEPS * lists * cost.listing
        plan = Plan(replace(options, solver="mpm", grid=grid), grid, solve, draw, solve <= limit)
        plans.append((max(solve, limit), bool((bends & ~soft).any()), plan))
    return min(plans, key=lambda one: one[:2])[2]  # of those alike the first, the finest


def check_budget(options: SimulateOptions) -> None:
    """Refuse a budget or a film's length that is none, before anything is made for it."""
    if not float(options.budget or 0) > 0 or not 0.1 <= options.seconds <= 60:
        raise UsageError("budget.range", budget=options.budget, seconds=options.seconds)


class ParticleSeconds(NamedTuple):
    """CPU seconds: of a particle in a ``step``, and of a ``listing`` of nodes near to a body."""

    step: float
    listing: float


def particle_seconds(substance: Substance) -> ParticleSeconds:
    """Measure them on this machine, by some steps of a shaken block of such matter."""
    from ...fem.mpm.solver import MpmSolver

    rng, size = np.random.default_rng(0), (float(BLOCK),) * 3
    x = block_places((0.0, 0.0, 0.0), size, 1.0)
    known: Any = {"E": 1e4, "nu": 0.3, "rho": 1e3, "substance": substance}
    block = Particles.of(x, 1 / 8, **known, velocity=0.01 * rng.standard_normal(x.shape))
    solver = MpmSolver(block, grid_around((0.0, 0.0, 0.0), size, 1.0))
    solver.cloud.write("H", 0.02 * rng.standard_normal((len(x), 3, 3)))
    solver.substep.set_step(1e-3, 0.0)
    solver.substep.run(1)  # its kernels are loaded
    taken = []
    for _ in range(3):
        began = time.process_time()
        solver.substep.run(TRIED)
        middle = time.process_time()
        solver.cloud.sort()
        solver.substep.list_nodes(0.0)
        taken.append(((middle - began) / TRIED, time.process_time() - middle))
    step, listing = np.median(taken, axis=0)
    return ParticleSeconds(float(step) / len(x), float(listing))


def factor_seconds(scene: Scene) -> float:
    """CPU seconds of a factor of the body's quadratic elements, which its modes find made."""
    grid = discretise(scene.mesh, 2)
    held = node_supports(scene.held, grid.space)
    with one_thread():
        matrix = linear_stiffness(grid, material_of(scene.mesh))
        apply_supports(matrix, held.fixed, held.springs)
        plan = planned_elimination(matrix, grid.space.edges)
        if plan.entries > MOST_ENTRIES:
            raise UsageError("budget.too_fine", tets=len(scene.mesh.tets))
        began = time.process_time()
        with suppress(NotPositive):  # a hinge: modes tell
            cached_factor(matrix, plan)
        return time.process_time() - began


def product_seconds() -> float:
    """CPU seconds of a product of matrices as they are many times made for a reduced body."""
    rows, began = np.ones(PRODUCT), time.process_time()
    with one_thread():
        for _ in range(TRIED):
            rows.T @ rows
    return (time.process_time() - began) / TRIED


def picture_seconds(table: PointTable) -> float:
    """CPU seconds of a picture of the splats of a table, at rest, over a ground."""
    from ...converters.points import film
    from ...predictors.appearance.views import ring

    shown = film.Shown(table)
    rest = shown.rest()
    bounds = np.nanquantile(rest.means, film.EDGES, axis=0)
    camera = ring(bounds, count=1, up="z", pixels=film.PIXELS)[0]
    size = float(np.linalg.norm(np.ptp(bounds, axis=0)))
    taken = []
    for _ in range(3):  # the first loads what draws
        began = time.process_time()
        stage = film.Stage(bounds.mean(axis=0), size, "z", float(bounds[0, 2]))
        film.picture([shown], [rest], camera, stage)
        taken.append(time.process_time() - began)
    return min(taken[1:])


def paced(scene: Scene, options: SimulateOptions) -> Scene:
    """The scene over a film of ``options.seconds``: as long, or slower where it is over sooner.

    Of a reduced body it is that of the tets that can move.
    """
    frames = round(FPS * options.seconds)
    duration = min(scene.duration, options.seconds)
    if options.solver == "lbs":
        scene, frames = scene.moving(), frames * STEPS
    return replace(scene, duration=duration, frames=frames)


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
