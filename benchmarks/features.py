"""Seconds from an asset to filled features, stage by stage.

    python benchmarks/features.py --json

The asset is a stool of 20,000 triangles: a seat, four legs and a ring, in three colours. It is seen
by 15 cameras at 256 x 256, encoded by the embedded encoder (D = 384), lifted onto 64 cells along
its longest side and filled. ``total`` is the whole verb once more, with its encoder loaded.
"""

import argparse
import json
import os
import time

import numpy as np
import trimesh
from autophyx_tet.predictors.appearance.features import features, fill, lift
from autophyx_tet.predictors.appearance.surface import opaque_density, surface_voxels
from autophyx_tet.predictors.appearance.views import hemisphere, render_views
from autophyx_tet.predictors.asset import Asset, Part
from autophyx_tet.predictors.encoders import load_encoder
from autophyx_tet.predictors.grid import Grid


def stool():
    """A stool half a metre high."""
    seat = trimesh.creation.icosphere(5, 0.2)  # 20,480 triangles
    seat.apply_transform(np.diag([1, 1, 0.2, 1]))
    seat.apply_translation([0, 0, 0.46])
    legs = [trimesh.creation.cylinder(0.015, 0.46, sections=64) for _ in range(4)]
    for leg, (x, y) in zip(legs, ((1, 1), (1, -1), (-1, 1), (-1, -1)), strict=True):
        leg.apply_translation([0.11 * x, 0.11 * y, 0.23])
    ring = trimesh.creation.torus(0.155, 0.008)
    ring.apply_translation([0, 0, 0.15])
    meshes = {"seat": seat, "legs": trimesh.util.concatenate(legs), "ring": ring}
    colours = {"seat": (150, 30, 40), "legs": (150, 110, 60), "ring": (190, 190, 200)}
    for name, mesh in meshes.items():
        mesh.visual.vertex_colors = (*colours[name], 255)
    return Asset("stool", tuple(Part(name, mesh) for name, mesh in meshes.items()), up="z")


class Clock:
    """Rows of wall and CPU seconds."""

    def __init__(self):
        self.rows = []

    def __call__(self, stage, run):
        """Run something and note how long it took."""
        wall, cpu = time.perf_counter(), time.process_time()
        result = run()
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        self.rows.append({"stage": stage, "wall_s": round(wall, 2), "cpu_s": round(cpu, 2)})
        return result


def stages(asset, clock):
    """The verb taken apart."""
    encoder = clock("load the encoder", lambda: load_encoder("embedded"))
    grid = Grid.around(asset.bounds, cells=64)
    cameras = hemisphere(asset.bounds, up=asset.up)
    views = clock("views", lambda: render_views(asset, cameras))
    images = encoder.dense(views.images()[:1])  # the first call prepares kernels
    images = clock("encode", lambda: encoder.dense(views.images()))
    voxels = clock("surface voxels", lambda: surface_voxels(asset, grid))
    density = opaque_density(voxels.occupied, grid)
    clock("lift", lambda: lift(images, cameras, density, grid, opacity=views.opacity))
    clock("fill", lambda: fill(density > 0))
    return encoder


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    asset, clock = stool(), Clock()
    encoder = stages(asset, clock)
    found = clock("total", lambda: features(asset, encoder=encoder))
    triangles = sum(len(part.mesh.faces) for part in asset.parts)
    document = {
        "cpus": os.cpu_count(),
        "triangles": triangles,
        "voxels": len(found.cells),
        "dim": found.values.shape[1],
        "rows": clock.rows,
    }
    if options.json:
        print(json.dumps(document, indent=1))
    else:
        for row in clock.rows:
            print("  ".join(f"{key} {value}" for key, value in row.items()))


if __name__ == "__main__":
    main()
