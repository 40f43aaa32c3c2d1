"""The judge: of each part the reading of the text that is likeliest right.

Three read what a text says of a part: the grammar takes the whole text apart; the tagger's words of
the part are read by themselves; the phrase network knows what words of matter mean that no list
has. Of each a logistic regression over how sure they are, what they have in common and how the
words stand in the text gives the chance that it is right. The best is taken, and is a doubt where
its chance is low. ``benchmarks/judge.py`` fits the weights.
"""

from __future__ import annotations

import json
import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, NamedTuple

from ...fem.note import Note
from ...fem.table import MaterialTable
from .clauses import GENERAL, Bound, BoundPart, Clause, Subject
from .english import words as lists
from .languages import bare, languages
from .lexing import in_english, lex
from .materials import ReaderLexicon, atoms, lexicon_of
from .numerals import Comparison, number
from .parts import parts_called
from .phrases import load_phrases
from .reader import parse
from .tagger import MANY, Said, load_tagger, shared_out, shown_name, without_prefix

JUDGE = Path(__file__).parents[1] / "weights" / "judge.json"
READERS = ("grammar", "words", "phrase")
MANY_ROWS = 0.1  # of chance: what a grammar's reading of two matters must be the likelier by
ASIDE = 0.9  # certainty of the tagger that words are no matter of any part
_BESIDE = {"reader.beside_idle", "reader.beside_left"}  # words that say nothing of a matter
_DECIDING = ("matter", "number", "relation", "content")


class Reading(NamedTuple):
    """What one of ``READERS`` takes a text to say of a part, and how it says so."""

    reader: str
    clauses: tuple[Clause, ...]


class Judge:
    """Chances that readings are right, by the weights in a file."""

    def __init__(self, path: Path = JUDGE) -> None:
        data = json.loads(path.read_text(encoding="utf-8"))
        self.weights: dict[str, dict[str, float]] = data["weights"]
        self.doubted: float = data["doubted"]  # a chance below which a reading is a doubt
        self.plain: float = data["plain"]  # above which idle words beside a matter are none

    def chance(self, reader: str, facts: Mapping[str, float]) -> float:
        """Chance in [0, 1] that a reader is right of a part of which there are these facts."""
        own = self.weights[reader]
        return 1 / (1 + math.exp(-sum(own.get(name, 0.0) * x for name, x in facts.items())))


@lru_cache(maxsize=1)
def load_judge() -> Judge:
    """The shipped judge, read once."""
    return Judge()


def with_second_opinion(
    bound: Bound, labels: Sequence[Sequence[str]], table: MaterialTable
) -> Bound:
    """Return what a text says of every part, each by the reading that is likeliest right.

    bound: What the grammar read, and of which part.
    labels: For each part its name, then all other words that the asset has for it.
    table: Whose rows are materials.
    """
    names, text = [own[0] for own in labels], bound.sentence.text
    if not text.strip() or len(names) < 2:
        return bound
    judge = load_judge()
    clauses, parts = [*bound.sentence.clauses], [*bound.parts]
    taken: list[tuple[int, int]] = []  # where the words stand that are read anew
    lexed = lex(text, lexicon_of(table), names)
    every = load_tagger().said(names, text, in_english(text, lexed))
    every = shared_out(every, bound, without_prefix(names), lexed)
    for i, said in enumerate(every):
        readings, facts = readings_of(i, bound, every, labels, table)
        chances = {r.reader: judge.chance(r.reader, facts) for r in readings}
        # Of a part that the grammar gives two matters the tagger's one
        torn = MANY_ROWS * (facts["grammar_rows"] > 0)
        best = max(readings, key=lambda r: chances[r.reader] - torn * (r.reader == "grammar"))
        chance = chances[best.reader]
        if best.reader == "grammar":
            doubts = () if chance > judge.doubted else _doubts_of(best, readings, text, said)
            plain = chance > judge.plain
            for place, k in enumerate(parts[i].clauses):
                kept = [d for d in clauses[k].doubts if not plain or _kind(d) not in _BESIDE]
                anew = (*kept, *doubts) if clauses[k].says_matter else tuple(kept)
                if anew == clauses[k].doubts:
                    continue
                new, doubts = replace(clauses[k], doubts=anew), ()
                if sum(k in part.clauses for part in parts) == 1:
                    clauses[k] = new
                else:  # others have this clause too
                    own = parts[i].clauses
                    own = (*own[:place], len(clauses), *own[place + 1 :])
                    parts[i] = parts[i]._replace(clauses=own)
                    clauses.append(new)
            continue
        spans = [(start, end) for role, start, end in said.words if role in _DECIDING]
        whole = min(start for start, _ in spans), max(end for _, end in spans)
        found = [
            replace(c, text=text[slice(*whole)], span=whole, subject=_subject(names[i]))
            for c in best.clauses
        ]
        if chance <= judge.doubted:
            found = [_guessed(c, best.reader) for c in found]
        elif facts["of_another"] and not facts["grammar"] and chance <= judge.plain:
            note = Note("tagger.of_another", words=text[slice(*whole)])
            found = [replace(c, doubts=(*c.doubts, note)) for c in found]
        again = [d for k in parts[i].clauses for d in clauses[k].doubts]
        again = [d for d in again if _kind(d) == "reader.again"]
        new = range(len(clauses), len(clauses) + len(found))
        clauses += [replace(c, doubts=(*c.doubts, *again)) for c in found]
        parts[i] = BoundPart(tuple(new), ("name",) * len(new))
        taken += spans
    return _without_idle(bound, clauses, parts, taken, every)


