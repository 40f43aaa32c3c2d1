"""Walls in the verbs: what a user who names a hollow thing gets, and what is said of it."""

import autophyx_tet as apx
import numpy as np
import pytest
import trimesh
from autophyx_tet.fem.errors import UsageError
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.asset import Asset, Part
from autophyx_tet.toolkit.options import AssignOptions, ConvertOptions
from autophyx_tet.toolkit.walls import WallOptions, bodies_of, with_named_walls

CAN = (0.066, 0.066, 0.115)
SURFACE = 2 * (0.066**2 + 2 * 0.066 * 0.115)
LOOKUP = AssignOptions(cells=8, predictor="retrieval")


def assigned(text, walls=None, mesh=None):
    """A box as large as a drink can, under a sentence."""
    mesh = mesh or box_mesh(CAN, (4, 4, 6))
    return apx.assign(mesh, text, options=LOOKUP, walls=walls)


def joined(names, one, other):
    """Two bodies as two regions of a mesh."""
    return TetMesh(
        np.concatenate([one.points, other.points]),
        np.concatenate([one.tets, other.tets + len(one.points)]),
        region=np.repeat([0, 1], [len(one.tets), len(other.tets)]),
        region_names=names,
    )


def test_a_steel_can_of_stated_wall_weighs_area_times_wall():
    """m = rho A t, 1 % less at the edges, counted once; E is beta of steel's; both are told."""
    wall = 2e-4
    result = assigned("steel", WallOptions(wall=wall))
    row = result.part_rows()[0]
    assert result.mesh.mass == pytest.approx(row["rho"] * SURFACE * wall, rel=0.02)
    assert row["mass_interval"][0] <= result.mesh.mass <= row["mass_interval"][1]
    inner = np.array(CAN) - 2 * wall
    beta = 1 - inner[0] ** 3 * inner[1] * inner[2] / (CAN[0] ** 3 * CAN[1] * CAN[2])
    assert result.mesh.material.E == pytest.approx(beta * row["E"], rel=0.05)  # sampled shares
    assert any("apparent" in warning and "0.2 mm" in warning for warning in result.warnings)


def test_a_wall_that_the_text_states_is_that_of_the_option():
    """m = rho (outer - inner volume) of a box; a part called wall, and "thick", hollow nothing."""
    for text in ("a steel box with a 2 mm wall", "steel box, wall thickness 0.2 cm"):
        result = assigned(text)
        rho = result.part_rows()[0]["rho"]
        mass = rho * (np.prod(CAN) - np.prod(np.array(CAN) - 2 * 0.002))
        assert result.mesh.mass == pytest.approx(mass, rel=0.02), text  # shares are sampled
        assert not any("changes nothing" in warning for warning in result.warnings)
    solid = assigned("a steel box with a 2 mm wall", WallOptions(solid=True))
    assert solid.mesh.mass == pytest.approx(rho * np.prod(CAN), rel=0.01)
    assert any("2 mm wall" in doubt and "not used" in doubt for doubt in solid.doubts)
    thick = assigned("a steel plate, 2 mm thick")
    assert thick.mesh.mass == pytest.approx(rho * np.prod(CAN), rel=0.01)
    assert any("changes nothing" in warning for warning in thick.warnings)
    house = joined(("wall", "roof"), box_mesh(CAN, (2, 2, 2)), box_mesh((0.05,) * 3, (2, 2, 2)))
    built = assigned("the wall is concrete, wall thickness 20 mm", mesh=house).built
    assert built[0].construction.form != "shell"


def test_walls_that_all_texts_state_are_known_before_the_mesh():
    """Options go first; texts that do not agree, and a wall that holds something, wait."""
    lid = trimesh.creation.box((0.1, 0.1, 0.02))
    lid.apply_translation((0, 0, 1))
    asset = Asset("cup", (Part("cup", trimesh.creation.box((0.1, 0.1, 0.2))), Part("lid", lid)))
    two = "a steel cup with a 2 mm wall"

    def stated(*texts, walls=None):
        found, said = with_named_walls(asset, texts, walls, None)
        assert found is asset
        return {} if said is None else said.by_part()

    assert stated(two) == stated(two, "the cup is glass, walls of 2 mm") == {"cup": 0.002}
    assert stated("the lid is pine, wall thickness 3 mm") == {"lid": 0.003}
    assert stated(two, "the cup is glass, walls of 4 mm") == {}
    assert stated(two, "a glass cup") == {}
    assert stated("a steel cup with a 2 mm wall full of water") == {}
    assert stated(two, walls=WallOptions(part_wall=("cup=0.001",))) == {"cup": 0.001}


def test_the_name_of_a_hollow_thing_is_enough():
    """A can is no block of metal; told to be solid it is; either way the interval holds it."""
    can = assigned("an aluminium can")
    low, high = can.mass_interval()
    assert low <= can.mesh.mass < 0.05 < high < 0.7  # kg: empty, though it may be full
    solid = assigned("an aluminium can", WallOptions(solid=True))
    assert solid.mesh.mass == pytest.approx(2700 * np.prod(CAN), rel=0.05)
    assert can.document()["mass_interval"] == [low, high]
    assert not any("apparent" in warning for warning in solid.warnings)


def test_where_nothing_decides_the_mass_is_an_interval():
    """A steel box is meshed solid, and the verdict gives both ends."""
    result = assigned("a steel box")
    low, high = result.mass_interval()
    assert high / low > 5
    verdict = next(v for v in result.verdicts() if v.name == "mass")
    assert "may be hollow" in verdict.sentence
    assert "--wall" in verdict.advice


