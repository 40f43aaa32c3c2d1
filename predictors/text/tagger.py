"""The span tagger: which words of a text speak of the matter of each part.

all-MiniLM-L6-v2 with low-rank changes of its weights (LoRA, Hu et al. 2021) reads "part [SEP] the
other parts [SEP] text" and gives each piece of the text a role. A word's role is decided by the
mean over its pieces. ``autophyx-tet train tagger`` learns the changes from made texts.

It is a second opinion. The grammar of the reader takes a whole text apart; the words that the
tagger finds for a part are read by themselves: "the seat is soft foam". Where the grammar has
nothing or only doubts, or the tagger is surer than it errs, its reading is taken. Where that fails
too, or both networks are sure of another matter, these words mean what the phrase network takes
them for: that is a doubt.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ...fem.note import Note
from ...fem.table import MaterialTable
from ..encoders.minilm import MAX_TOKENS, MiniLM
from .clauses import GENERAL, Bound, BoundPart, Clause, Sentence, Subject
from .english import words as lists
from .phrases import load_phrases
from .reader import parse

WEIGHTS = Path(__file__).parents[1] / "weights" / "tagger.safetensors"
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
    words = [word for word in _CUT.split(name) if word]
    shown = [
        lists()["sides"].get(word.lower(), word.lower()) if i else word.lower()
        for i, word in enumerate(words)
    ]
    return " ".join(str(int(w)) if w.isdecimal() else w for w in shown) or "part"


def question(names: Sequence[str], i: int) -> str:
    """What is asked about a part: its name, then the others' without their numbers."""
    others = (_NUMBER.sub("", shown_name(n)) for j, n in enumerate(names) if j != i)
    return f"{shown_name(names[i])} [SEP] " + ", ".join(dict.fromkeys(others))


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
    """What a text says of a part: its words in their order, and the least sure decision on one."""

    words: tuple[Words, ...]
    certainty: float


# A word with what joins it from within; a sign by itself.
_WORD = re.compile(r"[^\s()\[\]{}<>|;:=/,\"“”„!?•*]+|[^\s]")
_STRIDE = 2 / 3  # of a window, to the next one in a long text
_ROWS = 8  # questions at once
_MANY, _LAST = 32, re.compile(r"[\W_]*\d+$")  # parts; the number at the end of a name


class Tagger(MiniLM):
    """Gives each word of a text its role for each part.

    Parameters
    ----------
    folder
        Folder of the weights of MiniLM; by default the installed ones.
    learned
        File of the changes of these weights and of the last layer.

    Raises
    ------
    InputError
        If the package that holds MiniLM is not installed.
    """

    def __init__(self, folder: Path | None = None, learned: Path = WEIGHTS) -> None:
        from safetensors.numpy import load_file

        super().__init__(folder)
        self._tokenizer.no_truncation()
        found = {key: w.astype(np.float32) for key, w in load_file(learned).items()}
        for key, weight in found.items():
            kind, _, name = key.partition(".")
            if kind == "learned":
                self._weights[name] = weight
            elif kind == "up":
                self._weights[name] = self._weights[name] + weight @ found[f"down.{name}"]
        self._role = found["role.weight"].T, found["role.bias"]

    def said(self, names: Sequence[str], text: str) -> list[Said]:
        """What a text says of each part, by their names."""
        encoded = self._tokenizer.encode(text, add_special_tokens=False)
        said = {*re.findall(r"\d+", text)}
        if len(names) > _MANY:  # those that only a number tells apart are asked about once
            names = [n if {*re.findall(r"\d+", n)} & said else _LAST.sub("", n) for n in names]
        questions = [question(names, i) for i in range(len(names))]
        # So are fewer, by the first of them, of a text that tells none of them apart
        alike: dict[str, str] = {}
        if not said & {*re.findall(r"\d+", " ".join(questions))} and not _APART.search(text):
            questions = [alike.setdefault(_DIGITS.sub("", q), q) for q in questions]
        asks = {q: self._tokenizer.encode(q, add_special_tokens=False).ids for q in questions}
        found = dict(zip(asks, self._roles([*asks.values()], encoded.ids), strict=True))
        words = [(m.start(), m.end()) for m in _WORD.finditer(text)]
        decided = {q: _decoded(text, words, encoded.offsets, p) for q, p in found.items()}
        return [decided[q] for q in questions]

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
            length = len(batch[-1][2])
            tokens = np.zeros((len(batch), length), np.int64)
            types, seen = tokens.copy(), np.zeros(tokens.shape, bool)
            for row, (_, _, own, head) in enumerate(batch):
                tokens[row, : len(own)], seen[row, : len(own)] = own, True
                types[row, head : len(own) - 1] = 1
            with self._arrays.sparing():
                hidden = self._forward(tokens, types, None if seen.all() else seen)
                logits = hidden @ self._role[0] + self._role[1]
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


