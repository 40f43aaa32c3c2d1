"""A text as lexemes: part names, materials, numbers and connectors, each one token."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

from ...fem.table import Material
from .lexicon import (
    Atom,
    Meaning,
    Phrase,
    ReaderLexicon,
    atoms,
    part_name_words,
    without_loads,
    words,
)
from .numerals import Comparison, Quantity, number, numerals
from .spelling import mended_spelling


def lex(text: str, lexicon: ReaderLexicon, names: Sequence[str]) -> Lexed:
    """Cut a text into lexemes and tag them."""
    known = {word for name in names for word in part_name_words(name)}
    text, told = without_loads(_plain(text))
    cut = atoms(text, lexicon.model, known)
    cut, notes, strange, mended = mended_spelling(cut, lexicon, known)
    chosen = _longest(spans(text, cut, lexicon, names, known))
    # Put the words that no phrase took between the lexemes
    out = list(chosen)
    for i, atom in enumerate(cut):
        if any(c.start < atom.end and atom.start < c.end for c in chosen):
            continue
        first, named = atom.text[0], atom.stem in known and not _is_article(cut, i, known)
        role = "word" if first.isalpha() else "digits" if first.isdigit() else "sign"
        out.append(
            Lexeme(
                atom.text, atom.start, atom.end, role, words=(atom.stem,),
                known=atom.start not in strange, part=named,
            )
        )  # fmt: skip
    lexemes = spelt_out(sorted(out, key=lambda x: x.start), names)
    lexemes = [
        replace(x, note=x.note or "; ".join(n for at, n in mended.items() if x.start <= at < x.end))
        for x in lexemes
    ]
    return Lexed(_tag(lexemes, lexicon), [*told, *notes])


def _plain(text: str) -> str:
    """Write what stands for a word or a column by that, in as many characters."""
    for rule in words()["rewrites"]:
        width = lambda m, to=rule["to"]: m.expand(to).ljust(len(m[0]))[: len(m[0])]  # noqa: E731
        text = re.sub(rule["find"], width, text)
    return text


_RANK = {"part": 0, "number": 1, "told": 1, "size": 1, "material": 2}


def _longest(found: list[Lexeme]) -> list[Lexeme]:
    """Of candidates over each other the longest, then the more telling."""
    order = sorted(found, key=lambda x: (x.start - x.end, _RANK.get(x.role, 3)))
    chosen: list[Lexeme] = []
    for lexeme in order:
        if all(lexeme.end <= c.start or c.end <= lexeme.start for c in chosen):
            chosen.append(lexeme)
    return sorted(chosen, key=lambda x: x.start)


def _is_article(cut: list[Atom], i: int, known: set[str]) -> bool:
    """Whether an "a" is no label of a part: "a stool" of "leg_a", but "leg a is oak"."""
    if cut[i].text.lower() != "a" or (i > 0 and cut[i - 1].stem in known):
        return False
    after = cut[i + 1].text.lower() if i + 1 < len(cut) else ""
    joins = any(after in words()["roles"][role] for role in ("is", "of", "and"))
    return after[:1].isalpha() and not joins


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


# One token of a text.


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
    names: Phrase = ()  # those words of a row's phrase that a part is called too
    tag: str = ""
    dep: str = ""
    note: str = ""

    @property
    def is_name(self) -> bool:
        """Whether it may be a name that no dictionary has, by its place alone."""
        return self.role == "word" and self.tag in ("NN", "NNP", "FW", "XX", "UH")

    @property
    def is_code(self) -> bool:
        """Whether it is strange, or a number that measures nothing: "xq", "QT-500"."""
        return not self.part and (not self.known or self.role in ("digits", "told"))

    @property
    def is_measure(self) -> bool:
        """Whether it is a bare number that counts nothing: "0.33"."""
        return self.role == "digits" and not self.part and not self.text.isdigit()


@dataclass
class Lexed:
    """Lexemes of a text and what was mended on the way."""

    lexemes: list[Lexeme]
    notes: list[str]


# Spans of a text that may be a lexeme: part names, numbers, phrases of the table, codes.

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
    found += [
        Lexeme(match[0], match.start(), match.end(), "material", row, (match[0].lower(),))
        for pattern, row in lexicon.designations
        for match in pattern.finditer(text)
    ]
    # Letters and digits in one that nothing else is made of: "X7", a grade that nobody knows
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
    return found + out


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


# Ranges of parts: "leg_1 to leg_4".

_THROUGH = ("to", ".", "..", "...", "-", "–", "through", "until", "thru")


def spelt_out(lexemes: list[Lexeme], names: Sequence[str]) -> list[Lexeme]:
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


# Words that point to others: "the latter", and the noun that a text is about.


def point_back(lexemes: Sequence[Lexeme]) -> list[Lexeme]:
    """Put the parts in place of words that point back to them: "the latter is oak".

    Ordinals count the parts of the sentence that named some last: "a pane and a lid. The second".
    """
    out: list[Lexeme] = []
    named, ended = list[Phrase](), False
    for i, lexeme in enumerate(lexemes):
        place = words()["pointers"].get(lexeme.text.lower().removeprefix("the "))
        if lexeme.part and lexeme.words not in named:
            named = [lexeme.words] if ended else [*named, lexeme.words]
            ended = False
        elif lexeme.role == "stop":
            ended = True
        elif place is not None and -len(named) <= place < len(named) and len(named) > 1:
            articled = lexeme.text[:3].lower() == "the" or lexemes[i - 1].text.lower() == "the"
            if articled and _is_subject(lexemes[i + 1 : i + 3]):
                lexeme = replace(lexeme, role="part", words=named[place], part=True)
        out.append(lexeme)
    return out


def _is_subject(after: Sequence[Lexeme]) -> bool:
    """Whether what comes next says something of a word, and is no noun that it stands before."""
    says = bool(after) and after[0].role in ("is", "was", "of", "material")
    return says and not (after[0].role == "material" and any(x.part for x in after[1:]))


def first_phrase(lexemes: Sequence[Lexeme], stops: Collection[str]) -> Phrase:
    """Words of the first noun phrase, up to one that joins: "this is a can of ..." is "a can".

    What a participle says of the noun before it comes first: "a ball inflated with ...".
    """
    phrase, noun = list[str](), False
    for lexeme in lexemes:
        before = lexeme.role == "coat" and not noun  # "a painted drum"
        if lexeme.role in stops and not before:
            if phrase and phrase[-1] != "image":  # "an image of a chair"
                break
            phrase = []
        elif phrase and lexeme.dep == "acl":
            return (*lexeme.words, *phrase)
        else:
            phrase += lexeme.words
            noun = noun or lexeme.tag.startswith("NN")
    return tuple(phrase)


# Comparisons: "twice as stiff", "a bit softer", each one lexeme.

PLAIN_FACTOR = 2.0  # "stiffer", without a word for how much
_REACH = 6  # words before a comparative that may say how many times
_PERCENT = ("%", "percent")
_COUNTING = (
    *_PERCENT,
    "a",
    "an",
    "times",
    "x",
    "×",
    "of",
    "about",
    "roughly",
    "only",
    "at",
    "least",
    "as",
)


def join_comparisons(lexemes: Sequence[Lexeme]) -> list[Lexeme]:
    """Return the lexemes with every comparison as one: "twice as stiff", "a bit softer"."""
    out: list[Lexeme] = []
    for i, lexeme in enumerate(lexemes):
        found = words()["compared"].get(lexeme.text.lower())
        start = _comparison_start(out, lexeme, lexemes[i + 1 : i + 3]) if found else None
        if found is None or start is None:
            out.append(lexeme)
            continue
        measure, way = found
        sign = out[start].text.lower() if start < len(out) else ""
        unlike = sign == "as" and start and out[start - 1].role == "not"
        way = -way if sign == "less" or unlike else way
        factor, exact, start = _factor(out, start - 1 if unlike else start, way)
        if sign == "as" and not (unlike or exact):
            factor, exact = 1.0, True
        factor = 1 / factor if way < 0 and factor > 1 else factor
        began = out[start].start if start < len(out) else lexeme.start
        del out[start:]
        out.append(
            replace(
                lexeme, role="compare", start=began, value=Comparison(measure, factor, exact, ())
            )
        )
    return out


def _comparison_start(before: list[Lexeme], lexeme: Lexeme, after: Sequence[Lexeme]) -> int | None:
    """Index of the word that makes an adjective a comparison, or None where it is none."""
    last = before[-1].text.lower() if before else ""
    if last in ("more", "less"):
        return len(before) - 1
    if last == "as":
        times = len(before) > 1 and (
            before[-2].role == "factors" or before[-2].text.lower() in ("times", "x", "×")
        )
        return len(before) - 1 if times or any(x.role == "as" for x in after) else None
    return len(before) if lexeme.text.lower().endswith("er") else None


def _factor(before: list[Lexeme], start: int, way: int) -> tuple[float, bool, int]:
    """How many times, whether a number says so, and where the comparison starts."""
    factor, exact, first = PLAIN_FACTOR, False, start
    percent = start > 0 and before[start - 1].text.lower() in _PERCENT
    for i in range(start - 1, max(start - 1 - _REACH, -1), -1):
        lexeme = before[i]
        if lexeme.role in ("factors", "vague"):
            factor, exact, first = float(lexeme.value), lexeme.role == "factors", i
        elif lexeme.role == "digits":
            factor, exact, first = number(lexeme.text) or 1.0, True, i
            factor = max(1 + way * factor / 100, 0.01) if percent else factor
        elif lexeme.text.lower() not in _COUNTING:
            break
    return factor, exact, first


# Numbers without a word for what they are, told by their neighbours: hardness, grades.

_HARDNESS = re.compile(r"(?:hardness\W*(?:of )?)?([AD])?-?([1-9]\d)([AD])?")
_NUMBER = re.compile(r"(?!\d\.\d{4}$)\d[\d.]*")  # "1.4301" is a grade and nothing else
_YEAR = re.compile(r"(?:19|20)\d\d")
_CLASS = re.compile(r"\d\d?\.\d")  # of bolts: "8.8"
_RUBBERY = re.compile(r"(?i)\b(?:T?PU|TPE|polyurethane|urethane)\b")


def bare_numbers(lexemes: Sequence[Lexeme]) -> list[Lexeme]:
    """Take numbers without a word for what they are where their neighbours tell it.

    Two digits beside a rubber are its hardness, as lists of seals write it ("NBR 70", "rubber
    A-70"); what follows a modulus and lies below 0.5 is Poisson's ratio ("69 GPa / 0.33").
    """
    out: list[Lexeme] = []
    for i, lexeme in enumerate(lexemes):
        said, note = _HARDNESS.fullmatch(lexeme.text), ""
        near = lexemes[max(i - 3, 0) : i + 3]
        rubber = next((x for x in near if _is_rubbery(x)), None)
        bare = said is not None and not (said[1] or said[3] or "hardness" in lexeme.text)
        close = not bare or rubber in [x for x in lexemes[:i][-2:] if x.role != "hyphen"][-1:]
        if said and rubber and close and lexeme.role in ("digits", "word", "told", "material"):
            measure = "shore_d" if "D" in (said[1], said[3]) else "shore_a"
            note = f"{lexeme.text!r} beside {rubber.text!r} is taken as its Shore hardness"
            value = Quantity(measure, float(said[2]), lexeme.text)
        elif lexeme.role == "digits" and 0 < number(lexeme.text) < 0.5 and _after_modulus(out):
            note = f"{lexeme.text!r} after a modulus is taken as Poisson's ratio"
            value = Quantity("nu", number(lexeme.text), lexeme.text)
        out.append(replace(lexeme, role="number", value=value, note=note) if note else lexeme)
    return out


def lone_grades(lexemes: Sequence[Lexeme]) -> list[Lexeme]:
    """Take numbers for grades of a metal only where nothing says that they are another number.

    Where the metal stands beside them they are its grades; alone they are told as a guess. A year
    after "in", a number after "model" and a property class without a fastener are plain numbers.
    """
    out: list[Lexeme] = []
    for i, lexeme in enumerate(lexemes):
        if lexeme.role == "material" and _NUMBER.fullmatch(lexeme.text):
            metal, beside = lexeme.value, lexemes[max(i - 3, 0) : i + 4]
            last = lexemes[i - 1].text.lower() if i else ""
            if not _is_grade(lexeme, last, lexemes[i + 1 : i + 2], beside):
                note = f"{lexeme.text!r} after {last!r} is taken for no grade of a metal"
                told = last in (*words()["lone"]["labels"], *words()["lone"]["dates"])
                lexeme = replace(lexeme, role="digits", value=None, note=note if told else "")
            elif not _is_called(lexeme, lexemes[max(i - 2, 0) : i + 3]):
                note = f"{lexeme.text!r} without its metal is taken as a grade: {metal.name}"
                lexeme = replace(lexeme, note=note)
        out.append(lexeme)
    return out


def _is_grade(lexeme: Lexeme, last: str, after: Sequence[Lexeme], beside: Sequence[Lexeme]) -> bool:
    """Whether a number may be a grade, by the words before it and around it."""
    lone = words()["lone"]
    if last in lone["labels"]:
        return False
    if last in lone["dates"] and _YEAR.fullmatch(lexeme.text):
        return any(_is_metal(x) for x in after)
    fastener = any({*x.words} & {*lone["fasteners"]} for x in beside)
    return not _CLASS.fullmatch(lexeme.text) or fastener or _is_called(lexeme, beside)


def _is_called(lexeme: Lexeme, near: Sequence[Lexeme]) -> bool:
    """Whether a metal, or that it is a grade, is said beside a number."""
    lone = words()["lone"]
    says = {*lone["grades"]} | ({*lone["fasteners"]} if _CLASS.fullmatch(lexeme.text) else set())
    others = [x for x in near if x is not lexeme and not _NUMBER.fullmatch(x.text)]
    return any(_is_metal(x) or {x.text.lower(), *x.words} & says for x in others)


def _is_metal(lexeme: Lexeme) -> bool:
    row = lexeme.value if lexeme.role == "material" else None
    return isinstance(row, Material) and row.category == "metal"


def _is_rubbery(lexeme: Lexeme) -> bool:
    row = lexeme.value if lexeme.role == "material" else None
    named = isinstance(row, Material) and bool(_RUBBERY.search(row.name))
    return named or (isinstance(row, Material) and row.category == "elastomer")


def _after_modulus(before: Sequence[Lexeme]) -> bool:
    """Whether a modulus came last, with no more than a sign after it."""
    last = next((x for x in before[:-3:-1] if x.role == "number"), None)
    return last is not None and isinstance(last.value, Quantity) and last.value.measure == "E"


# What treatments and colours say of a matter: "galvanised" is steel, "painted silver" none.


def implied(run: Sequence[Lexeme], lexicon: ReaderLexicon) -> list[tuple[Lexeme, Material]]:
    """The metal that a treatment speaks of: "galvanised" is steel, until another is named."""
    rows = ((x, words()["implied"].get(x.text.lower())) for x in run if x.role == "coat")
    return [
        (replace(x, words=("metal",)), lexicon.table.exact(row))
        for x, row in rows
        if row in lexicon.table.phrases
    ][:1]


def puts_hue(lexeme: Lexeme, before: Sequence[object], after: Sequence[Lexeme]) -> bool:
    """Whether a participle puts the metal after it on the matter before: "wood painted silver"."""
    rows = [*before, *(x.value for x in after)]
    metals = [isinstance(row, Material) and row.category == "metal" for row in rows]
    matter = isinstance(next(iter(before), None), Material)
    return matter and lexeme.text.lower() in words()["hues"]["words"] and metals == [False, True]


def is_hue(after: Sequence[Lexeme]) -> bool:
    """Whether "light" is told of a colour: before another adjective, or a wood."""
    return any(
        x.value.category == "wood" if isinstance(x.value, Material) else x.tag == "JJ"
        for x in after
    )
