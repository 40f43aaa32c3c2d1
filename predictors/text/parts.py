"""Names of parts: what an asset calls them, and which of them a phrase names."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any, NamedTuple

from ...fem.table import MaterialTable
from .english import DATA, Phrase, load_model, words


@lru_cache(maxsize=1)
def part_words() -> Mapping[str, Any]:
    """Synonyms and opposites of part names: ``data/parts.toml``."""
    return tomllib.loads((DATA / "parts.toml").read_text(encoding="utf-8"))


def as_written(name: str) -> list[str]:
    """Words of a part's name as the file has them: "BRGHousing_2" -> brg housing 2."""
    name = re.sub(r"(?<=\d)[xX×](?=\d)", " ", name)  # "M8x40", so that "4x" is no part
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])|(?<=[^\W\d_])(?=\d)", " ", name)
    return [word.lower() for word in re.findall(r"[^\W\d_]+|\d+", spaced)]


def part_name_words(name: str) -> Phrase:
    """Words of a part's name: "SM_Leg.001" -> leg 001; "leg_FL" -> leg front left."""
    data = part_words()
    cut = as_written(name)
    kept = [word for word in cut if word not in data["exported"]]
    kept = kept if any(word.isalpha() for word in kept) else cut
    model = load_model()
    out: list[str] = []
    for i, word in enumerate(kept):
        short = data["abbreviated"].get(word)
        short = short or (data["short"].get(word) if i or len(word) > 1 else None)
        out += short.split() if short else [model.singular(word)]
    return tuple(out)


@lru_cache(maxsize=1)
def known_parts() -> frozenset[str]:
    """Words that name a part of something, and so never the whole of it."""
    data = part_words()
    return frozenset(w for group in data["synonyms"] for w in group) - {*data["things"]}


@lru_cache(maxsize=1)
def places() -> frozenset[str]:
    """Words that say where a part is: left, rear, upper, second."""
    data = part_words()
    return frozenset(w for group in data["places"] for w in group) | set(data["same"])


def positions(phrase: Sequence[str]) -> dict[int, str]:
    """Sets of opposites that a phrase speaks of -> its side in each: front leg -> {1: "front"}."""
    data = part_words()
    side = [data["same"].get(word, word) for word in phrase]
    return {
        i: word
        for i, group in enumerate([*data["places"], *data["looks"]])
        for word in reversed(side)
        if word in {data["same"].get(other, other) for other in group}
    }


# Which parts of an asset a noun phrase names: "front legs" of leg_FL, leg_FR, leg_BL, leg_BR.

# Of one word: what the part itself is called, its last word before the others; what else the asset
# calls it; another word for the same; a word inside another ("top" in "tabletop").
HEAD, WORD, LABEL, SYNONYM, INSIDE = 5, 4, 3, 2, 1
_SHORTEST_INSIDE = 4  # letters: "leg" is inside "legend"


class PartMatch(NamedTuple):
    """How well a phrase fits a part: the kind of its head's match, and how many words match."""

    tier: int
    words: int


class PartLabels:
    """What an asset calls a part: its name, then other words that it has for it."""

    def __init__(self, names: Phrase) -> None:
        self.own = part_name_words(names[0]) if names else ()
        self.label = frozenset(word for name in names[1:] for word in part_name_words(name))
        sided = {w for group in (*part_words()["places"], *part_words()["looks"]) for w in group}
        nouns = [w for w in self.own if w not in sided and len(w) > 1 and w.isalpha()]
        self.head = nouns[-1] if nouns else next(iter(self.own[-1:]), "")
        self.sides = positions(self.own)
        self.coded = len(self.own) == 2 and len(self.own[0]) == 1 and self.own[1].isdigit()
        aside = places() - known_parts()  # the last word of "leg_left" is leg, of "table_top" top
        self.tail = [word for word in self.own if word.isalpha() and word not in aside][-1:]

    def tier(self, word: str) -> int:
        """How a word names this part, 0 where it does not."""
        if word == self.head:
            return HEAD
        if word in self.own:
            return WORD
        if word in self.label:
            return LABEL
        related = {w for group in part_words()["synonyms"] if word in group for w in group}
        if self.head in related or related & self.label:
            return SYNONYM
        long = min(len(word), len(self.head)) >= _SHORTEST_INSIDE
        return INSIDE if long and (self.head.endswith(word) or word.endswith(self.head)) else 0


