"""Names of materials: rows of a table by all their names, designations and names of trade.

"walnut burl", "6061-T6", "EN-GJL-250" and "Hostaform" are found in a text here.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any, NamedTuple

from ...fem.note import Note
from ...fem.table import Material, MaterialTable, load_contents
from .english import (
    ATOM,
    DATA,
    OTHERS,
    Atom,
    LanguageModel,
    Lexeme,
    Phrase,
    bare,
    is_glue,
    load_model,
    small_words,
    words,
)
from .parts import part_words

NEAREST = 3  # rows that are named beside an unknown material
SHORT = 3  # letters of an acronym that may be an English word too: "PET", "PA"
_SPELT = ("stiffness", "density", "character", "coat", "coating", "rest")  # roles worth mending to


class Meaning(NamedTuple):
    """What a phrase does in a sentence, and which row, measure or factor it says."""

    role: str
    value: Any = None


class Designated(NamedTuple):
    """Where a designation stands in a text, and the row of its family."""

    start: int
    end: int
    row: Material


@lru_cache(maxsize=1)
def designations() -> Mapping[str, Any]:
    """Names of standards and of trade: ``data/designations.toml``."""
    return tomllib.loads((DATA / "designations.toml").read_text(encoding="utf-8"))


def atoms(text: str, model: LanguageModel, known: Collection[str] = ()) -> list[Atom]:
    """Cut a text into words, numbers and signs; a plural is of a ``known`` word if it may be."""
    return [
        Atom(m[0], m.start(), m.end(), model.singular(m[0].lower(), known))
        for m in ATOM.finditer(text.replace("’", "'"))
    ]


def _cut(name: str) -> list[str]:
    """Words and numbers of a name in small letters, without signs."""
    if name.isascii() and name.replace(" ", "").isalpha():  # as most are: thousands at a start
        return name.lower().split()
    words = ATOM.findall(name.replace("’", "'"))
    return [word.lower() for word in words if word[0].isalnum()]


class ReaderLexicon:
    """Phrases of a table and of the language, by their first word."""

    def __init__(self, table: MaterialTable, model: LanguageModel) -> None:
        self.table, self.model = table, model
        self.rows: dict[Phrase, Material] = {}
        self._acronyms: set[Phrase] = set()
        self._row_words: dict[str, set[str]] = {}  # of the rows that were asked for
        self.listed: set[Phrase] = set()  # with a comma in them: "oak, willow"
        self.plural: set[Phrase] = set()  # with a word in the plural: "wood chips"
        self._designated: tuple[str, list[Designated]] = "", []
        called = [(row, name) for row in table for name in (row.name, *row.aliases)]
        # A name may carry what tells it from its kin: "oak, willow (along grain)".
        called += [(row, re.sub(r"\s*\(.*?\)", "", row.name)) for row in table if "(" in row.name]
        for row, name in called:
            said = _cut(name)
            phrase = tuple(map(model.singular, said))
            if not phrase or "(contents)" in name:
                continue
            self.rows.setdefault(phrase, row)
            if "," in name:
                self.listed.add(phrase)
            if any(word == stem + "s" for word, stem in zip(said, phrase, strict=True)):
                self.plural.add(phrase)
            if len(phrase) == 1 and len(phrase[0]) <= SHORT:
                parts = re.split(r"[\s,]+", row.name)
                upper = any(name.upper() in {part, part.strip("()")} for part in parts)
                spoken = re.search(r"[aeiouy]", name.lower())
                if upper or not spoken or not self.model.is_word(name):
                    self._acronyms.add(phrase)

        for means, names in designations()["trade"].items():
            if row := self.rows.get(self.phrase(means)):
                for name in names:
                    self.rows.setdefault(self.phrase(name), row)

    def phrase(self, name: str) -> Phrase:
        """Stems of a name without signs: "Ti-6Al-4V" -> ti 6 al 4 v."""
        return tuple(map(self.model.singular, _cut(name)))

    def needs_capitals(self, phrase: Phrase) -> bool:
        """Whether a phrase is an acronym that small letters may mean otherwise: "PET", "pet"."""
        (word, *more) = phrase
        if more or phrase not in self._acronyms or word in words()["small_acronyms"]:
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

    def row_called(self, said: str) -> Material | None:
        """Row that the last words of ``said`` name: "black acetal"."""
        words = self.phrase(said)
        return next(
            (self.rows[words[i:]] for i in range(len(words)) if words[i:] in self.rows), None
        )

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
        """Patterns of standards, each with the first of its family's rows that the table has."""
        families = ((f["patterns"], self.first_row(f["rows"])) for f in designations()["family"])
        return [
            (re.compile(rf"(?<![\w.-])(?:{pattern})(?:\+[A-Z]{{1,3}})?(?!\w)"), row)
            for patterns, row in families
            for pattern in patterns
            if row
        ]

    def designated(self, text: str) -> list[Designated]:
        """Where a text has designations and laminates, each with its row; kept of the last text."""
        if self._designated[0] != text:
            found = [
                Designated(*m.span(), row) for find, row in self.designations
                for m in find.finditer(text)
            ]  # fmt: skip
            rows = ((place, self.first_row([place.row])) for place in laminates(text))
            found += [Designated(place.start, place.end, row) for place, row in rows if row]
            self._designated = text, found
        return self._designated[1]


