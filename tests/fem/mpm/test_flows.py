"""What flows, slides and tears: a dam break, a column of sand, the energy of a crack."""

import numpy as np
import pytest
from autophyx_tet.fem.mpm.boundaries import Touch, Wall, grid_around
from autophyx_tet.fem.mpm.kernels_grid import WAVE
from autophyx_tet.fem.mpm.materials import GAMMA, MaterialClass, Substance, plane_friction
from autophyx_tet.fem.mpm.particles import BAND, Particles, block_places, crack_band
from autophyx_tet.fem.mpm.solver import MpmSolver
from autophyx_tet.fem.scene.obstacles import Plane

pytestmark = pytest.mark.slow
G = 9.81


def slice_walls(dx, floor):
    """Slip walls at y = 0 and y = 2 dx and at x = 0, and a floor at z = 0."""
    slip = [((0, 0, 0), (1, 0, 0)), ((0, 0, 0), (0, 1, 0)), ((0, 2 * dx, 0), (0, -1, 0))]
    return (*[Wall(shape=Plane(*s), touch=Touch.SLIP) for s in slip], floor)


def sliced(substance, size, dx, reach, floor, **given):
    """A body ``size`` = (length, height) [m] in a slice of two cells, and its solver."""
    x = block_places((0, 0, 0), (size[0], 2 * dx, size[1]), dx)
    body = Particles.of(x, (dx / 2) ** 3, substance=substance, **given)
    room = grid_around([-dx] * 3, [reach, 3 * dx, size[1] + dx], dx, planes={0: 0, 1: 0, 2: 0})
    return MpmSolver(body, room, walls=slice_walls(dx, floor))


def test_a_dam_breaks_with_the_front_of_ritter():
    """The front runs at 2 sqrt(g h0) (Ritter 1892) once it has formed; the volume stays."""
    h0, dx = 0.2, 0.01
    water = Substance(kind=MaterialClass.FLUID, bulk=50 * 1000 * G * h0)
    floor = Wall(shape=Plane(), friction=0.0)
    solver = sliced(water, (h0, h0), dx, 1.3, floor, E=1.0, nu=0.0, rho=1000.0)
    x = solver.state.x
    pressure = 1000 * G * (h0 - x[:, 2])
    H = np.zeros((len(x), 3, 3))
    H[:, 0, 0] = (1 + pressure * GAMMA / water.bulk) ** (-1 / GAMMA) - 1
    solver.cloud.write("H", H)
    unit, fronts = np.sqrt(h0 / G), []
    for when in (2.5, 3.0):
        assert solver.advance(when * unit - solver.time)
        fronts.append((np.quantile(solver.state.x[:, 0], 0.998) - h0) / h0)
    speed = (fronts[1] - fronts[0]) / 0.5
    volume = np.linalg.det(solver.state.F).mean()
    assert 1.9 < speed < 2.05  # measured below
    assert volume == pytest.approx(1.0, abs=0.003)


def test_a_column_of_sand_runs_out():
    """As high as long, friction angle 31 degrees in plane strain: it runs out 1.0 to 1.3 lengths.

    Columns in wide channels ran out by a^0.9 times a number of order one that depends on the grains
    (Balmforth & Kerswell 2005); 1.0 to 1.3 is measured here, 1.12, with a margin of its cells. The
    cone of triaxial tests would be that of 46 degrees.
    """
    length, cells = 0.1, 20
    dx = length / cells
    sand = Substance(kind=MaterialClass.SAND, friction=plane_friction(np.deg2rad(31)))
    floor = Wall(shape=Plane(), touch=Touch.STICKY)
    solver = sliced(sand, (length, length), dx, 3.6 * length, floor, E=1e6, nu=0.3, rho=1500.0)
    assert solver.advance(3.5 * np.sqrt(length / G))
    run = (np.quantile(solver.state.x[:, 0], 0.995) - length) / length
    assert 1.0 < run < 1.3
    assert np.abs(solver.state.v).mean() < 0.03


