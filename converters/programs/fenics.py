"""FEniCSx: a .msh whose physical groups are bins, their table as JSON, and a loader in Python."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

from ...fem.scene.mesh import TetMesh
from ..files import writing
from ..mesh.msh import write_msh
from ..registry import MATERIAL, Format, Program
from .material_bins import Bins
from .scene_options import SceneOptions

_LOADER = '''"""Load {mesh} into FEniCSx: mesh, and E [Pa], nu, rho [kg/m^3] as DG0 functions."""

import json
from pathlib import Path

import gmsh
import numpy as np
from dolfinx import fem
from mpi4py import MPI

try:
    from dolfinx.io import gmshio
except ImportError:  # its name from 0.10 on
    from dolfinx.io import gmsh as gmshio

HERE = Path(__file__).parent


def load(comm=MPI.COMM_WORLD):
    """Return (mesh, cell tags, {{"E": E, "nu": nu, "rho": rho}})."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    if comm.rank == 0:
        gmsh.merge(str(HERE / "{mesh}"))
    mesh, cells = gmshio.model_to_mesh(gmsh.model, comm, 0, gdim=3)[:2]
    gmsh.finalize()
    table = json.loads((HERE / "{table}").read_text())["bins"]
    make = getattr(fem, "functionspace", getattr(fem, "FunctionSpace", None))
    space = make(mesh, ("DG", 0))
    fields = {{}}
    for name in ("E", "nu", "rho"):
        values = np.zeros(max(map(int, table)) + 1)
        for tag, row in table.items():
            values[int(tag)] = row[name]
        field = fem.Function(space, name=name)
        field.x.array[cells.indices] = values[cells.values]
        fields[name] = field
    return mesh, cells, fields
'''


def _write(path: Path, mesh: TetMesh, bins: Bins, options: SceneOptions) -> list[Path]:
    """Write STEM.msh, STEM.materials.json and STEM_fenics.py, which reads the other two."""
    table = path.with_name(f"{path.stem}.materials.json")
    loader = path.with_name(f"{path.stem}_fenics.py")
    rows = zip(bins.E.tolist(), bins.nu.tolist(), bins.rho.tolist(), strict=True)
    document = {
        "units": {"E": "Pa", "nu": "1", "rho": "kg/m^3"},
        "bins": {str(i): {"E": E, "nu": nu, "rho": rho} for i, (E, nu, rho) in enumerate(rows, 1)},
    }
    groups = tuple(f"bin {i + 1}" for i in range(len(bins)))
    write_msh(path, replace(mesh, region=bins.label, region_names=groups))
    with writing(table) as target:
        target.write_text(json.dumps(document, indent=1), encoding="utf-8")
    with writing(loader) as target:
        target.write_text(_LOADER.format(mesh=path.name, table=table.name), encoding="utf-8")
    return [path, table, loader]


FENICS = Program((Format("Gmsh 2.2, table and loader", (".msh",), write=_write, binned=MATERIAL),))
