"""The span tagger: which words of a text speak of the matter of each part.

all-MiniLM-L6-v2 with low-rank changes of its weights (LoRA, Hu et al. 2021) reads "part [SEP] the
other parts [SEP] text" and gives each piece of the text a role. A word's role is decided by the
mean over its pieces. ``autophyx-tet train tagger`` learns the changes from made texts.

What it says of all parts is then shared out among them. It is a second opinion: a judge takes it
where that is likelier right than what the grammar read.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ...fem.note import Note
from ...fem.table import MaterialTable
from ..encoders.minilm import MAX_TOKENS, MiniLM
from ..packed import unpacked
from .clauses import GENERAL, Bound, BoundPart, Clause, Gloss, Place, Subject, over
from .english import words as lists
from .materials import lexicon_of
from .parts import known_parts, part_words, parts_called, places
from .phrases import Meant, load_phrases, values_of
from .reader import parse
from .relations import BY_FACTOR, LEFT_OPEN, Relation, left_open, relation_of

WEIGHTS = Path(__file__).parents[1] / "weights" / "tagger.safetensors"
JUDGE = Path(__file__).parents[1] / "weights" / "judge.json"
SHARING = Path(__file__).parents[1] / "weights" / "sharing.json"
# What a word says of the part that is asked about; the first two after none decide its material.
ROLES = (
    "none", "matter", "number", "coating", "content", "excluded", "alternative", "relation",
)  # fmt: skip
CLS, SEP = 101, 102  # tokens of BERT
LONGEST_QUESTION = 96  # tokens; the names of more neighbours are left out
_CUT = re.compile(r"(?<=[a-z])(?=[A-Z])|(?<=[^\W\d_])(?=\d)|(?<=\d)(?=[^\W\d_]{2})|[\W_]+")
_NUMBER = re.compile(r"(?: \d+)+$")
_DIGITS = re.compile(r"(?: \d+)+(?= \[SEP\])")
_APART = re.compile(lists()["hedges"]["apart"])  # "two of the legs", "the third"


@lru_cache(maxsize=4096)
def shown_name(name: str) -> str:
    """Words of a part's name: "legFL_01" -> "leg front left 1"."""
    longer = part_words()["abbreviated"]
    words = [longer.get(word.lower(), word) for word in _CUT.split(name) if word]
    shown = [
        lists()["sides"].get(word.lower(), word.lower()) if i else word.lower()
        for i, word in enumerate(words)
    ]
    return " ".join(str(int(w)) if w.isdecimal() else w for w in shown) or "part"


@lru_cache(maxsize=4096)
def _unnumbered(name: str) -> str:
    return _NUMBER.sub("", shown_name(name))


def without_prefix(names: Sequence[str]) -> list[str]:
    """Names without the words, two or more, that all of them begin with: a file's, an asset's.

    >>> without_prefix(["Cafe_chair_Alu frame", "Cafe_chair_seat"])
    ['Alu frame', 'seat']
    >>> without_prefix(["leg_1", "leg_2"])
    ['leg_1', 'leg_2']
    """
    cut = [[m.end() for m in re.finditer(r"[^\W_]+[\W_]+", name)] for name in names]
    for count in range(min(map(len, cut), default=0), 1, -1):
        same = len({name[: ends[count - 1]] for name, ends in zip(names, cut, strict=True)}) == 1
        rest = [name[ends[count - 1] :] for name, ends in zip(names, cut, strict=True)]
        if same and len(names) > 1 and all(re.search(r"[^\W\d_]", name) for name in rest):
            return rest
    return [*names]


def question(names: Sequence[str], i: int) -> str:
    """What is asked about a part: its name, then the others' without their numbers."""
    others = (_unnumbered(name) for j, name in enumerate(names) if j != i)
    return f"{shown_name(names[i])} [SEP] " + ", ".join(dict.fromkeys(others))


def _numbers_in(text: str) -> set[int]:
    return {int(digits) for digits in re.findall(r"\d+", text) if digits.isdecimal()}


def asked(question: Sequence[int], text: Sequence[int]) -> tuple[list[int], int]:
    """Tokens of a question and a text, and how many of them stand before the text."""
    head = [CLS, *question[:LONGEST_QUESTION], SEP]
    return [*head, *text, SEP], len(head)


class Words(NamedTuple):
    """Words of a text, from ``start`` to ``end``, that speak of a part in a role."""

    role: str
    start: int
    end: int


@dataclass(frozen=True)
class Said:
    """What a text says of a part: its words in their order, and how sure that is.

    ``certainty`` is that of the least sure decision on a word of the text, ``within`` on one of
    those found. ``matter`` has the chance of every word of the text that it decides the material.
    ``share`` is the chance of these words beside what is said of the other parts, by which they
    may be ``moved``.
    """

    words: tuple[Words, ...]
    certainty: float
    within: float = 1.0
    matter: tuple[float, ...] = field(default=(), repr=False)
    share: float = 1.0
    moved: bool = False


# A word with what joins it from within; a sign by itself.
_WORD = re.compile(r"(?:[^\s()\[\]{}<>|;:=/,\"“”„!?•*]|(?<=\d),(?=\d))+|[^\s]")
_STRIDE = 2 / 3  # of a window, to the next one in a long text
_ROWS = 8  # questions at once
MANY, _LAST = 32, re.compile(r"[\W_]*\d+$")  # parts; the number at the end of a name


