"""Binding: which clause speaks of which part."""

import pytest
from autophyx_tet.predictors.text.clauses import bind
from autophyx_tet.predictors.text.parts import part_name_words
from autophyx_tet.predictors.text.reader import parse


@pytest.mark.slow
def test_more_words_beat_fewer(agree):
    agree("""
        white piece is marble, black piece is slate => white_piece: marble; black_piece: slate
        front legs are oak, rear legs are steel => leg_front_L, leg_front_R: oak; leg_rear: steel
        the top of the table is glass, the table leg is brass => table_top: glass; table_leg: brass
        upper arm steel, lower arm brass => arm_upper: steel; arm_lower: brass
        the posts are oak apart from the corner post: that is ash => post_1: oak; post_corner: ash
    """)


@pytest.mark.slow
def test_the_whole_and_the_rest_fill_what_nothing_names(agree):
    agree("""
        oak => a, b: oak
        everything is steel except the seat, which is leather => seat: leather; leg: steel
        seat leather, everything else brass => seat: leather; leg, back: brass
        a walnut bookcase with a glass door => side_1, shelf: walnut; door: glass
        the left arm is pine, the other one is steel => arm_left: pine; arm_right: steel
    """)


@pytest.mark.slow
def test_other_words_for_the_same_part(agree):
    agree("""
        the cap is cork => lid: cork
        brass stand => base: brass
        feet of rubber => foot_1, foot_2: rubber
    """)


def test_a_clause_without_its_part_is_given_back(table):
    sentence = parse("the legs are steel and the seat is oak", table, ["seat"])
    assert bind(sentence, [["seat"]]).unbound == (0,)
    sentence = parse("front legs oak, rear legs steel", table, ["leg_1", "leg_2"])
    assert bind(sentence, [["leg_1"], ["leg_2"]]).unbound == (0, 1)


def test_a_part_that_is_called_like_a_material_is_a_part_first(agree):
    agree("""
        the soil is moss => soil: moss
        the glass is acrylic and the rope is nylon => glass: acrylic; rope: nylon
        a ceramic pot with loose soil => pot: ceramic; soil: loose soil
        cardboard box with a steel lid => box: cardboard; lid: steel
    """)


def test_exceptions_are_left_out(agree):
    agree("""
        all bodies steel except Body2 (EPDM) => Body1, Body3: steel; Body2: EPDM
        all legs oak, except leg_3 which is pine => leg_1, leg_2: oak; leg_3: pine
        all parts but the rope are birch, the rope is nylon => deck, mast: birch; rope: nylon
    """)


def test_a_list_of_materials_may_name_its_parts_in_brackets(agree):
    agree("""
        steel (legs), oak (top) => leg_1: steel; top: oak
        Materials: ash (handle), brass (ferrule) => handle: ash; ferrule: brass
    """)


def test_names_of_exporters_are_words():
    for name, words in [
        ("SM_Seat_Cushion.001", ("seat", "cushion", "001")),
        ("leg_FL", ("leg", "front", "left")),
        ("TableTop", ("table", "top")),
        ("Knives2", ("knife", "2")),
    ]:
        assert part_name_words(name) == words


def test_what_only_a_name_says_is_overruled_by_what_is_said_of_it(agree):
    """Bones may be prints, a glass be sapphire; unsaid they stay so."""
    agree("""
        bones printed in PLA, skin of silicone => bone: PLA; skin: silicone
        the glass is sapphire, the case is titanium => glass: sapphire; case: titanium
        the glass sits in a brass frame => glass: glass; frame: brass
        an oak trunk and leaves => trunk: oak; leaf: leaf
    """)


def test_wholes_exceptions_and_places_are_read_where_they_stand(agree):
    agree("""
        but for the track (rubber) and gun (tin) a tank is PLA => track: rubber; gun: tin; hull: PLA
        the posts are oak, and the boards on top are larch => post: oak; board_1, board_2: larch
        polycarbonate lenses, silicone strap => lens_L, lens_R: polycarbonate; strap: silicone
        1x plate S355, 2x arm EN AW-6082 => plate: S355; arm_1, arm_2: 6082
        the skeg is cut from King StarBoard, the keel is lead => skeg: HDPE; keel: lead
        the body is a blend of PC and ABS => body: PC/ABS
        the post is fibreglass painted like cast iron => post: fibreglass
    """)


LEGS = ["top", "leg_fl", "leg_fr", "leg_bl", "leg_br"]


def _rows(clauses_of, text, names):
    found = clauses_of(text, names)
    return {n: next((c.material for c in cs if c.material), None) for n, cs in found.items()}


def test_two_sides_of_a_part_both_count(clauses_of):
    """The "back left leg" is one leg and not two, whatever the tagger makes of "back"."""
    for text, leg in [
        ("the back left leg is brass", "leg_bl"),
        ("back right leg: brass", "leg_br"),
        ("back-left leg brass", "leg_bl"),
        ("the front-right leg is brass", "leg_fr"),
        ("the rear left leg is brass", "leg_bl"),
        ("the left back leg is brass", "leg_bl"),
    ]:
        rows = _rows(clauses_of, text, LEGS)
        assert [n for n, row in rows.items() if row == "brass"] == [leg], (text, rows)


def test_fewer_than_there_are_is_told(clauses_of):
    """Three of four legs: nobody knows which, unless the fourth is named."""
    for text in (
        "3 of the legs are steel",
        "three legs are steel",
        "one of the legs is steel",
        "some of the legs are steel",
        "half of the legs are steel",
    ):
        found = clauses_of(text, LEGS)
        assert not found["top"], text
        for leg in LEGS[1:]:
            assert any("not which" in d for c in found[leg] for d in c.doubts), text
    for text in (
        "four legs of steel",
        "the 4 legs are steel",
        "the legs are steel",
        "all of the legs are steel",
        "each of the legs is steel",
        "3 of the legs are steel, the back left leg is brass",
    ):
        found = clauses_of(text, LEGS)
        assert not any(c.doubts for cs in found.values() for c in cs), text


def test_a_part_that_has_values_is_not_the_whole(clauses_of):
    """ "The body has a modulus" speaks of the part that is called so."""
    text = "The body has a Young's modulus of 3 MPa and a density of 500 kg/m^3"
    found = clauses_of(text, ["body", "lid"])
    assert [q.value for q in found["body"][0].numbers] == [3e6, 500.0]
    assert not found["lid"]


def test_a_side_is_a_part_of_what_has_no_parts(table):
    """In a thing of one piece "a leather back" is its back, and "a glass top" its top."""
    for text, part in [
        ("oak legs and a leather back", "back"),
        ("steel legs and a glass top", "top"),
        ("spruce top, maple back and sides", "back"),
    ]:
        sentence = parse(text, table, ["geometry_0"])
        assert (part,) in [name for c in sentence.clauses for name in c.subject.names], text
