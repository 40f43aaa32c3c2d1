"""What is hollow: by its words, its shape and its material."""

import pytest
from autophyx_tet.fem.scene.materials import load_table
from autophyx_tet.predictors.construction.construction import construction_of, usual_material
from autophyx_tet.predictors.construction.kinds import (
    first_phrase,
    head_of_name,
    kinds_named,
    load_kinds,
)
from autophyx_tet.predictors.construction.masses import mass_interval

TABLE = load_table()
STEEL = TABLE.exact("steel")


def kind(name):
    """The first kind that a name has, or None."""
    found = kinds_named(head_of_name(name))
    return found[0].name if found else None


def test_the_head_of_a_name_decides():
    """Whole words, the last of them: an opener is no bottle, an object no box."""
    rows = {
        "two_objects": None,
        "bottle opener": None,
        "carSeat": None,
        "staircase": None,
        "robin": None,
        "oscar": None,
        "CarBody_low.001": "car",
        "KatorLegaz fridge": "fridge",
        "washing-machine": "washing machine",
        "wash_machine2": "case",
        "medicoscopia_bottle2": "glass bottle",
        "fire truck": "truck",
        "water bottles": "plastic bottle",
        "lamp shade": "lamp shade",
        "mail_box": "toolbox",
        "box": "case",
    }
    assert {name: kind(name) for name in rows} == rows


def test_the_first_phrase_of_a_text_says_what_it_is():
    """Up to the first word of grammar: neither a lid for a bottle nor legs that can bend."""
    rows = {
        "This is a metal can full of coffee.": "a metal can",
        "an empty glass bottle": "an empty glass bottle",
        "a lid for a bottle": "a lid",
        "the legs can bend": "the leg can bend",
        "steel, like a car": "steel",
        "": "",
    }
    assert {text: " ".join(first_phrase(text)) for text in rows} == rows
    assert not kinds_named(first_phrase("the legs can bend"))


def test_every_kind_has_a_material_of_the_table():
    """Each usual material is a row, of the kind's own category where it has one."""
    for row in load_kinds():
        assert not row.always or row.material, row.name
        if row.material:
            category = TABLE.exact(row.material).category
            assert row.category in ("", category), row.name


def of(text="", material="steel", **said):
    """The construction of a lone part called "body"."""
    return construction_of(["body"], TABLE.exact(material), text=text, **said)


def test_who_decides():
    """Options before shape, shape before words, words before nothing."""
    assert of("a steel can", solid=True).form == "solid"
    assert of("a steel can", wall=0.001).wall == (0.001, 0.001)
    assert of("a steel can", hull_share=0.2).form == "walls in its shape"
    assert of("a solid steel can").form == "solid"
    assert of("a steel can").form == "shell"
    assert of("a hollow steel boule", smallest_side=0.1).wall == pytest.approx((0.001, 0.01))
    assert of("a steel box").form == "unknown"
    assert of("a hollow steel box").form == "shell"
    assert of("a steel bracket").form == "unknown"
    assert of("a block", material="granite").form == "solid"
    full = of("a steel box", filling=TABLE.exact("sand (uniform)"))
    assert full.form == "shell"
    assert full.inside.max == TABLE.exact("sand (uniform)").rho.max


def test_a_bottle_is_as_thick_as_its_material_allows():
    """Glass in millimetres, plastic in tenths: the row of the material's category."""
    glass, plastic = of("a bottle", material="glass"), of("a bottle", material="PET")
    assert glass.wall.min > plastic.wall.max
    assert usual_material(["body"], (), "a wine bottle") == ("glass bottle", "soda-lime glass")
    assert usual_material(["body"], (), "a chair") is None


def test_intervals_of_masses():
    """A cube of 1 m: solid V rho; a shell between the ends of its wall; unknown spans both."""

    def wall_volume(wall):
        return 1 - (1 - 2 * wall) ** 3

    def masses(construction):
        return mass_interval(construction, STEEL, rho=7850.0, volume=1.0, wall_volume=wall_volume)

    rho = STEEL.rho
    assert masses(of(solid=True)) == (min(rho.min, 7850), max(rho.max, 7850))
    told = masses(of(wall=0.001))
    assert told.low == pytest.approx(wall_volume(0.001) * min(rho.min, 7850))
    unknown = masses(of("a steel bracket"))
    assert unknown.low == pytest.approx(wall_volume(0.01) * min(rho.min, 7850))
    assert unknown.high == max(rho.max, 7850)
