"""A text as lexemes: part names, materials, numbers and connectors, each one token."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from ..quantities.numerals import numerals
from ..vocabulary.lexicon import Atom, Meaning, Phrase, ReaderLexicon, atoms, part_name_words, words
from ..vocabulary.spelling import mended_spelling

LONGEST_PHRASE = 7  # atoms: "Ti-6Al-4V titanium"
_CODE = re.compile(r"(?<![\w.])(?=[\w.-]*\d)(?=[\w.-]*[A-Za-z])[A-Za-z0-9][\w.+-]*\w")
_SMALL = ("word", "hyphen", "empty", "idle", "comma")  # what a code may hold
_TIMES = re.compile(r"(?i)\d+x")
# Codes that say no matter: "M8", "3rd", "20x20x2", "IP65", "z24".
_HARMLESS = re.compile(
    r"(?i)\d+(x\d*)+|x\d+|[mz]\d+(x[\d.]+)*|(dn|ip|ral|iso|din)\d+|\d+(st|nd|rd|th|s|d|k)"
)
_TEMPER = re.compile(r"-?(?:T[1-9]\d{0,4}|H\d{2,3}|O|F)")  # of a wrought alloy: "A356.0-T6"
_THROUGH = ("to", ".", "..", "...", "-", "–", "through", "until", "thru")


@dataclass(frozen=True)
class Lexeme:
    """One token of a sentence: what it does, what it says, how the model tags it."""

    text: str
    start: int
    end: int
    role: str
    value: Any = None
    words: Phrase = ()
    known: bool = True  # to the dictionary, the table or the part names
    part: bool = False  # whether a part of the asset is called so
    tag: str = ""
    dep: str = ""
    note: str = ""


@dataclass
class Lexed:
    """Lexemes of a text and what was mended on the way."""

    lexemes: list[Lexeme]
    notes: list[str]


def lex(text: str, lexicon: ReaderLexicon, names: Sequence[str]) -> Lexed:
    """Cut a text into lexemes and tag them."""
    known = {word for name in names for word in part_name_words(name)}
    text = _plain(text)
    cut = atoms(text, lexicon.model, known)
    cut, notes, strange, mended = mended_spelling(cut, lexicon, known)
    found = _exact_names(text, names) + _numbers(text) + _phrases(cut, text, lexicon, known)
    found += _designations(text, lexicon)
    chosen = _longest(found + _codes(text, found))
    lexemes = _spelt_out(_fill(cut, chosen, lexicon, known, strange), names)
    lexemes = [
        replace(x, note=x.note or "; ".join(n for at, n in mended.items() if x.start <= at < x.end))
        for x in lexemes
    ]
    return Lexed(_tag(lexemes, lexicon), notes)


def _plain(text: str) -> str:
    """Write what stands for a word or a column by that, in as many characters."""
    for rule in words()["rewrites"]:
        width = lambda m, to=rule["to"]: m.expand(to).ljust(len(m[0]))[: len(m[0])]  # noqa: E731
        text = re.sub(rule["find"], width, text)
    return text


def _exact_names(text: str, names: Sequence[str]) -> list[Lexeme]:
    """Part names as they are written in the asset: "SM_Leg.001"."""
    found = []
    alone = {re.sub(r"[\s_-]+\d+$", "", name) for name in names}  # "hinge leaf" of hinge_leaf_1
    for name in sorted({*names, *alone}, key=len, reverse=True):
        if not re.search(r"[\W\d_]|[a-z][A-Z]", name.strip()):
            continue  # a plain word is read as one, with its plural
        written = r"(?:[\s_-]+|, ?)".join(map(re.escape, re.split(r"[\s_-]+", name)))
        said = part_name_words(name)
        for m in re.finditer(rf"(?i)(?<!\w){written}(?!\w)", text):
            found.append(Lexeme(m[0], *m.span(), "part", name, said, part=True))
    return found


def _numbers(text: str) -> list[Lexeme]:
    found = []
    for numeral in numerals(text):
        at = numeral.start, numeral.end
        role = "number" if numeral.value else "told" if numeral.note else "size"
        found.append(Lexeme(text[slice(*at)], *at, role, numeral.value, note=numeral.note))
    return found


def _phrases(cut: list[Atom], text: str, lexicon: ReaderLexicon, known: set[str]) -> list[Lexeme]:
    """Phrases of the table and of the language, at every place the longest of each."""
    found: list[Lexeme] = []
    for find in (_material, _connector):
        for i in range(len(cut)):
            sizes = range(min(LONGEST_PHRASE, len(cut) - i), 0, -1)
            candidates = (find(cut, i, size, text, lexicon, known) for size in sizes)
            best = next((lexeme for lexeme in candidates if lexeme), None)
            if best:
                single = best.end == cut[i].end or best.role == "material"
                found.append(replace(best, part=single and best.words[-1] in known))
    return found


def _material(
    cut: list[Atom], i: int, size: int, text: str, lexicon: ReaderLexicon, known: set[str]
) -> Lexeme | None:
    end = _joined(cut, i, size, text)
    run = cut[i:end] if end else []
    stems = tuple(a.stem for a in run if a.text[0].isalnum())
    row = lexicon.rows.get(stems) or (None if known & {*stems} else lexicon.turned.get(stems))
    if any(a.text == "," for a in run) and stems not in lexicon.listed:
        return None  # "rubber sole, leather upper" is no sole leather
    if not row or not _is_meant(run, stems, lexicon):
        return None
    start, stop = run[0].start, run[-1].end
    opens = i == 0 or cut[i - 1].text in "|;,\n"  # "| saddle leather": a saddle, what it is of
    divided = opens and stems[0] in known and stems[1:] in lexicon.rows
    if divided or text[start - 1 : start].isdigit():  # "Pb" of "CuSn10Pb1"
        return None
    note = words()["confused"].get(text[start:stop].lower(), "")
    return Lexeme(text[start:stop], start, stop, "material", row, stems, note=note)


def _connector(
    cut: list[Atom], i: int, size: int, text: str, lexicon: ReaderLexicon, known: set[str]
) -> Lexeme | None:
    run = cut[i : i + size]
    said = tuple(a.text.lower() for a in run if size == 1 or a.text != "-")
    meaning = lexicon.meanings.get(said)
    if size == 1:
        meaning = meaning or lexicon.meanings.get((run[0].stem,))
        glued = run[0].text in "-/" and _is_glue(text, run[0])
        lists = glued and {a.stem for a in cut[i - 1 : i + 2]} <= {*known, "/"}  # "arms/legs"
        meaning, said = Meaning("and" if lists else "hyphen") if glued else meaning, (run[0].stem,)
    if not meaning or (size > 1 and run[-1].text == "-"):
        return None
    start, stop = run[0].start, run[-1].end
    return Lexeme(text[start:stop], start, stop, meaning.role, meaning.value, said)


def _is_glue(text: str, sign: Atom) -> bool:
    """Whether a sign stands between words without spaces: "chrome-plated"."""
    around = text[sign.start - 1 : sign.end + 1] if sign.start else " "
    return len(around) == 3 and not any(c.isspace() for c in around)


def _joined(cut: list[Atom], start: int, size: int, text: str) -> int | None:
    """End of a run of ``size`` words that only hyphens, slashes or spaces part."""
    i, count = start, 0
    while i < len(cut):
        if cut[i].text[0].isalnum():
            count += 1
            if count == size:
                return i + 1
        elif i == start or cut[i].text not in ("-", "/", "+", ",", "("):
            return None
        elif cut[i].text in ("/", "-", "+") and not _is_glue(text, cut[i]):
            return None
        i += 1
    return None


def _is_meant(run: list[Atom], stems: Phrase, lexicon: ReaderLexicon) -> bool:
    """Whether a run that is spelt like a phrase of the table means it."""
    said = run[0].text
    if len(stems) > 1 and len(stems[0]) == 1:  # "A36" and not "a 36"
        return run[0].end == run[1].start
    if lexicon.needs_capitals(stems):
        return said.isupper()
    return True


def _designations(text: str, lexicon: ReaderLexicon) -> list[Lexeme]:
    """Designations of standards whose very name the table does not bear."""
    return [
        Lexeme(match[0], match.start(), match.end(), "material", row, (match[0].lower(),))
        for pattern, row in lexicon.designations
        for match in pattern.finditer(text)
    ]


def _codes(text: str, found: Sequence[Lexeme]) -> list[Lexeme]:
    """Letters and digits in one that nothing else is made of: "X7", a grade that nobody knows."""
    out = []
    for m in _CODE.finditer(text):
        start, end = m.span()
        over = [x for x in found if x.start < end and start < x.end and x.role not in _SMALL]
        if len(over) == 1 and over[0].role == "material" and over[0].start == start:
            metal = over[0].value.category == "metal"
            start, over = over[0].end, []  # "T40" of "PP-T40"
            if metal and _TEMPER.fullmatch(text[start:end]):
                continue
        said = text[start:end].lstrip("-+/")
        if over or _TIMES.fullmatch(said) or not re.search(r"[A-Za-z].*\d|\d.*[A-Za-z]", said):
            continue
        idle = bool(_HARMLESS.fullmatch(said))
        role, at = "idle" if idle else "word", end - len(said)
        out.append(Lexeme(said, at, end, role, words=(said.lower(),), known=idle))
    return out


_RANK = {"part": 0, "number": 1, "told": 1, "size": 1, "material": 2}


def _longest(found: list[Lexeme]) -> list[Lexeme]:
    """Of candidates over each other the longest, then the more telling."""
    order = sorted(found, key=lambda x: (x.start - x.end, _RANK.get(x.role, 3)))
    chosen: list[Lexeme] = []
    for lexeme in order:
        if all(lexeme.end <= c.start or c.end <= lexeme.start for c in chosen):
            chosen.append(lexeme)
    return sorted(chosen, key=lambda x: x.start)


def _fill(
    cut: list[Atom], chosen: list[Lexeme], lexicon: ReaderLexicon, known: set[str], strange: set
) -> list[Lexeme]:
    """Put the words that no phrase took between the lexemes."""
    out = list(chosen)
    for atom in cut:
        if any(c.start < atom.end and atom.start < c.end for c in chosen):
            continue
        first = atom.text[0]
        role = "word" if first.isalpha() else "digits" if first.isdigit() else "sign"
        out.append(
            Lexeme(
                atom.text, atom.start, atom.end, role, words=(atom.stem,),
                known=atom.start not in strange, part=atom.stem in known,
            )
        )  # fmt: skip
    return sorted(out, key=lambda x: x.start)


def _spelt_out(lexemes: list[Lexeme], names: Sequence[str]) -> list[Lexeme]:
    """Put the parts of a range where it is said: "leg_1 to leg_4", "blade_1..3", "bodies 1-3"."""
    out: list[Lexeme] = []
    first: Lexeme | None = None  # a part or its number, and nothing but "to" or dots since
    for lexeme in lexemes:
        ends = lexeme.role == "part" or (lexeme.role == "digits" and lexeme.part)
        bare = ends and first is not None and lexeme.role == "digits"
        if bare and first is not None and first.role == "part":  # "rib_01..03"
            lexeme = replace(lexeme, role="part", words=(*first.words[:-1], *lexeme.words))
        if ends and first is not None and first.role == lexeme.role and out[-1] is not first:
            while out[-1] is not first:
                out.pop()
            both = replace(first, role="and", words=(), part=False)
            for words in _between(first.words, lexeme.words, names):
                out += [both, replace(first, words=words)]
            out.append(both)
        if ends or (first is not None and lexeme.text.lower() not in _THROUGH):
            first = lexeme if ends else None
        out.append(lexeme)
    return out


def _between(first: Phrase, last: Phrase, names: Sequence[str]) -> list[Phrase]:
    """Words of the names between two that count on: the same words, with numbers between theirs."""
    if first[:-1] != last[:-1] or not (first[-1].isdigit() and last[-1].isdigit()):
        return []
    told = {int(part_name_words(name)[-1]) for name in names if name[-1:].isdigit()}
    inside = sorted(n for n in told if int(first[-1]) < n < int(last[-1]))
    return [(*first[:-1], str(n).zfill(len(first[-1]))) for n in inside]


# What the model is shown for tokens that it cannot know, and for phrases that are one token here.
_PLAIN = {"material": "wood", "number": "12", "size": "12", "told": "12", "part": "part"}
_PHRASES = {
    "fill": "with", "is": "is", "of": "of", "with": "with", "except": "except", "not": "not",
    "looks": "like", "off": "for", "on": "on", "than": "than", "degree": "very", "same": "same",
    "stiffness": "soft", "density": "heavy", "character": "tough", "rest": "rest", "whole": "all",
}  # fmt: skip


def _tag(lexemes: list[Lexeme], lexicon: ReaderLexicon) -> list[Lexeme]:
    """Let the model tag the sentence with every material, number and odd name as a plain word."""
    if not lexemes:
        return []
    shown = [
        _PLAIN.get(x.role, "") or (" " in x.text and _PHRASES.get(x.role)) or _sober(x.text)
        for x in lexemes
    ]
    doc = lexicon.model.doc(shown)
    return [
        replace(lexeme, tag=token.tag_, dep=token.dep_)
        for lexeme, token in zip(lexemes, doc, strict=True)
    ]


def _sober(word: str) -> str:
    return word.lower() if word.isupper() and len(word) > 1 else word.replace("\n", ".")
