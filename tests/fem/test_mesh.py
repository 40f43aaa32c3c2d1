"""TetMesh: volumes, orientation, boundary, validation."""

import numpy as np
import pytest
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.material import ElementMaterial, lame_parameters
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from hypothesis import given
from hypothesis import strategies as st

sizes = st.tuples(*[st.floats(1e-3, 1e3)] * 3)
cells = st.tuples(*[st.integers(1, 3)] * 3)


@given(sizes, cells)
def test_box_volume_is_exact(size, n):
    """Sum of tet volumes = a b c for every split of the box."""
    mesh = box_mesh(size, n)
    assert mesh.volume == pytest.approx(np.prod(size), rel=1e-12)  # round-off only
    assert (mesh.volumes > 0).all()


@given(sizes, cells, st.integers(0, 2**31))
def test_orientation_is_restored(size, n, seed):
    """Any winding of the input gives the same volume, every tet positive."""
    mesh = box_mesh(size, n)
    rng = np.random.default_rng(seed)
    tets = np.array([rng.permutation(t) for t in mesh.tets])
    again = TetMesh.oriented(mesh.points, tets)
    assert again.volume == pytest.approx(mesh.volume, rel=1e-12)


@given(sizes, cells)
def test_boundary_is_closed_and_outward(size, n):
    """Divergence theorem: 1/3 of the flux of x through the boundary is the volume."""
    mesh = box_mesh(size, n)
    a, b, c = (mesh.points[mesh.boundary.faces[:, i]] for i in range(3))
    flux = np.einsum("fi,fi->f", np.cross(b - a, c - a) / 2, (a + b + c) / 3).sum() / 3
    assert flux == pytest.approx(mesh.volume, rel=1e-9)
    nx, ny, nz = n
    assert len(mesh.boundary.faces) == 4 * (nx * ny + ny * nz + nx * nz)


def test_mass_is_sum_of_rho_v():
    mesh = box_mesh((0.1, 0.2, 0.3), (2, 2, 2))
    mesh = mesh.with_material(ElementMaterial.uniform(len(mesh.tets), E=1e6, nu=0.3, rho=1000))
    assert mesh.mass == pytest.approx(6.0, rel=1e-12)


def test_invalid_mesh_is_refused_with_a_reason():
    mesh = box_mesh((1, 1, 1), (1, 1, 1))
    p, t = mesh.points, mesh.tets
    for points, tets, reason in (
        (p[:, :2], t, "points 3|shape"),
        (np.where(p == 0, np.nan, p), t, "finite"),
        (p, t + 100, "points"),
        (p, t[:, [0, 2, 1, 3]], "inverted"),
        (p, t[:0], "at least one"),
    ):
        with pytest.raises((InputError, TypeError), match=reason):
            TetMesh(points, tets, mesh.region[: len(tets)])


@given(st.floats(1e3, 1e12), st.floats(0, 0.49))
def test_lame_parameters_invert(E, nu):
    """E = mu (3 lam + 2 mu) / (lam + mu), nu = lam / (2 (lam + mu))."""
    lam, mu = lame_parameters(E, nu)
    assert mu * (3 * lam + 2 * mu) / (lam + mu) == pytest.approx(E, rel=1e-9)
    assert lam / (2 * (lam + mu)) == pytest.approx(nu, rel=1e-9, abs=1e-12)


def test_material_out_of_range_is_refused():
    for name, E, nu, rho in (
        ("E", 0, 0.3, 1), ("nu", 1, 0.5, 1), ("nu", 1, -0.1, 1), ("rho", 1, 0.3, np.inf),
    ):  # fmt: skip
        with pytest.raises(InputError, match=f"{name} = .* at tet 0"):
            ElementMaterial.uniform(3, E=E, nu=nu, rho=rho)


def test_a_material_cannot_change_behind_its_moduli():
    """Its arrays are copies that refuse to be written to, so that lam and mu are of E and nu."""
    E = np.full(3, 1e6)
    material = ElementMaterial(E, np.full(3, 0.3), np.full(3, 1e3))
    lam = material.lame.lam.copy()
    E[:] = 1.0
    np.testing.assert_array_equal(material.E, 1e6)
    np.testing.assert_array_equal(material.lame.lam, lam)
    with pytest.raises(ValueError, match="read-only"):
        material.E[0] = 2.0
