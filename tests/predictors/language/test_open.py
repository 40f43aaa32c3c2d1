"""What a text leaves open, and what it takes back: by parts, in four languages."""

import pytest
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.text.clauses import corrected
from autophyx_tet.predictors.text.materials import lexicon_of
from autophyx_tet.predictors.text.reader import read_sentence
from autophyx_tet.predictors.text.relations import left_open
from autophyx_tet.predictors.text.tagger import with_second_opinion

TABLE = load_table()
LEXICON = lexicon_of(TABLE)


def heard(text, *names):
    labels = [[name] for name in names]
    return corrected(
        text, lambda said: with_second_opinion(read_sentence(said, labels, TABLE), labels, TABLE)
    )


def rows_of(bound):
    return [
        {bound.sentence.clauses[k].material for k in part.clauses} - {None} for part in bound.parts
    ]


@pytest.mark.parametrize(
    "said",
    [
        "no idea what the lid is", "lid: unknown", "the lid is some stuff, who knows",
        "nobody can say what the lid is made of", "lid to be confirmed", "lid as on the old model",
        "Deckel keine Ahnung", "Deckel noch offen", "le couvercle, aucune idée",
        "la tapa ni idea de qué es", "la tapa por definir", "the lid: ask the shop",
    ],
)  # fmt: skip
def test_a_part_may_be_left_open(said):
    """It is told by its name, and takes nothing on from what is said of others."""
    bound = heard(f"box oak, frame brass. {said}.", "lid", "box", "frame")
    rows = rows_of(bound)
    assert rows[0] == set()
    assert all(rows[1:])
    (note,) = [n for n in bound.sentence.notes if getattr(n, "kind", "") == "tagger.left_open"]
    assert note.values["part"] == "lid"


@pytest.mark.parametrize("joint", [" or ", ", or ", " (or "])
@pytest.mark.parametrize("other", ["brass", "45 GPa"])
def test_of_alternatives_the_first_is_taken_and_the_other_told(joint, other):
    """A number is one as a matter is: nothing of it is mixed into the first."""
    bound = heard(f"tray oak{joint}{other}{')' * ('(' in joint)}; lid steel", "tray", "lid")
    (clause,) = (bound.sentence.clauses[k] for k in bound.parts[0].clauses)
    assert (clause.material, clause.numbers) == (TABLE.exact("oak").name, ())
    assert [d.kind for d in clause.doubts] == ["lexing.one_of"]


@pytest.mark.parametrize(
    "text",
    [
        "the lid is oak, and we do not know its price",
        "delivery of the lid is open. Lid oak",
        "the lid is oak, the colour is unknown",
        "E of the lid is 2.0 GPa, its density unknown",
        "lid colour unknown, PC",
        "lid (thickness to be decided) of PC",
        "the lid is open, oak",
    ],
)
def test_what_is_open_is_not_always_the_matter(text):
    """Where a matter or a number of the part stands beside it or elsewhere, it keeps that."""
    bound = heard(f"box brass. {text}.", "lid", "box")
    assert bound.parts[0].clauses


def test_the_rest_may_be_left_open():
    """Parts of which nothing else is said."""
    labels, matters = [["lid"], ["box"], ["foot"]], [(4, 7)]
    text = "lid oak. About the rest nobody can tell."
    assert set(left_open(text, labels, [1, 2], matters, LEXICON)) == {1, 2}
    assert not left_open("lid oak. The rest is brass.", labels, [1, 2], matters, LEXICON)


@pytest.mark.parametrize(
    "text",
    [
        "seat brass, leg oak. Edit: the seat is cork",
        "seat = brass, leg = oak\nCORRECTION: seat cork",
        "leg oak, seat brass. Update after the test: seat is cork now",
        "seat brass; leg oak. Korrektur: seat Kork",
        "seat laiton, leg chêne. Rectificatif : seat liège",
    ],
)
def test_a_correction_replaces_what_was_said(text):
    """Of the parts that it names; the others keep theirs."""
    cork, oak = TABLE.exact("cork").name, TABLE.exact("oak").name
    assert rows_of(heard(text, "seat", "leg")) == [{cork}, {oak}]


def test_a_corrected_number_leaves_the_matter():
    bound = heard("seat oak, leg steel. Edit: seat density 700 kg/m3", "seat", "leg")
    assert rows_of(bound)[0] == {TABLE.exact("oak").name}
    numbers = [q for k in bound.parts[0].clauses for q in bound.sentence.clauses[k].numbers]
    assert [(q.measure, q.value) for q in numbers] == [("rho", 700.0)]


@pytest.mark.parametrize("said", ["all parts are steel", "everything is made of steel"])
def test_a_correction_of_all_parts_leaves_nothing_of_before(said):
    bound = heard(f"gear brass, shaft oak. Correction: {said}", "gear", "shaft")
    assert rows_of(bound) == [{"carbon steel"}] * 2
    assert {clause.material for clause in bound.sentence.clauses} == {"carbon steel"}


@pytest.mark.parametrize(
    "mark", ["Rev B:", "Revision 2:", "ECN 12:", "Change note:", "Change:", "Rev B (2024):"]
)
def test_a_revision_is_a_correction_and_what_only_compares_leaves_the_matter(mark):
    bound = heard(
        f"base steel; lids oak. {mark} lids now brass (was oak)", "base", "lid_1", "lid_2"
    )
    assert rows_of(bound) == [{"carbon steel"}, {"brass"}, {"brass"}]
    bound = heard(f"base steel; lid oak. {mark} lid 10 % lighter", "base", "lid")
    assert rows_of(bound) == [{"carbon steel"}, {TABLE.exact("oak").name}]


@pytest.mark.parametrize(
    "text",
    [
        "Rev C: base brass\nRev B: lid brass\nRev A: base steel, lid oak",  # the latest first
        "base brass, lid oak. Eco: base bamboo, lid oak",
        "base brass, lid oak. Edit: not everything is steel",
    ],
)
def test_what_is_no_correction_is_none(text):
    rows = rows_of(heard(text, "base", "lid"))
    assert "brass" in rows[0]
    assert TABLE.exact("oak").name in rows[1]


def test_of_several_corrections_the_last_holds():
    bound = heard("cap brass, pin oak. Edit: cap cork. Edit: the cap is copper", "cap", "pin")
    assert rows_of(bound) == [{"copper"}, {TABLE.exact("oak").name}]


def test_revisions_rise_by_number():
    bound = heard("cap brass, pin oak. Rev 9: cap cork. Rev 10: cap copper", "cap", "pin")
    assert rows_of(bound) == [{"copper"}, {TABLE.exact("oak").name}]


def test_a_correction_of_no_part_changes_nothing():
    text = "seat brass, leg oak. Edit: photos added, thanks all."
    assert rows_of(heard(text, "seat", "leg")) == [
        {TABLE.exact("brass").name}, {TABLE.exact("oak").name},
    ]  # fmt: skip


@pytest.mark.parametrize(
    "text",
    ["everything is plastic except the legs", "all steel apart from the legs",
     "steel everywhere, except for the legs"],
)  # fmt: skip
def test_what_is_excepted_is_not_of_what_it_is_excepted_from(text):
    bound = heard(text, "Tabletop", "Leg_1", "Leg_2")
    assert [bool(rows) for rows in rows_of(bound)] == [True, False, False]
