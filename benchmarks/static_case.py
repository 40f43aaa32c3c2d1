"""What static solvers are compared on: a body, what holds it, its weight; see ``statics.py``.

Either the cantilever of two materials or one of the real meshes of ``real_meshes.py``.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

SIZES = {"S": (40, 6, 8), "M": (60, 12, 12), "L": (96, 18, 20)}
# Their linear tets have the nodes that quadratic ones of S and M have.
SIZES |= {f"2{size}": tuple(2 * n for n in SIZES[size]) for size in "SM"}
TOLERANCE = 1e-8
STRENGTH_OF_GRAVITY = 9.81


@dataclass(frozen=True, eq=False)
class Case:
    """A ``mesh`` with material, clamped at the points ``held`` (points,), under ``gravity`` (3,).

    Answers are compared by the mean displacement of the points ``probe`` (points,) along
    ``direction`` (3,).
    """

    mesh: object
    held: np.ndarray
    gravity: np.ndarray
    probe: np.ndarray

    @cached_property
    def direction(self) -> np.ndarray:
        """Upwards, as a unit vector."""
        return -self.gravity / np.linalg.norm(self.gravity)

    def tip(self, u: np.ndarray) -> float:
        """Mean displacement [m] of the probe, of displacements (points or nodes, 3)."""
        return float((u[: len(self.probe)][self.probe] @ self.direction).mean())

    def held_nodes(self, space) -> np.ndarray:
        """Nodes of a quadratic space (nodes,) that are clamped: our edges, for every peer."""
        from autophyx_tet.fem.elements.assembly import node_supports
        from autophyx_tet.fem.scene.supports import Supports

        supports = Supports.clamp(len(self.held), self.held)
        return node_supports(supports, space).fixed.all(axis=1)


def cantilever(size: str) -> Case:
    """Box 1 x 0.2 x 0.2 m clamped at x = 0; the probe is the end face."""
    from autophyx_tet.fem.material import ElementMaterial
    from autophyx_tet.fem.mesh import box_mesh

    mesh = box_mesh((1, 0.2, 0.2), SIZES[size])
    upper = mesh.centroids[:, 2] > 0.1
    pick = lambda high, low: np.where(upper, high, low)  # noqa: E731
    material = ElementMaterial(pick(1e7, 1e6), pick(0.4, 0.3), pick(1200.0, 1000.0))
    x, gravity = mesh.points[:, 0], np.array([0.0, 0.0, -STRENGTH_OF_GRAVITY])
    return Case(mesh.with_material(material), x == 0, gravity, np.isclose(x, 1.0))


def standing(path: Path) -> Case:
    """Mesh file on the base that our ``sag`` finds; the probe is every point that is not held."""
    from autophyx_tet.converters.mesh.meshdata import read_mesh
    from autophyx_tet.fem.scenarios import Sag
    from autophyx_tet.toolkit.asset.document import Sidecar

    mesh, sidecar = read_mesh(path), Sidecar.read(path)
    scene = Sag().scene(mesh, up=sidecar.up if sidecar else "z")
    held = scene.supports.fixed.all(axis=1)
    used = np.zeros(len(held), dtype=bool)
    used[mesh.tets] = True
    return Case(mesh, held, np.asarray(scene.gravity_vector), used & ~held)


def make_row(case: Case, dof, start, middle, u, iterations, residual) -> dict:
    end = time.process_time()
    return {
        "tets": len(case.mesh.tets),
        "dof": int(dof),
        "assemble_cpu_s": middle - start,
        "solve_cpu_s": end - middle,
        "cpu_s": end - start,
        "iterations": int(iterations),
        "tip": case.tip(u),
        "rel_residual": float(residual),
    }