class Tagger(MiniLM):
    """Gives each word of a text its role for each part.

    Parameters
    ----------
    folder
        Folder of the weights of MiniLM; by default the installed ones.
    learned
        Files of changes of these weights, one upon the other, and of the last layer.

    Raises
    ------
    InputError
        If the package that holds MiniLM is not installed.
    """

    def __init__(self, folder: Path | None = None, learned: Sequence[Path] = (WEIGHTS,)) -> None:
        from safetensors.numpy import load_file

        super().__init__(folder)
        self._tokenizer.no_truncation()
        for path in learned:
            found = unpacked(load_file(path))
            for key, weight in found.items():
                kind, _, name = key.partition(".")
                if kind == "learned":
                    self._weights[name] = weight
                elif kind == "up":
                    self._weights[name] = self._weights[name] + weight @ found[f"down.{name}"]
            self._role = found["role.weight"].T, found["role.bias"]

    def said(self, names: Sequence[str], text: str, gloss: Gloss | None = None) -> list[Said]:
        """What a text says of each part, by their names.

        Of a text of another language its English ``gloss`` is asked about too, and the mean taken.
        """
        said, names = _numbers_in(text), without_prefix(names)
        if len(names) > MANY:  # those that only a number tells apart are asked about once
            names = [n if _numbers_in(n) & said else _LAST.sub("", n) for n in names]
        questions = [question(names, i) for i in range(len(names))]
        # So are fewer, by the first of them, of a text that tells none of them apart
        alike: dict[str, str] = {}
        if not said & _numbers_in(" ".join(questions)) and not _APART.search(text):
            questions = [alike.setdefault(_DIGITS.sub("", q), q) for q in questions]
        asks, words = [*dict.fromkeys(questions)], words_of(text)
        found = self._of_words(asks, text, words)
        if gloss is not None:
            there = words_of(gloss.text)
            others = self._of_words(asks, gloss.text, there)
            here, at = _by_character(text, words), _by_character(gloss.text, there)
            same: dict[int, set[int]] = {}  # words of the gloss that stand for a word
            for start, end, first, last in gloss.places:
                for k in {here[c] for c in range(first, last)} - {-1}:
                    same.setdefault(k, set()).update({at[c] for c in range(start, end)} - {-1})
            for k, own in same.items():
                if own:
                    found[:, k] = (found[:, k] + others[:, sorted(own)].mean(axis=1)) / 2
        decided = {q: _decoded(text, words, p) for q, p in zip(asks, found, strict=True)}
        return [decided[q] for q in questions]

    def _of_words(
        self, asks: Sequence[str], text: str, words: Sequence[Place]
    ) -> Float[np.ndarray, "asks words roles"]:
        """Chances of the roles of a text's words: the mean over their pieces."""
        encoded = self._tokenizer.encode(text, add_special_tokens=False)
        ids = [self._tokenizer.encode(ask, add_special_tokens=False).ids for ask in asks]
        pieces = np.array(self._roles(ids, encoded.ids)).reshape(len(asks), -1, len(ROLES))
        out = np.zeros((len(asks), len(words), len(ROLES)), np.float32)
        out[..., 0] = 1.0
        at = 0
        for k, (start, end) in enumerate(words):
            own = []
            while at < len(encoded.offsets) and encoded.offsets[at][0] < end:
                own += [at] if encoded.offsets[at][1] > start else []
                at += 1
            said = [i for i in own if any(c.isalnum() for c in text[slice(*encoded.offsets[i])])]
            if own:
                out[:, k] = pieces[:, said or own].mean(axis=1)
        return out

    def _logits(
        self, rows: Sequence[Sequence[int]], types: Sequence[Sequence[int]]
    ) -> Float[np.ndarray, "rows tokens roles"]:
        """What the last layer says of rows of tokens and their types, the shorter ones padded."""
        shape = len(rows), max(map(len, rows))
        tokens, kinds, seen = (
            np.zeros(shape, np.int64),
            np.zeros(shape, np.int64),
            np.zeros(shape, bool),
        )
        for i, (own, of_own) in enumerate(zip(rows, types, strict=True)):
            tokens[i, : len(own)], kinds[i, : len(own)], seen[i, : len(own)] = own, of_own, True
        with self._arrays.sparing():
            hidden = self._forward(tokens, kinds, None if seen.all() else seen)
            return hidden @ self._role[0] + self._role[1]

    def _roles(
        self, asks: Sequence[Sequence[int]], text: Sequence[int]
    ) -> list[Float[np.ndarray, "tokens roles"]]:
        """Probabilities of the roles of a text's tokens, for each question."""
        windows: list[tuple[int, int, list[int], int]] = []  # question, first token, row, head
        for i, ask in enumerate(asks):
            room = MAX_TOKENS - len(asked(ask, ())[0])
            step = max(1, int(room * _STRIDE))
            starts = range(0, len(text) - room, step) if len(text) > room else range(1)
            for start in (*starts, len(text) - room) if len(text) > room else starts:
                windows.append((i, start, *asked(ask, text[start : start + room])))
        out = [np.zeros((len(text), len(ROLES)), np.float32) for _ in asks]
        inner = [np.full(len(text), -1) for _ in asks]  # how far from a window's edge it was seen
        windows.sort(key=lambda w: len(w[2]))
        for k in range(0, len(windows), _ROWS):
            batch = windows[k : k + _ROWS]
            types = [[0] * head + [1] * (len(own) - 1 - head) + [0] for _, _, own, head in batch]
            logits = self._logits([own for _, _, own, _ in batch], types)
            logits = np.exp(logits - logits.max(axis=-1, keepdims=True))
            logits /= logits.sum(axis=-1, keepdims=True)
            for row, (i, start, own, head) in enumerate(batch):
                count = len(own) - 1 - head
                far = np.minimum(np.arange(count), np.arange(count)[::-1])
                where = slice(start, start + count)
                better = far > inner[i][where]
                out[i][where][better] = logits[row, head : head + count][better]
                inner[i][where][better] = far[better]
        return out


