"""What is said of a part against what else is said of it: told, and refused by --strict."""

from dataclasses import replace

import numpy as np
import pytest
from autophyx_tet.fem.errors import UsageError
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.toolkit.options import AssignOptions
from autophyx_tet.toolkit.pipeline import assign

TABLE = replace(
    box_mesh((1, 1, 1), (2, 1, 1)),
    region=np.repeat(np.arange(2, dtype=np.int32), 6),
    region_names=("top", "legs"),
)


def outcomes(result):
    return {check.outcome for check in result.verdicts() if check.name == "inside band"}


@pytest.mark.parametrize(
    "text", ["aluminium 6061-T6, E = 210 GPa", "copper, E = 210 GPa", "steel, density 2700 kg/m3"]
)
def test_numbers_of_another_matter_are_no_usual_ones(text):
    assert outcomes(assign(TABLE, text)) == {"doubtful"}
    with pytest.raises(UsageError, match="used as said"):
        assign(TABLE, text, options=AssignOptions(strict=True))


@pytest.mark.parametrize(
    "text", ["aluminium 6061-T6, E = 72 GPa", "steel, E = 200 GPa, density 7800 kg/m3"]
)
def test_numbers_of_the_matter_are(text):
    assert outcomes(assign(TABLE, text, options=AssignOptions(strict=True))) == {"passed"}


def test_what_is_excepted_is_named_by_nothing():
    text = "everything is plastic except the legs"
    assert any("nothing names the material of part 'legs'" in x for x in assign(TABLE, text).doubts)
    with pytest.raises(UsageError, match="legs"):
        assign(TABLE, text, options=AssignOptions(strict=True))


def test_what_is_said_of_a_part_that_is_not_there_is_a_doubt_where_another_takes_it():
    doubts = assign(TABLE, "the seat is leather and the armrests are foam").doubts
    assert sum("said of what no part is called after" in x for x in doubts) == 2
