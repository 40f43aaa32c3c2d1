"""Scenarios and verdicts."""

from dataclasses import replace

import numpy as np
import pytest
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.laws.law import Law
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.fem.scenarios import drop, hang, poke, sag, squeeze, wind
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.modal import natural_modes
from autophyx_tet.fem.solve.nonlinear import solve_nonlinear
from autophyx_tet.toolkit.verdict import checks

from .bodies import shaken_box, with_uniform


def column(E=1e6, nu=0.0, cells=1):
    return shaken_box((0.1, 0.1, 1.0), (cells, cells, 8 * cells), E=E, nu=nu, rho=1000, amount=0)


def test_hang():
    """A hanging bar lengthens as a standing one shortens: rho g l^2 / 2 E."""
    result = hang(column(), order=2)
    assert result.displacement[:, 2].min() == pytest.approx(-1000 * 9.81 / 2e6, rel=1e-6)
    assert (result.static.reaction[:, 2].sum()) == pytest.approx(1000 * 0.01 * 9.81, rel=1e-6)


def test_wind():
    """The reaction at the foot is drag: rho v^2 / 2 C A."""
    result = wind(column(E=1e8), speed=20.0, drag=1.2, direction=(1, 0, 0))
    force = 0.5 * 1.225 * 20**2 * 1.2 * 0.1
    assert result.static.reaction.sum(axis=0) == pytest.approx([-force, 0, 0], abs=1e-6 * force)
    assert result.displacement[:, 0].max() > 0


def test_poke():
    """The foot carries the finger's force, wherever it presses."""
    result = poke(column(), force=3.0, at=(0.1, 0.05, 0.9), direction=(-2, 0, 0), law=Law.LINEAR)
    assert result.static.reaction.sum(axis=0) == pytest.approx([3.0, 0, 0], abs=1e-6)
    assert poke(column(), force=3.0).displacement[:, 2].min() < 0


@pytest.mark.slow
def test_drop():
    """A dropped cube falls, lands, and is never below the ground."""
    mesh = shaken_box((0.1,) * 3, (1, 1, 1), E=1e6, nu=0.4, rho=1000)
    result = drop(mesh, height=0.05, frames=20)
    assert result.smallest_gap > 0
    assert result.displacements.shape == (21, len(mesh.points), 3)
    assert result.displacements[-1, :, 2].mean() == pytest.approx(-0.05, abs=0.02)
    assert result.contact_forces[:, 2].max() > mesh.mass * 9.81


@pytest.mark.slow
def test_drop_follows_up():
    mesh = shaken_box((0.1,) * 3, (1, 1, 1), E=1e6, nu=0.4, rho=1000)
    for axis, up in enumerate("xy"):
        moved = drop(mesh, up=up, height=0.05, frames=20).displacements[-1]
        assert moved[:, axis].mean() < -0.03, up
        assert np.abs(np.delete(moved, axis, axis=1)).max() < 0.02, up


@pytest.mark.blockers
@pytest.mark.slow
@pytest.mark.parametrize("share", [0.002, 0.02, 0.1])
def test_squeeze_presses_as_the_squeeze_asked_for_does(share):
    """Frictionless plates give the uniaxial force at the share asked for, and never more before.

    The reference holds the faces of the same body where plates would: a cube, and a plate a tenth
    as thick, which the reach of a barrier made for its diagonal would swallow.
    """
    for size in ((0.1,) * 3, (0.1, 0.1, 0.01)):
        body = shaken_box(size, (2, 2, 2), E=1e7, nu=0.3, rho=1000, amount=0)
        answer = squeeze(body, axis="z", share=share, friction=0.0, frames=10)
        x, z = body.points, body.points[:, 2]
        rollers = Supports.none(len(x))
        for axis in range(3):
            rollers = rollers.with_fixed(x[:, axis] == 0, axis)
        moved = rollers.with_fixed(z == z.max(), 2, -share * z.max())
        exact = solve_nonlinear(body, moved)
        force = np.abs(exact.reaction[exact.space.nodes[:, 2] == 0, 2].sum())
        pressed = np.linalg.norm(answer.obstacle_forces, axis=2)
        # 0.7 %: the squeeze is right to 0.5 %, and the force to the tolerance of a step.
        assert pressed[-1] == pytest.approx(force, rel=7e-3)
        assert (np.diff(pressed, axis=0) > 0).all()  # from nothing, evenly: the last is the largest
        assert pressed[0].max() < 1e-6 * force
        assert answer.smallest_gap > 0
        assert pressed[:, 0] == pytest.approx(pressed[:, 1], rel=1e-3)  # in balance


