"""Notes: what a result or an error says, as a kind and its values.

Sentences are made above: of the whole package by ``toolkit/verdict/sentences.toml``.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any, Literal

# How much a note matters: it is for who reads the whole report; it tells how a thing was read; a
# thing may be otherwise than taken; what was said is not used.
Severity = Literal["detail", "note", "doubt", "error"]

# Module and function that know the sentence of a kind: none, where these elements are used alone.
_speaker: list[str] = []


def speak_by(module: str, function: str) -> None:
    """Let ``module.function``, loaded when it is first asked, give the template of every kind."""
    _speaker[:] = [module, function]


class Note(str):
    """A sentence with the kind and the values that it was made of.

    Parameters
    ----------
    kind
        "file.key" of a template that ``speak_by`` knows. Any other text stands for itself.
    values
        Numbers and names that the template's ``{fields}`` show.

    Examples
    --------
    >>> Note("tets", got=3, wanted=4)
    'tets: got 3, wanted 4'
    """

    kind: str
    values: dict[str, Any]

    def __new__(cls, kind: str, /, **values: Any) -> Note:
        """Make the sentence: of a kind that nobody words, the kind and its values."""
        template = _told(kind)
        if template is not None:
            text = template.format(**values)
        else:
            shown = ", ".join(f"{name.replace('_', ' ')} {value}" for name, value in values.items())
            text = f"{kind}: {shown}" if shown else kind
        made = super().__new__(cls, text)
        made.kind, made.values = kind, values
        return made

    @property
    def severity(self) -> Severity:
        """How much it matters: that of what it ``said`` of something, else by its kind."""
        said = self.values.get("said")
        return (
            said.severity if isinstance(said, Note) else _told(f"severity.{self.kind}") or "doubt"
        )


def severity_of(line: str) -> Severity:
    """How much a line matters; what is no ``Note`` is a doubt.

    Parameters
    ----------
    line
        A note, or any sentence.

    Returns
    -------
    str
        "detail", "note", "doubt" or "error".

    Examples
    --------
    >>> severity_of("nobody knows")
    'doubt'
    """
    return line.severity if isinstance(line, Note) else "doubt"


def _told(kind: str) -> Any:
    """What is known of a kind by whoever words notes; None by nobody."""
    if not _speaker:
        return None
    module, function = _speaker
    look_up: Callable[[str], str | None] = getattr(import_module(module), function)
    return look_up(kind)
