"""Texts as engineers write them: lists, tables, notes, changes; what stands around a matter."""

import pytest
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.resolve.resolve import Lookup
from autophyx_tet.predictors.text.reader import read_sentence

TABLE = load_table()
LOOKUP = Lookup(table=TABLE)


def read(parts, text):
    """Choices by part, and all that is told."""
    labels = [[name] for name in parts.split()]
    settled = LOOKUP.settle(labels, read_sentence(text, labels, TABLE))
    told = [*settled.warnings, *(line for choice in settled.choices for line in choice.warnings)]
    return {choice.part: choice for choice in settled.choices}, told


FORMS = {
    "1. housing EN AC-46000, 2 pcs\n2. shaft 42CrMo4 QT, 60 HRC": "housing shaft",
    "Item;Qty;Part;Material\n1;2;housing;EN AC-46000\n2;1;shaft;42CrMo4": "housing shaft",
    "part,material,qty\nhousing,EN AC-46000,1\nshaft,42CrMo4,1": "housing shaft",
    "| part | material |\n|---|---|\n| housing | EN AC-46000 |\n| shaft | 42CrMo4 |":
        "housing shaft",
    "housing    EN AC-46000    RAL 9005\nshaft      42CrMo4    nitrided": "housing shaft",
    "Pos. Qty Name Material Std\n10 1 housing EN AC-46000 EN 1706\n20 1 shaft 42CrMo4 EN 10083":
        "housing shaft",
    "NOTES: 1. MATERIAL housing: EN AC-46000. 2. DEBURR ALL EDGES. 3. shaft: 42CrMo4. "
    "4. TOLERANCES ISO 2768-mK": "housing shaft",
    "Please quote 50 pcs housing in EN AC-46000 T7 and 50 pcs shaft in 42CrMo4 by 2026-12-01, "
    "price target 12 EUR.": "housing shaft",
    "shaft: was C45, now 42CrMo4+QT; housing unchanged (EN AC-46000)": "housing shaft",
    "Change: shaft C45 -> 42CrMo4. Housing stays EN AC-46000.": "housing shaft",
    "housing;EN AC-46000\nshaft;42CrMo4": "housing shaft",
}  # fmt: skip


@pytest.mark.parametrize("text", FORMS)
def test_a_form_of_text_is_read(text):
    """The same two parts in every form, and nothing that would be a doubt."""
    found, told = read(FORMS[text], text)
    cast = "aluminium casting alloy" if "T7" in text else "aluminium A380 die casting"  # its kin
    assert found["housing"].row is TABLE.exact(cast)
    assert found["shaft"].row is TABLE.exact("AISI 4140 steel")
    assert not told


AROUND = [
    "RAL 7035", "12.50 EUR", "order no. 45-2231", "DIN 2098", "58-62 HRC", "Ra 1.6", "H7/g6",
    "M6x20", "Ø12", "±0.1 mm", "4 pcs", "+QT", "Rm 900-1100 MPa", "nitrided", "shot-peened",
    "deburr all edges", "bonded with Loctite 406", "2026-11-28", "ISO 2768-mK", "tig welded",
    "tensile strength 900 MPa",
]  # fmt: skip


@pytest.mark.parametrize("around", AROUND)
def test_what_stands_around_a_matter_says_nothing(around):
    """Neither another value nor a doubt."""
    bare, _ = read("shaft", "shaft: 42CrMo4")
    found, told = read("shaft", f"shaft: 42CrMo4, {around}")
    assert found["shaft"].value == bare["shaft"].value
    assert not told


@pytest.mark.parametrize(
    ("parts", "text", "told_of"),
    [
        ("seat legs", "the seat is oak or ash, the legs are steel", "'oak' or 'ash'"),
        ("leg", "a dry-rotted oak leg", "'dry-rotted'"),
        ("leg", "the leg is balsa, 2500 kg/m3", "2500 kg/m3"),
        ("core", "the core is bronze honeycomb 72 kg/m3", "72 kg/m3"),
        ("plate", "plate made of stuff from my attic", "attic"),
        ("plate", "the plate is vibranium", "vibranium"),
        ("lid", "Scatola in legno di noce, coperchio in ottone", "not read"),
    ],
)
def test_what_changes_a_matter_or_is_not_known_is_told(parts, text, told_of):
    """A wrong answer that looks sure is worse than none."""
    _, told = read(parts, text)
    assert any(told_of in line for line in told), told


def test_what_sinks_is_heavier_than_water_and_what_floats_lighter():
    """AutoPhyX's own sentences; the row keeps its modulus."""
    found, _ = read("block", "This is mahogany that might sink to the bottom")
    assert found["block"].value.rho > 1000
    assert found["block"].value.E == TABLE.exact("mahogany").value().E
    found, _ = read("block", "softwood that can float on water")
    assert found["block"].value.rho < 600


def test_a_bracket_behind_an_exception_is_of_what_is_excepted():
    found, told = read("body tires", "everything is aluminium except the tires (rubber)")
    assert found["body"].row is TABLE.exact("aluminium")
    assert found["tires"].row is TABLE.exact("rubber")
    assert not told


def test_a_wildcard_names_all_parts_that_begin_so():
    found, told = read("arm_link1 arm_link2 base", "arm_link*: EN AC-44300, base: GG25")
    assert {found["arm_link1"].row.name, found["arm_link2"].row.name} == {
        "aluminium casting alloy AlSi12"
    }
    assert found["base"].row is TABLE.exact("en-gjl-250")
    assert not told


