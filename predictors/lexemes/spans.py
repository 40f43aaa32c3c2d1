"""Spans of a text that may be a lexeme: part names, numbers, phrases of the table, codes."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from ..quantities.numerals import numerals
from ..vocabulary.lexicon import Atom, Meaning, Phrase, ReaderLexicon, part_name_words, words
from .lexeme import Lexeme

LONGEST_PHRASE = 7  # atoms: "Ti-6Al-4V titanium"
_CODE = re.compile(r"(?<![\w.])(?=[\w.-]*\d)(?=[\w.-]*[A-Za-z])[A-Za-z0-9][\w.+-]*\w")
_SMALL = ("word", "hyphen", "empty", "idle", "comma")  # what a code may hold
_SHARE = re.compile(
    r"(?i)(?:half|quarters?|thirds?|\d+ ?%|part(?:l|iall)y|nearly|almost)"
    r"[ -](?:full|filled)(?: \w+)?$"
)
_TIMES = re.compile(r"(?i)\d+x")
# Codes that say no matter: "M8", "3rd", "20x20x2", "IP65", "z24".
_HARMLESS = re.compile(
    r"(?i)\d+(x\d*)+|x\d+|[mz]\d+(x[\d.]+)*|(dn|ip|ral|iso|din)\d+|\d+(st|nd|rd|th|s|d|k)"
)
_TEMPER = re.compile(r"-?(?:T[1-9]\d{0,4}|H\d{2,3}|O|F)")  # of a wrought alloy: "A356.0-T6"


def spans(
    text: str, cut: list[Atom], lexicon: ReaderLexicon, names: Sequence[str], known: set[str]
) -> list[Lexeme]:
    """Return every span that says something, also over each other."""
    found = _exact_names(text, names) + _numbers(text) + _phrases(cut, text, lexicon, known)
    found += _designations(text, lexicon)
    return found + _codes(text, found)


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
                part = single and best.words[-1] in known
                found.append(replace(best, part=part, names=best.names or best.words[-1:] * part))
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
    if text[start - 1 : start].isdigit():  # "Pb" of "CuSn10Pb1"
        return None
    opens = i == 0 or cut[i - 1].text in "|;,\n"  # "spring steel" of a spring, "| saddle leather"
    divided = opens and stems[0] in known and stems[1:] in lexicon.rows
    if divided and known & {atom.stem for atom in cut if atom not in run}:
        return None  # one of a list of parts
    note = words()["confused"].get(text[start:stop].lower(), "")
    return Lexeme(
        text[start:stop], start, stop, "material", row, stems, names=stems[:1] * divided, note=note
    )


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
    share = _SHARE.search(text[:stop]) if meaning.role == "fill" else None
    note = f"{share[0]!r} is taken as full" if share else ""
    return Lexeme(text[start:stop], start, stop, meaning.role, meaning.value, said, note=note)


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
