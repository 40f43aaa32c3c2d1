"""Problems of textbooks through ``simulate`` with its defaults: each against its exact solution."""

import autophyx_tet as apx
import numpy as np
import pytest
from autophyx_tet.fem import ElementMaterial, TetMesh, box_mesh, load_table
from autophyx_tet.fem.table import load_strengths
from autophyx_tet.toolkit.verdict.simulation import StaticSimulation


def uniform(mesh, *, E=1e9, nu=0.0, rho=1000.0):
    count = len(mesh.tets)
    values = (np.broadcast_to(x, count) for x in (E, nu, rho))
    return mesh.with_material(ElementMaterial(*values))


def solve(mesh, **stated) -> StaticSimulation:
    found = apx.simulate(mesh, **stated)
    assert isinstance(found, StaticSimulation)
    return found


def at(found, *, tol=1e-9, **place):
    """Displacements of the points at x, y, z."""
    points = found.mesh.points
    chosen = np.all([abs(points[:, "xyz".index(a)] - v) < tol for a, v in place.items()], axis=0)
    assert chosen.any()
    return found.displacement[chosen]


def reactions(found):
    return {one["place"]: one for one in found.numbers["reactions"]}


def slim(cells=(20, 2, 2), **material):
    """A beam of 1 m along x, .05 m wide and high."""
    return uniform(box_mesh((1.0, 0.05, 0.05), cells), **material)


I4, AREA = 0.05**4 / 12, 0.05**2
SHEAR = 5 / 6  # of a rectangle at nu 0 (Cowper 1966)


def test_a_beam_on_two_supports_under_a_load_in_its_middle():
    """P L^3 / 48 E I + P L / 4 k G A; the load on a strip of a quarter of a cell, cut out."""
    ends = [
        "box:0,0,0,0,0.05,0:z",
        "box:1,0,0,1,0.05,0:z",
        "box:0,0,0,0,0,0:xy",
        "box:1,0,0,1,0,0:y",
    ]
    load = {"box:0.49375,0,0.05,0.50625,0.05,0.05": (0, 0, -10.0)}
    found = solve(slim(), fix=ends, load=load, gravity=0)
    exact = 10 / (48 * 1e9 * I4) + 10 / (4 * SHEAR * 0.5e9 * AREA)
    # 2 %: the support at its lower edge dents
    assert -at(found, x=0.5)[:, 2].mean() == pytest.approx(exact, rel=0.02)
    carried = reactions(found)
    for end in ends[:2]:
        assert carried[end]["force"][2] == pytest.approx(5.0, rel=1e-6)


def test_a_beam_clamped_at_both_ends():
    """Uniform pressure w: w L^4 / 384 E I + w L^2 / 8 k G A, and w L^2 / 12 at each wall."""
    found = solve(
        slim(), fix=["plane:x<0", "plane:x>1"], pressure={"plane:z>0.05": 200.0}, gravity=0
    )
    line = 200 * 0.05
    exact = line / (384 * 1e9 * I4) + line / (8 * SHEAR * 0.5e9 * AREA)
    assert -at(found, x=0.5)[:, 2].mean() == pytest.approx(exact, rel=0.01)
    for wall, sign in (("plane:x<0", -1), ("plane:x>1", 1)):
        assert reactions(found)[wall]["torque"][1] == pytest.approx(sign * line / 12, rel=0.01)


def test_a_propped_cantilever():
    """Its prop carries 3 w L / 8 (and a hundredth of that more, for shear)."""
    found = solve(
        slim(),
        fix=["plane:x<0", "box:1,0,0,1,0.05,0:z"],
        pressure={"plane:z>0.05": 200.0},
        gravity=0,
    )
    prop = reactions(found)["box:1,0,0,1,0.05,0:z"]["force"][2]
    # Timoshenko: 3/8 (1 + 4/3 a) / (1 + a) ... of w L, a = 3 E I / (k G A L^2)
    a = 3 * 1e9 * I4 / (SHEAR * 0.5e9 * AREA)
    exact = 10 * (3 / 8 + a / 2) / (1 + a)
    assert prop == pytest.approx(exact, rel=0.005)


