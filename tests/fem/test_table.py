"""Laws of the material table: complete, in its bands, and blind to no unit slip."""

import csv
import dataclasses
import itertools
import math
import re

import pytest
from autophyx_tet.fem.errors import InputError, UsageError
from autophyx_tet.fem.table import (
    CATEGORIES,
    CONTENTS_PATH,
    NU_CAP,
    TABLE_PATH,
    MaterialTable,
    Span,
    key,
    load_contents,
    load_table,
    outside_band,
)

TABLE, CONTENTS = load_table(), load_contents()
EVERYDAY = """steel iron metal oak pine wood rubber plastic glass ceramic pottery porcelain
terracotta soil earth dirt foliage leaves moss fabric cloth textile foam leather stone marble
concrete paper brass gold wicker cardboard wax sponge
 apple bread cork aluminium aluminum wooden""".split()

# Names: E [GPa]: density [kg/m^3], as the suppliers' data sheets print them.
GRADES = """
AISI 304,304,304 stainless steel,1.4301: 193: 8000
316L,AISI 316,316 stainless: 193: 8000
440C,1018,AISI 1045,4140,4340,52100: 205: 7800
A36,S235,S275,S355: 205: 7850
2024-T3,7075-T6: 72: 2800
5052,6061-T6,6082-T6,6063: 69.5: 2700
AlSi10Mg: 70: 2670
Ti-6Al-4V,Ti6Al4V: 114: 4430
Inconel 718,Inconel 625: 205: 8300
Hastelloy C-276: 205: 8890
C260: 110: 8530
C360: 97: 8500
zamak 3: 90: 6600
AZ31,AZ91: 45: 1790
tungsten carbide: 620: 14900
invar: 145: 8050
PEEK: 3.8: 1310
Delrin,POM: 2.9: 1415
PETG: 2.1: 1270
PA12: 1.5: 1020
PA66: 2.6: 1140
G10,FR4: 21: 1830
birch plywood: 9: 670
sugar maple: 12.6: 705
teak: 11.5: 640
"""
TYPED = """d2 steel,h13,spring steel,brass,bronze,phosphor bronze,zamak,hastelloy,pla,petg,abs,asa
pa6,nylon 6,nylon 12,pa6-gf30,uhmwpe,hdpe,ldpe,polypropylene,rigid pvc,soft pvc,polycarbonate,pmma
acrylic,plexiglass,ptfe,teflon,eps,xps,polyurethane,tpu,tpe,epdm,neoprene,nitrile,nbr,fkm,viton
silicone,natural rubber,latex,eva,memory foam,pe foam,cork,sorbothane,gel,balsa,ebony,mahogany
spruce,cedar,bamboo,rattan,wicker,plywood,softwood plywood,mdf,hdf,osb,chipboard,particle board
hardboard,kevlar,g10,carbon fibre,epoxy,fibreglass,drywall,plaster,brick,concrete,granite
sandstone,slate,terracotta,porcelain,stoneware,alumina,zirconia,soda-lime glass,borosilicate
tempered glass,suede,leather,cotton,wool,linen,silk,nylon fabric,polyester,felt,canvas,velvet,denim
paper,cardboard,corrugated cardboard,snow,ice,sand,gravel,clay,soil,loose soil,moist soil
potting soil,wax,soap,bone,cartilage,human skin,muscle,fat tissue,high impact polystyrene"""


def test_every_row_is_complete_and_says_where_it_comes_from():
    optional = {"note", "aliases", "estimated", "grade"}
    for path, table, count in ((TABLE_PATH, TABLE, 550), (CONTENTS_PATH, CONTENTS, 80)):
        with open(path, newline="") as file:
            records = list(csv.DictReader(file))
        assert len(records) == len(table) >= count
        for record in records:
            assert all(value for name, value in record.items() if name not in optional), record
            assert bool(record["estimated"]) == ("estimate" in record["source"]), record["name"]
            assert record.get("grade") in (None, "", "yes"), record["name"]


