"""A kind of matter is told with the row that is taken for it."""

import autophyx_tet as apx
import pytest
from autophyx_tet.fem.mesh import TetMesh, box_mesh


@pytest.mark.parametrize(
    ("text", "taken"),
    [
        ("metal", "carbon steel"),  # aluminium is a third of it
        ("ceramic", "stoneware"),
        ("wooden", None),  # a generic row spans its kind
        ("steel", None),
    ],
)
def test_what_stands_for_a_kind_is_told(text, taken):
    box = box_mesh((1, 0.2, 0.2), (2, 1, 1))
    leg = TetMesh(box.points, box.tets, box.region, ("leg",))
    told = [line for line in apx.assign(leg, f"{text} leg").warnings if "kind of matter" in line]
    wanted = f"part 'leg': '{text}' is a kind of matter, taken as {taken}"
    assert told == ([wanted] if taken else [])
