"""The reader: sentences of many forms, each with the row that every part is said to be of."""

import random
import time

import pytest
from autophyx_tet.fem.errors import InputError, UsageError
from autophyx_tet.predictors.language.binding import bind
from autophyx_tet.predictors.language.model import load_model
from autophyx_tet.predictors.language.reader import LONGEST, parse


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
        teak deck, bronze cleats and nylon rope => deck: teak; cleat_1: bronze; rope: nylon
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
    ]:
        (said, *_) = clauses_of(text, ["hilt"])["hilt"]
        assert said.material == table.exact(row).name, text
        assert {out, table.exact(out).name} & set(said.excluded), text


def test_numbers_are_si(clauses_of):
    for text, wanted in [
        ("plate: E = 70 GPa, nu = 0.33, density 2.7 g/cm3", {"E": 70e9, "nu": 0.33, "rho": 2700.0}),
        ("the plate has a Young's modulus of 2,5 MPa", {"E": 2.5e6}),
        ("plate rubber 62 Shore A", {"shore_a": 62.0}),
        ("the plate is oak and weighs 1.2 kg", {"mass": 1.2}),
        ("plate: PLA, 20 % infill", {"infill": 0.2}),
        ("plate modulus 10 ksi, rho 62.428 lb/ft3", {"E": 68.947572932e6, "rho": 1000.0}),
    ]:
        (said, *_) = clauses_of(text, ["plate"])["plate"]
        read = {q.measure: q.value for q in said.numbers}
        assert read == pytest.approx(wanted, rel=1e-5), text  # 62.428 is rounded at 1e-5


def test_a_number_is_read_in_every_notation(clauses_of):
    """One value each, as it is written by many hands; the unit's dimension says what it is."""
    written = {
        ("E", 2e9): """
            E=2 GPa | E ~ 2e9 Pa | modulus 2,000 MPa | E-modulus of 2.0 GPa | E: 2000 N/mm² |
            2 kN/mm2 | Young's modulus is about 2 gigapascals | 2e9 N/m^2 |
            elastic modulus 2 000 MPa | E = 2·10⁹ Pa | tensile modulus: 2x10^3 MPa | Ex = 2 GPa |
            flexural modulus 290.0754754 ksi | 2 GPa modulus | stiffness approx. 2 Gpa | E=2E9 |
            E = 20394.32425 kgf/cm2""",
        ("rho", 7850.0): """
            density 7.85 g/cm³ | ρ = 7.85 g/cc | rho=7850 kg/m3 | 7.85 kg/dm³ | 7.85 t/m3 |
            7850 kg/m^3 | 7.85 kg/l | 490.0594885 lb/ft³ | 490.0594885 pcf |
            0.2835991256 lb/in3 | 7850 kg per cubic metre | 7.85 g·cm⁻³ | 7850 kg m-3 |
            rho = 7850 | density of 7,850 kg/m³ | 490.0594885 pounds per cubic foot""",
        ("nu", 0.4): """
            nu=0.4 | ν = .4 | Poisson's ratio 0.40 | poisson ratio of 0,4 | v=0.4 | Poisson 0.4 |
            nu 0.4""",
        ("mass", 0.35): """
            weighs 350 g | mass 0.35 kg | weight: 350 grams | 0.77161791765 lb heavy |
            weighing 350g""",
        ("thickness", 0.003): """
            3 mm thick | thickness: 3mm | 3 mm walls | wall thickness of 0.3 cm | 3mm wall""",
        ("infill", 0.1): """
            10 % infill | infill 10% | infill: 10 percent | 10% gyroid infill""",
        ("shore_a", 60.0): """
            60A | Shore 60 | shore A 60 | 60 Shore A | Shore hardness 60A | durometer 60A |
            60 ShA | 60 duro | 60° Shore A | 60 durometer | Shore-A 60 | 60 A Shore |
            hardness of 60 Shore A | Shore A hardness of 60 | IRHD 60 | 60 sh A | 60a""",
        ("shore_d", 70.0): """
            Shore D 70 | 70D | 70 Shore D | Shore 70D | durometer D 70 | Shore-D: 70""",
    }
    wrong = []
    for (measure, value), texts in written.items():
        for said in map(str.strip, texts.split("|")):
            clauses = clauses_of(f"plate: rubber, {said}", ["plate"])["plate"]
            read = [(q.measure, pytest.approx(q.value)) for c in clauses for q in c.numbers]
            wrong += [] if read == [(measure, value)] else [(said, read)]
    assert not wrong