def words_of(text: str) -> list[Place]:
    """Where the words of a text stand, and its signs."""
    return [(m.start(), m.end()) for m in _WORD.finditer(text)]


def _by_character(text: str, words: Sequence[Place]) -> list[int]:
    """Which word each character of a text belongs to, -1 for none."""
    out = [-1] * len(text)
    for k, (start, end) in enumerate(words):
        out[start:end] = [k] * (end - start)
    return out


def _decoded(text: str, words: Sequence[Place], chances: Float[np.ndarray, "words roles"]) -> Said:
    """Roles of whole words: what a part is of where these two are likelier than all others."""
    found: list[Words] = []
    least, within = 1.0, 1.0
    each = chances[:, 1] + chances[:, 2]
    for (start, end), mean, matter in zip(words, chances, each, strict=True):
        said = any(c.isalnum() for c in text[start:end])
        if said:
            least = min(least, max(matter, 1 - matter))
        if said and matter > 0.5:
            within = min(within, matter)
        role = int(mean[1:3].argmax()) + 1 if matter > 0.5 else int(mean.argmax())
        if matter <= 0.5 and role in (0, 1, 2):
            continue
        end = start + (len(text[start:end].rstrip(".,;:!?")) or end - start)
        gap = text[found[-1].end : start] if found else None
        joins = gap is not None and "\n" not in gap and gap.strip() in ("", "-", "–")
        joins |= gap == "/"  # "lb/in^3", "carbon/epoxy"
        if joins and _kin(found[-1].role, ROLES[role]):
            found[-1] = found[-1]._replace(end=end)
        else:
            found.append(Words(ROLES[role], start, end))
    return Said(tuple(found), float(least), float(within), tuple(map(float, each)))


def _kin(a: str, b: str) -> bool:
    """Whether two roles both decide the material, or are one."""
    return a == b or {a, b} <= {"matter", "number"}


@lru_cache(maxsize=1)
def load_tagger() -> Tagger:
    """The shipped tagger, read once."""
    return Tagger()


# Sharing out. The tagger is asked about one part at a time; here what it says of all is put beside
# each other: no matter is said for nothing, parts of one name are mostly alike, and who writes a
# list mostly keeps to one order. What speaks for an assignment of stretches of matter to parts is
# summed in logarithms of odds (a conditional random field), a beam search over the parts in the
# file's order keeps the best, and the chance of a stretch is the share of those that have it: in
# long lists, whose kept assignments agree on the first parts, more of 0 and 1 than it should be.
# ``benchmarks/sharing.py`` fits the weights.

HEARD = 0.3  # chance from which a word may be of a matter
KEPT = 40  # assignments, from one part to the next
MOST = 2000  # pairs of a part and a stretch; beyond, each part is heard alone
SURE = (0.005, 0.995)  # chances that the tagger is believed at most


@lru_cache(maxsize=1)
def load_sharing() -> dict[str, float]:
    """What speaks for an assignment, in logarithms of odds."""
    return json.loads(SHARING.read_text(encoding="utf-8"))


class Stretch(NamedTuple):
    """Words of one matter: where they stand, and the first and the last of the text's words."""

    start: int
    end: int
    first: int
    last: int


def stretches(text: str, every: Sequence[Said], matters: Sequence[Place]) -> list[Stretch]:
    """Words that may be of a matter, by the tagger or a list, where no sign stands between them.

    Words of which the tagger has one for these parts and the other for those are two stretches.
    """
    words, found = words_of(text), list[Stretch]()
    chance = np.array([said.matter for said in every])
    excluded = [(w.start, w.end) for said in every for w in said.words if w.role == "excluded"]
    for k, (start, end) in enumerate(words):
        listed = any(over((start, end), x) for x in matters)
        listed = listed and not any(over((start, end), x) for x in excluded)
        if not any(c.isalnum() for c in text[start:end]):
            continue
        if not listed and chance[:, k].max() <= HEARD:
            continue
        before = found[-1] if found and found[-1].last == k - 1 else None
        gap = text[before.end : start] if before else "\n"
        mine, others = chance[:, k] > 0.5, chance[:, k - 1] > 0.5
        one = not mine.any() or not others.any() or bool((mine & others).any())
        if before and one and "\n" not in gap and gap.strip() in ("", "-", "–"):
            found[-1] = before._replace(end=end, last=k)
        else:
            found.append(Stretch(start, end, k, k))
    return found


def shared_out(every: Sequence[Said], bound: Bound, names: Sequence[str]) -> list[Said]:
    """What is said of each part, with a stretch in place of its words where that is likelier.

    every: What the tagger says of each part alone.
    bound: What the grammar read.
    names: Those of the parts, without what all begin with.
    """
    text, said = bound.sentence.text, list[Said]()
    found, chances = chances_of(every, bound, names)
    for own, likely in zip(every, chances, strict=True):
        best = int(likely.argmax())
        spans = [(w.start, w.end) for w in own.words if w.role in ("matter", "number")]
        mine = [any(over((s.start, s.end), x) for x in spans) for s in found]
        beside = not spans and any(w.role == "relation" for w in own.words)
        if best == len(found) or mine[best] or beside:
            share = float(likely[:-1][mine].sum() if any(mine) else likely[-1])
            said.append(replace(own, share=share))
            continue
        start, end, p = found[best].start, found[best].end, float(likely[best])
        alone = not any(over((start, end), x) for x in bound.sentence.matters)
        alone &= any(over((start, end), x) for x in bound.sentence.numbers)
        last = start + len(text[start:end].rstrip(".,;:!?"))
        words = Words("number" if alone else "matter", start, last)
        others = (w for w in own.words if w.role not in ("matter", "number", "relation"))
        anew = tuple(sorted((*others, words), key=lambda w: w.start))
        said.append(Said(anew, p, p, own.matter, p, moved=True))
    return said


