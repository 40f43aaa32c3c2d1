"""Loads that a text speaks of are told, and set nothing; words of matter are no loads."""

import autophyx_tet as apx
import numpy as np
import pytest
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.fem.note import severity_of
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.text.lexing import without_loads


@pytest.mark.parametrize(
    ("text", "load"),
    [
        ("a beech chair, a 70 kg person sits on the seat", "70 kg person sits on the seat"),
        ("a steel chair with a 70 kg person on the seat", "70 kg person on the seat"),
        ("aluminium chair, the seat carries 700 N", "700 N"),
        ("aluminium chair, the seat carries 70 kg; legs steel", "carries 70 kg"),
        ("the trunk is oak dropped from 2 m", "dropped from 2 m"),
        ("steel legs; a strong wind of 30 m/s", "strong wind of 30 m/s"),
        ("an oak table with 50 kg on it", "50 kg on it"),
        ("a man sits on the bench, which is pine", "a man sits on the bench"),
        ("foam, pushed sideways at the top, soft", "pushed sideways at the top"),
        ("pine shelf under a load of 200 N", "load of 200 N"),
        ("oak, 1.5 kN on top", "1.5 kN on top"),
        ("a 70 kg person sits on it and the lid is foam", "70 kg person sits on it"),
    ],
)
def test_a_load_is_found_to_the_end_of_what_it_says(text, load):
    left, (told,) = without_loads(text)
    assert len(left) == len(text)
    assert told.startswith(repr(load))
    assert "--load" in told


@pytest.mark.parametrize(
    "text",
    [
        "pressed steel, drop forged hooks, a bronze statue of a man",
        "body CW617N, lens PMMA 8N, axle EA1N",
        "E = 200 N/mm2, density 700 kg/m3 on the seat, 25 kN/m3",
        "a jute sack holding 25 kg of rice",
        "2 kg of foam on the seat, legs of 3 kg",
        "a wind chime of brass, a child's chair of beech, a people carrier",
        "the legs stand on a concrete floor and are steel",
    ],
)
def test_matter_is_no_load(text):
    assert without_loads(text) == (text, [])


def test_a_load_is_told_once_and_no_part_is_missed_for_it():
    """Of "a 70 kg person" no part is asked for, and nothing weighs 70 kg."""
    box = box_mesh((1, 0.2, 0.2), (2, 1, 1))
    bench = TetMesh(box.points, box.tets, box.region, ("bench",))
    found = apx.assign(bench, "a beech bench, a 70 kg person sits on it")
    assert not any("no part was found" in line for line in found.warnings)
    assert sum("is a load" in line for line in found.warnings) == 1
    assert found.choices[0].value == load_table().exact("beech").value()


def test_matter_beside_a_load_is_missed_as_ever():
    """No part is a lid: that is told, though a load stands in the same words."""
    box = box_mesh((1, 0.2, 0.2), (2, 1, 1))
    two = TetMesh(box.points, box.tets, np.arange(len(box.tets)) % 2, ("bench", "leg"))
    found = apx.assign(two, "bench oak, leg oak, a 70 kg person sits on it and the lid is foam")
    assert any("'the lid is foam' is of no part" in line for line in found.warnings)


def test_a_load_and_a_strength_leave_no_doubt_of_the_matter():
    """They are told, and neither is in question: what a text sets is read without them."""
    box = box_mesh((1, 0.2, 0.2), (2, 1, 1))
    rod = TetMesh(box.points, box.tets, box.region, ("rod",))

    def doubts(text):
        found = apx.assign(rod, text)
        assert found.choices[0].row.name == "carbon steel", text
        lines = [line for line in found.warnings if "no asset" not in line]
        return [line for line in lines if severity_of(line) == "doubt"]

    assert not doubts("a steel rod, 355 MPa, it carries 400 N")
    assert not doubts("a steel rod, max 180 °C")
    assert doubts("a steel rod at 600 °C")
