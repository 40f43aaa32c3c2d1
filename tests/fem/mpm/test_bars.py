"""Bars and cantilevers: statics and periods against closed forms and the finite elements."""

import numpy as np
import pytest
from autophyx_tet.fem.mpm.boundaries import CLAMP_OFFSET, Touch, Wall, grid_around
from autophyx_tet.fem.mpm.solver import MpmSolver
from autophyx_tet.fem.scene.obstacles import Plane

from .bodies import block

pytestmark = pytest.mark.slow
E, RHO, L = 1e7, 1000.0, 1.0
G = 9.81


def hanging(n, **given):
    """Bar of n cells and nu = 0 that hangs from z = L."""
    dx = L / n
    body = block((0, 0, 0), (2 * dx, 2 * dx, L), dx, E=E, nu=0.0, rho=RHO)
    held = L - CLAMP_OFFSET * dx
    room = grid_around([-dx, -dx, -2 * dx], [3 * dx, 3 * dx, L], dx, planes={2: held})
    wall = Wall(shape=Plane((0, 0, held), (0, 0, -1)), touch=Touch.STICKY)
    return MpmSolver(body, room, walls=(wall,), courant=0.3, **given)


def test_a_hanging_bar_sags_by_its_weight():
    """At rest, u = -(rho g / 2E)(L^2 - z^2): by 0.5 % at 16 cells."""
    solver = hanging(16, damping=1.8 * (2 * np.pi / (4 * L / np.sqrt(E / RHO))))
    z = solver.state.x[:, 2]
    assert solver.advance(8 * 4 * L / np.sqrt(E / RHO))
    u = solver.state.x[:, 2] - z
    exact = -(RHO * G / 2 / E) * (L**2 - z**2)
    scale = (u @ exact) / (exact @ exact)
    assert scale == pytest.approx(1.0, abs=0.005)  # measured 0.22 %
    pull = solver.substep.take_impulses()
    assert pull[0, 2] > 0


def test_a_released_bar_swings_with_the_period_of_its_waves():
    """4 L / c, over two periods: 0.2 % at 16 cells; the swing is between rest and twice the sag."""
    solver = hanging(16)
    period, z = 4 * L / np.sqrt(E / RHO), solver.state.x[:, 2]
    tip = z < 1 / 32
    times, found = [], []
    while solver.time < 3 * period:
        assert solver.advance(period / 400)
        times.append(solver.time / period)
        found.append((z - solver.state.x[:, 2])[tip].mean())
    t, u = np.array(times), np.array(found) / (RHO * G * L**2 / 2 / E)
    peaks = [np.polyfit(t[near], u[near], 2) for k in range(3) for near in [abs(t - k - 0.5) < 0.1]]
    tops = [-b / (2 * a) for a, b, _ in peaks]
    assert (tops[2] - tops[0]) / 2 == pytest.approx(1.0, abs=0.002)  # measured 0.12 %


CANTILEVER = {"E": 1e6, "nu": 0.3, "rho": 1000.0}
SIDE = 0.25
CELLS = (16, 4, 4)


def finite_elements(gravity):
    """Tip deflection [m] of the cantilever by quadratic elements."""
    from autophyx_tet.fem.material import ElementMaterial
    from autophyx_tet.fem.mesh import box_mesh
    from autophyx_tet.fem.scene.supports import Supports
    from autophyx_tet.fem.solve.nonlinear import solve_nonlinear

    mesh = box_mesh((L, SIDE, SIDE), CELLS)
    mesh = mesh.with_material(ElementMaterial.uniform(len(mesh.tets), **CANTILEVER))
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] < 1e-9)
    answer = solve_nonlinear(mesh, held, gravity_vector=(0, 0, -gravity), order=2)
    return answer.displacement[mesh.points[:, 0] > L - 1e-9, 2].mean()


def bent(gravity, *, lagrangian, cells=4, along=2, swing=False):
    """Tip deflection [m] at rest of the cantilever, or its history over a swing."""
    dx = SIDE / cells
    body = block((0, 0, 0), (L, SIDE, SIDE), dx, along=along, **CANTILEVER)
    held = CLAMP_OFFSET * dx
    low, high = [-dx, -dx, -0.4], [L + dx, SIDE + dx, SIDE + dx]
    room = grid_around(low, high, dx, planes={0: held})
    wall = Wall(shape=Plane((held, 0, 0), (1, 0, 0)), touch=Touch.STICKY)
    first = 2 * np.pi * L**2 / 1.8751**2 * np.sqrt(RHO * SIDE**2 * 12 / (1e6 * SIDE**4))
    solver = MpmSolver(
        body, room, walls=(wall,), lagrangian=lagrangian, gravity_vector=(0, 0, -gravity),
        damping=0.0 if swing else 4 * np.pi / first,
    )  # fmt: skip
    x = solver.state.x
    near = x[:, 0] > L - 2 * dx

    def tip():
        u = solver.state.x - x
        return float(np.polyval(np.polyfit(x[near, 0], u[near, 2], 1), L))

    if not swing:
        assert solver.advance(1.6 * first)
        return tip()
    history = []
    for _ in range(110):
        assert solver.advance(first / 80)
        history.append(tip())
    return np.array(history)


@pytest.mark.parametrize(
    ("gravity", "lagrangian", "along", "within"),
    # Measured 1.2, 1.2, 5.95 and 2.8 %: what crosses cells is integrated less well, the less so the
    # more particles are in one.
    [
        (0.4905, True, 2, 0.02),
        (9.81, True, 2, 0.02),
        (9.81, False, 2, 0.06),
        (9.81, False, 3, 0.03),
    ],
)
def test_a_cantilever_bends_as_the_finite_elements_say(gravity, lagrangian, along, within):
    """Four cells thick, small and large deflection, against quadratic tets."""
    wanted = finite_elements(gravity)
    found = bent(gravity, lagrangian=lagrangian, along=along)
    assert found == pytest.approx(wanted, rel=within)


def test_weights_at_rest_forget_nothing():
    """A free swing comes back to where it began: by 1 % of its depth."""
    history = bent(9.81, lagrangian=True, swing=True)
    deepest = int(np.argmin(history))
    back = history[deepest:].max()
    # Measured 0.3 %.
    assert abs(back) < 0.01 * abs(history[deepest])
