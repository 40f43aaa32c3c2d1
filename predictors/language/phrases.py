"""What words say together: comparisons, treatments and colours, contents."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import replace

from ...fem.scene.materials import Material
from ..quantities.numerals import number
from ..quantities.quantity import Quantity
from ..vocabulary.lexicon import Phrase, ReaderLexicon, words
from .clauses import Comparison
from .lexing import Lexeme

PLAIN_FACTOR = 2.0  # "stiffer", without a word for how much
_REACH = 6  # words before a comparative that may say how many times
_HARDNESS = re.compile(r"(?:hardness\W*(?:of )?)?([AD])?-?([1-9]\d)([AD])?")
_NUMBER = re.compile(r"(?!\d\.\d{4}$)\d[\d.]*")  # "1.4301" is a grade and nothing else
_YEAR = re.compile(r"(?:19|20)\d\d")
_CLASS = re.compile(r"\d\d?\.\d")  # of bolts: "8.8"
_RUBBERY = re.compile(r"(?i)\b(?:T?PU|TPE|polyurethane|urethane)\b")
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


def contents_called(said: Sequence[str], lexicon: ReaderLexicon) -> str | None:
    """Row of the loose matter or liquid that the last words of ``said`` name."""
    tails = (tuple(said[i:]) for i in range(len(said)))
    return next((lexicon.contents[tail] for tail in tails if tail in lexicon.contents), None)


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
