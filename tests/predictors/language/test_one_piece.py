"""What a text says of a thing in one piece: the matter of each of its nouns, and no other."""

from __future__ import annotations

from itertools import product

import pytest
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.regions.division import of_matters
from autophyx_tet.predictors.text.clauses import Clause
from autophyx_tet.predictors.text.one_piece import of_one_piece
from autophyx_tet.predictors.text.reader import read_sentence

LABELS = (("object",),)


def said(text: str) -> list[Clause]:
    table = load_table()
    bound = of_one_piece(read_sentence(text, LABELS, table), LABELS, table)
    return [clause for clause in bound.sentence.clauses if clause.says_matter]


def rows(text: str) -> list[tuple[set[str], str | None]]:
    """Heads of the parts, and the row, of each clause."""
    return [({name[-1] for name in c.subject.names}, c.material) for c in said(text)]


def row(word: str) -> str:
    return load_table().exact(word).name


FORMS = (
    "An old {thing} standing on {b} {q}, its {p} made of {a}.",
    "{thing}: {p} {a}; {q} {b}",
    "{thing} for sale, {a} {p} resting upon {b} {q}",
    "The {p} in {a}, the {q} in {b}: a {thing} for the porch.",
)
THINGS = (
    ("lectern", "slope", "walnut", "castors", "nylon"),
    ("birdbath", "basin", "granite", "pedestal", "concrete"),
    ("toboggan", "seat", "felt", "runners", "steel"),
    ("sundial", "plate", "brass", "column", "marble"),
)


@pytest.mark.parametrize(("form", "words"), [*product(FORMS, THINGS)])
def test_each_noun_has_its_matter(form, words):
    thing, p, a, q, b = words
    heard = rows(form.format(thing=thing, p=p, a=a, q=q, b=b))
    stem = {"castors": "castor", "runners": "runner"}.get(q, q)
    assert {material for _, material in heard} == {row(a), row(b)}
    assert any(p in heads and material == row(a) for heads, material in heard)
    assert any(stem in heads and material == row(b) for heads, material in heard)


@pytest.mark.parametrize("thing", ["fruit bowl", "bread basket", "eggs basket", "cheese plate"])
def test_what_a_thing_is_for_is_no_matter_of_it(thing):
    heard = rows(f"A {thing} with a copper rim and an oak foot.")
    assert {material for _, material in heard} == {row("copper"), row("oak")}


@pytest.mark.parametrize("place", ["ceiling", "harbour", "concert", "chapel"])
def test_a_word_that_the_dictionary_has_is_no_unknown_matter(place):
    heard = rows(f"Lamp of {place}, the shade is linen, the stem is brass.")
    assert [material for _, material in heard] == [row("linen"), row("brass")]


@pytest.mark.parametrize(
    ("word", "matter"), [("upholstery", "leather"), ("padding", "wool"), ("canopy", "nylon")]
)
def test_a_word_for_a_matter_may_be_a_part_of_another(word, matter):
    heard = rows(f"A pram with {word} in {matter} and a chassis of aluminium.")
    assert {material for _, material in heard} == {row(matter), row("aluminium")}


@pytest.mark.parametrize("way", ["wrapped in", "covered in", "clad in"])
def test_a_coat_is_what_one_sees(way):
    heard = rows(f"A drum whose shell is {way} leather, with hoops of brass.")
    assert {material for _, material in heard} == {row("leather"), row("brass")}


def test_joined_nouns_have_one_matter():
    heard = rows("Lid, spout and handle in pewter, a body of porcelain.")
    assert ({"lid", "spout", "handle"}, row("pewter")) in heard


def test_a_matter_that_the_grammar_gave_to_another_is_of_its_noun():
    heard = rows(
        "a buoy with a hull in fibreglass over a keel of lead, hanging from a chain of steel"
    )
    assert ({"chain"}, row("steel")) in heard


def test_one_matter_is_read_as_the_grammar_reads_it():
    table = load_table()
    bound = read_sentence("A duck made of rubber.", LABELS, table)
    assert of_one_piece(bound, LABELS, table).sentence.clauses == bound.sentence.clauses


# Texts of a thing of one matter {a}, beside one {b} that it touches, was or looks like.
BESIDE = (
    "{a}, turned from bar. Runs on a {b} pin, qty 24",
    "Looks like {b} in the photos; it is {a}.",
    "was {b} until last year, now {a}",
    "the thing is {a} and stands on a {b} floor that I did not scan",
    "Made of {a}; the {b} screws are not in this file.",
    "not {b}! {a}",
)


def test_a_thing_of_one_matter_is_not_divided():
    """A network decides: of things that it was not taught, six in seven."""
    table, right = load_table(), []
    pairs = (("brass", "steel"), ("PEEK", "stainless steel"), ("bronze", "limestone"))
    for text, (a, b), name in product(BESIDE, pairs, ("object", "roller", "SM_Statue_01")):
        words, labels = text.format(a=a, b=b), ((name,),)
        bound = of_one_piece(read_sentence(words, labels, table), labels, table)
        heard = {bound.sentence.clauses[k].material for k in bound.parts[0].clauses}
        right.append(not of_matters(bound.sentence) and heard - {None} == {row(a)})
    assert sum(right) >= 6 / 7 * len(right)


TWO = (
    ("chair", "chair legs are steel and the chair seat is oak", {"steel", "oak"}),
    ("cabinet", "front panel oak, back panel steel", {"oak", "steel"}),
    ("knife", "blade: steel; titanium handle", {"steel", "titanium"}),
    ("pen", "aluminium body, brass clip", {"aluminium", "brass"}),
    ("shoe", "rubber sole, leather upper", {"rubber", "leather"}),
    ("table", "oak and steel", {"oak", "steel"}),
)


