"""What is not understood: told, never guessed and never passed over."""

from autophyx_tet.predictors.text.reader import parse


def test_what_nobody_knows_is_told_with_its_nearest_rows(clauses_of):
    for text in ("the pot is made of unobtainium", "pot: blargite", "the pot is zorbium"):
        (said, *_) = clauses_of(text, ["pot"])["pot"]
        assert said.material is None, text
        assert said.unknown, text
        assert len(said.nearest) == 3, text


def test_a_part_beside_which_something_is_unread_is_not_understood(clauses_of):
    """A code, a number or a noun in the place of its matter: told, and never passed over."""
    for text, word in [
        ("a moonvine spring and a PEEK seat", "moonvine"),
        ("spring: K-750; seat: PEEK", "K-750"),
        ("spring Grivory; seat PEEK", "Grivory"),
        ("spring xq, seat PEEK", "xq"),
    ]:
        (said, *_) = clauses_of(text, ["spring", "seat"])["spring"]
        assert said.material is None, text
        assert word in said.unknown, text


def test_a_quality_is_no_material(clauses_of):
    for text in (
        "the seat is comfortable",
        "the seat is red",
        "the seat is a disaster",
        "nice seat",
    ):
        assert not any(c.says_matter for c in clauses_of(text, ["seat"])["seat"]), text


def test_spelling_is_mended_and_told(agree, table):
    agree("""
        alumnium rim, stell hub => rim: aluminium; hub: steel
        the hadnle is wlanut => handle: walnut
    """)
    assert any("'alumnium'" in note for note in parse("alumnium rim", table, ["rim"]).notes)


def test_a_text_that_is_not_english_is_told(table):
    for text in (
        "Scatola in legno di noce, coperchio in ottone",
        "het blad is van eikenhout en de poten zijn van smeedijzer",
    ):
        assert any("a language that is not read" in note for note in parse(text, table).notes), text


def test_what_is_left_out_beside_a_material_is_told(clauses_of):
    for text, word in [
        ("the lid is nylon sponge", "nylon"),
        ("the lid is kitchen oak", "kitchen"),
        ("lid: caste iron", "caste"),
        ("the lid is between 2 and 3 GPa", "range"),
        ("a silicon lid", "silicone"),
    ]:
        (said, *_) = clauses_of(text, ["lid"])["lid"]
        assert any(word in doubt for doubt in said.doubts), text
    (said,) = clauses_of("the lid is ABS plastic, steel St37 and 6061-T6 aluminium", ["lid"])["lid"]
    assert not said.doubts


def test_what_no_clause_takes_is_unread(table):
    for text, word in [("the seat is oak, E = 2", "E = 2"), ("the seat is oak, zorbly", "zorbly")]:
        assert word in parse(text, table, ["seat"]).unread, text


def test_a_number_is_a_grade_where_it_may_be_one(clauses_of, table):
    """A year, a part number and a ratio are none; without its metal a grade is told as a guess."""
    for text in (
        "the lid was designed in 2017",
        "a lid from 2014",
        "the lid, model 304",
        "lid: part number 7050",
        "the lid is rated 8.8",
    ):
        assert all(c.material is None for c in parse(text, table, ["lid"]).clauses), text
    assert any("'2017'" in note for note in parse("made in 2017", table, ["lid"]).notes)
    assert "8.8" in parse("the lid is rated 8.8", table, ["lid"]).unread
    for text in ("lid 6061", "the lid is 304", "lid: 2017"):
        (said,) = clauses_of(text, ["lid"])["lid"]
        assert said.material, text
        assert any("without its metal" in doubt for doubt in said.doubts), text
    for text in ("lid: 6061 aluminium", "lid bolt: 8.8", "lid: steel, class 8.8", "lid type 304"):
        for said in parse(text, table, ["lid", "lid bolt"]).clauses:
            assert said.material, text
            assert not said.doubts, text


def test_what_is_out_is_excluded(clauses_of, table):
    for text in ("the lid: steel is out, brass is in", "for the lid steel is out, brass is in"):
        (said,) = clauses_of(text, ["lid"])["lid"]
        assert said.material == "brass", text
        assert any("steel" in row for row in said.excluded), text
    for text in ("oak is gone", "oak is forbidden", "avoid oak", "the lid is rid of oak"):
        assert all(c.material is None for c in parse(text, table, ["lid"]).clauses), text
    (said,) = clauses_of("the lid is out of oak", ["lid"])["lid"]
    assert "oak" in said.material


def test_a_level_as_of_something_is_of_its_part(clauses_of):
    for text in ("the lid is as stiff as steel", "the lid is stiff as steel"):
        (said,) = clauses_of(text, ["lid", "seat"])["lid"]
        assert said.stiffness == 5, text


def test_what_a_number_of_a_steel_standard_says_is_no_guess(clauses_of):
    """1.4301 is no ratio and no length: EN 10027-2 numbers are told only where they are unknown."""
    (said,) = clauses_of("shaft 1.4301", ["shaft"])["shaft"]
    assert said.material
    assert not said.doubts


def test_a_strange_word_one_letter_off_from_a_matter_is_read_as_it_and_told(agree, table):
    agree("the gear is bras, the tap brasss => gear: brass; tap: brass")
    (said,) = parse("the gear is bras", table, ["gear"]).clauses
    assert any("'bras'" in doubt for doubt in said.doubts)


def test_a_request_in_the_form_of_a_question_leaves_nothing_open(clauses_of):
    for text, opened in [
        ("Could you make the lid oak, please?", False),
        ("can you set the lid to oak? thanks", False),
        ("Könnten Sie bitte den Deckel aus Eiche nehmen?", False),
        ("Could you tell me if the lid is oak?", True),
        ("is the lid oak?", True),
    ]:
        (said, *_) = clauses_of(text, ["lid"])["lid"]
        assert said.material, text
        assert any(note.kind == "reader.unsure" for note in said.doubts) == opened, text
