"""A text as lexemes: part names, materials, numbers and connectors, each one token.

What is no matter (loads, a misspelling, another language) is taken out or mended first; then every
span that may be a lexeme is sought, of overlapping ones the longest stays, and the English model
tags them all. What needs the lexemes around it (ranges of parts, words that point back,
comparisons, bare numbers) is a pass over the list.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import NamedTuple

from ...fem.note import Note
from ...fem.table import Material
from .clauses import Gloss, Place, over
from .english import Atom, Lexeme, Phrase, is_glue, words
from .languages import data, glossed
from .materials import (
    LONGEST_PHRASE,
    Meaning,
    ReaderLexicon,
    atoms,
    mended_spelling,
    named_materials,
)
from .numerals import NUMBERS, Blend, Comparison, Numeral, Quantity, counted_by, number, numerals
from .parts import as_written, part_name_words, part_words

# Of candidates over each other the longest is taken, then the one of the lowest rank.
_RANK = {"part": 0, "number": 1, "material": 2, "told": 2.5, "size": 2.5}
# What the model is shown for tokens that it cannot know, and for phrases that are one token here.
_PLAIN = {"material": "wood", "number": "12", "size": "12", "told": "12", "part": "part"}
_PHRASES = words()["shown"]
_AS_IT_IS = ("material", "number", "digits")  # what is the same in every language


@dataclass
class Lexed:
    """Lexemes of a text and what was mended on the way."""

    lexemes: list[Lexeme]
    notes: list[str]


def lex(text: str, lexicon: ReaderLexicon, names: Sequence[str], *, language: str = "") -> Lexed:
    """Cut a text, in a language that its words tell where none is given, into tagged lexemes."""
    known = {word for name in names for word in part_name_words(name)}
    text = rewritten(text)
    # What stands around a matter; "quenched and tempered" stays of the row that is called so
    ignored = [m for pattern in _IGNORED for m in pattern.finditer(text)]
    plain = atoms(text, lexicon.model, known) if ignored else []
    rows = named_materials(text, plain, lexicon, known, several=len(names) > 1) if plain else []
    rows = [x for x in rows if x.words in lexicon.rows]
    own = [m.span() for name in names for m in re.finditer(re.escape(name), text)]
    for m in ignored:
        if not any(a < m.end() and m.start() < b for a, b in own) and not any(
            x.start <= m.start() and m.end() <= x.end and x.text != m[0] for x in rows
        ):
            text = text[: m.start()] + " " * len(m[0]) + text[m.end() :]
    text = re.sub(r"\(\s*\)", lambda m: " " * len(m[0]), text)  # "modulus (ISO 527) 2000 MPa"
    text, loads = without_loads(text)
    cut = atoms(text, lexicon.model, known)
    gloss, notes, strange, mended = (
        glossed(cut, lexicon, known, language=language), [], set[int](), {},
    )  # fmt: skip
    if not gloss:
        english, notes, strange, mended = mended_spelling(text, cut, lexicon, known)
        if notes:  # no English
            gloss = glossed(cut, lexicon, known, foreign=True)
        cut = english
    if gloss:
        notes = [Note("lexing.read_as", language=gloss.language)]
        cut, strange, mended = gloss.atoms, gloss.unknown, {}
    if not cut:
        return Lexed([], [*loads, *notes])
    out: list[Lexeme] = []
    materials = named_materials(text, cut, lexicon, known, several=len(names) > 1)
    for atom in cut if gloss else ():  # "mantequilla" of a part that is called so
        row = lexicon.first_row([gloss.matter.get(atom.start, "")]) if gloss else None
        if row and atom.stem in known:
            own = (atom.stem,)
            materials.append(
                Lexeme(atom.text, atom.start, atom.end, "material", row, own, part=True, names=own)
            )
    coded = [x for x in materials if _CODED.fullmatch(x.text) and not _UNIT.match(text, x.end)]
    unnamed = text
    for x in coded:  # "PA66" is no pascal, and in "tank wall PE100 12 mm" of no number
        unnamed = unnamed[: x.start] + " " * len(x.text) + unnamed[x.end :]
    numbers = [
        n._replace(start=max([n.start, *(x.end for x in coded if n.start < x.start < n.end)]))
        for n in numerals(unnamed)
    ]
    candidates = _spans(text, cut, numbers, materials, lexicon, names, known)
    for lexeme in sorted(candidates, key=lambda x: (x.start - x.end, _RANK.get(x.role, 3))):
        if all(lexeme.end <= c.start or c.end <= lexeme.start for c in out):
            out.append(lexeme)
    # Put the words that no phrase took between the lexemes
    chosen = [*out]
    for i, atom in enumerate(cut):
        if any(c.start < atom.end and atom.start < c.end for c in chosen):
            continue
        named = atom.stem in known
        if atom.text.lower() == "a" and not (i and cut[i - 1].stem in known):
            # "a stool" of "leg_a", but "leg a is oak"
            after = cut[i + 1].text.lower() if i + 1 < len(cut) else ""
            joins = any(after in words()["roles"][role] for role in ("is", "of", "and"))
            named = named and not (after[:1].isalpha() and not joins)
        first = atom.text[0]
        role = "word" if first.isalpha() else "digits" if first.isdigit() else "sign"
        out.append(
            Lexeme(
                atom.text, atom.start, atom.end, role, words=(atom.stem,),
                known=atom.start not in strange, part=named,
            )
        )  # fmt: skip
    lexemes = spelt_out(sorted(out, key=lambda x: x.start), names)
    # Every material, number and odd name is a plain word to the model.
    shown = [
        _PLAIN.get(x.role, "")
        or (" " in x.text and _PHRASES.get(x.role))
        or (x.text.lower() if x.text.isupper() and len(x.text) > 1 else x.text.replace("\n", "."))
        for x in lexemes
    ]
    lexemes = [
        replace(
            x, tag=tag,
            note=x.note or next((n for at, n in mended.items() if x.start <= at < x.end), ""),
        )
        for x, tag in zip(lexemes, lexicon.model.tags(shown), strict=True)
    ]  # fmt: skip
    if gloss:  # a compound is told whole: "Stahlrohr", of which steel has the first half
        whole = list(re.finditer(r"[^\W\d_]+", text))
        for i, x in enumerate(lexemes):
            inside = (m[0] for m in whole if m.start() <= x.start and x.end <= m.end())
            if x.text == text[x.start : x.end] and (word := next(inside, "")):
                lexemes[i] = replace(x, text=word)
    return Lexed(lexemes, [*loads, *notes])


_REWRITES = [
    (re.compile(rule["find"]), rule["to"]) for rule in (*words()["rewrites"], *data()["rewrites"])
]


def in_english(text: str, lexed: Lexed) -> Gloss | None:
    """Return a text of another language word by word, None where it is English."""
    if not any(getattr(note, "kind", "") == "lexing.read_as" for note in lexed.notes):
        return None
    out, places, at = "", list[tuple[int, int, int, int]](), 0
    for x in lexed.lexemes:
        if x.start < at:
            continue
        out += text[at : x.start]
        here = text[x.start : x.end]
        matter = x.role == "material" and not any(c.isdigit() for c in here)
        word = here if x.role in _AS_IT_IS and not matter else " ".join(x.words) or x.text
        out += " " * (out[-1:].isalnum() and word[:1].isalnum())
        places.append((len(out), len(out) + len(word), x.start, x.end))
        out, at = out + word, x.end
    return Gloss(out + text[at:], tuple(places))


def rewritten(text: str) -> str:
    """The text with what stands for other words written by them, in as many letters."""

    def in_its_place(found: re.Match, to: str) -> str:
        new = found.expand(to)
        new = new.upper() if found[0].isupper() else new  # no small letters in what shouts
        return new.ljust(len(found[0]))[: len(found[0])]

    for pattern, to in _REWRITES:
        text = pattern.sub(partial(in_its_place, to=to), text)
    return text


# Loads that a text speaks of: its words set none, so that they are told with what does.

_LOADS = re.compile(words()["loads"]["pattern"], re.VERBOSE)
_CODED = re.compile(r"(?=.*\d)(?=.*[A-Za-z])[^%]{3,}")
_UNIT = re.compile(r" ?(?:[kMG]?Pa|psi|ksi|k?g/|N/)")
_IGNORED = [re.compile(rf"(?<![\w.])(?:{each})(?!\w)") for each in words()["ignored"]["patterns"]]
_LOAD_END = re.compile(r"[;\n]|[,.](?=\s|$)|\s(?=and\b|but\b|while\b|which\b)|$")


def without_loads(text: str) -> tuple[str, list[str]]:
    """The text with blanks for the words that tell loads, and a sentence for each load.

    What is told of one goes up to the next comma or stop.
    """
    loads, left, start = list[str](), text, 0
    for match in _LOADS.finditer(text):
        end = _LOAD_END.search(text, match.end())
        load = text[match.start() : end.start() if end else len(text)].strip()
        if not (loads and loads[-1].endswith(load)):
            loads.append(load)
            start = match.start()
        left = left[:start] + " " * (match.end() - start) + left[match.end() :]
    return left, [Note("lexing.load_text", load=load) for load in loads]


_CODE = re.compile(r"(?<![\w.])(?=[\w.-]*\d)(?=[\w.-]*[A-Za-z])[A-Za-z0-9][\w.+-]*\w")
_SMALL = ("word", "hyphen", "empty", "idle", "comma")  # what a code may hold
_PARTLY = re.compile(words()["codes"]["partly"])
_TIMES = re.compile(r"(?i)\d+x")
# Codes that say no matter: "M8", "3rd", "20x20x2", "IP65", "z24".
_HARMLESS = re.compile(words()["codes"]["harmless"])
_TEMPER = re.compile(r"-?(?:T[1-9]\d{0,4}|H\d{2,3}|O|F)")  # of a wrought alloy: "A356.0-T6"


def _spans(
    text: str,
    cut: list[Atom],
    numbers: list[Numeral],
    materials: list[Lexeme],
    lexicon: ReaderLexicon,
    names: Sequence[str],
    known: set[str],
) -> list[Lexeme]:
    """Every span that says something, also over each other."""
    found: list[Lexeme] = []
    # Part names as they are written in the asset: "SM_Leg.001", "hinge leaf" of hinge_leaf_1
    alone = {re.sub(r"[\s_-]+\d+$", "", name) for name in names}
    for name in sorted({*names, *alone}, key=len, reverse=True):
        if not re.search(r"[\W\d_]|[a-z][A-Z]", name.strip()):
            continue  # a plain word is read as one, with its plural
        each = [re.escape(word) for word in re.split(r"[\s_-]+", name)]
        if each[-1].isdigit():  # "board one" of board_1
            said = [word for word, n in NUMBERS.items() if n == int(each[-1])]
            each[-1] = f"(?:{'|'.join([each[-1], *said])})"
        written = r"(?:[\s_-]+|, ?)".join(each)
        stems = part_name_words(name)
        for m in re.finditer(rf"(?i)(?<!\w){written}(?!\w)", text):
            found.append(Lexeme(m[0], *m.span(), "part", name, stems, part=True))
    # Names with a wildcard, as files of robots have them: "arm_link*", "link.*"
    for m in re.finditer(r"(?<![\w*])(\w{2,}?)[._-]?\*", text):
        meant = [name for name in names if name.lower().startswith(m[1].lower())]
        if meant:
            found.append(
                Lexeme(m[0], *m.span(), "part", meant, part_name_words(meant[0]), part=True)
            )
    # Parts that share all but the last word of their name: "busbar L1/L2/L3"
    for m in re.finditer(r"(?<!\w)([A-Za-z]\w*)[ _](\w+(?:/\w+)+)(?!\w)", text):
        called = {f"{m[1]} {last}".lower() for last in m[2].split("/")}
        meant = [name for name in names if re.sub(r"[\s_-]+", " ", name).lower() in called]
        if len(meant) == len(called):
            found.append(
                Lexeme(m[0], *m.span(), "part", meant, part_name_words(meant[0]), part=True)
            )
    for n in numbers:
        last = next((a.stem for a in cut if a.end == n.end), "")
        if not n.value and last in known and counted_by(text[n.start : n.end].split()[0]):
            continue  # "the three feet are rubber"
        role = "number" if n.value else "told" if n.note else "size"
        found.append(Lexeme(text[n.start : n.end], n.start, n.end, role, n.value, note=n.note))
    found += materials
    # Phrases of the language, at every place the longest
    for i in range(len(cut)):
        sizes = range(min(LONGEST_PHRASE, len(cut) - i), 0, -1)
        candidates = (_connector(cut, i, size, text, lexicon, known) for size in sizes)
        best = next((lexeme for lexeme in candidates if lexeme), None)
        if best:
            part = best.end == cut[i].end and best.words[-1] in known
            found.append(replace(best, part=part, names=best.words[-1:] * part))
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
        code = text[start:end].lstrip("-+/")
        if over or _TIMES.fullmatch(code) or not re.search(r"[A-Za-z].*\d|\d.*[A-Za-z]", code):
            continue
        idle = bool(_HARMLESS.fullmatch(code))
        role, at = "idle" if idle else "word", end - len(code)
        out.append(Lexeme(code, at, end, role, words=(code.lower(),), known=idle))
    return found + out


def _connector(
    cut: list[Atom], i: int, size: int, text: str, lexicon: ReaderLexicon, known: set[str]
) -> Lexeme | None:
    run = cut[i : i + size]
    phrase = tuple(a.text.lower() for a in run if size == 1 or a.text != "-")
    meaning = lexicon.meanings.get(phrase)
    if size == 1:
        meaning = meaning or lexicon.meanings.get((run[0].stem,))
        glued = run[0].text in "-/" and is_glue(text, run[0])
        lists = glued and {a.stem for a in cut[i - 1 : i + 2]} <= {*known, "/"}  # "arms/legs"
        meaning, phrase = (
            Meaning("and" if lists else "hyphen") if glued else meaning,
            (run[0].stem,),
        )
    if not meaning or (size > 1 and run[-1].text == "-"):
        return None
    start, stop = run[0].start, run[-1].end
    partly = _PARTLY.search(text[:stop]) if meaning.role == "fill" else None
    note = Note("lexing.taken_full", partly=partly[0]) if partly else ""
    return Lexeme(text[start:stop], start, stop, meaning.role, meaning.value, phrase, note=note)


# Passes over the lexemes: ranges of parts, words that point to others.

_THROUGH = ("to", ".", "..", "...", "-", "–", "through", "until", "thru")


def spelt_out(lexemes: list[Lexeme], names: Sequence[str]) -> list[Lexeme]:
    """Put the parts of a range where it is said: "leg_1 to leg_4", "blade_1..3", "bodies 1-3"."""
    out: list[Lexeme] = []
    first: Lexeme | None = None  # a part or its number, and nothing but "to" or dots since
    for lexeme in lexemes:
        for name in lexeme.value[:-1] if isinstance(lexeme.value, list) else ():
            each = replace(lexeme, words=part_name_words(name), value=name)
            out += [each, replace(lexeme, role="and", words=(), part=False, value=None)]
        if isinstance(lexeme.value, list):
            last = lexeme.value[-1]
            lexeme = replace(lexeme, words=part_name_words(last), value=last)
        ends = lexeme.role == "part" or (lexeme.role == "digits" and lexeme.part)
        bare = ends and first is not None and lexeme.role == "digits"
        if bare and first is not None and first.role == "part":  # "rib_01..03"
            lexeme = replace(lexeme, role="part", words=(*first.words[:-1], *lexeme.words))
        if ends and first is not None and first.role == lexeme.role and out[-1] is not first:
            while out[-1] is not first:
                out.pop()
            both = replace(first, role="and", words=(), part=False)
            # The names between two that count on: the same words, with numbers between theirs
            stem, (low, high) = first.words[:-1], (first.words[-1], lexeme.words[-1])
            if stem == lexeme.words[:-1] and low.isdigit() and high.isdigit():
                numbered = {int(part_name_words(n)[-1]) for n in names if n[-1:].isdigit()}
                for n in sorted(n for n in numbered if int(low) < n < int(high)):
                    out += [both, replace(first, words=(*stem, str(n).zfill(len(low))))]
            out.append(both)
        if ends or (first is not None and lexeme.text.lower() not in _THROUGH):
            first = lexeme if ends else None
        out.append(lexeme)
    return out


def one_of(lexemes: Sequence[Lexeme]) -> list[Lexeme]:
    """Leave of materials between which the text does not decide the first, and tell it."""
    out: list[Lexeme] = []
    for lexeme, after in zip(lexemes, [*lexemes[1:], None], strict=False):
        either = [x.text.lower() for x in out[-1:]] in (["or"], ["and/or"])
        # "oak, or 9 GPa;", but no number of a matter behind it, and none of another part
        number = getattr(lexeme.value, "measure", "") in ("E", "rho")
        number = number and (after is None or after.role in ("stop", "comma", "close"))
        before = [
            x for x in out[:-1]
            if x.role not in ("open", "comma") and (number or not x.part)  # "ash legs (or oak)"
        ]  # fmt: skip
        first = before[-1] if either and before else None
        other = lexeme.role == "material" or number
        if first and first.role == "material" and other and first.value is not lexeme.value:
            note = Note("lexing.one_of", first=first.text, second=lexeme.text)
            out[out.index(first)] = replace(first, note=note)
            out.pop()
        else:
            out.append(lexeme)
    return out


# Roles of what may stand beside a name in brackets: "(Ti-6Al-4V, ASTM F136)".
_CALLING = "material word digits sign comma told size hyphen empty idle".split()


_ENDS = (None, "stop", "number", "told", "size", "digits", "comma", "close", "idle")


def finer(lexemes: Sequence[Lexeme], lexicon: ReaderLexicon) -> list[Lexeme]:
    """Leave out a kind of matter before what says which: "rubber foot NBR 70", "elastomer, NR"."""
    out, skip = list[Lexeme](), False
    for i, x in enumerate(lexemes):
        kind = lexicon.kinds.get(x.text.lower()) if x.role in ("material", "word") else None
        if skip or not kind or x.part:
            if not skip:
                out.append(x)
            skip = False
            continue
        j = next((k for k in range(i + 1, len(lexemes)) if not lexemes[k].part), len(lexemes))
        listed = j == i + 1 and j < len(lexemes) and lexemes[j].role == "comma"
        second, after = [*lexemes[j + listed : j + listed + 2], None, None][:2]
        says = second is not None and second.role == "material" and j + listed > i + 1
        same = says and second.value.category == kind and second.text.lower() not in lexicon.kinds
        if not same or (after.part or after.role not in _ENDS if after else False):
            out.append(x)
        skip = bool(same and listed and out[-1:] != [x])
    return out


def same_again(lexemes: Sequence[Lexeme], lexicon: ReaderLexicon) -> list[Lexeme]:
    """Join a matter and its name in brackets behind it: "titanium alloy (Ti-6Al-4V, ASTM F136)"."""
    out: list[Lexeme] = []
    at = 0
    while at < len(lexemes):
        out.append(lexemes[at])
        at += 1
        first = out[-1]
        end = next((k for k in range(at, len(lexemes)) if lexemes[k].role == "close"), at)
        inside = lexemes[at + 1 : end]
        if first.role != "material" or end == at or lexemes[at].role != "open":
            continue
        rows = [x for x in inside if x.role == "material"]
        others = any(x.part or x.role not in _CALLING for x in inside)
        if len(rows) == 1 and not others and not first.part:
            (second,) = rows
            mixed = any(isinstance(x.value, Blend) for x in out[-3:])  # "glass-filled PA (PA-GF30)"
            graded = second.value.grade and not first.value.grade and not mixed
            if graded or lexicon.repeats(first.value, first.words, second.value):
                out[-1] = replace(first, value=second.value)
            elif first.value.category != second.value.category:
                continue
            out[-1] = replace(out[-1], end=lexemes[end].end)
            at = end + 1
    return out


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
            after = lexemes[i + 1 : i + 3]  # says something of it, and is no noun that it precedes
            says = bool(after) and after[0].role in ("is", "was", "of", "material")
            noun = says and after[0].role == "material" and any(x.part for x in after[1:])
            if articled and says and not noun:
                lexeme = replace(lexeme, role="part", words=named[place], part=True)
        out.append(lexeme)
    return out


# Comparisons: "twice as stiff", "a bit softer", each one lexeme.

PLAIN_FACTOR = 2.0  # "stiffer", without a word for how much
_REACH = 6  # words before a comparative that may say how many times
_PERCENT = ("%", "percent")
_COUNTING = (*_PERCENT, *"a an times x × of about roughly only at least as".split())


def join_comparisons(lexemes: Sequence[Lexeme]) -> list[Lexeme]:
    """Return the lexemes with every comparison as one: "twice as stiff", "a bit softer"."""
    out: list[Lexeme] = []
    for i, lexeme in enumerate(lexemes):
        compared = words()["compared"].get(lexeme.text.lower())
        last = out[-1].text.lower() if out else ""
        start = None  # of the word that makes an adjective a comparison
        if last in ("more", "less"):
            start = len(out) - 1
        elif last == "as":
            times = len(out) > 1 and (
                out[-2].role == "factors" or out[-2].text.lower() in ("times", "x", "×")
            )
            if times or any(x.role == "as" for x in lexemes[i + 1 : i + 3]):
                start = len(out) - 1
        elif lexeme.text.lower().endswith("er"):
            start = len(out)
        if compared is None or start is None:
            out.append(lexeme)
            continue
        measure, way = compared
        sign = out[start].text.lower() if start < len(out) else ""
        unlike = sign == "as" and start and out[start - 1].role == "not"
        way = -way if sign == "less" or unlike else way
        # How many times, whether a number says so, and where the comparison starts
        end = start - 1 if unlike else start
        factor, exact, start = PLAIN_FACTOR, False, end
        percent = end > 0 and out[end - 1].text.lower() in _PERCENT
        for k in range(end - 1, max(end - 1 - _REACH, -1), -1):
            if out[k].role in ("factors", "vague"):
                factor, exact, start = float(out[k].value), out[k].role == "factors", k
            elif out[k].role == "digits":
                factor, exact, start = number(out[k].text) or 1.0, True, k
                factor = max(1 + way * factor / 100, 0.01) if percent else factor
            elif out[k].text.lower() not in _COUNTING:
                break
        if sign == "as" and not (unlike or exact):
            factor, exact = 1.0, True
        factor = 1 / factor if way < 0 and factor > 1 else factor
        began = out[start].start if start < len(out) else lexeme.start
        del out[start:]
        value = Comparison(measure, factor, exact, ())
        out.append(replace(lexeme, role="compare", start=began, value=value))
    return out


# Numbers without a word for what they are, told by their neighbours: hardness, grades.

_HARDNESS = re.compile(r"(?:hardness\W*(?:of )?)?([AD])?-?([1-9]\d)([AD])?")
_NUMBER = re.compile(r"(?!\d\.\d{4}$)\d[\d.]*")  # "1.4301" is a grade and nothing else
_YEAR = re.compile(r"(?:19|20)\d\d")
_CLASS = re.compile(r"\d\d?\.\d")  # of bolts: "8.8"
_RUBBERY = re.compile(r"(?i)\b(?:T?PU|TPE|polyurethane|urethane)\b")


def bare_numbers(lexemes: Sequence[Lexeme]) -> list[Lexeme]:
    """Take numbers without a word for what they are where their neighbours tell it.

    Two digits beside a rubber are its hardness, as lists of seals write it: "NBR 70", "rubber
    A-70".
    """
    out: list[Lexeme] = []
    for i, lexeme in enumerate(lexemes):
        shore, note = _HARDNESS.fullmatch(lexeme.text), ""
        rubbers = (
            x for x in lexemes[max(i - 3, 0) : i + 3]
            if x.role == "material" and isinstance(x.value, Material)
            and (x.value.category == "elastomer" or _RUBBERY.search(x.value.name))
        )  # fmt: skip
        rubber = next(rubbers, None)
        bare = shore is not None and not (shore[1] or shore[3] or "hardness" in lexeme.text)
        close = not bare or rubber in [x for x in lexemes[:i][-2:] if x.role != "hyphen"][-1:]
        if shore and rubber and close and lexeme.role in ("digits", "word", "told", "material"):
            measure = "shore_d" if "D" in (shore[1], shore[3]) else "shore_a"
            note = Note("lexing.beside_taken", text=lexeme.text, text_2=rubber.text)
            value = Quantity(measure, float(shore[2]), lexeme.text)
        out.append(replace(lexeme, role="number", value=value, note=note) if note else lexeme)
    return out


def lone_grades(lexemes: Sequence[Lexeme]) -> list[Lexeme]:
    """Take numbers for grades of a metal only where nothing says that they are another number.

    Where the metal stands beside them they are its grades; alone they are told as a guess. A year
    after "in", a number after "model" and a property class without a fastener are plain numbers.
    """
    out, lone = list[Lexeme](), words()["lone"]
    for i, lexeme in enumerate(lexemes):
        if lexeme.role == "material" and _NUMBER.fullmatch(lexeme.text):
            metal, beside = lexeme.value, lexemes[max(i - 3, 0) : i + 4]
            last = lexemes[i - 1].text.lower() if i else ""
            # Whether it may be a grade, by the words before it and around it
            if last in lone["labels"]:
                grade = False
            elif last in lone["dates"] and _YEAR.fullmatch(lexeme.text):
                grade = any(_is_metal(x) for x in lexemes[i + 1 : i + 2])
            else:
                fastener = any({*x.words} & {*lone["fasteners"]} for x in beside)
                grade = not _CLASS.fullmatch(lexeme.text) or fastener or _is_called(lexeme, beside)
            if not grade:
                note = Note("lexing.after_taken", text=lexeme.text, last=last)
                noted = note if last in (*lone["labels"], *lone["dates"]) else ""
                lexeme = replace(lexeme, role="digits", value=None, note=noted)
            elif not _is_called(lexeme, lexemes[max(i - 2, 0) : i + 3]):
                note = Note("lexing.without_metal", text=lexeme.text, name=metal.name)
                lexeme = replace(lexeme, note=note)
        out.append(lexeme)
    return out


def _is_called(lexeme: Lexeme, near: Sequence[Lexeme]) -> bool:
    """Whether a metal, or that it is a grade, is said beside a number."""
    lone = words()["lone"]
    says = {*lone["grades"]} | ({*lone["fasteners"]} if _CLASS.fullmatch(lexeme.text) else set())
    others = [x for x in near if x is not lexeme and not _NUMBER.fullmatch(x.text)]
    return any(_is_metal(x) or {x.text.lower(), *x.words} & says for x in others)


def _is_metal(lexeme: Lexeme) -> bool:
    row = lexeme.value if lexeme.role == "material" else None
    return isinstance(row, Material) and row.category == "metal"


# What treatments and colours say of a matter: "galvanised" is steel, "painted silver" none.


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


# Notations of engineers as sentences: tables, decks of solvers, numbers under a heading of units.
# "part;material;price" and its rows become "bush: bronze;", the cards of a deck "bush: E = 7.17e+10
# Pa, nu = 0.33, rho = 2810 kg/m3;". What is in no such notation stays as it is.

_FIGURE = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_DECIMAL = rf"(?:\d+,\d+|{_FIGURE})"
_PRESSURE = r"[kMG]?Pa|(?:k|da)?N/mm(?:\^?2|²)|k(?:gf|p)/[mc]m(?:\^?2|²)|[kM]?psi|[kM]si"
_DENSITY = r"[kM]?g/[cd]?m\^?[³3]|t/m?m\^?[³3]|g/cc|pcf|lbs?/(?:cu\.? ?)?(?:in|ft)\^?[³3]?"
_SPACED = r"\s{2,}"  # columns that are aligned
_WORDS = r"\s+(?![\[(])"  # columns of one word each but the last: "Part E [GPa] Material"
_SLASHED = r"\s/\s"
_VALUED = re.compile(r"[\s~≈<>]*[-\d.]")  # a cell that begins with a number
_COLUMN_UNIT = re.compile(
    r"(?i)(?<![a-z])([kmg]?pa|(?:k|da)?N/mm(?:\^?2|²)|[km]?psi|ksi|msi)(?![a-z])"
    r"|(?<![a-z])(k?g|t)[ /]?([cdm]?m)\^?[³3]|(?<![a-z])(lbs?)/(?:cu\.? ?)?(in|ft)\^?[³3]?"
    r"|(?<![a-z])pcf(?![a-z])"
)
_MEASURES = ("E", "nu", "rho")
_RULED, _EDGES = re.compile(r"[\s|:+-]*-[\s|:+-]*"), re.compile(r"^\s*\||\|\s*$")  # "|---|---|"
_ITEM = r"(?:pos(?:ition)?|item|no|nr|teil|rep(?:ère)?)\.? ?(\d+)"


def in_sentences(text: str, names: Sequence[str] = (), lexicon: ReaderLexicon | None = None) -> str:
    """Return a text whose tables and decks have become sentences, a row or a card each.

    A table begins with a line that names its columns, one of them of parts and another of what
    these are of; columns of prices, numbers and the like are left out. Of numbers the unit may
    stand in the name of their column. A row without such a line begins with one of the parts'
    ``names``. Lists by position want a ``lexicon``, which knows what is a matter.
    """
    known = {name.lower() for name in names}
    text = _SCATTER.sub("", text)
    if sum(bool(_DOTTED.search(line)) for line in text.splitlines()) > 1:
        text = _DOTTED.sub(" | ", text)
    text = _unabridged(_BRACKETED.sub(r" \1", _OBJECT.sub(_of_object, text)), names)
    text = _by_position(text, names, lexicon) if lexicon else text
    text = _under_units(_decks(_grouped(_with_positions(text, names)), names))
    lines = [line for line in text.splitlines() if not _RULED.fullmatch(line)]
    lines, out = [_EDGES.sub("", line) if "|" in line else line for line in lines], list[str]()
    while lines:
        head, *lines = lines
        for sign in (";", "\t", "|", ",", _SPACED, _WORDS, _SLASHED):
            columns = [_column(name) for name in _cells(head, sign)]
            valued = len({*columns} & {*_MEASURES}) > 1
            if "name" not in columns and valued and columns[0] in ("", "key", "matter"):
                columns[0] = "name"
            if "name" not in columns or len({*columns} - {""}) < 2:
                continue
            if sign == _WORDS and not (all(columns[1:]) and len(columns) > 3 and len(lines) > 1):
                continue
            rows = [_cells(line, sign, len(columns)) for line in lines]
            ends = (i for i, row in enumerate(rows) if len(row) < 2 or (
                columns[0] == "key" and not row[0].isalnum()
            ))  # fmt: skip
            count = next(ends, len(rows))
            keyed = valued and all(_is_key(row[0], lines[count:]) for row in rows[:count])
            units = [_COLUMN_UNIT.search(name.replace("_", " ")) for name in _cells(head, sign)]
            for row in rows[:count]:
                said = [
                    (column, f"{column} = {cell} {_unit(unit)}" if _VALUED.match(cell) else cell)
                    if column in _MEASURES else (column, cell)
                    for column, cell, unit in zip(columns, row, units, strict=False)
                    if column not in _MEASURES or any(c.isalnum() for c in cell)
                ]  # fmt: skip
                name = next((cell for column, cell in said if column == "name"), "")
                name = f"MAT_{row[0]}" if keyed else name
                matter = [cell for column, cell in said if column not in ("", "name", "key")]
                out.append(f"{name}: {', '.join(filter(str.strip, matter))};")
            lines = lines[count:]
            break
        else:
            cut = [_cells(head, sign) for sign in ";\t|" if "\n" in text]
            row = next((r for r in cut if len(r) > 1 and known & {r[0].lower()}), [])
            plain = row and not known & {cell.lower() for cell in row[1:]}
            out.append(f"{row[0]}: {', '.join(row[1:])};" if plain else head)
    return _referred(*_definitions("\n".join(out), names))


_SCATTER = re.compile(  # "69 ± 2 GPa"
    r"(?<=\d) ?(?:±|\+/-) ?(?:\d{1,3}(?: \d{3})+|\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?)(?:\s?%)?"
    r"(?![\d.,]*\d)"
)
_DOTTED = re.compile(r"(?<=\S) (?:\.{3,}|>>) (?=\S)")  # "bolt .... 29e6 .... 0.283"
# As programs write them: "160[GPa]", {"brace": {"E_GPa": 62, "rho": 1540}}
_BRACKETED = re.compile(rf"(?<=\d) ?\[({_PRESSURE}|{_DENSITY})\]")
_OBJECT = re.compile(r"\{?\s*\"([^\"{}]+)\"\s*:\s*\{([^{}]*\d[^{}]*)\}[,\s}]*")


def _of_object(m: re.Match) -> str:
    unquoted = re.sub(r"[\"']", "", m[2])
    valued = re.sub(rf"_({_PRESSURE})\s*:\s*({_FIGURE})", r" = \2 \1", unquoted)
    return f"{m[1]}: {re.sub(r'(?<=[a-zE]):', ' =', valued)};\n"


def _unabridged(text: str, names: Collection[str]) -> str:
    """The text with whole words for those that the parts' names shorten: "hsg steel"."""
    long = part_words()["abbreviated"]
    said = {word for name in names for word in as_written(name)}
    short = "|".join(sorted({*long} & said, key=len, reverse=True))
    if not short:
        return text
    return re.sub(rf"(?i)(?<![\w-])({short})(?![\w-])", lambda m: long[m[1].lower()], text)


