"""Gmsh: a .msh with a group a region, one view an array under the wanted names."""

from __future__ import annotations

from pathlib import Path

from ...fem.scene.mesh import TetMesh
from ..mesh.msh import write_msh
from ..registry import MATERIAL, Format, Keeps, Program
from .material_bins import named_arrays
from .scene_options import SceneOptions


def _write(path: Path, mesh: TetMesh, options: SceneOptions) -> list[Path]:
    write_msh(path, mesh.with_material(None), cell_data=named_arrays(mesh, options.names))
    return [path]


GMSH = Program((Format("Gmsh 2.2", (".msh",), write=_write, keeps=MATERIAL | {Keeps.REGIONS}),))