def readings_of(
    i: int,
    bound: Bound,
    every: Sequence[Said],
    labels: Sequence[Sequence[str]],
    table: MaterialTable,
    asked: frozenset[int] = frozenset(),
) -> tuple[list[Reading], dict[str, float]]:
    """Readings of a part, the grammar's first, and facts about them that tell which is right.

    ``asked`` are parts whose readings wait for this one's: "as the lid", "as the box".
    """
    names = [own[0] for own in labels]
    text, said, part = bound.sentence.text, every[i], shown_name(names[i])
    own = tuple(bound.sentence.clauses[k] for k in bound.parts[i].clauses)
    notes = [note for note in bound.sentence.notes if isinstance(note, Note)]
    language = next((n.values["language"] for n in notes if n.kind == "lexing.read_as"), "")
    readings = [Reading("grammar", own)]
    words = _words(said, text)
    # Words that the grammar has for it too, and no more
    known = len(own) == 1 and bool(words) and words.lower() in own[0].phrase.lower()
    known = known and not own[0].comparisons and not own[0].numbers
    read: tuple[Clause, ...] = ()
    unread = False
    if words and not known:
        others = names if len(names) <= MANY else names[i : i + 1]
        alone = parse(lists()["alone"][language].format(part=part, words=words), table, others)
        read = tuple(c for c in alone.clauses if c.says_matter)
        unread = bool(alone.unread) or any(c.doubts or c.unknown for c in read)
    beside = _beside(i, text, every, labels, table)
    if beside and beside.comparison:
        told = _related(said, text)
        clause = Clause(told, (0, 0), Subject("none"), comparisons=(beside.comparison,))
        read = (*(c for c in read if not c.comparisons), clause)
    elif beside and beside.other not in asked:  # the same matter
        others, _ = readings_of(beside.other, bound, every, labels, table, asked | {i})
        same = next((r.clauses for r in reversed(others[:2]) if r.clauses), ())
        read = tuple(c for c in same if c.says_matter) or read
    if read:
        readings.append(Reading("words", read))
    phrase = ", ".join(text[start:end] for role, start, end in said.words if role == "matter")
    meant = load_phrases().meant(phrase) if phrase else None
    row = table.phrases.get(meant.row.lower()) if meant else None
    plain = not {"relation", "alternative"} & {role for role, *_ in said.words}
    others_say = {c.material for r in readings for c in r.clauses}
    if row and plain and row.name not in others_say:
        numbers = next((c.numbers for c in read or own if c.numbers), ()) if read or known else ()
        clause = Clause(phrase, (0, 0), Subject("none"), row.name, phrase, numbers=numbers)
        readings.append(Reading("phrase", (clause,)))
    rows = {r.reader: {c.material for c in r.clauses if c.material} for r in readings}
    stated = {
        r.reader: {(n.measure, n.value) for c in r.clauses for n in c.numbers} for r in readings
    }

    def alike(a: str, b: str) -> float:
        one, two = rows.get(a, set()), rows.get(b, set())
        return float(any(_are_alike(table, x, y) for x in one for y in two))

    how, spans = bound.parts[i].how, [(s, e) for r, s, e in said.words if r in _DECIDING]
    held = [
        bound.sentence.clauses[k].span
        for j, bond in enumerate(bound.parts) if j != i
        for k, h in zip(bond.clauses, bond.how, strict=True)
        if h not in GENERAL and k not in bound.parts[i].clauses
    ]  # fmt: skip
    shared = [  # words that the tagger has for other parts too
        any(not w.end <= a and not b <= w.start for a, b in spans) for other in every
        if other is not said for w in other.words
    ]  # fmt: skip
    sure = _logit(said.certainty)
    same_words = known or (bool(rows.get("words")) and rows["words"] <= rows["grammar"])
    same = same_words and stated.get("words", set()) <= stated["grammar"]
    said_own, heard = any(c.says_matter for c in own), bool(words)
    doubtful = any(c.doubts for c in own)
    facts = {
        "one": 1.0,
        "grammar": float(said_own),
        "grammar_row": float(bool(rows["grammar"])),
        "grammar_rows": float(len(rows["grammar"]) > 1),
        "grammar_kind": float(any(c.kind for c in own)),
        "grammar_numbers": float(bool(stated["grammar"])),
        "grammar_relation": float(any(c.comparisons for c in own)),
        "grammar_unknown": float(any(c.unknown for c in own)),
        "grammar_doubts": float(doubtful),
        "grammar_by_name": float(bool(how) and not {*how} <= {*GENERAL}),
        "grammar_in_general": float(bool(how) and {*how} <= {*GENERAL}),
        "mute": float(i in bound.mute),
        "heard": float(heard),
        "sure_of_words": sure * heard,
        "sure_of_these": _logit(said.within) * heard,
        "sure_of_none": sure * (not heard),
        "none_heard_grammar": sure * (not heard and said_own),
        "words_read": float(bool(read)),
        "words_doubtful": float(unread),
        "words_row": float(bool(rows.get("words"))),
        "words_numbers": float(bool(stated.get("words"))),
        "same": float(same),
        "sure_same": sure * same,
        "differ": float(heard and said_own and not same),
        "sure_differ": sure * (heard and said_own and not same),
        "grammar_like_words": alike("grammar", "words"),
        "grammar_like_phrase": alike("grammar", "phrase"),
        "words_like_phrase": alike("words", "phrase"),
        "share": _logit(meant.share) if meant and row else 0.0,
        "no_row": float(bool(meant and not row)),
        "share_grammar": (_logit(meant.share) if meant else 0.0) * alike("grammar", "phrase"),
        "share_against": (_logit(meant.share) if meant and row else 0.0)
        * (bool(rows["grammar"]) and not alike("grammar", "phrase")),
        "of_another": float(any(a <= s and e <= b for a, b in held for s, e in spans)),
        "shared": float(any(shared)),
        "moved": float(said.moved),
        "moved_grammar": float(said.moved and said_own),
        "share_of_words": _logit(said.share) * heard,
        "share_of_none": _logit(said.share) * (not heard),
        "share_moved": _logit(said.share) * said.moved,
        "share_same": _logit(said.share) * same,
        "share_differ": _logit(said.share) * (heard and said_own and not same),
        "relation_heard": float(any(r == "relation" for r, *_ in said.words)),
        "number_heard": float(any(r == "number" for r, *_ in said.words)),
        "alternative": float(any(r == "alternative" for r, *_ in said.words)),
        "excluded": float(any(r == "excluded" for r, *_ in said.words)),
        "language": float(bool(language)),
        "language_grammar": float(bool(language) and said_own),
        "length": math.log(len(text) / 100),
        "parts": math.log(len(names) / 4),
        "long_phrase": math.log(max(len(phrase), 1) / 10) * bool(phrase),
        "spread": math.log(max((max(e for _, e in spans) - min(s for s, _ in spans)) / 10, 1))
        if spans
        else 0.0,
    }
    return readings, facts


