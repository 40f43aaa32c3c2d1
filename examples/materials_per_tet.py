"""How do I get E, nu and rho on every tet of my mesh?

A hammer of two named parts and a sentence; the arrays are numpy's, one value a tet, in SI.
"""

import autophyx_tet as apx
import numpy as np
import trimesh

handle = trimesh.creation.box((0.02, 0.02, 0.30))  # m
head = trimesh.creation.box((0.10, 0.03, 0.03))
head.apply_translation((0, 0, 0.15 + 0.015))
scene = trimesh.Scene()
scene.add_geometry(handle, node_name="handle", geom_name="handle")
scene.add_geometry(head, node_name="head", geom_name="head")
scene.export("hammer.glb")

solid = apx.convert("hammer.glb", mesher="stuffing", edge_length=0.006)
body = apx.assign(solid.mesh, "a steel head on an oak handle", asset=solid.asset)
mesh = body.mesh
E, nu, rho = mesh.material.E, mesh.material.nu, mesh.material.rho  # Pa, 1, kg/m^3
for number, name in enumerate(mesh.region_names):
    mine = mesh.region == number
    print(f"{name}: {mine.sum()} tets, E {E[mine][0]:.3g} Pa, rho {rho[mine][0]:.0f} kg/m^3")
assert E.shape == nu.shape == rho.shape == (len(mesh.tets),)

# The mass is what the volumes of the two boxes weigh by the table.
table = apx.load_table()
weighs = handle.volume * table.exact("oak").value().rho
weighs += head.volume * table.exact("steel").value().rho
print(f"{mesh.mass:.3f} kg, the boxes: {weighs:.3f} kg")
assert abs(mesh.mass / weighs - 1) < 0.02  # convert keeps volumes to about 1 % a part
np.savez("hammer.npz", points=mesh.points, tets=mesh.tets, E=E, nu=nu, rho=rho)
