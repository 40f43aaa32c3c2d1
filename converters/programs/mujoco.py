"""MuJoCo: an MJCF scene of flexes, one a bin, that share a body with three slides a vertex."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ...fem.scene.mesh import TetMesh
from ...fem.scene.up import up_vector
from ..files import writing
from ..registry import Format, Keeps, Program
from .material_bins import Bins, vertex_masses
from .scene_options import SceneOptions

log = logging.getLogger(__name__)

_MANY = 5000  # vertices; beyond, MuJoCo's own mass matrix and contact search become slow
_TINY = 1e-9  # kg m^2: a point mass has no inertia, but MuJoCo wants one
_RADIUS = 1e-3  # of the box's diagonal: contact margin around each vertex


def _write(path: Path, mesh: TetMesh, bins: Bins, options: SceneOptions) -> list[Path]:
    """Write a body that falls on the ground plane below it; masses are lumped to the vertices."""
    used = np.unique(mesh.tets)
    if len(used) > _MANY:
        log.warning("%d vertices give MuJoCo %d degrees of freedom", len(used), 3 * len(used))
    number = np.full(len(mesh.points), -1)
    number[used] = np.arange(len(used))
    with writing(path) as target, target.open("w", encoding="utf-8", newline="\n") as file:
        file.write('<mujoco model="autophyx_tet">\n')
        file.writelines(_world(mesh, used, options))
        file.write("  <deformable>\n")
        for bin_id in range(len(bins)):
            file.writelines(_flex(mesh, number, bins, bin_id))
        file.write("  </deformable>\n</mujoco>\n")
    return [path]


MUJOCO = Program(
    (Format("MJCF scene", (".xml",), write=_write, binned=frozenset({Keeps.E, Keeps.NU})),)
)


def _world(mesh: TetMesh, used: np.ndarray, options: SceneOptions) -> Iterator[str]:
    upwards = up_vector(options.up)
    gravity = -options.gravity * upwards
    ground = (float((mesh.bounds @ upwards).min()) - 2 * _radius(mesh)) * upwards
    yield f'  <option gravity="{_row(gravity)}" integrator="discrete" timestep="0.002"/>\n'
    yield f'  <statistic extent="{_diagonal(mesh)!r}" center="{_row(mesh.bounds.mean(axis=0))}"/>\n'
    yield "  <worldbody>\n"
    yield (
        f'    <geom name="ground" type="plane" size="0 0 1" pos="{_row(ground)}" '
        f'zaxis="{_row(upwards)}"/>\n'
    )
    masses = vertex_masses(mesh)[used].tolist()
    for i, (place, mass) in enumerate(zip(mesh.points[used], masses, strict=True)):
        yield f'    <body name="v{i}" pos="{_row(place)}">'
        yield f'<inertial pos="0 0 0" mass="{mass!r}" diaginertia="{_TINY} {_TINY} {_TINY}"/>'
        for slide in ("1 0 0", "0 1 0", "0 0 1"):
            yield f'<joint type="slide" axis="{slide}"/>'
        yield "</body>\n"
    yield "  </worldbody>\n"


def _flex(mesh: TetMesh, number: np.ndarray, bins: Bins, bin_id: int) -> Iterator[str]:
    """One material: its vertices are the shared bodies, numbered anew inside the flex."""
    vertices, elements = np.unique(number[mesh.tets[bins.label == bin_id]], return_inverse=True)
    bodies = " ".join(f"v{i}" for i in vertices)
    E, nu = float(bins.E[bin_id]), float(bins.nu[bin_id])
    yield f'    <flex name="bin{bin_id + 1}" dim="3" radius="{_radius(mesh)!r}"\n'
    yield f'      body="{bodies}"\n'
    yield f'      element="{" ".join(map(str, elements.ravel().tolist()))}">\n'
    yield f'      <elasticity young="{E!r}" poisson="{nu!r}"/>\n'
    yield '      <contact selfcollide="none"/>\n    </flex>\n'


def _diagonal(mesh: TetMesh) -> float:
    return float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))


def _radius(mesh: TetMesh) -> float:
    return _RADIUS * _diagonal(mesh)


def _row(values: np.ndarray) -> str:
    return " ".join(repr(value) for value in values.tolist())
