"""Newton: .vtk or .npz for ``newton.TetMesh.create_from_file``, Lame parameters a tet."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...fem.scene.mesh import TetMesh
from ..mesh.vtk import write_vtk
from ..npz import save_npz
from .material_bins import material_of, vertex_masses

if TYPE_CHECKING:
    from .export import ExportOptions


def write(path: Path, mesh: TetMesh, options: ExportOptions) -> list[Path]:
    """Write k_mu, k_lambda [Pa] a tet and vertex_mass [kg] a point.

    Newton takes one ``density`` a mesh and refuses an array: a varying rho is lumped to the
    points, which is what its solvers use; .npz states the mean density as well.
    """
    lam, mu = material_of(mesh).lame
    masses = vertex_masses(mesh)
    if path.suffix.lower() == ".vtk":
        write_vtk(
            path,
            mesh,
            point_data={"vertex_mass": masses},
            cell_data={"k_mu": mu, "k_lambda": lam},
        )
    else:
        save_npz(
            path,
            vertices=mesh.points.astype(np.float32),
            tet_indices=mesh.tets.ravel(),
            k_mu=mu.astype(np.float32),
            k_lambda=lam.astype(np.float32),
            density=np.array(mesh.mass / mesh.volume),
            vertex_mass=masses,
        )
    return [path]