def test_value_is_geometric_in_E_and_rho_and_arithmetic_in_nu():
    for row in (*TABLE, *CONTENTS):
        value = row.value()
        assert math.isclose(value.E, math.sqrt(row.E.min * row.E.max), rel_tol=1e-12), row
        assert math.isclose(value.rho, math.sqrt(row.rho.min * row.rho.max), rel_tol=1e-12), row
        assert value.nu == min((row.nu.min + row.nu.max) / 2, NU_CAP) < 0.5, row
        assert math.isclose(row.value(0.0).E, row.E.min), row
        assert math.isclose(row.value(1.0).E, row.E.max), row
        assert not outside_band(row.category, *value), row


def _refusal(row) -> str:
    """What the table says of a row that it does not take; nothing where it takes it."""
    try:
        MaterialTable((row,))
    except InputError as error:
        return str(error)
    return ""


def test_a_unit_slip_in_E_is_rejected():
    """GPa or MPa taken as Pa, or the other way round, leaves the band of the category."""
    for row, factor in itertools.product((*TABLE, *CONTENTS), (1e-9, 1e-6, 1e-3, 1e3, 1e6, 1e9)):
        slipped = dataclasses.replace(row, E=Span(row.E.min * factor, row.E.max * factor))
        assert re.search(r"E = .* is outside", _refusal(slipped)), slipped


def test_a_unit_slip_in_rho_is_rejected():
    """A density in g/cm^3 taken as kg/m^3, or the other way round, leaves the band."""
    for row, factor in itertools.product((*TABLE, *CONTENTS), (1e-3, 1e3)):
        slipped = dataclasses.replace(row, rho=Span(row.rho.min * factor, row.rho.max * factor))
        assert "rho" in _refusal(slipped), slipped


def test_swapped_limits_impossible_nu_and_doubled_names_are_rejected():
    steel = TABLE.exact("steel")
    for bad in (
        {"E": Span(*reversed(steel.E))},
        {"nu": Span(0.3, 0.5)},
        {"nu": Span(0.3, 0.55)},
        {"nu": Span(0.27, math.nan)},
        {"E": Span(math.inf, math.inf)},
    ):
        with pytest.raises(InputError):
            MaterialTable((dataclasses.replace(steel, **bad),))
    rubber = TABLE.exact("rubber")
    with pytest.raises(InputError, match="nu"):
        MaterialTable((dataclasses.replace(rubber, nu=Span(0.45, 0.51)),))
    with pytest.raises(InputError, match="two materials"):
        MaterialTable((steel, steel))


def test_rubber_at_a_gigapascal_is_outside_its_band_though_plastic_may_have_it():
    assert outside_band("elastomer", 1e9, 0.48, 1000)
    assert not outside_band("plastic", 1e9, 0.4, 1000)
    assert len(outside_band("metal", 200, 0.6, 7.85)) == 3
    with pytest.raises(UsageError, match="plasma"):
        outside_band("plasma", 1, 0.1, 1)


def test_everyday_words_are_in_the_table_whatever_their_case():
    for word in EVERYDAY:
        assert TABLE.exact(word) is TABLE.exact(f"  {word.upper()} "), word


def test_words_mean_what_they_say():
    """Bare wood is along the grain, across only when asked; foams and rubbers come in levels."""
    assert TABLE.exact("oak").value().E > 10 * TABLE.exact("oak across the grain").value().E
    assert "along" in TABLE.exact("oak").name
    assert "across" not in TABLE.exact("pine").name
    # Foams of seats are told apart by 3 in published moduli, rubbers of 40 and 80 Shore A by 5
    for soft, stiff, times in [("soft foam", "firm foam", 3), ("soft rubber", "stiff rubber", 5)]:
        assert TABLE.exact(soft).value().E < TABLE.exact(stiff).value().E / times
    assert abs(TABLE.exact("steel").value().rho - 7850) < 10
    assert TABLE.exact("natural rubber") is TABLE.exact("rubber")


