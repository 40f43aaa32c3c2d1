"""Boundary conditions in words: what they select, what forces they make, what they refuse."""

import numpy as np
import pytest
from autophyx_tet.fem import BoundaryConditions, ElementMaterial, Scene, TetMesh, box_mesh
from autophyx_tet.fem.errors import InputError, UsageError
from autophyx_tet.fem.scene.conditions import read_conditions
from autophyx_tet.fem.scene.loads import resultant, spread_torque
from autophyx_tet.fem.scene.selection import select
from autophyx_tet.fem.solve.equilibrium import StaticMethod

from .bodies import hammer


def solved(mesh, **conditions):
    return StaticMethod().solve(BoundaryConditions(**conditions).applied(Scene(mesh=mesh)), order=2)


def slim_beam(cells=(24, 2, 2)):
    mesh = box_mesh((1.0, 0.05, 0.05), cells)
    return mesh.with_material(ElementMaterial.uniform(len(mesh.tets), E=1e9, nu=0.3, rho=1000.0))


def test_a_cantilever_in_words_is_beam_theory():
    """Tip load: P L^3 / 3 E I + P L / k G A, k = 10 (1 + nu) / (12 + 11 nu) (Cowper 1966); 1 %."""
    mesh = slim_beam()
    result = solved(mesh, fix=("plane:x<0",), load=("plane:x>1=0,0,-10",))
    inertia, shear, k = 0.05**4 / 12, 1e9 / 2.6, 13 / (12 + 3.3)
    exact = 10 / (3 * 1e9 * inertia) + 10 / (k * shear * 0.05**2)
    tip = result.displacement[mesh.points[:, 0] == 1, 2].mean()
    assert tip == pytest.approx(-exact, rel=0.01)
    np.testing.assert_allclose(result.static.reaction.sum(axis=0), [0, 0, 10], atol=1e-6)


def test_a_torque_in_words_twists():
    """A square bar, between its quarters: T L / (0.1406 a^4 G) (Timoshenko & Goodier).

    1 %: four quadratic cells across the section cannot quite warp as it does.
    """
    mesh = slim_beam((16, 4, 4))
    u = solved(mesh, fix=("plane:x<0",), torque=("plane:x>1=0.5,0,0",)).displacement
    x, y, z = mesh.points.T
    side = (z == 0.05) & (y == 0.025)
    start, end = (-u[side & np.isclose(x, at), 1].mean() / 0.025 for at in (0.25, 0.75))
    assert end - start == pytest.approx(0.5 * 0.5 / (0.1406 * 0.05**4 * 1e9 / 2.6), rel=0.01)


def test_a_pressure_and_a_roller_press_a_bar():
    """Uniaxial stress p: u = p L / E, and nothing across with rollers on one side only."""
    mesh = slim_beam()
    rollers = ("plane:x<0:x", "plane:y<0:y", "plane:z<0:z")
    u = solved(mesh, fix=rollers, pressure=("plane:x>1=1e5",)).displacement
    end = mesh.points[:, 0] == 1
    np.testing.assert_allclose(u[end, 0], -1e5 / 1e9, rtol=1e-6)


def test_a_move_prescribes_and_leaves_the_others_free():
    """A bar stretched by 1 mm without being told across: sides contract by nu times the strain."""
    mesh = slim_beam()
    fix = ("plane:x<0:x", "plane:y<0:y", "plane:z<0:z")
    u = solved(mesh, fix=fix, move=("plane:x>1:x=0.001,0,0",)).displacement
    np.testing.assert_allclose(u[mesh.points[:, 0] == 1, 0], 1e-3, rtol=1e-12)
    side = mesh.points[:, 1] == 0.05
    np.testing.assert_allclose(u[side, 1], -0.3 * 1e-3 * 0.05, rtol=1e-4)


