"""What does an unknown material do?

It is told, never taken in silence: a warning, or under `strict` an error; values are then a guess
within the ranges of the table.
"""

import autophyx_tet as apx
from autophyx_tet.fem import box_mesh

block = box_mesh((0.1, 0.1, 0.1), (2, 2, 2))  # m
guess = apx.assign(block, "the body is made of unobtainium")
print(*guess.warnings, sep="\n")
assert any("unobtainium" in warning for warning in guess.warnings)

rows = apx.load_table().rows
E = guess.mesh.material.E[0]
print(f"E {E:.3g} Pa is a guess")
assert min(row.E[0] for row in rows) <= E <= max(row.E[1] for row in rows)

try:
    apx.assign(block, "the body is made of unobtainium", strict=True)
except apx.AutophyxError as error:
    print(f"strict: {error}")
else:
    raise AssertionError("strict took a word that nobody knows")

# What you know of it in numbers is taken as it is.
known = apx.assign(block, "unobtainium", set=("body:E=3e9,nu=0.35,rho=1200",))
assert abs(known.mesh.mass / (0.1**3 * 1200) - 1) < 1e-9  # V rho
assert abs(known.mesh.material.E[0] / 3e9 - 1) < 1e-12  # it went through a logarithm
