"""What one clause speaks of and what it is made of: "very soft rubber for the grip".

``parser.parse`` cuts a sentence into clauses and must guess where each ends; here the end is known,
so the words that remain when the material, how it is, and the small words are taken away are those
for the part. They bind a clause to voxels whatever it says of them.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

from . import words
from .degrees import ADJECTIVES, BEND, BRITTLE, FLOAT, MANNER, MODERATE, SINK
from .part_names import known_words
from .vocabulary import TOKEN, Vocabulary, stem

# A statement begins: "legs are", "whose rim must be", "it consists of", "the seat gives way".
_COPULA = (
    words.LINKS
    | frozenset(": must should formed consists cannot can will would might never barely".split())
    | frozenset(
        "does do has have keeps keep stays stay goes go resists resist weighs weigh drops drop "
        "falls fall rises rise settles settle pops pop squeezes".split()
    )
    | ((BEND | BRITTLE | FLOAT | SINK) - ADJECTIVES)
    - frozenset("press dent stretch fold bend chip broken afloat".split())
)
_IDLE = (
    words.DETERMINERS
    | words.JOINTS
    | words.FILLERS
    | words.LINKS
    | words.BREAKS
    | MANNER
    | MODERATE
    | frozenset("this these use below around on which whose must should it be where".split())
)
_ALL = frozenset("everything all rest other remaining remainder anything else".split())
_LIKE = frozenset("as like than".split())
_COMPARED = frozenset("hard soft light heavy".split())  # "steel hard": hard, and no steel


# "rock hard" is very hard, and no rock.
_IDIOM = re.compile(r"\b(?:rock(?= (?:hard|solid))|feather(?= light))")


def as_usual(text: str) -> str:
    """Return the clause in lower case, with the idioms that hide a degree said plainly."""
    return _IDIOM.sub("very", text.lower())


class Statement(NamedTuple):
    """What a clause speaks of ("" where it does not tell), its material, and how that is."""

    subject: str
    material: str | None
    manner: tuple[str, ...]


Span = tuple[int, int]  # first word, and the one after the last


class Reader:
    """Reads single clauses by the words of a material table."""

    def __init__(self, vocabulary: Vocabulary) -> None:
        self.vocabulary = vocabulary
        self._parts = Vocabulary(known_words())

    def __call__(self, text: str) -> Statement:
        """Read a clause."""
        raw = TOKEN.findall(as_usual(text))
        stems = [stem(word) for word in raw]
        spans, compared = self._materials(raw, stems)
        chosen, subject = self._choose(raw, stems, spans)
        if chosen is None:
            return Statement(_join(raw, stems, subject, compared), None, ())
        first = chosen[0]
        while first and raw[first - 1] in MANNER | MODERATE:
            first -= 1
        found = self.vocabulary.match(stems, chosen[0])
        material = found[0] if found else None
        without = compared | set(range(first, chosen[1]))
        manner = tuple(raw[first : chosen[0]])
        return Statement(_join(raw, stems, subject, without), material, manner)

    def _materials(self, raw: list[str], stems: list[str]) -> tuple[list[Span], set[int]]:
        """Spans of the table's phrases outside longer words for parts; words compared with."""
        spans, compared, at = [], set(), 0
        while at < len(raw):
            part, found = self._parts.match(stems, at), self.vocabulary.match(stems, at)
            if part and part[1] > (found[1] if found else 0):
                at += part[1]
                continue
            end = at + (found[1] if found else 1)
            if found and self._is_compared(raw, stems, at, end):
                compared |= set(range(at, end))
            elif found:
                spans.append((at, end))
            at = end
        return spans, compared

    def _is_compared(self, raw: list[str], stems: list[str], at: int, end: int) -> bool:
        """Tell "soft as wool" and "wool soft": nothing is made of it."""
        before = [word for word in raw[max(0, at - 2) : at] if word not in ("a", "an")]
        if before and before[-1] in _LIKE:
            return True
        hard = end < len(raw) and raw[end] in _COMPARED
        return hard and not self._parts.match(stems, end)  # "steel hard shell": a part

    def _is_part(self, stems: list[str], span: Span) -> bool:
        """Whether the span is a word for a part too: "soil", "boulder"."""
        found = self._parts.match(stems, span[0])
        return found is not None and found[1] == span[1] - span[0]

    def _choose(self, raw: list[str], stems: list[str], spans: list[Span]):
        """Span of the material, if any, and the range of the words for the subject."""
        n = len(raw)
        inside = {i for a, b in spans for i in range(a, b)}
        content = [i for i in range(n) if i in inside or not _idle(raw[i], stems[i])]
        cut = raw.index("for") if "for" in raw else 0
        before = [span for span in spans if span[1] <= cut]
        if before:  # "oak for the legs"
            return before[-1], range(cut + 1, n)
        links = (i for i in range(n) if raw[i] in _COPULA and i not in inside)
        link = next((i for i in links if content and content[0] < i), None)
        if link is None:
            return self._attribute(raw, stems, spans, content), range(n)
        after = [span for span in spans if span[0] > link]
        if after:
            return after[0], range(link)
        # "the oak seat is heavy", but "the boulder and the soil are heavy"
        first = next((span for span in spans if span[1] <= link), None)
        head = first and any(first[1] <= i < link for i in content)
        joined = first and raw[first[1]] in ("and", ",")
        return (first if head and not joined else None), range(link)

    def _attribute(self, raw, stems, spans: list[Span], content: list[int]) -> Span | None:
        """Material of a phrase without a verb: "oak legs", "legs oak", "very soft leather"."""
        if not spans:
            return None
        first, last = spans[0], spans[-1]
        others = [i for i in content if not first[0] <= i < first[1]]
        how = any(word in MANNER for word in raw[: first[0]])
        if not others and how and self._is_part(stems, first):
            return None  # "very heavy soil"
        ends = last[1] == len(raw) and self._is_part(stems, first)
        if raw[0] == "make" or (ends and not self._is_part(stems, last)):
            return last
        return first


def _idle(word: str, stem: str) -> bool:
    return (word in _IDLE or stem in _IDLE or not word[0].isalnum()) and stem not in _ALL


def _join(raw: Sequence[str], stems: Sequence[str], where: range, without) -> str:
    kept = [i for i in where if i not in without and not _idle(raw[i], stems[i])]
    return " ".join("everything" if stems[i] in _ALL else stems[i] for i in kept)
