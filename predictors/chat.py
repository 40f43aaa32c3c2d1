"""A language model behind an OpenAI-compatible endpoint, here or elsewhere: text in, JSON out.

What it answers is data of unknown quality: bounded in size, read as JSON alone, checked by whoever
asked.
"""

from __future__ import annotations

import json
import os
import urllib.error
import urllib.request
from dataclasses import dataclass, field
from typing import Any

from ..fem.errors import InputError, UsageError

MAX_ANSWER = 1_000_000  # bytes; what is asked for here is a few thousand


@dataclass(frozen=True)
class ChatEndpoint:
    """An endpoint such as ``http://localhost:8000/v1`` and the model to ask there."""

    url: str
    model: str
    key: str = field(default="", repr=False)
    timeout: float = 60.0

    def __post_init__(self) -> None:
        if not self.url.startswith(("http://", "https://")):
            raise UsageError(f"the endpoint must be an http or https address, got {self.url!r}")

    @classmethod
    def at(cls, address: str) -> ChatEndpoint:
        """Return the endpoint of ``http://HOST/v1#MODEL``; its key is in the environment."""
        url, _, model = address.partition("#")
        return cls(url, model or "default", os.environ.get("AUTOPHYX_INTERPRETER_KEY", ""))

    def ask(self, prompt: str) -> dict[str, Any]:
        """Return the JSON object that the model answers (POST /chat/completions).

        Raises
        ------
        InputError
            Where the endpoint cannot be reached or answers no JSON object.
        """
        answer = self._content(self._post(prompt))
        try:
            document = json.loads(answer)
        except (json.JSONDecodeError, RecursionError) as error:
            raise InputError(
                f"{self.model} answered no JSON ({error}): ask another model"
            ) from error
        if not isinstance(document, dict):
            raise InputError(f"{self.model} answered no JSON object: ask another model")
        return document

    def _post(self, prompt: str) -> bytes:
        body = {
            "model": self.model,
            "messages": [{"role": "user", "content": prompt}],
            "response_format": {"type": "json_object"},
        }
        request = urllib.request.Request(
            f"{self.url.rstrip('/')}/chat/completions",
            data=json.dumps(body).encode(),
            headers={"Content-Type": "application/json", "Authorization": f"Bearer {self.key}"},
        )
        try:
            with urllib.request.urlopen(request, timeout=self.timeout) as response:
                data = response.read(MAX_ANSWER + 1)
        except (urllib.error.URLError, OSError) as error:
            raise InputError(f"cannot reach {self.url}: {error}") from error
        if len(data) > MAX_ANSWER:
            raise InputError(f"{self.url} answered more than {MAX_ANSWER} bytes")
        return data

    def _content(self, data: bytes) -> str:
        try:
            return str(json.loads(data)["choices"][0]["message"]["content"])
        except (ValueError, KeyError, IndexError, TypeError, RecursionError) as error:
            raise InputError(f"{self.url} does not answer as a chat endpoint: {error}") from error
