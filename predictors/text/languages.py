"""German, French and Spanish: the words of a text as English ones, at their places.

A text is of the language of which it has the most words. What the lists of that language lack, and
no row of the table, part or designation explains, stays as it stands and is told.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from .english import DATA, Atom, Phrase, bare
from .materials import ReaderLexicon
from .parts import places

LONGEST = 5  # words of an entry: "mousse à mémoire de forme" is read by its last two
SHORTEST = 3  # letters of a part of a compound


class Glossed(NamedTuple):
    """The words of a text, each at its place; ``unknown`` are the places of those not in a list."""

    language: str
    atoms: list[Atom]
    unknown: set[int]


@dataclass(frozen=True)
class Language:
    """Entries by their words, without accents: small words, names of matter, names of parts."""

    name: str
    small: dict[Phrase, str]
    matter: dict[Phrase, str]
    parts: dict[Phrase, str]
    endings: tuple[str, ...]
    links: tuple[str, ...]
    adjectives: re.Pattern  # of what is done to a matter, in small letters: "geöltem"

    def of(self, phrase: Phrase) -> tuple[str, str] | None:
        """English of a phrase and the list that has it, by its last word's endings too."""
        *first, last = phrase
        for form in self.forms(last):
            for kind in ("small", "matter", "parts"):
                english = getattr(self, kind).get((*first, form))
                if english is not None and (kind != "small" or form == last or len(form) > 5):
                    return english, kind
        return self._compound(last) if not first else None

    def forms(self, word: str) -> Iterator[str]:
        """A word and what it may be without an ending: "Beine" -> bein."""
        yield word
        for ending in self.endings:
            stem = word.removesuffix(ending)
            if stem != word and len(stem) >= SHORTEST:
                yield stem

    def _compound(self, word: str) -> tuple[str, str] | None:
        """What a compound of two entries says: "Stahlrahmen" is a steel frame."""
        for at in range(SHORTEST, len(word) - SHORTEST + 1) if self.links else ():
            head = next(
                ((getattr(self, kind)[(form,)], kind) for form in self.forms(word[at:])
                 for kind in ("matter", "parts") if (form,) in getattr(self, kind)), None
            )  # fmt: skip
            stems = {word[:at].removesuffix(link) for link in self.links} | {f"{word[:at]}e"}
            for stem in sorted(stems, key=len, reverse=True) if head else ():
                first = self.matter.get((stem,)) or self.parts.get((stem,))
                first = first or (self._compound(stem) or ("", ""))[0]
                if first and head:
                    return f"{first} {head[0]}", head[1]
        return None


@lru_cache(maxsize=1)
def languages() -> tuple[Language, ...]:
    """Languages of ``data/languages.toml``."""
    found = []
    data = tomllib.loads((DATA / "languages.toml").read_text(encoding="utf-8"))
    shared = data.pop("nouns")
    for at, table in enumerate(data.values(), 1):
        lists = {kind: dict(_entries(table[kind])) for kind in ("small", "matter", "parts")}
        for kind, lines in shared.items():  # English : German : French : Spanish
            rows = (line.split(" : ") for line in lines.strip().splitlines())
            words = "\n".join(f"{row[at]} = {row[0]}" for row in rows)
            lists[kind] = {**dict(_entries(words)), **lists[kind]}
        endings, links = tuple(table["endings"]), tuple(table.get("links", ()))
        done = re.compile(table["adjectives"])
        own = {"endings": endings, "links": links, "adjectives": done}
        found.append(Language(table["name"], **lists, **own))
    return tuple(found)


def _entries(text: str) -> Iterator[tuple[Phrase, str]]:
    for entry in re.split(r"[;\n]", text):
        words, equals, english = entry.partition("=")
        for word in words.split(",") if equals else ():
            yield tuple(re.findall(r"\w+", bare(word))), english.strip()


def glossed(cut: list[Atom], lexicon: ReaderLexicon, known: Collection[str]) -> Glossed | None:
    """Return a text's words in English where it is of another language, None where it is not."""
    words = [
        (i, bare(atom.text)) for i, atom in enumerate(cut)
        if atom.text.islower() or (atom.text.istitle() and len(atom.text) > 1)  # no "PA", "ShA"
    ]  # fmt: skip
    english = {
        i for i, word in words
        if lexicon.model.is_word(cut[i].text.lower()) or (cut[i].stem,) in lexicon.rows
        or (cut[i].text.lower(),) in lexicon.meanings
    }  # fmt: skip
    names = {bare(word): word for word in known}
    names |= {re.sub("(?<=[aou])e", "", name): word for name, word in names.items()}  # "gehaeuse"
    best, most = None, 0
    for language in languages():
        read = {i for i, word in words if language.of((word,))}
        called = {i for i, word in words if word in names}
        own = len(read - english) - len(english - read - called)
        if own > most and 2 * own >= len({i for i, _ in words} - read - english - called):
            best, most = language, own
    if best is None:
        return None
    # Words for the same part are one: "yeux" of a part "oeil_g"
    alike = {
        found[0]: own for name, own in names.items()
        if (found := best.of((name,))) and found[1] == "parts"
    }  # fmt: skip
    out, unknown, at, last = list[Atom](), set[int](), 0, ""
    while at < len(cut):
        atom = cut[at]
        run = [bare(a.text) for a in cut[at : at + 2 * LONGEST]]
        if not atom.text[0].isalpha():
            out += [] if atom.text in "'’" else [atom]
            at, last = at + 1, ""
            continue
        forms = [form for form in best.forms(run[0]) if len(form) > SHORTEST or form in names]
        called = [names[form] for form in forms if form in names]
        called += [form for form in forms for name in names if name.endswith(form)]
        if called:
            out.append(atom._replace(stem=called[0]))
            at, last = at + 1, "parts"
            continue
        taken, found = 1, None
        for size in range(LONGEST, 0, -1):
            ends = [k for k, word in enumerate(run) if word[:1].isalpha()][:size]
            phrase = tuple(run[k] for k in ends)
            if len(phrase) == size and all(w[:1].isalpha() or w in "'’-" for w in run[: ends[-1]]):
                found = best.of(phrase)
            if found:
                taken = ends[-1] + 1
                break
        if found is None:
            if at not in english and not best.adjectives.fullmatch(atom.text):
                unknown.add(atom.start)
            out.append(atom)
            at, last = at + 1, ""
            continue
        if found[1] == "parts" and found[0] in alike:
            out.append(atom._replace(stem=alike[found[0]], end=cut[at + taken - 1].end))
            at, last = at + taken, "parts"
            continue
        # Its English words share its place between them
        english_words = re.findall(r"[^\W\d_]+|\d+|[-,]", found[0])
        ends = np.linspace(atom.start, cut[at + taken - 1].end, len(english_words) + 1)
        new = [
            Atom(word, int(start), int(end), lexicon.model.singular(word.lower()))
            for word, start, end in zip(english_words, ends, ends[1:], strict=False)
        ]
        if found[1] == "parts":  # "Stahlklinge" of a part "klinge"
            new[-1] = new[-1]._replace(stem=alike.get(new[-1].text, new[-1].stem))
        # "roue avant gauche": the places stand before the part in English
        if last == "parts" and not best.links and len(new) == 1 and new[0].stem in places():
            part = out.pop()
            out += [new[0]._replace(start=part.start, end=part.end),
                    part._replace(start=new[0].start, end=new[0].end)]  # fmt: skip
        else:
            out += new
            last = found[1]
        at += taken
    return Glossed(best.name, out, unknown)