def test_gravity_pulls_where_it_is_told():
    """Size kept, direction taken, of any length."""
    scene = Scene(mesh=hammer(), gravity_vector=(0.0, 0.0, -9.81))
    turned = BoundaryConditions(gravity_dir=(2.0, 0.0, 0.0)).applied(scene)
    np.testing.assert_allclose(turned.gravity_vector, [9.81, 0, 0])


def test_selections_are_what_they_say():
    """Against masks of the coordinates; a plane at the surface means that surface."""
    mesh = hammer()
    x, y, z = mesh.points.T
    found = {
        "part:handle": np.isin(np.arange(len(x)), mesh.tets[mesh.region == 0]),
        "part:HEAD": np.isin(np.arange(len(x)), mesh.tets[mesh.region == 1]),
        "plane:x<0": x <= 1e-9,
        "plane:z>=0.1": z >= 0.1 - 1e-9,
        "box:0.3,0,0,0.34,0.02,0.02": (x > 0.3 - 1e-9) & (z < 0.02 + 1e-9),
        "near:0,0.01,0.05,0.015": np.linalg.norm([x, y - 0.01, z - 0.05], axis=0) <= 0.015,
        "all": np.ones(len(x), dtype=bool),
    }
    for words, mask in found.items():
        np.testing.assert_array_equal(select(mesh, words).points, np.flatnonzero(mask), words)
    assert select(mesh, "plane:x<0:xz").axes == (0, 2)
    assert select(mesh, "part:head:y").axes == (1,)
    odd = TetMesh(mesh.points, mesh.tets, mesh.region, ("lid:x", "head"))
    assert select(odd, "part:lid:x").axes == (0, 1, 2)  # the part's own name comes first


