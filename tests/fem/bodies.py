"""Bodies and solutions that the FEM tests share."""

import numpy as np
from autophyx_tet.fem.box import box_mesh
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mesh import TetMesh
from autophyx_tet.fem.supports import Supports


def shaken_box(size=(1.0, 1.0, 1.0), cells=(3, 3, 3), *, E=1.0, nu=0.3, rho=1.0, amount=0.15):
    """Box with its inner points moved at random: no symmetry left that could hide an error."""
    mesh = box_mesh(size, cells)
    inside = ((mesh.points > 1e-9) & (mesh.points < np.array(size) - 1e-9)).all(axis=1)
    rng = np.random.default_rng(0)
    h = np.array(size) / cells
    shift = rng.uniform(-amount, amount, mesh.points.shape) * h * inside[:, None]
    material = ElementMaterial.uniform(len(mesh.tets), E=E, nu=nu, rho=rho)
    return TetMesh(mesh.points + shift, mesh.tets, mesh.region, material=material)


def symmetry_planes(points) -> Supports:
    """Rollers on x = 0, y = 0 and z = 0."""
    held = Supports.none(len(points))
    for axis in range(3):
        held = held.with_fixed(np.abs(points[:, axis]) < 1e-12, axis)
    return held


def faces_at(mesh, axis, value):
    """Boundary faces on the plane x_axis = value."""
    faces = mesh.boundary.faces
    return faces[np.isclose(mesh.points[faces][:, :, axis], value).all(axis=1)]


def random_rotation(seed=0):
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))
