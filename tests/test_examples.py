"""Every example runs from an empty folder, keeps what it asserts, and needs public names alone."""

import ast
import re
import runpy
from importlib import import_module
from pathlib import Path

import pytest

SOURCES = sorted((Path(__file__).resolve().parent.parent / "examples").glob("*.py"))
EACH = pytest.mark.parametrize("source", SOURCES, ids=lambda path: path.stem)
FACES = ("autophyx_tet", *(f"autophyx_tet.{room}" for room in ("fem", "converters", "predictors")))
LONGEST = 60  # lines: an example is read at a glance
QUICK = ("drive_splats", "into_other_programs", "linear_or_neo_hookean", "ringing_bar")  # < 2 s


@EACH
def test_it_answers_one_question_in_a_page(source):
    text = source.read_text()
    question = (ast.get_docstring(ast.parse(text)) or "").partition("\n")[0]
    assert question.endswith("?")
    assert len(text.splitlines()) <= LONGEST
    assert re.search(r"^ *assert ", text, re.MULTILINE)


@EACH
def test_it_takes_only_public_names(source):
    """What is imported, or taken from ``apx``, stands in ``__all__`` of one of the faces."""
    used = []
    for node in ast.walk(ast.parse(source.read_text())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("autophyx_tet"):
            used += [(node.module, alias.name) for alias in node.names]
        if isinstance(node, ast.Import):
            ours = {a.name: a.asname for a in node.names if a.name.startswith("autophyx_tet")}
            assert ours in ({}, {"autophyx_tet": "apx"})
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            used += [("autophyx_tet", node.attr)] if node.value.id == "apx" else []
    assert used
    hidden = [one for one in used if one[0] not in FACES]
    hidden += [(face, name) for face, name in used if name not in import_module(face).__all__]
    assert not hidden


def test_the_list_of_examples_is_complete(root):
    """The page of the folder has each with its question, and no other."""
    page = (root / "examples" / "README.md").read_text()
    listed = re.findall(r"^\* \[(.*)\]\((\w+\.py)\)$", page, re.MULTILINE)
    asked = {
        source.name: (ast.get_docstring(ast.parse(source.read_text())) or "").partition("\n")[0]
        for source in SOURCES
    }
    assert {file: question for question, file in listed} == asked


@pytest.mark.parametrize(
    "source",
    [
        pytest.param(path, id=path.stem, marks=[] if path.stem in QUICK else [pytest.mark.slow])
        for path in SOURCES
    ],
)
def test_it_keeps_its_promises(source, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(source))