def _with_positions(text: str, names: Collection[str]) -> str:
    """The text with parts in place of their numbers in a list: "cover same as pos 1"."""
    items: dict[str, str] = {}
    if not re.search(rf"(?i){_ITEM}", text):
        return text
    for name in sorted(names, key=len):  # the longest last: "casing cover" before "casing"
        spelt = r"[\s_-]".join(map(re.escape, re.split(r"[\s_-]+", name)))
        found = re.finditer(rf"(?i)(?<!\w){_ITEM}:? +{spelt}(?!\w)", text)
        items |= {m[1]: name for m in found}
    same = rf"(?i),?(?<!\w)(?: ?)(?<!\w)(as|like|wie|comme|como) ({_ITEM})(?!\w)"
    return re.sub(same, lambda m: f" {m[1]} {items.get(m[3], m[2])}", text)


# Lists by position: "in file order: walnut, brass, glass", "race, ball, cage -> 100Cr6, Si3N4, PA".

_ORDER = re.compile(words()["order"]["pattern"])
_SENTENCE = re.compile(
    r"[^\s;,.].*?(?=\n|;\s|(?<=\w{2}|.[)%\d])\.\s+[A-ZÄÖÜÉ]"
    r"|(?<=\w{5})\.\s+[a-z]|\.?\s*$)",
    re.MULTILINE,
)
_BEFORE_LIST = re.compile(
    r":(?=\s)|[-=]>|→|(?<=\s)=(?=\s)"
    r"|(?<=\s)(?:are|sind|sont|son)(?: made)?(?: of| from| in| aus| en| de)?(?=\s)"
)
_STATES = re.compile(r"(?<=\s)(?:is|are|ist|sind|est|sont|es|son)(?=\s)")
_COMMA = r",(?!\d)"
_SIGNS = (
    rf"{_COMMA}|(?<=\s)(?:and|und|et|y|then|dann|puis)(?=\s)", _COMMA, r"(?<=\s)/(?=\s)", r"\|"
)  # fmt: skip
_OF_THINGS = (*_SIGNS, "/")  # "shell/lid/base: 304, PA6, cork"
_WORDED, _LAST_NUMBER = re.compile(r"[^\W\d_]"), re.compile(r"\d+$")
_COUNTED = re.compile(
    r"(?<![\w.,])(\d\d?) ?(?:to|bis|à|al?|through|thru|-|–|\.\.+) ?(\d\d?)(?!\w|[.,]\w)"
    r"(?! ?(?:[µmck]?m|in|kg|g|[kMG]?Pa|%|°)(?!\w))"
)
_SIZE = 4  # letters of a number that may be a thickness: "1.52"
_LEAST = 3  # things of two lists that are taken for one where no order is told