def chances_of(
    every: Sequence[Said], bound: Bound, names: Sequence[str]
) -> tuple[list[Stretch], Float[np.ndarray, "parts options"]]:
    """Stretches of a text and their chances for each part; the last one is that of none.

    Parameters as of `shared_out`.
    """
    weights, text = load_sharing(), bound.sentence.text
    matters = bound.sentence.matters
    found = stretches(text, every, [*matters, *bound.sentence.numbers])
    # Parts that were asked about at once have one answer
    first = [next(j for j in range(i + 1) if every[j] is said) for i, said in enumerate(every)]
    asked = [*dict.fromkeys(first)]
    if not found or len(asked) * len(found) > MOST:
        return [], np.full((len(every), 1), 0.5)
    every_word = np.array([every[i].matter for i in asked])
    chance = np.stack([every_word[:, s.first : s.last + 1].mean(axis=1) for s in found], axis=1)
    odds = np.clip(chance, *SURE)
    score = weights["tagger"] * np.log(odds / (1 - odds))
    for row, i in enumerate(asked):
        by_name = np.zeros(len(found), bool)
        for k, how in zip(bound.parts[i].clauses, bound.parts[i].how, strict=True):
            place = place_of(bound.sentence.clauses[k], text)
            here = np.array([over(place, (s.start, s.end)) for s in found])
            if how in GENERAL:
                score[row] += weights["in_general"] * here
            else:
                by_name |= here
        if by_name.any():
            score[row] += np.where(by_name, weights["named"], -weights["named_another"])
        elif _points(bound, i):  # "same as the stem": no words of its own
            score[row] -= weights["named"]
    listed = np.array([any(over((s.start, s.end), x) for x in matters) for s in found])
    heard = np.maximum(chance.max(axis=0), weights["listed"] * listed)
    kinds = [_called(names[i]) for i in asked]
    chances = _chances(score, weights["unclaimed"] * heard, kinds, weights)
    return found, chances[[asked.index(i) for i in first]]


def _chances(
    score: Float[np.ndarray, "parts stretches"],
    unclaimed: Float[np.ndarray, " stretches"],
    kinds: Sequence[str],
    weights: Mapping[str, float],
) -> Float[np.ndarray, "parts stretches+1"]:
    """Chances of each stretch for each part, and of none, the last option."""
    parts, count = score.shape
    # An assignment: its score, the stretch of each part, the last one, kinds that have a stretch
    kept: list[tuple[float, tuple[int, ...], int, frozenset[tuple[int, str]], frozenset[int]]]
    kept = [(0.0, (), -1, frozenset(), frozenset())]
    for i in range(parts):
        more = []
        for total, chosen, last, owners, taken in kept:
            more.append((total + weights["none"], (*chosen, count), last, owners, taken))
            for c in range(count):
                own = (c, kinds[i]) in owners
                step = c - last
                move = (
                    "next" if step == 1 else "later" if step > 1 else "earlier" if step else "same"
                )
                new = total + score[i, c] + (0.0 if c in taken else unclaimed[c])
                new += weights["alike" if own else move]
                more.append((new, (*chosen, c), c, owners | {(c, kinds[i])}, taken | {c}))
        kept = sorted(more, key=lambda one: -one[0])[:KEPT]
    share = np.exp([one[0] - kept[0][0] for one in kept])
    out = np.zeros((parts, count + 1))
    for weight, one in zip(share / share.sum(), kept, strict=True):
        out[np.arange(parts), one[1]] += weight
    return out


def place_of(clause: Clause, text: str) -> Place:
    """Where a clause's matter stands in the text, or all of the clause."""
    words = clause.phrase or clause.unknown
    at = text.find(words, clause.span[0]) if words else -1
    return (at, at + len(words)) if 0 <= at < clause.span[1] else clause.span


def _points(bound: Bound, i: int) -> bool:
    """Whether the grammar has a part's matter from what is said of another: "same as the lid"."""
    text, clauses = bound.sentence.text, bound.sentence.clauses
    own = [clauses[k] for k in bound.parts[i].clauses]
    others = [o for o in clauses if o not in own]
    for clause in own:
        said = [clause.phrase] if clause.phrase else [q.text for q in clause.numbers]
        if said and not any(words in text[slice(*clause.span)] for words in said):
            what = (clause.material, () if clause.phrase else clause.numbers)
            if any(what == (o.material, what[1] and o.numbers) for o in others):
                return True
    return False


def _called(name: str) -> str:
    """What parts are called that are told apart by numbers and sides."""
    words = [word for word in shown_name(name).split() if not word.isdigit()]
    return " ".join([word for word in words if word not in places()] or words)


# The judge. Three read what a text says of a part: the grammar takes the whole text apart; the
# tagger's words of the part are read by themselves; the phrase network knows what words of matter
# mean that no list has. From how sure they are, what they have in common and how the words stand in
# the text a small network gives the chance of each that it is right. The best is taken, and is a
# doubt where its chance is low. ``benchmarks/judge.py`` fits the weights.

READERS = ("grammar", "words", "phrase")
MANY_ROWS = 0.1  # of chance: what a grammar's reading of two matters must be the likelier by
ASIDE = 0.9  # certainty of the tagger that words are no matter of any part
LIKELY = 0.75  # chance of a reading from which what is said of all is one part's, if heard for it
_BESIDE = {"reader.beside_idle", "reader.beside_left"}  # words that say nothing of a matter
_SAME = re.compile(lists()["hedges"]["same"])
_TWEAK, _THAN = (
    re.compile(r"(?i)%|per ?cent|prozent|por ?cien|pour ?cent"),
    re.compile(r"(?i)(?<!\w)(?:than|as|of|like|als|wie|que|de|del|du)(?!\w)"),
)
_DECIDING = ("matter", "number", "relation", "content")


