"""A text read by a language model, whose answer the built-in reader checks.

The built-in reader stays the fall-back, and the check: what the model left out or reads otherwise
is told. A clause that quotes words which the text does not have, or numbers that are not in it, is
left out with its reason.
"""

from __future__ import annotations

import json
import math
import os
import urllib.error
import urllib.request
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, get_args

from ...fem.errors import InputError, UsageError
from ...fem.note import Note
from ...fem.table import CATEGORIES, MaterialTable, key
from .clauses import Clause, Degree, Scope, Sentence, Subject
from .numerals import Measure, Quantity
from .reader import parse

MOST_CLAUSES = 100  # of a text of 4,000 characters
_PROMPT = """Read what this sentence says about the materials of an object's parts.
Sentence: {text!r}
Parts of the object: {names}.
Answer with JSON alone: {{"clauses": [CLAUSE, ...]}}. A CLAUSE has
"text": the exact words of the sentence that it comes from;
"scope": "parts" (it names parts), "whole" (the object), "rest" (everything else) or "none";
"parts": for each part it names a list of words, the head last, as [["front", "leg"]];
"exceptions": the same for parts that it leaves out;
"material": the bulk material in plain words ("soft foam", "6061-T6"), never a coating; or null;
"coating", "filling": words for what lies on it and what it is full of; or null;
"excluded": materials it is said not to be;
"stiffness", "density": 1 (very soft, very light) to 5 (very stiff, very heavy), or null;
"numbers": [{{"measure": one of {measures}, "value": in Pa, 1, kg/m3, kg, m, "text": exact words}}].
Leave out what the sentence does not say. Guess nothing."""


def interpret(
    endpoint: ChatEndpoint, text: str, table: MaterialTable, names: Sequence[str] = ()
) -> Sentence:
    """Return a text's clauses as a language model reads them.

    Where it cannot be reached or answers nothing usable, the built-in reader's clauses, and a note
    that says so.
    """
    own = parse(text, table, names)
    prompt = _PROMPT.format(
        text=text, names=", ".join(names) or "not known", measures=", ".join(get_args(Measure))
    )
    try:
        given = endpoint.ask(prompt).get("clauses")
        if not isinstance(given, list) or not given:
            raise InputError("interpreter.answered_clauses", model=endpoint.model)
    except InputError as error:
        note = Note("interpreter.interpreter_used", error=error)
        return replace(own, notes=(*own.notes, note))
    clauses, notes = [], []
    for number, item in enumerate(given[:MOST_CLAUSES], 1):
        try:
            clauses.append(_clause(item, text, table))
        except InputError as error:
            notes.append(Note("interpreter.clause_interpreter", number=number, error=error))
    if not clauses:
        notes.append(Note("interpreter.interpreters_clauses"))
        return replace(own, notes=(*own.notes, *notes))
    # What the built-in reader found in the text and the model did not give
    texts = {clause.material: clause.text for clause in own.clauses if clause.material}
    materials = {clause.material for clause in clauses}
    notes += [
        Note("interpreter.interpreter_give", material=material, words=words)
        for material, words in texts.items()
        if material not in materials
    ]
    measures = {number.measure for clause in clauses for number in clause.numbers}
    notes += [
        Note("interpreter.interpreter_give_number", text=number.text)
        for clause in own.clauses
        for number in clause.numbers
        if number.measure not in measures
    ]
    return Sentence(text, tuple(clauses), (), tuple(notes), own.thing)


