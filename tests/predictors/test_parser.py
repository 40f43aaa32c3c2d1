"""Laws of the clause parser: words bind to the parts they stand by, whatever the syntax."""

import pytest
from autophyx_tet.fem.errors import UsageError
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.text.parts import name_words, stem, vocabulary_of
from autophyx_tet.research.evaluation.parser import MAX_TEXT, listen
from hypothesis import given, settings
from hypothesis import strategies as st

TABLE = load_table()
OAK_FOAM = [("oak", "leg"), ("foam", "seat")]


def clauses(text):
    return listen(text, TABLE).clauses


def pairs(text):
    """(material, part) pairs of a text, in order."""
    return [(c.material, part) for c in clauses(text) for part in c.parts]


def test_all_these_say_oak_legs_and_a_foam_seat():
    for text in (
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
    ):
        assert [pair for pair in pairs(text) if pair[0]] == OAK_FOAM, text


def test_lists_relative_clauses_and_words_that_are_part_and_material():
    for text, expected in (
        ("oak legs and back, foam seat", [("oak", "leg"), ("oak", "back"), ("foam", "seat")]),
        ("legs, back and seat are oak", [("oak", "leg"), ("oak", "back"), ("oak", "seat")]),
        ("oak for the legs", [("oak", "leg")]),
        ("use velvet for the fabric", [("velvet", "fabric")]),
        ("it is a steel frame with an oak seat", [("steel", "frame"), ("oak", "seat")]),
        ("a bonsai in a ceramic pot", [(None, "bonsai"), ("ceramic", "pot")]),
        ("plastic leaves", [("plastic", "leaf")]),
        ("the leaves are silk", [("silk", "leaf")]),
        ("the seat is oak wood", [("oak wood", "seat")]),
        ("oak legs of the chair", [("oak", "leg"), ("oak", "chair")]),
        ("", []),
        ("10 cm x 20 cm", []),
    ):
        assert pairs(text) == expected, text


def test_longest_phrase_and_level():
    (clause,) = clauses("solid steel ball, 10 cm")
    assert (clause.material, clause.parts, clause.level) == ("steel", ("ball",), None)
    soft, stiff = clauses("a natural rubber grip that is very soft; a stiff frame")
    assert (soft.material, soft.parts, soft.level) == ("natural rubber", ("grip",), "soft")
    assert (stiff.material, stiff.parts, stiff.level) == (None, ("frame",), "stiff")
    (alloy,) = clauses("6061-T6 hull")
    assert alloy.material == "6061 t6"


def test_a_text_too_long_is_refused():
    clauses("oak " * (MAX_TEXT // 4))
    with pytest.raises(UsageError, match=str(MAX_TEXT)):
        clauses("x" * (MAX_TEXT + 1))


def test_materials_in_the_names_of_assets():
    vocabulary = vocabulary_of(TABLE)
    for name, phrase in (
        ("Metal_Chrome", "chrome"),
        ("legno_scuro", "wood"),
        ("WoodSeat02", "wood"),
        ("Stahl.001", "steel"),
        ("tissu-rouge", "fabric"),
        ("sweethome3d_mat_3", None),
        ("Group1", None),
    ):
        found = vocabulary.in_name(name)
        assert (found and TABLE.exact(found)) is (phrase and TABLE.exact(phrase)), name


def test_stems():
    plurals = "legs leaves boxes bodies feet shelves brass glass wheels chassis wrenches".split()
    singulars = "leg leaf box body foot shelf brass glass wheel chassi wrench".split()
    assert [stem(word).rstrip("s") for word in plurals] == [w.rstrip("s") for w in singulars]
    assert name_words("BedFrame_01.Legs") == ["bed", "frame", "leg"]


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(st.text(max_size=200) | st.lists(st.sampled_from(
    "oak steel foam legs seat the is of , . and with which : soft not leaves 10 cm".split()
)).map(" ".join))  # fmt: skip
def test_any_text_is_read(text):
    """No input fails, and case and surrounding space do not matter."""
    found = clauses(text)
    assert all(clause.material or clause.parts for clause in found)
    if text.isascii():
        again = clauses(f"  {text.upper()} ")
        read = [[(c.material, c.parts, c.level) for c in those] for those in (again, found)]
        assert read[0] == read[1]


def test_clauses_keep_their_words_as_written():
    """Every word between the first and the last, in the user's own letters; no word of others."""
    text = "Extremely squishy FOAM seat and a leather back; oak legs, arms"
    assert [clause.text for clause in clauses(text)] == [
        "squishy FOAM seat",
        "a leather back",
        "oak legs and arms",  # a list taken apart: as it was understood
    ]
    assert clauses("a seat of very soft foam")[0].text == "a seat of very soft foam"


def test_a_template_states_nothing():
    """AutoPhyX's template only names the object; with a material or a level it says something."""
    assert listen("This is a potted plant.", TABLE).stated == ()
    for text in ("This is an oak chair.", "this is a soft toy", "chair with legs"):
        sentence = listen(text, TABLE)
        assert sentence.stated == sentence.clauses != (), text
