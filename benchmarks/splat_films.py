"""Films of Gaussian splats by the command, and those of AutoPhyX's figure 5.

    python benchmarks/splat_films.py [NAME ...]   measures, and writes docs/data/splat_films.json
    python benchmarks/splat_films.py --gallery    `make gallery`: docs/films/*.webp too
    python benchmarks/splat_films.py --drivers    bodies that drive films beside full ones

Captures are splats on the surface of models that are made here, lit and in colour. Each film is the
one command that its row shows, `autophyx-tet film`: 60 frames of 512 px. A row tells its CPU
seconds, those foretold, needles (splats longer than 3 times their rest beside their neighbours, in
every frame), frozen dots (drawn splats that stand where all that were around them move, and lie on
nothing) and the verdicts.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shlex
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import igl
import numpy as np
import trimesh
from autophyx_tet.converters.mesh.meshdata import read_mesh
from autophyx_tet.converters.points.film import needles
from autophyx_tet.converters.points.table import read_points, write_points
from autophyx_tet.fem import (
    METHODS,
    SCENARIOS,
    ElementMaterial,
    Scene,
    box_mesh,
    natural_modes,
    rigid_labels,
)
from autophyx_tet.fem.reduced.elasticity import ReducedElasticity, held_rest, reduced_frequencies
from autophyx_tet.fem.reduced.motion import ReducedMethod
from autophyx_tet.predictors.asset import Asset, Part
from autophyx_tet.toolkit.asset.load import load_asset
from autophyx_tet.toolkit.film import FINE_TETS, kept_motion, largest_piece
from autophyx_tet.toolkit.options import ConvertOptions, SimulateOptions
from autophyx_tet.toolkit.pipeline import convert
from autophyx_tet.toolkit.simulation.budget import MOST_TETS, coarsened, driver_edge
from autophyx_tet.toolkit.simulation.scenario import scene_of_options
from driven_picture import splats
from PIL import Image
from real_meshes import cache_folder, demo_mesh, real_mesh
from scipy.spatial import KDTree

DOCS = Path(__file__).resolve().parent.parent / "docs"
SHOWN, KEPT = 288, 3  # px of a film in the gallery, and every which frame it has
STILL, GOES, TRAVELS = 0.02, 8, 0.005  # a frozen dot against its neighbours, their number, and size
LIES = 0.05  # of the size: what is so near to the ground, or to what stands on it, lies there


@dataclass(frozen=True)
class Filmed:
    """A model, how many splats it has, and what the command is told of it."""

    model: str
    count: int
    options: str

    def words(self, capture: Path, output: Path) -> list[str]:
        """The command without the program."""
        return ["film", str(capture), "-o", str(output), *shlex.split(self.options)]


PLANT = '--size 0.6 --up z --scenario wind --wind-speed 7 --fix "plane:z<0.16"'
PROPELLER = "--size 0.6 --up z --scenario spin --spin-rate 3"
TOAST = "--size 0.12 --up z --fall-height 1 --scenario fall"
BEAR = "--size 0.25 --up z --scenario drop --drop-height 0.3"
SCENES = {
    "propeller_rigid": Filmed("propeller", 60_000, f'{PROPELLER} --text "ABS"'),
    "propeller_elastic": Filmed("propeller", 60_000, f'{PROPELLER} --text "gelatin"'),
    "ficus_stiff": Filmed("plant", 150_000, f'{PLANT} --text "stiff rubber"'),
    "ficus_flexible": Filmed("plant", 150_000, f'{PLANT} --text "soft rubber"'),
    "toast_whole": Filmed("toast", 60_000, f'{TOAST} --text "a slice of bread"'),
    "toast_broken": Filmed(
        "toast", 60_000, f'{TOAST} --text "a slice of bread" --matter toast=brittle',
    ),
    "soft_body_stiff": Filmed("bear", 90_000, f'{BEAR} --text "soft rubber"'),
    "soft_body_large": Filmed("bear", 90_000, f'{BEAR} --text "gelatin"'),
}  # fmt: skip
MEASURED = ("ficus_flexible", "toast_broken", "soft_body_large")


def painted(mesh: trimesh.Trimesh, colour: tuple[int, int, int], name: str) -> Part:
    mesh.visual.vertex_colors = np.tile([*colour, 255], (len(mesh.vertices), 1)).astype(np.uint8)
    return Part(name, mesh)


def plant() -> list[Part]:
    """A pot, a bent trunk with branches, and some forty leaves."""
    rng = np.random.default_rng(1)
    outline = [(0, 0), (0.09, 0), (0.12, 0.13), (0.135, 0.135), (0.135, 0.16), (0, 0.15)]
    pot = trimesh.creation.revolve(outline, sections=64)
    parts = [painted(pot, (166, 92, 60), "pot")]
    at = np.array([0, 0, 0.12])
    joints = [at]
    for k in range(6):
        at = at + np.array([0.02 * np.sin(1.3 * k), 0.018 * np.cos(1.7 * k), 0.06])
        joints.append(at)
    stems = list(zip(joints[:-1], joints[1:], np.linspace(0.022, 0.015, 6), strict=True))
    leaves = []
    for k in range(11):
        start = joints[2 + k % 5]
        turn = 2.4 * k
        way = np.array([np.cos(turn), np.sin(turn), 0.55 + 0.3 * rng.random()])
        end = start + way / np.linalg.norm(way) * (0.1 + 0.05 * rng.random())
        stems.append((start, end, 0.012))
        leaves += [(end + rng.normal(size=3) * 0.007, rng) for _ in range(4)]
    for k, (a, b, radius) in enumerate(stems):
        stem = trimesh.creation.capsule(np.linalg.norm(b - a), radius)
        stem.apply_transform(trimesh.geometry.align_vectors([0, 0, 1], b - a))
        stem.apply_translation(a)
        parts.append(painted(stem, (112, 82, 52), f"stem{k}"))
    for k, (place, rng) in enumerate(leaves):
        leaf = trimesh.creation.icosphere(3)
        leaf.apply_scale([0.048, 0.032, 0.014])
        leaf.apply_transform(trimesh.transformations.random_rotation_matrix(rng.random(3)))
        leaf.apply_translation(place)
        green = np.array([58, 128, 52]) + rng.integers(-22, 22)
        parts.append(painted(leaf, tuple(green), f"leaf{k}"))
    return parts


def propeller() -> list[Part]:
    """A hub with three twisted blades, across the x axis."""
    parts = [painted(trimesh.creation.cylinder(0.022, 0.036, sections=48), (60, 62, 70), "hub")]
    for k in range(3):
        blade = trimesh.creation.box((0.14, 0.046, 0.014)).subdivide().subdivide().subdivide()
        x = blade.vertices[:, 0] / 0.14 + 0.5
        taper = 1 - 0.45 * x**2
        angle = np.deg2rad(38 - 26 * x)
        y, z = blade.vertices[:, 1] * taper, blade.vertices[:, 2] * (1 - 0.3 * x)
        blade.vertices[:, 1] = np.cos(angle) * y - np.sin(angle) * z
        blade.vertices[:, 2] = np.sin(angle) * y + np.cos(angle) * z
        blade.apply_translation([0.08, 0, 0])
        turn = trimesh.transformations.rotation_matrix(2 * np.pi * k / 3, [0, 0, 1])
        blade.apply_transform(turn)
        colour = [(214, 72, 58), (236, 170, 60), (70, 130, 190)][k]
        parts.append(painted(blade, colour, f"blade{k}"))
    for part in parts:
        part.mesh.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0]))
    return parts


def toast() -> list[Part]:
    """A slice of bread with its crust, upon a corner."""
    bread = trimesh.creation.box((0.11, 0.022, 0.11))
    for _ in range(5):
        bread = bread.subdivide()
    v = bread.vertices
    # Rounded corners, and the waist of a loaf
    r = np.maximum(np.abs(v[:, [0, 2]]) - 0.035, 0)
    far = np.linalg.norm(r, axis=1)
    keep = np.minimum(1.0, 0.02 / np.maximum(far, 1e-9))
    v[:, [0, 2]] = np.sign(v[:, [0, 2]]) * (np.minimum(np.abs(v[:, [0, 2]]), 0.035)
                                            + r * keep[:, None])  # fmt: skip
    v[:, 0] *= 1 - 0.08 * np.exp(-((v[:, 2] - 0.005) ** 2) / 2e-4)
    rim = np.abs(bread.vertex_normals[:, 1]) < 0.7
    crumb = np.sin(900 * v[:, 0]) * np.sin(820 * v[:, 2]) + np.sin(400 * v[:, 0] + 650 * v[:, 2])
    colours = np.where(rim[:, None], [150, 92, 44], np.array([228, 196, 142]) - 12 * crumb[:, None])
    bread.visual.vertex_colors = np.clip(colours, 0, 255).astype(np.uint8)
    tilt = trimesh.transformations.rotation_matrix
    bread.apply_transform(tilt(0.5, [0, 1, 0]) @ tilt(0.35, [1, 0, 0]))
    return [Part("toast", bread)]


def bear() -> list[Part]:
    """A gummy bear of balls."""
    balls = [
        ((0, 0, 0.075), (0.07, 0.06, 0.075)), ((0, 0.005, 0.17), (0.05, 0.046, 0.046)),
        ((-0.038, 0, 0.212), (0.018, 0.012, 0.018)), ((0.038, 0, 0.212), (0.018, 0.012, 0.018)),
        ((0, -0.042, 0.162), (0.022, 0.018, 0.017)),
        *(((x, -0.03, 0.11), (0.024, 0.036, 0.022)) for x in (-0.066, 0.066)),
        *(((x, -0.04, 0.026), (0.03, 0.05, 0.026)) for x in (-0.045, 0.045)),
    ]  # fmt: skip
    parts = []
    for k, (place, size) in enumerate(balls):
        ball = trimesh.creation.icosphere(4)
        ball.apply_scale(size)
        ball.apply_translation(place)
        parts.append(painted(ball, (206, 44, 62) if k != 4 else (226, 92, 92), f"ball{k}"))
    return parts


MODELS = {"plant": plant, "propeller": propeller, "toast": toast, "bear": bear}


def captured(scene: Filmed, folder: Path) -> Path:
    """The capture of a model: its visible skin alone, as a camera would have it."""
    path = folder / f"{scene.model}.ply"
    if path.exists():
        return path
    parts = MODELS[scene.model]()
    asset = Asset(scene.model, tuple(parts))
    splats(asset, path, total=round(1.4 * scene.count), share=0.0034)
    table = read_points(path)
    inside = np.zeros(len(table), dtype=bool)
    for part in parts:  # what lies within another part is never seen
        others = table.positions
        box = (others > part.mesh.bounds[0]) & (others < part.mesh.bounds[1])
        near = np.flatnonzero(box.all(axis=1))
        if len(near) and len(parts) > 1:
            distance = igl.signed_distance(
                others[near], np.asarray(part.mesh.vertices), np.asarray(part.mesh.faces)
            )[0]
            inside[near[distance < -1e-4]] = True
    rows = np.flatnonzero(~inside)
    rng = np.random.default_rng(0)
    rows = np.sort(rng.permutation(rows)[: scene.count])
    write_points(path, table.only(rows))
    return path


def made(name: str, folder: Path) -> dict:
    """Run the command of a scene and measure it."""
    scene = SCENES[name]
    capture, output = captured(scene, folder), folder / name
    program = [sys.executable, "-m", "autophyx_tet", *scene.words(capture, output), "--json"]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(program, check=False, capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        raise SystemExit(f"{name}: {done.stderr}")
    document = json.loads(done.stdout)
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    (case,) = document["cases"]
    words = scene.words(Path(capture.name), Path("out"))
    return {
        "scene": name,
        "command": shlex.join(["autophyx-tet", *words]),
        "splats": len(read_points(capture)),
        "driver": case["options"],
        "cells": case["cells"],
        "cpu_s": round(spent, 1),
        "foretold_over_spent": round(document["foretold"] / spent, 2),
        "frames": document["film"]["frames"],
        **watched(read_points(capture), output / "motion_0.npz"),
        "left": document["film"]["left"],
        "clamped": document["film"]["clamped"],
        "verdicts": [f"{v['mark']}: {v['sentence']}" for v in case["verdicts"]],
    }


def watched(table, motion: Path) -> dict[str, int]:
    """Needles in all frames, and frozen dots at the end."""
    actor, floor = kept_motion(motion, table)
    frames = [actor.frame(i) for i in range(len(actor.states))]
    found = sum(int(needles(actor.shown, frame).sum()) for frame in frames)
    means = np.stack([frame.means for frame in frames])
    near = KDTree(means[0]).query(means[0], k=GOES + 1)[1][:, 1:]
    moved = np.linalg.norm(means[-1] - means[len(means) // 2], axis=1)
    around = np.median(moved[near], axis=1)
    size = np.linalg.norm(np.ptp(means[0], axis=0))
    frozen = (moved < STILL * around) & (around > TRAVELS * size) & (frames[-1].opacity > 0)
    if frozen.any() and floor is not None:
        # Dots that stand, by cells: those of a heap that reaches the ground lie on it
        still = moved < STILL * around.max()
        cell = np.round(means[-1][still] / (LIES * size))
        cells, of = np.unique(cell, axis=0, return_inverse=True)
        heap = rigid_labels(cells, 1.8)[of.reshape(-1)]  # cells that touch, by corners too
        low = means[-1][still, 2] - floor / actor.scale < LIES * size
        frozen[np.flatnonzero(still)[np.isin(heap, heap[low])]] = False
    return {"needles": found, "frozen": int(frozen.sum())}


def main() -> None:
    """Measure some scenes, or make the gallery."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("names", nargs="*", choices=[[], *SCENES])
    parser.add_argument("--gallery", action="store_true")
    parser.add_argument("--output", type=Path, help="folder of captures and films, else temporary")
    parser.add_argument("--drivers", action="store_true", help="coarse bodies beside fine ones")
    options = parser.parse_args()
    if options.drivers:
        rows = []
        for row in drivers():
            rows.append(row)
            print(json.dumps(row), flush=True)
        recorded("film_drivers", "python benchmarks/splat_films.py --drivers", rows)
        return
    names = options.names or (SCENES if options.gallery else MEASURED)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        folder = options.output or Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        for name in names:
            rows.append(made(name, folder))
            print(json.dumps(rows[-1]), flush=True)
            if options.gallery:
                smaller(folder / name / "film.webp", DOCS / "films" / f"{name}.webp")
    if options.gallery or not options.names:
        record = DOCS / "data" / "splat_films.json"
        known = json.loads(record.read_text())["rows"] if record.exists() else []
        rows += [row for row in known if row["scene"] not in names]
        option = " --gallery" if options.gallery else ""
        recorded("splat_films", f"python benchmarks/splat_films.py{option}", rows)