def _clause(item: Any, text: str, table: MaterialTable) -> Clause:
    """Check one clause of the model's answer."""
    if not isinstance(item, Mapping):
        raise InputError("interpreter.wanted_object", name=type(item).__name__)
    said = _quote(item.get("text"), text)
    start = text.lower().index(said.lower())
    scopes: tuple[Scope, ...] = get_args(Scope)
    if item.get("scope") not in scopes:
        raise InputError("interpreter.scope_none", get=item.get("scope"), scopes=", ".join(scopes))
    scope = scopes[scopes.index(item["scope"])]
    subject = Subject(scope, _names(item.get("parts")), _names(item.get("exceptions")))
    phrase = _words(item.get("material"))
    row = table.phrases.get(key(phrase)) if phrase else None
    excluded, numbers = [], []
    for word in _strings(item.get("excluded")):
        other = table.phrases.get(key(word))
        if other is None and word not in CATEGORIES:
            raise InputError("interpreter.rules_out", word=word)
        excluded.append(other.name if other else word)
    stiffness, density = _degree(item.get("stiffness")), _degree(item.get("density"))
    for number in _list(item.get("numbers")):
        if not isinstance(number, Mapping) or number.get("measure") not in get_args(Measure):
            raise InputError(
                "interpreter.number", number=number, get_args=", ".join(get_args(Measure))
            )
        measure, value = number["measure"], number.get("value")
        if isinstance(value, bool) or not (isinstance(value, int | float) and math.isfinite(value)):
            raise InputError("interpreter.number_2", value=value)
        if value <= 0 and measure != "nu":
            raise InputError("interpreter.positive", measure=measure, value=value)
        numbers.append(Quantity(measure, float(value), _quote(number.get("text"), text)))
    return Clause(
        text=said,
        span=(start, start + len(said)),
        subject=subject,
        material=row.name if row else None,
        phrase=phrase if row else "",
        unknown=phrase if phrase and not row else "",
        nearest=tuple(table.near(phrase)) if phrase and not row else (),
        excluded=tuple(excluded),
        stiffness=stiffness,
        density=density,
        numbers=tuple(numbers),
        coating=_words(item.get("coating")) or None,
        filling=_words(item.get("filling")) or None,
        certainty=0.9,  # read by someone else: below what stands in the text as it is
    )


def _quote(value: Any, text: str) -> str:
    words = _words(value)
    if not words or words.lower() not in text.lower():
        raise InputError("interpreter.quotes_text", words=words)
    return words


def _degree(value: Any) -> Degree | None:
    if value is None or (value in get_args(Degree) and not isinstance(value, bool)):
        return value
    raise InputError("interpreter.degree", value=value)


def _words(value: Any) -> str:
    return " ".join(value.split()) if isinstance(value, str) else ""


def _list(value: Any) -> list:
    return value if isinstance(value, list) else []


def _strings(value: Any) -> list[str]:
    return [item for item in _list(value) if isinstance(item, str)]


def _names(value: Any) -> tuple[tuple[str, ...], ...]:
    named = (tuple(w.lower() for w in _strings(words)) for words in _list(value))
    return tuple(words for words in named if words)


# A language model behind an OpenAI-compatible endpoint, here or elsewhere: text in, JSON out.
#
# What it answers is data of unknown quality: bounded in size, read as JSON alone, checked by
# whoever asked.

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
            raise UsageError("interpreter.endpoint_must", url=self.url)

    @classmethod
    def at(cls, address: str) -> ChatEndpoint:
        """Return the endpoint of ``http://HOST/v1#MODEL``; its key is in the environment."""
        url, _, model = address.partition("#")
        return cls(url, model or "default", os.environ.get("AUTOPHYX_INTERPRETER_KEY", ""))

    def ask(self, prompt: str) -> dict[str, Any]:
        """Return the JSON object that the model answers (POST /chat/completions).

        Raises InputError: Where the endpoint cannot be reached or answers no JSON object.
        """
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
            raise InputError("interpreter.answered_more", url=self.url, max_answer=MAX_ANSWER)
        try:
            answer = str(json.loads(data)["choices"][0]["message"]["content"])
        except (ValueError, KeyError, IndexError, TypeError, RecursionError) as error:
            raise InputError("interpreter.answer_chat", url=self.url, error=error) from error
        try:
            document = json.loads(answer)
        except (json.JSONDecodeError, RecursionError) as error:
            raise InputError(
                "interpreter.answered_json_ask", model=self.model, error=error
            ) from error
        if not isinstance(document, dict):
            raise InputError("interpreter.answered_json", model=self.model)
        return document