def _by_position(text: str, names: Sequence[str], lexicon: ReaderLexicon) -> str:
    """The text with a sentence for each two things of lists that go on alike.

    The first list may be the file's parts, where the text says that it keeps an order.
    """
    plain = re.sub(r"\(\s*\)", _blank, _ORDER.sub(_blank, text))
    out, at, lexemes = "", 0, list[Lexeme]()
    for found in _SENTENCE.finditer(text):
        start, end = found.span()
        told = plain[start:end] != text[start:end]
        heads = [m.span() for m in _BEFORE_LIST.finditer(plain, start, end)] or [(start, start)]
        begins = [start, *(after for _, after in heads[:-1])]  # "from left: a, b = oak, pine"
        cuts = zip(begins, heads, strict=True)
        for (begin, (head, after)), sign, other in product(cuts, _OF_THINGS, _SIGNS):
            things, matters = _items(plain, begin, head, sign), _items(plain, after, end, other)
            listed = len(things) == len(matters) >= (2 if told else _LEAST)
            counted = None if listed else _COUNTED.search(plain, begin, head)  # "discs 1 to 4"
            if counted and int(counted[2]) - int(counted[1]) + 1 != len(matters):
                counted = None
            if len(matters) < 2 or not (told or listed or counted):
                continue
            if any(_STATES.search(plain, a, b) for a, b in (*things, *matters)):
                continue  # "the arms are oak, the cups are glass"
            lexemes = lexemes or lex(text, lexicon, names).lexemes
            spoken = {w for x in lexemes if begin <= x.start < head and x.part for w in x.words}
            kin = [n for n in names if any(w.isalpha() and w in spoken for w in part_name_words(n))]
            others = (x for x in lexemes if x.part and not start <= x.start < end)
            elsewhere = {w for x in others for w in x.words}
            free = [n for n in names if not {*filter(str.isalpha, part_name_words(n))} <= elsewhere]
            called = [text[a:b] for a, b in things] if listed else _of_number(
                len(matters), kin or (free if len(free) == len(matters) else names), counted
            )  # fmt: skip
            numbered = listed and not any(map(_WORDED.search, called[1:]))  # "rollers 1, 2 and 3"
            if numbered and (last := _LAST_NUMBER.search(called[0])):
                called = [called[0], *(called[0][: last.start()] + n for n in called[1:])]
            each = [[x for x in lexemes if over(item, (x.start, x.end))] for item in matters]
            named = any(
                x.part and x.role not in ("material", "digits") for own in each for x in own
            )
            strange = int(head > begin)  # where no list of parts stands before it, all are known
            stated = ["=" in text[a:b] for a, b in matters]
            mixed = any(stated) and not all(stated)  # "are S420ML, t=75" has one matter
            if called and not named and not mixed and _is_each(each, strange):
                ends = [_without_size(own, b) for own, (_, b) in zip(each, matters, strict=True)]
                said = (
                    f"{name}: {text[a:b]}"
                    for name, (a, _), b in zip(called, matters, ends, strict=True)
                )
                said_before = (x for x in lexemes if start <= x.start and x.end <= begin)
                before = any(x.role == "material" for x in said_before)
                kept = text[at : begin if before else start]
                out, at = f"{out}{kept}{' ' * before}{'; '.join(said)}", end
                break
    return out + text[at:]