class Reading(NamedTuple):
    """What one of ``READERS`` takes a text to say of a part, and how it says so."""

    reader: str
    clauses: tuple[Clause, ...]


class Judge:
    """Chances that readings are right, by one hidden layer of ReLU: ``data`` is as in ``JUDGE``."""

    def __init__(self, data: Mapping[str, Any]) -> None:
        self.facts: list[str] = data["facts"]
        self._hidden, self._out = np.array(data["hidden"]), np.array(data["out"])  # shifts last
        self.doubted: float = data["doubted"]  # a chance below which a reading is a doubt
        self.plain: float = data["plain"]  # above which idle words beside a matter are none

    def chance(self, reader: str, facts: Mapping[str, float]) -> float:
        """Chance in [0, 1] that a reader is right of a part of which there are these facts."""
        hidden = np.maximum(self._hidden @ [*(facts[name] for name in self.facts), 1.0], 0)
        return float(1 / (1 + np.exp(-self._out[READERS.index(reader)] @ [*hidden, 1.0])))


@lru_cache(maxsize=1)
def load_judge() -> Judge:
    """The shipped judge, read once."""
    return Judge(json.loads(JUDGE.read_text(encoding="utf-8")))


def with_second_opinion(
    bound: Bound, labels: Sequence[Sequence[str]], table: MaterialTable, every: Sequence[Said] = ()
) -> Bound:
    """Return what a text says of every part, each by the reading that is likeliest right.

    bound: What the grammar read, and of which part.
    labels: For each part its name, then all other words that the asset has for it.
    table: Whose rows are materials.
    every: What is heard of each part; by default the tagger's, shared out among them.
    """
    names, text = [own[0] for own in labels], bound.sentence.text
    if not text.strip():
        return bound
    judge = load_judge()
    clauses, parts = [*bound.sentence.clauses], [*bound.parts]
    taken: list[tuple[int, int]] = []  # where the words stand that are read anew
    notes: list[Note] = []
    if not every:
        every = load_tagger().said(names, text, bound.sentence.gloss)
        every = shared_out(every, bound, without_prefix(names))
    # "All steel except the legs", of which the tagger hears steel all the same
    for clause in (c for c in bound.sentence.clauses if c.subject.exceptions):
        left_out = {i for e in clause.subject.exceptions for i in parts_called(e, labels)}
        every = [
            replace(s, words=tuple(w for w in s.words if not over((w.start, w.end), clause.span)))
            if i in left_out else s
            for i, s in enumerate(every)
        ]  # fmt: skip
    for i, said in enumerate(every):
        readings, facts = readings_of(i, bound, every, labels, table)
        chances = {r.reader: judge.chance(r.reader, facts) for r in readings}
        # Of a part that the grammar gives two matters the tagger's one
        torn = MANY_ROWS * (facts["grammar_rows"] > 0)
        # What is said of a third is not of a part that is as another
        torn -= facts["grammar_points"] * facts["of_another"]
        # How many times another's E it has is more than nothing, or a strange word
        told = [r for r in readings[1:] if any(x.exact for c in r.clauses for x in c.comparisons)]
        grammar = ("grammar_row", "grammar_numbers", "grammar_relation")
        torn += bool(told) and not any(facts[fact] for fact in grammar)
        best = max(readings, key=lambda r: chances[r.reader] - torn * (r.reader == "grammar"))
        chance = chances[best.reader]
        if best.reader == "grammar":
            doubts = _doubts_of(best, readings, text, said, likely=chance > judge.doubted)
            plain = chance > judge.plain
            own, how = parts[i]
            if facts["same"] and facts["heard"] and chance > LIKELY:
                # Given to all for want of a part that it names, and heard for this one and not for
                # all; "it is brass" too, where the text says no other matter of this part
                alone = any(other.words != said.words for other in every)
                lost = (
                    i in bound.mute or (alone and clauses[k].subject.scope not in GENERAL)
                    for k in own
                )  # fmt: skip
                how = tuple(
                    "name" if way in GENERAL and each else way
                    for way, each in zip(how, lost, strict=True)
                )
                parts[i] = BoundPart(own, how)
            for place, k in enumerate(own):
                kept = [d for d in clauses[k].doubts if not plain or _kind(d) not in _BESIDE]
                kept = [d for d in kept if not _is_settled(d, plain, i, every)]
                anew = (*kept, *doubts) if clauses[k].says_matter else tuple(kept)
                if anew == clauses[k].doubts:
                    continue
                new, doubts = replace(clauses[k], doubts=anew), ()
                if sum(k in part.clauses for part in parts) == 1:
                    clauses[k] = new
                else:  # others have this clause too
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
        if facts["of_none"] and not facts["grammar"]:
            strange = (bound.sentence.clauses[k] for k in bound.unbound)
            heads = {n[-1] for c in strange if over(c.span, whole) for n in c.subject.names}
            called = shown_name(names[i]).lower()
            other = {head for head in heads & known_parts() if head not in called}
            told = {"words": text[slice(*whole)], "part": names[i]}
            note = Note("tagger.of_other", **told) if other else Note("tagger.of_none", **told)
            found = [replace(c, doubts=(*c.doubts, note)) for c in found]
        opened = _doubts_of(best, readings, text, said, likely=True)
        found = [replace(c, doubts=(*c.doubts, *opened)) for c in found]
        again = [d for k in parts[i].clauses for d in clauses[k].doubts]
        again = [d for d in again if _kind(d) == "reader.again"]
        again = [d for d in again if not _is_settled(d, chance > judge.plain, i, every)]
        new = range(len(clauses), len(clauses) + len(found))
        clauses += [replace(c, doubts=(*c.doubts, *again)) for c in found]
        parts[i] = BoundPart(tuple(new), ("name",) * len(new))
        taken += spans
    for i, (own, how) in enumerate(parts):  # "B twice as stiff as A" says nothing of A
        heard = any(w.role == "relation" for w in every[i].words)
        bonds = [
            (k, way) for k, way in zip(own, how, strict=True)
            if heard or k >= len(bound.sentence.clauses)
            or not clauses[k].comparisons or clauses[k].material
            or not any(over(clauses[k].span, x) for x in taken)
        ]  # fmt: skip
        parts[i] = BoundPart(tuple(k for k, _ in bonds), tuple(way for _, way in bonds))
    opened: dict[int, Place] = {}
    if LEFT_OPEN.search(text):
        matters = [w[1:] for said in every for w in said.words if w.role == "matter"]
        silent = [i for i, part in enumerate(parts) if not (part.clauses or every[i].words)]
        opened = left_open(text, labels, silent, matters, lexicon_of(table))
    for i, (start, end) in opened.items():
        own = [clauses[k] for k in parts[i].clauses]
        said_here = [c for c in own if over(c.span, (start, end))]
        if any(c.comparisons or c.numbers for c in said_here):
            continue
        notes.append(Note("tagger.left_open", part=names[i], words=text[start:end].strip()))
        # What has a matter elsewhere keeps it
        if all(over(place_of(c, text), (start, end)) for c in own if c.material):
            parts[i] = BoundPart()
            taken.append((start, end))
    bound = replace(bound, sentence=replace(bound.sentence, notes=(*bound.sentence.notes, *notes)))
    return _without_idle(bound, clauses, parts, taken, every, table)


