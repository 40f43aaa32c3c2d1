"""Laws of the annotator, against a local server that speaks the protocol."""

import json

import pytest
from autophyx_tet.fem.errors import InputError, UsageError
from autophyx_tet.predictors.text.interpreter import ChatEndpoint
from autophyx_tet.research.datasets.annotator import Annotator

POT = {"E": 7e10, "nu": 0.25, "rho": 2400}
SOIL = {"E": 1e7, "nu": 0.3, "rho": 1300}


def endpoint(server) -> ChatEndpoint:
    return ChatEndpoint(f"http://127.0.0.1:{server.server_port}/v1", "small", key="k", timeout=60)


def annotator(server) -> Annotator:
    return Annotator(endpoint(server))


def variant(text="a ceramic pot with soil", pot=POT, soil=SOIL, constraints=("pot.E > soil.E",)):
    return {"text": text, "parts": {"pot": pot, "soil": soil}, "constraints": list(constraints)}


def test_protocol_and_values(server):
    """The request is a chat completion; a good answer comes back as texts and values."""
    server.answer = json.dumps({"variants": [variant()]})
    found = annotator(server).annotate("potted plant", ("pot", "soil"), count=3)
    path, headers, body = server.asked
    assert (path, body["model"]) == ("/v1/chat/completions", "small")
    assert headers["Authorization"] == "Bearer k"
    assert "pot, soil" in body["messages"][0]["content"]
    assert found.variants[0].values["pot"] == (7e10, 0.25, 2400)
    assert not found.rejected


BAD = (
    (variant(constraints=("pot.E < soil.E",)), "does not hold"),
    (variant(constraints=("__import__('os')",)), "not known"),
    (variant(pot={**POT, "nu": 0.7}), "lies outside"),
    (variant(pot={**POT, "E": "NaN"}), "lies outside"),
    (variant(soil="soft"), "no numbers"),
    ({"text": "x", "parts": {"pot": POT}}, "wanted"),
    ("just words", "no text"),
)


def test_bad_variants_are_counted(server):
    """A variant that breaks a rule is left out with its reason; the others stay."""
    for bad, why in BAD:
        server.answer = json.dumps({"variants": [bad, variant()]})
        found = annotator(server).annotate("potted plant", ("pot", "soil"))
        assert len(found.variants) == 1, bad
        assert why in found.rejected[0], bad


def test_no_json_and_no_server(server):
    """Prose instead of JSON, and an endpoint that is not there, are errors of one line."""
    server.answer = "Sure! Here you go:"
    with pytest.raises(InputError, match="no JSON"):
        annotator(server).annotate("plant", ("pot",))
    with pytest.raises(InputError, match="cannot reach"):
        Annotator(ChatEndpoint("http://127.0.0.1:9/v1", "small", timeout=1)).annotate(
            "plant", ("pot",)
        )
    with pytest.raises(UsageError, match="http or https"):
        ChatEndpoint("file:///etc/passwd", "small")
