"""The judge: the likeliest reading of a part is taken, and an unlikely one is a doubt."""

import pytest
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.text import tagger as judge
from autophyx_tet.predictors.text.clauses import Bound, BoundPart
from autophyx_tet.predictors.text.reader import read_sentence
from autophyx_tet.predictors.text.tagger import Said, Words, load_tagger, words_of

TABLE = load_table()
TEXT = "the legs are oak, the seat is soft foam; everything else is steel"
LABELS = [("seat",), ("leg_1",), ("back",)]
OAK, FOAM, STEEL = (TABLE.phrases[p].name for p in ("oak", "soft foam", "steel"))


def rows(bound):
    """Rows that the clauses of each part name."""
    return [{bound.sentence.clauses[k].material for k in part.clauses} for part in bound.parts]


def test_the_second_opinion_fills_what_the_grammar_leaves_and_keeps_the_rest():
    whole = read_sentence(TEXT, LABELS, TABLE)
    half = Bound(whole.sentence, (BoundPart(), *whole.parts[1:]), ())
    assert rows(judge.with_second_opinion(half, LABELS, TABLE)) == [{FOAM}, {OAK}, {STEEL}]
    assert judge.with_second_opinion(whole, LABELS, TABLE) == whole


@pytest.mark.parametrize(
    ("chances", "row", "doubted"),
    [
        ({"grammar": 0.99, "words": 0.2}, OAK, False),
        ({"grammar": 0.5, "words": 0.3}, OAK, True),
        ({"grammar": 0.2, "words": 0.9}, "brass", False),
        ({"grammar": 0.2, "words": 0.5}, "brass", True),
    ],
)
def test_the_likeliest_reading_is_taken_and_an_unlikely_one_is_a_doubt(
    monkeypatch, chances, row, doubted
):
    text = "the seat is oak, the leg is steel; brass"
    words = (Words("matter", text.index("brass"), len(text)),)
    matter = tuple(float(start == words[0].start) for start, _ in words_of(text))
    said = [Said(words, 0.9, matter=matter), Said((), 1.0, matter=(0.0,) * len(matter))]
    tagger = type("Fixed", (), {"said": lambda *_: said})()
    monkeypatch.setattr(judge, "load_tagger", lambda: tagger)
    fixed = type(
        "Judge", (), {"doubted": 0.7, "plain": 1.0, "chance": lambda _, r, __: chances.get(r, 0.0)}
    )()
    monkeypatch.setattr(judge, "load_judge", lambda: fixed)
    labels = [("seat",), ("leg",)]
    found = judge.with_second_opinion(read_sentence(text, labels, TABLE), labels, TABLE)
    assert rows(found)[0] == {row}
    (seat,) = (found.sentence.clauses[k] for k in found.parts[0].clauses)
    assert bool(seat.doubts) == doubted


@pytest.mark.parametrize(
    ("text", "parts", "factor"),
    [
        ("Bracket DC04. The dummy has ten times the stiffness of it.", "bracket dummy", 10),
        ("Klotz unten POM, der obere doppelt so steif wie der untere", "Klotz_unten Klotz_oben", 2),
        ("la plaque est en acier, la nervure deux fois moins raide", "plaque nervure", 0.5),
    ],
)  # fmt: skip
def test_a_relation_that_the_tagger_finds_is_read_by_its_words(text, parts, factor):
    """In German and French as in English."""
    labels = [[name] for name in parts.split()]
    bound = judge.with_second_opinion(read_sentence(text, labels, TABLE), labels, TABLE)
    relations = [r for k in bound.parts[1].clauses for r in bound.sentence.clauses[k].comparisons]
    assert [(r.measure, r.factor) for r in relations] == [("E", factor)]


def test_weights_are_of_facts_that_there_are():
    """None of a fact that was renamed; every reader has a chance."""
    bound = read_sentence(TEXT, LABELS, TABLE)
    said = load_tagger().said([own[0] for own in LABELS], TEXT)
    _, facts = judge.readings_of(0, bound, said, LABELS, TABLE)
    fitted = judge.load_judge()
    assert {*fitted.facts} == {*facts}
    assert all(0 < fitted.chance(reader, facts) < 1 for reader in judge.READERS)


def test_names_of_a_file_that_all_begin_alike_are_told_apart_by_the_rest():
    """No doubt about a plain sentence because of what an exporter writes before every name."""
    names = ["Cafe_chair_Cafe_chair_Aluminum frame", "Cafe_chair_Cafe_chair_Green_chair seat"]
    labels, text = [[name] for name in names], "a steel frame with an oak seat"
    bound = judge.with_second_opinion(read_sentence(text, labels, TABLE), labels, TABLE)
    assert rows(bound) == [{STEEL}, {OAK}]
    assert not any(clause.doubts for clause in bound.sentence.clauses)