def _decoded(
    text: str,
    words: Sequence[tuple[int, int]],
    offsets: Sequence[tuple[int, int]],
    p: Float[np.ndarray, "tokens roles"],
) -> Said:
    """Roles of whole words: what a part is of where these two are likelier than all others."""
    found: list[Words] = []
    least, at = 1.0, 0
    for start, end in words:
        own = []
        while at < len(offsets) and offsets[at][0] < end:
            own += [at] if offsets[at][1] > start else []
            at += 1
        said = [i for i in own if any(c.isalnum() for c in text[slice(*offsets[i])])]
        if not own:
            continue
        mean = p[said or own].mean(axis=0)
        matter = mean[1] + mean[2]
        if said:
            least = min(least, max(matter, 1 - matter))
        role = int(mean[1:3].argmax()) + 1 if matter > 0.5 else int(mean.argmax())
        if matter <= 0.5 and role in (0, 1, 2):
            continue
        end = start + (len(text[start:end].rstrip(".,;:!?")) or end - start)
        gap = text[found[-1].end : start] if found else None
        joins = gap is not None and "\n" not in gap and gap.strip() in ("", "-", "–")
        if joins and _kin(found[-1].role, ROLES[role]):
            found[-1] = found[-1]._replace(end=end)
        else:
            found.append(Words(ROLES[role], start, end))
    return Said(tuple(found), float(least))


def _kin(a: str, b: str) -> bool:
    """Whether two roles both decide the material, or are one."""
    return a == b or {a, b} <= {"matter", "number"}


@lru_cache(maxsize=1)
def load_tagger() -> Tagger:
    """The shipped tagger, read once."""
    return Tagger()


# Least certainty of the tagger to be heard where the grammar is in doubt, where it is not, and to
# be told where it is not heard; chosen on the eleventh set, on which neither had been made.
LIKELY, SURE, TOLD = 0.6, 0.95, 0.6
NEVER = 1.1  # in other languages what the lists read without a doubt is righter
# Least certainty of tagger and phrase network together, where the grammar is in doubt and where it
# is not, to be no doubt, and of the phrase network to confirm the grammar; chosen on the sixteenth.
GUESSED, AGAINST, PLAIN, CONFIRMED = 0.4, 0.7, 0.9, 0.8
_BESIDE = {"reader.beside_idle", "reader.beside_left"}  # words that say nothing of a matter
_UNLIKE_MATTER = {"number", "relation", "content", "alternative"}
_DECIDING = ("matter", "number", "relation", "content")


