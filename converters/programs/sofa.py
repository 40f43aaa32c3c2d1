"""SOFA: a .scn scene beside a .msh; E varies a tet through local stiffness factors."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...fem.mesh import TetMesh, material_of
from ...fem.scene.supports import find_supports
from ...fem.scene.up import up_vector
from ..files import writing
from ..mesh.msh import write_msh
from ..registry import Format, Keeps, Program
from .export import SceneOptions
from .material_bins import vertex_masses

_SCENE = """<?xml version="1.0"?>
<Node name="root" dt="0.01" gravity="{gravity}">
  <RequiredPlugin name="Sofa.Component"/>
  <DefaultAnimationLoop/>
  <Node name="body">
    <EulerImplicitSolver/>
    <CGLinearSolver iterations="200" tolerance="1e-9" threshold="1e-9"/>
    <MeshGmshLoader name="mesh" filename="{mesh}"/>
    <TetrahedronSetTopologyContainer src="@mesh"/>
    <TetrahedronSetGeometryAlgorithms template="Vec3"/>
    <MechanicalObject template="Vec3" src="@mesh"/>
    <DiagonalMass vertexMass="{masses}"/>
    <TetrahedronFEMForceField method="large" youngModulus="{young}" poissonRatio="{poisson}"
      localStiffnessFactor="{factors}"/>
{constraints}
  </Node>
</Node>
"""


def _write(path: Path, mesh: TetMesh, options: SceneOptions) -> list[Path]:
    """Write scene and mesh: largest E times a factor a tet, masses at the points.

    SOFA knows one Poisson's ratio a force field: it is the mean over the volume.
    """
    material = material_of(mesh)
    supports = options.supports or find_supports(mesh, options.up)[0]
    mesh_path = path.with_suffix(".msh")
    young = float(material.E.max())
    # One constraint for every set of directions in which points are held
    constraints, fixed = [], supports.fixed
    for directions in np.unique(fixed[fixed.any(axis=1)], axis=0):
        points = _row(np.flatnonzero((fixed == directions).all(axis=1)))
        kind, which = "FixedProjectiveConstraint", ""
        if not directions.all():
            kind = "PartialFixedProjectiveConstraint"
            which = f' fixedDirections="{_row(directions.astype(int))}"'
        constraints.append(f'    <{kind} indices="{points}"{which}/>')
    scene = _SCENE.format(
        gravity=_row(-options.gravity * up_vector(options.up)),
        mesh=mesh_path.name.replace("&", "&amp;").replace('"', "&quot;"),
        masses=_row(vertex_masses(mesh)),
        young=repr(young),
        poisson=repr(float(material.nu @ mesh.volumes / mesh.volume)),
        factors=_row(material.E / young),
        constraints="\n".join(constraints),
    )
    write_msh(mesh_path, mesh.with_material(material.without_grain()))
    with writing(path) as target:
        target.write_text(scene, encoding="utf-8")
    return [path, mesh_path]


SOFA = Program(
    (
        Format(
            "SOFA scene",
            (".scn",),
            write=_write,
            keeps=frozenset({Keeps.REGIONS, Keeps.E, Keeps.HELD, Keeps.ROLLERS}),
        ),
    )
)


def _row(values: np.ndarray) -> str:
    return " ".join(map(repr, values.tolist()))
