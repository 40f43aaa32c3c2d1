"""The reader: sentences of many forms, each with the row that every part is said to be of."""

import importlib.util
import random
import re
import tomllib
from pathlib import Path

import pytest
from autophyx_tet.fem.errors import InputError, UsageError
from autophyx_tet.predictors.text.clauses import bind
from autophyx_tet.predictors.text.english import PACKAGE, load_model
from autophyx_tet.predictors.text.reader import LONGEST, parse

SENTENCES = Path(__file__).parents[3] / "benchmarks/data/sentences_tenth_trades.toml"


def test_a_sentence_with_a_verb_says_what_its_subject_is_of(agree):
    agree("""
        The door is oak and the knob is brass. => door: oak; knob: brass
        the mast is made of spruce, the boom was cut from ash => mast: spruce; boom: ash
        The drum's shell is birch. Its hoops are steel. => shell: birch; hoop_1, hoop_2: steel
        I carved the spoon out of cherry wood => spoon: cherry wood
        The gate, which my uncle built in the barn, is larch => gate: larch
        both shutters are made from pine => shutter_L, shutter_R: pine
    """)


def test_a_material_before_a_noun_is_its_matter(agree):
    agree("""
        a copper kettle with a cork stopper => kettle: copper; stopper: cork
        teak deck, bronze cleats and nylon rope => deck: teak; cleat_1: bronze; rope: nylon rope
        Stainless steel bowl on a walnut tray => bowl: stainless steel; tray: walnut
        granite counter and sink => counter, sink: granite
        wooden spokes, rubber tyre => spoke_1, spoke_2: wood; tyre: rubber
    """)


def test_a_list_without_verbs_is_read_in_pairs(agree):
    agree("""
        legs: steel; top: glass => leg_1, leg_2: steel; top: glass
        hull teak, mast spruce, keel lead => hull: teak; mast: spruce; keel: lead
        - body: brass\\n- valve: bronze\\n- gasket: EPDM => body: brass; valve: bronze; gasket: EPDM
        part | material\\nrim | aluminium\\nhub | steel => rim: aluminium; hub: steel
        RIM - ALUMINIUM / HUB - STEEL => rim: aluminium; hub: steel
        oak legs steel frame => leg: oak; frame: steel
        legs (oak), seat (leather) => leg: oak; seat: leather
        SM_Stem.001 brass; SM_Shade.002 silk => SM_Stem.001: brass; SM_Shade.002: silk
    """)


def test_a_coat_is_not_the_core(clauses_of, table):
    for text, part, core, coat in [
        ("the handle is chrome-plated brass", "handle", "brass", "chrome"),
        ("a seat of foam covered with leather", "seat", "foam", "leather"),
        ("gold-painted wooden base", "base", "wood", "gold"),
        ("walnut veneer on plywood for the door", None, "plywood", "walnut"),
        ("door: oak veneer on MDF", "door", "MDF", "oak"),
        ("the grip is aluminium wrapped in leather", "grip", "aluminium", "leather"),
    ]:
        said = clauses_of(text, [part or "door"])[part or "door"]
        assert said, text
        assert said[0].material == table.exact(core).name, text
        assert said[0].coating == table.exact(coat).name, text


def test_what_is_ruled_out_is_no_material(clauses_of, table):
    for text, row, out in [
        ("the hilt isn't wood, it's bronze", "bronze", "wood"),
        ("the hilt is not metal but horn", "horn", "metal"),
        ("hilt: brass instead of bronze", "brass", "bronze"),
        ("the hilt is made of oak rather than pine", "oak", "pine"),
        ("the hilt is steel-free: oak", "oak", "steel"),
        ("hilt: non-metallic, it is oak", "oak", "metal"),
    ]:
        (said, *_) = clauses_of(text, ["hilt"])["hilt"]
        assert said.material == table.exact(row).name, text
        assert {out, table.exact(out).name} & set(said.excluded), text


def test_levels_are_from_very_soft_to_very_stiff(clauses_of):
    for text, wanted in [
        ("the paw is very soft", 1),
        ("a soft paw", 2),
        ("the paw is rigid", 4),
        ("extremely stiff paw", 5),
        ("paw: squishy", 1),
        ("the paw should be rock hard", 5),
    ]:
        assert clauses_of(text, ["paw"])["paw"][0].stiffness == wanted, text


def test_columns_of_a_table_are_read(agree):
    agree("""
        1;1;hull;brass\\n2;4;mast;spruce => hull: brass; mast: spruce
        hull....brass\\nmast....spruce => hull: brass; mast: spruce
        part,material,qty\\nhull,brass,1\\nmast,spruce,1 => hull: brass; mast: spruce
    """)