# Laminates: "2x2 twill carbon prepreg" and "E-glass/epoxy, ±45" by fibre, lay-up and resin.
#
# Whoever names a laminate says its fibre, how that lies and what binds it, in any order and with
# grades, weights and forms between. ``data/laminates.toml`` has the words of each and the rows of
# their combinations.

_JOIN = re.compile(r"[ \t/()+\-–]{0,3}|, ?")  # between the words of one laminate
# Words that behind a comma may begin something else: "glass, fabric seat"
_LOOSE = re.compile(r"(?i)mat|fabric|cloth|satin|tissue|braid(?:ed)?|forged|uni|45 ?(?:°|deg)")
# Fibres that nobody uses without a resin.
_ALONE = {"intermediate", "high", "pitch", "grade", "k13d", "m40", "m46", "m55", "m60", "t1100"}


class Laminate(NamedTuple):
    """Where a text speaks of a laminate, and the name of its row."""

    start: int
    end: int
    row: str


class _LaminateWord(NamedTuple):
    kind: str  # fibre, lay, resin or between
    value: str
    start: int
    end: int


@lru_cache(maxsize=1)
def _of_laminates() -> tuple[re.Pattern, Mapping[str, Any]]:
    """All words as one pattern, a group for each kind and value ("lay_woven"), and the rows."""
    data = tomllib.loads((DATA / "laminates.toml").read_text(encoding="utf-8"))
    patterns = [
        f"(?P<{kind}_{value}>{pattern})"
        for kind in ("fibre", "lay", "resin") for value, pattern in data[kind].items()
    ]  # fmt: skip
    patterns.append(f"(?P<between>{data['between']})")
    return re.compile(rf"(?<![\w.-])(?:{'|'.join(patterns)})(?!\w)"), data["rows"]


def laminates(text: str) -> list[Laminate]:
    """The laminates of a text.

    >>> [text[a:b] for text in ["fins 2x2 twill carbon"] for a, b, _ in laminates(text)]
    ['2x2 twill carbon']
    >>> laminates("carbon steel"), laminates("UD carbon")[0].row
    ([], 'carbon/epoxy unidirectional (along fibre)')
    """
    return [found for run in _laminate_runs(text) if (found := _laminate(run))]


def _laminate_runs(text: str) -> Iterator[list[_LaminateWord]]:
    """Words of laminates that nothing else parts."""
    run: list[_LaminateWord] = []
    for m in _of_laminates()[0].finditer(text):
        kind, _, value = (m.lastgroup or "between").partition("_")
        token = _LaminateWord(kind, value, m.start(), m.end())
        gap = text[run[-1].end : token.start] if run else ""
        kinds = {t.kind for t in run}
        joins = run and _JOIN.fullmatch(gap)
        if "," in gap:  # "carbon, 2x2 twill", but "carbon, glass" and "CSM, biax glass"
            joins = joins and kind == "lay" and "fibre" in kinds and not _LOOSE.fullmatch(m[0])
        elif "+" in gap:  # "kevlar + carbon hybrid", but "UD carbon + triax"
            joins = joins and not ({"lay", "resin"} & kinds and kind in ("fibre", "lay"))
        if not joins:
            yield run
            run = []
        run.append(token)
    yield run


