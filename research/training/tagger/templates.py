"""Sentences with marked words as templates: their words of matter and names of parts change.

``data/marked/*.txt`` holds texts of many hands, written to be learned from. A block is the language
and the names of the parts, then the text with marks, ``{lid, base|m:grey cast iron}``: the parts
that the words speak of, and the role by a letter of ``MARKS``.

``data/spans.json`` says of the benchmark's sets which words of a sentence speak of which part, in
which role: where the reader or the tagger had a part right, those words; else marked by hand. Parts
that nobody marked are left out, and not asked about.
"""

from __future__ import annotations

import json
import random
import re
import tomllib
from collections.abc import Collection, Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from .generator import (
    ALTERNATIVE,
    COATING,
    CONTENT,
    DATA,
    EXCLUDED,
    MATTER,
    NUMBER,
    RELATION,
    Example,
    Generator,
    Piece,
    Span,
)

SETS = Path(__file__).parents[3] / "benchmarks" / "data"
MARKS = {
    "m": MATTER, "n": NUMBER, "c": COATING, "f": CONTENT, "x": EXCLUDED, "o": ALTERNATIVE,
    "r": RELATION,
}  # fmt: skip
_MARK = re.compile(r"\{([^{}|]+)\|([a-z]):([^{}]+)\}")
_EXCHANGED = {MATTER, EXCLUDED, ALTERNATIVE}
_PLAIN = re.compile(r"[^\W\d_][\w %+./-]{1,38}")  # of a matter that another may stand for
_CUT = re.compile(r"(?<=[a-z])(?=[A-Z])|(?<=[^\W\d_])(?=\d)|[\W_]+|\d+")
# Words that point at another clause: the order stays.
_BOUND = re.compile(tomllib.loads((DATA / "words.toml").read_text(encoding="utf-8"))["bound"])


class Template(NamedTuple):
    """A sentence, its language, the names of the parts, and what speaks of them."""

    text: str
    language: str
    names: list[str]
    spans: list[Span]
    skip: frozenset[int]  # parts that nobody marked


def load_templates(without: Collection[str] = ()) -> list[Template]:
    """Templates of all marked texts and of the sets but those ``without``, where they are there."""
    found = [
        marked_template(block)
        for path in sorted((DATA / "marked").glob("*.txt"))
        for block in path.read_text(encoding="utf-8").split("\n---\n")
    ]
    for name, marked in json.loads((DATA / "spans.json").read_text(encoding="utf-8")).items():
        path = SETS / f"sentences_{name}.toml"
        if name in without or not path.exists():
            continue
        for sentence in tomllib.loads(path.read_text(encoding="utf-8"))["sentence"]:
            if sentence["id"] in marked:
                language, skip, spans = marked[sentence["id"]]
                own = [Span(a, b, tuple(owners), role) for a, b, owners, role in spans]
                names = list(sentence["parts"])
                found.append(Template(sentence["text"], language, names, own, frozenset(skip)))
    return found


def marked_template(block: str) -> Template:
    r"""Template of a block of ``data/marked``.

    >>> template = marked_template("# en | Lid_1, box\nLid {Lid_1|m:oak}, not {Lid_1|x:teak}")
    >>> template.text, template.names, [tuple(span) for span in template.spans]
    ('Lid oak, not teak', ['Lid_1', 'box'], [(4, 7, (0,), 1), (13, 17, (0,), 5)])
    """
    head, _, marked = block.strip("-\n").partition("\n")
    language, _, named = head.removeprefix("#").partition("|")
    names = [name.strip() for name in named.split(",")]
    text, spans, at = "", [], 0
    for mark in _MARK.finditer(marked):
        text += marked[at : mark.start()]
        owners = tuple(names.index(name.strip()) for name in mark[1].split(","))
        spans.append(Span(len(text), len(text) + len(mark[3]), owners, MARKS[mark[2]]))
        text, at = text + mark[3], mark.end()
    return Template(text + marked[at:], language.strip(), names, spans, frozenset())