def test_a_full_thing_weighs_what_it_holds():
    """A wall of 0.2 mm of steel around sand."""
    sand = load_table().exact("sand (uniform)")
    result = assigned("a steel can", WallOptions(fill=("sand (uniform)",)))
    volume = float(np.prod(CAN))
    coffee = assigned("a metal can full of ground coffee")
    assert 0.15 < coffee.mesh.mass < 0.35  # kg: half a litre at 300 to 500 kg/m3
    assert "full of" in coffee.built[0].construction.sentence
    assert 0.9 * sand.rho.min * 0.95 * volume < result.mesh.mass < 1.1 * sand.rho.max * volume


def test_only_the_part_that_is_said_to_be_full_is():
    """Of a bottle and its cap the bottle; what the whole is full of, its main part."""
    bottle, cap = (
        box_mesh((0.1, 0.1, 0.2), (2, 2, 2)),
        box_mesh((0.03,) * 3, (1,) * 3, lo=(1, 0, 0)),
    )
    for names, text in (
        (("bottle", "cap"), "a plastic bottle filled with water and a steel cap"),
        (("mesh_0", "mesh_1"), "a plastic bottle full of water"),
    ):
        rows = assigned(text, mesh=joined(names, bottle, cap)).part_rows()
        assert [row["construction"]["filling"] for row in rows] == ["water (contents)", ""], text


def test_what_a_solid_thing_is_said_to_hold_is_told():
    """Its mass does not count it, and that is a doubt."""
    said = assigned("a steel can full of ground coffee", WallOptions(solid=True))
    assert any("does not count it" in doubt and "--part-wall" in doubt for doubt in said.doubts)
    assert not assigned("a steel can full of ground coffee").doubts


def test_unknown_parts_and_materials_are_told():
    with pytest.raises(UsageError, match="no part 'lid'"):
        assigned("steel", WallOptions(part_wall=("lid=0.001",)))
    with pytest.raises(UsageError, match="no material"):
        assigned("steel", WallOptions(fill=("unobtainium",)))
    with pytest.raises(UsageError, match="lengths > 0"):
        assigned("steel", WallOptions(wall=-1.0))


def test_a_name_of_the_whole_speaks_of_its_main_part():
    """A car's body is a shell; its wheel, a twentieth of it, is what its own words say."""
    body, wheel = box_mesh((1, 1, 1), (2, 2, 2)), box_mesh((0.3, 0.3, 0.3), (1, 1, 1), lo=(2, 0, 0))
    mesh = joined(("panel", "wheel"), body, wheel)
    rows = assigned("a steel car", mesh=mesh).part_rows()
    assert [row["construction"]["form"] for row in rows] == ["shell", "unknown"]
    assert bodies_of(mesh)[1].smallest_side == pytest.approx(0.3)


@pytest.mark.slow
@pytest.mark.parametrize("wall", [0.02, 0.013])
def test_a_cup_of_water_is_a_wall_and_water(wall, tmp_path):
    """m = rho_wall (V - V_room) + rho_water V_room, two regions of tets, nothing smeared.

    So through files too: the options of `assign` do not undo what `convert` made.
    """
    outer = np.array((0.1, 0.1, 0.12))
    cup = Asset("cup", (Part("cup", trimesh.creation.box(outer)),))
    options = ConvertOptions(mesher="stuffing", edge_length=0.01, no_cache=True)
    walls = WallOptions(wall=wall, fill=("water",))
    solid = apx.convert(cup, options=options, walls=walls, output=tmp_path / "cup.msh")
    assert not solid.report.hollow
    room = float(np.prod(outer - 2 * wall))
    volumes = dict(zip(solid.mesh.region_names, solid.mesh.region_volumes(), strict=True))
    assert volumes == pytest.approx({"cup": outer.prod() - room, "cup contents": room}, rel=0.01)
    full = AssignOptions(cells=24, predictor="retrieval", set=("cup:rho=7850",))
    for made in (
        apx.assign(solid.mesh, "a steel cup", options=full, walls=solid.known_walls),
        apx.assign(tmp_path / "cup.msh", "a steel cup", options=full, walls=WallOptions()),
    ):
        expected = 7850 * (outer.prod() - room) + 999 * room  # kg; a litre at 20 degrees: 998 g
        assert made.mesh.mass == pytest.approx(expected, rel=0.01)
        assert [row["material"] for row in made.part_rows()][1] == "water (contents)"
        assert not any("apparent" in told or "not count" in told for told in made.warnings)


def test_a_wall_that_no_mesh_holds_stays_with_the_material():
    """Where the wall is thinner than epsilon there is one region, full of apparent material."""
    cup = Asset("cup", (Part("cup", trimesh.creation.box((0.1, 0.1, 0.12))),))
    options = ConvertOptions(mesher="stuffing", edge_length=0.02, no_cache=True)
    solid = apx.convert(cup, options=options, walls=WallOptions(wall=2e-4, fill=("water",)))
    assert solid.mesh.region_names == ("cup",)


def test_contents_never_take_the_name_of_a_part():
    """A part that is called what the contents would be: said, with the way out."""
    box = trimesh.creation.box((0.1, 0.1, 0.12))
    cup = Asset("cup", (Part("cup", box), Part("cup contents", box.copy())))
    options = ConvertOptions(mesher="stuffing", edge_length=0.02, no_cache=True)
    with pytest.raises(UsageError, match="'cup contents', which the asset has"):
        apx.convert(cup, options=options, walls=WallOptions(wall=0.02, fill=("cup=water",)))
