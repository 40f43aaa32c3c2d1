"""Bodies and solutions that the FEM tests share."""

import numpy as np
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.fem.scene.supports import Supports


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


def mapped(mesh, position) -> TetMesh:
    """The same tets with points moved to ``position(points)``."""
    return TetMesh.oriented(position(mesh.points), mesh.tets)


def merged(*meshes) -> TetMesh:
    """One mesh of several; points at one place become one."""
    starts = np.cumsum([0, *[len(m.points) for m in meshes]])
    points = np.concatenate([m.points for m in meshes])
    tets = np.concatenate([m.tets + s for m, s in zip(meshes, starts, strict=False)])
    _, first, index = np.unique(np.round(points, 9), axis=0, return_index=True, return_inverse=True)
    return TetMesh.oriented(points[first], index.reshape(-1)[tets])


def quarter_tube(a, b, height, cells) -> TetMesh:
    """Quarter of a tube around z, a <= r <= b; ``cells`` in r, angle, z."""
    box = box_mesh((b - a, np.pi / 2, height), cells, lo=(a, 0.0, 0.0))
    turn = lambda x: np.stack(  # noqa: E731
        [x[:, 0] * np.cos(x[:, 1]), x[:, 0] * np.sin(x[:, 1]), x[:, 2]], axis=1
    )
    mesh = mapped(box, turn)
    points = np.where(np.abs(mesh.points) < 1e-12, 0.0, mesh.points)
    return TetMesh(points, mesh.tets, mesh.region)


def octant_ball(radius, cells) -> TetMesh:
    """Octant of a ball: the cube [0, 1]^3 with max-norm spheres moved to round ones."""

    def round_off(x):
        norm = np.linalg.norm(x, axis=1)
        return radius * x * (x.max(axis=1) / np.where(norm > 0, norm, 1.0))[:, None]

    return mapped(box_mesh((1, 1, 1), (cells,) * 3), round_off)


def ball(radius, cells, *, E, nu, rho) -> TetMesh:
    """Ball whose lowest point is at z = 0: a cube's max-norm spheres moved to round ones.

    With an odd number of ``cells`` it stands on a facet.
    """
    box = box_mesh((2, 2, 2), (cells,) * 3, lo=(-1, -1, -1))
    norm = np.linalg.norm(box.points, axis=1, keepdims=True)
    largest = np.abs(box.points).max(axis=1, keepdims=True)
    x = radius * box.points * largest / np.where(norm > 0, norm, 1.0)
    mesh = TetMesh.oriented(x - [0, 0, x[:, 2].min()], box.tets)
    return with_uniform(mesh, E=E, nu=nu, rho=rho)


def lifted(mesh, height) -> TetMesh:
    """The same body ``height`` above where it was."""
    up = mesh.points + np.array([0, 0, height])
    return TetMesh(up, mesh.tets, mesh.region, material=mesh.material)


def outer_faces(mesh, radius, axes=(0, 1, 2)):
    """Boundary faces whose corners lie at ``radius`` from the origin, measured in ``axes``."""
    faces = mesh.boundary.faces
    r = np.linalg.norm(mesh.points[:, list(axes)], axis=1)
    return faces[np.isclose(r[faces], radius, rtol=1e-6).all(axis=1)]


def with_uniform(mesh, *, E, nu, rho=1.0) -> TetMesh:
    return mesh.with_material(ElementMaterial.uniform(len(mesh.tets), E=E, nu=nu, rho=rho))


def hammer(cell=0.01) -> TetMesh:
    """A hammer along x: a handle of 0.3 x 0.02 x 0.02 m of wood, a head of 0.04 x 0.02 x 0.1 m.

    The parts are "handle" and "head"; the head is steel.
    """
    size = (0.34, 0.02, 0.1)
    box = box_mesh(size, [round(side / cell) for side in size])
    x, _, z = box.centroids.T
    head = x > 0.3
    tets = box.tets[head | (np.abs(z - 0.05) < 0.01)]
    used, index = np.unique(tets, return_inverse=True)
    region = (box.points[tets].mean(axis=1)[:, 0] > 0.3).astype(int)
    names = ("handle", "head")
    mesh = TetMesh(box.points[used], index.reshape(tets.shape), region, names)
    E, nu, rho = np.array([[1.1e10, 0.35, 700.0], [2e11, 0.29, 7850.0]])[region].T
    return mesh.with_material(ElementMaterial(E, nu, rho))