class TemplateTexts:
    """Makes texts of templates; ``maker`` gives materials, nouns and noise."""

    def __init__(self, templates: Sequence[Template], maker: Generator, seed: int) -> None:
        self.templates, self.maker, self.dice = templates, maker, random.Random(seed)

    def example(self) -> Example:
        """One text with its spans."""
        dice, maker = self.dice, self.maker
        template = dice.choice(self.templates)
        maker.language = template.language
        pieces, names = _pieces(template), list(template.names)
        if dice.random() < 0.65:
            self._exchange_matter(pieces)
        if dice.random() < 0.6:
            names = self._exchange_parts(pieces, names)
        if dice.random() < 0.25 and not _BOUND.search(template.text):
            pieces = self._in_another_order(pieces)
        if dice.random() < 0.5:
            texts = maker.noise([Piece(text, (i,)) for i, (text, _) in enumerate(pieces)])
            pieces = [(piece.text, pieces[piece.owners[0]][1]) for piece in texts]
        # Parts in another order, at times without the last: a text speaks of more than there is
        order = list(range(len(names)))
        if dice.random() < 0.3:
            dice.shuffle(order)
        order = order[:-1] if len(order) > 2 and dice.random() < 0.12 else order
        place = {old: new for new, old in enumerate(order)}
        spans, at = [], 0
        for text, roles in pieces:
            body = text.strip(" ,;:\n")
            start = at + text.index(body) if body else at
            for role, owners in roles.items():
                own = tuple(place[i] for i in owners if i in place)
                spans += [Span(start, start + len(body), own, role)] if body and own else []
            at += len(text)
        skip = frozenset(place[i] for i in template.skip if i in place)
        return Example([names[i] for i in order], "".join(t for t, _ in pieces), spans, skip)

    def _exchange_matter(self, pieces: list[tuple[str, dict[int, list[int]]]]) -> None:
        """Other matters for some, the same for the same words."""
        changed, share = dict[str, str | None](), self.dice.choice((0.3, 0.6, 1.0))
        for i, (text, roles) in enumerate(pieces):
            word = text.strip()
            if roles and {*roles} <= _EXCHANGED and _PLAIN.fullmatch(word):
                if word.lower() not in changed:
                    new = "".join(p.text for p in self.maker.expand("<mat>"))
                    changed[word.lower()] = new if self.dice.random() < share else None
                if new := changed[word.lower()]:
                    new = new.upper() if len(word) > 4 and word.isupper() else new
                    pieces[i] = text.replace(word, new), roles

    def _exchange_parts(
        self, pieces: list[tuple[str, dict[int, list[int]]]], names: list[str]
    ) -> list[str]:
        """Another noun for some heads of names, in the text and in the names that are returned."""
        maker, lasts = self.maker, [[w for w in _CUT.split(name) if len(w) > 2] for name in names]
        for head in sorted({words[-1].lower() for words in lasts if words and words[-1].isalpha()}):
            said = re.compile(rf"(?i)(?<![^\W\d_]){re.escape(head)}(e?s)?(?![^\W\d_])")
            free = any(said.search(text) for text, roles in pieces if not roles)
            in_matter = any(said.search(text) for text, roles in pieces if roles)
            if self.dice.random() < 0.5 or in_matter or not free:
                continue
            if maker.language == "en":
                noun = self.dice.choice(maker.nouns)
            else:
                parts = maker.lexicon[maker.language]["parts"]
                noun = self.dice.choice(parts[self.dice.choice([*parts])])
            there = " ".join([*names, *(text for text, _ in pieces)]).lower()
            if noun.split()[-1].lower() in there:
                continue

            def other(m: re.Match, noun: str = noun) -> str:
                new = maker.plural(noun) if m[1] else noun
                return new.upper() if m[0].isupper() else new.title() if m[0].istitle() else new

            pieces[:] = [(t if roles else said.sub(other, t), roles) for t, roles in pieces]
            names = [said.sub(lambda m: other(m).replace(" ", "_"), name) for name in names]
        return names

    def _in_another_order(
        self, pieces: list[tuple[str, dict[int, list[int]]]]
    ) -> list[tuple[str, dict[int, list[int]]]]:
        """The clauses of a list shuffled, each of which names a part and says what it is of."""
        for sign in ("\n", "; ", ". ", ", "):
            clauses: list[list[tuple[str, dict[int, list[int]]]]] = [[]]
            for text, roles in pieces:
                first, *more = [text] if roles else text.split(sign)
                clauses[-1].append((first, roles))
                clauses += [[(bit, roles)] for bit in more]
            whole = all(
                any(r for _, r in clause) and any(t.strip() and not r for t, r in clause)
                for clause in clauses
            )
            if len(clauses) > 2 and whole:
                self.dice.shuffle(clauses)
                sign = self.dice.choice((sign, sign, "; ", "\n", ", ", ". "))
                first, *more = clauses
                return [*first, *(piece for clause in more for piece in [(sign, {}), *clause])]
        return pieces


def _pieces(template: Template) -> list[tuple[str, dict[int, list[int]]]]:
    """The text cut where a span begins or ends; with each piece its owners by role."""
    text = template.text
    ends = sorted({0, len(text), *(end for span in template.spans for end in span[:2])})
    out = []
    for start, end in pairwise(ends):
        roles: dict[int, list[int]] = {}
        for span in template.spans:
            if span.start <= start and end <= span.end:
                roles.setdefault(span.role, []).extend(span.owners)
        out.append((text[start:end], roles))
    return out
