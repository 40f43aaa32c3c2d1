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
BANDS, MORE = (
    tomllib.loads(Path(__file__).with_name(f"{name}.toml").read_text(encoding="utf-8"))
    for name in ("handbooks", "handbooks_more")
)


@pytest.mark.parametrize(
    ("family", "step"),
    [
        *((name, 4) for name in BANDS),
        *(pytest.param(name, 6, marks=pytest.mark.slow) for name in MORE),
    ],
)
def test_a_name_gives_what_handbooks_give(family, step):
    """Each by itself, of the longer lists every sixth: ten thousand names take six minutes."""
    every = [
        (name, band) for names, band in (BANDS | MORE)[family].items() for name in names.split("; ")
    ]
    wrong = [
        f"{name}: {found}; wanted {band}"
        for name, band in every[::step]
        if (found := _outside(name, band))
    ]
    assert not wrong, "\n".join(wrong)


def _outside(name, band):
    """Row, E and rho of what a name gives, where they leave the band."""
    E_min, E_max, rho_min, rho_max = band
    language, name = name.split(": ") if ": " in name else ("en", name)
    parts, saying = SAYING[language]
    labels = [[part] for part in parts]
    bound = read_sentence(saying.format(name), labels, TABLE)
    choice = LOOKUP.settle(labels, bound).choices[0]
    E, rho = choice.value.E / 1e9, choice.value.rho
    if E_min <= E <= E_max and rho_min <= rho <= rho_max:
        return None
    return f"{choice.row.name}: {E:.4g} GPa, {rho:.0f} kg/m^3"