@pytest.mark.parametrize("cells", [10, 20])
@pytest.mark.parametrize("shift", [0.0, 0.5])
def test_a_crack_spends_the_fracture_energy(cells, shift):
    """A notched bar pulled in two: work of the damage by the crack's area, at two spacings.

    It stores 0.6 of G_f before it breaks: no other crack opens. The nodes lie ``shift`` from it.
    """
    length, energy, strength, E, speed = 0.2, 4.0, 5e3, 1e6, 0.05
    dx = length / cells
    toast = Substance(tension=strength, fracture_energy=energy)
    x = block_places((0, 0, 0), (2 * dx, 2 * dx, length), dx)
    body = Particles.of(x, (dx / 2) ** 3, E=E, nu=0.0, rho=300.0, substance=toast)
    low, high = [-dx, -dx, -2 * dx], [3 * dx, 3 * dx, 1.4 * length]
    room = grid_around(low, high, dx, planes={2: shift * dx})
    pulled = Plane((0, 0, length - dx), (0, 0, -1), (0, 0, speed))
    held = [Wall(shape=s, touch=Touch.STICKY) for s in (Plane((0, 0, dx)), pulled)]
    solver = MpmSolver(body, room, walls=held, gravity_vector=(0, 0, 0))
    f = np.where(np.abs(x[:, 2] - length / 2) < dx / 2, 0.9 * strength, strength)
    band = crack_band(f, energy, E, dx)
    assert (band.spends == 1).all()
    solver.cloud.write("k", np.stack([f, band.softening, 0 * f], axis=1))
    assert solver.advance(0.06 * length / speed)
    q = solver.state.q
    spent = f**2 / E * (0.5 + 1 / band.softening) * (1 - np.exp(-band.softening * (q - 1)))
    total = (body.volume * spent)[q > 1].sum() / (2 * dx) ** 2
    assert total == pytest.approx(energy, rel=0.15)  # measured 0.88 to 0.94


def test_a_crack_that_opens_does_not_shorten_the_steps():
    """Pulled to twice its length: the torn cells carry nothing, their stretch stiffens nothing."""
    dx = 0.01
    weak = Substance(tension=500.0, fracture_energy=0.05)
    x = block_places((0, 0, 0), (2 * dx, 2 * dx, 10 * dx), dx)
    body = Particles.of(x, (dx / 2) ** 3, E=2e4, nu=0.2, rho=200.0, substance=weak)
    room = grid_around([-dx, -dx, -dx], [3 * dx, 3 * dx, 22 * dx], dx)
    pulled = Plane((0, 0, 9 * dx), (0, 0, -1), (0, 0, 1.0))
    held = [Wall(shape=s, touch=Touch.STICKY) for s in (Plane((0, 0, dx)), pulled)]
    solver = MpmSolver(body, room, walls=held, gravity_vector=(0, 0, 0))
    wave = float(body.wave_speed.max())
    assert solver.advance(10 * dx)
    stretch = np.linalg.norm(solver.cloud.read("H"), axis=(1, 2)).max()
    assert stretch > 3  # a crack is open, but the matter beside it is unloaded
    assert np.linalg.norm(solver.state.F - np.eye(3), axis=(1, 2)).max() < 0.5
    assert solver.cloud.survey()[WAVE] < 2 * wave  # sqrt(2) of a lost stretch, and compression
    assert np.abs(solver.state.v).max() < 2.0


def test_too_brittle_a_matter_keeps_its_strength():
    """Where the cells are too large, a crack spends what its band stores, f_t^2 l_c / 1.9 E."""
    band = crack_band(np.array([1e4, 1e6]), 4.0, 1e6, 0.02)
    assert band.spends[0] == 1
    assert band.spends[1] == pytest.approx(1e12 * BAND * 0.02 / (1.9 * 1e6 * 4.0), rel=1e-12)
    # 1/H_s + 1/2 = G E / (l_c f_t^2), of what is spent
    assert 1 / band.softening + 0.5 == pytest.approx(
        band.spends * 4.0 * 1e6 / (BAND * 0.02 * np.array([1e8, 1e12])), rel=1e-9
    )
