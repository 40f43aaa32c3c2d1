"""How do I add an export format?

A reader, a writer and what survives, registered by suffix: every verb then takes it.
"""

import json
from pathlib import Path

import autophyx_tet as apx
import numpy as np
from autophyx_tet.converters import MESH_FORMATS, Format, Keeps, MeshData, read_mesh
from autophyx_tet.fem import ElementMaterial, TetMesh, box_mesh

MATERIAL = ("E", "nu", "rho")


def write(path, mesh, *, point_data=None, cell_data=None):
    """Write points [m], tets, regions and, where there is one, the material."""
    arrays = {name: getattr(mesh, name).tolist() for name in ("points", "tets", "region")}
    if mesh.material is not None:
        arrays |= {name: getattr(mesh.material, name).tolist() for name in MATERIAL}
    Path(path).write_text(json.dumps(arrays | {"names": mesh.region_names}))


def read(path):
    """Read what ``write`` wrote."""
    held = json.loads(Path(path).read_text())
    arrays = [np.array(held[name]) for name in ("points", "tets", "region")]
    values = [np.array(held[name]) for name in MATERIAL if name in held]
    material = ElementMaterial(*values) if values else None
    return MeshData(TetMesh(*arrays, tuple(held["names"]), material))


kept = {Keeps.REGIONS, Keeps.E, Keeps.NU, Keeps.RHO}  # the rest is told as lost
MESH_FORMATS.register(".tetjson", Format("tets as JSON", (".tetjson",), read, write, kept))

box = box_mesh((0.1, 0.1, 0.1), (2, 2, 2))  # m
oak = apx.assign(box, "oak", output="oak.tetjson", predictor="retrieval").mesh
back = read_mesh("oak.tetjson")
print(f"{len(back.tets)} tets, {back.mass:.3f} kg")
# JSON writes every digit of a float64: what comes back is bit for bit what went in.
assert all(np.array_equal(getattr(back.material, k), getattr(oak.material, k)) for k in MATERIAL)
assert np.array_equal(back.points, oak.points)