class _Heard(NamedTuple):
    """Readings of a part, and what they were made of.

    The tagger's ``words``; whether the grammar has them too (``known``) and something in them was
    not read (``unread``); of these the ``phrase`` of the matter and what that is taken to mean.
    """

    readings: list[Reading]
    words: str
    known: bool
    unread: bool
    phrase: str
    meant: Meant | None


def readings_of(
    i: int,
    bound: Bound,
    every: Sequence[Said],
    labels: Sequence[Sequence[str]],
    table: MaterialTable,
    waiting: frozenset[int] = frozenset(),
) -> tuple[list[Reading], dict[str, float]]:
    """Readings of a part, the grammar's first, and facts about them that tell which is right.

    ``waiting`` are parts whose readings wait for this one's: "as the lid", "as the box".
    """
    names = [own[0] for own in labels]
    text, part = bound.sentence.text, shown_name(names[i])
    said = _whole(every[i], bound.sentence.numbers)
    own = tuple(bound.sentence.clauses[k] for k in bound.parts[i].clauses)
    language = bound.sentence.language
    readings = [Reading("grammar", own)]
    words = _words(said, text)
    if any(_SAME.search(text[:start]) for role, start, _ in said.words if role == "matter"):
        words = ""  # "the same alloy": whose, the grammar tells
    # Words that the grammar has for it too, and no more
    known = len(own) == 1 and bool(words) and words.lower() in own[0].phrase.lower()
    known = known and not own[0].comparisons and not own[0].numbers
    read: tuple[Clause, ...] = ()
    unread = False
    if words and not known:
        others = names if len(names) <= MANY else names[i : i + 1]
        # What the name says of a matter is no second one: "EVA foam" of a part "BladeFoam"
        of_matter = any(word in table.phrases for word in part.split())
        part = "part" if of_matter else part
        saying = lists()["alone"][language].format(part=part, words=_in_capitals(words, table))
        alone = parse(saying, table, others, language=language, beside=text)
        read = tuple(c for c in alone.clauses if c.says_matter)
        unread = bool(alone.unread) or any(c.doubts or c.unknown for c in read)
    beside = _beside(i, text, every, labels, table)
    if beside and beside.comparison:
        told = _related(said, text)
        clause = Clause(told, (0, 0), Subject("none"), comparisons=(beside.comparison,))
        read = (*(c for c in read if (c.material or c.numbers) and not c.comparisons), clause)
    elif beside and beside.other not in waiting and not any(c.comparisons for c in own):
        # The same matter
        others, _ = readings_of(beside.other, bound, every, labels, table, waiting | {i})
        by = {r.reader: r.clauses for r in others}
        order = ("words", "grammar", "phrase")
        same = next((by[reader] for reader in order if by.get(reader)), ())
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
    return _compared(i, bound, every, table, _Heard(readings, words, known, unread, phrase, meant))


