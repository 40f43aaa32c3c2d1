"""Newton: .vtk or .npz for ``newton.TetMesh.create_from_file``, Lame parameters a tet."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...fem.mesh import TetMesh, material_of
from ..mesh.vtk import write_vtk
from ..npz import save_npz
from ..registry import MATERIAL, Format, Keeps, Program
from .export import SceneOptions
from .material_bins import vertex_masses


def _write_vtk(path: Path, mesh: TetMesh, options: SceneOptions) -> list[Path]:
    """Write k_mu, k_lambda [Pa] a tet beside E, nu, rho, and vertex_mass [kg] a point.

    Newton takes one ``density`` a mesh and refuses an array: a varying rho is lumped to the
    points, which is what its solvers use.
    """
    lam, mu = material_of(mesh).lame
    cells, points = {"k_mu": mu, "k_lambda": lam}, {"vertex_mass": vertex_masses(mesh)}
    plain = mesh.with_material(material_of(mesh).without_grain())
    write_vtk(path, plain, point_data=points, cell_data=cells)
    return [path]


def _write_npz(path: Path, mesh: TetMesh, options: SceneOptions) -> list[Path]:
    """Write k_mu, k_lambda [Pa] a tet in float32, vertex_mass [kg] a point, the mean density."""
    lam, mu = material_of(mesh).lame
    save_npz(
        path,
        vertices=mesh.points.astype(np.float32),
        tet_indices=mesh.tets.ravel(),
        k_mu=mu.astype(np.float32),
        k_lambda=lam.astype(np.float32),
        density=np.array(mesh.mass / mesh.volume),
        vertex_mass=vertex_masses(mesh),
    )
    return [path]


NEWTON = Program(
    (
        Format(
            "legacy VTK", (".vtk",), write=_write_vtk, keeps=MATERIAL | {Keeps.REGIONS}, single=True
        ),
        Format(
            "Newton archive",
            (".npz",),
            write=_write_npz,
            keeps=frozenset({Keeps.E, Keeps.NU}),
            single=True,
        ),
    )
)