def test_a_bar_between_walls_loaded_within():
    """P b / L and P a / L on its walls (nu 0), from a load on a part of it."""
    mesh = slim((20, 1, 1))
    inside = (abs(mesh.centroids[:, 0] - 0.275) < 0.026).astype(int)
    mesh = TetMesh(mesh.points, mesh.tets, inside, ("bar", "collar"), mesh.material)
    found = solve(
        mesh, fix=["plane:x<0", "plane:x>1"], load={"part:collar": (100.0, 0, 0)}, gravity=0
    )
    for wall, share in (("plane:x<0", 0.725), ("plane:x>1", 0.275)):
        assert -reactions(found)[wall]["force"][0] == pytest.approx(100 * share, rel=2e-3)


def test_bars_in_series():
    """P (L1 / E1 + L2 / E2) / A of two materials, P in each, nu 0."""
    mesh = box_mesh((1.0, 0.05, 0.05), (10, 1, 1))
    E = np.where(mesh.centroids[:, 0] < 0.4, 1e9, 5e7)
    found = solve(
        uniform(mesh, E=E), fix=["plane:x<0"], load={"plane:x>1": (50.0, 0, 0)}, gravity=0
    )
    exact = 50 * (0.4 / 1e9 + 0.6 / 5e7) / AREA
    np.testing.assert_allclose(at(found, x=1.0)[:, 0], exact, rtol=1e-7)


def test_bars_side_by_side():
    """Pressed by a stiff plate: forces as E A, here 9 to 1."""
    mesh = box_mesh((0.1, 0.2, 0.3), (2, 4, 6))
    E = np.where(mesh.centroids[:, 1] < 0.1, 9e7, 1e7)
    halves = ["box:0,0,0,0.1,0.1,0", "box:0,0.1,0,0.1,0.2,0"]
    found = solve(
        uniform(mesh, E=E), fix=halves, move={"plane:z>0.3": (0, 0, -3e-4)}, gravity=0, law="linear"
    )
    total = found.numbers["reaction"][2]
    assert abs(total) < 1e-6  # the plate's force and those of the ground
    plate = -reactions(found)["plane:z>0.3"]["force"][2]
    assert plate == pytest.approx((9e7 + 1e7) * 0.01 * 1e-3, rel=1e-6)


def test_a_stopped_block_is_stiffer():
    """All sides on rollers: p / (lam + 2 mu) L, and p nu / (1 - nu) on the sides."""
    mesh = uniform(box_mesh((0.1, 0.1, 0.2), (2, 2, 4)), E=1e6, nu=0.4)
    rollers = [f"plane:{axis}{way}:{axis}" for axis in "xy" for way in ("<0", ">0.1")]
    found = solve(mesh, fix=[*rollers, "plane:z<0:z"], pressure={"plane:z>0.2": 1e3}, gravity=0)
    modulus = 1e6 * 0.6 / (1.4 * 0.2)
    np.testing.assert_allclose(-at(found, z=0.2)[:, 2], 1e3 * 0.2 / modulus, rtol=1e-7)
    side = reactions(found)["plane:x<0:x"]["force"][0]
    assert side == pytest.approx(1e3 * 0.4 / 0.6 * 0.02, rel=1e-7)


def shell(a, b, n=4, layers=3):
    """A hollow ball a < r < b: six faces of a cube, n x n each."""
    points, tets, count = [], [], 0
    for axis in range(3):
        for side in (-1, 1):
            cap = box_mesh((2, 2, 1), (n, n, layers), lo=(-1, -1, 0))
            u, v, w = cap.points.T
            way = np.empty((len(u), 3))
            way[:, axis], way[:, (axis + 1) % 3] = side, np.tan(u * np.pi / 4)
            way[:, (axis + 2) % 3] = np.tan(v * np.pi / 4)
            way /= np.linalg.norm(way, axis=1, keepdims=True)
            points.append(way * (a + (b - a) * w)[:, None])
            tets.append(cap.tets + count)
            count += len(u)
    points, tets = np.concatenate(points), np.concatenate(tets)
    _, first, same = np.unique(
        np.round(points / b, 7), axis=0, return_index=True, return_inverse=True
    )
    return TetMesh.oriented(points[first], same.reshape(-1)[tets])


def lame_ball(r, a, b, inner, outer, E, nu):
    """Radial displacement [m] of a hollow ball under pressures (Timoshenko & Goodier, art. 142)."""
    cube = b**3 - a**3
    mean, share = (inner * a**3 - outer * b**3) / cube, (inner - outer) * a**3 * b**3 / (2 * cube)
    return r / E * (1 - 2 * nu) * mean + (1 + nu) / E * share / r**2


