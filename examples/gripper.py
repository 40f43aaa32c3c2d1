"""With what force does a gripper squeeze a pad?

Two plates close on a cube of rubber by a tenth of its width; they rub, so that its sides bulge.
"""

import numpy as np
from autophyx_tet.fem import ElementMaterial, box_mesh, squeeze

side, E, nu, share = 0.02, 1e6, 0.4, 0.1  # m, Pa, 1, 1
pad = box_mesh((side, side, side), (3, 3, 3))
pad = pad.with_material(ElementMaterial.uniform(len(pad.tets), E=E, nu=nu, rho=1100.0))

motion = squeeze(pad, axis="x", share=share)
forces = motion.obstacle_forces[-1]  # N, a row a plate
force = np.abs(forces[:, 0]).mean()
print(f"{force:.2f} N at {share:.0%}")

# Between two exact answers of a small strain, on a side of 4 cm^2: plates without friction let the
# sides go, E A e; a sleeve around it stops them, (lam + 2 mu) A e. Within 10 %, for e is not small.
free = E * side**2 * share
stopped = free * (1 - nu) / ((1 + nu) * (1 - 2 * nu))
print(f"free {free:.2f} N, stopped {stopped:.2f} N")
assert 0.9 * free < force < 1.1 * stopped
assert abs(forces[:, 0].sum()) < 0.01 * force  # action and reaction
