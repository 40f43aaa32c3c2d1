"""What treatments and colours say of a matter: "galvanised" is steel, "painted silver" none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ...fem.scene.materials import Material
from ..vocabulary.lexicon import ReaderLexicon, words
from .lexeme import Lexeme


def implied(run: Sequence[Lexeme], lexicon: ReaderLexicon) -> list[tuple[Lexeme, Material]]:
    """The metal that a treatment speaks of: "galvanised" is steel, until another is named."""
    rows = ((x, words()["implied"].get(x.text.lower())) for x in run if x.role == "coat")
    return [
        (replace(x, words=("metal",)), lexicon.table.exact(row))
        for x, row in rows
        if row in lexicon.table.phrases
    ][:1]


def puts_hue(lexeme: Lexeme, before: Sequence[object], after: Sequence[Lexeme]) -> bool:
    """Whether a participle puts the metal after it on the matter before: "wood painted silver"."""
    rows = [*before, *(x.value for x in after)]
    metals = [isinstance(row, Material) and row.category == "metal" for row in rows]
    matter = isinstance(next(iter(before), None), Material)
    return matter and lexeme.text.lower() in words()["hues"]["words"] and metals == [False, True]


def is_hue(after: Sequence[Lexeme]) -> bool:
    """Whether "light" is told of a colour: before another adjective, or a wood."""
    return any(
        x.value.category == "wood" if isinstance(x.value, Material) else x.tag == "JJ"
        for x in after
    )
