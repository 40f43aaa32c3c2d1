"""What is said of a part beside another: "ten times the modulus of the bracket", "wie Deckel".

The tagger finds the words; their beginnings, in four languages, tell what is compared, which way
and how many times (``data/relations.toml``), and names of parts in them with what. And parts of
which a text says that nobody knows what they are of.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, NamedTuple

from .clauses import Place, over
from .languages import bare, languages
from .materials import ReaderLexicon, atoms
from .numerals import Comparison, number
from .parts import part_name_words, parts_called

_FACTOR = re.compile(
    r"(?<![\w.,])(\d+(?:[.,]\d+)?) ?(?:x|×|-?fach\w*|[- ]?mal|times|fois|veces)(?!\w)"
)
BY_FACTOR = re.compile(
    r"(?i)\s*(?:by |um |d'|por )?(?:an? |einen |un )?fa[ck]t(?:or|eur)(?: of| von| de)? "
    r"(\d+(?:[.,]\d+)?)"
)
_PERCENT = re.compile(r"(?<![\w.,])(\d+(?:[.,]\d+)?) ?%")
_SENTENCE, _COMMA = re.compile(r"[.;!?\n](?=\s)|[|•]"), re.compile(r"[,(](?=\s|\w)(?!\d)")
_END = re.compile(r"[.,;!?\n)|•](?=\s|$)")
_SYMBOL = re.compile(r"(?<!\w)E(?= (?:is|=|of|\d|should|must|shall|\.))")
_LONGEST = 4  # words of a part's name
_MORE = 2.0  # times: what "stiffer" is at the least, and "softer" the other way


class Relation(NamedTuple):
    """A part, by its index, and how another is beside it: None for the same matter."""

    other: int
    comparison: Comparison | None


@lru_cache(maxsize=1)
def _data() -> dict[str, Any]:
    return tomllib.loads((Path(__file__).parent / "data/relations.toml").read_text("utf-8"))


LEFT_OPEN = re.compile(_data()["open"]["words"])


def relation_of(
    said: str, own: int, labels: Sequence[Sequence[str]], before: int | None,
    lexicon: ReaderLexicon, context: str = "",
) -> Relation | None:  # fmt: skip
    """Return what words say of a part beside another, None where they say nothing of the kind.

    said: Words of a relation.
    own: Index of the part that they are said of.
    labels: For each part its name, then all other words that the asset has for it.
    before: The part that the text speaks of last before them, for "ditto".
    context: Words of their clause before them: "its modulus is" before "half the frame's".
    """
    data, low = _data(), said.lower()
    joined = context.rstrip()[-1:].isalnum()  # "módulo diez", "veces menor"
    near = " ".join([*context.lower().split()[-2:], low]) if joined else low
    times = _FACTOR.search(near) or BY_FACTOR.search(low)
    told, share = _first(data["times"], near), _PERCENT.search(low)
    tokens = re.findall(r"[^\W\d_]+", low)
    measures: tuple[Literal["E", "rho"], ...] = ("E", "rho")

    def begun_in(words: Sequence[str]) -> dict[str, str]:
        return {
            m: next((w for w in words for b in data["measured"][m] if w.startswith(b)), "")
            for m in measures
        }

    begun = begun_in(tokens)
    if not any(begun.values()) and (times or told):  # "its modulus is half the frame's"
        begun = begun_in(re.findall(r"[^\W\d_]+", context.lower()))
    measure = next((m for m in measures if begun[m]), None)
    if measure is None and times and _SYMBOL.search(f"{context} {said}"):  # "E 1.5 x that of it"
        measure = "E"
    found = _named(said, own, labels, lexicon)
    if measure is None:
        same = not {*tokens}.isdisjoint(data["same"]["words"]) or found is not None
        other = before if found is None else found
        return Relation(other, None) if same and other is not None else None
    way = -1 if any(begun[measure].startswith(b) for b in data["less"]["of"]) else 1
    way = -way if any(w.startswith(t) for w in tokens for t in data["less"]["turns"]) else way
    factor, exact = 1.0, True
    if times:
        factor = number(times[1])
    elif share:
        part = number(share[1]) / 100
        # "10 % stiffer", "10 % less dense"; but "10 % of the lid's modulus"
        more = begun[measure].endswith("er") or any(w in data["more"]["words"] for w in tokens)
        factor = 1 + way * part if more else part
        way = 1
    elif told:
        factor = told
    elif not {*tokens}.isdisjoint(data["more"]["equal"]):
        factor = 1.0  # "as stiff as"
    else:
        more = way < 0 or any(w in data["more"]["words"] for w in tokens) or "er " in low
        exact = not more
        factor = (_first(data["vague"], low) or _MORE) if more else 1.0
    if factor <= 0:
        return None
    if way < 0:
        factor = 1 / factor if factor >= 1 else factor
    other = before if found is None else found
    if other is None:
        return None
    return Relation(other, Comparison(measure, factor, exact, part_name_words(labels[other][0])))


def _first(factors: dict[str, list[str]], low: str) -> float | None:
    spoken = ((low.find(w), float(f)) for f, ws in factors.items() for w in ws)
    starts = [
        (at, f) for at, f in spoken if at >= 0 and (at == 0 or not low[at - 1].isalpha())
    ]  # fmt: skip
    return min(starts)[1] if starts else None


def _named(
    said: str, own: int, labels: Sequence[Sequence[str]], lexicon: ReaderLexicon
) -> int | None:
    """Index of the part that words name, the longest name first."""
    found = (i for parts in _called(said, labels, lexicon) for i in parts if i != own)
    return next(found, None)


def _called(
    said: str, labels: Sequence[Sequence[str]], lexicon: ReaderLexicon
) -> Iterator[list[int]]:
    """Indices of the parts that phrases name, by the longest phrase first."""
    known = {word for names in labels for word in re.findall(r"[^\W\d_]+|\d+", names[0].lower())}
    cut = [
        a for a in atoms(said, lexicon.model, known)
        if len(a.stem) > 1 or a.text.isupper() or a.text.isdigit()
    ]  # fmt: skip
    for size in range(_LONGEST, 0, -1):
        for at in range(len(cut) - size + 1):
            words = tuple(a.stem for a in cut[at : at + size])
            plain = tuple(map(bare, words))  # "núcleo" of a part "nucleo"
            named = parts_called(words, labels)
            yield named or (parts_called(plain, labels) if plain != words else [])
    for a in cut:  # "la plaque" of a part "plate"
        for language in languages():
            for english in language.names(bare(a.text)):
                if english:
                    yield parts_called((english,), labels)


def left_open(
    text: str, labels: Sequence[Sequence[str]], silent: Sequence[int], matters: Sequence[Place],
    lexicon: ReaderLexicon,
) -> dict[int, Place]:  # fmt: skip
    """Parts of which a text says that their matter is not known, and where it does.

    labels: For each part its name, then all other words that the asset has for it.
    silent: Parts of which nothing is said: "the rest".
    matters: Where matters of parts stand.

    Of a sentence it is what lies between commas, with what stands before it up to a part's name:
    "the foot is heavy stuff, who knows".
    """
    out: dict[int, Place] = {}
    of_rest = _data()["open"]["rest"]
    for found in LEFT_OPEN.finditer(text):
        first = max((m.end() for m in _SENTENCE.finditer(text, 0, found.start())), default=0)
        begins = [m.end() for m in _COMMA.finditer(text, first, found.start())]
        last = _END.search(text, found.end())
        end = last.start() if last else len(text)
        for begin in [*reversed(begins), first]:
            if any(over(place, (begin, end)) for place in matters):
                break
            if re.search(_data()["open"]["other"], text[begin:end]):
                break  # "the colour of the lid is unknown"
            parts = next(filter(None, _called(text[begin:end], labels, lexicon)), ())
            if parts := parts or (silent if re.search(of_rest, text[begin:end]) else ()):
                out |= dict.fromkeys(parts, (begin, end))
                break
    return out
