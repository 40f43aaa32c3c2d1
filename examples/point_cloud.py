"""How does a point cloud become a body with a mass?

Points on a sphere of 10 cm in millimetres, as a scanner gives them: a surface through them, tets in
it, cork on them, and E, nu, rho back on every point.
"""

import autophyx_tet as apx
import numpy as np
from autophyx_tet.converters import PointTable, read_points, write_points

count, radius = 4000, 0.05  # m
z = 1 - (2 * np.arange(count) + 1) / count
turn = np.arange(count) * np.pi * (3 - 5**0.5)  # the golden angle spreads them evenly
sphere = np.stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z], axis=1)
scan = PointTable(dict(zip("xyz", 1e3 * radius * sphere.T, strict=True)))  # mm
write_points("ball.ply", scan)

solid = apx.convert("ball.ply", units="mm", up="z", edge_length_rel=0.1, output="ball.msh")
body = apx.assign("ball.msh", "it is made of cork", output="cork.msh")
cork = apx.load_table().exact("cork").value()
exact = 4 / 3 * np.pi * radius**3 * cork.rho
print(f"{len(solid.mesh.tets)} tets, {body.mesh.mass * 1e3:.1f} g, exact {exact * 1e3:.1f} g")
assert abs(body.mesh.mass / exact - 1) < 0.03  # the surface through the points is 1 to 2 % off

apx.transfer("cork.msh", "ball.ply", output="cork.ply")
back = read_points("cork.ply").columns
assert np.allclose(back["E"], cork.E, rtol=1e-6)  # single precision
