"""Words that change a matter which the table has only as it is usually: told, or another row."""

import pytest
from autophyx_tet.predictors.text.reader import parse


@pytest.mark.parametrize(
    ("text", "state"),
    [
        ("a molten glass frame", "molten"),
        ("the frame is rotten wood", "rotten"),
        ("the frame is hot steel", "hot"),
        ("frame: wet beech", "wet"),
        ("the frame is rusty steel", "rusty"),
        ("a frame of cracked concrete", "cracked"),
        ("the frame is steel at 800 °C", "800 °C"),
    ],
)
def test_a_state_that_no_row_has_is_told(clauses_of, table, text, state):
    (said,) = clauses_of(text, ["frame"])["frame"]
    sentence = parse(text, table, ["frame"])
    assert any(state in told for told in (*said.doubts, *sentence.notes)), (said, sentence.notes)


def test_a_state_that_the_row_has_is_none(clauses_of):
    for text, name in [
        ("the soil is moist soil", "soil"),
        ("bolt hot-dip galvanised steel", "bolt"),
        ("bolt: hot rolled steel", "bolt"),
        ("a ceramic mug full of hot coffee", "mug"),
        ("the sand is wet sand", "sand"),
        ("the bench is at 20 °C, oak", "bench"),
    ]:
        assert not [d for c in clauses_of(text, [name])[name] for d in c.doubts], text


def test_what_a_word_rules_out_is_its_whole_family(clauses_of, table):
    """ "Not glass" is no tempered glass, "not steel" no stainless steel."""
    for word, kin in [("glass", "tempered glass"), ("steel", "AISI 304 stainless steel")]:
        (said,) = clauses_of(f"the lid must not be {word}", ["lid"])["lid"]
        assert table.exact(kin).name in said.excluded


def test_a_bound_is_told(clauses_of):
    for text in ("frame E < 1 MPa", "frame E at least 1 MPa", "frame: E max. 1 MPa"):
        (said,) = clauses_of(text, ["frame"])["frame"]
        assert [q.value for q in said.numbers] == [1e6], text
        assert any("bound" in doubt for doubt in said.doubts), text


def test_a_small_m_before_pascal_is_told(clauses_of):
    (said,) = clauses_of("frame E = 3 mPa", ["frame"])["frame"]
    assert any("3 MPa" in doubt for doubt in said.doubts)


def test_numbers_stay_with_their_subject(clauses_of):
    """What is told beside them is no comma before a new one."""
    found = clauses_of("The body has stiffness 1000 N/m and density of 500", ["body", "lid"])
    assert [q.value for q in found["body"][0].numbers] == [500.0]
    assert not found["lid"]
    found = clauses_of("body PLA printed with 20% infill, lid PETG 100% infill", ["body", "lid"])
    assert {n: c[0].numbers[0].value for n, c in found.items()} == {"body": 0.2, "lid": 1.0}


def test_a_liquid_is_no_spelling_of_a_solid(clauses_of):
    (said,) = clauses_of("body: water", ["body"])["body"]
    assert (said.material, said.unknown) == (None, "water")


def test_a_wall_in_its_words_is_a_thickness(clauses_of):
    for text in ("a steel tank with a 3 mm thick wall", "a steel tank with 3 mm walls",
                 "an empty steel tank with a 3 mm wall"):  # fmt: skip
        (said, *_) = clauses_of(text, ["tank"])["tank"]
        assert [(q.measure, q.value) for q in said.numbers] == [("thickness", 0.003)], text


def test_a_share_of_a_filling_is_told(table):
    for text in (
        "a steel tank half full of diesel",
        "the tank is steel, half-filled with water",
        "a steel tank, 30 % full of sand",
        "a tank of steel, two thirds full of water",
    ):
        sentence = parse(text, table, ["tank"])
        assert any("taken as full" in note for note in sentence.notes), (text, sentence.notes)
    assert not parse("a steel tank full of diesel", table, ["tank"]).notes