def _laminate(run: Sequence[_LaminateWord]) -> Laminate | None:
    """What a run of words is of: a fibre with the way that it lies, or with a resin."""
    while run and run[-1].kind == "between":
        run = run[:-1]
    while run and run[0].kind == "between":
        run = run[1:]
    fibres = list(dict.fromkeys(t.value for t in run if t.kind == "fibre"))
    lays = [t.value for t in run if t.kind == "lay"]
    resins = [t.value for t in run if t.kind == "resin"]
    if not fibres or not (lays or resins or fibres[0] in _ALONE):
        return None
    rows, both = _of_laminates()[1], "_".join(sorted(fibres))
    known = rows[both if both in rows else fibres[0]]
    mixed = {"ud", "bias"} <= {*lays} and "quasi" in known
    lay = "quasi" if mixed else next((lay for lay in known if lay in lays), "")
    named = known.get(lay or "plain")
    if isinstance(named, Mapping):  # by its resin
        named = next((named[r] for r in resins if r in named), named.get("other"))
    return Laminate(run[0].start, run[-1].end, named) if named else None


_KEPT: dict[int, ReaderLexicon] = {}


def lexicon_of(table: MaterialTable) -> ReaderLexicon:
    """Return the lexicon of a table, made once."""
    if id(table) not in _KEPT:
        _KEPT[id(table)] = ReaderLexicon(table, load_model())  # which keeps the table, and its id
    return _KEPT[id(table)]


# Spans of a text that may be a lexeme: part names, numbers, phrases of the table, codes.

LONGEST_PHRASE = 7  # atoms: "Ti-6Al-4V titanium"


def named_materials(
    text: str, cut: list[Atom], lexicon: ReaderLexicon, known: set[str], *, several: bool
) -> list[Lexeme]:
    """Rows of the table that a text names, at every place the longest phrase, and designations.

    A phrase whose last word is a ``known`` part's is that part's name too; where there are
    ``several`` parts, its first may stand in a list of them.
    """
    listed = known if several else set[str]()
    found: list[Lexeme] = []
    for i in range(len(cut)):
        sizes = range(min(LONGEST_PHRASE, len(cut) - i), 0, -1)
        candidates = (_material(cut, i, size, text, lexicon, known, listed) for size in sizes)
        best = next((lexeme for lexeme in candidates if lexeme), None)
        if best:
            part = best.words[-1] in known and not best.words[-1].isdigit()  # "PZT-4" of ring_4
            found.append(replace(best, part=part, names=best.names or best.words[-1:] * part))
    graded = [x for x in found if x.value.grade and re.search(r"\d", x.text)]
    for start, end, row in lexicon.designated(text):
        # "EN AW-6082 T6" has a row, and "EN AW-6082 T4" its family's.
        own = (
            x.value for x in graded
            if start <= x.start and x.end == end and x.value.category == row.category
            and not re.search(r"\d", text[start : x.start])
        )  # fmt: skip
        said = text[start:end]
        found.append(Lexeme(said, start, end, "material", next(own, row), (said.lower(),)))
    return found