@pytest.mark.slow
@pytest.mark.parametrize(("place", "inner"), [("all", 0.0), ("inside:all", 1e5)])
def test_a_hollow_ball_under_pressure(place, inner):
    """Lame's ball, pressed from outside or from within; 3 %: flat faces of 22 degrees."""
    a, b, E, nu = 0.08, 0.1, 1e8, 0.3
    mesh = uniform(shell(a, b), E=E, nu=nu)
    fix = ["near:0,0,-0.1,0.001", "near:0,0,0.1,0.001:xy", "near:0.1,0,0,0.001:y"]
    found = solve(mesh, fix=fix, pressure={place: 1e5}, gravity=0, law="linear")
    low, high = (found.displacement[np.isclose(mesh.points[:, 2], z)].mean(axis=0) for z in (-b, b))
    exact = lame_ball(b, a, b, inner, 1e5 - inner, E, nu)
    assert (high - low)[2] / 2 == pytest.approx(exact, rel=0.03)


@pytest.mark.slow
def test_a_round_bar_twists():
    """T L / G J with J = pi R^4 / 2, and T about the axis at the wall; 2 %: 32 flat sides."""
    R, L, T = 0.02, 0.2, 1.0
    mesh = box_mesh((2, 2, L), (8, 8, 8), lo=(-1, -1, 0))
    x, y, z = mesh.points.T
    round_points = np.stack(
        [R * x * np.sqrt(1 - y**2 / 2), R * y * np.sqrt(1 - x**2 / 2), z], axis=1
    )
    mesh = uniform(TetMesh.oriented(round_points, mesh.tets), E=1e9, nu=0.25)
    found = solve(mesh, fix=["plane:z<0"], torque={f"plane:z>{L}": (0, 0, T)}, gravity=0)
    edge = at(found, x=R, z=L)
    assert edge[:, 1].mean() / R == pytest.approx(T * L / (1e9 / 2.5 * np.pi * R**4 / 2), rel=0.02)
    (wall,) = reactions(found).values()
    np.testing.assert_allclose(wall["torque"], (0, 0, -T), atol=1e-6)


@pytest.mark.parametrize(("top", "factor"), [("pushed", 2.0457), ("moved", 4.0)])
def test_columns_of_euler(top, factor):
    """times pi^2 E I / L^2: clamped below; above it may tilt under a load, or not under a plate."""
    mesh = uniform(box_mesh((0.02, 0.02, 1.0), (1, 1, 24)), E=1e9)
    strain = np.pi**2 * 0.02**2 / 12 / 2  # half of that of the column with hinges
    if top == "pushed":
        known = {"fix": ["plane:z<0", "plane:z>1:xy"]}
        known["load"] = {"plane:z>1": (0, 0, -strain * 1e9 * 0.02**2)}
    else:
        known = {"fix": ["plane:z<0"], "move": {"plane:z>1": (0, 0, -strain)}}
    found = solve(mesh, gravity=0, law="linear", **known)
    assert found.solved.load_factor.value == pytest.approx(2 * factor, rel=0.02)


def test_a_free_beam_rings():
    """4.730^2 / (2 pi L^2) sqrt(E I / rho A) of a free beam, less what shear and turning cost."""
    mesh = slim((20, 1, 1), E=1e9, rho=1000.0)
    found = apx.simulate(mesh, scenario="modal", supports="free", modes=2)
    euler = 4.730041**2 / (2 * np.pi) * np.sqrt(1e9 * I4 / (1000 * AREA))
    # Timoshenko's first correction of a slender beam, (r / L)^2 = 2.1e-4: 1.2 % (Huang 1961)
    assert found.frequencies[0] == pytest.approx(euler * (1 - 0.012), rel=0.01)
    assert found.frequencies[1] == pytest.approx(found.frequencies[0], rel=1e-2)
    assert len(found.numbers["free"]) == 6


def test_a_rod_rings_along_itself():
    """c / 4 L with c = sqrt(E / rho): sides on rollers let it move along x alone, nu 0."""
    mesh = slim((12, 1, 1), E=1e9, rho=1000.0)
    sides = ["plane:y<0:y", "plane:y>0.05:y", "plane:z<0:z", "plane:z>0.05:z"]
    found = apx.simulate(mesh, scenario="modal", fix=["plane:x<0", *sides], modes=1)
    assert found.frequencies[0] == pytest.approx(1000 / 4, rel=1e-5)