def _compared(
    i: int, bound: Bound, every: Sequence[Said], table: MaterialTable, heard: _Heard
) -> tuple[list[Reading], dict[str, float]]:
    """The readings of a part that say different things, and what they have in common."""
    readings, words, known, unread, phrase, meant = heard
    text, said = bound.sentence.text, every[i]
    by = {r.reader: r.clauses for r in readings}
    own, read = by["grammar"], by.get("words", ())
    row = bool(meant and table.phrases.get(meant.row.lower()))
    rows = {r.reader: {c.material for c in r.clauses if c.material} for r in readings}
    stated = {
        r.reader: {(n.measure, n.value) for c in r.clauses for n in c.numbers} for r in readings
    }
    filled = {r.reader: {c.filling for c in r.clauses} for r in readings}
    one_matter = bool(rows.get("words")) and rows["words"] == rows["grammar"]
    beside = {r.reader: {x for c in r.clauses for x in c.comparisons} for r in readings}
    # "10 % stiffer" of "same as the base, but 10 % stiffer"
    part_of = bool(beside.get("words")) and not rows["words"] and bool(rows["grammar"])
    less = all(of.get("words", set()) <= of["grammar"] for of in (stated, filled, beside))
    if (one_matter or part_of) and less:
        readings = [r for r in readings if r.reader != "words"]  # the same matter, and no more

    def alike(a: str, b: str) -> float:
        one, two = rows.get(a, set()), rows.get(b, set())
        return float(any(_are_alike(table, x, y) for x in one for y in two))

    def meant_by(reader: str) -> float:
        """How surely the phrase network takes the words for a matter like this reader's."""
        if not (phrase and rows.get(reader)):
            return 0.0
        return _logit(load_phrases().share(phrase, values_of(map(table.exact, rows[reader]))))

    how, spans = bound.parts[i].how, [(s, e) for r, s, e in said.words if r in _DECIDING]
    held = [bound.sentence.clauses[k].span for k in bound.named.difference(bound.parts[i].clauses)]
    shared = [  # words that the tagger has for other parts too
        any(over((w.start, w.end), span) for span in spans) for other in every
        if other.words != said.words for w in other.words
    ]  # fmt: skip
    strange = [  # of what is no part: "the gasket is graphite"
        bound.sentence.clauses[k].span
        for k in bound.unbound
        if bound.sentence.clauses[k].subject.names
    ]
    sure = _logit(said.certainty)
    same_words = known or (bool(rows.get("words")) and rows["words"] <= rows["grammar"])
    same = same_words and stated.get("words", set()) <= stated["grammar"]
    said_own, listened = any(c.says_matter for c in own), bool(words)
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
        "heard": float(listened),
        "sure_of_words": sure * listened,
        "sure_of_these": _logit(said.within) * listened,
        "sure_of_none": sure * (not listened),
        "none_heard_grammar": sure * (not listened and said_own),
        "words_read": float(bool(read)),
        "words_doubtful": float(unread),
        "words_row": float(bool(rows.get("words"))),
        "words_numbers": float(bool(stated.get("words"))),
        "same": float(same),
        "sure_same": sure * same,
        "differ": float(listened and said_own and not same),
        "sure_differ": sure * (listened and said_own and not same),
        "grammar_like_words": alike("grammar", "words"),
        "grammar_like_phrase": alike("grammar", "phrase"),
        "words_like_phrase": alike("words", "phrase"),
        "share": _logit(meant.share) if meant and row else 0.0,
        "no_row": float(bool(meant and not row)),
        "share_grammar": (_logit(meant.share) if meant else 0.0) * alike("grammar", "phrase"),
        "share_against": (_logit(meant.share) if meant and row else 0.0)
        * (bool(rows["grammar"]) and not alike("grammar", "phrase")),
        "meant_by_grammar": meant_by("grammar"),
        "meant_by_words": meant_by("words"),
        "grammar_points": float(_points(bound, i)),
        "of_another": float(any(a <= s and e <= b for a, b in held for s, e in spans)),
        "of_none": float(any(a <= s and e <= b for a, b in strange for s, e in spans)),
        "shared": float(any(shared)),
        "moved": float(said.moved),
        "moved_grammar": float(said.moved and said_own),
        "share_of_words": _logit(said.share) * listened,
        "share_of_none": _logit(said.share) * (not listened),
        "share_moved": _logit(said.share) * said.moved,
        "share_same": _logit(said.share) * same,
        "share_differ": _logit(said.share) * (listened and said_own and not same),
        "relation_heard": float(any(r == "relation" for r, *_ in said.words)),
        "number_heard": float(any(r == "number" for r, *_ in said.words)),
        "alternative": float(any(r == "alternative" for r, *_ in said.words)),
        "excluded": float(any(r == "excluded" for r, *_ in said.words)),
        "language": float(bool(bound.sentence.language)),
        "language_grammar": float(bool(bound.sentence.language) and said_own),
        "length": math.log(len(text) / 100),
        "parts": math.log(len(every) / 4),
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


def _is_settled(doubt: object, plain: bool, i: int, every: Sequence[Said]) -> bool:
    """Whether of a part's two matters one is not heard for it: the first is another's, say.

    Where nobody can say where they stand, whether the second is ``plain``.
    """
    if not isinstance(doubt, Note) or doubt.kind != "reader.again":
        return False
    starts, words = doubt.values.get("at", (-1,)), (doubt.values["first"], doubt.values["second"])
    if min(starts) < 0:
        return plain
    first, second = ((at, at + len(word)) for at, word in zip(starts, words, strict=True))
    others = (w for said in every if said != every[i] for w in said.words)
    theirs = any(over(first, (w.start, w.end)) for w in others)
    return theirs or not any(over(second, (w.start, w.end)) for w in every[i].words)


def _subject(name: str) -> Subject:
    return Subject("parts", (tuple(shown_name(name).split()),))


