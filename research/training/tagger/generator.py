"""Made texts about what the parts of things are made of, with the spans that speak of each part.

Forms, words and things are data (``data/*.toml``), the materials those of the table and of the
lists of languages. A template is text with slots:

``[a|b|]`` one of them; ``<name>`` one entry of a list of the language, else of English; ``<#5-90>``
a whole number, ``<modulus>`` and ``<density>`` a value with its unit; ``{A}`` how the text calls
the parts A, ``{the A}`` with an article; ``{A=list}`` an entry of a list that speaks of A;
``{3=list}`` the same in another role; ``{A+B3=list}`` both. An entry of a list may begin with its
weight: "5*...".
"""

from __future__ import annotations

import random
import re
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

DATA = Path(__file__).parent / "data"
LANGUAGES = ("de", "fr", "es")
# What a word says of a part; the first two decide its material.
NONE, MATTER, NUMBER, COATING, CONTENT, EXCLUDED, ALTERNATIVE, RELATION = range(8)
MOST_PARTS = 14
_SLOT = re.compile(r"(?:(the|a) )?(?:([A-Z](?:\+[A-Z])*|rest|all))?(?:(\d)?=(\w+))?")


class Span(NamedTuple):
    """Characters ``start`` to ``end`` of a text speak of the parts ``owners`` in a role."""

    start: int
    end: int
    owners: tuple[int, ...]
    role: int


class Example(NamedTuple):
    """A made text, the names of the parts and what speaks of them."""

    names: list[str]
    text: str
    spans: list[Span]
    skip: frozenset[int] = frozenset()  # parts of which it is not known what speaks of them


class Piece(NamedTuple):
    """A piece of a text under construction."""

    text: str
    owners: tuple[int, ...] = ()
    role: int = NONE


@dataclass
class Unit:
    """Parts that one clause speaks of, and what the text may call them."""

    owners: tuple[int, ...]
    said: list[str]  # without an article
    bare: list[str]  # that take none: "leg_2", "both legs"
    plural: bool = False
    own: str = ""  # the matter that the part is called after: "soil"


@cache
def _data() -> dict[str, dict[str, Any]]:
    found: dict[str, dict[str, Any]] = {}
    for path in sorted(DATA.glob("*.toml")):
        found[path.stem] = tomllib.loads(path.read_text(encoding="utf-8"))
    return found


class Node(NamedTuple):
    """A parsed template: alternatives of sequences, or one leaf."""

    kind: str
    value: Any


@cache
def _parsed(template: str) -> list[Node]:
    """Nodes of a template."""

    def sequence(at: int, stops: str) -> tuple[list[Node], int]:
        nodes: list[Node] = []
        while at < len(template) and template[at] not in stops:
            sign = template[at]
            if sign == "[":
                ways, at = [], at + 1
                while True:
                    way, at = sequence(at, "|]")
                    ways.append(way)
                    at += 1
                    if template[at - 1] == "]":
                        break
                nodes.append(Node("any", ways))
            elif sign in "{<":
                end = template.index("}" if sign == "{" else ">", at)
                nodes.append(Node(sign, template[at + 1 : end]))
                at = end + 1
            else:
                end = at
                while end < len(template) and template[end] not in "[{<" + stops:
                    end += 1
                nodes.append(Node("text", template[at:end]))
                at = end
        return nodes, at

    return sequence(0, "")[0]