def _is_each(spoken: Sequence[Sequence[Lexeme]], strange: int) -> bool:
    """Whether each item is a matter, ``strange`` of them unknown, or all are numbers of a kind."""
    roles = [{x.role for x in own} for own in spoken]
    matters = sum("material" in own for own in roles)
    if matters:
        return all({"material", "number"} & own != {"number"} for own in roles) and (
            matters >= len(roles) - strange
        )
    measures = [{x.value.measure for x in own if isinstance(x.value, Quantity)} for own in spoken]
    return len(measures[0]) == 1 and all(own == measures[0] for own in measures)


def _blank(found: re.Match) -> str:
    return " " * len(found[0])


def _items(text: str, start: int, end: int, sign: str) -> list[Place]:
    """Where the things of a list stand that a sign parts."""
    cut = [m.span() for m in re.compile(sign).finditer(text, start, end)]
    ends = zip([start, *(b for _, b in cut)], [*(a for a, _ in cut), end], strict=True)
    found = (re.compile(r"[^\s.,](?:.*[^\s.,])?").search(text, a, b) for a, b in ends)
    return [m.span() for m in found if m]


def _without_size(item: Sequence[Lexeme], end: int) -> int:
    """Where the matter of an item ends, before its thickness: "glass 6", but "NBR 70"."""
    if [x.role for x in item] != ["material", "digits"] or len(item[1].text) > _SIZE:
        return end
    return end if item[0].value.category == "elastomer" else item[0].end


