"""Many bodies by one basis: every member is what the full body would be."""

import numpy as np
import pytest
from autophyx_tet.fem.material import ElementMaterial, isotropic_tensor, orthotropic_constants
from autophyx_tet.fem.mesh import material_of
from autophyx_tet.fem.reduced.sweep import AT_ONCE, LinearFamily, Member
from autophyx_tet.fem.solve.modal import natural_modes
from autophyx_tet.fem.solve.statics import solve_static

from .bodies import clamped, two_part_bar

MESH = two_part_bar((6, 2, 2))
GRAVITY = np.array([0.0, 2.0, -9.81])
LOW = Member(np.array([0.5, 0.2]), np.array([0.1, 0.3]), np.array([0.9, 0.7]))
HIGH = Member(np.array([2.0, 3.0]), np.array([0.4, 0.45]), np.array([1.2, 1.5]))


def family(mesh, *, grained):
    """Of the two halves of a clamped bar, pulled at its tip, between ``LOW`` and ``HIGH``."""
    forces = np.zeros_like(mesh.points)
    forces[mesh.points[:, 0] > mesh.points[:, 0].max() - 1e-9] = [0.01, 0.02, 0.0]
    held = clamped(mesh)
    modes = natural_modes(mesh, 3, supports=held, order=1, lumped=True)
    groups = np.stack([mesh.region == k for k in range(2)])
    found = LinearFamily(
        mesh, held, groups, grained=grained, forces=forces, gravity_vector=GRAVITY,
        shapes=modes.shapes,
    )  # fmt: skip
    as_is = Member(np.ones(2), np.full(2, 0.3), np.ones(2))
    found.add([as_is, LOW, HIGH])
    return found


def between(share):
    """Member between the ends, each number at another place."""
    return Member(*(a + (b - a) * share for a, b in zip(LOW, HIGH, strict=True)))


@pytest.mark.parametrize("grain", [False, True])
@pytest.mark.slow
def test_members_are_the_full_body_s(grain):
    """Those that the basis learned, to what it leaves out; others to 1 % at rest and in f1.

    With a grain the tip has a tensor whose size alone varies.
    """
    mesh = MESH
    if grain:
        material = material_of(mesh)
        tensor = isotropic_tensor(*material.lame)
        tensor[:, 2, 2] *= np.where(mesh.region == 1, 1.5, 1.0)
        tip, along = np.flatnonzero(mesh.region == 1), np.eye(3)
        constants = orthotropic_constants(tensor[tip], along)
        mesh = mesh.with_material(material.with_grain(tip, constants, along))
    found = family(mesh, grained=np.array([False, grain]))
    for member, tolerance in ((LOW, 1e-3), (HIGH, 1e-3), (between(np.array([0.3, 0.8])), 1e-2)):
        body = mesh.with_material(found.material(member))
        u, tones = found.answers(member)
        known = {"gravity_vector": GRAVITY, "forces": found.forces, "order": 1}
        full = solve_static(body, clamped(mesh), **known).displacement
        assert np.linalg.norm(u - full) < tolerance * np.linalg.norm(full)
        modes = natural_modes(body, 1, supports=clamped(mesh), order=1, lumped=True)
        assert tones[0] == pytest.approx(modes.frequencies[0], rel=1e-2)


def test_the_largest_of_many_are_those_of_each():
    """As many as are made at once and one more: displacement and frequencies to round-off."""
    found = family(MESH, grained=np.zeros(2, dtype=bool))
    members = [between(np.full(2, share)) for share in np.linspace(0, 1, AT_ONCE + 1)]
    sizes, tones = found.largest(members)
    for member, size, frequencies in zip(members, sizes, tones, strict=True):
        u, wanted = found.answers(member)
        assert size == pytest.approx(np.linalg.norm(u, axis=1).max(), rel=1e-12)
        assert frequencies == pytest.approx(wanted, rel=1e-12)


def test_its_material_is_the_one_asked_for():
    """E and rho times the factors, nu as it is, in each half."""
    found = family(MESH, grained=np.zeros(2, dtype=bool)).material(HIGH)
    assert isinstance(found, ElementMaterial)
    known = material_of(MESH)
    assert found.E == pytest.approx(known.E * HIGH.E[MESH.region], rel=1e-12)
    assert found.nu == pytest.approx(HIGH.nu[MESH.region], rel=1e-12)
    assert found.rho == pytest.approx(known.rho * HIGH.rho[MESH.region], rel=1e-12)