class Generator:
    """Makes texts; ``materials`` are names and aliases, ``lexicon`` for each language two lists."""

    def __init__(
        self, materials: Sequence[str], lexicon: Mapping[str, Mapping[str, Any]], seed: int
    ) -> None:
        self.dice = random.Random(seed)
        self.materials, self.lexicon = list(materials), lexicon
        data = _data()
        self.things = {
            thing: [part.replace("_", " ") for part in parts.split()]
            for line in data["things"]["things"].strip().splitlines()
            for thing, parts in [line.split(": ")]
        }
        self.nouns = sorted({part for parts in self.things.values() for part in parts})
        self.same: dict[str, list[str]] = {}
        for line in data["things"]["same"].strip().splitlines():
            words = [word.replace("_", " ") for word in line.split()]
            for word in words:
                self.same.setdefault(word, []).extend(w for w in words if w != word)
        self.mass = set(data["things"]["mass"])
        self.language = "en"
        self.thing, self.busy = "", set[str]()
        self.units: dict[str, Unit] = {}
        self.lists: dict[tuple[str, str], tuple[list[str], list[float]]] = {}

    # Drawing

    def chance(self, share: float) -> bool:
        """True in this share [1] of draws."""
        return self.dice.random() < share

    def one(self, of: Sequence[Any]) -> Any:
        """One of these, all as likely."""
        return of[int(self.dice.random() * len(of))]

    def entry(self, name: str) -> str:
        """One entry of a list of the language, by weight."""
        key = self.language, name
        if key not in self.lists:
            data = _data()
            entries = data[self.language].get(name)
            entries = data["en"].get(name) if entries is None else entries
            entries = data["words"].get(name) if entries is None else entries
            if isinstance(entries, str):
                entries = [line for line in entries.split("\n") if line]
            if entries is None:
                raise KeyError(name)
            weighed = [re.match(r"(\d+)\*", e) for e in entries]
            total, sums = 0.0, []
            for weight in weighed:
                total += int(weight[1]) if weight else 1
                sums.append(total)
            plain = [e[w.end() :] if w else e for e, w in zip(entries, weighed, strict=True)]
            self.lists[key] = plain, sums
        entries, sums = self.lists[key]
        return self.dice.choices(entries, cum_weights=sums)[0]

    # Templates

    def expand(self, template: str, owners: tuple[int, ...] = (), role: int = NONE) -> list[Piece]:
        """Pieces of a template, each character of them by whom it is owned and in which role."""
        pieces: list[Piece] = []
        self._expand(_parsed(template), owners, role, pieces)
        return pieces

    def _expand(
        self, nodes: Sequence[Node], owners: tuple[int, ...], role: int, out: list[Piece]
    ) -> None:
        for kind, value in nodes:
            if kind == "text":
                out.append(Piece(value, owners, role))
            elif kind == "any":
                self._expand(self.one(value), owners, role, out)
            elif kind == "<":
                self._expand(_parsed(self._drawn(value)), owners, role, out)
            else:
                self._slot(value, owners, role, out)

    def _slot(self, slot: str, owners: tuple[int, ...], role: int, out: list[Piece]) -> None:
        article, who, number, name = _SLOT.fullmatch(slot).groups()  # type: ignore
        if name is None:  # how a part is called
            out.append(Piece(self.call(self.units[who], article), owners, role))
            return
        if who:
            owners = tuple(i for key in who.split("+") for i in self.units[key].owners)
            role = NONE
        inner = int(number) if number else role
        if not who and number and role not in (NONE, MATTER) and inner != NONE:
            inner = role  # what is excluded stays so with its numbers
        if name == "own":
            out.append(Piece(self.units[who].own, owners, inner))
        else:
            start = len(out)
            self._expand(_parsed(self._drawn(name)), owners, inner, out)
            if who and sum(p.text.count("(") - p.text.count(")") for p in out[start:]) > 0:
                out.append(Piece(")", owners))

    def _drawn(self, name: str) -> str:
        if name[0] == "#":
            low, high = name[1:].split("-")
            return str(self.dice.randint(int(low), int(high)))
        if name == "modulus":
            return self._modulus()
        if name == "density":
            return self._density()
        if name == "mat":
            return self._material()
        if name == "thing":
            return self.thing if self.chance(0.75) else self.entry("things")
        if name == "other":  # another thing, and none of its parts
            return next(t for t in iter(lambda: self.one([*self.things]), None) if t != self.thing)
        return self.entry(name)

    def _material(self) -> str:
        if self.language != "en" and self.chance(0.8):
            return self.one(self.lexicon[self.language]["matter"])
        dice = self.dice.random()
        if dice < 0.5:
            return self.entry("common")
        if dice < 0.78:
            found = self.one(self.materials)
            return found if self.chance(0.8) else found.capitalize()
        return self.entry("designation" if dice < 0.96 else "invented")

    def _figure(self, value: float) -> str:
        text = f"{value:.{self.one((1, 2, 3, 3))}g}"
        if "e" in text:
            text = f"{float(text):.0f}" if value > 1 else f"{float(text):f}".rstrip("0")
        comma = 0.5 if self.language != "en" else 0.03
        return text.replace(".", ",") if self.chance(comma) else text

    def _modulus(self) -> str:
        value = 10 ** self.dice.uniform(3, 11.6)
        if self.chance(0.08):
            return f"{value:.1e}".replace("e+0", "e").replace("e+", "e") + self.entry("pascal")
        scale = 1e9 if value > 8e8 else 1e6 if value > 8e5 else 1e3
        unit = self.entry({1e9: "giga", 1e6: "mega", 1e3: "kilo"}[scale])
        return self.entry("about") + self._figure(value / scale) + unit

    def _density(self) -> str:
        value = 10 ** self.dice.uniform(1, 4.3)
        heavy = self.chance(0.35)
        unit = self.entry("per_litre" if heavy else "per_cubic_metre")
        return self.entry("about") + self._figure(value / 1000 if heavy else value) + unit

    # The thing and its parts

    def asset(self) -> tuple[list[str], list[Unit], tuple[int, ...]]:
        """Names of an asset's parts, the units that a text may speak of, and the mute parts."""
        self.thing = self.one([*self.things])
        pool = self.things[self.thing] if self.chance(0.85) else self.nouns
        wanted = self.one((1, 2, 2, 3, 3, 3, 4, 4, 5, 6))
        nouns = self.dice.sample(pool, min(wanted, len(pool)))
        self.busy = {word for noun in nouns for word in noun.split()} | {*self.thing.split()}
        names: list[str] = []
        units: list[Unit] = []
        for noun in nouns:
            units += self._parts(noun, names)
        mute: tuple[int, ...] = ()
        if self.chance(0.14):
            mute = tuple(range(len(names), len(names) + self.one((1, 1, 2, 3))))
            names += [self._filled(self.entry("mute")) for _ in mute]
        if self.chance(0.06):  # a file whose names say nothing
            sort = self.entry("mute").replace("<#1-40>", "{}").replace("<#1-9>", "{}")
            if "{}" in sort:
                names[:] = [sort.format(i + 1) for i in range(len(names))]
                for unit in units:
                    unit.bare = [self._series(unit, names)]
                    if unit.said and self.chance(0.5):  # "Body_1 fork: ..."
                        unit.bare = [f"{unit.bare[0]} {self.one(('', '(', '- '))}{unit.said[0]}"]
                        unit.bare[0] += ")" * unit.bare[0].count("(")
                    unit.said = unit.bare
        seen: dict[str, int] = {}
        for i, name in enumerate(names):
            if name in seen:
                names[i] = f"{name}_{i}"
            seen[name] = i
        for unit in units:
            if unit.own and unit.own not in " ".join(names):
                unit.own = ""
        self.dice.shuffle(units)
        return names, units, mute

    def _filled(self, template: str) -> str:
        return "".join(piece.text for piece in self.expand(template))

    def _parts(self, noun: str, names: list[str]) -> list[Unit]:
        """Name the parts of one noun, and return what may be spoken of apart."""
        first, language = len(names), self.language
        matter = noun in self.mass
        kinds = ("one",) if matter else ("one", "one", "one", "plural", "sides", "count", "count")
        kind = self.one(kinds)
        if len(names) > MOST_PARTS - 4:
            kind = "one"
        file_noun = said = noun
        if language != "en":
            found = self.lexicon[language]["parts"].get(noun)
            if found is None:
                noun = self.one([*self.lexicon[language]["parts"]])
                found, file_noun, matter = self.lexicon[language]["parts"][noun], noun, False
            said = self.one(found)
            file_noun = said.lower() if self.chance(0.5) else file_noun
        elif self.chance(0.25) and noun in self.same:
            others = [w for w in self.same[noun] if not {*w.split()} & self.busy]
            said = self.one(others) if others else noun
        if kind == "one" and self.chance(0.12):
            extra = self.entry("before")
            file_noun, said = f"{extra} {file_noun}", f"{extra} {said}"
        many = self.plural(said)
        if kind in ("one", "plural"):
            file_name = self._file_name(self.plural(file_noun) if kind == "plural" else file_noun)
            names.append(file_name)
            singular = kind == "one" or self.chance(0.06)
            bare = [file_name] if self.chance(0.5) else []
            own = noun if matter and language == "en" and said == noun else ""
            return [Unit((first,), [said if singular else many], bare, not singular, own)]
        if kind == "sides":
            keys = self.one(_data()[language]["sides"])
        else:
            keys = [str(k + 1) for k in range(self.one((2, 2, 3, 3, 4, 4, 5, 6)))]
        owners = tuple(range(first, first + len(keys)))
        sort = self.dice.randint(0, 9)
        for key in keys:
            names.append(self._keyed(file_noun, key, kind, sort))
        whole = Unit(owners, [many], self._together(said, keys, names, owners), True)
        if self.chance(0.6):
            return [whole]
        if kind == "sides" and len(keys) == 4:
            halves = [
                (owners[:2], keys[0].split()[0]), (owners[2:], keys[2].split()[0]),
            ]  # fmt: skip
            return [Unit(own, [self._with(many, key)], [], True) for own, key in halves]
        single = [
            Unit((i,), self._single(said, key, kind), [names[i]] if self.chance(0.6) else [])
            for i, key in zip(owners, keys, strict=True)
        ]
        if len(keys) > 2 and self.chance(0.5):
            cut = self.dice.randint(1, len(keys) - 1)
            if self.chance(0.5):  # some, and the others
                rest = Unit(owners[cut:], [], [f"{self.entry('others')} {many}"], True)
                return [rest, *single[:cut]]
            runs = [owners[:cut], owners[cut:]]
            out = []
            for run in runs:
                unit = Unit(run, [many], [], True)
                unit.bare = [self._series(unit, names), self._numbered(said, many, run, first)]
                unit.said = unit.bare
                out.append(unit)
            return out
        return single

    def _series(self, unit: Unit, names: Sequence[str]) -> str:
        """Names as the file has them, one after the other: "leg_1 to leg_3"."""
        own = [names[i] for i in unit.owners]
        if len(own) == 1:
            return own[0]
        if len(own) > 2 and self.chance(0.6):
            return own[0] + self.entry("to") + own[-1]
        return ", ".join(own[:-1]) + self.entry("and") + own[-1]

    def _numbered(self, said: str, many: str, run: Sequence[int], first: int) -> str:
        own = [str(i - first + 1) for i in run]
        if len(own) == 1:
            return f"{said} {own[0]}"
        if len(own) > 2 and self.chance(0.6):
            return f"{many} {own[0]}{self.entry('to')}{own[-1]}"
        return f"{many} " + ", ".join(own[:-1]) + self.entry("and") + own[-1]

    def _together(
        self, said: str, keys: Sequence[str], names: Sequence[str], owners: Sequence[int]
    ) -> list[str]:
        """How several parts of a noun are called at once, without an article."""
        many, count = self.plural(said), self.entry("numbers_" + str(min(len(keys), 6)))
        ways = [self.entry("every").replace("@", many).replace("%", said).replace("#", count)]
        own = [names[i] for i in owners]
        if self.chance(0.4):
            ways.append(self._series(Unit(tuple(owners), [], []), names))
        stem = own[0]
        while stem and not all(name.startswith(stem) for name in own):
            stem = stem[:-1]
        if len(stem) > 2 and self.chance(0.4):
            ways.append(stem + self.one(("*", "*", "#", "x", "…")))
        return ways

    def _with(self, noun: str, key: str) -> str:
        if self.language in ("fr", "es"):
            return f"{noun} {key}"
        return f"{key} {noun}"

    def _single(self, said: str, key: str, kind: str) -> list[str]:
        if kind == "sides":
            ways = [self._with(said, key)]
            return [*ways, f"{said} {key}"] if self.chance(0.3) else ways
        order = _data()[self.language]["orders"]
        ways = [f"{said} {key}", f"{said} {self.entry('no')}{key}"]
        return [*ways, f"{order[int(key) - 1]} {said}"] if int(key) <= len(order) else ways

    def _keyed(self, noun: str, key: str, kind: str, sort: int) -> str:
        """A part's name with what tells it from its like, in one style for all of them."""
        if kind == "sides":
            short = _data()["things"]["short"].get(key, key) if sort < 6 else key
            pair = (short, noun) if sort in (1, 7) else (noun, short)
            return self._file_name(" ".join(pair), sort)
        key = key.zfill(self.one((2,)) if sort in (2, 3) else 1)
        signs = (" ", "_", "_", "_", "", ".00", ":", " ", "-", "_")
        return self._file_name(noun, sort) + signs[sort] + key

    def _file_name(self, noun: str, sort: int | None = None) -> str:
        """A noun as a file writes it."""
        dice = self.dice.randint(0, 9) if sort is None else sort
        if dice < 6:
            name = noun.replace(" ", "_")
        elif dice < 7:
            name = "".join(word.capitalize() for word in noun.split())
        elif dice < 8:
            name = noun.replace(" ", "-")
        else:
            name = noun
        if sort is None and self.chance(0.15):
            name = self._filled(self.entry("file")).replace("@", name)
        elif sort is None and self.chance(0.08):
            name = name.upper() if self.chance(0.4) else name.capitalize()
        return name

    def plural(self, noun: str) -> str:
        """A plural, as good as two rules and some endings go."""
        if self.language == "de":
            return noun if noun.endswith(("er", "el", "en")) else noun + self.one(("e", "en", "n"))
        if noun.endswith(("s", "x", "z")):
            return noun if self.language == "fr" or noun.endswith("s") else noun + "es"
        if self.language == "en":
            irregular = _data()["en"]["plurals"].get(noun.split()[-1])
            if irregular:
                return noun[: len(noun) - len(noun.split()[-1])] + irregular
            if noun.endswith(("ch", "sh")):
                return noun + "es"
            if noun.endswith("y") and noun[-2] not in "aeiou":
                return noun[:-1] + "ies"
        elif self.language == "es" and noun[-1] not in "aeiouáéíóú":
            return noun + "es"
        return noun + "s"

    def call(self, unit: Unit, article: str | None) -> str:
        """What a text calls a unit."""
        if unit.bare and (not unit.said or self.chance(0.35)):
            return self.one(unit.bare)
        name = self.one(unit.said)
        if self.language == "en" and self.chance(0.06):
            name = f"{self.entry('looks')} {name}"
        if article and not (article == "a" and unit.plural):
            name = self.entry("definite" if article == "the" else "indefinite") + name
        return name

    # The text

    def text(self, names: Sequence[str], units: list[Unit], mute: tuple[int, ...]) -> list[Piece]:
        """Pieces of a text about the units."""
        every = tuple(range(len(names)))
        form = self._form()
        out: list[Piece] = []
        items, rest = list(units), ()
        if form.get("rest"):
            count = self.dice.randint(0 if form.get("items") == "few" else 1, 3)
            items = units[:count]
            rest = tuple(i for unit in units[count:] for i in unit.owners) + mute
            if not rest or (not items and form.get("items") != "few"):
                return self.text(names, units, mute)
        elif form.get("items") == "none":
            items, rest = [], every
        elif len(units) > 1 and self.chance(0.3):
            items = units[: self.dice.randint(1, len(units) - 1)]  # some are not spoken of
        self.units = {"all": Unit(every, [], []), "rest": Unit(rest, [], [])}
        if self.chance(form.get("lead", 0.12)):
            out += self.expand(self.entry("lead"))
        talk = 0.75 if self.chance(0.07) else 0.13  # a paragraph with facts about anything
        while talk > 0.5 and self.chance(0.5):
            out += [*self.aside(), Piece(". ")]
        out += self.expand(self.one(form.get("head", [""])))
        separators = form.get("between", ["; "])
        separator = self.one(separators)
        separator = self.entry("between") if separator == "*" else separator
        fixed = self.one(form["item"]) if items and self.chance(form.get("alike", 0.4)) else None
        left = list(items)
        while left:
            if len(left) < len(items):
                last = separator in (", ", ". ", " ") and len(left) == 1 and self.chance(0.4)
                out.append(Piece(self.entry("and") if last else separator))
                while separator == ". " and self.chance(talk):
                    out += [*self.aside(), Piece(separator)]
            item = fixed or self.one(form["item"])
            item = self.entry(item[1:-1]) if item[0] == "<" and item[-1] == ">" else item
            wants = sum(f"{{{k}" in item or f" {k}}}" in item or f"+{k}" in item for k in "BC")
            if wants >= len(left):
                item = self.entry("clause_one")
                wants = 0
            taken = [left.pop() for _ in range(wants + 1)]
            self.units |= dict(zip("ABC", taken, strict=False))
            if taken[0].own and wants == 0 and self.chance(0.8):
                item = self.entry("clause_own")
            out += self.expand(item)
        out += self.expand(self.one(form.get("tail", [""])))
        while self.chance(talk):
            out += [Piece(". "), *self.aside()]
        return [*out, Piece(".")] if self.chance(0.35) else out

    def _form(self) -> dict[str, Any]:
        data = _data()
        forms = data[self.language]["form"]
        return self.dice.choices(forms, [form.get("weight", 1) for form in forms])[0]

    def aside(self) -> list[Piece]:
        """A sentence that says nothing of the parts' matter, and names none of them."""
        for _ in range(8):
            pieces = self.expand(self.entry("aside"))
            said = "".join(piece.text for piece in pieces).lower()
            if not {*re.findall(r"\w+", said)} & self.busy:
                return pieces
        return []

    def example(self) -> Example:
        """One text with its spans."""
        self.language = "en" if self.chance(0.76) else self.one(LANGUAGES)
        names, units, mute = self.asset()
        pieces = self.text(names, units, mute)
        if self.chance(0.015):
            pieces = self.aside()  # nothing is said at all
        return Example(names, *_joined(self.noise(pieces)))

    # Noise

    def noise(self, pieces: list[Piece]) -> list[Piece]:
        """Misspelt words, small letters, capitals."""
        if self.chance(0.16):
            share = self.one((0.1, 0.25, 0.4))
            pieces = [
                p._replace(text=re.sub(r"[^\W\d_]{4,}", lambda m: self._typo(m[0], share), p.text))
                for p in pieces
            ]
        dice = self.dice.random()
        if dice < 0.14:
            pieces = [p._replace(text=p.text.lower()) for p in pieces]
        elif dice < 0.16:
            pieces = [p._replace(text=p.text.upper()) for p in pieces]
        elif dice < 0.19:
            pieces = [p._replace(text=re.sub(r"[.,;]\s*$", " ", p.text)) for p in pieces]
        elif dice < 0.55:
            first = next((i for i, p in enumerate(pieces) if p.text.strip()), None)
            if first is not None:
                text = pieces[first].text.lstrip()
                pieces[first] = pieces[first]._replace(text=text[:1].upper() + text[1:])
        return pieces

    def _typo(self, word: str, share: float) -> str:
        if not self.chance(share):
            return word
        i = self.dice.randint(1, len(word) - 2)
        sound, alike = self.one(_SOUNDS)
        ways: tuple[Callable[[], str], ...] = (
            lambda: word[:i] + word[i + 1 :],
            lambda: word[:i] + word[i + 1] + word[i] + word[i + 2 :],
            lambda: word[:i] + word[i] + word[i:],
            lambda: word[:i] + self.one("aeioulnrstm") + word[i + 1 :],
            lambda: word[0] + word[1:].replace(sound, alike, 1),
        )
        return self.one(ways)()


