"""Laws of the material table: complete, in its bands, and blind to no unit slip."""

import csv
import dataclasses
import itertools
import math
import re

import pytest
from autophyx_tet.fem.errors import InputError, UsageError
from autophyx_tet.fem.scene.materials import (
    CATEGORIES,
    NU_CAP,
    TABLE_PATH,
    MaterialTable,
    Span,
    load_table,
    outside_band,
)

TABLE = load_table()
EVERYDAY = """steel iron metal oak pine wood rubber plastic glass ceramic pottery porcelain
terracotta soil earth dirt foliage leaves moss fabric cloth textile foam leather stone marble
concrete paper brass gold wicker cardboard wax sponge
 apple bread cork aluminium aluminum wooden""".split()


def test_every_row_is_complete_and_says_where_it_comes_from():
    with open(TABLE_PATH, newline="") as file:
        records = list(csv.DictReader(file))
    assert len(records) == len(TABLE) >= 180
    for record in records:
        optional = {"note", "aliases", "estimated"}
        assert all(value for name, value in record.items() if name not in optional), record
        assert bool(record["estimated"]) == ("estimate" in record["source"]), record["name"]


def test_value_is_geometric_in_E_and_rho_and_arithmetic_in_nu():
    for row in TABLE:
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
    for row, factor in itertools.product(TABLE, (1e-9, 1e-6, 1e-3, 1e3, 1e6, 1e9)):
        slipped = dataclasses.replace(row, E=Span(row.E.min * factor, row.E.max * factor))
        assert re.search(r"E = .* is outside", _refusal(slipped)), slipped


def test_a_unit_slip_in_rho_is_rejected():
    """A density in g/cm^3 taken as kg/m^3, or the other way round, leaves the band."""
    for row, factor in itertools.product(TABLE, (1e-3, 1e3)):
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
    for soft, stiff in [("soft foam", "firm foam"), ("soft rubber", "stiff rubber")]:
        assert TABLE.exact(soft).value().E < TABLE.exact(stiff).value().E / 5
    assert abs(TABLE.exact("steel").value().rho - 7875) < 10
    assert TABLE.exact("natural rubber") is TABLE.exact("rubber")


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
    (tmp_path / "blank.csv").write_text("\n".join([text[0], text[1].replace("7e+10", "", 1)]))
    with pytest.raises(InputError, match="line 2"):
        load_table(tmp_path / "blank.csv")
    (tmp_path / "empty.csv").write_text("")
    with pytest.raises(InputError, match="no column"):
        load_table(tmp_path / "empty.csv")


def test_every_category_has_rows_and_a_possible_band():
    assert {row.category for row in TABLE} == set(CATEGORIES)
    for band in CATEGORIES.values():
        assert all(span.min < span.max for span in band)
