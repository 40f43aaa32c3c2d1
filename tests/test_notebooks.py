"""Every walkthrough runs from start to end, keeps what it asserts, and is shown as it ran."""

import ast
import hashlib
import json
import runpy
from importlib import import_module
from pathlib import Path

import pytest

SOURCES = sorted((Path(__file__).resolve().parent.parent / "notebooks").glob("*.py"))
FACES = (
    "autophyx_tet",
    *(f"autophyx_tet.{room}" for room in ("fem", "converters", "predictors", "research")),
)
EACH = pytest.mark.parametrize("source", SOURCES, ids=lambda path: path.stem)
LARGEST = 300_000  # bytes: a page shows it at once, and the history stays small


def _with_marks(source):
    """Notebooks that call an outside program belong to the tests that need it."""
    marks = [pytest.mark.external] if '"ccx"' in source.read_text() else []
    return pytest.param(source, id=source.stem, marks=marks)


def test_there_are_notebooks():
    assert SOURCES


@EACH
def test_only_public_names_are_used(source):
    """What is imported, or taken from ``apx``, stands in ``__all__`` of one of the faces."""
    tree = ast.parse(source.read_text())
    used = []
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("autophyx_tet"):
            used += [(node.module, alias.name) for alias in node.names]
        if isinstance(node, ast.Import):
            names = {a.name: a.asname for a in node.names if a.name.startswith("autophyx_tet")}
            assert names in ({}, {"autophyx_tet": "apx"})
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            used += [("autophyx_tet", node.attr)] if node.value.id == "apx" else []
    assert used
    hidden = [
        row for row in used if row[0] not in FACES or row[1] not in import_module(row[0]).__all__
    ]
    assert not hidden


def test_every_public_name_is_there():
    for face in FACES:
        module = import_module(face)
        assert all(hasattr(module, name) for name in module.__all__)
        assert set(dir(module)) >= set(module.__all__) - {"__version__"}


@pytest.mark.long
@pytest.mark.parametrize("source", [*map(_with_marks, SOURCES)])
def test_a_notebook_keeps_its_promises(source, tmp_path, monkeypatch):
    """It needs no file but those it makes, and each asserts at least one number."""
    assert "\nassert " in source.read_text()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    runpy.run_path(str(source))


@EACH
def test_what_is_shown_is_what_the_source_does(source):
    """The executed notebook has its source's hash and cells, no error, a picture, and is small."""
    shown = source.with_suffix(".ipynb")
    assert shown.exists(), "run `make notebooks`"
    book = json.loads(shown.read_text())
    made_of = hashlib.sha256(source.read_bytes()).hexdigest()
    assert book["metadata"]["autophyx_tet"]["source_sha256"] == made_of, "run `make notebooks`"
    assert shown.stat().st_size < LARGEST
    code = [cell for cell in book["cells"] if cell["cell_type"] == "code"]
    assert [cell["execution_count"] for cell in code] == list(range(1, len(code) + 1))
    outputs = [output for cell in code for output in cell["outputs"]]
    assert all(output["output_type"] != "error" for output in outputs)
    kinds = {kind for output in outputs for kind in output.get("data", {})}
    assert kinds & {"image/png", "image/gif"}
