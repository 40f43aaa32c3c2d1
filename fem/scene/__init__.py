"""Scene: a body of tets with its material, what holds it, acts on it and meets it, in SI.

In: arrays of points, tets and E, nu, rho; names of the material table.
Out: TetMesh, Supports, Traction, obstacles, and the Scene of all of them.
Read: scene, supports, loads, obstacles, selection, conditions, up.
"""

from typing import Literal

UpAxis = Literal["x", "y", "z", "-x", "-y", "-z"]  # that points up
