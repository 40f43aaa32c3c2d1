"""German, French and Spanish: the words of a text as English ones, at their places.

A text is of the language of which it has the most words. What the lists of that language lack, and
no row of the table, part or designation explains, stays as it stands and is told.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from .english import DATA, OTHERS, Atom, Phrase, bare, small_words
from .english import words as small_lists
from .materials import ReaderLexicon
from .parts import places

LONGEST = 5  # words of an entry: "mousse à mémoire de forme" is read by its last two
SHORTEST = 3  # letters of a part of a compound
LEAST_HEAD = 4  # letters of a noun that ends a compound whose beginning is in no list
_DIGRAPH = re.compile("(?<=[aou])e")  # of an umlaut: "gehaeuse"


class Glossed(NamedTuple):
    """The words of a text, each at its place; ``unknown`` are the places of those not in a list.

    ``matter`` has by place the English matter that a part is called after: "mantequilla".
    """

    language: str
    atoms: list[Atom]
    unknown: set[int]
    matter: dict[int, str]


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
    idle: frozenset[str]  # small words that say nothing here: "noch", "toujours"

    def of(
        self, phrase: Phrase, own: Collection[str] = (), *, whole: bool = False
    ) -> tuple[str, str] | None:
        """English of a phrase and the list that has it, by its last word's endings too.

        Of several words for a part it is the one that the asset has as its ``own``, or the first.
        A ``whole`` word is no compound.
        """
        *first, last = phrase
        kinds = ("small", "matter", "parts")
        if own and any(word in own for word in (*self.names(last), "") if not first):
            kinds = ("small", "parts", "matter")  # "Schnur" of a part "string"
        for form in self.forms(last):
            for kind in kinds:
                english = self._english(kind, (*first, form), own)
                if english is not None and (kind != "small" or form == last or len(form) > 5):
                    return english, kind
        if first or whole:
            return ("", "small") if not first and last in self.idle else None
        return ("", "small") if last in self.idle else self._compound(last, own)

    def _english(self, kind: str, phrase: Phrase, own: Collection[str]) -> str | None:
        options = getattr(self, kind).get(phrase, "").split("|")
        known = phrase in getattr(self, kind)
        return next((w for w in options if w in own), options[0]) if known else None

    def forms(self, word: str) -> Iterator[str]:
        """A word and what it may be without an ending: "Beine" -> bein, "Zahnraeder" -> zahnrad."""
        for whole in dict.fromkeys((word, *[_DIGRAPH.sub("", word)] * bool(self.links))):
            yield whole
            for ending in self.endings:
                stem = whole.removesuffix(ending)
                if stem != whole and len(stem) >= SHORTEST:
                    yield stem

    def names(self, word: str) -> Sequence[str]:
        """English words that a noun for a part may stand for."""
        entries = (self.parts[(form,)] for form in self.forms(word) if (form,) in self.parts)
        return next(entries, "").split("|")

    def _compound(self, word: str, own: Collection[str]) -> tuple[str, str] | None:
        """What a compound says: "Stahlrahmen" is a steel frame, "Haselfichte" a kind of spruce."""
        head_alone = None
        for at in range(len(word) - SHORTEST, SHORTEST - 1, -1) if self.links else ():
            head = next(
                ((english, kind) for form in self.forms(word[at:]) for kind in ("matter", "parts")
                 if (english := self._english(kind, (form,), own)) is not None), None
            )  # fmt: skip
            stems = {word[:at].removesuffix(link) for link in self.links} | {f"{word[:at]}e"}
            known = [stem for stem in stems if (stem,) in self.matter or (stem,) in self.parts]
            for stem in sorted(known or stems, key=len, reverse=True) if head else ():
                first = self.matter.get((stem,)) or self._english("parts", (stem,), own)
                first = first or (self._compound(stem, own) or ("", ""))[0]
                if first and head:
                    return f"{first} {head[0]}", head[1]
            if len(word) - at >= LEAST_HEAD:
                head_alone = head or head_alone  # the longest
        return head_alone


@lru_cache(maxsize=1)
def data() -> dict[str, Any]:
    """``data/languages.toml``."""
    return tomllib.loads((DATA / "languages.toml").read_text(encoding="utf-8"))


@lru_cache(maxsize=1)
def languages() -> tuple[Language, ...]:
    """Languages of ``data/languages.toml``."""
    found = []
    shared = data()["nouns"]
    for at, code in enumerate(("de", "fr", "es"), 1):
        table = data()[code]
        lists: dict[str, Any] = {
            kind: dict(_entries(table[kind])) for kind in ("small", "matter", "parts")
        }
        for kind, lines in shared.items():  # English : German : French : Spanish
            rows = (line.split(" : ") for line in lines.strip().splitlines())
            words = "\n".join(f"{row[at]} = {row[0]}" for row in rows)
            for phrase, english in _entries(words):
                before = lists[kind].get(phrase)
                if before is None or kind == "parts":
                    options = dict.fromkeys([*(before or english).split("|"), *english.split("|")])
                    lists[kind][phrase] = "|".join(options)
        endings, links = tuple(table["endings"]), tuple(table.get("links", ()))
        done = re.compile(table["adjectives"])
        idle = frozenset(map(bare, small_words(code)))
        own: dict[str, Any] = {"endings": endings, "links": links, "adjectives": done, "idle": idle}
        found.append(Language(table["name"], **lists, **own))
    return tuple(found)


def _entries(text: str) -> Iterator[tuple[Phrase, str]]:
    for entry in re.split(r"[;\n]", text):
        words, equals, english = entry.partition("=")
        for word in words.split(",") if equals else ():
            plain = bare(word.strip())
            phrase = (plain,) if plain.isalpha() else tuple(re.findall(r"\w+", plain))
            if phrase:  # "-" is none
                yield phrase, english.strip()


def glossed(
    cut: list[Atom],
    lexicon: ReaderLexicon,
    known: Collection[str],
    *,
    foreign: bool = False,
    language: str = "",
) -> Glossed | None:
    """Return a text's words in English where it is of another language, None where it is not.

    ``foreign`` says that it is not English, so that few words are enough to say what it is;
    ``language`` says what it is.
    """
    shouts = not any(c.islower() for atom in cut for c in atom.text)
    words = [
        (i, bare(atom.text)) for i, atom in enumerate(cut)
        if atom.text.islower() or (atom.text.istitle() and len(atom.text) > 1)  # no "PA", "ShA"
        or (shouts and len(atom.text) > SHORTEST)
    ]  # fmt: skip
    english = {
        i for i, word in words
        if lexicon.model.is_word(cut[i].text.lower()) or (cut[i].stem,) in lexicon.rows
        or (cut[i].text.lower(),) in lexicon.meanings
    }  # fmt: skip
    stems = [atom.stem for atom in cut if atom.text[0].isalnum()]
    starts = [i for i, atom in enumerate(cut) if atom.text[0].isalnum()]
    for k, size in ((k, size) for k in range(len(stems)) for size in range(2, LONGEST)):
        if tuple(stems[k : k + size]) in lexicon.rows:  # "gutta-percha", "acetal homopolymer"
            english |= {*starts[k : k + size]} & {i for i, _ in words}
    if not language and all(i in english for i, _ in words):
        return None
    names = {bare(word): word for word in known}
    names |= {_DIGRAPH.sub("", name): word for name, word in names.items()}  # "gehaeuse"
    best, most = None, 0
    called = {i for i, word in words if word in names}
    for each in languages():
        read = {i for i, word in words if each.of((word,))}
        small = {i for i, word in words if (word,) in each.small}
        both = english - {i for i in small if cut[i].text.lower() not in small_words("en")}
        own = len(read - both) - len(both - read - called)
        strange = {i for i, _ in words} - read - both - called
        sure = foreign or 2 * own >= len(strange)
        if own > most and sure and read - english:  # some word of its own: not "chrome moly"
            best, most = each, own
    if language:
        best = next(each for each in languages() if each.name == language)
    if best is None:
        return None
    low = [cut[i].text.lower() for i, _ in words]
    others = (sum(word in small_words(code) for word in low) for code in OTHERS)
    if not language and max(others) > sum(best.of((word,)) is not None for _, word in words):
        return None
    # Words for the same part are one: "yeux" of a part "oeil_g"
    alike = [(best.names(name), own) for name, own in names.items()]

    def same(noun: str) -> str:
        """The asset's own word for a part that a noun is another word for."""
        told = best.names(noun)
        pairs = ((name, own) for name, own in alike if name[0] and told[0])
        return next((own for name, own in pairs if told[0] in name or name[0] in told), "")

    states = {*small_lists()["conditions"]["words"]}
    # In German nouns, and so compounds, begin with a capital, but in a careless hand
    nouns = sum(cut[i].text.istitle() for i, _ in words) > 2
    out, unknown, matter, at, last = list[Atom](), set[int](), dict[int, str](), 0, ""
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
            # Or the matter that it is called after: "mantequilla", "cera de abeja" of a part "cera"
            spans = (
                (size, best.matter.get((*([form] if size == 1 else run[:1]), *run[1:size])))
                for size in range(LONGEST, 0, -1) for form in best.forms(run[0])
            )  # fmt: skip
            size, own = next((found for found in spans if found[1]), (1, ""))
            end = cut[min(at + size, len(cut)) - 1].end
            out.append(atom._replace(stem=called[0], end=end))
            matter |= {atom.start: own} if own else {}
            at, last = at + size, "parts"
            continue
        done = best.adjectives.fullmatch(atom.text.lower() if shouts else atom.text)
        taken, found = 1, None
        for size in range(LONGEST, 0, -1):
            ends = [k for k, word in enumerate(run) if word[:1].isalpha()][:size]
            phrase = tuple(run[k] for k in ends)
            if len(phrase) == size and all(w[:1].isalpha() or w in "'’-" for w in run[: ends[-1]]):
                found = best.of(phrase, known, whole=bool(done) and nouns)
            if found:
                taken = ends[-1] + 1
                break
        if found is None:
            done = done and atom.text.lower() not in small_lists()["compared"]
            if at not in english and not done:
                unknown.add(atom.start)
            out += [] if done else [atom]
            at, last = at + 1, ""
            continue
        if found[1] == "parts" and taken == 1 and (own := same(run[0])):
            out.append(atom._replace(stem=own))
            at, last = at + taken, "parts"
            continue
        # Its English words share its place between them
        english_words = re.findall(r"[^\W\d_]+|\d+|,", found[0])
        ends = np.linspace(atom.start, cut[at + taken - 1].end, len(english_words) + 1)
        new = [
            Atom(word, int(start), int(end), lexicon.model.singular(word.lower()))
            for word, start, end in zip(english_words, ends, ends[1:], strict=False)
        ]
        if found[1] == "parts":  # "Stahlklinge" of a part "klinge"
            ends_in = (run[0][k:] for k in range(1, len(run[0]) - SHORTEST + 1))
            new[-1] = new[-1]._replace(stem=next(filter(None, map(same, ends_in)), new[-1].stem))
        # "roue avant gauche", "chêne mouillé": what stands before the noun in English
        before = {"parts": places(), "matter": states}.get(last, ())
        if not best.links and len(new) == 1 and new[0].stem in before:
            part = out.pop()
            out += [new[0]._replace(start=part.start, end=part.end),
                    part._replace(start=new[0].start, end=new[0].end)]  # fmt: skip
        else:
            out += new
            last = found[1]
        at += taken
    return Glossed(best.name, out, unknown, matter)
