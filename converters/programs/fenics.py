"""FEniCSx: a .msh whose physical groups are bins, their table as JSON, and a loader in Python."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...fem.mesh import TetMesh
from ...fem.note import Note
from ...fem.table import OrthotropicConstants
from ..files import writing
from ..mesh.msh import write_msh
from ..registry import MATERIAL, Format, Keeps, Program
from .export import SceneOptions
from .material_bins import Bins

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
    """Return (mesh, cell tags, {{"E": E, "nu": nu, "rho": rho}}) and what else the table has.

    Of a grain that is "grain_axes", its directions L, R, T as rows, and the constants along them,
    "E_L" to "nu_RT"; all are 0 where a tet has none.
    """
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    if comm.rank == 0:
        gmsh.merge(str(HERE / "{mesh}"))
    mesh, cells = gmshio.model_to_mesh(gmsh.model, comm, 0, gdim=3)[:2]
    gmsh.finalize()
    table = json.loads((HERE / "{table}").read_text())["bins"]
    fields = {{}}
    for name in next(iter(table.values())):
        shape = np.shape(table["1"][name])
        values = np.zeros((max(map(int, table)) + 1, *shape))
        for tag, row in table.items():
            values[int(tag)] = row[name]
        field = fem.Function(_space(mesh, shape), name=name)
        rows = field.x.array.reshape(-1, values[0].size)
        rows[cells.indices] = values.reshape(len(values), -1)[cells.values]
        fields[name] = field
    return mesh, cells, fields


def _space(mesh, shape):
    """One value of a shape a tet."""
    if hasattr(fem, "functionspace"):
        return fem.functionspace(mesh, ("DG", 0, shape) if shape else ("DG", 0))
    if shape:  # before 0.7
        return fem.TensorFunctionSpace(mesh, ("DG", 0), shape=shape)
    return fem.FunctionSpace(mesh, ("DG", 0))
'''


_UNITS = {name: "1" if name.startswith("nu") else "Pa" for name in OrthotropicConstants._fields}


def _write(path: Path, mesh: TetMesh, bins: Bins, options: SceneOptions) -> list[Path]:
    """Write STEM.msh, STEM.materials.json and STEM_fenics.py, which reads the other two."""
    table = path.with_name(f"{path.stem}.materials.json")
    loader = path.with_name(f"{path.stem}_fenics.py")
    document: dict[str, Any] = {
        "units": {"E": "Pa", "nu": "1", "rho": "kg/m^3", "grain_axes": "1", **_UNITS},
        "bins": {},
    }
    for i in range(len(bins)):  # of a grain all values are 0 where a bin has none
        row = {"E": float(bins.E[i]), "nu": float(bins.nu[i]), "rho": float(bins.rho[i])}
        if bins.grain is not None:
            row["grain_axes"] = bins.grain.axes[i].tolist()
            row |= dict(zip(_UNITS, bins.grain.constants[i].tolist(), strict=True))
        document["bins"][str(i + 1)] = row
    groups = tuple(f"bin {i + 1}" for i in range(len(bins)))
    write_msh(path, replace(mesh, region=bins.label, region_names=groups))
    with writing(table) as target:
        target.write_text(json.dumps(document, indent=1), encoding="utf-8")
    with writing(loader) as target:
        target.write_text(_LOADER.format(mesh=path.name, table=table.name), encoding="utf-8")
    return [path, table, loader]


FENICS = Program(
    (Format(Note("fenics.gmsh_table"), (".msh",), write=_write, binned=MATERIAL | {Keeps.GRAIN}),)
)
