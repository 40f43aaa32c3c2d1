"""The span tagger: which words of a text speak of the matter of each part.

all-MiniLM-L6-v2 with low-rank changes of its weights (LoRA, Hu et al. 2021) reads "part [SEP] the
other parts [SEP] text" and gives each piece of the text a role. A word's role is decided by the
mean over its pieces. ``autophyx-tet train tagger`` learns the changes from made texts.

It is a second opinion: the judge takes it where it is likelier right than the grammar.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ..encoders.minilm import MAX_TOKENS, MiniLM
from .english import words as lists

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
    """What a text says of a part: its words in their order, and how sure that is.

    ``certainty`` is that of the least sure decision on a word of the text, ``within`` on one of
    those found.
    """

    words: tuple[Words, ...]
    certainty: float
    within: float = 1.0


# A word with what joins it from within; a sign by itself.
_WORD = re.compile(r"[^\s()\[\]{}<>|;:=/,\"“”„!?•*]+|[^\s]")
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
        if len(names) > MANY:  # those that only a number tells apart are asked about once
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
    least, within, at = 1.0, 1.0, 0
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
        if said and matter > 0.5:
            within = min(within, matter)
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
    return Said(tuple(found), float(least), float(within))


def _kin(a: str, b: str) -> bool:
    """Whether two roles both decide the material, or are one."""
    return a == b or {a, b} <= {"matter", "number"}


@lru_cache(maxsize=1)
def load_tagger() -> Tagger:
    """The shipped tagger, read once."""
    return Tagger()