@pytest.mark.slow
@pytest.mark.parametrize("E", [1e5, 1e10])
def test_squeeze_with_friction_converges_for_soft_and_stiff(E):
    """The plates hold the faces that they touch: pressed a tenth, it bulges between them."""
    body = shaken_box((0.1,) * 3, (4, 4, 4), E=E, nu=0.35, rho=700, amount=0)
    moved = body.points + squeeze(body, share=0.1, friction=0.5).displacements[-1]
    width = np.ptp(moved[:, 0])
    assert width == pytest.approx(0.09, rel=6e-4)  # a squeeze right to 0.5 %: of a tenth
    middle = np.abs(body.points[:, 0] - 0.05) < 1e-9
    assert np.ptp(moved[middle, 1]) > np.ptp(moved[body.points[:, 0] < 1e-9, 1])


def test_verdicts():
    """Stiff columns hold their shape, soft ones do not; sentences carry the numbers."""
    stiff, soft = (sag(column(E=E), law=Law.LINEAR) for E in (1e9, 5e4))
    assert checks.holds_shape(stiff).outcome == "passed"
    assert checks.holds_shape(soft).outcome == "failed"
    assert checks.percent(soft.sag_ratio) in checks.holds_shape(soft).sentence
    assert checks.distinguishable(stiff, soft).outcome == "passed"
    assert checks.distinguishable(stiff, stiff).outcome == "failed"
    assert {c.name for c in checks.static_checks(stiff)} == {
        "holds shape", "buckling", "discretisation", "locking", "explicit step", "size", "mass",
    }  # fmt: skip


def test_explicit_step():
    """h / c of a regular corner tet: its smallest height over sqrt((lam + 2 mu) / rho)."""
    mesh = with_uniform(box_mesh((1, 1, 1), (1, 1, 1)), E=1e6, nu=0.0, rho=1e3)
    height = 1 / np.sqrt(2)  # Kuhn's tet of the unit cube: volume 1/6, largest face sqrt(2)/2
    assert checks.largest_explicit_step(mesh) == pytest.approx(height / np.sqrt(1e3), rel=1e-12)


def test_frequency_verdict():
    modes = natural_modes(column(E=1e9), 2)
    assert checks.first_frequency(modes).outcome == "passed"


def test_bad_options_are_named():
    with pytest.raises(InputError, match="direction"):
        wind(column(), direction=(0, 0, 0))
    with pytest.raises(InputError, match="height"):
        drop(column(), height=-1.0)
    with pytest.raises(InputError, match="share"):
        squeeze(column(), share=2.0)


@pytest.mark.parametrize("order", [1, 2])
def test_the_mesh_is_judged_by_more_than_it_costs(order):
    """One cell across: the verdict's number bounds what quadratic tets on two cells make of it.

    Of linear tets it leaves out what the quadratic ones beside them miss: 2 %.
    """
    coarse = wind(column(E=1e8), order=order, law=Law.LINEAR)
    fine = wind(column(E=1e8, cells=2), order=2, law=Law.LINEAR)
    check = checks.discretisation(coarse)
    error = abs(coarse.max_displacement / fine.max_displacement - 1)
    assert error <= check.value + 0.02 * (order == 1)
    assert (check.outcome == "passed") == (check.value <= 0.1)
    assert f"within about {check.value:.0%}" in check.sentence


def test_what_is_beyond_the_limit_does_not_read_as_the_limit():
    """10.4 % is beyond 10 %, and the sentence says so, with the edges that the mesh has."""
    one = wind(column(E=1e8), order=2, law=Law.LINEAR)
    for value, shown in ((0.0999, "10%"), (0.1001, "10.1%"), (0.104, "10.4%"), (0.2, "20%")):
        error = one.discretisation_error._replace(value=value, kind="P1/P2")
        check = checks.discretisation(replace(one, discretisation_error=error))
        assert f"within about {shown} (" in check.sentence
    assert "coarse, its edges 0." in check.sentence