def test_places_take_units_and_several_parts():
    """The same points in metres and in millimetres; parts by a pattern or one after the other."""
    mesh = box_mesh((0.2, 0.1, 0.1), (4, 2, 2))
    for plain, said in (
        ("plane:x>0.15", "plane:x>150mm"),
        ("box:0,0,0,0.05,0.1,0.1", "box:0,0,0,5cm,10 cm,0.1m"),
        ("near:0.2,0,0,0.06", "near:200mm,0,0,6cm"),
    ):
        found = [select(mesh, words).points for words in (plain, said)]
        assert len(found[0])
        assert np.array_equal(*found)
    quarter = (mesh.points[mesh.tets].mean(axis=1)[:, 0] // 0.05).astype(np.int32)
    legs = TetMesh(mesh.points, mesh.tets, quarter, ("leg_1", "leg_2", "seat", "Leg_3"))
    each = [select(legs, f"part:{name}").points for name in ("leg_1", "leg_2", "leg_3")]
    three = np.unique(np.concatenate(each))
    assert np.array_equal(select(legs, "part:leg*").points, three)
    assert np.array_equal(select(legs, "part:leg_1, leg_2,leg_3").points, three)
    for words in ("part:arm*", "part:leg_1,arm", "plane:x>150miles", "plane:x>mm"):
        with pytest.raises(UsageError):
            select(mesh if words.startswith("plane") else legs, words)


def test_loads_add_up_on_any_surface():
    """Force, torque and no net force of a torque, to round-off, on a curved selection of faces."""
    mesh = hammer()
    scene = Scene(mesh=mesh)
    said = BoundaryConditions(
        load=("part:head=1,-2,3",), torque=("near:0.34,0,0,0.05=0.1,0.2,-0.3",)
    )
    force, torque = (resultant(mesh, load) for load in said.applied(scene).tractions)
    np.testing.assert_allclose(force.force, [1, -2, 3], rtol=1e-12)
    np.testing.assert_allclose(torque.torque, [0.1, 0.2, -0.3], rtol=1e-9)
    np.testing.assert_allclose(torque.force, 0, atol=1e-9)


@pytest.mark.parametrize(
    ("conditions", "said"),
    [
        ({"fix": ("part:handl",)}, "did you mean 'handle'.*parts are handle, head.*x 0 to 0.34"),
        ({"fix": ("box:1,1,1,2,2,2",)}, "nearest is .0.34, 0.02, 0.1. of part 'head', 1.49 m away"),
        ({"fix": ("plane:w<1",)}, "wanted plane:z<0.01"),
        ({"fix": ("near:0,0,0,-1",)}, "radius -1 m"),
        ({"fix": ("near:0,0,nan,1",)}, "not 4 numbers"),
        ({"fix": ("handle",)}, "no place is called 'handle'; wanted part:NAME"),
        ({"load": ("part:head",)}, "--load 'part:head': wanted SELECTION=X,Y,Z"),
        ({"load": ("part:head=1,2",)}, "'1,2' is not 3 numbers"),
        ({"pressure": ("part:head=inf",)}, "'inf' is not a number"),
        ({"gravity_dir": (0.0, 0.0, 0.0)}, "not all 0"),
    ],
)  # fmt: skip
def test_what_hits_nothing_or_is_no_number_is_one_line(conditions, said):
    scene = Scene(mesh=hammer(), gravity_vector=(0.0, 0.0, -9.81))
    with pytest.raises(UsageError, match=said) as raised:
        BoundaryConditions(**conditions).applied(scene)
    assert "\n" not in str(raised.value)


def test_a_moved_point_that_is_held_stays_and_that_is_said():
    scene = BoundaryConditions(fix=("part:handle",), move=("part:head=0,0,1e-3",))
    scene = scene.applied(Scene(mesh=hammer()))
    assert any("its points are held: they stay" in warning for warning in scene.warnings)
    handle = np.unique(scene.mesh.tets[scene.mesh.region == 0])
    assert not scene.held.values[handle].any()


def test_a_square_end_of_two_faces_takes_the_torque_about_its_normal():
    """The middles of both lie on one line; only a torque about that line turns nothing."""
    bar = box_mesh((0.02, 0.02, 0.5), (1, 1, 8))
    faces = bar.boundary.faces
    end = faces[(bar.points[faces][..., 2] > 0.4999).all(axis=1)]
    assert len(end) == 2
    given = resultant(bar, spread_torque(bar, end, (0.0, 0.0, 100.0)))
    np.testing.assert_allclose(given.torque, [0, 0, 100], rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(given.force, 0, atol=1e-9)
    line = np.diff(bar.points[end].mean(axis=1), axis=0)[0]
    with pytest.raises(InputError, match="wider surface"):
        spread_torque(bar, end, line)


def test_a_torque_on_one_face_is_refused():
    with pytest.raises(InputError, match="wider surface"):
        spread_torque(hammer(), hammer().boundary.faces[:1], (0.0, 0.0, 1.0))


def test_a_scene_file_says_the_same(tmp_path):
    """Lists of strings and tables of numbers are the same conditions."""
    path = tmp_path / "scene.toml"
    path.write_text(
        'fix = "part:handle"\ngravity = 1.62\ngravity_dir = [0, 0, -1]\n'
        '[load]\n"part:head" = [0, 0, -10]\n[pressure]\n"part:head" = 5\n'
    )
    read = read_conditions(path)
    assert read.gravity == 1.62
    assert read.conditions == BoundaryConditions(
        fix=("part:handle",),
        load=("part:head=0.0,0.0,-10.0",),
        pressure=("part:head=5.0",),
        gravity_dir=(0.0, 0.0, -1.0),
    )
    for text, said in (
        ("fixed = []", "did you mean 'fix'"),
        ("load = 3", "load = 3, wanted a list of strings or a table"),
        ('gravity = "a"', "wanted a number"),
        ("fix = [1]", "wanted a list of strings or selections"),
        ("gravity_dir = [1]", "wanted three numbers"),
    ):
        path.write_text(text)
        with pytest.raises(UsageError, match=said):
            read_conditions(path)
    path.write_text("fix = = 2")
    with pytest.raises(InputError, match="cannot read the scene"):
        read_conditions(path)
