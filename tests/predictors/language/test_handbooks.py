"""Names that engineers, trades and makers use give E and rho inside the bands of handbooks."""

import tomllib
from pathlib import Path

import pytest
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.resolve.resolve import Lookup
from autophyx_tet.predictors.text.reader import read_sentence

TABLE = load_table()
LOOKUP = Lookup(table=TABLE)
# How a part is said to be of a matter: the parts, and a sentence, long enough to tell its language.
SAYING = {
    "en": (["part"], "the part is {}"),
    "de": (["Teil", "Deckel"], "das Teil ist aus {} und der Deckel ist aus Stahl"),
    "fr": (["piece", "couvercle"], "la pièce est en {} et le couvercle est en acier"),
    "es": (["pieza", "tapa"], "la pieza es de {} y la tapa es de acero"),
}
BANDS = tomllib.loads(Path(__file__).with_name("handbooks.toml").read_text())
NAMES = [
    pytest.param(name, band, id=name)
    for of_kind in BANDS.values()
    for names, band in of_kind.items()
    for name in names.split("; ")
]


@pytest.mark.parametrize(("name", "band"), NAMES)
def test_a_name_gives_what_handbooks_give(name, band):
    E_min, E_max, rho_min, rho_max = band
    language, name = name.split(": ") if ": " in name else ("en", name)
    parts, saying = SAYING[language]
    labels = [[part] for part in parts]
    bound = read_sentence(saying.format(name), labels, TABLE)
    choice = LOOKUP.settle(labels, bound).choices[0]
    found = f"{choice.row.name}: {choice.value.E / 1e9:.4g} GPa, {choice.value.rho:.0f} kg/m^3"
    assert E_min <= choice.value.E / 1e9 <= E_max, found
    assert rho_min <= choice.value.rho <= rho_max, found