def _of_number(count: int, names: Sequence[str], counted: re.Match | None) -> list[str]:
    """The parts that have the numbers that are ``counted``.

    Or all, if so many, or else those of the only name that so many have.
    """
    wanted = range(int(counted[1]), int(counted[2]) + 1) if counted else range(count)
    if len(wanted) != count:
        return []
    for at in (0, -1) if counted else ():
        digits = {name: re.findall(r"\d+", name) for name in names}
        own = [[n for n, d in digits.items() if d and int(d[at]) == k] for k in wanted]
        if all(len(each) == 1 for each in own):
            return [each[0] for each in own]
    if len(names) == count:
        return [*names]
    kinds: dict[Phrase, list[str]] = {}
    for name in names:
        kinds.setdefault(tuple(w for w in part_name_words(name) if w.isalpha()), []).append(name)
    found = [own for own in kinds.values() if len(own) == count]
    return found[0] if len(found) == 1 else []


def _unit(found: re.Match | None) -> str:
    """A unit as it is written behind a number: "kgm3" is kg/m3."""
    if found is None:
        return ""
    if found[4]:
        return f"lb/{found[5]}3"
    return found[1] or (f"{found[2]}/{found[3]}3" if found[2] else "pcf")


def _column(name: str) -> str:
    """What a column of this name holds, "" where that is no matter."""
    bare = re.sub(r"[\[(].*|_(?=[A-Za-z]*/?[a-z]*\d?$).*", "", name).strip(" .:/").lower()
    unit = _COLUMN_UNIT.search(name.replace("_", " "))
    if unit and not (rest := bare.replace(unit[0].lower(), "").strip(" .:,/")):
        return "E" if unit[1] else "rho"
    kinds = words()["columns"].items()
    return next((kind for kind, names in kinds if {bare, unit and rest} & {*names}), "")


def _cells(line: str, sign: str, most: int = 0) -> Sequence[str]:
    if sign in (_SPACED, _WORDS, _SLASHED):
        most = max(most - 1, 0) if sign == _WORDS else 0
        return [cell.strip() for cell in re.split(sign, line.strip(), maxsplit=most)]
    return [cell.strip(' "') for cell in next(csv.reader([line], delimiter=sign), [])]


# Numbers whose units stand once, before them: "mat card (GPa / kg/m3): pin 210 / 7850; tray ...".

_CALLED_E = r"(?i:e[- ]?mod\w*|(?:young\S* )?modul\w*|m[oó]dulos?|E)"
_CALLED_RHO = r"(?:(?i:rho|dens\w*|dicht\w*|masse vol\w*)\.?|ρ|w)"
_LABEL = re.compile(
    rf"(?<![\w.])(?<!\d )(?:(?:{_CALLED_E}[, ]*(?:in )?)?[(\[]?(?P<E>{_PRESSURE})[)\]]?"
    rf"|(?:{_CALLED_RHO}[, ]*(?:in )?)?[(\[]?(?P<rho>{_DENSITY})[)\]]?"
    r"|(?P<nu>nu|ν|(?i:poisson\w*)))(?!\w)"
)
_ANNOUNCED = re.compile(
    rf"(?:{_CALLED_E}|{_CALLED_RHO})\W|[(\[]|(?<=[Uu]nits are )|(?<=[Uu]nits: )"
)
_AND = r"(?:\s*[/;|]\s*|\s*,\s+|\s+(?:and|und|et|y)\s+)"
_VALUE = rf"(\d{{2,3}}(?: \d{{3}})+(?![\d,])|{_DECIMAL}(?<!\.))"
_HEADED = re.compile(r"[)\]]?(?:[^\d:;,.\n]*:|\.?\s)")
_IN_A_ROW = re.compile(r"(?<!units)(?:[;|/,\t]|\s{2})\s*$")  # before a column's name


def _under_units(text: str) -> str:
    """The text with the units of a heading behind its numbers, two or three of them together."""
    heads = list[list[re.Match]]()
    for m in _LABEL.finditer(text):
        gap = text[heads[-1][-1].end() : m.start()] if heads else "-"
        if re.fullmatch(rf"{_AND}[(\[]?", gap):
            heads[-1].append(m)
        else:
            heads.append([m])
    heads = [
        own for own in heads
        if (_ANNOUNCED.match(text, own[0].start()) or text[own[-1].end() :].startswith(":"))
        and len({m.lastgroup for m in own}) == len(own) > 1
        and not _IN_A_ROW.search(text[: own[0].start()])
        and _HEADED.match(text, own[-1].end())
    ]  # fmt: skip
    end = len(text)
    for own in reversed(heads):
        if not _ANNOUNCED.match(text, own[0].start()):  # of its sentence alone
            stop = re.compile(r"\n|\.\s").search(text, own[-1].end(), end)
            end = stop.start() if stop else end
        values = re.sub(
            rf"(?<![\w.,-]){_AND.join([_VALUE] * len(own))}(?![\w%]|[.,-]\d| ?(?:[mc]m|%))",
            lambda m, own=own: ", ".join(
                f"{label.lastgroup} = {n} {label['E'] or label['rho'] or ''}".strip()
                for n, label in zip(m.groups(), own, strict=True)
            ),
            text[own[-1].end() : end],
        )
        text, end = text[: own[0].start()] + values + text[end:], own[0].start()
    return text


# Numbers beside each other, of which one says its unit or name: "68.9 GPa / 0.33 / 2.70".

