"""A printed part weighs its solid skin and the cells inside it."""

import numpy as np
import pytest
from autophyx_tet.fem.mesh import TetMesh, box_mesh
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


def test_a_printed_bracket_weighs_what_a_slicer_says():
    """An angle of two legs 60 and 40 mm long, 10 mm thick, 30 mm wide; its inside is one too."""
    long, short, thick, wide, skin, infill = 0.06, 0.04, 0.01, 0.03, 1.2e-3, 0.2
    block = box_mesh((long, short, wide), (24, 16, 12))
    centre = block.points[block.tets].mean(axis=1)
    kept = (centre[:, 0] < thick) | (centre[:, 1] < thick)
    used, tets = np.unique(block.tets[kept], return_inverse=True)
    region = np.zeros(len(block.tets[kept]), dtype=np.int32)
    angle = TetMesh(block.points[used], tets.reshape(-1, 4), region, ("angle",))

    def area(inset):  # of the angle with all its sides moved inwards
        t = thick - 2 * inset
        return (long - 2 * inset) * t + (short - thick) * t

    inside = area(skin) * (wide - 2 * skin)
    rho = load_table().exact("PLA").value().rho
    by_hand = rho * (area(0.0) * wide - inside + infill * inside)
    found = assign(angle, "PLA, 20 % infill, 3 walls of .4 mm", options=WORDS)
    assert found.mesh.mass == pytest.approx(by_hand, rel=0.1)


@pytest.mark.parametrize(
    ("text", "sides", "rho"),
    [
        ("leaf", (0.4, 0.4, 0.4), (8, 30)),  # a crown
        ("leaf", (0.1, 0.1, 0.002), (700, 950)),  # a blade of a leaf
        ("straw", (0.9, 0.45, 0.35), (70, 140)),  # a bale
        ("horsehair", (0.1, 0.1, 0.05), (20, 80)),  # a stuffing
        ("oak", (0.4, 0.4, 0.4), (683, 750)),
    ],
)
def test_what_is_far_thicker_than_a_piece_is_many_of_them(text, sides, rho):
    found = assign(box_mesh(sides, (4, 4, 4)), text, options=WORDS)
    (choice,) = found.choices
    assert rho[0] <= choice.value.rho <= rho[1]
