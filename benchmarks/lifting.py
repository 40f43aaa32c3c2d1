"""Lifting methods side by side on one scene: residual, leak, time.

    python benchmarks/lifting.py --json

The scene is a trunk behind leaves in a 64^3 grid, seen by 15 cameras of the upper hemisphere. Every
part has one random unit feature of D channels; each picture cell shows the feature of what is
nearest, plus noise. ``leak`` is the mean share of the leaves' feature in the trunk's surface cells
that no camera sees; ``residual`` the RMS error of the rendered features relative to their RMS.
SGD is Adam on random batches of the same rays, the paper's way. Its cells have no notion of being
seen: those without gradient stay at 0.
"""

import argparse
import json
import os
import time

import numpy as np
from autophyx_tet.predictors.appearance.features import Lifted, lift, pixel_rays, ray_weights
from autophyx_tet.predictors.appearance.surface import opaque_density
from autophyx_tet.predictors.appearance.views import hemisphere
from autophyx_tet.predictors.grid import Grid

CELLS, VIEWS, PIXELS = 64, 15, 64  # pixels: a 256 pixel picture seen by a network of stride 4
NOISE = 0.3  # norm of the noise relative to a feature's
LEAVES, TRUNK = 0, 1


def scene():
    """Occupied surface cells and the part of every cell: a trunk under a crown of leaves."""
    grid = Grid(np.full(3, -1.0), 2 / CELLS, (CELLS,) * 3)
    x, y, z = np.moveaxis(grid.centers(), -1, 0)
    trunk = (np.hypot(x, y) < 0.2) & (np.abs(z) < 0.97)
    rng = np.random.default_rng(0)
    shell = np.abs(np.sqrt(x**2 + y**2 + ((z - 0.2) / 0.75) ** 2) - 0.92) < 1.2 * grid.h
    leaves = shell & (rng.random(grid.shape) < 0.8) & ~trunk
    part = np.where(leaves, LEAVES, np.where(trunk, TRUNK, -1))
    return grid, part


def pictures(grid, part, dim, rng):
    """Noisy features of what every ray sees first, and the share of the object in each pixel."""
    cameras = hemisphere(np.stack([grid.lo, grid.hi]) * 0.75, count=VIEWS, up="z", pixels=PIXELS)
    density = opaque_density(part >= 0, grid)
    blank = np.zeros((VIEWS, PIXELS, PIXELS, 1))
    matrix = ray_weights(pixel_rays(blank, cameras, None), density, grid)
    share = matrix @ np.eye(2, dtype=np.float32)[part[density > 0]]
    basis = np.linalg.qr(rng.normal(size=(dim, 2)))[0].T.astype(np.float32)
    features = basis[share.argmax(axis=1)]
    features += rng.normal(size=features.shape).astype(np.float32) * (NOISE / np.sqrt(dim))
    shape = (VIEWS, PIXELS, PIXELS)
    return cameras, density, features.reshape(*shape, dim), share.sum(axis=1).reshape(shape), basis


def sgd(features, cameras, density, grid, opacity, steps=2000, batch=1024, rate=0.05):
    """Adam on the squared error of batches of rays (AutoPhyX 3.1), same matrix, same rays."""
    import torch

    rays = pixel_rays(features, cameras, opacity)
    matrix = ray_weights(rays, density, grid)
    total = np.asarray(matrix.sum(axis=1)).ravel()
    keep = total >= 0.1
    matrix, wanted = (matrix[keep].T / total[keep]).T.tocsr(), rays.features[keep]
    weight = np.asarray(matrix.sum(axis=0)).ravel()
    reached = weight > 0  # the others have no gradient and stay 0
    full, matrix = matrix, matrix[:, reached]
    field = torch.zeros(matrix.shape[1], wanted.shape[1], requires_grad=True)
    adam = torch.optim.Adam([field], lr=rate, fused=True)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(adam, steps)
    rng = np.random.default_rng(0)
    for _ in range(steps):
        picked = rng.integers(len(wanted), size=batch)
        rows = matrix[picked].tocoo()
        sparse = torch.sparse_coo_tensor(
            np.stack([rows.row, rows.col]),
            torch.from_numpy(rows.data.astype(np.float32)),
            rows.shape,
        )
        error = torch.sparse.mm(sparse, field) - torch.from_numpy(wanted[picked])
        adam.zero_grad()
        (error**2).sum(dim=1).mean().backward()
        adam.step()
        schedule.step()
    values = np.zeros((full.shape[1], wanted.shape[1]), dtype=np.float32)
    values[reached] = field.detach().numpy()
    error = full @ values - wanted
    residual = float(np.sqrt((error**2).mean() / (wanted**2).mean()))
    return Lifted(np.argwhere(density > 0), values, weight, residual, len(wanted))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--dim", type=int, default=384)
    parser.add_argument("--steps", type=int, default=2000, help="of SGD; 0 leaves it out")
    options = parser.parse_args()
    grid, part = scene()
    rng = np.random.default_rng(1)
    cameras, density, features, opacity, basis = pictures(grid, part, options.dim, rng)
    trunk = part[density > 0] == TRUNK
    methods = {
        name: lambda name=name: lift(features, cameras, density, grid, opacity=opacity, method=name)
        for name in ("solve", "weighted", "average")
    }
    if options.steps:
        methods["sgd"] = lambda: sgd(features, cameras, density, grid, opacity, steps=options.steps)
    rows = []
    hidden = None
    for name, run in methods.items():
        wall, cpu = time.perf_counter(), time.process_time()
        lifted = run()
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        hidden = trunk & ~lifted.seen if hidden is None else hidden
        leak = float(np.abs(lifted.values[hidden] @ basis[LEAVES]).mean())
        row = {"method": name, "residual": round(lifted.residual, 5), "leak": round(leak, 5)}
        row |= {"wall_s": round(wall, 2), "cpu_s": round(cpu, 2)}
        row |= {"rays": lifted.rays, "cells": len(lifted.cells), "hidden": int(hidden.sum())}
        rows.append(row)
    if options.json:
        print(json.dumps({"cpus": os.cpu_count(), "dim": options.dim, "rows": rows}, indent=1))
    else:
        for row in rows:
            print("  ".join(f"{key} {value}" for key, value in row.items()))


if __name__ == "__main__":
    main()