_BETWEEN = (
    r"(?:\s*[/|&]\s*|\s*[,;]\s+|\s+and\s+|\s*\(\s*"
    rf"|\s+(?=0?\.\d|{_FIGURE}\s?(?:{_DENSITY})(?!\w)))"
)
_SAID_E, _SAID_RHO = r"(?<!\w)E\s?[=:]?\s?", r"(?<!\w)(?:rho|ρ|density)\s?[=:]?\s?"
_NAMED = r"(?:nu|ν|v|pr|poisson\w*|rho|ρ|density)\s?[=:]?\s?"
_LABELLED = (
    rf"(?:{_NAMED})?{_DECIMAL}(?:\s?(?:{_DENSITY})(?!\w)"
    r"|(?![\w%°×€\"”µ-]|[.,]\d|\s?(?:[^\W\d_]|[°%±×€\"”-])))"
)
_GROUP = re.compile(
    rf"(?<![\w.,])(?P<E>{_FIGURE}\s?(?P<unit>{_PRESSURE}))(?P<rest>(?:{_BETWEEN}{_LABELLED}){{1,2}})"
)
_OF_GROUP = re.compile(rf"({_BETWEEN})({_NAMED})?({_DECIMAL})(\s?(?:{_DENSITY})(?!\w))?")
_NO_MODULUS = re.compile(r"(?i)(?:strength|stress|yield|tensile|load|\b(?:uts|rm|re|rp0[.,]2))\W*$")
_POINT = re.compile(r"(?<=\d)\.10\^(-?\d+)")  # "2,05.10^5"
_PER_CUBE = re.compile(
    r"(?i)(?<=\d) ?kg (?:le|par|por|el|pro|je|per|the) (?:m3|m³|cubic met\w+)(?!\w)"
)
_BARE_RHO = re.compile(  # "205 GPa, 7850"; neither 0.33 nor a grade such as 7075
    r"(?<=GPa)([,/ ]{1,3})((?!7050)\d{2}[05]0|[12]?\d(?<!0)\.\d{1,2})(?=\s*(?:[;|\n)]|\.(?!\d)|$))"
)
_BARE_E = re.compile(
    rf"(?<![\w.])([Ee]\s?[=:]?\s?)({_FIGURE})(?=\s*[,;/ ]\s*(?:nu|ν|v|pr)\s?[=:]?\s?0?\.\d)"
)
_SHEAR = re.compile(
    rf"(?<![\w.])(?:G|(?i:shear modulus))\s?[=:]?\s?({_FIGURE})\s?({_PRESSURE})"
    rf"(?=[,;/ ]+(?:nu|ν|v|(?i:poisson\S*))\s?[=:]?\s?({_FIGURE}))"
)
_IN_A_SYSTEM = re.compile(
    rf"(?<![\w.,])(?:E ?[=:]? ?)?(?P<E>{_FIGURE})\s?[/,;]\s?(?:nu ?[=:]? ?)?(?P<nu>0?\.\d+)"
    r"\s?[/,;]\s?(?:rho ?[=:]? ?)?(?P<rho>\d[\d.]*[eE]-\d+)(?: \(t/mm3\))?(?![\w.])"
    rf"|(?i:\bro)[\s=]+(?P<rho_2>{_FIGURE})[,\s]+[eE][\s=]+(?P<E_2>{_FIGURE})"
    rf"[,\s]+(?i:pr)[\s=]+(?P<nu_2>{_FIGURE})"
)
_STIFF = 600  # GPa: more has no number without a unit
_HEAVY = re.compile(rf"[^;\n]*?{_SAID_RHO}({_FIGURE})(?!\s?[a-zA-Z])")
_UNITS_BEHIND = re.compile(
    rf"{_SAID_E}({_FIGURE})(?!\w)([^()\n;]*?{_SAID_RHO}{_FIGURE})"
    rf"\s*[(\[]({_PRESSURE})\s*[,/;]\s*({_DENSITY})[)\]]"
)


def _grouped(text: str) -> str:
    """The text with what numbers beside an E are; an E of G and nu, E = 2 G (1 + nu), for the G."""

    def named(m: re.Match) -> str:
        if _NO_MODULUS.search(text[: m.start()]):
            return m[0]
        out, imperial = m["E"], m["unit"].endswith("si")
        nu = False  # Poisson's ratio is said
        inside = text[: m.start()].endswith("(") and text[m.end() : m.end() + 1] == ")"
        for sign, name, figure, unit in _OF_GROUP.findall(m["rest"]):
            value, label = float(figure.replace(",", ".")), name
            tabled = nu or {"/", "|", "and"} & {sign.strip()} or inside
            if name or unit:
                nu |= name[:1] in ("n", "ν", "v", "p")
            elif 0 < value < 0.5 and not (imperial and nu):
                nu, label = True, "nu = "
            elif imperial and value < 1:
                label, unit = "rho = ", " lb/in3"
            elif 0.5 <= value < 23 and ("." in figure or "," in figure) and tabled:
                label, unit = "rho = ", " g/cm3"
            elif (10 if nu and tabled else 400) <= value < 23e3 and tabled:
                label, unit = "rho = ", " kg/m3"
            parted = label != name or "/" in sign  # "0.32 / 1.75" may be a range
            out += f"{', ' if parted else sign}{label}{figure}{unit}"
        return out

    def in_units(m: re.Match) -> str:
        E, nu, rho = (float(m[name] or m[f"{name}_2"]) for name in ("E", "nu", "rho"))
        system = _system_of(rho)
        if system is None or not 0 < nu < 0.5:
            return m[0]
        return f"E = {E * system[1]:.10g} Pa, nu = {nu:g}, rho = {rho * system[2]:.10g} kg/m3"

    def of_shear(m: re.Match) -> str:
        before = re.split(r"[;\n]|\.\s", text[: m.start()])[-1]
        after = re.split(r"[;\n]|\.\s", text[m.end() :])[0]
        if re.search(rf"{_SAID_E}{_FIGURE}", f"{before} {after}"):
            return m[0]  # both are said
        return f"E = {2 * float(m[1]) * (1 + float(m[3])):.6g} {m[2]}"

    def in_its_unit(m: re.Match) -> str:  # "E = 71.7, nu = .33", "E 210000 nu 0.3 rho 7.85"
        E, beside = float(m[2]), _HEAVY.match(text, m.end())
        metal = beside is not None and (7.0 <= float(beside[1]) <= 23 or float(beside[1]) > 2500)
        return m[0] + (" GPa" if 0.5 <= E <= _STIFF else " MPa" if metal and 1e4 < E < 1e6 else "")

    text = _UNITS_BEHIND.sub(r"E = \1 \3\2 \4", text)
    text = _SHEAR.sub(of_shear, text)
    text = _IN_A_SYSTEM.sub(in_units, text)
    if not re.search(rf"(?<!\w)(?:{_PRESSURE})(?!\w)", text) and not _UNITS.search(text):
        text = _BARE_E.sub(in_its_unit, text)
    text = _POINT.sub(r"e\1", _PER_CUBE.sub(" kg/m3", text))
    if re.search(rf"(?<!\w)(?:{_DENSITY})|(?i:dens)", text):  # it speaks of densities
        text = _BARE_RHO.sub(lambda m: m[0] + (" g/cm3" if "." in m[2] else " kg/m3"), text)
    return _GROUP.sub(named, text)


# Decks: what a solver's cards say of E, nu and the density, in the units that the density tells.


class _Card(NamedTuple):
    """Numbers of a material in a deck, with its number or name there, and the number beside it."""

    key: str
    numbers: dict[str, float]
    number: str = ""


# A density tells the units of a deck: Pa, kg/m3 and then of an E and of a density.
_SYSTEMS = (
    ((1e-12, 3e-8), 1e6, 1e12),  # mm, t, s, MPa
    ((3e-8, 3e-5), 1e9, 1e9),  # mm, kg, ms, GPa; in MPa where that is more than there is
    ((3e-5, 3e-3), 6894.757, 10686895.0),  # in, lbf s2/in, s, psi
    ((1.0, 3e4), 1.0, 1.0),  # SI
)
_KIP = re.compile(r"(?i)\bkips?[-, /]+(?:in|inch)|\bunits?\b[^\n]*\bkips?\b")
_KIPS = (0.0, 0.0), 6894757.0, 1.0686895e10  # kip, in, s
_SOFTEST, _STIFFEST = 500.0, 2e12  # Pa
_COMMENT = re.compile(r"^\s*(?:\*\*|\$|!|#|//|C )\s*(.*)$")
_MAT1 = r"MAT1\*?[,\s]\s*\d+\s*[,\s][-+.,\s\d]"
_NASTRAN = re.compile(rf"(?i)^{_MAT1}")
_OF_A_MEASURE = re.compile(r"(?i)young|modul|poisson|densit|\b(?:E|EX|nu|rho|[MG]?Pa|kg/m)\b")
_REMARK = re.compile(r"(?im)^(MAT1\b[^$!\n]*|MP,\w+,\s*(\d+)[^$!\n]*)[$!]+(.*)$")
_BEGUN = re.compile(rf"(?im)^(?:\*MAT|MP,|\w+\s*=\s*DEFI_MATERIAU|{_MAT1})")
_ANSYS = re.compile(rf"(?i)^MP,\s*(EX|PRXY|NUXY|DENS),\s*(\d+),\s*({_FIGURE})")
_LS_DYNA = re.compile(r"(?i)^\*MAT_(?!ADD)\w+")
_ABAQUS = re.compile(r"(?i)^\*MATERIAL\b.*?NAME\s*=\s*[\"']?([^\"',]+)")
# Who has a material: "*SOLID SECTION, ELSET=RIB, MATERIAL=ALU"; a part's name, its own number, its
# section's and its material's
_SECTION = re.compile(
    r"(?im)^\*\w+ SECTION\b(?=.*ELSET ?= ?([^,\n]+))(?=.*MATERIAL ?= ?([^,\n]+)).*$"
    r"|^\*PART\b.*\n(?:\$.*\n)*(.+)\n(?:\$.*\n)*\s*\d+[,\s]+\d+[,\s]+(\d+).*$"
    r"|^P(?:SOLID|SHELL),\s*\d+,\s*(\d+)[^$\n]*\$+\s*(.+)$"
)
_PROSE = re.compile(r"[a-z]{2}|(?:[^\W\d_]{2,}\W+){2}[^\W\d_]{2}")  # no card is so
_IN_DECK = re.compile(rf"(?i)\*|MAT\d|MP,|\w+\s*=\s*DEFI_MATERIAU|{_FIGURE}[,\s]*[-=]>")
_KEYWORD = re.compile(r"(?i)^\*(ELASTIC|DENSITY)\b")
_ASTER = re.compile(r"(?i)^(\w+)\s*=\s*DEFI_MATERIAU\s*\((.*)\)")
_GIVEN = re.compile(rf"(?i)\b(E|NU|RHO)\s*=\s*({_FIGURE})")
_CALLED = re.compile(
    r"(?i)(?:\bmat(?:erial)?\s*|(?<![\w.]))(\d+)\s*=\s*([^,;=.]+)|([^,;=]+?)\s*=\s*mat(?:erial)?\s*(\d+)"
)
_UNITS = re.compile(
    r"(?i)\b(?:N[-, /]+mm[-, /]+t(?:on(?:ne)?s?)?|t(?:on(?:ne)?s?)?[-, /]+mm[-, /]+[Ns]"
    r"|mm[-, /]+(?:t(?:on(?:ne)?s?)?|N)[-, /]+(?:s|t|MPa|N))\b"
)


