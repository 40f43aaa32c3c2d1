"""How do I drive Gaussian splats by a simulation?

Splats inside a rubber bar that is pulled: they move with it and become longer by its strain.
"""

import numpy as np
from autophyx_tet.converters import Driven, PointTable, standard_columns, write_points
from autophyx_tet.fem import ElementMaterial, Supports, Traction, box_mesh, solve_static

size, E, nu, stress = (1.0, 0.2, 0.2), 1e6, 0.3, 1e4  # m, Pa, 1, Pa
bar = box_mesh(size, (5, 1, 1))
bar = bar.with_material(ElementMaterial.uniform(len(bar.tets), E=E, nu=nu, rho=1000.0))
rollers = Supports.none(len(bar.points))
for axis in range(3):  # it slides in the planes x = 0, y = 0 and z = 0
    rollers = rollers.with_fixed(bar.points[:, axis] == 0, axis)
faces = bar.boundary.faces
end = faces[(bar.points[faces][:, :, 0] == size[0]).all(axis=1)]
rest = solve_static(bar, rollers, traction=Traction(end, np.array([stress, 0.0, 0.0])))

count, rng = 1000, np.random.default_rng(0)
scale = 0.01  # m, of round splats
splats = PointTable(
    standard_columns(
        means=rng.uniform((0, 0, 0), size, (count, 3)),
        log_scales=np.full((count, 3), np.log(scale)),
        rotations=np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),  # w, x, y, z
        opacity=np.full(count, 0.9),
        f_dc=rng.normal(size=(count, 3)),
    )
)
(moved,) = Driven.of(splats, bar).frames([rest.displacement])  # a frame for every displacement
write_points("moved.ply", moved)

# Exact: u = (s / E) (x, -nu y, -nu z); files of splats are in single precision.
strain = stress / E * np.array([1, -nu, -nu])
assert np.allclose(moved.positions, splats.positions * (1 + strain), atol=1e-6)
longest = np.exp(max(moved.columns[f"scale_{i}"].mean() for i in range(3)))
print(f"splats are {longest / scale - 1:.2%} longer, the bar is by {strain[0]:.2%}")
assert abs(longest / scale - (1 + strain[0])) < 1e-5
