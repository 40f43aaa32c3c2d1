"""A second opinion: what a learned tagger reads of a part where the grammar is in doubt of it.

The grammar of the reader takes a whole text apart; the tagger asks of each part which words speak
of it, and these are read by themselves: "the seat is soft foam". Where the grammar has nothing or
only doubts, or the tagger is surer than it errs, its reading is taken. What the grammar says
without a doubt and the tagger reads otherwise is told.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ...fem.note import Note
from ...fem.table import MaterialTable
from .clauses import Bound, BoundPart, Clause, Sentence, Subject
from .english import words as lists
from .reader import parse
from .tagger import Said, load_tagger, shown_name

# Least certainty of the tagger to be heard where the grammar is in doubt, and where it is not. On a
# set that neither was made on, .9 to .98 and .98 to .995 gave within 5 of 936 parts the same.
LIKELY, SURE = 0.9, 0.995
_DECIDING = ("matter", "number", "relation", "content")


def with_second_opinion(
    bound: Bound, labels: Sequence[Sequence[str]], table: MaterialTable
) -> Bound:
    """Return what a text says of every part, with the tagger's reading where that is the better.

    bound: What the grammar read, and of which part.
    labels: For each part its name, then all other words that the asset has for it.
    table: Whose rows are materials.
    """
    names, text = [own[0] for own in labels], bound.sentence.text
    if not text.strip() or len(names) < 2:
        return bound
    notes = [note for note in bound.sentence.notes if isinstance(note, Note)]
    language = next((n.values["language"] for n in notes if n.kind == "lexing.read_as"), "")
    clauses, parts = [*bound.sentence.clauses], [*bound.parts]
    taken: list[tuple[int, int]] = []  # where the words stand that the tagger's readings are of
    for i, said in enumerate(load_tagger().said(names, text)):
        own = [clauses[k] for k in parts[i].clauses]
        words = _words(said, text)
        doubtful = not any(c.says_matter for c in own) or any(c.doubts or c.unknown for c in own)
        if not words or said.certainty < (LIKELY if doubtful else SURE):
            continue
        if any(c.phrase.lower() == words.lower() for c in own):
            continue
        part = shown_name(names[i])
        read = parse(lists()["alone"][language].format(part=part, words=words), table, names)
        found = [c for c in read.clauses if c.says_matter]
        (rows, numbers), (own_rows, own_numbers) = _said(found), _said(own)
        if own and any(c.kind for c in found):  # "wood" says less than what is there
            continue
        if not found or (rows <= own_rows and numbers <= own_numbers) or _is_doubtful(read, found):
            continue
        subject = Subject("parts", (tuple(part.split()),))
        spans = [(start, end) for role, start, end in said.words if role in _DECIDING]
        taken += spans
        whole = min(start for start, _ in spans), max(end for _, end in spans)
        new = range(len(clauses), len(clauses) + len(found))
        clauses += [replace(c, text=words, span=whole, subject=subject) for c in found]
        parts[i] = BoundPart(tuple(new), ("name",) * len(new))
    return _without_idle(bound, clauses, parts, taken) if taken else bound


def _without_idle(
    bound: Bound,
    clauses: Sequence[Clause],
    parts: Sequence[BoundPart],
    taken: Sequence[tuple[int, int]],
) -> Bound:
    """The sentence without what spoke of no part, or no longer does, and was read anew."""
    used = {k for part in parts for k in part.clauses}

    def is_anew(k: int) -> bool:
        start, end = clauses[k].span
        return any(start < there and here < end for here, there in taken)

    stale = {k for k in range(len(clauses)) if k not in used and is_anew(k)}
    place = {k: n for n, k in enumerate(k for k in range(len(clauses)) if k not in stale)}
    said = " ".join(bound.sentence.text[start:end] for start, end in taken)
    sentence = replace(
        bound.sentence,
        clauses=tuple(clauses[k] for k in place),
        unread=tuple(word for word in bound.sentence.unread if word not in said),
    )
    renamed = (part._replace(clauses=tuple(place[k] for k in part.clauses)) for part in parts)
    return Bound(sentence, tuple(renamed), tuple(place[k] for k in bound.unbound if k in place))


def _words(said: Said, text: str) -> str:
    """Words that speak of a part's matter as one phrase."""
    runs: dict[str, list[str]] = {}
    for role, start, end in said.words:
        role = "matter" if role == "number" else role
        runs.setdefault(role, []).append(text[start:end].rstrip(" .,;:"))
    phrase = ", ".join(runs.get("matter", []))
    if phrase and "alternative" in runs:
        phrase += " or " + " ".join(runs["alternative"])
    return ", ".join(
        [*([phrase] if phrase else []), *runs.get("relation", []),
         *(f"filled with {words}" for words in runs.get("content", []))]
    )  # fmt: skip


def _said(clauses: Sequence[Clause]) -> tuple[set[str], set[tuple[str, float]]]:
    """Rows and numbers that clauses name."""
    rows = {c.material for c in clauses if c.material}
    return rows, {(n.measure, n.value) for c in clauses for n in c.numbers}


def _is_doubtful(read: Sentence, found: Sequence[Clause]) -> bool:
    return bool(read.unread) or any(c.doubts or c.unknown for c in found)