def _material(
    cut: list[Atom],
    i: int,
    size: int,
    text: str,
    lexicon: ReaderLexicon,
    known: set[str],
    listed: set[str],
) -> Lexeme | None:
    """A row of the table in ``size`` words from ``i`` on, which only hyphens and the like part."""
    end, count = i, 0
    while count < size:
        if end == len(cut):
            return None
        sign = cut[end].text
        if sign[0].isalnum():
            count += 1
        elif end == i or sign not in ("-", "/", "+", ",", "("):
            return None
        elif sign in ("/", "-", "+") and not is_glue(text, cut[end]):
            return None
        end += 1
    run = cut[i:end]
    stems: Phrase = tuple(a.stem for a in run if a.text[0].isalnum())
    own = lexicon.rows.get(stems) or lexicon.rows.get(tuple(map(bare, stems)))
    row = own or (None if known & {*stems} else lexicon.turned.get(stems))
    if not row or (any(a.text == "," for a in run) and stems not in lexicon.listed):
        return None  # "rubber sole, leather upper" is no sole leather
    of_thing = len(stems) == 2 and stems not in lexicon.plural and (stems[1],) in lexicon.rows
    if (of_thing and run[0].is_plural) or (not own and any(a.is_plural for a in run)):
        return None  # "windows glass" and "paper books" name parts: no window glass, no book paper
    single = len(stems) > 1 and len(stems[0]) == 1  # "A36" and not "a 36"
    if single and run[0].end != run[1].start:
        return None
    if not single and lexicon.needs_capitals(stems) and not run[0].text.isupper():
        return None
    start, stop = run[0].start, run[-1].end
    if text[start - 1 : start].isdigit():  # "Pb" of "CuSn10Pb1"
        return None
    opens = i == 0 or cut[i - 1].text in "|;,\n"  # "spring steel" of a spring, "| saddle leather"
    divided = opens and run[0].stem in listed and stems[1:] in lexicon.rows
    states = {*words()["states"]["words"], *words()["conditions"]["words"]}
    divided = divided or (
        len(stems) > 1 and stems[0] in known and {*stems[1:]} <= states
    )  # "spaghetti, dry"
    if divided and listed & {atom.stem for atom in cut if atom not in run}:
        return None  # one of a list of parts
    note = words()["confused"].get(text[start:stop].lower(), "")
    return Lexeme(
        text[start:stop], start, stop, "material", row, stems, names=stems[:1] * divided, note=note
    )


# Spelling: words that are nearly one that the reader knows, and texts that are not English.

SHORTEST_MENDED = 4  # letters: a shorter word has too many neighbours
# A text is not English where so many of its words are in no dictionary and no table.
FOREIGN_SHARE = 0.5
LANGUAGES = ("en", "de", "fr", "es", *OTHERS)


_COINED = re.compile(r"-\d")  # "quindle-7" is no quince


def mended_spelling(
    text: str, cut: list[Atom], lexicon: ReaderLexicon, known: set[str]
) -> tuple[list[Atom], list[str], set[int], dict[int, str]]:
    """Mend what is misspelt; tell what is in no dictionary, and a text that is not English.

    A designation is spelt as it is: "Perunal" is no Perbunan. Returns the atoms, notes on the
    whole, where the words stand that nobody knows, and by place what was mended.
    """
    coded = [(start, end) for start, end, _ in lexicon.designated(text)]
    odd = [
        i for i, atom in enumerate(cut)
        if not _is_known(atom, lexicon, known)
        and not any(start <= atom.start < end for start, end in coded)
    ]  # fmt: skip
    mended, notes = list(cut), {}
    for i in odd:
        # Glued to digits it is part of a name, as in "X50CrMoV15".
        sides = [cut[j] for j in (i - 1, i + 1) if 0 <= j < len(cut)]
        glued = any(
            side.text[0].isdigit() and (side.end == cut[i].start or cut[i].end == side.start)
            for side in sides
        )
        near = None if glued else _nearest(cut[i], lexicon, known)
        coined = near not in known and _COINED.match(text, cut[i].end)
        if near and not (coined and _skeleton(cut[i].text.lower()) != _skeleton(near)):
            mended[i] = cut[i]._replace(stem=near, text=near)
            notes[cut[i].start] = Note("lexing.spelt", word=cut[i].text, near=near)
    for i, (atom, after) in enumerate(pairwise(mended)):  # "caste iron", but no "AlSi9"
        glued = atom.end == after.start or atom.stem in known
        near = None if glued else _near_phrase(atom, after, lexicon)
        if near:
            mended[i] = atom._replace(stem=near, text=near)
            notes[atom.start] = Note("lexing.spelt", word=atom.text, near=near)
    left = [i for i in odd if mended[i] is cut[i]]
    strange = {cut[i].start for i in left}
    long = sum(atom.text.isalpha() and len(atom.text) >= SHORTEST_MENDED for atom in cut)
    left = [i for i in left if not cut[i].text.isupper()]
    foreign = len(left) >= 3 and len(left) >= FOREIGN_SHARE * long
    strange_long = [i for i in odd if len(cut[i].text) >= SHORTEST_MENDED]
    if len(strange_long) >= 3 and len(strange_long) == long:
        return [], [Note("lexing.language_read")], set(), {}
    if odd and not foreign:  # or another language has more of its small words than English has
        ends = {a.end for a in cut if a.text[0].isdigit()}  # "Ni" of "CuAl10Ni5" is no word
        low = [
            a.text.lower() for a in cut
            if a.text.isalpha() and not a.text.isupper() and a.start not in ends
        ]  # fmt: skip
        small = {code: small_words(code) for code in LANGUAGES}
        english = sum(word in small["en"] for word in low)
        alien = (sum(w in small[code] and w not in small["en"] for w in low) for code in LANGUAGES)
        words_of = sum(lexicon.model.is_word(word) for word in low)
        if max(alien) > max(english, 2) and 2 * words_of < len(low):
            return [], [Note("lexing.language_read")], set(), {}
    if foreign:
        note = Note("lexing.words_english", count=len(odd), long=long)
        return cut, [note], {cut[i].start for i in odd}, {}
    return mended, [], strange, notes


