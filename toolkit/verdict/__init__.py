"""Verdict: what a verb did, in numbers for JSON and sentences for people.

In: the results of a conversion, an assignment or a simulation.
Out: checks (does it hold its shape, buckle, tip over?), documents, advice that names options.
Read: checks, check, assignment, simulation, run.
"""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path


def template(kind: str) -> str | None:
    """Sentence of a kind "file.key", with {fields} for its values; None of any other text."""
    file, _, key = kind.partition(".")
    return _templates().get(file, {}).get(key)


@cache
def _templates() -> dict[str, dict[str, str]]:
    return tomllib.loads(Path(__file__).with_name("sentences.toml").read_text(encoding="utf-8"))