def test_a_doubt_leaves_no_clause_behind_that_speaks_of_no_part(monkeypatch):
    """The clause that is doubted is the one that the part has, and no copy of it."""
    low = type("Judge", (), {"doubted": 0.7, "plain": 1.0, "chance": lambda *_: 0.5})()
    monkeypatch.setattr(judge, "load_judge", lambda: low)
    whole = read_sentence("the seat is oak, the leg is steel", LABELS[:2], TABLE)
    found = judge.with_second_opinion(whole, LABELS[:2], TABLE)
    assert len(found.sentence.clauses) == len(whole.sentence.clauses)
    assert all(clause.doubts for clause in found.sentence.clauses)


def test_clauses_of_parts_that_have_other_names_stay_for_the_network():
    """What no name binds is not put aside: "Aluminum" may be the frame."""
    labels = [["Aluminum"], ["Green_chair"]]
    whole = read_sentence("a rubber frame with a foam seat", labels, TABLE)
    found = judge.with_second_opinion(whole, labels, TABLE)
    assert found.unbound == whole.unbound
    assert len(found.sentence.clauses) == 2


@pytest.mark.parametrize(
    ("text", "names", "wanted"),
    [
        ("bracket petg, lid pla, knob abs", "bracket lid knob", "PETG; PLA; ABS"),
        ("cage Ti64; the zone is same alloy, 70 % porosity", "cage zone", "Ti-6Al-4V; Ti-6Al-4V"),
        ("Ressort 51CrV4 grenaillé ; butée en liège", "spring stop", "spring steel; cork"),
        ("servo horn nylon gf30, palm brass", "servo_horn palm", "nylon 6/6; brass"),
    ],
)
def test_words_of_a_part_are_read_as_its_text_is(text, names, wanted):
    """In its language, an acronym in small letters, and not where they point to another part."""
    labels = [[name] for name in names.split()]
    bound = judge.with_second_opinion(read_sentence(text, labels, TABLE), labels, TABLE)
    meant = [{TABLE.exact(row).name} for row in wanted.split("; ")]
    assert [{row for row in own if row} for own in rows(bound)] == meant


def told(text, names):
    """Kinds of the notes on each part's clauses."""
    labels = [[name] for name in names.split()]
    bound = judge.with_second_opinion(read_sentence(text, labels, TABLE), labels, TABLE)
    clauses = bound.sentence.clauses
    return [{d.kind for k in part.clauses for d in clauses[k].doubts} for part in bound.parts]


def test_the_matter_of_what_is_no_part_is_told_of_the_part_that_has_it():
    """And two matters of one part, wherever the first one is said too."""
    assert told("The gasket is graphite, the body is bronze.", "Body Seat")[1] == {
        "tagger.of_other"
    }
    text = "The lid is oak. The seat is oak. The seat is steel. The legs are pine."
    assert "reader.again" in told(text, "lid seat leg_1")[1]


def test_a_part_that_is_as_another_is_not_of_a_thirds_matter():
    labels = [[name] for name in ("Body", "Stem", "Lever", "Seat")]
    text = "Body same as stem. Stem: Inconel 718. Lever: brass. Seat: PTFE."
    bound = judge.with_second_opinion(read_sentence(text, labels, TABLE), labels, TABLE)
    assert rows(bound)[0] == {"Inconel 718"}


@pytest.mark.parametrize(
    ("text", "parts", "row"),
    [
        ("main hull veg tan, buckles brass; strap is cotton", "buckle flap strap", "veg tan"),
        ("the lid is oak; it was the knob he skimped on, that one is brass", "lid knob", "brass"),
        ("egg chocolate. The stand under it is not edible, its pewter", "egg egg_stand", "pewter"),
    ],
)  # fmt: skip
def test_what_is_given_to_all_and_heard_for_one_part_is_of_that_part(text, parts, row):
    """So no name of a part, and no network that sees its shape, overrules it."""
    labels = [[name] for name in parts.split()]
    bound = judge.with_second_opinion(read_sentence(text, labels, TABLE), labels, TABLE)
    assert {"name"} == {*bound.parts[1].how}
    assert rows(bound)[1] == {TABLE.phrases[row].name}


def test_a_second_matter_that_is_left_open_is_told():
    labels = [["body"], ["handle"]]
    text = "What is the body of, was it porcelain or the buff stoneware? The handle is bamboo."
    bound = judge.with_second_opinion(read_sentence(text, labels, TABLE), labels, TABLE)
    body, handle = ([bound.sentence.clauses[k] for k in part.clauses] for part in bound.parts)
    assert any("stoneware" in str(doubt) for clause in body for doubt in clause.doubts)
    assert not any(clause.doubts for clause in handle)


def test_numbers_of_parts_are_alike_with_and_without_noughts():
    """Of "layer_01" and "layer_02" the text's "01" and "02" are told apart."""
    labels = [["layer_01"], ["layer_02"], ["layer_03"]]
    text = "layer_01: gelcoat; layer_02: glass/polyester laminate; layer_03: balsa core"
    bound = judge.with_second_opinion(read_sentence(text, labels, TABLE), labels, TABLE)
    first, second, third = rows(bound)
    assert len(first | second | third) == len(first) + len(second) + len(third) == 3
