"""Notes: each kind that the code names has a sentence, of just the values that it is given."""

import ast
import string
import tomllib
from functools import cache
from pathlib import Path

import pytest
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.note import Note, severity_of
from autophyx_tet.toolkit.verdict.check import RESTS_ON

ROOT = Path(__file__).resolve().parent.parent
ROOMS = ("fem", "converters", "predictors", "toolkit", "research")


def _sentences() -> dict[str, set[str]]:
    """Kind -> fields of its sentence."""
    tables = tomllib.loads((ROOT / "toolkit/verdict/sentences.toml").read_text())
    return {
        f"{file}.{key}": {
            name.partition(".")[0] for _, name, _, _ in string.Formatter().parse(text) if name
        }
        for file, table in tables.items()
        if file != "severity"
        for key, text in table.items()
    }


@cache
def _calls() -> list[tuple[str, str, set[str]]]:
    """(place, kind, names of values) of every note and every error that is made with a kind."""
    calls = []
    for path in (path for room in ROOMS for path in (ROOT / room).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if not (isinstance(node, ast.Call) and node.args):
                continue
            name = ast.unparse(node.func)
            first, values = node.args[0], {keyword.arg or "**" for keyword in node.keywords}
            kinds = (first.body, first.orelse) if isinstance(first, ast.IfExp) else (first,)
            for kind in (getattr(one, "value", None) for one in kinds):
                if not isinstance(kind, str):
                    continue
                advice = f"advice.{kind.replace(' ', '_')}"  # by the name of a check
                if name == "Check" and advice in _sentences():
                    calls.append((f"{path}:{node.lineno}", advice, set()))
                elif (name == "Note" or name.endswith("Error")) and " " not in kind and "." in kind:
                    calls.append((f"{path}:{node.lineno}", kind, values))
    return calls


def test_every_kind_has_a_sentence_of_its_values():
    sentences = _sentences()
    wrong = [
        place
        for place, kind, values in _calls()
        if kind not in sentences or not ("**" in values or sentences[kind] <= values)
    ]
    assert not wrong


def test_no_sentence_is_left_over():
    """Nor a name of a check that rests on nothing and that nothing rests on, nor a severity."""
    checks = {*RESTS_ON, *(name for names in RESTS_ON.values() for name in names)}
    named = {f"named.{name.replace(' ', '_')}" for name in checks}
    kinds = {kind for _, kind, _ in _calls()}
    assert not set(_sentences()) - kinds - named - {f"severity.{kind}" for kind in kinds}


def test_a_severity_is_of_a_kind_that_there_is():
    told = tomllib.loads((ROOT / "toolkit/verdict/sentences.toml").read_text())["severity"]
    assert set(told) <= set(_sentences())
    assert set(told.values()) <= {"detail", "note", "error"}  # all others are doubts


def test_a_note_of_a_part_matters_as_what_it_says():
    spelt = Note("lexing.spelt", word="stell", near="steel")
    lost = Note("resolve.left_out", word="foam")
    of = {"parts": "part 'a'", "names": ("a",)}
    assert severity_of(Note("resolve.of_part", said=spelt, **of)) == "note"
    assert severity_of(Note("resolve.of_part", said=lost, **of)) == "doubt"
    assert severity_of("words of nobody") == "doubt"


def test_a_note_is_its_sentence_and_keeps_its_values():
    """Text that is no kind stands for itself, braces and all."""
    note = Note("mesh.part_names", names=["a", "a"])
    assert note.kind == "mesh.part_names"
    assert note.values == {"names": ["a", "a"]}
    assert "['a', 'a']" in note
    assert Note("a file {x} of mine.txt") == "a file {x} of mine.txt"


def test_an_error_carries_what_its_sentence_says():
    with pytest.raises(InputError, match="nowhere") as caught:
        raise InputError("nowhere: wanted {somewhere}")
    assert caught.value.note.values == {}
