"""E, nu, rho onto a million points: ours beside a k-nearest mean as Pixie transfers.

    python benchmarks/transfer.py --points 1000000 --json

A ball of 64^3 voxels in two parts; the points lie on its surface with a spread of 1 % of the
radius, as splats and scans do. Each row is a process of its own: ``wall_s`` and ``cpu_s`` of the
call (the field and the points are in memory), ``rss_mb`` the peak of the whole process, ``error``
the largest |d log10 E| against the law that the field samples, within one part.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import resource
import time

import numpy as np


def law(x: np.ndarray) -> np.ndarray:
    """log10 E at points: linear in x, and five decades stiffer above z = 0."""
    return 5 + x[..., 0] + 5 * (x[..., 2] > 0)


def ball(cells: int = 64):
    from autophyx_tet.predictors.field import MaterialField
    from autophyx_tet.predictors.grid import Grid

    grid = Grid.around([[-1.0] * 3, [1.0] * 3], cells=cells)
    centres = grid.centers()
    part = (centres[..., 2] > 0).astype(int)
    one = np.ones(grid.shape)
    inside = np.linalg.norm(centres, axis=-1) < 1
    return MaterialField(
        grid, inside, 10 ** law(centres), 0.3 * one, 1000 * one, part=part, part_names=("a", "b")
    )


def surface_points(n: int) -> np.ndarray:
    rng = np.random.default_rng(0)
    x = rng.normal(size=(n, 3))
    return x / np.linalg.norm(x, axis=1, keepdims=True) * rng.normal(1, 0.01, (n, 1))


def ours(field, points):
    from autophyx_tet.predictors.field import sample_field

    return np.log10(sample_field(field, points).E)


def pixie(field, points):
    """Mean of the ten nearest voxels weighted by inverse distance: parts mix."""
    from scipy.spatial import cKDTree

    tree = cKDTree(field.grid.centers()[field.occupied])
    distance, near = tree.query(points, k=10, workers=-1)
    weight = 1 / np.maximum(distance, 1e-8)
    values = np.stack([np.log10(field.E), field.nu, np.log10(field.rho)], -1)[field.occupied]
    return ((weight[..., None] * values[near]).sum(1) / weight.sum(1)[:, None])[:, 0]


TOOLS = {"autophyx-tet": ours, "cKDTree k=10": pixie}


def measure(tool: str, n: int) -> dict:
    field, points = ball(), surface_points(n)
    TOOLS[tool](field, points[:100])  # imports
    wall, cpu = time.perf_counter(), time.process_time()
    found = TOOLS[tool](field, points)
    row = {
        "tool": tool,
        "points": n,
        "wall_s": round(time.perf_counter() - wall, 3),
        "cpu_s": round(time.process_time() - cpu, 3),
        "rss_mb": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024),
    }
    clear = np.abs(points[:, 2]) > field.grid.h  # on the interface either part is right
    return row | {"error": round(float(np.abs(found - law(points))[clear].max()), 3)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, default=1_000_000)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    fresh = multiprocessing.get_context("spawn")
    rows = []
    for tool in TOOLS:
        with fresh.Pool(1) as pool:
            rows.append(pool.apply(measure, (tool, options.points)))
        if not options.json:
            print(rows[-1])
    if options.json:
        print(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