def _is_known(atom: Atom, lexicon: ReaderLexicon, known: set[str]) -> bool:
    word = atom.text.lower()
    return (
        not word[0].isalpha()
        or (len(word) < SHORTEST_MENDED and not (atom.text.isupper() and len(word) > 1))
        or word in known
        or atom.stem in known
        or word in lexicon.spellings
        or atom.stem in lexicon.spellings
        or lexicon.model.is_word(word)
        or (word,) in lexicon.meanings
        or (atom.stem,) in lexicon.rows
    )


def _nearest(atom: Atom, lexicon: ReaderLexicon, known: set[str]) -> str | None:
    """Return the one word that a misspelt one is near to, or None."""
    from rapidfuzz.distance import OSA
    from rapidfuzz.process import extract_iter

    if atom.text.isupper() and len(atom.text) <= SHORTEST_MENDED + 1:
        return None  # an acronym
    words = [*lexicon.spellings, *(w for w in known if len(w) >= SHORTEST_MENDED and w.isalpha())]
    best: dict[str, float] = {}
    for word in {atom.text.lower(), atom.stem}:
        for near, off, _ in extract_iter(word, words, scorer=OSA.distance, score_cutoff=2):
            skeleton = _skeleton(word) == _skeleton(near)
            limit = 2 if len(word) >= (6 if skeleton else 7) else 1
            if off <= limit and word[0] == near[0] and off <= len(word) / 2:
                best[near] = min(best.get(near, 9.0), off - 0.5 * skeleton)
    ranked = sorted(best.items(), key=lambda item: (item[1], item[0] not in known))
    nearest = [word for word, off in ranked if off == ranked[0][1]]
    nearest = [word for word in nearest if word in known] or nearest
    nearest.sort(key=lambda word: abs(len(word) - len(atom.text)))  # "silicoen" is no silicon
    # "fiber" and "fibre" are one word: either will do.
    return nearest[0] if len({_skeleton(word) for word in nearest}) == 1 else None


def _near_phrase(atom: Atom, after: Atom, lexicon: ReaderLexicon) -> str | None:
    """The first word of a row of two that a word before its second is one letter off from."""
    from rapidfuzz.distance import OSA

    firsts = lexicon.firsts.get(after.stem, ())
    if len(atom.text) < SHORTEST_MENDED or not atom.text.isalpha() or (atom.stem,) in lexicon.rows:
        return None
    if {atom.stem, atom.text.lower()} & {*firsts} or (atom.text.lower(),) in lexicon.meanings:
        return None
    if lexicon.model.is_word(atom.text.lower(), ("verb",)):  # "we took steel" is of no tool steel
        return None
    near = [word for word in firsts if OSA.distance(atom.text.lower(), word, score_cutoff=1) <= 1]
    return near[0] if len(near) == 1 else None


def _skeleton(word: str) -> str:
    """Consonants of a word, doubled ones once: what a spelling by ear keeps."""
    return re.sub(r"(.)\1", r"\1", re.sub(r"(?<!^)[aeiouyh]", "", word))