def test_a_shelf_of_its_own_weight_hangs_sideways_too():
    """rho g L^4 / 8 E I / A of a cantilever, gravity along y as along z."""
    for way, axis in (((0, 1, 0), 1), ((0, 0, -1), 2)):
        found = solve(slim(E=1e9, rho=500.0), fix=["plane:x<0"], gravity=9.81, gravity_dir=way)
        weight = 500 * 9.81 * AREA
        exact = weight / (8 * 1e9 * I4) + weight / (2 * SHEAR * 0.5e9 * AREA)
        assert abs(at(found, x=1.0)[:, axis].mean()) == pytest.approx(exact, rel=0.01)


def test_a_sheared_cube_carries_g_gamma():
    """All points of linear tets moved as u_x = gamma z: G gamma A on the top, to round-off."""
    mesh = uniform(box_mesh((0.1, 0.1, 0.1), (2, 2, 2)), E=1e6, nu=0.3)
    levels = {f"box:0,0,{z},0.1,0.1,{z}": (0.01 * z, 0, 0) for z in (0.05, 0.1)}
    found = solve(mesh, fix=["plane:z<0"], move=levels, gravity=0, law="linear", order=1)
    top = reactions(found)["box:0,0,0.1,0.1,0.1,0.1"]["force"]
    assert top[0] == pytest.approx(1e6 / 2.6 * 0.01 * 0.01, rel=1e-6)  # the solve's own


def test_stone_is_crushed_by_its_own_weight_at_its_height():
    """rho g H / compressive strength at the foot of a pillar that may widen: the factor is one."""
    row = load_table().exact("concrete C25")
    value, limit = row.value(), load_strengths()["concrete C25"].limit(compression=True)
    height = limit / (value.rho * 9.81)
    mesh = uniform(
        box_mesh((height / 10,) * 2 + (height,), (2, 2, 10)), E=value.E, nu=0.0, rho=value.rho
    )
    found = solve(mesh, materials={"body": "concrete C25"}, law="linear")
    (safety,) = found.safety
    assert safety.factor == pytest.approx(1.0, rel=2e-3)
    assert safety.side == "compression"


@pytest.mark.slow
@pytest.mark.truth("force of a squeeze")
def test_a_squeezed_block_pushes_back_with_its_modulus():
    """E A e of a block of nu 0, which plates that rub do not widen; 2 %: e is not small."""
    mesh = uniform(box_mesh((0.1, 0.1, 0.1), (2, 2, 2)), E=1e6, nu=0.0)
    found = apx.simulate(mesh, scenario="squeeze", squeeze_share=0.02)
    forces = found.motion.obstacle_forces[-1]
    for force, sign in zip(forces[:, 0], (1, -1), strict=True):
        assert sign * force == pytest.approx(1e6 * 0.01 * 0.02, rel=0.02)


@pytest.mark.long
@pytest.mark.truth("elements of a fine mesh")
def test_a_fine_plate_keeps_its_elements_and_yields():
    """A clamped plate of 190,000 unknowns at 1.5 times its yield: quadratic, factor 2 / 3.

    w L^4 / 8 D and 3 w L^2 / t^2 at the wall, nu 0.
    """
    E, yields = load_table().exact("S235 structural steel").value().E, 2.15e8
    mesh = box_mesh((0.5, 0.2, 0.02), (120, 48, 1))
    mesh = mesh.with_material(ElementMaterial.uniform(len(mesh.tets), E=E, nu=0.0, rho=7850.0))
    load = 1.5 * yields * 0.02**2 / (3 * 0.5**2)
    known = {"gravity": 0, "materials": {"body": "S235 structural steel"}}
    found = apx.simulate(mesh, fix=("plane:x<0",), pressure={"plane:z>0.02": load}, **known)
    assert found.solved.static.order == 2
    bends = load * 0.5**4 / (8 * E * 0.02**3 / 12)
    assert found.solved.max_displacement == pytest.approx(bends, rel=0.01)
    assert found.safety[0].factor == pytest.approx(1 / 1.5, rel=0.03)
