"""USD: an ASCII stage with a TetMesh, a subset and a deformable material a bin, values a tet."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ...fem.errors import UsageError
from ...fem.scene.mesh import TetMesh, material_of
from ..files import writing
from ..registry import MATERIAL, Format, Program
from .material_bins import Bins
from .scene_options import SceneOptions


def _write(path: Path, mesh: TetMesh, bins: Bins, options: SceneOptions) -> list[Path]:
    """Write metres and kilograms; exact E, nu, rho stay beside the bins as uniform primvars."""
    if options.up == "x":
        raise UsageError("USD knows the up axes y and z; turn the mesh or take another target")
    with writing(path) as target, target.open("w", encoding="utf-8", newline="\n") as file:
        file.write(
            '#usda 1.0\n(\n    defaultPrim = "World"\n    kilogramsPerUnit = 1\n'
            f'    metersPerUnit = 1\n    upAxis = "{options.up.upper()}"\n)\n\n'
            'def Xform "World"\n{\n'
        )
        file.writelines(_tet_mesh(mesh, bins))
        file.write('    def Scope "Materials"\n    {\n')
        for i in range(len(bins)):
            file.writelines(_material(bins, i))
        file.write("    }\n}\n")
    return [path]


USD = Program((Format("USD stage", (".usda",), write=_write, keeps=MATERIAL, binned=MATERIAL),))


def _tet_mesh(mesh: TetMesh, bins: Bins) -> Iterator[str]:
    material = material_of(mesh)
    low, high = mesh.bounds
    yield '    def TetMesh "Body" (\n        prepend apiSchemas = ["MaterialBindingAPI"]\n'
    yield "    )\n    {\n"
    yield f"        float3[] extent = [{_tuple(low)}, {_tuple(high)}]\n"
    yield f"        point3f[] points = [{', '.join(map(_tuple, mesh.points))}]\n"
    yield f"        int4[] tetVertexIndices = [{', '.join(map(_tuple, mesh.tets))}]\n"
    faces = mesh.boundary.faces
    yield f"        int3[] surfaceFaceVertexIndices = [{', '.join(map(_tuple, faces))}]\n"
    for name in ("E", "nu", "rho"):
        values = ", ".join(map(repr, getattr(material, name).tolist()))
        yield f'        double[] primvars:{name} = [{values}] (interpolation = "uniform")\n'
    yield '        uniform token subsetFamily:materialBind:familyType = "partition"\n'
    for i in range(len(bins)):
        members = ", ".join(map(str, np.flatnonzero(bins.label == i).tolist()))
        yield (
            f'        def GeomSubset "bin{i + 1}" (\n'
            '            prepend apiSchemas = ["MaterialBindingAPI"]\n        )\n        {\n'
            '            uniform token elementType = "tetrahedron"\n'
            '            uniform token familyName = "materialBind"\n'
            f"            int[] indices = [{members}]\n"
            f"            rel material:binding = </World/Materials/bin{i + 1}>\n        }}\n"
        )
    yield "    }\n"


def _material(bins: Bins, i: int) -> Iterator[str]:
    """Canonical attributes, and the older names that Omniverse and Isaac Lab read."""
    schemas = '"PhysicsVolumeDeformableMaterialAPI", "OmniPhysicsDeformableMaterialAPI"'
    yield f'        def Material "bin{i + 1}" (\n'
    yield f"            prepend apiSchemas = [{schemas}]\n        )\n        {{\n"
    values = {"youngsModulus": bins.E[i], "poissonsRatio": bins.nu[i], "density": bins.rho[i]}
    for space in ("physics", "omniphysics"):
        for name, value in values.items():
            yield f"            float {space}:{name} = {float(value)!r}\n"
    yield "        }\n"


def _tuple(values: np.ndarray) -> str:
    return f"({', '.join(map(repr, values.tolist()))})"
