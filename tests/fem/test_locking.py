"""Poisson's ratio near one half: averaged pressures against P2 and against plain P1."""

import numpy as np
import pytest
from autophyx_tet.fem.discrete.space import make_space
from autophyx_tet.fem.scene.box import box_mesh
from autophyx_tet.fem.scene.loads import Traction
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.nodal_pressure import solve_averaged
from autophyx_tet.fem.solve.statics import solve_static

from .bodies import faces_at, shaken_box, with_uniform


def _against_p2(nu):
    """Tip of a sheared beam over that of P2: plain P1, and P1 with averaged pressures."""
    mesh = with_uniform(box_mesh((1, 0.4, 0.4), (10, 4, 4)), E=1e6, nu=nu)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0)
    load = Traction(faces_at(mesh, 0, 1), np.array([0, 0, -1e2]))
    tip = np.isclose(mesh.points[:, 0], 1)
    results = (
        solve_static(mesh, held, traction=load, order=1),
        solve_averaged(mesh, held, traction=load),
        solve_static(mesh, held, traction=load, order=2),
    )
    plain, averaged, fine = (r.displacement[tip, 2].mean() for r in results)
    return plain / fine, averaged / fine


@pytest.mark.slow
def test_sweep_of_nu():
    """From nu = .3 to .4999 averaged P1 keeps its distance from P2 within 12 %; plain P1 locks."""
    plain, averaged = np.transpose([_against_p2(nu) for nu in (0.3, 0.4, 0.49, 0.499, 0.4999)])
    assert averaged == pytest.approx(np.full(5, averaged[0]), rel=0.12)
    assert plain[-1] < 0.7 * plain[0]
    assert (np.diff(plain) < 0).all()


def test_patch_of_averaged_pressures():
    """u = A x on the boundary: averaging changes nothing, stress is Hooke's."""
    mesh = shaken_box(nu=0.49)
    A = np.random.default_rng(1).normal(size=(3, 3))
    x = make_space(mesh, 1).nodes
    edge = ((x < 1e-9) | (x > 1 - 1e-9)).any(axis=1)
    held = Supports.clamp(len(x), edge, (x @ A.T)[edge])
    result = solve_averaged(mesh, held)
    assert np.abs(result.displacement - x @ A.T).max() < 1e-11
    plain = solve_static(mesh, held, order=1)
    assert result.stress == pytest.approx(plain.stress, abs=1e-8 * np.abs(plain.stress).max())
    assert result.energy == pytest.approx(plain.energy, rel=1e-9)


def test_locking_share():
    """The result says how much of the volume has nu > 0.45 under P1."""
    mesh = shaken_box()
    nu = np.where(mesh.centroids[:, 2] > 0.5, 0.48, 0.3)
    body = mesh.with_material(type(mesh.material)(mesh.material.E, nu, mesh.material.rho))
    held = Supports.clamp(len(mesh.points), mesh.points[:, 2] == 0)
    share = mesh.volumes[nu > 0.45].sum() / mesh.volume
    assert solve_static(body, held, order=1).locking_share == pytest.approx(share)
    assert solve_static(body, held, order=2).locking_share == 0
