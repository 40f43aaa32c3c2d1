"""Laws of the interpreter, against a local server that speaks the protocol, hostile ones too."""

import json

import pytest
from autophyx_tet.fem.errors import UsageError
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.text.interpreter import MAX_ANSWER, ChatEndpoint, interpret
from autophyx_tet.predictors.text.reader import parse

TABLE = load_table()
TEXT = "oak legs, the seat is soft foam of 30 kg/m3"
NAMES = ("leg", "seat")
LEGS = {"text": "oak legs", "scope": "parts", "parts": [["legs"]], "material": "oak"}
DENSITY = {"measure": "rho", "value": 30, "text": "30 kg/m3"}
SEAT = {
    "text": "the seat is soft foam of 30 kg/m3", "scope": "parts", "parts": [["seat"]],
    "material": "soft foam", "stiffness": 2, "numbers": [DENSITY],
}  # fmt: skip


def endpoint(server) -> ChatEndpoint:
    return ChatEndpoint(f"http://127.0.0.1:{server.server_port}/v1", "small", key="k", timeout=60)


def read(server, *clauses):
    server.answer = json.dumps({"clauses": list(clauses)})
    return interpret(endpoint(server), TEXT, TABLE, NAMES)


def test_a_good_answer_becomes_the_same_clauses(server):
    found = read(server, LEGS, SEAT)
    assert [clause.material for clause in found.clauses] == [
        TABLE.exact("oak").name,
        TABLE.exact("soft foam").name,
    ]
    legs, seat = found.clauses
    assert TEXT[slice(*legs.span)] == "oak legs"
    assert seat.subject.names == (("seat",),)
    assert seat.numbers[0].value == 30
    assert not found.notes
    path, headers, body = server.asked
    assert (path, body["model"]) == ("/v1/chat/completions", "small")
    assert headers["Authorization"] == "Bearer k"
    assert body["messages"][0]["content"].count("seat")


HOSTILE = (
    ({**LEGS, "text": "gold legs"}, "does not say"),
    ({**LEGS, "scope": "__class__"}, "scope"),
    ({**LEGS, "stiffness": 9}, "degree"),
    ({**LEGS, "numbers": [{**DENSITY, "value": float("nan")}]}, "no number"),
    ({**LEGS, "numbers": [{**DENSITY, "value": -30}]}, "not positive"),
    ({**LEGS, "numbers": [{**DENSITY, "text": "40 kg/m3"}]}, "does not say"),
    ({**LEGS, "numbers": [{**DENSITY, "measure": "os.system"}]}, "no number of"),
    ({**LEGS, "excluded": ["blarg"]}, "rules out"),
    ("oak legs", "wanted an object"),
    ([], "wanted an object"),
)


def test_a_clause_that_breaks_a_rule_is_left_out_with_its_reason(server):
    for bad, why in HOSTILE:
        found = read(server, bad, SEAT)
        assert len(found.clauses) == 1, bad
        assert any(why in note for note in found.notes), (bad, found.notes)


def test_an_unknown_material_is_never_a_row(server):
    found = read(server, {**LEGS, "material": "blarg wood"}, SEAT)
    assert found.clauses[0].material is None
    assert found.clauses[0].unknown == "blarg wood"


def test_what_the_model_left_out_is_told(server):
    """The built-in reader is the check: its materials and numbers are named if they are missing."""
    found = read(server, LEGS)
    assert any("does not give" in note and "foam" in note for note in found.notes)


def test_without_an_answer_the_built_in_reader_reads(server):
    """Prose, an empty list, deep nesting, nobody there: the parse, and a note."""
    own = parse(TEXT, TABLE, NAMES).clauses
    for answer in ("Sure!", json.dumps({"clauses": []}), "[" * 100_000, json.dumps([LEGS])):
        server.answer = answer
        found = interpret(endpoint(server), TEXT, TABLE, NAMES)
        assert found.clauses == own, answer[:20]
        assert any("built-in reader" in note for note in found.notes)
    nobody = ChatEndpoint("http://127.0.0.1:9/v1", "small", timeout=1)
    found = interpret(nobody, TEXT, TABLE, NAMES)
    assert found.clauses == own
    assert any("cannot reach" in note for note in found.notes)
    with pytest.raises(UsageError, match="http or https"):
        ChatEndpoint("file:///etc/passwd", "small")


def test_an_endless_answer_is_cut(server):
    server.answer = "x" * (MAX_ANSWER + 1)
    found = interpret(endpoint(server), TEXT, TABLE, NAMES)
    assert any("more than" in note for note in found.notes)
