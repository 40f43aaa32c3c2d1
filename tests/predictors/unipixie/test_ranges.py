"""Ranges by what a thing is called, and the classes of matter of rows."""

import numpy as np
import pytest
import torch
from autophyx_tet.fem.mpm.materials import MaterialClass, class_of
from autophyx_tet.fem.table import load_contents, load_table
from autophyx_tet.predictors.field import DEFAULT
from autophyx_tet.research.datasets.parts import part_kinds
from autophyx_tet.research.datasets.ranges import RangeTable, build_range_table, name_things
from autophyx_tet.research.training.unipixie.names_on_device import rgb_of_lab


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("carbon steel", "METAL"), ("dry sand", "SAND"), ("honey", "FLUID"),
        ("toothpaste", "VISPLAS"), ("snow", "SNOW"), ("granite", "STATIONARY"),
        ("soft rubber", "JELLY"), ("oak", "JELLY"), ("mud", "VISPLAS"), ("rice", "SAND"),
    ],
)  # fmt: skip
def test_class_of_a_row(name, kind):
    table = load_contents() if name in ("honey", "toothpaste", "rice") else load_table()
    assert class_of(table.exact(name)) == MaterialClass[kind]


@pytest.fixture(scope="module")
def things():
    return list(dict.fromkeys(name_things(np.random.default_rng(0))))


def test_a_part_of_a_material_is_of_that_row(things):
    """A name with a material leaves one row, a bare part those of its kind."""
    kinds = list(part_kinds().values())
    for thing in things:
        bare = thing.kind >= 0 and thing.text in kinds[thing.kind].words
        assert len(thing.materials) == (len(kinds[thing.kind].materials) if bare else 1), thing


def test_no_held_out_part_is_named_in_another(things):
    """Words of the parts that training never sees stand in their own names alone."""
    kinds = list(part_kinds().values())
    held = {word for kind in kinds if kind.held_out for word in kind.words}
    for thing in things:
        if thing.kind >= 0 and not kinds[thing.kind].held_out:
            assert thing.text not in held


def test_a_file_gives_the_table_back(tmp_path):
    def embed(texts):
        return np.random.default_rng(0).normal(size=(len(texts), 384))

    table = build_range_table(embed)
    table.save(tmp_path / "ranges.safetensors")
    read = RangeTable.load(tmp_path / "ranges.safetensors")
    for name in ("embedding", "kind", "rows", "low", "high", "matter", "colour", "kind_rows"):
        np.testing.assert_array_equal(getattr(read, name), getattr(table, name))
    rows = [row.name for row in load_table()]
    steel = rows.index("carbon steel")
    low = DEFAULT.physical(table.low[steel])
    assert low[0] == pytest.approx(load_table().rows[steel].E.min, rel=1e-5)


@pytest.mark.parametrize(
    ("lab", "rgb"),
    [((100, 0, 0), (1, 1, 1)), ((0, 0, 0), (0, 0, 0)), ((53.2408, 80.0925, 67.2032), (1, 0, 0)),
     ((32.2970, 79.1875, -107.8602), (0, 0, 1))],
)  # fmt: skip
def test_colours_of_lab(lab, rgb):
    """White, black, and the primaries of sRGB, whose L*a*b* are known."""
    found = rgb_of_lab(torch.tensor(lab, dtype=torch.float32))
    torch.testing.assert_close(found, torch.tensor(rgb, dtype=torch.float32), atol=2e-3, rtol=0)
