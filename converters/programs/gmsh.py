"""Gmsh: a .msh with a group a region, one view an array under the wanted names."""

from __future__ import annotations

from pathlib import Path

from ...fem.scene.material import GRAIN, material_arrays
from ...fem.scene.mesh import TetMesh
from ..mesh.meshdata import WHOLE
from ..mesh.msh import write_msh
from ..registry import Format, Keeps, Program
from .material_bins import named_arrays
from .scene_options import SceneOptions


def _write(path: Path, mesh: TetMesh, options: SceneOptions) -> list[Path]:
    grain = {
        name: values for name, values in material_arrays(mesh.material).items() if name in GRAIN
    }
    arrays = named_arrays(mesh, options.names) | grain
    write_msh(path, mesh.with_material(None), cell_data=arrays)
    return [path]


GMSH = Program(
    (
        Format(
            "Gmsh 2.2", (".msh",), write=_write, keeps=WHOLE - {Keeps.POINT_DATA, Keeps.CELL_DATA}
        ),
    )
)