def test_what_is_no_modulus_is_not_taken_for_one(clauses_of):
    for said in (
        "shear modulus 80 GPa", "bulk modulus 160 GPa", "yield strength 250 MPa",
        "hardness 55 HRC", "section modulus 3 cm3", "pressure of 3 bar", "M8 x 20",
    ):  # fmt: skip
        for clause in clauses_of(f"the plate is steel, {said}", ["plate"])["plate"]:
            assert not clause.numbers, said


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


def test_what_nobody_knows_is_told_with_its_nearest_rows(clauses_of):
    for text in ("the pot is made of unobtainium", "pot: blargite", "the pot is zorbium"):
        (said, *_) = clauses_of(text, ["pot"])["pot"]
        assert said.material is None, text
        assert said.unknown, text
        assert len(said.nearest) == 3, text


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
        "Die Platte besteht aus Eichenholz und Stahlrohr",
        "asiento de madera y patas de hierro forjado",
    ):
        assert any("not English" in note for note in parse(text, table).notes), text


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
        ("jar: clay, stuffed with books", "clay", "books (contents)"),
    ]:
        (said, *_) = clauses_of(text, ["jar"])["jar"]
        assert said.material == table.exact(row).name, text
        assert said.filling, text
        assert filling in said.filling, text
    (said, *_) = clauses_of("a bag of sand", ["bag"])["bag"]
    assert (said.material, said.filling) == (None, "sand (contents)")


def test_an_old_material_gives_way_to_the_new(agree):
    agree("""
        the seat used to be steel, now it's oak => seat: oak
        handle: wood -> aluminium => handle: aluminium
        replace the steel of the hub with brass => hub: brass
        hub changed from brass to titanium => hub: titanium
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
        ("C35/45", "glass-ceramic"),
    ]:  # fmt: skip
        (said,) = parse(f"plate {text}", table, ["plate"]).clauses
        assert said.material, text
        assert table.exact(said.material).category == category, text


def test_a_part_that_is_called_after_a_material_is_read(table):
    for text in ("the soil is moist soil", "soil: sand; foliage: leaves"):
        assert parse(text, table, ["soil", "foliage"]).unread == (), text


def test_what_no_clause_takes_is_unread(table):
    for text, word in [
        ("the seat is oak, yield 250 MPa", "yield 250 MPa"),
        ("the seat is oak, E = 2", "E = 2"),
        ("the seat is oak, zorbly", "zorbly"),
    ]:
        assert word in parse(text, table, ["seat"]).unread, text


def test_a_missing_model_is_named_with_the_line_that_installs_it(monkeypatch):
    load_model.cache_clear()
    monkeypatch.setattr("autophyx_tet.predictors.language.model.find_spec", lambda _: None)
    with pytest.raises(InputError, match=r"pip install .*en-core-web-sm"):
        load_model()
    monkeypatch.undo()
    load_model.cache_clear()


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


def test_reading_takes_less_than_a_frame(table):
    """20 ms of CPU a sentence, warm; a busy machine may take five times as long."""
    text = "The seat is soft foam covered with leather, the legs are stainless steel tube."
    parse(text, table)
    start = time.process_time()
    for _ in range(5):
        parse(text, table)
    assert (time.process_time() - start) / 5 < 0.1


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
