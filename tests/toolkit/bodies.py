"""Bodies that several tests of surfaces are made of."""

import numpy as np
import trimesh
from autophyx_tet.predictors.asset import Part


def part_of(points, faces, name="p"):
    return Part(name, trimesh.Trimesh(points, faces, process=False))


def cube_part(name="p", lo=(0, 0, 0), size=1.0):
    box = trimesh.creation.box((size,) * 3)
    return part_of(box.vertices + size / 2 + np.array(lo), box.faces, name)
