"""A thing in one piece: its parts are what the nouns of its text name.

The tagger is asked about each noun as about a part. Words that it finds for none are no matter of
the thing ("a padded egg chair"), those that the grammar gave to another noun or to none are of the
noun that they are found for, and what the grammar did not hear is added. A word for a matter that
is found for nothing is asked about too: "upholstery" is of leather.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from ...fem.table import MaterialTable
from .clauses import Bound, Clause, Place, Subject, bind, over
from .english import Lexeme, load_model
from .english import words as lists
from .lexing import lex
from .materials import lexicon_of
from .parts import known_parts, part_words, stem
from .reader import parse
from .tagger import load_tagger, place_of

NEAR = 0.1  # of certainty: of nouns that are as sure the nearest has the matter
_JOINED = re.compile(r"\s*(?:[,/+]\s*|,?\s*(?:&|and\b)\s*(?:\w+\s+)?)")  # "rail and four blades"
_HERE = ("inside", "outside")  # where a part has no noun
_VERBS = ("VB", "VBZ", "VBP", "UH")  # tags that a noun without an article may get: "runners steel"
_NO_NOUN = ("number", "told", "size", "look", "material")


class Claim(NamedTuple):
    """Where a matter stands that the tagger finds for a noun, and how surely."""

    matter: Place
    noun: Place
    certainty: float

    @property
    def own(self) -> bool:
        """Whether the noun is the matter: "the soil"."""
        return over(self.matter, self.noun)

    @property
    def gap(self) -> int:
        """Letters between the two."""
        return max(self.matter[0] - self.noun[1], self.noun[0] - self.matter[1])


def nouns(lexemes: Sequence[Lexeme]) -> list[Place]:
    """Where the nouns of each phrase stand, cut where matters stand among them."""
    found: list[Place] = []
    last = -2  # where the noun before ends
    for x in lexemes:
        part = {*x.words[-1:]} & known_parts()
        noun = x.text[0].isalpha() and x.role not in _NO_NOUN
        low = x.text.lower()
        mistagged = x.role == "word" and x.tag in _VERBS and load_model().is_word(low, ("noun",))
        if noun and (x.tag.startswith("NN") or part or low in _HERE or mistagged):
            joins = x.start - last <= 1
            found[len(found) - joins :] = [(found[-1][0] if joins else x.start, x.end)]
            last = x.end
        elif x.role == "hyphen" and x.start == last:
            last = x.end
        elif x.role == "material":
            word = x.text.split()[-1]
            if part or not (word.isupper() or stem(word) == word.lower()):
                found.append((x.end - len(word), x.end))  # "soil", "nylon strings"
    return found


def owners(claims: Sequence[Claim], text: str) -> list[Place]:
    """The noun that has what all of these claim, and those that are joined to it."""
    claims = [c for c in claims if not c.own] or claims
    least = max(c.certainty for c in claims) - NEAR
    out = [min((c for c in claims if c.certainty >= least), key=lambda c: c.gap).noun]
    for noun in sorted(
        (c.noun for c in claims if c.certainty >= least), key=lambda noun: abs(noun[0] - out[0][0])
    ):
        sides = [sorted((noun, other)) for other in (out[0], out[-1])]
        if noun not in out and any(_JOINED.fullmatch(text[a[1] : b[0]]) for a, b in sides):
            out = sorted((*out, noun))
    return out


def of_one_piece(bound: Bound, labels: Sequence[Sequence[str]], table: MaterialTable) -> Bound:
    """Return what a text says of a thing in one piece, by its own nouns.

    bound: What the grammar read.
    labels: What the asset calls the thing.
    table: Whose rows are materials.
    """
    text, lexicon = bound.sentence.text, lexicon_of(table)
    language = bound.sentence.language
    lexemes = lex(text, lexicon, ()).lexemes
    matters, things = [(x.start, x.end) for x in lexemes if x.role == "material"], nouns(lexemes)
    if len(matters) < 2 or len(things) < 2:
        return bound

    def asked(spans: Sequence[Place], *roles: str, others: Sequence[Place] = ()) -> list[Claim]:
        names = [text[slice(*span)] for span in (*spans, *others)]
        said = load_tagger().said(names, text)[: len(spans)] if spans else []
        return [
            Claim((start, end), span, one.certainty)
            for span, one in zip(spans, said, strict=True)
            for role, start, end in one.words if role in roles
        ]  # fmt: skip

    def name(noun: Place) -> tuple[str, ...]:
        return tuple(map(stem, re.findall(r"[^\W_]+", text[slice(*noun)])))

    def subject(claims: Sequence[Claim]) -> Subject:
        return Subject("parts", tuple(filter(None, map(name, owners(claims, text)))))

    def is_meant(clause: Clause, here: Place) -> bool:
        """Whether its matter is of the thing, as far as its words and those around it tell."""
        if clause.unknown and all(map(lexicon.model.is_word, clause.unknown.lower().split())):
            return False  # "a lamp of the wall"
        behind = re.match(r" (\w+)", text[here[1] :])
        row = table.exact(clause.material) if clause.material else None
        if (
            row
            and row.category in lists()["purposes"]["categories"]
            and behind
            and stem(behind[1]) in part_words()["objects"]
        ):
            return False  # "a fruit bowl"
        if any(over(c.matter, here) for c in claims) or clause.subject.scope == "rest":
            return True
        heads = {n[-1] for n in clause.subject.names}
        numbers = any(n.measure not in ("mass", "thickness") for n in clause.numbers)
        if numbers or clause.comparisons or clause.excluded:
            return True
        of_other = any(  # "soft leaves" are leaves all the same
            any(over(c.matter, x) for x in matters)
            and ({*name(c.noun)[-1:]} & heads or over(c.noun, here))
            for c in claims
        )
        return row is not None and not of_other

    claims = asked(things, "matter", "number", "coating")
    spoken = [(clause, place_of(clause, text)) for clause in bound.sentence.clauses]
    stray = [(max(text.rfind(" ", *here) + 1, here[0]), here[1]) for c, here in spoken if c.phrase]
    taken = [*things, *(c.matter for c in claims)]
    stray = [x for x in stray if x[0] < x[1] and not any(over(x, y) for y in taken)]
    more = asked(stray, "matter", "number", others=things)
    claims += [
        c for c in more
        if c.certainty > 1 - NEAR and not c.own and any(over(c.matter, x) for x in matters)
    ]  # fmt: skip
    claims = [  # "foliage: leaf" speaks of no leaf
        c for c in claims
        if not any(
            over(c.matter, d.noun) and over(d.matter, c.noun) and c.certainty < d.certainty
            for d in claims
        )
    ]  # fmt: skip
    clauses: list[Clause] = []
    heard: list[Place] = []
    for clause, here in spoken:
        mine = [c for c in claims if over(c.matter, here)]
        meant = is_meant(clause, here)
        heard += [c.matter for c in mine if clause.material or not meant]
        if not meant:
            continue
        if mine and clause.material:
            new, names = subject(mine), clause.subject.names
            heads = {n[-1] for n in names}
            behind = {name(x)[-1] for x in things if 0 <= x[0] - here[1] <= 1 and name(x)}
            known = heads & (behind | {n[-1] for n in new.names}) or all(c.own for c in mine)
            if clause.subject.scope != "rest" and not (names and known):
                clause = replace(clause, subject=new)
            elif len(names) > 1:  # "a box, its lid of brass"
                claimed = behind | {n[-1] for n in map(name, (c.noun for c in mine)) if n}
                kept = tuple(n for n in names if n[-1] in claimed) or names
                clause = replace(clause, subject=replace(clause.subject, names=kept))
        clauses.append(clause)
    unheard = [c for c in claims if not any(over(c.matter, span) for span in heard)]
    while unheard:
        first = max(unheard, key=lambda c: c.certainty)
        same = [c for c in unheard if over(c.matter, first.matter)]
        unheard = [c for c in unheard if c not in same]
        words = text[slice(*first.matter)]
        read = parse(lists()["alone"][language].format(part="part", words=words), table).clauses
        new = next((c for c in read if c.material or c.coating), None)
        if new:
            clauses = [
                c for c in clauses if c.material or not over(place_of(c, text), first.matter)
            ]
            span = first.matter
            clauses.append(replace(new, text=words, span=span, subject=subject(same)))
    seen = [  # nobody sees what a coat is on
        c if c.material or c.unknown else replace(c, material=c.coating, phrase=c.coating or "")
        for c in sorted(clauses, key=lambda c: c.span)
    ]
    return bind(replace(bound.sentence, clauses=tuple(seen)), labels)