def _logit(p: float) -> float:
    p = min(max(p, 0.002), 0.998)
    return math.log(p / (1 - p))


def _kind(doubt: object) -> str:
    return getattr(doubt, "kind", "")


def _subject(name: str) -> Subject:
    return Subject("parts", (tuple(shown_name(name).split()),))


def _doubts_of(
    taken: Reading, readings: Sequence[Reading], text: str, said: Said
) -> tuple[Note, ...]:
    """What is told of the grammar's reading where it is likely wrong."""
    if any(c.doubts or c.unknown for c in taken.clauses):
        return ()
    phrase = next((c.phrase or c.text for c in taken.clauses), "")
    words = _words(said, text)
    other = any(r.reader != "grammar" for r in readings) and words != phrase
    if other and words:
        return (Note("tagger.differs", words=words, phrase=phrase),)
    return (Note("tagger.unsaid", phrase=phrase),)


def _guessed(clause: Clause, reader: str) -> Clause:
    """A clause of a reading that is likely wrong: words of no list are a guess and called so."""
    if reader == "phrase":
        return replace(clause, unknown=clause.phrase)
    if clause.doubts or clause.unknown:
        return clause
    note = Note("tagger.likely", words=clause.phrase or clause.text, row=clause.material or "it")
    return replace(clause, doubts=(*clause.doubts, note))


