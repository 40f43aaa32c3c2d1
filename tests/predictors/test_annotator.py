"""Laws of the annotator, against a local server that speaks the protocol."""

import json
import threading
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest
from autophyx_tet.fem.errors import InputError, UsageError
from autophyx_tet.predictors.datasets.annotator import Annotator

POT = {"E": 7e10, "nu": 0.25, "rho": 2400}
SOIL = {"E": 1e7, "nu": 0.3, "rho": 1300}


@pytest.fixture
def server():
    """A chat endpoint that answers what ``server.answer`` holds and keeps what it was asked."""

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self):
            length = int(self.headers["Content-Length"])
            self.server.asked = (self.path, dict(self.headers), json.loads(self.rfile.read(length)))
            body = json.dumps({"choices": [{"message": {"content": self.server.answer}}]}).encode()
            self.send_response(200)
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_):
            pass

    server = HTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield server
    server.shutdown()
    thread.join()
    server.server_close()


def annotator(server) -> Annotator:
    return Annotator(f"http://127.0.0.1:{server.server_port}/v1", "small", key="k", timeout=60)


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
        Annotator("http://127.0.0.1:9/v1", "small", timeout=1).annotate("plant", ("pot",))
    with pytest.raises(UsageError, match="http or https"):
        Annotator("file:///etc/passwd", "small")