def parts_named(name: Phrase, parts: Sequence[PartLabels]) -> dict[int, PartMatch]:
    """Parts that a name speaks of: the best kind of match, and of these the most words."""
    sides, forms = positions(name[:-1]), words()["attributes"]["empty"]
    found: dict[int, PartMatch] = {}
    for i, part in enumerate(parts if name else ()):
        tier = part.tier(name[-1])
        if not tier and name[-1] in forms:  # "the butt section" of a part "butt"
            tier = max((part.tier(word) for word in name[-2:-1]), default=0)
        if not tier and part.coded and name[: len(part.own)] == part.own:
            tier = HEAD  # "A100 housing" of a part "A100"
        against = any(part.sides.get(axis, side) != side for axis, side in sides.items())
        if tier and not against:
            matched = {w for w in name if w in part.own or w in part.label}
            matched |= {side for axis, side in sides.items() if part.sides.get(axis) == side}
            found[i] = PartMatch(tier, len(matched))
    # "the corner post" is "post_corner" before any other post.
    called = {i: m for i, m in found.items() if len(name) > 1 and {*name} <= {*parts[i].own}}
    found = called or found
    counted = any(word.isdigit() for part in parts for word in part.own)
    first = {i for i in found if parts[i].own[:1] == name[-1:] and len(parts[i].own) == 2}
    best, siblings = (
        max((m.tier for m in found.values()), default=0),
        (first if not counted and any(found[i].tier == HEAD for i in first) else set()),
    )
    found = {i: m for i, m in found.items() if m.tier == best or i in siblings}
    most = max((m.words for m in found.values()), default=0)
    found = {i: m for i, m in found.items() if m.words == most}
    strict = {axis: side for axis, side in sides.items() if axis < len(part_words()["places"])}
    told = any(parts[i].sides.get(axis) == side for i in found for axis, side in strict.items())
    # "front legs" of a chair whose legs bear numbers: nobody knows which those are.
    return {} if strict and not told and len(found) > 1 else found


def parts_called(words: Phrase, labels: Sequence[Sequence[str]]) -> list[int]:
    """Indices of the parts that words name."""
    return [*parts_named(words, [part_labels(tuple(names)) for names in labels])]


@lru_cache(maxsize=4096)  # of an assembly, which is asked about for every phrase
def part_labels(names: Phrase) -> PartLabels:
    """What an asset calls a part, by its name and its other words."""
    return PartLabels(names)


LISTS = tomllib.loads((DATA / "network.toml").read_text(encoding="utf-8"))


def words_of(section: str, name: str) -> frozenset[str]:
    """Return the words of a list of ``data/network.toml``."""
    return frozenset(LISTS[section][name].split())


FILLERS, REST = words_of("roles", "fillers"), words_of("roles", "rest")
OBJECTS, STRUCTURE = words_of("roles", "objects"), words_of("roles", "structure")
FRAME_PARTS, FAMILIES = words_of("roles", "frame_parts"), words_of("roles", "families")
EXPORTED, LEAVES = words_of("roles", "exported"), words_of("roles", "leaves")
THINGS = tuple(LISTS["roles"]["things"].split())
SYNONYMS = [frozenset(group.split()) for group in LISTS["synonyms"]["groups"]]
# Material words of other languages in names of asset parts -> a name in the table.
FOREIGN = {word: name for name, words in LISTS["foreign"].items() for word in words.split()}
# Words of names and sentences without their endings, and the table's phrases among them.

TOKEN = re.compile(r"[^\W_]+|[.;,&+=:\n]")
_IRREGULAR = {"leaves": "leaf", "feet": "foot", "shelves": "shelf", "knives": "knife"}


@cache
def stem(word: str) -> str:
    """Return the singular, lower-case form of an English word."""
    word = word.lower()
    if word in _IRREGULAR:
        return _IRREGULAR[word]
    if len(word) > 4 and word.endswith("ies"):
        return word[:-3] + "y"
    if len(word) > 4 and word.endswith(("ches", "shes", "sses", "xes")):
        return word[:-2]
    if len(word) > 3 and word.endswith("s") and not word.endswith(("ss", "us", "is")):
        return word[:-1]
    return word


def name_words(name: str) -> list[str]:
    """Stems of the words in a part, node or material name: camelCase, digits and _ divide them."""
    spaced = re.sub(r"(?<=[^\W\d_A-Z])(?=[A-Z])", " ", name)
    return [stem(word) for word in re.findall(r"[^\W\d_]+", spaced)]


