"""The benchmark of sentences runs the command with its defaults, and every look is on record."""

import importlib
import json
import sys

import pytest

pytestmark = pytest.mark.blockers

SENTENCE = {
    "id": "one", "kind": "plain", "style": "cad", "text": "the legs are steel",
    "parts": {"legs": "steel"}, "must_warn": "nothing is wrong",
}  # fmt: skip
BANDS = {"steel": {"E": [190e9, 215e9], "rho": [7600, 8100]}}


@pytest.fixture
def sentences(root, monkeypatch):
    monkeypatch.syspath_prepend(str(root / "benchmarks"))
    monkeypatch.delitem(sys.modules, "sentences", raising=False)
    return importlib.import_module("sentences")


def test_it_runs_assign_with_nothing_but_mesh_text_and_output(sentences, tmp_path, monkeypatch):
    """What follows are the defaults of the command; an error is wrong, and counted by itself."""
    called = []
    monkeypatch.setattr(sentences, "autophyx_tet", lambda words: called.append(words) or 2)
    scores = sentences.score_sentence(SENTENCE, BANDS, tmp_path)
    verb, mesh, *words = called[0]
    output = str(tmp_path / "stiff.msh")
    assert (verb, words) == ("assign", ["--text", SENTENCE["text"], "-o", output, "--json"])
    assert mesh == str(tmp_path / "parts.msh")
    row = sentences.row("set", scores)
    assert (row["right"], row["in_error"], row["silently_wrong"]) == (0, 1, 0)


def test_a_missing_file_is_no_doubt_about_words(sentences, tmp_path):
    """A sentence that must be warned of, and is not, is wrong; else it is right."""
    (wrong,) = sentences.score_sentence(SENTENCE, BANDS, tmp_path)
    assert not wrong.right
    assert not wrong.exit_code
    (right,) = sentences.score_sentence({**SENTENCE, "must_warn": ""}, BANDS, tmp_path)
    assert right.right


def test_what_a_part_allows_is_allowed_to_it_alone(sentences, tmp_path):
    """Of a matter that nobody knows both are told, and one of them may be wrong then."""
    sentence = {
        **SENTENCE, "must_warn": "", "text": "the legs and the seat are vibranium",
        "parts": {"legs": {"band": "steel", "or_warn": True}, "seat": "steel"},
    }  # fmt: skip
    legs, seat = sentences.score_sentence(sentence, BANDS, tmp_path)
    assert (legs.warned, seat.warned) == (True, True)
    assert (legs.right, legs.plainly, seat.right) == (True, False, False)
    assert legs.needless is None


def test_the_last_look_at_a_held_out_set_is_its_row(root, sentences):
    """Who scores one and keeps the figure to themselves leaves a look without a row."""
    looks = [json.loads(line) for line in sentences.LOOKS.read_text().splitlines()]
    document = json.loads((root / "docs" / "data" / "sentences.json").read_text())
    rows = {row["set"]: row for row in document["rows"]}
    for name in sentences.HELD_OUT:
        of_set = [look for look in looks if look["set"] == name]
        row, last = rows[name], of_set[-1]
        assert row["scored_times"] == len(of_set)
        assert last.items() - row.items() == {("date", last["date"]), ("command", "assign")}
    assert {*rows} <= {*sentences.SETS, *sentences.HELD_OUT}