_SILENT = re.compile(
    rf"{_CALLED.pattern}|{_UNITS.pattern[4:]}|\bunits?\b|\bro,?\s+e\b|\bin[-, ]+lbf|^MKS$"
    r"|\bkg[-, ]+mm",
    re.IGNORECASE,
)


def _system_of(rho: float) -> tuple[tuple[float, float], float, float] | None:
    """The system of units in which a density may be such a number."""
    return next((s for s in _SYSTEMS if s[0][0] <= rho < s[0][1]), None)


_SHARED_OUT = re.compile(r"\s/\s|[;,]\s|^[\w ]{3,20}:\s")  # "use: frame -> S355 / plate -> AW6082"


def _decks(text: str, names: Collection[str]) -> str:
    """The text with a sentence in place of each material's cards; bare numbers in their units."""
    text = _CONTINUED.sub(lambda m: f"{m[1]} " if m[1] else "\n", _LISTED.sub(_as_cards, text))
    text = _OPENSEES.sub(r"\nMAT1,\1,\2,,\3,\4 $\5\n", _ELEMENT.sub(_of_element, text))
    text = _OF_KEYWORD.sub("\n", _KEYWORDS.sub("\n", text))
    text = re.sub(r"(?im)^MPDATA,(\w+),(\w+),\d*,", r"MP,\1,\2,", text)
    if not _BEGUN.search(text):
        return _in_units(text)
    text = _REMARK.sub(_before_its_card, text)
    parts = {word for name in names for word in part_name_words(name)}
    called = dict[str, list[str]]()
    for m in _SECTION.finditer(text):
        name = (m[1] or m[3] or m[6]).strip()
        if not m[6] or not parts.isdisjoint(part_name_words(name)):
            called.setdefault(m[2] or m[4] or m[5], []).append(name)
    lines = _SECTION.sub("", text).splitlines()
    cards = [*_cards(lines)]
    comments = [
        piece for found in map(_COMMENT.match, lines) if found
        for piece in (_SHARED_OUT.split(found[1]) if found[1].count("->") > 1 else [found[1]])
    ]  # fmt: skip
    for m in (m for comment in comments for m in _CALLED.finditer(comment)):
        called.setdefault(m[1] or m[4], []).append((m[2] or m[3]).strip().replace(" + ", " and "))
    keys = {card.key for card in cards}
    told = (
        one for comment in comments
        for one in re.split(r"(?:(?<=\w{4})|(?<=\)))\.\s+", comment.strip())
    )  # fmt: skip
    said = [f"{one};" for one in told if one and not _SILENT.search(one) and one not in keys]
    low = {key.lower() for key in keys}
    said += [
        line for line in map(str.strip, lines)
        if _PROSE.search(line) and not _IN_DECK.match(line) and not _COMMENT.match(line)
        and line.lower() not in low
    ]  # fmt: skip
    out, defined = list[str](), dict[str, str]()
    stated = _KIPS if _KIP.search(text) else None
    for key, numbers, number_of in cards:
        system = stated or _system_of(numbers.get("rho", 0))
        if system is None and "E" in numbers:
            system = (0, 0), 1.0 if numbers["E"] > 1e8 else 1e6 if _UNITS.search(text) else 0.0, 0.0
        E = numbers.get("E", 0.0) * system[1] if system else 0.0
        E = E / 1e3 if E > _STIFFEST else E
        values = [f"E = {E:.10g} Pa"] * ("E" in numbers)
        values += [f"nu = {value:.10g}" for name, value in numbers.items() if name == "nu"]
        if "rho" in numbers and system:
            values.append(f"rho = {numbers['rho'] * system[2]:.10g} kg/m3")
        if system is None or 0 < E < _SOFTEST:  # in units that nobody can tell
            values = [f"{measure} = {value:.10g}" for measure, value in numbers.items()]
        if not numbers:
            continue
        named = dict.fromkeys(one for by in (key, number_of) for one in called.get(by, ()))
        if named or not any(_is_key(one, said) for one in (key, number_of) if one):
            named = named or {key: None}
            out += [f"{name}: {', '.join(values)};" for name in named]
        else:
            defined |= dict.fromkeys(filter(None, (key, number_of)), ", ".join(values))
            out += [f"{key}: {', '.join(values)};"] * (not parts.isdisjoint(part_name_words(key)))
    return "\n".join([*out, _referred("\n".join(said), defined)])


# Materials that a text defines and gives to parts by their numbers or names: "M1: E = 210 GPa;
# bucket M1", "base plate is mid 2", "shell -> 1".

_LIBRARY = (
    r"(?i:mid|mat(?:erial)?|card|karte|werkstoff|matière|mat[ée]riau|material id)(?: (?:no|nr)\.?)?"
)
_DEFINED = re.compile(
    rf"(?:\*MAT_\w+ )?(?<![\w-])(?:{_LIBRARY} ?#?(?=\d|[A-F]\b)|M(?=\d)|MAT_|#(?=\d)"
    r"|(?=[A-Z1-9]\)|[A-Z] ?= ?E\W))(?P<key>\w{1,8})"
    r" ?(?:[:=)]|(?<=#\d)) ?(?P<said>(?=[\w(])(?:[^;\n.(→]|\([^)]*\)|\.(?=\d|\w))+?)"
    rf" ?(?:;|\.(?=\s|$)|\n|$|\s/\s|,(?= {_LIBRARY} ?#?\w{{1,8}} ?[:=])|(?=\s[A-Z1-9]\)\s)"
    r"|(?P<arrow>--?>|=>|→))"
    # "white parts are PLA, the black ones PETG"
    r"|(?<![\w-])(?i:(?:(?:all|the) )*)(?P<sort>\w+) (?:parts|ones|pieces|bodies|components)"
    r" (?:(?:is|are|in|of|made|from) )*(?P<of>[^,;.:\n]+?)"
    r"(?:[,;.\n]|(?= and (?:the )?\w+ ones))"
)
_VERBS = re.compile(
    r"(?i)^(?:(?:is|are|goes|go|for|on|takes?|uses?|the|to|gets?)\b|=|->|:|\s)+"
    r"|(?:\b(?:is|are|use|uses|using|take|takes|gets?|goes|as|made of|from|of)\b|[-=]>|[=:→]|\s)+$"
)


def _definitions(text: str, names: Collection[str]) -> tuple[str, dict[str, str]]:
    """A text without the materials that it defines and gives to parts, and these by their keys."""
    called = {word for name in names for word in part_name_words(name)}
    keys, rest, at = dict[str, str](), "", 0
    for m in _DEFINED.finditer(text):
        key, said = m["key"] or m["sort"], m["said"] or m["of"]
        if m["sort"] and not _is_key(key, [text[m.end() :]]):
            continue
        is_part = {"mat", "material", f"m{key.lower()}"} & called
        of_part = not called.isdisjoint(re.findall(r"\w+", said.lower()))
        if key in keys or is_part or (of_part and not (m["sort"] or re.search(r"\d", said))):
            return text, {}
        keys[key] = said.strip()
        # "card 1: E = 210 GPa -> both rails" defines, and gives to these
        gives = m["arrow"] and not re.match(r"[^,;.\n]*[=:]", text[m.end() :])
        rest += text[at : m.start()].rstrip("/ ") + f" mat {key} ->" * bool(gives)
        at = m.end()
    rest += text[at:]
    if len(keys) < 2 or not all(_is_key(k, [rest]) for k in keys):
        return text, {}
    return rest, keys


class _Keyed(NamedTuple):
    """Parts, the key of their material, if a sign said that it is one, and if it stands first."""

    parts: str
    key: str
    signed: bool
    first: bool


def _keyed(chunk: str, keys: Collection[str], *, signed: bool) -> _Keyed | None:
    """What a chunk of a sentence says by a key at its end or beginning.

    A number alone is a key where a ``signed`` one stood before it: "shell -> 1, lid 2".
    """
    spelt = (r"[ _-]".join(map(re.escape, re.split(r"[ _-]", key))) for key in keys)
    named = "|".join(sorted(spelt, key=len, reverse=True))
    sign = (
        rf"(?P<sign>(?:\b(?:{_LIBRARY}|PID) ?#?|\bM(?=\d)|\bMAT_|#"
        r"|(?:->|→|[=:]|\btakes?|\buses?) ?))"
    )
    chunk = re.sub(r"\s*\((?!M\d|MAT|mat|mid)[^()]*\)$|,? (?:too|also|as well)$", "", chunk)
    found = re.search(rf"(?i)(?:{sign}|(?<![\w.]))(?P<key>{named})\)?$", chunk)
    bare = found is not None and re.fullmatch(r"\d+|\w", found["key"])
    if bare and not (found["sign"] or signed):
        found = None
    found = found or re.search(
        rf"(?i)^{sign}?(?P<key>{named})"
        r"(?= (?:goes|is|are|for|on)\b| ?(?:=|->|:)|(?<=\d) [^\W\d])",
        chunk,
    )
    if found is None:
        return None
    parts = f"{chunk[: found.start()].rstrip('(')} {chunk[found.end() :]}"
    parts = _VERBS.sub("", _VERBS.sub("", parts.strip()))
    first = not chunk[: found.start()].strip()
    return _Keyed(parts, _spelt(found["key"]), bool(found["sign"]), first) if parts else None