def _doubts_of(
    taken: Reading, readings: Sequence[Reading], text: str, said: Said, *, likely: bool
) -> tuple[Note, ...]:
    """What is told of the grammar's reading where it is not likely, or another matter is heard."""
    phrase = next((c.phrase or c.text for c in taken.clauses), "")
    if any(c.doubts or c.unknown for c in taken.clauses):
        return ()
    if likely:
        others = (text[start:end] for role, start, end in said.words if role == "alternative")
        others = [words for words in others if phrase and words not in phrase]
        return (Note("tagger.differs", words=others[0], phrase=phrase),) if others else ()
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
    table: MaterialTable,
) -> Bound:
    """The sentence without what spoke of no part, or no longer does, and was read anew.

    Unread words that the tagger surely has for no part, as those of a tolerance, are a note; so is
    a matter by itself behind a part's that is like it ("steel, S235"), or not heard for any.
    """
    text = bound.sentence.text
    least = min(said.certainty for said in every)
    heard = [(w.start, w.end) for said in every for w in said.words]

    def is_aside(start: int, length: int) -> bool:
        """Whether the tagger surely has these words for no part."""
        here = any(over((start, start + length), x) for x in heard)
        return least > ASIDE and start >= 0 and not here

    used = {k for part in parts for k in part.clauses}

    def is_anew(k: int) -> bool:
        return any(over(clauses[k].span, x) for x in taken)

    def is_idle(k: int) -> bool:
        """Whether a clause by itself changes no part's matter."""
        place, row = place_of(clauses[k], text), clauses[k].material
        owners = (
            i for i, said in enumerate(every)
            if any(over(place, w[1:]) for w in said.words if w.role in ("matter", "number"))
        )  # fmt: skip
        others = (clauses[j].material for i in owners for j in parts[i].clauses)
        return all(row and other and _are_alike(table, row, other) for other in others)

    def is_related(note: object) -> bool:
        """Whether "the same as" is of a relation that was read anew."""
        if not isinstance(note, Note) or note.kind != "reader.same_nothing":
            return False
        at = text.lower().find(note.values["who"])
        return any(a <= at < b for a, b in taken)

    stale = {k for k in range(len(clauses)) if k not in used and is_anew(k)}
    place = {k: n for n, k in enumerate(k for k in range(len(clauses)) if k not in stale)}
    said = " ".join(text[start:end] for start, end in taken)
    beside = [word for word in bound.sentence.unread if is_aside(text.find(word), len(word))]
    idle = [k for k in bound.unbound if k in place and clauses[k].subject.scope == "none"]
    idle = [k for k in idle if is_idle(k)]
    beside += [clauses[k].text for k in idle if clauses[k].text]
    told = Note("reader.aside", words=", ".join(map(repr, dict.fromkeys(beside))))
    sentence = replace(
        bound.sentence,
        clauses=tuple(clauses[k] for k in place),
        notes=(
            *(note for note in bound.sentence.notes if not is_related(note)),
            *[told] * bool(beside),
        ),
        unread=tuple(
            word for word in bound.sentence.unread if word not in said and word not in beside
        ),
    )
    renamed = (part._replace(clauses=tuple(place[k] for k in part.clauses)) for part in parts)
    left = (place[k] for k in bound.unbound if k in place and k not in idle)
    mute = (i for i in bound.mute if {*parts[i].how} <= {*GENERAL})
    return Bound(sentence, tuple(renamed), tuple(left), tuple(mute))


def _whole(said: Said, numbers: Sequence[Place]) -> Said:
    """What is said with numbers as wholes: with the word that says what they are, and the unit."""
    found = list[Words]()
    for words in said.words:
        own = [x for x in numbers if over(x, words[1:]) and words.role in ("matter", "number")]
        start = max(min([words.start, *(a for a, _ in own)]), found[-1].end if found else 0)
        end = max([words.end, *(b for _, b in own)])
        found += [Words(words.role, start, end)] if start < end else []
    return replace(said, words=tuple(found))


def _words(said: Said, text: str) -> str:
    """Words that speak of a part's matter as one phrase, with the signs that stand between them."""
    runs: dict[str, list[str]] = {}
    last, end = "", 0
    for role, start, stop in said.words:
        kind = "matter" if role == "number" else role
        gap, words = text[end:start], text[start:stop].rstrip(" .,;:")
        near = kind == last and ({*gap} <= {*" ()[]/,+-–&'"} or gap.strip(" ,(") == "or")
        if words == "or":  # alone it is no role
            continue
        own = runs.setdefault(kind, [])
        if near:
            own[-1] += text[end : start + len(words)]
        else:
            own.append(words)
        own[-1] += ")" * (own[-1].count("(") > own[-1].count(")") and text[stop : stop + 1] == ")")
        last, end = kind, start + len(words)
    phrase = ", ".join(runs.get("matter", []))
    if phrase and "alternative" in runs:
        phrase = " or ".join([phrase, *runs["alternative"]])
    contents = (f"filled with {words}" for words in runs.get("content", []))
    return ", ".join([*([phrase] if phrase else []), *contents])


def _in_capitals(words: str, table: MaterialTable) -> str:
    """Words of matter with their acronyms in capitals: "abs", "pet"."""
    lexicon = lexicon_of(table)

    def spelt(found: re.Match) -> str:
        return found[0].upper() if lexicon.needs_capitals((found[0],)) else found[0]

    return re.sub(r"(?<!\w)[a-z]{2,5}(?!\w)", spelt, words)


def _related(said: Said, text: str) -> str:
    """Words that speak of a part beside another, with those between them."""
    spans = [(start, end) for role, start, end in said.words if role == "relation"]
    if not spans:
        return ""
    (start, _), (_, end) = spans[0], spans[-1]
    factor = BY_FACTOR.search(text, start)  # "stiffer by a", "factor of 20"
    return text[start : max(end, factor.end()) if factor and factor.start() <= end else end]


def _beside(
    i: int, text: str, every: Sequence[Said], labels: Sequence[Sequence[str]], table: MaterialTable
) -> Relation | None:
    """How the tagger's words put a part beside another."""
    told = _related(every[i], text)
    if not told:
        return None
    at = next(start for role, start, _ in every[i].words if role == "relation")
    context = re.split(r"[.;,\n](?=\s|$)", text[:at])[-1]
    alone = _TWEAK.search(told) and not _THAN.search(told)  # "web 6061-T6, but 10 % stiffer"
    ends = [
        (w.end, j == i, j) for j, said in enumerate(every) if j != i or alone
        for w in said.words if w.role in ("matter", "number") and w.end <= at
    ]  # fmt: skip
    only = 1 - i if len(labels) == 2 else None
    before = max(ends)[2] if ends else only
    return relation_of(told, i, labels, before, lexicon_of(table), context)