@pytest.mark.parametrize(
    ("parts", "text"),
    [("spring_clip", "spring steel clip"), ("spring_clip", "the clip is spring steel")],
)
def test_the_name_of_the_file_is_not_against_the_text(parts, text):
    found, _ = read(parts, text)
    assert found[parts].row is TABLE.exact("spring steel")


def test_one_statement_of_a_thing_of_one_part_is_of_it():
    """Whatever the file is called: told, and not left to a network."""
    found, _ = read("finray", "The gripper finger is TPU 95A")
    assert found["finray"].row is TABLE.exact("TPU 95A")
    assert found["finray"].settled


LANGUAGES = [
    ("seat legs", "Die Sitzfläche ist aus massiver Eiche, die Beine sind aus Edelstahl"),
    ("seat legs", "Sitz: Eiche; Beine: Edelstahl"),
    ("sitz bein", "Das Bein besteht aus Edelstahl, der Sitz aus Eichenholz"),
    ("seat legs", "Alles aus Edelstahl außer dem Sitz, der ist aus Eiche"),
    ("seat legs", "l'assise est en chêne massif, les pieds sont en acier inoxydable"),
    ("seat legs", "Les pieds avant et arrière en inox et l'assise en bois de chêne"),
    ("seat legs", "el asiento es de roble y las patas son de acero inoxidable"),
    ("asiento pata", "pata de acero inoxidable, asiento de madera de roble"),
]


@pytest.mark.parametrize(("parts", "text"), LANGUAGES)
def test_german_french_and_spanish_are_read(parts, text):
    """The same chair in each; no word is half read."""
    found, told = read(parts, text)
    seat, legs = (found[name] for name in parts.split())
    assert seat.row is TABLE.exact("oak")
    assert legs.row is TABLE.exact("stainless steel")
    assert [line for line in told if "is read as" not in line] == []
    assert len(told) == 1


def test_a_language_that_is_not_read_says_nothing_of_any_part():
    found, told = read("lid box", "Scatola in legno di noce, coperchio in ottone")
    assert all(choice.guessed for choice in found.values())
    assert len([line for line in told if "language" in line]) == 1


IN_ORDER = [
    ("a_1 b_1 c_1", "The a_1, the b_1 and the c_1 are oak, steel and rubber respectively."),
    ("Body_1 Body_2 Body_3", "Body_1, Body_2 and Body_3 are oak, steel and rubber respectively."),
    ("roller_1 roller_2 roller_3", "The rollers 1, 2 and 3 are oak, steel and rubber respectively"),
    ("galet_1 galet_2 galet_3",
     "Les galets 1, 2 et 3 sont respectivement en chêne, en acier et en caoutchouc."),
    ("rodillo_1 rodillo_2 rodillo_3",
     "Los rodillos 1, 2 y 3 son de roble, acero y caucho, respectivamente."),
]  # fmt: skip


@pytest.mark.parametrize(("parts", "text"), IN_ORDER)
def test_three_in_their_order(parts, text):
    found, _ = read(parts, text)
    rows = [TABLE.phrases[word] for word in ("oak", "steel", "rubber")]
    assert [found[name].row for name in parts.split()] == rows


@pytest.mark.parametrize(
    ("name", "rho"),  # EN 10088-1, annex E: kg/dm3
    [("1.4112", 7.7), ("X46Cr13", 7.7), ("15-5PH H900", 7.8), ("S32205", 7.8), ("1.4462", 7.8)],
)
def test_stainless_steels_without_nickel_or_with_little_are_lighter(name, rho):
    found, told = read("rail", f"rail {name}")
    assert found["rail"].value.rho == pytest.approx(1000 * rho, rel=0.01)
    assert not told


INFILL = [
    "the grip is PLA, 20 % infill, 3 walls", "Griff aus PLA gedruckt, 20 % Füllung, 3 Wände",
    "le grip imprimé en PLA, remplissage 20 %, 3 parois",
    "grip impreso en PLA con 20 % de relleno y 3 perímetros",
]  # fmt: skip


@pytest.mark.parametrize("text", INFILL)
def test_infill_and_walls_of_a_print_in_four_languages(text):
    grip = "Griff" if "Griff" in text else "grip"
    found, _ = read(grip, text)
    whole, _ = read("grip", INFILL[0])
    assert found[grip].value == whole["grip"].value
    assert found[grip].value.rho < 0.6 * TABLE.exact("PLA").rho.min


def test_what_fills_a_thing_is_of_loose_matter():
    found, _ = read("filling lid", "the filling is sawdust, the lid is oak")
    assert found["filling"].row.name == "sawdust (contents)"
    assert found["filling"].unknown is None


def test_a_count_is_no_part_of_a_screws_name_and_a_piece_no_stucco():
    """ "4x" against "M8x40"; umlauts are tolerated, and "Stück" is not "Stuck"."""
    caps, screw = "04_Fusskappe", "05_ISO4762_M8x40"
    got, _ = read(f"{caps} {screw}", "Pos 4 Fußkappen PUR 90 ShA 4x / Pos 5 ISO 4762 M8x40 8.8 vz")
    assert got[caps].material == "thermoplastic polyurethane (TPU)"
    got, _ = read("claw_bowl liner", "Zitzengummi Silikon, Sammelstück ebenfalls PSU")
    assert "silicone" in (got["liner"].material or "")
    assert "plaster" not in {each.material for each in got.values()}
