"""Captures of splats to bodies: processor time, pieces, volume, colours and which way is up.

    python benchmarks/splat_bodies.py --splats 100000

Captures are made of textured meshes as a training would: places of their surface as pictures from
all sides show them, blurred, with haze around, loose clusters, a stray far off, in COLMAP's axes
(y down). The bodies that `convert` makes of them are compared with the meshes.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import autophyx_tet as apx
import numpy as np
import trimesh
from autophyx_tet.converters.points.gaussians import SH_C0, standard_columns
from autophyx_tet.converters.points.table import PointTable, write_points
from autophyx_tet.predictors.appearance.surface import skin_of
from autophyx_tet.predictors.appearance.views import hemisphere, render_views
from autophyx_tet.predictors.asset import Asset, Part, upright
from autophyx_tet.toolkit.asset.triangles import winding_numbers
from PIL import Image
from scipy.spatial import KDTree

VIEWS = 40  # half of them from below
HAZE, CLUSTERS, EACH = 0.05, 6, 40  # of the splats; loose clusters, and the splats of each
POINTS = 300_000  # in the box of an asset, for its volume
BLUR = 0.3  # of the distance of two splats: how far off the surface they are


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--splats", type=int, default=100_000)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for name, asset in _assets(Path(folder)).items():
            path = Path(folder) / f"{name}.ply"
            write_points(path, capture(asset, args.splats, np.random.default_rng(0)))
            print(json.dumps(row(path, asset)), flush=True)


def _assets(folder: Path) -> dict[str, Asset]:
    """A bonsai in four parts, a textured donut, a chair-like thing with thin legs; z up."""
    bonsai = apx.load_asset(apx.write_bonsai(folder / "bonsai.glb"))
    ring = trimesh.creation.torus(0.15, 0.06)
    angle = np.arctan2(ring.vertices[:, 1], ring.vertices[:, 0]) / (2 * np.pi)
    icing = np.zeros((64, 64, 3), np.uint8) + np.array([240, 150, 180], np.uint8)
    icing[::8] = 90, 50, 30
    uv = np.stack([angle, ring.vertices[:, 2] / 0.12 + 0.5], axis=1)
    ring.visual = trimesh.visual.TextureVisuals(uv=uv, image=Image.fromarray(icing))
    boxes = [((0.4, 0.4, 0.05), (0, 0, 0.4)), ((0.4, 0.04, 0.45), (0, 0.18, 0.62))]
    boxes += [((0.05, 0.05, 0.4), (x, y, 0.2)) for x in (-0.16, 0.16) for y in (-0.16, 0.16)]
    pieces = []
    for size, at in boxes:
        pieces.append(trimesh.creation.box(size))
        pieces[-1].apply_translation(at)
    chair = trimesh.util.concatenate(pieces)
    chair.visual.vertex_colors = np.full((len(chair.vertices), 3), (150, 100, 50), np.uint8)
    return {
        "bonsai": bonsai,
        "donut": Asset("donut", (Part("donut", ring),)),
        "chair": Asset("chair", (Part("chair", chair),)),
    }


def capture(asset: Asset, count: int, rng: np.random.Generator) -> PointTable:
    """Splats where the pictures of an asset show its surface, with all that training leaves."""
    cameras = hemisphere(asset.bounds, count=VIEWS // 2, lower=VIEWS // 2, up=asset.up, pixels=200)
    seen = render_views(asset, cameras)
    assert seen.depth is not None
    places, colours = [], []
    for camera, depth, colour in zip(cameras, seen.depth, seen.colour, strict=True):
        met = np.isfinite(depth)
        places.append(camera.position + camera.directions()[met] * depth[met][:, None])
        colours.append(colour[met])
    places, colours = np.concatenate(places), np.concatenate(colours)
    some = rng.choice(len(places), min(count, len(places)), replace=False)
    places, colours = places[some], colours[some]
    apart = float(np.median(KDTree(places).query(places[:2000], k=5)[0][:, -1]))
    places = places + rng.normal(0, BLUR * apart, places.shape)
    size, middle = asset.size, asset.bounds.mean(axis=0)
    haze = middle + rng.uniform(-0.7, 0.7, (round(HAZE * count), 3)) * size
    away = rng.normal(size=(CLUSTERS, 3))
    away *= 0.8 * np.linalg.norm(size) / np.linalg.norm(away, axis=1, keepdims=True)
    floats = np.repeat(middle + away, EACH, axis=0) + rng.normal(0, apart, (CLUSTERS * EACH, 3))
    stray = middle[None] + np.array([100 * size.max(), 0, 0])
    opacity = np.concatenate([
        rng.beta(8, 1, len(places)), rng.uniform(0.01, 0.09, len(haze)),
        np.full(len(floats) + 1, 0.9),
    ])  # fmt: skip
    other = rng.random((len(haze) + len(floats) + 1, 3))
    colours = np.concatenate([colours, other])
    x, y, z = upright(np.concatenate([places, haze, floats, stray]), asset.up).T
    turns = rng.normal(size=(len(x), 4))
    scales = np.log(apart * rng.uniform(0.5, 1.2, (len(x), 3)))
    means = np.stack([x, -z, y], axis=1)  # y down
    return PointTable(standard_columns(means, scales, turns, opacity, (colours - 0.5) / SH_C0))


def row(path: Path, asset: Asset) -> dict:
    """Convert a capture in a process of its own; what it took and what came of it."""
    output = path.with_suffix(".msh")
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-m", "autophyx_tet", "convert", str(path), "-o", str(output)]
    command += ["--no-cache", "--json"]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    if done.returncode:
        return {"capture": path.stem, "cpu_s": round(cpu, 1), "why": done.stderr[-300:]}
    report = json.loads(done.stdout)
    again = apx.load_asset(path)
    surface = again.parts[0].mesh
    points, faces = trimesh.sample.sample_surface(surface, 2000, seed=0)
    shown = skin_of(surface)(faces, np.full((len(faces), 3), 1 / 3))[:, :3]
    true = upright(points, again.up)
    truth = [
        np.concatenate(
            [upright(one, asset.up), skin_of(part.mesh)(of, np.full((len(of), 3), 1 / 3))[:, :3]],
            axis=1,
        )
        for part in asset.parts
        for one, of in [trimesh.sample.sample_surface(part.mesh, 5000, seed=0)]
    ]
    truth = np.concatenate(truth)
    nearest = KDTree(truth[:, :3]).query(true)[1]
    # What any of its parts encloses, by random points: to half a per cent
    low, high = asset.bounds
    places = np.random.default_rng(0).uniform(low, high, (POINTS, 3))
    meshes = [part.mesh for part in asset.parts]
    around = [winding_numbers(np.asarray(m.vertices), np.asarray(m.faces), places) for m in meshes]
    inside = (np.abs(around) > 0.5).any(axis=0)
    volume = float(inside.mean() * np.prod(high - low))
    return {
        "capture": path.stem,
        "cpu_s": round(cpu, 1),
        "tets": report["tets"],
        "pieces": report["quality"]["components"],
        "volume": round(report["volume"], 6),
        "volume_off": round(report["volume"] / volume - 1, 4),
        "surface_off": round(float(np.linalg.norm(truth[nearest, :3] - true, axis=1).mean()), 4),
        "colour_off": round(float(np.abs(truth[nearest, 3:] - shown).mean()), 3),
        "up": again.up,
        "warnings": report["warnings"],
    }


if __name__ == "__main__":
    main()
