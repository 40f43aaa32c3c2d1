"""The four faces of the package: every public name is on its page and says what it takes."""

import doctest
import inspect
import re
from importlib import import_module

import pytest

FACES = ("autophyx_tet", *(f"autophyx_tet.{room}" for room in ("fem", "converters", "predictors")))
NAMES = [(face, name) for face in FACES for name in import_module(face).__all__ if name[0] != "_"]
DEFINED = {f"{face}.{name}": getattr(import_module(face), name) for face, name in NAMES}
# What two faces share is looked at once.
OWN = {id(what): (name, what) for name, what in reversed(DEFINED.items())}
FUNCTIONS = [one for one in OWN.values() if inspect.isroutine(inspect.unwrap(one[1]))]
UNIT = re.compile(
    r"\[(1/)?(1|m|m\^2|m\^3|s|Hz|kg|N|Pa|J|px|rad|deg|bytes)([ /(].*)?\]"  # SI, 1, pixels and bytes
)
# What has no quantity: words, files and counts.
WITHOUT_UNIT = {
    "autophyx_tet.run", "autophyx_tet.batch", "autophyx_tet.train", "autophyx_tet.evaluate",
    "autophyx_tet.show_report", "autophyx_tet.catalog", "autophyx_tet.extract",
    "autophyx_tet.predictors.count_parameters", "autophyx_tet.asset_panel",
}  # fmt: skip
# What takes minutes, a notebook, a download or another program to show.
WITHOUT_EXAMPLE = {
    "autophyx_tet.run", "autophyx_tet.batch", "autophyx_tet.train", "autophyx_tet.evaluate",
    "autophyx_tet.show_report", "autophyx_tet.catalog", "autophyx_tet.extract",
    "autophyx_tet.features", "autophyx_tet.match", "autophyx_tet.doctor",
    "autophyx_tet.asset_panel", "autophyx_tet.story", "autophyx_tet.render_png",
    "autophyx_tet.render_animation", "autophyx_tet.converters.splat_view",
}  # fmt: skip


def doc_of(what) -> str:
    return inspect.getdoc(what) or ""


def section(what, title) -> str:
    """Text under a heading of numpy's style."""
    found = re.search(rf"^{title}\n-+\n(.*?)(?=^\S[^\n]*\n-+$|\Z)", doc_of(what), re.M | re.S)
    return found[1] if found else ""


def test_the_page_of_python_has_every_public_name_and_no_other(root):
    """By the names that a user types; what two faces share stands there once."""
    page = (root / "docs" / "python.md").read_text()
    shown = re.findall(r"^::: (\S+)$", page, re.MULTILINE)
    assert [name for name in shown if name not in DEFINED] == []
    assert len(shown) == len({*shown})
    there = {id(DEFINED[name]) for name in shown}
    assert [name for name, what in DEFINED.items() if id(what) not in there] == []


@pytest.mark.parametrize(("name", "what"), FUNCTIONS, ids=[name for name, _ in FUNCTIONS])
def test_a_function_says_what_it_takes_and_gives(name, what):
    """Every parameter by name, what comes back, and a unit where there is a quantity."""
    taken = inspect.signature(what).parameters.values()
    told = re.findall(r"^(\S.*)$", section(what, "Parameters"), re.MULTILINE)
    named = {part.strip(" *") for line in told for part in line.split(",")}
    assert {one.name for one in taken} - {"given"} <= named, name
    assert named <= {one.name for one in taken}, name
    assert section(what, "Returns"), name
    assert UNIT.search(doc_of(what)) or name in WITHOUT_UNIT, name
    assert ">>> " in doc_of(what) or name in WITHOUT_EXAMPLE, name


@pytest.mark.parametrize("name", [name for name, what in OWN.values() if ">>> " in doc_of(what)])
def test_its_example_is_true(name, tmp_path, monkeypatch):
    """What a docstring shows is what comes out: numbers that a law gives."""
    monkeypatch.chdir(tmp_path)
    finder, runner = doctest.DocTestParser(), doctest.DocTestRunner()
    case = finder.get_doctest(doc_of(DEFINED[name]), {}, name, None, None)
    said: list[str] = []
    assert runner.run(case, out=said.append).failed == 0, "".join(said)


def test_every_public_name_says_what_it_is():
    """A function or a class in its docstring."""
    assert [name for name, what in OWN.values() if not doc_of(what)] == []
