"""Laws of the clause parser: words bind to the parts they stand by, whatever the syntax."""

import pytest
from autophyx_tet.fem.errors import UsageError
from autophyx_tet.fem.scene.materials import load_table
from autophyx_tet.predictors.language.clauses import MAX_TEXT, parse
from autophyx_tet.predictors.language.vocabulary import Vocabulary, name_words, stem
from hypothesis import given, settings
from hypothesis import strategies as st

VOCABULARY = Vocabulary(load_table().phrases)
OAK_FOAM = [("oak", "leg"), ("foam", "seat")]


def pairs(text):
    """(material, part) pairs of a text, in order."""
    return [(c.material, part) for c in parse(text, VOCABULARY) for part in c.parts]


@pytest.mark.parametrize(
    "text",
    [
        "oak legs, foam seat",
        "oak legs foam seat",
        "legs of oak and a seat of foam",
        "the legs are oak the seat is foam",
        "the legs are oak while the seat is foam",
        "Legs: oak. Seat: foam.",
        "legs = oak\nseat = foam",
        "legs - oak; seat - foam",
        "legs, which are oak, with a seat that is made out of foam",
        "the legs, made from oak, and the seat, foam",
        "two oak legs (30 cm) & one foam seat of 1.5 kg",
        "OAK LEGS AND FOAM SEAT!",
        "the legs are not steel but oak, the seat is foam",
    ],
)
def test_all_these_say_oak_legs_and_a_foam_seat(text):
    found = pairs(text)
    assert [pair for pair in found if pair[0]] == OAK_FOAM


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("oak legs and back, foam seat", [("oak", "leg"), ("oak", "back"), ("foam", "seat")]),
        ("legs, back and seat are oak", [("oak", "leg"), ("oak", "back"), ("oak", "seat")]),
        ("oak for the legs", [("oak", "leg")]),
        ("use velvet for the fabric", [("velvet", "fabric")]),
        ("it is a steel frame with an oak seat", [("steel", "frame"), ("oak", "seat")]),
        ("a bonsai in a ceramic pot", [(None, "bonsai"), ("ceramic", "pot")]),
        ("plastic leaves", [("plastic", "leaf")]),
        ("the leaves are silk", [("silk", "leaf")]),
        ("the seat is oak wood", [("oak", "seat")]),
        ("oak legs of the chair", [("oak", "leg"), ("oak", "chair")]),
        ("", []),
        ("10 cm x 20 cm", []),
    ],
)
def test_lists_relative_clauses_and_words_that_are_part_and_material(text, expected):
    assert pairs(text) == expected


def test_longest_phrase_and_level():
    (clause,) = parse("solid steel ball, 10 cm", VOCABULARY)
    assert (clause.material, clause.parts, clause.level) == ("steel", ("ball",), None)
    soft, stiff = parse("a natural rubber grip that is very soft; a stiff frame", VOCABULARY)
    assert (soft.material, soft.parts, soft.level) == ("natural rubber", ("grip",), "soft")
    assert (stiff.material, stiff.parts, stiff.level) == (None, ("frame",), "stiff")
    (alloy,) = parse("6061-T6 aluminium hull", Vocabulary(["6061 t6"]))
    assert alloy.material == "6061 t6"


def test_a_text_too_long_is_refused():
    parse("oak " * (MAX_TEXT // 4), VOCABULARY)
    with pytest.raises(UsageError, match=str(MAX_TEXT)):
        parse("x" * (MAX_TEXT + 1), VOCABULARY)


@pytest.mark.parametrize(
    ("name", "phrase"),
    [
        ("Metal_Chrome", "chrome"),
        ("legno_scuro", "wood"),
        ("WoodSeat02", "wood"),
        ("Stahl.001", "steel"),
        ("tissu-rouge", "fabric"),
        ("sweethome3d_mat_3", None),
        ("Group1", None),
    ],
)
def test_materials_in_the_names_of_assets(name, phrase):
    found = VOCABULARY.in_name(name)
    rows = load_table()
    assert (found and rows.exact(found)) is (phrase and rows.exact(phrase))


def test_stems():
    plurals = "legs leaves boxes bodies feet shelves brass glass wheels chassis wrenches".split()
    singulars = "leg leaf box body foot shelf brass glass wheel chassi wrench".split()
    assert [stem(word).rstrip("s") for word in plurals] == [w.rstrip("s") for w in singulars]
    assert name_words("BedFrame_01.Legs") == ["bed", "frame", "leg"]


@settings(max_examples=200, deadline=None)
@given(st.text(max_size=200) | st.lists(st.sampled_from(
    "oak steel foam legs seat the is of , . and with which : soft not leaves 10 cm".split()
)).map(" ".join))  # fmt: skip
def test_any_text_is_read(text):
    """No input fails, and case and surrounding space do not matter."""
    clauses = parse(text, VOCABULARY)
    assert all(clause.material or clause.parts for clause in clauses)
    if text.isascii():
        assert parse(f"  {text.upper()} ", VOCABULARY) == clauses