def test_a_comparison_names_the_other_part(clauses_of):
    for text, measure, factor, exact in [
        ("the fin is twice as stiff as the hull", "E", 2.0, True),
        ("the fin is half as heavy as the hull", "rho", 0.5, True),
        ("the fin is 10x stiffer than the hull", "E", 10.0, True),
        ("the fin is three times softer than the hull", "E", 1 / 3, True),
        ("the fin is a bit softer than the hull", "E", 1 / 1.5, False),
        ("the fin is less stiff than the hull", "E", 0.5, False),
    ]:
        (said,) = clauses_of(text, ["fin", "hull"])["fin"][0].comparisons
        assert (said.measure, said.exact, said.other) == (measure, exact, ("hull",)), text
        assert said.factor == pytest.approx(factor), text


def test_the_same_as_another_is_of_its_matter(agree):
    agree("""
        the back is the same material as the seat, the seat is oak => back, seat: oak
        lid brass, base same => lid, base: brass
        the left ear is like the right ear; right ear felt => ear_L, ear_R: felt
    """)


def test_what_is_in_it_is_not_what_it_is_of(clauses_of, table):
    for text, row, filling in [
        ("a glass jar full of coffee", "glass", "coffee"),
        ("the jar is glass and holds water", "glass", "water (contents)"),
        ("steel jar filled with sand", "steel", "sand"),
        ("jar: clay, stuffed with books", "earthenware", "books (contents)"),
    ]:
        (said, *_) = clauses_of(text, ["jar"])["jar"]
        assert said.material == table.exact(row).name, text
        assert said.filling, text
        assert filling in said.filling, text
    (said, *_) = clauses_of("a bag of sand", ["bag"])["bag"]
    assert (said.material, said.filling) == (None, "sand (contents)")


def test_a_treatment_is_no_matter_of_its_own(clauses_of, table):
    for text, core, coat in [
        ("the blade is wood painted silver", "wood", "silver"),
        ("gold painted wooden blade", "wood", "gold"),
        ("blade: CW617N, chromed", "brass", None),
        ("a galvanised blade", "steel", None),
        ("an anodised blade", "aluminium", None),
        ("anodised titanium blade", "titanium", None),
    ]:
        (said, *_) = clauses_of(text, ["blade"])["blade"]
        assert said.material == table.exact(core).name, text
        assert said.coating == (coat and table.exact(coat).name), text


def test_what_a_whole_leaves_out_may_come_first(agree):
    agree("""
        Apart from the cap, which is cork, it's all glass. => cap: cork; neck, body: glass
        except for the cap, everything is steel => neck, body: steel; cap: -
        Except for the cap it is steel => neck, body: steel; cap: -
        not metal but oak => cap, body: oak
    """)


def test_an_old_material_gives_way_to_the_new(agree):
    agree("""
        cap: leather? no, vinyl => cap: vinyl
        cap: brass (was nylon); body: oak => cap: brass; body: oak
        the seat used to be steel, now it's oak => seat: oak
        handle: wood -> aluminium => handle: aluminium
        replace the steel of the hub with brass => hub: brass
        hub changed from brass to titanium => hub: titanium
        the hub was steel but is now brass => hub: brass
        we dropped the steel hub in favour of brass => hub: brass
        replaced the steel hub with a brass one => hub: brass
    """)


def test_a_range_of_parts_is_all_of_them(agree):
    agree("""
        fin_1 to fin_3: brass; fin_4: steel => fin_1, fin_2, fin_3: brass; fin_4: steel
        fin_1..fin_3 brass => fin_1, fin_2, fin_3: brass
        bodies 1-3 steel => Body1, Body2, Body3: steel
        wheel 1 is rubber and wheel 2 is steel => wheel_1: rubber; wheel_2: steel
    """)


def test_designations_of_standards_name_their_family(agree, table):
    for text, category in [
        ("X5CrNi18-10", "metal"), ("1.4571", "metal"), ("EN AW-6026", "metal"),
        ("S460ML", "metal"), ("CuZn37", "metal"), ("EN-GJS-600-3", "metal"), ("PP-H", "plastic"),
        ("C35/45", "glass-ceramic"), ("SCM440", "metal"), ("UNS S31603", "metal"),
        ("QT500-7", "metal"), ("2.1090", "metal"), ("3.4365", "metal"), ("X 20 Cr 13", "metal"),
        ("class 10.9", "metal"), ("EN AC-AlSi12", "metal"), ("20CrMnTi", "metal"), ("Cu", "metal"),
    ]:  # fmt: skip
        (said,) = parse(f"plate {text}", table, ["plate"]).clauses
        assert said.material, text
        assert table.exact(said.material).category == category, text


