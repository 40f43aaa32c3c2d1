"""Designations of standards: each is of its family, by E and rho, however it is written.

The lists are written by rule or from what engineers name; none is copied from a table of a
standard. A family's bands are those of handbooks: E and rho differ by a few per cent inside it.
"""

import tomllib
from pathlib import Path

import pytest
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.resolve.resolve import Lookup
from autophyx_tet.predictors.text.reader import read_sentence

TABLE = load_table()
LOOKUP = Lookup(table=TABLE)

# Family -> E [GPa] and rho [kg/m^3] that its members have.
FAMILIES = {
    "steel": ((180, 220), (7650, 8160)),
    "stainless": ((185, 220), (7600, 8200)),
    "grey iron": ((66, 145), (6900, 7400)),
    "ductile iron": ((150, 185), (6900, 7400)),
    "malleable iron": ((150, 190), (7000, 7500)),
    "aluminium": ((66, 78), (2550, 2900)),
    "aluminium 6": ((67, 71), (2650, 2750)),
    "aluminium 5": ((68, 72.5), (2600, 2740)),
    "aluminium 2": ((70, 75), (2740, 2860)),
    "aluminium 7": ((69, 73.5), (2740, 2860)),
    "copper": ((110, 135), (8850, 9000)),
    "brass": ((90, 120), (8300, 8800)),
    "tin bronze": ((90, 122), (8650, 8950)),
    "aluminium bronze": ((100, 130), (7300, 7850)),
    "cupronickel": ((120, 165), (8800, 9000)),
    "nickel silver": ((115, 150), (8500, 8900)),
    "titanium": ((98, 120), (4400, 4850)),
    "nickel alloy": ((170, 225), (7900, 9300)),
    "magnesium": ((40, 48), (1700, 1870)),
    "zinc": ((70, 100), (4950, 7250)),  # ZA-27 has 27 % aluminium: 5.0 g/cm3
    "PE": ((0.1, 1.5), (900, 970)),
    "PP": ((0.9, 2.2), (885, 930)),
    "PA": ((0.8, 4.2), (930, 1190)),
    "PA glass": ((4, 20), (1180, 1700)),
    "PC": ((2.0, 2.6), (1180, 1230)),
    "POM": ((2.4, 3.5), (1380, 1440)),
    "PET": ((2.0, 3.8), (1290, 1420)),
    "PBT": ((2.0, 3.0), (1270, 1350)),
    "PBT glass": ((5, 14), (1380, 1700)),
    "ABS": ((1.6, 2.9), (1010, 1100)),
    "PMMA": ((2.2, 3.6), (1150, 1210)),
    "PVC": ((2.0, 4.2), (1300, 1500)),
    "soft PVC": ((0.001, 0.3), (1100, 1450)),
    "PS": ((1.5, 3.6), (1020, 1100)),
    "PTFE": ((0.3, 0.8), (2100, 2250)),
    "PEEK": ((3.2, 4.5), (1260, 1340)),
    "PPS": ((3.0, 4.5), (1300, 1400)),
    "PPS glass": ((9, 20), (1550, 2050)),
    "rubber": ((0.0005, 0.05), (850, 2000)),
    "hard rubber": ((0.003, 0.2), (850, 1950)),
    "CFRP": ((40, 330), (1400, 1700)),
    "GFRP": ((7, 50), (1400, 2200)),
    "foam": ((0.000005, 0.5), (10, 700)),
    "glass": ((50, 115), (2200, 4000)),
    "alumina": ((300, 420), (3600, 4000)),
    "zirconia": ((180, 230), (5600, 6150)),
    "silicon nitride": ((280, 330), (3100, 3350)),
    "silicon carbide": ((350, 450), (2950, 3250)),
    "tungsten carbide": ((450, 710), (13500, 15900)),
    "ferrite": ((100, 220), (4500, 5300)),
    "NdFeB": ((140, 175), (7300, 7700)),
    "SmCo": ((100, 190), (8000, 8600)),
    "concrete": ((20, 50), (2200, 2600)),
    "wood": ((4, 20), (300, 950)),
}


LISTS = tomllib.loads(Path(__file__).with_name("designations.toml").read_text(encoding="utf-8"))
NAMED = {family: " ".join(text.split()).split("; ") for family, text in LISTS.items()}


@pytest.mark.slow
@pytest.mark.parametrize("family", NAMED)
def test_a_designation_is_of_its_family(family):
    """Written after a part's name, as a parts list does it; no word of it is left unread."""
    (E_low, E_high), (rho_low, rho_high) = FAMILIES[family]
    wrong = [said for said in NAMED[family] if not _is_of(said, E_low, E_high, rho_low, rho_high)]
    assert not wrong


def _is_of(said, E_low, E_high, rho_low, rho_high):
    value = value_of(said)
    return (
        value is not None and E_low <= value.E / 1e9 <= E_high and rho_low <= value.rho <= rho_high
    )


def value_of(said):
    """E, nu and rho of a part that is said to be of it, None where the text is not understood."""
    labels = [["bracket"]]
    bound = read_sentence(f"bracket: {said}", labels, TABLE)
    (choice,) = LOOKUP.settle(labels, bound).choices
    return None if choice.guessed or choice.unknown else choice.value
