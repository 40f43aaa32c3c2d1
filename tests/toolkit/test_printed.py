"""A printed part weighs its solid skin and the cells inside it."""

import pytest
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.fem.table import load_table
from autophyx_tet.toolkit.options import AssignOptions
from autophyx_tet.toolkit.pipeline import assign

SIDES = (0.08, 0.04, 0.02)  # m
WORDS = AssignOptions(cells=16, predictor="retrieval")


def sliced_mass(rho, skin, infill):
    """Mass [kg] of the box by hand: what is within the skin is solid, the rest a share of it."""
    inside = 1.0
    for side in SIDES:
        inside *= side - 2 * skin
    volume = SIDES[0] * SIDES[1] * SIDES[2]
    return rho * (volume - inside + infill * inside)


@pytest.mark.parametrize(
    ("text", "skin", "infill"),
    [
        ("PLA, 20 % infill, 3 walls of .4 mm", 1.2e-3, 0.2),
        ("printed in PLA, 4 perimeters, 30% gyroid infill", 1.6e-3, 0.3),
        ("PLA with 20% infill and 2 mm walls", 2e-3, 0.2),
        ("PLA at 20 % infill", 0.8e-3, 0.2),  # two lines and four layers, as slicers have it
    ],
)
def test_a_print_weighs_what_a_slicer_says(text, skin, infill):
    """Within 10 %; E lies between that of the cells alone and that of the solid."""
    found = assign(box_mesh(SIDES, (16, 8, 4)), text, options=WORDS)
    solid = load_table().exact("PLA").value()
    assert found.mesh.mass == pytest.approx(sliced_mass(solid.rho, skin, infill), rel=0.1)
    (choice,) = found.choices
    assert infill**2 * solid.E < choice.value.E < solid.E
    assert not any("slip" in str(check) for check in found.verdicts())
