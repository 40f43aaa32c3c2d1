"""Sentences of what the rooms below say: `sentences.toml` has one for every kind of note."""

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
    return tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
