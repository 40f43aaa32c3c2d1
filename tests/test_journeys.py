"""The two journeys through the house: how long they are, and how often they come back."""

import importlib.util
import re
import sys

import pytest

# Stays in a file, and returns to one that had been left. A walk that grows beyond these has been
# cut into too many files, or hands its traveller through some that do nothing with it.
# Regime, buckling and vibrations ask the body of the rest, which has read E.
LIMITS = {"a sentence": (20, 8), "a modulus": (45, 20)}


@pytest.fixture(scope="module")
def journeys(root):
    spec = importlib.util.spec_from_file_location("journeys", root / "docs" / "journeys.py")
    module = sys.modules["journeys"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def walks(journeys):
    return {"a sentence": journeys.walk_of_a_sentence(), "a modulus": journeys.walk_of_a_modulus()}


@pytest.mark.slow  # every call of ours is looked at
@pytest.mark.parametrize("name", LIMITS)
def test_a_journey_is_short(walks, name):
    """A sentence from ``assign`` to the mesh, E from ``simulate`` to the report."""
    walk = walks[name]
    way = [stay.file for stay in walk.stays]
    assert len(way) > 10, f"{name} was lost sight of: {way}"
    stays, returns = LIMITS[name]
    assert len(way) <= stays, way
    assert walk.returns <= returns, way


def test_a_return_is_a_file_that_had_been_left(journeys, tmp_path, monkeypatch):
    """Two files that call each other: a, b, a is three stays and one return.

    Who is handed a holder is on the way only above one that is handed the value itself, and a
    property of the value is no stay.
    """
    (tmp_path / "fem").mkdir()
    sources = {
        "a": "def start(box):\n    first(box['E'])\n    size(box)\n\ndef last(E): E.doubled\n",
        "b": "def first(E): last(E)\n\ndef size(box): return len(box)\n",
        "c": "class Modulus:\n    @property\n    def doubled(self): return 2\n",
    }
    names = {}
    for name, source in sources.items():
        file = tmp_path / "fem" / f"{name}.py"
        exec(compile(source, file, "exec"), names)  # one namespace: no import among them
    monkeypatch.setattr(journeys, "HERE", tmp_path / "docs")
    journeys.file_of.cache_clear()
    modulus = names["Modulus"]()
    carries, holds = (lambda value: value is modulus), lambda value: isinstance(value, dict)
    with journeys.Walk(carries, holds) as walk:
        names["start"]({"E": modulus})
    journeys.file_of.cache_clear()
    way = [(stay.file, stay.functions) for stay in walk.stays]
    assert way == [("fem/a.py", ["start"]), ("fem/b.py", ["first"]), ("fem/a.py", ["last"])]
    assert walk.returns == 1


def test_the_page_names_only_files_that_exist(root):
    """Files and folders in backticks, of the prose and of both lists."""
    page = (root / "docs" / "architecture.md").read_text(encoding="utf-8")
    named = re.findall(r"`([\w/]+(?:\.py|/))`", page)
    assert len(named) > 30
    assert [name for name in named if "/" in name and not (root / name).exists()] == []
