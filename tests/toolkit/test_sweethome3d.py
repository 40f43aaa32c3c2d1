"""The one door to the furniture package opens three archives and no other."""

import re

import pytest
from autophyx_tet.fem.errors import UsageError
from autophyx_tet.research.datasets import sweethome3d

HIDDEN = ["BlendSwap-CC-" + "BY", "Real" + "lusion"]  # split, so that this file does not match


def test_the_hidden_sources_are_refused():
    for source in HIDDEN:
        for door in (sweethome3d.catalog, sweethome3d._open):
            with pytest.raises((UsageError, TypeError)):
                door(source)


def test_no_other_file_names_the_archives(root):
    """Neither the hidden sources nor the archive suffix stands anywhere else in the project."""
    suffix = ".sh" + "3f"
    allowed = {root / "research/datasets/sweethome3d.py"}
    rooms = ("fem", "predictors", "converters", "toolkit", "research", "tests", "benchmarks")
    for room in rooms:
        for path in (root / room).rglob("*.py"):
            text = path.read_text()
            assert not any(name in text for name in HIDDEN), path
            assert path in allowed or suffix not in text, path


def test_training_and_validation_are_disjoint():
    assert set(sweethome3d.TRAINING) | set(sweethome3d.VALIDATION) == set(sweethome3d.SOURCES)
    assert not set(sweethome3d.TRAINING) & set(sweethome3d.VALIDATION)


@pytest.mark.real
def test_catalog_has_objects_with_real_sizes(tmp_path):
    """90 objects of the validation source and more of the others, each a few cm to some metres."""
    for source in sweethome3d.SOURCES:
        items = sweethome3d.catalog(source)
        assert len(items) >= 80
        assert all(0.005 < max(item.size) < 60 for item in items)
    item = next(i for i in sweethome3d.catalog("KatorLegaz") if i.key.endswith("cafe-chair"))
    obj = sweethome3d.extract(item, tmp_path)
    assert re.search(r"^usemtl ", obj.read_text(), re.M)
