"""A text as lexemes: part names, materials, numbers and connectors, each one token."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from ..vocabulary.lexicon import Atom, ReaderLexicon, atoms, part_name_words, words
from ..vocabulary.loads import without_loads
from ..vocabulary.spelling import mended_spelling
from .lexeme import Lexed, Lexeme
from .ranges import spelt_out
from .spans import spans


def lex(text: str, lexicon: ReaderLexicon, names: Sequence[str]) -> Lexed:
    """Cut a text into lexemes and tag them."""
    known = {word for name in names for word in part_name_words(name)}
    text, told = without_loads(_plain(text))
    cut = atoms(text, lexicon.model, known)
    cut, notes, strange, mended = mended_spelling(cut, lexicon, known)
    chosen = _longest(spans(text, cut, lexicon, names, known))
    lexemes = spelt_out(_fill(cut, chosen, lexicon, known, strange), names)
    lexemes = [
        replace(x, note=x.note or "; ".join(n for at, n in mended.items() if x.start <= at < x.end))
        for x in lexemes
    ]
    return Lexed(_tag(lexemes, lexicon), [*told, *notes])


def _plain(text: str) -> str:
    """Write what stands for a word or a column by that, in as many characters."""
    for rule in words()["rewrites"]:
        width = lambda m, to=rule["to"]: m.expand(to).ljust(len(m[0]))[: len(m[0])]  # noqa: E731
        text = re.sub(rule["find"], width, text)
    return text


_RANK = {"part": 0, "number": 1, "told": 1, "size": 1, "material": 2}


def _longest(found: list[Lexeme]) -> list[Lexeme]:
    """Of candidates over each other the longest, then the more telling."""
    order = sorted(found, key=lambda x: (x.start - x.end, _RANK.get(x.role, 3)))
    chosen: list[Lexeme] = []
    for lexeme in order:
        if all(lexeme.end <= c.start or c.end <= lexeme.start for c in chosen):
            chosen.append(lexeme)
    return sorted(chosen, key=lambda x: x.start)


def _fill(
    cut: list[Atom], chosen: list[Lexeme], lexicon: ReaderLexicon, known: set[str], strange: set
) -> list[Lexeme]:
    """Put the words that no phrase took between the lexemes."""
    out = list(chosen)
    for i, atom in enumerate(cut):
        if any(c.start < atom.end and atom.start < c.end for c in chosen):
            continue
        first, named = atom.text[0], atom.stem in known and not _is_article(cut, i, known)
        role = "word" if first.isalpha() else "digits" if first.isdigit() else "sign"
        out.append(
            Lexeme(
                atom.text, atom.start, atom.end, role, words=(atom.stem,),
                known=atom.start not in strange, part=named,
            )
        )  # fmt: skip
    return sorted(out, key=lambda x: x.start)


def _is_article(cut: list[Atom], i: int, known: set[str]) -> bool:
    """Whether an "a" is no label of a part: "a stool" of "leg_a", but "leg a is oak"."""
    if cut[i].text.lower() != "a" or (i > 0 and cut[i - 1].stem in known):
        return False
    after = cut[i + 1].text.lower() if i + 1 < len(cut) else ""
    joins = any(after in words()["roles"][role] for role in ("is", "of", "and"))
    return after[:1].isalpha() and not joins


# What the model is shown for tokens that it cannot know, and for phrases that are one token here.
_PLAIN = {"material": "wood", "number": "12", "size": "12", "told": "12", "part": "part"}
_PHRASES = {
    "fill": "with", "is": "is", "of": "of", "with": "with", "except": "except", "not": "not",
    "looks": "like", "off": "for", "on": "on", "than": "than", "degree": "very", "same": "same",
    "stiffness": "soft", "density": "heavy", "character": "tough", "rest": "rest", "whole": "all",
}  # fmt: skip


def _tag(lexemes: list[Lexeme], lexicon: ReaderLexicon) -> list[Lexeme]:
    """Let the model tag the sentence with every material, number and odd name as a plain word."""
    if not lexemes:
        return []
    shown = [
        _PLAIN.get(x.role, "") or (" " in x.text and _PHRASES.get(x.role)) or _sober(x.text)
        for x in lexemes
    ]
    doc = lexicon.model.doc(shown)
    return [
        replace(lexeme, tag=token.tag_, dep=token.dep_)
        for lexeme, token in zip(lexemes, doc, strict=True)
    ]


def _sober(word: str) -> str:
    return word.lower() if word.isupper() and len(word) > 1 else word.replace("\n", ".")
