"""How do I hand the mesh to CalculiX, MuJoCo or Newton?

One call a program: a deck for CalculiX, a scene for MuJoCo, a mesh with arrays for Newton.
"""

import re
from pathlib import Path

import autophyx_tet as apx
import numpy as np
from autophyx_tet.converters import read_mesh
from autophyx_tet.fem import ElementMaterial, box_mesh

block = box_mesh((0.2, 0.1, 0.1), (4, 2, 2))  # m
E = np.where(block.centroids[:, 0] < 0.1, 1e6, 5e6)  # Pa: two rubbers side by side
block = block.with_material(
    ElementMaterial(E, np.full(len(E), 0.4), np.full(len(E), 1100.0))  # 1, kg/m^3
)

for program, file in (("calculix", "block.inp"), ("mujoco", "block.xml"), ("newton", "block.vtk")):
    done = apx.export(block, program, output=file)
    print(f"{program}: {', '.join(path.name for path in done.files)}")

# What knows no material a tet gets a material a bin, here two: their moduli are exact.
deck = Path("block.inp").read_text()
moduli = {float(row.split(",")[0]) for row in re.findall(r"\*ELASTIC\n(.*)", deck, re.IGNORECASE)}
assert moduli == {1e6, 5e6}

# Newton reads a value a tet: what comes back is what went in, to the single precision of the file.
back = read_mesh("block.vtk")
assert np.allclose(back.material.E, E, rtol=1e-6)
assert abs(back.mass / (0.2 * 0.1 * 0.1 * 1100.0) - 1) < 1e-6  # V rho
