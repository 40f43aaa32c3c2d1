"""How do I recover E from a motion?

A bar of unknown rubber is let go and filmed; `match` finds by what factor the E that was guessed is
wrong.
"""

import autophyx_tet as apx
from autophyx_tet.fem import ElementMaterial, box_mesh


def bar(E):
    mesh = box_mesh((0.1, 0.1, 0.4), (2, 2, 4))  # m
    return mesh.with_material(ElementMaterial.uniform(len(mesh.tets), E=E, nu=0.3, rho=500.0))


poke = {"scenario": "poke", "poke_force": 0.2, "solver": "lbs"}  # N
truth, guess = 1.5e5, 1e5  # Pa
apx.simulate(bar(truth), output="film.pvd", **poke)

found = apx.match(bar(guess), "film.pvd", output="rubber.npz", **poke)
E = guess * found.fit.scale
print(f"E {E:.4g} Pa, it was {truth:.4g} Pa; {found.summary}")
# 1 %: the film is of the full motion's coordinates at another stiffness, and its files are single.
assert abs(E / truth - 1) < 0.01

again = apx.simulate(bar(guess), parameters="rubber.npz", **poke)
print(f"with it the tip moves by {again.motion.displacements.max() * 1e3:.1f} mm at most")
