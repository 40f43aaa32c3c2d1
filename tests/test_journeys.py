"""The two journeys through the house: not back and forth, and told of files that are there."""

import importlib.util
import re
import sys

import pytest


@pytest.fixture(scope="module")
def journeys(root):
    spec = importlib.util.spec_from_file_location("journeys", root / "docs" / "journeys.py")
    module = sys.modules["journeys"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow  # every call of ours is looked at
@pytest.mark.parametrize("walk", ["walk_of_a_sentence", "walk_of_a_modulus"])
def test_a_traveller_is_not_sent_back_and_forth(journeys, walk):
    """A sentence and one E come back at most five times to a room that they had left.

    Rooms ask those below them and go on.
    """
    found = getattr(journeys, walk)()
    assert len(found.stays) > 4, "lost sight of"
    assert found.returns <= 5, [stay.room for stay in found.stays]


def test_what_the_page_names_is_there(root):
    """Rooms and files of both lists are folders and files; else `python docs/journeys.py`."""
    page = (root / "docs" / "architecture.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\d+\. `([\w/.]+)`(?: \(again\))?(?:: (.*))?$", page, re.MULTILINE)
    assert len(rows) > 8
    named = [root / room / file for room, inside in rows for file in re.findall(r"`(.+?)`", inside)]
    assert not [path for path in [*named, *(root / room for room, _ in rows)] if not path.exists()]
