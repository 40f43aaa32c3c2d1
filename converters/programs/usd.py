"""USD: an ASCII stage with a deformable TetMesh, a subset and a material a bin, values a tet.

The schemas of deformable bodies are written under their canonical names (``physics:``, which
Newton reads) and their older ones (``omniphysics:``, which Isaac Lab and Omniverse read). They know
one material a body: a body of several has their mean bound to it, and each to its own subset.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...fem.mesh import TetMesh, material_of
from ...fem.note import Note
from ...predictors.asset import upright
from ..files import writing
from ..registry import MATERIAL, Format, Program
from .export import SceneOptions
from .material_bins import Bins, bin_materials

_SPACES = ("physics", "omniphysics")
_BODY = (
    "MaterialBindingAPI",
    "PhysicsCollisionAPI",
    "PhysicsDeformableBodyAPI",
    "PhysicsVolumeDeformableSimAPI",
    "OmniPhysicsDeformableBodyAPI",
    "OmniPhysicsVolumeDeformableSimAPI",
)
_MATERIAL = ("PhysicsVolumeDeformableMaterialAPI", "OmniPhysicsDeformableMaterialAPI")


def _write(path: Path, mesh: TetMesh, bins: Bins, options: SceneOptions) -> list[Path]:
    """Write metres and kilograms; exact E, nu, rho stay beside the bins as uniform primvars.

    A stage has y or z up: of a body that has another axis up the points are turned until z is.
    """
    up = options.up
    if up not in ("y", "z"):
        mesh, up = replace(mesh, points=upright(mesh.points, up)), "z"
    with writing(path) as target, target.open("w", encoding="utf-8", newline="\n") as file:
        file.write(
            '#usda 1.0\n(\n    defaultPrim = "World"\n    kilogramsPerUnit = 1\n'
            f'    metersPerUnit = 1\n    upAxis = "{up.upper()}"\n)\n\n'
            'def Xform "World"\n{\n'
        )
        file.writelines(_tet_mesh(mesh, bins))
        file.write('    def Scope "Materials"\n    {\n')
        for i in range(len(bins)):
            file.writelines(_material(f"bin{i + 1}", bins, i))
        if len(bins) > 1:
            file.writelines(_material("mean", bin_materials(mesh, bins=1), 0))
        file.write("    }\n}\n")
    return [path]


USD = Program(
    (Format("USD stage", (".usda",), write=_write, keeps=MATERIAL, binned=MATERIAL, single=True),)
)


def _tet_mesh(mesh: TetMesh, bins: Bins) -> Iterator[str]:
    material = material_of(mesh)
    low, high = mesh.bounds
    points, tets = (", ".join(map(_tuple, rows)) for rows in (mesh.points, mesh.tets))
    yield f'    def TetMesh "Body" (\n        prepend apiSchemas = [{_quoted(_BODY)}]\n'
    yield "    )\n    {\n"
    yield f"        float3[] extent = [{_tuple(low)}, {_tuple(high)}]\n"
    yield f"        point3f[] points = [{points}]\n"
    yield f"        int4[] tetVertexIndices = [{tets}]\n"
    for space in _SPACES:
        yield f"        point3f[] {space}:restShapePoints = [{points}]\n"
        yield f"        int4[] {space}:restTetVtxIndices = [{tets}]\n"
        yield f"        float {space}:mass = {mesh.mass!r}\n"
    bound = "mean" if len(bins) > 1 else "bin1"
    yield f"        rel material:binding = </World/Materials/{bound}>\n"
    faces = mesh.boundary.faces
    yield f"        int3[] surfaceFaceVertexIndices = [{', '.join(map(_tuple, faces))}]\n"
    for name in ("E", "nu", "rho"):
        values = ", ".join(map(repr, getattr(material, name).tolist()))
        yield f'        double[] primvars:{name} = [{values}] (interpolation = "uniform")\n'
    yield '        uniform token subsetFamily:materialBind:familyType = "partition"\n'
    for i in range(len(bins)):
        members = ", ".join(map(str, np.flatnonzero(bins.label == i).tolist()))
        yield Note("usd.def_geomsubset", i=i + 1, members=members)
    yield "    }\n"


def _material(name: str, bins: Bins, i: int) -> Iterator[str]:
    yield f'        def Material "{name}" (\n'
    yield f"            prepend apiSchemas = [{_quoted(_MATERIAL)}]\n        )\n        {{\n"
    values = {"youngsModulus": bins.E[i], "poissonsRatio": bins.nu[i], "density": bins.rho[i]}
    for space in _SPACES:
        for attribute, value in values.items():
            yield f"            float {space}:{attribute} = {float(value)!r}\n"
    yield "        }\n"


def _quoted(names: tuple[str, ...]) -> str:
    return ", ".join(f'"{name}"' for name in names)


def _tuple(values: np.ndarray) -> str:
    return f"({', '.join(map(repr, values.tolist()))})"
