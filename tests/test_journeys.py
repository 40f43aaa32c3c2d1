"""The two journeys through the house: as docs/architecture.md tells them, not back and forth."""

import importlib.util
import sys

import pytest


@pytest.fixture(scope="module")
def journeys(root):
    spec = importlib.util.spec_from_file_location("journeys", root / "docs" / "journeys.py")
    module = sys.modules["journeys"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow  # every call of ours is looked at
def test_what_the_page_tells_is_what_happens(journeys, root):
    """A sentence and one E come back at most five times to a room that they had left.

    Rooms ask those below them and go on: the reader's four; solve, scene and discrete.
    """
    walks = {
        "a sentence": journeys.walk_of_a_sentence(),
        "a modulus": journeys.walk_of_a_modulus(),
    }
    for name, walk in walks.items():
        assert len(walk.stays) > 4, f"{name} was lost sight of"
        assert walk.returns <= 5, f"{name}: {[stay.room for stay in walk.stays]}"
    page = (root / "docs" / "architecture.md").read_text(encoding="utf-8")
    assert journeys.written(page, walks) == page, "run `python docs/journeys.py`"
