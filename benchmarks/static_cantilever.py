"""The cantilever of two materials that static solvers are compared on; see ``statics.py``."""

from __future__ import annotations

import time

import numpy as np

SIZES = {"S": (40, 6, 8), "M": (60, 12, 12), "L": (96, 18, 20)}
TOLERANCE = 1e-8
GRAVITY = (0.0, 0.0, -9.81)


def bench_mesh(size: str):
    from autophyx_tet.fem.scene.box import box_mesh
    from autophyx_tet.fem.scene.material import ElementMaterial

    mesh = box_mesh((1, 0.2, 0.2), SIZES[size])
    upper = mesh.centroids[:, 2] > 0.1
    pick = lambda high, low: np.where(upper, high, low)  # noqa: E731
    material = ElementMaterial(pick(1e7, 1e6), pick(0.4, 0.3), pick(1200.0, 1000.0))
    return mesh.with_material(material)


def tip(mesh, u: np.ndarray) -> float:
    return float(u[np.isclose(mesh.points[:, 0], 1.0), 2].mean())


def make_row(mesh, dof, start, middle, u, iterations, residual) -> dict:
    end = time.process_time()
    return {
        "tets": len(mesh.tets),
        "dof": int(dof),
        "assemble_cpu_s": middle - start,
        "solve_cpu_s": end - middle,
        "cpu_s": end - start,
        "iterations": int(iterations),
        "tip": tip(mesh, u[: len(mesh.points)]),
        "rel_residual": float(residual),
    }