def _are_alike(table: MaterialTable, a: str, b: str) -> bool:
    """Whether the ranges of two rows have a part in common, in E and in density."""
    one, two = table.exact(a), table.exact(b)
    pairs = (one.E, two.E), (one.rho, two.rho)
    return all(x.min <= y.max and y.min <= x.max for x, y in pairs)


def _without_idle(
    bound: Bound,
    clauses: Sequence[Clause],
    parts: Sequence[BoundPart],
    taken: Sequence[tuple[int, int]],
    every: Sequence[Said],
) -> Bound:
    """The sentence without what spoke of no part, or no longer does, and was read anew.

    Unread words that the tagger surely has for no part, as those of a tolerance, are a note.
    """
    text = bound.sentence.text
    least = min(said.certainty for said in every)
    heard = [(w.start, w.end) for said in every for w in said.words]

    def is_aside(start: int, length: int) -> bool:
        """Whether the tagger surely has these words for no part."""
        here = any(a < start + length and start < b for a, b in heard)
        return least > ASIDE and start >= 0 and not here

    used = {k for part in parts for k in part.clauses}

    def is_anew(k: int) -> bool:
        start, end = clauses[k].span
        return any(start < there and here < end for here, there in taken)

    stale = {k for k in range(len(clauses)) if k not in used and is_anew(k)}
    place = {k: n for n, k in enumerate(k for k in range(len(clauses)) if k not in stale)}
    said = " ".join(text[start:end] for start, end in taken)
    beside = [word for word in bound.sentence.unread if is_aside(text.find(word), len(word))]
    told = Note("reader.aside", words=", ".join(map(repr, dict.fromkeys(beside))))
    sentence = replace(
        bound.sentence,
        clauses=tuple(clauses[k] for k in place),
        notes=(*bound.sentence.notes, *[told] * bool(beside)),
        unread=tuple(
            word for word in bound.sentence.unread if word not in said and word not in beside
        ),
    )
    renamed = (part._replace(clauses=tuple(place[k] for k in part.clauses)) for part in parts)
    parts, unbound = tuple(renamed), (place[k] for k in bound.unbound if k in place)
    mute = (i for i in bound.mute if {*parts[i].how} <= {*GENERAL})
    return Bound(sentence, parts, tuple(unbound), tuple(mute))


def _words(said: Said, text: str) -> str:
    """Words that speak of a part's matter as one phrase."""
    runs: dict[str, list[str]] = {}
    for role, start, end in said.words:
        role = "matter" if role == "number" else role
        runs.setdefault(role, []).append(text[start:end].rstrip(" .,;:"))
    phrase = ", ".join(runs.get("matter", []))
    if phrase and "alternative" in runs:
        phrase += " or " + " ".join(runs["alternative"])
    contents = (f"filled with {words}" for words in runs.get("content", []))
    return ", ".join([*([phrase] if phrase else []), *contents])