def test_a_part_that_is_called_after_a_material_is_read(table):
    for text in ("the soil is moist soil", "soil: sand; foliage: leaves", "soil: CuZn37+QT, M8"):
        assert parse(text, table, ["soil", "foliage"]).unread == (), text


def test_a_missing_model_is_named_with_the_line_that_installs_it(monkeypatch):
    load_model.cache_clear()
    monkeypatch.setattr("autophyx_tet.predictors.text.english.find_spec", lambda _: None)
    with pytest.raises(InputError, match=r"pip install .*en-core-web-sm"):
        load_model()
    monkeypatch.undo()
    load_model.cache_clear()


def test_tags_are_those_of_spacy():
    """Of every word of a set of sentences, signs and all."""
    import spacy

    package = importlib.util.find_spec(PACKAGE).submodule_search_locations[0]
    (folder,) = Path(package).glob("en_core_web_sm*")
    nlp = spacy.load(folder, exclude=["ner", "parser", "senter", "lemmatizer", "attribute_ruler"])
    model = load_model()
    sentences = tomllib.loads(SENTENCES.read_text(encoding="utf-8"))["sentence"]
    said = [re.findall(r"\w+|[^\w\s]", sentence["text"]) for sentence in sentences]
    ours = [model.tags(words) for words in said]
    theirs = [[t.tag_ for t in nlp(spacy.tokens.Doc(nlp.vocab, words=w))] for w in said]
    assert ours == theirs
    assert sum(map(len, said)) > 1000


@pytest.mark.slow
def test_no_text_is_too_odd(table):
    """Words in any order are read, and bound, without an error."""
    said = "oak the legs which are same as ( 2 GPa ) -> than : other except 's E 1..3 one of it"
    shuffle = random.Random(0).sample
    for _ in range(60):
        text = " ".join(shuffle(said.split(), 9))
        sentence = parse(text, table, ["leg_1", "seat"])
        assert len(bind(sentence, [["leg_1"], [""]]).parts) == 2, text


def test_a_book_is_refused(table):
    with pytest.raises(UsageError, match=str(LONGEST)):
        parse("oak " * LONGEST, table)


def test_the_first_phrase_says_what_the_object_is(table):
    """Up to a word that joins: neither a lid for a bottle nor what the can is full of."""
    rows = {
        "This is a metal can full of coffee.": "a metal can",
        "an empty glass bottle": "an empty glass bottle",
        "a lid for a bottle": "a lid",
        "a box made of steel": "made a box",
        "a painted steel drum": "a painted steel drum",
        "a steel drum painted red": "a steel drum",
        "an image of wine bottles": "wine bottle",
        "steel, like a car": "steel",
        "": "",
    }
    assert {text: " ".join(parse(text, table).thing) for text in rows} == rows


def test_what_a_thing_is_full_of_is_its_filling(table, clauses_of):
    """Of a can of beans the beans; a bottle of glass and a table of oak are made of it."""
    rows = {
        "a metal can full of ground coffee": "ground coffee (contents)",
        "a bottle of wine on a table": "wine (contents)",
        "a can of beans": "beans (contents)",
        "a bottle of glass": None,
        "a coffee table of oak": None,
        "a steel bolt": None,
    }
    found = {text: next(iter(parse(text, table).clauses)).filling for text in rows}
    assert found == rows


@pytest.mark.slow
def test_words_side_by_side_are_read_in_any_order_and_over_any_sign(agree):
    """Slashes list parts, commas stand in part names, the words of a row may be turned."""
    agree(r"""
        arms/legs: beech; seat: foam => arm_1, arm_2, leg: beech; seat: foam
        BODY, LOWER: PA12\nBODY, UPPER: ABS => body_lower: nylon 12; body_upper: ABS
        SEAT: PLYWOOD BIRCH; pad: foam PU => seat: birch plywood; pad: PU foam
        bezel PC+ABS => bezel: PC/ABS
        knobs on a drawer of pine => drawer: pine
        the bow is osage orange, the top gres => bow: osage orange; top: gres
    """)


def test_what_was_taken_away_is_not_what_is_there(agree):
    agree("""
        the steel seat is out, use oak => seat: oak
        the steel seat is gone => seat: -
        the steel seat was removed, the legs are oak => seat: -; leg: oak
    """)


def test_a_name_of_signs_alone_ends_no_reading(clauses_of):
    (said, *_) = clauses_of("1 wt% agarose seat 3", ["seat_3"])["seat_3"]
    assert "agarose" in said.material