class Vocabulary:
    """The material phrases to look for; the longest match wins."""

    def __init__(self, phrases: Iterable[str]) -> None:
        self._phrase: dict[tuple[str, ...], str] = {}
        for phrase in phrases:  # of singular and plural, the first
            self._phrase.setdefault(tuple(map(stem, TOKEN.findall(phrase.lower()))), phrase)
        self._foreign = {stem(word): name for word, name in FOREIGN.items()}
        self._longest = max(map(len, self._phrase), default=0)

    def match(self, stems: Sequence[str], at: int) -> tuple[str, int] | None:
        """Longest phrase that starts at ``stems[at]``, and its number of tokens."""
        for length in range(min(self._longest, len(stems) - at), 0, -1):
            phrase = self._phrase.get(tuple(stems[at : at + length]))
            if phrase is not None:
                return phrase, length
        return None

    def in_name(self, name: str) -> str | None:
        """The longest material phrase in an asset's name ("Metal_Chrome", "legno_scuro")."""
        stems = name_words(name)
        if not LEAVES.isdisjoint(stems):  # "leaf_spring", "door_leaf"
            stems = [word for word in stems if word != "leaf"]
        found = [match for at in range(len(stems)) if (match := self.match(stems, at))]
        if found:
            # "Wood_Oak" is oak: of equals, the word that is no family's.
            return max(found, key=lambda match: (match[1], match[0] not in FAMILIES))[0]
        return next((self._foreign[word] for word in stems if word in self._foreign), None)


@lru_cache(maxsize=4)
def vocabulary_of(table: MaterialTable) -> Vocabulary:
    """Return the phrases of a table."""
    return Vocabulary(table.phrases)


@lru_cache(maxsize=1)
def known_words() -> tuple[str, ...]:
    """Words for parts and whole things, but for those that only tests of the network speak of."""
    kinds = tomllib.loads((DATA / "part_kinds.toml").read_text(encoding="utf-8"))["parts"]
    parts = (word.strip() for kind in kinds.values() for word in kind.split("|")[0].split(","))
    return (*parts, *(thing.replace("_", " ") for thing in THINGS))


# Kinds of material by the words in a name of an asset: "blackMetal_02", "madera oscura".

KINDS: tuple[str, ...] = tuple(LISTS["kinds"])
_KIND_OF = {word: kind for kind, words in LISTS["kinds"].items() for word in words.split()}
_CHAFF = frozenset(
    "jpg jpeg png tga texture textured tex map mat material generic sweethome".split()
)


def bare_words(name: str) -> list[str]:
    """Lower-case words of a name, without digits, file suffixes and the like."""
    spaced = re.sub(r"(?<=[a-zà-ÿ])(?=[A-ZÀ-Ý])", " ", name)
    words = re.findall(r"[^\W\d_]+", spaced.lower())
    return [word for word in words if len(word) > 1 and word not in _CHAFF]


def kind_of(name: str) -> str | None:
    """Kind of material that a name speaks of, or None."""
    words = bare_words(name)
    found = {_KIND_OF[word] for word in words if word in _KIND_OF}
    if not found:
        inside = LISTS["inside"].items()
        found = {k for k, stems in inside for s in stems.split() if any(s in w for w in words)}
    return next((kind for kind in KINDS if kind in found), None)


@dataclass(frozen=True)
class NamedPart:
    """A part and its words: ``name`` first, then node, group and material names."""

    name: str
    labels: tuple[str, ...]
    name_words: tuple[str, ...]
    label_words: frozenset[str]
    material: str | None  # phrase of the table in its labels
    material_label: str  # the label that holds it
    volume: float

    @classmethod
    def of(cls, labels: Sequence[str], vocabulary: Vocabulary, volume: float) -> NamedPart:
        """Read the words of a part; a material's name counts before the part's own."""
        name, *others = labels
        found = ((label, vocabulary.in_name(label)) for label in (*others, name))
        label, material = next((pair for pair in found if pair[1]), ("", None))
        label_words = frozenset(word for other in others for word in name_words(other))
        return cls(
            name, tuple(others), tuple(name_words(name)), label_words, material, label, volume
        )

    @property
    def spoken(self) -> str:
        """Its name as words to embed ("bed frame" for "BedFrame_01"), or "object".

        What it is comes last and is no filler: a "soup can" is no soup.
        """
        own = [word for word in self.name_words if word not in EXPORTED]
        told = [word for word in own[:-1] if word not in FILLERS] + own[-1:]
        return " ".join(told) or "object"


def own_name(part: NamedPart) -> str:
    """Words of a part with the material its labels tell, "" where they tell nothing."""
    word = "" if part.spoken == "object" else part.spoken
    material = part.material or ""
    return word if material in word else f"{word} {material}".strip()