def test_grades_have_the_values_of_their_data_sheets():
    """E [GPa] and density [kg/m^3] as suppliers print them; 6 % covers their spread."""
    for line in GRADES.strip().splitlines():
        names, E, rho = line.split(":")
        for name in names.split(","):
            value = TABLE.exact(name).value()
            assert math.isclose(value.E, float(E) * 1e9, rel_tol=0.06), name
            assert math.isclose(value.rho, float(rho), rel_tol=0.06), name


def test_what_people_type_is_in_the_table():
    for name in TYPED.replace("\n", ",").split(","):
        assert TABLE.exact(name).name, name


def test_silicones_by_hardness_follow_gent():
    """E grows with Shore A as Gent's relation: 40 A is 1.7 MPa, 60 A 3.6 MPa, within 5 %."""
    stiffness = [TABLE.exact(f"silicone {s}a").value().E for s in range(10, 81, 10)]
    assert stiffness == sorted(stiffness)
    for shore, E in ((40, 1.69e6), (60, 3.61e6)):
        assert math.isclose(TABLE.exact(f"{shore} shore a rubber").value().E, E, rel_tol=0.05)


def test_words_of_everyday_speech_do_not_name_a_material():
    """Units, parts of things, hardness scales and contents would take sentences over."""
    for word in """pa shore durometer table plate pot cup bag lace hip hips psu coffee tea water
    milk oil rice beans flour salt toys clothes fat skin teeth""".split():
        assert key(word) not in TABLE.phrases, word


def test_contents_are_asked_for_by_word_and_stand_apart():
    """A litre weighs what a kitchen scale says: liquids 5 %, bulk 15 % (how it was poured)."""
    for word, rho, spread in (
        ("water", 1000, 0.05), ("milk", 1030, 0.05), ("olive oil", 915, 0.05),
        ("honey", 1420, 0.05), ("rice", 800, 0.15), ("flour", 560, 0.15), ("sugar", 850, 0.15),
        ("ground coffee", 350, 0.15), ("coffee beans", 370, 0.15), ("sand", 1600, 0.15),
        ("paper", 750, 0.15),
    ):  # fmt: skip
        assert math.isclose(CONTENTS.exact(word).value().rho, rho, rel_tol=spread), word
    assert all(row.name.endswith("(contents)") for row in CONTENTS)
    assert CONTENTS.exact("coffee") is CONTENTS.exact("ground coffee")


def test_unknown_names_get_a_hint_and_search_finds():
    with pytest.raises(UsageError, match=r"did you mean .*'steel'"):
        TABLE.exact("stele")
    assert TABLE.search("oak")[0] is TABLE.exact("oak")
    assert {row.category for row in TABLE.search("soft foam")} >= {"soft foam"}
    assert TABLE.search("") == list(TABLE.rows)
    assert TABLE.search("nothing of the kind") == []


def test_files_are_checked(tmp_path):
    with pytest.raises(InputError, match="cannot read"):
        load_table(tmp_path / "none.csv")
    text = TABLE_PATH.read_text().splitlines()
    (tmp_path / "blank.csv").write_text("\n".join([text[0], text[1].replace("6.9e+10", "", 1)]))
    with pytest.raises(InputError, match="line 2"):
        load_table(tmp_path / "blank.csv")
    (tmp_path / "empty.csv").write_text("")
    with pytest.raises(InputError, match="no column"):
        load_table(tmp_path / "empty.csv")


def test_every_category_has_rows_and_a_possible_band():
    assert {row.category for row in (*TABLE, *CONTENTS)} == set(CATEGORIES)
    assert not {row.category for row in TABLE} & {row.category for row in CONTENTS}
    for band in CATEGORIES.values():
        assert all(span.min < span.max for span in band)
