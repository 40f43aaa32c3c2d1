"""A thing in one piece: of one matter, or of parts that are what the words of its text name.

A network that has learned from the tagger is asked about every matter of the text: whether the
thing has it ("a fruit bowl" has no fruit), and which words name the part of it that does. Where
parts have different matters it is divided by these words; else it is read as any part is.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...fem.table import Material, MaterialTable
from ..encoders.minilm import MAX_TOKENS
from .clauses import Bound, Clause, Place, Subject, bind, over
from .english import words as lists
from .lexing import lex
from .materials import lexicon_of
from .parts import part_name_words, part_words, stem
from .reader import parse
from .tagger import (
    CLS,
    SEP,
    WEIGHTS,
    Tagger,
    Words,
    load_tagger,
    place_of,
    shown_name,
    with_second_opinion,
    words_of,
)  # fmt: skip

OWNERS = Path(__file__).parents[1] / "weights" / "one_piece.safetensors"
MEANT, HEARD = 0.5, 0.2  # chance from which the thing has a matter, and one that was heard
NAMED = 0.3  # chance from which a word names the part; the likeliest one does from
LIKELIEST = 0.1  # this one
CALLED, LONGEST_NAME = "object", 24  # a thing without a name; tokens of a name
_ROWS = 8  # questions at once
_LIST = 3  # matters of a list
_ALIAS = re.compile(r"\s*[(\[/=,]?\s*(?:i\.?e\.?)?\s*")  # before another name of a matter
_ENDS = ".'’"  # of a word that a sentence ends with
_JOINED = re.compile(r"[,/&]|\band\b")  # "seat and back"
_LISTED = re.compile(r"\s*(?:[,/&]|,?\s*\band\b)\s*")  # not "or"
_WORD = re.compile(r"\b(?!(?:the|an?|its)\b)[^\W_]+")
_NO_PART = {"all", "whole", "entire", "everything", "filled"}  # alone


class Owned(NamedTuple):
    """Where a matter stands, the chance that the thing has it, and where its part is named."""

    matter: Place
    chance: float
    parts: tuple[Place, ...]


class OwnerFinder(Tagger):
    """Finds what has a matter: "matter [SEP] name of the thing [SEP] text".

    The matter's own place is marked in the text.
    """

    def __init__(self) -> None:
        super().__init__(learned=(WEIGHTS, OWNERS))

    def owners(self, text: str, matters: Sequence[Place], name: str) -> list[Owned]:
        """What the text says of matters, given by their places, of a thing with a name.

        Asked by its name it takes the thing's own parts for other things; asked without one it
        takes other things for parts. So the logarithms of the odds are averaged. The words for
        the parts are those that it finds without a name.
        """
        unnamed, shown = self._asked(text, matters, CALLED), shown_name(name)
        named = unnamed if shown == CALLED else self._asked(text, matters, shown)
        return [
            Owned(place, float(1 / (1 + np.exp(-(one + other) / 2))), parts)
            for place, (one, parts), (other, _) in zip(matters, unnamed, named, strict=True)
        ]

    def _asked(
        self, text: str, matters: Sequence[Place], name: str
    ) -> list[tuple[float, tuple[Place, ...]]]:
        """Of a thing that is called so: for each matter log odds that it has it, and its parts."""
        encoded = self._tokenizer.encode(text, add_special_tokens=False)
        called = self._tokenizer.encode(name, add_special_tokens=False).ids[:LONGEST_NAME]
        rows = []
        for place in matters:
            words = self._tokenizer.encode(text[slice(*place)], add_special_tokens=False).ids
            head = [CLS, *words, SEP, *called, SEP]
            own = np.array([over(offset, place) for offset in encoded.offsets])
            room = MAX_TOKENS - len(head) - 1  # of a longer text what lies around it is seen
            first = int(np.clip(own.argmax() - room // 2, 0, max(len(own) - room, 0)))
            rows.append((head, own[first : first + room], first))
        found: list[tuple[float, tuple[Place, ...]]] = []
        for k in range(0, len(rows), _ROWS):
            batch = rows[k : k + _ROWS]
            tokens = [
                [*head, *encoded.ids[first : first + len(own)], SEP] for head, own, first in batch
            ]
            types = [[0] * len(head) + [int(not x) for x in own] + [0] for head, own, _ in batch]
            logits = self._logits(tokens, types)
            for (head, own, first), said in zip(batch, logits, strict=True):
                said = said[len(head) : len(head) + len(own)]
                chance = 1 / (1 + np.exp(-said[:, 0]))
                offsets = encoded.offsets[first : first + len(own)]
                found.append((float(said[own, 1].mean()), _named(text, offsets, chance)))
        return found


def _named(text: str, offsets: Sequence[Place], chance: np.ndarray) -> tuple[Place, ...]:
    """Words that name a part, those that follow one another together."""
    words = []
    for word in words_of(text):
        own = [c for offset, c in zip(offsets, chance, strict=True) if over(offset, word)]
        mean = float(np.mean(own)) if own else 0.0
        if any(c.isalnum() for c in text[slice(*word)]):
            end = word[0] + len(text[slice(*word)].rstrip(_ENDS))
            words.append(((word[0], end), mean))
        elif words and mean > NAMED:  # the comma of "lid, spout and handle"
            words[-1] = (words[-1][0], max(words[-1][1], mean))
    least = min(NAMED, max((c for _, c in words), default=0.0))
    out: list[Place] = []
    for word, c in words:
        if c < max(least, LIKELIEST):
            continue
        if out and text[out[-1][1] : word[0]].strip() in ("", "-"):
            out[-1] = (out[-1][0], word[1])
        else:
            out.append(word)
    return tuple(out)


@lru_cache(maxsize=1)
def load_owner_finder() -> OwnerFinder:
    """The shipped network, read once."""
    return OwnerFinder()


def of_one_piece(bound: Bound, labels: Sequence[Sequence[str]], table: MaterialTable) -> Bound:
    """Return what a text says of a thing in one piece, by its own words for parts.

    It is read as a part among others (``_of_one_matter``). Its parts have their own matters where
    two of them have two, where matters of several kinds are listed, where the text speaks of a rest
    or an exception, and where that reading still finds matters of two kinds.

    bound: What the grammar read.
    labels: What the asset calls the thing.
    table: Whose rows are materials.
    """
    text, lexicon = bound.sentence.text, lexicon_of(table)
    lexemes = [x for x in lex(text, lexicon, ()).lexemes if x.role == "material"]
    of: dict[Place, Material] = {(x.start, x.end): x.value for x in lexemes}
    for clause in bound.sentence.clauses:  # "abs", in small letters, the grammar reads alone
        place = place_of(clause, text)
        if clause.material and text[slice(*place)].strip() and not any(over(place, x) for x in of):
            of[place] = table.exact(clause.material)
    if not of:
        return _of_one_matter(bound, [], labels, table)
    asked = load_owner_finder().owners(text, sorted(of), labels[0][0])

    def is_purpose(row: Material, end: int) -> bool:
        """Whether it tells what a thing is for: "a fruit bowl"."""
        behind = re.match(r" (\w+)", text[end:])
        of_thing = behind and stem(behind[1]) in part_words()["objects"]
        return bool(of_thing and row.category in lists()["purposes"]["categories"])

    found: list[Owned] = []
    for one in asked:
        parts = tuple(x for x in one.parts if not over(x, one.matter)) or one.parts
        chance = 0.0 if is_purpose(of[one.matter], one.matter[1]) else one.chance
        found.append(Owned(one.matter, chance, parts))
    found = [
        one for one, following in zip(found, [*found[1:], None], strict=True)
        if not (following and _is_said_of(one, following, text))
    ]  # fmt: skip
    for run in _lists([one.matter for one in found], text):  # one meant, all meant; no parts
        most = max(one.chance for one in found if one.matter in run)
        for k, one in enumerate(found):
            if one.matter in run:
                parts = tuple(x for x in one.parts if not any(over(x, y) for y in run))
                found[k] = Owned(one.matter, most, parts)
    subjects = [clause.subject for clause in bound.sentence.clauses]
    apart = any(x.scope == "rest" or x.exceptions for x in subjects)
    if not (apart or _are_apart([x for x in found if x.chance > MEANT] or found, of, text)):
        one_matter = _of_one_matter(bound, found, labels, table)
        said_of = (one_matter.sentence.clauses[k].material for k in one_matter.parts[0].clauses)
        kinds = {table.exact(name).category for name in said_of if name}
        if len(kinds) < 2:  # "aluminium, 6082"
            return one_matter

    def subject(owned: Sequence[Owned], before: Subject) -> Subject:
        names = tuple(dict.fromkeys(
            name for one in owned for place in one.parts
            for words in _JOINED.split(text[slice(*place)].lower())
            if {*(name := tuple(map(stem, _WORD.findall(words))))} - _NO_PART
        ))  # fmt: skip
        in_english = bound.sentence.gloss and before.names
        if not names or in_english or before.exceptions or before.scope == "rest":
            return before
        return Subject("parts", names)

    clauses: list[Clause] = []
    heard: list[Owned] = []
    for clause in bound.sentence.clauses:
        here = place_of(clause, text)
        mine = [one for one in found if over(one.matter, here)]
        meant = [one for one in mine if one.chance > HEARD]
        numbers = any(n.measure not in ("mass", "thickness") for n in clause.numbers)
        if clause.unknown and all(map(lexicon.model.is_word, clause.unknown.lower().split())):
            continue  # "a lamp of the wall"
        said = clause.material or clause.unknown or clause.kind or clause.stiffness
        is_matter = meant or (not mine and said)
        if not (is_matter or numbers or clause.comparisons or clause.excluded):
            continue
        if meant and clause.material:
            clause = replace(clause, subject=subject(meant, clause.subject))
        heard += [one for one in mine if clause.material]
        clauses.append(clause)
    for one in found:
        of_same = {*one.parts} & {place for other in heard for place in other.parts}
        if one.chance <= MEANT or one in heard or of_same:
            continue  # a part has one matter: "of PLA, it looks like steel"
        words = text[slice(*one.matter)]
        alone = lists()["alone"][bound.sentence.language].format(part="part", words=words)
        new = next((c for c in parse(alone, table).clauses if c.material or c.coating), None)
        if new:
            clauses = [c for c in clauses if c.material or not over(place_of(c, text), one.matter)]
            heard.append(one)
            told = subject([one], Subject("none"))
            clauses.append(replace(new, text=words, span=one.matter, subject=told))
    seen = [  # nobody sees what a coat is on
        c if c.material or c.unknown else replace(c, material=c.coating, phrase=c.coating or "")
        for c in sorted(clauses, key=lambda c: c.span)
    ]
    return bind(replace(bound.sentence, clauses=tuple(seen)), labels)


def _part_words(one: Owned, text: str) -> set[str]:
    """Stems of the words that name the part that has a matter."""
    return {stem(word) for a, b in one.parts for word in _WORD.findall(text[a:b].lower())}


def _are_apart(meant: Sequence[Owned], of: Mapping[Place, Material], text: str) -> bool:
    """Whether parts of a thing have different matters, or matters of several kinds are listed.

    Of designations beside each other one is the other's: "EN AC-46000 (AlSi9Cu3(Fe))".
    """
    kept: list[tuple[Owned, set[str]]] = []
    for one in meant:
        words = _part_words(one, text)
        if kept:
            last, before = kept[-1]
            alias = _ALIAS.fullmatch(text[last.matter[1] : one.matter[0]])
            alike = of[last.matter].category == of[one.matter].category
            if alias and alike and (words <= before or before <= words):
                continue
        kept.append((one, words))
    for i, (b, two) in enumerate(kept):
        for a, one in kept[:i]:
            nested = one <= two or two <= one if one and two else one == two
            if of[a.matter] is not of[b.matter] and not nested:
                return True
    runs = _lists([one.matter for one in meant], text)
    return any(len({of[x].category for x in run}) > 1 for run in runs)


def _lists(matters: Sequence[Place], text: str) -> Iterator[Sequence[Place]]:
    """Runs of three matters and more: "oak, steel and brass", no alternatives ("or")."""
    ends = [
        k for k, (a, b) in enumerate(pairwise(matters), 1)
        if not _LISTED.fullmatch(text[a[1] : b[0]])
    ]  # fmt: skip
    for first, last in pairwise([0, *ends, len(matters)]):
        if last - first >= _LIST:
            yield matters[first:last]


def _of_one_matter(
    bound: Bound, found: Sequence[Owned], labels: Sequence[Sequence[str]], table: MaterialTable
) -> Bound:
    """What a text says of a thing read as one part: what it names without what is others'."""
    text, clauses = bound.sentence.text, bound.sentence.clauses
    if any(c.comparisons for c in clauses) and not any(c.material for c in clauses):
        return bound  # "twice as stiff as oak"
    (said,) = load_tagger().said([labels[0][0]], text, bound.sentence.gloss)
    meant = [one.matter for one in found if one.chance > MEANT]
    tagged, own = [w[1:] for w in said.words], {*part_name_words(labels[0][0])}

    def of_another(one: Owned) -> bool:
        """Whether words name another thing that has it, and the tagger has it not of this one."""
        named = _part_words(one, text)
        said_of = any(over(one.matter, x) for x in tagged)
        return bool(named) and not (named & own or said_of)

    # What it is for ("fruit bowl") has the chance 0; others where they are not the only ones
    foreign = [
        one.matter for one in found
        if one.chance == 0 or (one.chance <= HEARD and (meant or of_another(one)))
    ]  # fmt: skip

    def is_foreign(place: Place) -> bool:
        mine = any(over(place, x) for x in meant)
        return not mine and any(over(place, x) for x in foreign)

    clauses = [c for c in clauses if not (c.material and is_foreign(place_of(c, text)))]
    bound = bind(replace(bound.sentence, clauses=tuple(clauses)), labels)
    words = list[Words]()
    for w in said.words:
        start, end = w[1:]
        decides = w.role in ("matter", "number")
        for first, last in foreign if decides else ():  # "wooden fruit" of a bowl
            if over((first, last), (start, end)):
                start, end = (last, end) if first <= start else (start, first)
        matter = [x for x in words if x.role == "matter" == w.role]
        open_ = matter and re.search(r"\b(?:or|oder|ou|o)\b", text[matter[-1].end : start])
        if text[start:end].strip() and not open_:  # of alternatives the first
            words.append(w._replace(start=start, end=end))

    def add(role: str, place: Place) -> None:
        if not any(over(place, w[1:]) for w in words):
            words.append(Words(role, *place))

    if not any(w.role == "matter" for w in words):  # the first, and other names of it
        for before, place in zip([None, *meant], meant, strict=False):
            if before and not _ALIAS.fullmatch(text[before[1] : place[0]]):
                break
            add("matter", place)
    # Numbers of it, or of no other part: "..., silicone. We use E = 70 kPa"
    mine = [w[1:] for w in words if w.role == "matter"]
    for clause in clauses if mine else ():
        here = any(over(place_of(clause, text), x) for x in mine)
        its_own = here if clause.material else all(own & {*n} for n in clause.subject.names)
        for number in clause.numbers if its_own else ():
            at = text.find(number.text, *clause.span)
            if at >= 0:
                add("number", (at, at + len(number.text)))
    if tuple(words) != said.words:  # as sure as the network is of these matters
        sure = min((max(one.chance, 1 - one.chance) for one in found), default=1.0)
        within = min((one.chance for one in found if one.matter in meant), default=1.0)
        words.sort(key=lambda w: w.start)
        said = replace(said, words=tuple(words), certainty=sure, within=within)
    return with_second_opinion(bound, labels, table, [said])


def _is_said_of(one: Owned, following: Owned, text: str) -> bool:
    """Whether a matter only tells what the next one is like: "chromed brass", not "wax candles"."""
    beside = text[one.matter[1] : following.matter[0]].strip() in ("", "-")
    same = {*one.parts} & {*following.parts}
    part = any(over(place, following.matter) for place in same)
    return beside and bool(same) and not part and following.chance > MEANT
