"""What is hollow: by its words, its shape and its material."""

import pytest
from autophyx_tet.fem.table import load_contents, load_table
from autophyx_tet.predictors.construction import (
    SHAPE,
    ThingWords,
    construction_of,
    densities_of,
    head_of_name,
    kinds_named,
    load_kinds,
    mass_interval,
)
from autophyx_tet.predictors.text.reader import parse

TABLE, CONTENTS = load_table(), load_contents()
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
        "waterbottle": "plastic bottle",
        "lamp shade": "lamp shade",
        "mail_box": "toolbox",
        "box": "case",
    }
    assert {name: kind(name) for name in rows} == rows


def test_a_sentence_about_what_a_thing_does_names_no_kind():
    """Legs that can bend are no can, whatever comes last."""
    assert not kinds_named(parse("the legs can bend", TABLE).thing)
    assert kinds_named(parse("This is a steel can.", TABLE).thing)


def test_every_kind_has_a_material_of_the_table():
    """Each usual material is a row, of the kind's own category where it has one."""
    for row in load_kinds():
        assert row.hollow == "often" or row.material, row.name
        if row.material:
            category = TABLE.exact(row.material).category
            assert row.category in ("", category), row.name


def words(text):
    """What a text says of a lone part called "body"."""
    return ThingWords.of(["body"], thing=parse(text, TABLE).thing)


def of(text="", material="steel", **said):
    """The construction of a lone part called "body"."""
    return construction_of("body", words(text), TABLE.exact(material), **said)


def test_who_decides():
    """Options before shape, shape before words, words before nothing."""
    assert of("a steel can", solid=True).form == "solid"
    assert of("a steel can", wall=0.001).wall == (0.001, 0.001)
    assert of("a steel can", hull_fraction=0.2).form == "walls in its shape"
    assert of("a solid steel can").form == "solid"
    assert of("a steel can").form == "shell"
    assert of("a hollow steel sphere", smallest_side=0.1).wall == pytest.approx((0.001, 0.01))
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
    assert words("a wine bottle").usual_material() == ("glass bottle", "soda-lime glass")
    assert words("a thing").usual_material() is None
    assert of("a steel bolt").form == "solid"


def test_intervals_of_masses():
    """A cube of 1 m: solid V rho; a shell between the ends of its wall; unknown spans both."""

    def wall_volume(wall):
        return 1 - (1 - 2 * wall) ** 3

    def masses(construction):
        rho = densities_of(STEEL, 7850.0, guessed=False, table=TABLE)
        return mass_interval(construction, rho, volume=1.0, wall_volume=wall_volume)

    rho = STEEL.rho
    low, high = (1 - SHAPE) * min(rho.min, 7850), (1 + SHAPE) * max(rho.max, 7850)
    assert masses(of(solid=True)) == pytest.approx((low, high))
    assert masses(of(wall=0.001)).low == pytest.approx(wall_volume(0.001) * low)
    unknown = masses(of("a steel bracket"))
    assert unknown == pytest.approx((wall_volume(0.01) * low, high))
    drum = masses(of("a steel drum"))
    assert drum.high > 1000 > 100 > masses(of("an empty steel drum")).high
    anything = densities_of(STEEL, 7850.0, guessed=True, table=TABLE)
    assert anything.min <= 300 < 7800 <= anything.max


def test_what_a_thing_is_called_after_may_be_in_it():
    """A milk carton may hold milk, if nothing says that it is empty."""
    carton = of("a milk carton", material="paper and cardboard", contents=CONTENTS)
    assert carton.filling == "milk (contents)"
    assert carton.inside.min == 0
    assert "maybe" in carton.sentence
    assert not of("an empty milk carton", contents=CONTENTS).filling
    assert not of("a drink can", contents=CONTENTS).filling


def test_what_is_empty_is_hollow():
    """An empty tank has the wall of its kind; a tank, of which nothing is said, may be solid."""
    empty = ThingWords.of(["tank"], thing=("an", "empty", "steel", "tank"))
    assert construction_of("tank", empty, STEEL).form == "shell"
    assert construction_of("tank", ThingWords.of(["tank"]), STEEL).form == "unknown"
