"""How far does an oak shelf sag under 20 kg of books?

A board of 800 x 250 x 18 mm between two walls that clamp its ends, loaded all over its top.
"""

import autophyx_tet as apx
import numpy as np
import trimesh

length, depth, thick, books = 0.8, 0.25, 0.018, 20.0  # m, m, m, kg
trimesh.creation.box((length, depth, thick)).export("shelf.stl")

board = apx.convert("shelf.stl", units="m", mesher="stuffing", edge_length=thick)
oak = apx.assign(board.mesh, "a shelf of oak")
half = length / 2 - 1e-3  # what lies beyond is in the wall
sag = apx.simulate(
    oak.mesh,
    fix=[f"plane:x<{-half}", f"plane:x>{half}"],
    load={f"plane:z>{thick / 2 - 1e-4}": (0, 0, -9.81 * books)},
    gravity=0.0,
    materials={"shelf": "oak"},  # of the table: its grain runs along the longest side
)
print(f"it sags by {sag.solved.max_displacement * 1e3:.3f} mm")

# Clamped at both ends under a load spread over its length: F L^3 / (384 E I); I = b h^3 / 12.
E = float(np.mean(oak.mesh.material.E))
textbook = 9.81 * books * length**3 / (384 * E * depth * thick**3 / 12)
print(f"textbook: {textbook * 1e3:.3f} mm")
# 10 %: wood is soft in shear across its grain, which adds about 4 E h^2 / (k G L^2) = 4 %; the rest
# is the width, which the textbook lets free and the wall does not.
assert abs(sag.solved.max_displacement / textbook - 1) < 0.10