def recorded(name: str, command: str, rows: list[dict]) -> None:
    """Write rows to docs/data, with their command and machine."""
    machine = {"what": "one of two shared cores", "load": round(os.getloadavg()[0], 1)}
    document = {"command": command, "machine": machine, "rows": rows}
    (DOCS / "data" / f"{name}.json").write_text(json.dumps(document, indent=1) + "\n")


def drivers() -> Iterator[dict]:
    """What drives a film of a held body, over the full body of quadratic elements.

    Up to twice ``MOST_TETS`` that is the reduced body of the same mesh, and of a finer one where a
    lattice of at most ``MOST_TETS`` falls into pieces. Where it does not, one of less than half of
    the mesh's tets is measured too. Of the plant it is the film's own lattice in its splats, beside
    one of twice as many tets. First frequency, and largest displacement under the own weight: a
    load that comes on at once makes a body swing by twice that, its amplitude.
    """
    slab = box_mesh((0.4, 0.3, 0.06), (20, 15, 6))
    slab = slab.with_material(ElementMaterial.uniform(len(slab.tets), E=5e6, nu=0.4, rho=500.0))
    bodies = {
        "slab": (slab, "x"),
        "bonsai": (read_mesh(demo_mesh(cache_folder())), "y"),
        "chair": (read_mesh(real_mesh("BlendSwap-CC-0/silla2", cache_folder())), "y"),
        "oak chair": (read_mesh(real_mesh("BlendSwap-CC-0/oakChair", cache_folder())), "y"),
    }
    for name, (mesh, up) in bodies.items():
        mesh = mesh.with_material(mesh.material.without_grain())
        full = SCENARIOS["sag"]().scene(mesh, up=up)
        for most in {MOST_TETS: 0, min(MOST_TETS, (len(mesh.tets) - 1) // 2): 0}:
            began = time.process_time()
            body = coarsened(mesh, most=most)
            if body is mesh and most != MOST_TETS:
                continue
            yield beside(name, SCENARIOS["sag"]().scene(body, up=up), full, began)
    with tempfile.TemporaryDirectory() as folder:
        asset = load_asset(captured(SCENES["ficus_stiff"], Path(folder)), size=0.6, up="z")
    volume, began = sum(part.mesh.volume for part in asset.parts), time.process_time()
    fine, full = (lattice(asset, driver_edge(volume, most)) for most in (FINE_TETS, 2 * FINE_TETS))
    yield beside("plant", fine, full, began)


def lattice(asset: Asset, edge: float) -> Scene:
    """The scene of a plant in a film that sags, what moves of its lattice of soft rubber."""
    options = ConvertOptions(mesher="stuffing", accept_broken=True, edge_length=edge)
    mesh = largest_piece(convert(asset, options=options).mesh)
    soft = ElementMaterial.uniform(len(mesh.tets), E=5.5e5, nu=0.49, rho=1100.0)
    held = SimulateOptions(scenario="sag", fix=("plane:z<0.16",))
    return scene_of_options(mesh.with_material(soft), held, up="z").moving()


def beside(name: str, scene: Scene, full: Scene, began: float) -> dict:
    """A row of a driver, made since ``began`` [CPU s], beside the full body."""
    model = ReducedMethod().model_of(scene, 2)
    spent = time.process_time() - began
    modes = natural_modes(full.mesh, 1, supports=full.held, order=2)
    rest = METHODS["statics"].solve(full, law="linear", order=2)
    elasticity = ReducedElasticity(model, law="linear")
    moved = held_rest(elasticity, model.weight(scene.gravity_vector))
    sag = np.linalg.norm(model.displacement(moved), axis=1).max()
    frequency = reduced_frequencies(elasticity)[0] / modes.frequencies[0]
    return {
        "body": name,
        "tets": len(full.mesh.tets),
        "of_driver": len(scene.mesh.tets),
        "cut_anew": scene.mesh is not full.mesh,
        "coordinates": model.dofs,
        "frequency": round(float(frequency), 4),
        "amplitude": round(float(sag / rest.max_displacement), 4),
        "cpu_s": round(spent, 1),
    }


def smaller(source: Path, target: Path) -> None:
    """Write a film for the gallery: every third frame, some 100 kB."""
    target.parent.mkdir(parents=True, exist_ok=True)
    with Image.open(source) as film:
        frames = []
        for i in range(0, film.n_frames, KEPT):
            film.seek(i)
            frames.append(film.convert("RGB").resize((SHOWN, SHOWN), Image.Resampling.LANCZOS))
    options = {"duration": 100, "loop": 0, "quality": 55, "method": 6}
    frames[0].save(target, "WEBP", save_all=True, append_images=frames[1:], **options)


if __name__ == "__main__":
    main()