def with_second_opinion(
    bound: Bound, labels: Sequence[Sequence[str]], table: MaterialTable
) -> Bound:
    """Return what a text says of every part, with the tagger's reading where that is the better.

    Where it names another matter, of other values, and is not sure enough, that is a doubt.

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
    every = load_tagger().said(names, text)
    for i, said in enumerate(every):
        own = [clauses[k] for k in parts[i].clauses]
        words = _words(said, text)
        doubtful = not any(c.says_matter for c in own) or any(c.doubts or c.unknown for c in own)
        doubtful = doubtful or (bool(language) and not any(c.material or c.numbers for c in own))
        wanted = LIKELY if doubtful else NEVER if language else SURE
        told = SURE if language else TOLD
        known = any(words.lower() in c.phrase.lower() for c in own)
        part = shown_name(names[i])
        own_rows = _said(own)[0]
        found: list[Clause] = []
        if words and not known and said.certainty >= (wanted if doubtful else told):
            others = names if len(names) <= _MANY else names[i : i + 1]
            alone = lists()["alone"][language].format(part=part, words=words)
            found = _more_than(own, parse(alone, table, others))
            if found and said.certainty < wanted:
                rows = _said(found)[0]
                if own_rows and not any(_are_alike(table, a, b) for a in own_rows for b in rows):
                    k = next(k for k in parts[i].clauses if clauses[k].material)
                    note = Note("tagger.differs", words=words, phrase=clauses[k].phrase)
                    at = parts[i].clauses.index(k)  # one of its own: others may have this one too
                    new = (*parts[i].clauses[:at], len(clauses), *parts[i].clauses[at + 1 :])
                    parts[i] = parts[i]._replace(clauses=new)
                    clauses.append(replace(clauses[k], doubts=(*clauses[k].doubts, note)))
                found = []
        phrase, meant, share = _meant(said, text, table)
        sure = said.certainty * share
        if meant and any(_are_alike(table, a, meant) for a in own_rows):
            for k in parts[i].clauses if share > CONFIRMED else ():
                kept = (d for d in clauses[k].doubts if getattr(d, "kind", "") not in _BESIDE)
                clauses[k] = replace(clauses[k], doubts=tuple(kept))
        elif meant and not found and sure > (GUESSED if doubtful else AGAINST):
            told_else = any(c.numbers or c.comparisons or meant in c.excluded for c in own)
            guess = phrase if doubtful and sure <= PLAIN else ""
            doubts = () if doubtful else (Note("tagger.likely", words=phrase, row=meant),)
            clause = Clause(
                phrase, (0, 0), Subject("none"), meant, phrase, unknown=guess, doubts=doubts
            )
            found = [] if told_else else [clause]
        if not found:
            continue
        subject = Subject("parts", (tuple(part.split()),))
        spans = [(start, end) for role, start, end in said.words if role in _DECIDING]
        whole = min(start for start, _ in spans), max(end for _, end in spans)
        # Words that another part has by a name, and this one by the tagger alone
        held = [
            bound.sentence.clauses[k].span for bond, other in zip(bound.parts, every, strict=True)
            for k, how in zip(bond.clauses, bond.how, strict=True)
            if how not in GENERAL and k not in bound.parts[i].clauses
            and _may_hold(other, bound.sentence.clauses[k].span)
        ]  # fmt: skip
        of_another = any(a <= whole[0] and whole[1] <= b for a, b in held)
        named = any(how not in GENERAL for how in parts[i].how)
        matters = [(start, end) for role, start, end in said.words if role == "matter"]
        inside = any(a <= start and end <= b for a, b in held for start, end in matters)
        if (named and inside and not doubtful) or (  # it has its own
            (of_another or inside) and said.certainty < LIKELY
        ):
            continue
        taken += spans
        if of_another or inside:
            note = Note("tagger.of_another", words=words)
            found = [replace(c, doubts=(*c.doubts, note)) for c in found]
        kept = [d for c in own for d in c.doubts if getattr(d, "kind", "") == "reader.again"]
        found = [replace(c, doubts=(*c.doubts, *kept)) for c in found]
        new = range(len(clauses), len(clauses) + len(found))
        clauses += [replace(c, text=words, span=whole, subject=subject) for c in found]
        parts[i] = BoundPart(tuple(new), ("name",) * len(new))
    return _without_idle(bound, clauses, parts, taken)


def _more_than(own: Sequence[Clause], read: Sentence) -> list[Clause]:
    """Clauses of a reading that say more than what there is, without a doubt; else none."""
    found = [c for c in read.clauses if c.says_matter]
    (rows, numbers), (own_rows, own_numbers) = _said(found), _said(own)
    less = bool(own) and any(c.kind for c in found)  # "wood" says less than what is there
    same = rows <= own_rows and numbers <= own_numbers
    return [] if less or same or _is_doubtful(read, found) else found


def _may_hold(said: Said, span: tuple[int, int]) -> bool:
    """Whether the tagger leaves a part the words that the grammar gave it."""
    given = any(start < span[1] and span[0] < end for _, start, end in said.words)
    return given or said.certainty < SURE


def _meant(said: Said, text: str, table: MaterialTable) -> tuple[str, str, float]:
    """What the phrase network takes a part's matter for: the words, a row or "", its share."""
    phrase = ", ".join(text[start:end] for role, start, end in said.words if role == "matter")
    if not phrase or {role for role, *_ in said.words} & _UNLIKE_MATTER:
        return "", "", 0.0
    meant = load_phrases().meant(phrase)
    row = table.phrases.get(meant.row.lower())
    return phrase, row.name if row else "", meant.share


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