@pytest.mark.parametrize(("name", "text", "matters"), TWO)
def test_parts_of_a_thing_with_a_name_are_divided(name, text, matters):
    table, labels = load_table(), ((name,),)
    sentence = of_one_piece(read_sentence(text, labels, table), labels, table).sentence
    heard = {sentence.clauses[k].material for k in of_matters(sentence)}
    assert heard == {row(matter) for matter in matters}


@pytest.mark.parametrize(
    ("name", "text", "matter"),
    [("bowl", "wooden fruit bowl", "wood"), ("basket", "wicker bread basket", "wicker"),
     ("bracket", "This bracket carries the motor. " * 48 + "It is PEEK.", "PEEK"),
     ("_".join(f"qx{k}" for k in range(800)), "steel", "steel")],
)  # fmt: skip
def test_the_only_matter_is_taken(name, text, matter):
    table, labels = load_table(), ((name,),)
    bound = of_one_piece(read_sentence(text, labels, table), labels, table)
    assert {bound.sentence.clauses[k].material for k in bound.parts[0].clauses} == {row(matter)}


def test_a_thing_beside_a_matter_is_not_of_it():
    (heard,) = said("twice as stiff as oak")
    assert heard.material is None
    assert heard.comparisons[0].factor == 2


def test_a_number_of_another_thing_is_not_its_own():
    table, labels = load_table(), (("actuator",),)
    text = "Ecoflex 00-30, E = 70 kPa. The floor has E = 30 GPa"
    bound = of_one_piece(read_sentence(text, labels, table), labels, table)
    clauses = [bound.sentence.clauses[k] for k in bound.parts[0].clauses]
    assert {n.value for clause in clauses for n in clause.numbers} == {70e3}


@pytest.mark.parametrize(
    "text", ["EN AC-46000 (AlSi9Cu3(Fe)), as cast", "CuBe2 (C17200) strip", "PA6, i.e. nylon 6"]
)
def test_two_designations_are_one_matter(text):
    table, labels = load_table(), (("bracket_v3",),)
    bound = of_one_piece(read_sentence(text, labels, table), labels, table)
    assert not of_matters(bound.sentence)
    assert {bound.sentence.clauses[k].material for k in bound.parts[0].clauses} - {None}


def test_numbers_of_another_sentence_are_of_the_only_part():
    table, labels = load_table(), (("actuator",),)
    text = "Ecoflex 00-30. We use E = 70 kPa and 1070 kg/m3 in the lab."
    bound = of_one_piece(read_sentence(text, labels, table), labels, table)
    heard = [bound.sentence.clauses[k] for k in bound.parts[0].clauses]
    assert {n.value for clause in heard for n in clause.numbers} == {70e3, 1070.0}


def test_numbers_of_a_part_stay():
    heard = said("A clamp: jaws of brass, the screw of steel with E = 190 GPa, pads 3 mm thick.")
    assert {n.value for clause in heard for n in clause.numbers} == {190e9}
    assert {clause.material for clause in heard} == {row("brass"), row("steel")}


def test_what_it_is_not_stays():
    heard = said("A barrow, no plastic: a tub of zinc, shafts of ash.")
    assert any(clause.excluded for clause in heard)
    assert {row("zinc"), row("ash")} <= {clause.material for clause in heard}


def test_what_is_soft_is_a_matter_all_the_same():
    """An adjective that the tagger takes for the matter of a noun that is one."""
    heard = rows("ceramic pot, oak trunk, soft leaves")
    assert {material for _, material in heard} == {row("ceramic"), row("oak"), row("leaves")}


@pytest.mark.parametrize("text", ["{}, {} and {}.", "Made of {}, {} and {}.", "{} / {} / {}"])
@pytest.mark.parametrize("matters", [("oak", "steel", "brass"), ("walnut", "glass", "leather")])
def test_in_a_list_of_matters_none_is_the_part_of_another(text, matters):
    assert rows(text.format(*matters)) == [(set(), row(matter)) for matter in matters]


def test_a_whole_keeps_its_exceptions():
    (whole, seat) = said("Everything but the seat is steel, the seat is oak.")
    assert whole.subject.scope == "whole"
    assert whole.subject.exceptions == (("seat",),)
    assert seat.subject.names == (("seat",),)


@pytest.mark.parametrize("text", ["The seat is very soft, the {}", "A soft seat, the {}"])
def test_what_is_only_soft_is_heard_too(text):
    heard = said(text.format("frame is steel, the legs are oak."))
    assert any(c.stiffness and c.subject.names == (("seat",),) for c in heard)


@pytest.mark.parametrize(
    "text", ["The {} of {} looks like {}.", "A {} of {} painted to look like {}"]
)
def test_a_part_has_one_matter(text):
    for thing, matter, other in (("bracket", "PLA", "steel"), ("mask", "paper", "bronze")):
        assert [heard for _, heard in rows(text.format(thing, matter, other))] == [row(matter)]


def test_parts_that_are_told_far_from_each_other_are_found():
    """Of a text of more tokens than the network sees at once."""
    idle = "It stood in the hall of my aunt for years and nobody ever sat on it. " * 30
    heard = rows(f"The frame of the bench is steel. {idle} Its cushion is leather.")
    assert ({"frame"}, row("steel")) in heard
    assert ({"cushion"}, row("leather")) in heard


def test_small_letters_are_no_other_matter():
    assert rows("The hull is abs, the mast is pc.") == rows("The hull is ABS, the mast is PC.")
    assert rows("windows glass, frame steel")[0] == ({"window"}, row("glass"))