def _spelt(key: str) -> str:
    return re.sub(r"[ _-]", " ", key).lower()


def _chunks(text: str, keys: Collection[str]) -> Iterator[list[str]]:
    """What the sentences of a text say one after another, split behind a key too."""
    named = "|".join(map(re.escape, keys))
    for sentence in re.split(r"(?<=[;.\n])\s+|\n", text):
        parted = re.sub(rf"(?i)(?<=\w )((?:M|MAT_|{_LIBRARY} )(?:{named})) and ", r"\1, ", sentence)
        cut = re.split(r"[;,.](?=\s|$)(?![^()]*\))", parted)
        yield [c.strip() for c in cut if c.strip()]


def _is_key(key: str, said: Sequence[str]) -> bool:
    """Whether a text gives a material to parts by its key."""
    chunks = (chunk for line in said for own in _chunks(line, [key]) for chunk in own)
    return any(_keyed(chunk, [key], signed=True) for chunk in chunks)


def _referred(text: str, defined: Mapping[str, str]) -> str:
    """The text with what its materials are in place of their keys."""
    if not defined:
        return text
    by_key, out = {_spelt(key): said for key, said in defined.items()}, list[str]()
    every = [*_chunks(text, defined)]
    found = [_keyed(chunk, defined, signed=True) for chunks in every for chunk in chunks]
    bare = not any(one.signed for one in found if one)  # "plate 1, arm 2", and no key has a sign
    for chunks in every:
        # Parts before the one that the key stands beside; whether others may follow
        waiting, signed, first = list[str](), bare, False
        for chunk in chunks:
            if found := _keyed(chunk, defined, signed=signed):
                parts = ", ".join([*waiting, found.parts]).replace("+", " and ")
                out.append(f"{parts}: {by_key[found.key]};")
                waiting, signed, first = [], signed or found.signed, found.first
            elif re.search(r"\d|\b(?:is|are)\b", chunk):
                out, waiting = [*out, *(f"{w}," for w in waiting), f"{chunk};"], []
            elif first and " " not in chunk.removeprefix("the "):  # "mat 1 -> shell, lid"
                out[-1] = f"{chunk}, {out[-1]}"
            else:
                waiting.append(chunk)
        out += [f"{w};" for w in waiting]
    return "\n".join(out)


# Cards of more lines than one, or more than one in a line.
_CONTINUED = re.compile(r"(?im)^(MAT1\*.*)\n\*(?=\s)|(?<=\d)()[^\S\n]*\$?[^\S\n]*(?=MP,)")
_KEYWORDS = re.compile(r"(?i)(?<=\S)\s(?=\*(?:MATERIAL|ELASTIC|DENSITY)\b)")
_OF_KEYWORD = re.compile(r"(?i)(?<=\*ELASTIC|\*DENSITY)[: ]+(?=[\d.])")
_OPENSEES = re.compile(
    rf"nDMaterial ElasticIsotropic (\d+) ({_FIGURE}) ({_FIGURE}) ({_FIGURE})(?: *;)?(?: *#(.*))?"
)
# Elements of XML: FEBio's <material name="rib"><E>7e4</E></material>, <geom name= density=/>
_ELEMENT = re.compile(
    r"(?is)<(material|geom|link|mat)\b(?=[^>]*\bname=[\"']([^\"']+))(.*?)(?:/>|</\1>)"
)
_IN_ELEMENT = re.compile(
    rf"(?i)\b(?:(E|young\w*)|(v|nu|poisson\w*)|(density|rho))(?:=[\"']|>)\s*({_FIGURE})"
)
# Cards within a line: "MAT1,11,70300.,,.33,2.78-9 is for the skin, MAT1,12,...".
_LISTED = re.compile(
    r"(?i)(?<!\S)(MAT1(?:,[^,\s]*)+?),? +(?:is +)?(?:for|on|->|=) +"
    r"([^(.\n]+?)(?=,? *MAT1|[(.\n]|$)"
)


def _as_cards(m: re.Match) -> str:
    """A card and who has it, as a comment and a card."""
    return f"\n$ {m[2].strip(' ,;')}\n{m[1]}\n"


def _of_element(m: re.Match) -> str:
    """An element of XML as cards of Abaqus, where it says numbers of a matter."""
    said = {k: x[4] for x in _IN_ELEMENT.finditer(m[3]) for k in (1, 2, 3) if x[k]}
    if not said.keys() & {1, 3}:
        return m[0]
    E, nu, rho = (said.get(k, "") for k in (1, 2, 3))
    return f"\n*MATERIAL, NAME={m[2]}\n*ELASTIC\n{E}, {nu}\n*DENSITY\n{rho}\n"


def _before_its_card(found: re.Match) -> str:
    """A comment at the end of a card, "MAT1,1,210000.,,.3 $ bracket", on a line before it."""
    if _OF_A_MEASURE.search(found[3]):
        return found[1].rstrip()
    number = f"mat {found[2]} = " if found[2] else ""
    return f"$ {number}{found[3].strip()}\n{found[1].rstrip()}"


def _cards(lines: Sequence[str]) -> Iterator[_Card]:
    """The materials of a deck, in their order."""
    title, ansys, at = "", dict[str, dict[str, float]](), 0
    while at < len(lines):
        line, at = lines[at].strip(), at + 1
        comment = _COMMENT.match(line)
        if found := _ANSYS.match(line):
            kind = {"EX": "E", "DENS": "rho"}.get(found[1].upper(), "nu")
            ansys.setdefault(found[2], {})[kind] = float(found[3])
        elif _NASTRAN.match(line):
            free = "," in line
            cells = line.split(",") if free else line.split()
            numbers = [_real(cell) for cell in cells[2:]]
            if not free and len(numbers) == 3:  # the empty field of G
                numbers.insert(1, None)
            kinds = zip(("E", "G", "nu", "rho"), numbers, strict=False)
            number_of, numbers = cells[1].strip(), {k: n for k, n in kinds if n and k != "G"}
            yield _Card(title or number_of, numbers, number_of)
            title = ""
        elif found := _ABAQUS.match(line):
            numbers, kind, name, given = {}, "", found[1].strip(), ""
            while at < len(lines) and not _ABAQUS.match(lines[at]):
                row, *parts = re.split(r"\s*(?:[-=]>|→)\s*", lines[at].strip(), maxsplit=1)
                given = parts[0].strip(" .") if parts else given
                at += 1
                if row.startswith("**"):
                    continue
                if row.startswith("*"):
                    keyword = _KEYWORD.match(row)
                    kind = keyword[1].upper() if keyword else ""
                    continue
                values = [_real(cell) for cell in row.split(",")]
                kinds = ("E", "nu") if kind == "ELASTIC" else ("rho",) if kind == "DENSITY" else ()
                numbers |= {k: n for k, n in zip(kinds, values, strict=False) if n}
                kind = ""
            yield _Card(given or re.sub(r"[_-]+", " ", name), numbers, name)
        elif found := _LS_DYNA.match(line):
            after = line[found.end() :].strip()
            title = title or (after.strip("$# ") if after.startswith("$") else "")
            while at < len(lines) and lines[at].startswith("$"):
                title = title if _SILENT.search(lines[at]) else lines[at].strip("$ ")
                at += 1
            rows = [row.strip() for row in lines[at:] if not row.startswith("$")]
            titled = "_TITLE" in line.upper()
            for i, row in enumerate(rows[titled:]):
                cells = re.split(r"[,\s]+", row.strip(" ,"))
                numbers = list(map(_real, cells[:4]))
                if i and (len(numbers) < 4 or None in numbers or not cells[0].isdigit()):
                    break  # of the same material, or of no card
                kinds = zip(("rho", "E", "nu"), numbers[1:], strict=False)
                name = rows[0] if titled else title or cells[0]
                yield _Card(name, {k: n for k, n in kinds if n}, cells[0])
                title = ""
        elif found := _ASTER.match(line):
            given = {m[1]: float(m[2]) for m in _GIVEN.finditer(found[2])}
            kinds = {"E": "E", "NU": "nu", "RHO": "rho"}
            yield _Card(found[1], {kinds[k.upper()]: n for k, n in given.items()})
        elif comment:
            title = "" if _SILENT.search(line) else comment[1]
    yield from (_Card(key, numbers) for key, numbers in ansys.items())


def _real(cell: str) -> float | None:
    """A number as decks write it, "2.81-9" for 2.81e-9; None for an empty field."""
    cell = re.sub(r"(?<=[\d.])([-+]\d+)$", r"e\1", cell.strip())
    try:
        return float(cell)
    except ValueError:
        return None


def _in_units(text: str) -> str:
    """The text with the units that it says once, as input of solvers does: "units N-mm-t"."""
    if not _UNITS.search(text):
        return text
    text = re.sub(
        rf"(?<!\w)E ?(?:=|:)? ?({_FIGURE})(?![\w.]| ?[kMG]?Pa)", lambda m: f"E = {m[1]} MPa", text
    )
    return re.sub(
        r"(?<!\w)(?:rho|ρ|density) ?(?:=|:)? ?(\d[\d.]*[eE]-\d+)(?!\w|\.\d| ?k?[gt]/)",
        lambda m: f"rho = {float(m[1]) * 1e12:.10g} kg/m3",
        text,
    )