# Spellings by ear.
_SOUNDS = (
    ("ph", "f"), ("c", "k"), ("k", "c"), ("ee", "ea"), ("ea", "ee"), ("ie", "ei"), ("ei", "ie"),
    ("y", "i"), ("ll", "l"), ("ss", "s"), ("tt", "t"), ("s", "z"), ("um", "ium"), ("ium", "um"),
    ("er", "re"), ("el", "le"), ("le", "el"), ("o", "oo"), ("x", "ks"), ("th", "t"), ("mm", "m"),
)  # fmt: skip
_MARKS = " \t\n,;:(-"
_EXTRA = re.compile(r"[ \t]+(?=[ ,.;:)\]!?\n])|(?<=[(\[\n]) +|^\s+|\s+$")


def _joined(pieces: Sequence[Piece]) -> tuple[str, list[Span]]:
    """The text of pieces without the spaces that stand twice, and its spans."""
    raw = "".join(piece.text for piece in pieces)
    moved, kept, end = [0] * (len(raw) + 1), [], 0
    for match in _EXTRA.finditer(raw):
        kept.append(raw[end : match.start()])
        end = match.end()
        for i in range(match.start(), match.end()):
            moved[i] = 1
    kept.append(raw[end:])
    gone = 0
    for i in range(len(raw) + 1):
        here, moved[i] = moved[i], i - gone
        gone += here
    spans, at = [], 0
    for piece in pieces:
        if piece.role and piece.owners and piece.text.strip():
            start = moved[at + len(piece.text) - len(piece.text.lstrip(_MARKS))]
            stop = moved[at + len(piece.text.rstrip(_MARKS))]
            if stop <= start:
                pass
            elif spans and spans[-1][1] == start and spans[-1][2:] == (piece.owners, piece.role):
                spans[-1] = spans[-1]._replace(end=stop)
            else:
                spans.append(Span(start, stop, piece.owners, piece.role))
        at += len(piece.text)
    return "".join(kept), spans


def pairs(example: Example, dice: random.Random) -> Iterator[tuple[int, list[Span]]]:
    """Parts of an example to learn from, with their spans; of equal parts most are left out."""
    seen: set[Any] = set()
    for i in dice.sample(range(len(example.names)), len(example.names)):
        if i in example.skip:
            continue
        own = [span for span in example.spans if i in span.owners]
        key = re.sub(r"\d+", "", example.names[i]), tuple(own)
        if key in seen and dice.random() < 0.75:
            continue
        seen.add(key)
        yield i, own
