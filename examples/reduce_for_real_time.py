"""How do I reduce a body for real time?

A rubber stand, clamped at its foot: thousands of unknowns become a few coordinates that carry its
swings and its weight, with the error that this costs.
"""

import autophyx_tet as apx
from autophyx_tet.converters import load_reduced
from autophyx_tet.fem import ElementMaterial, box_mesh

stand = box_mesh((0.1, 0.1, 0.4), (3, 3, 10))  # m
stand = stand.with_material(
    ElementMaterial.uniform(len(stand.tets), E=1e6, nu=0.4, rho=1100.0)  # Pa, 1, kg/m^3
)
reduced = apx.reduce(stand, output="stand.npz")
print(reduced.summary)

model = load_reduced("stand.npz")  # points, basis, cells: all that a real-time program needs
print(f"{3 * len(stand.points)} unknowns of the mesh, {model.dofs} coordinates of the model")
assert model.basis.shape == (len(model.points), 3, model.dofs)
assert model.dofs < 50
# Its mass is the body's: V rho.
assert abs(model.mass.sum() / (0.1 * 0.1 * 0.4 * 1100.0) - 1) < 1e-6
# The basis holds its slowest vibration: the frequency, an upper bound of the full body's, is kept
# to what the sampled cells cost.
assert abs(model.accuracy.frequency - 1) < 0.01
assert model.accuracy.sag < 0.01