def _related(said: Said, text: str) -> str:
    """Words that speak of a part beside another, with those between them."""
    spans = [(start, end) for role, start, end in said.words if role == "relation"]
    return text[spans[0][0] : spans[-1][1]] if spans else ""


def _beside(
    i: int, text: str, every: Sequence[Said], labels: Sequence[Sequence[str]], table: MaterialTable
) -> Relation | None:
    """How the tagger's words put a part beside another."""
    told = _related(every[i], text)
    if not told:
        return None
    at = next(start for role, start, _ in every[i].words if role == "relation")
    ends = [
        (w.end, j) for j, said in enumerate(every) if j != i
        for w in said.words if w.role in ("matter", "number") and w.end <= at
    ]  # fmt: skip
    return relation_of(told, i, labels, max(ends)[1] if ends else None, lexicon_of(table))


# What is said of a part beside another: "ten times the modulus of the bracket", "wie Deckel".
#
# The tagger finds the words; their beginnings, in four languages, tell what is compared, which way
# and how many times (``data/relations.toml``), and names of parts in them with what.

_FACTOR = re.compile(
    r"(?<![\w.,])(\d+(?:[.,]\d+)?) ?(?:x|×|-?fach\w*|[- ]?mal|times|fois|veces)(?!\w)"
)
_PERCENT = re.compile(r"(?<![\w.,])(\d+(?:[.,]\d+)?) ?%")
_LONGEST = 4  # words of a part's name
_MORE = 2.0  # times: what "stiffer" is at the least, and "softer" the other way


class Relation(NamedTuple):
    """A part, by its index, and how another is beside it: None for the same matter."""

    other: int
    comparison: Comparison | None


@lru_cache(maxsize=1)
def _data() -> dict[str, Any]:
    return tomllib.loads((Path(__file__).parent / "data/relations.toml").read_text("utf-8"))


def relation_of(
    said: str, own: int, labels: Sequence[Sequence[str]], before: int | None, lexicon: ReaderLexicon
) -> Relation | None:
    """Return what words say of a part beside another, None where they say nothing of the kind.

    said: Words of a relation.
    own: Index of the part that they are said of.
    labels: For each part its name, then all other words that the asset has for it.
    before: The part that the text speaks of last before them, for "ditto".
    """
    data, low = _data(), said.lower()
    tokens = re.findall(r"[^\W\d_]+", low)
    measures: tuple[Literal["E", "rho"], ...] = ("E", "rho")
    begun = {
        m: next((w for w in tokens for b in data["measured"][m] if w.startswith(b)), "")
        for m in measures
    }
    measure = next((m for m in measures if begun[m]), None)
    found = _named(said, own, labels, lexicon)
    if measure is None:
        same = not {*tokens}.isdisjoint(data["same"]["words"]) or found is not None
        other = before if found is None else found
        return Relation(other, None) if same and other is not None else None
    way = -1 if any(begun[measure].startswith(b) for b in data["less"]["of"]) else 1
    way = -way if any(w.startswith(t) for w in tokens for t in data["less"]["turns"]) else way
    times, share = _FACTOR.search(low), _PERCENT.search(low)
    factor, exact = 1.0, True
    if times:
        factor = number(times[1])
    elif share:
        part = number(share[1]) / 100
        factor = 1 + way * part if any(w in data["more"]["words"] for w in tokens) else part
        way = 1
    elif told := _first(data["times"], low):
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
    name = tuple(re.findall(r"[^\W_]+", labels[other][0]))
    return Relation(other, Comparison(measure, factor, exact, name))


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
    known = {word for names in labels for word in re.findall(r"[^\W\d_]+|\d+", names[0].lower())}
    cut = [
        a for a in atoms(said, lexicon.model, known)
        if len(a.stem) > 1 or a.text.isupper() or a.text.isdigit()
    ]  # fmt: skip
    phrases = [
        tuple(a.stem for a in cut[at : at + size])
        for size in range(_LONGEST, 0, -1) for at in range(len(cut) - size + 1)
    ]  # fmt: skip
    phrases += [  # "la plaque" of a part "plate"
        (english,) for a in cut for language in languages()
        for english in language.names(bare(a.text)) if english
    ]  # fmt: skip
    found = (i for words in phrases for i in parts_called(words, labels) if i != own)
    return next(found, None)
