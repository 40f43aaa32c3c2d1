"""The parser of the training's sentences: which material words stand by which part words.

The product reads with ``predictors.text.reader``; this one is what the ablations were measured
with.

"oak legs and back, with a seat of soft foam" gives (oak: leg, back) and (soft foam: seat). The
parser is a left-to-right scan over a handful of word roles: a material before its
nouns ("oak legs"), after a link ("legs are oak", "legs of oak") or after its part in a list of
pairs ("legs oak, seat foam"). It knows no grammar beyond that and never fails: what it cannot
bind becomes a clause without parts or without a material.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Literal, NamedTuple

from ...fem.errors import UsageError
from ...fem.table import MaterialTable
from ...predictors.film import words
from ...predictors.text import parts
from ...predictors.text.clauses import Clause, Degree, Sentence, Subject
from ...predictors.text.parts import TOKEN, Vocabulary, stem, vocabulary_of

MAX_TEXT = 4000  # characters: longer than any description of one object; bounds the work
PARTICIPLES = frozenset("filled stuffed padded upholstered covered wrapped lined made".split())
NEGATIONS = frozenset("not no non without instead than".split())
# How stiff or dense.
LEVELS = {
    "soft": "soft softer squishy squashy squeezable plush flexible bendy pliable floppy supple "
    "elastic springy",
    "stiff": "stiff stiffer rigid firm hard inflexible unyielding sturdy",
    "dense": "dense heavy",
    "light": "light lightweight",
}
LEVEL_OF = {word: level for level, words in LEVELS.items() for word in words.split()}


@dataclass
class _Draft:
    """A clause that is being read; ``joint`` is the word between it and the one before."""

    joint: str = ""
    cut: Token | None = None  # the token of the joint
    words: list[Token] = field(default_factory=list)
    nouns: list[str] = field(default_factory=list)
    asides: list[str] = field(default_factory=list)  # nouns after a link: not the subject
    material: str | None = None
    material_stems: tuple[str, ...] = ()
    level: str | None = None
    linked: bool = False
    negated: bool = False  # a "not" waits for its material
    subjectless: bool = False  # it begins with a link: "which are oak", "it is a steel frame"
    predicate: bool = False  # the material came after its nouns

    @property
    def bare(self) -> bool:
        """Nouns, of which nothing is said yet."""
        return bool(self.nouns) and not (self.material or self.linked or self.level)

    @property
    def subject(self) -> list[str]:
        """What it speaks of; of "this is a chair" what comes after the link."""
        return self.nouns or ([] if self.material else self.asides)

    def name(self, token: Token) -> None:
        self.material, self.material_stems = token.word, token.stems
        self.predicate = bool(self.nouns)

    def clause(self, text: str) -> Clause:
        said = " ".join(token.said for token in self.words)
        return clause_of(self._written(text) or said, self.material, self.subject, self.level)

    def _written(self, text: str) -> str:
        """Characters from the first word to the last; "" where the words are not in this order."""
        spans = [token.span for token in self.words if token.span]
        if len(spans) < len(self.words) or any(a[1] > b[0] for a, b in pairwise(spans)):
            return ""
        return " ".join(text[spans[0][0] : spans[-1][1]].split())


def clause_of(
    text: str, material: str | None = None, parts: Iterable[str] = (), level: str | None = None
) -> Clause:
    """Return a clause of a text that speaks of parts, each by a word."""
    subject = Subject("parts", tuple((part,) for part in parts))
    stiffness: dict[str, Degree] = {"soft": 2, "stiff": 4}
    density: dict[str, Degree] = {"light": 2, "dense": 4}
    return Clause(
        text, (0, len(text)), subject, material, material or "",
        stiffness=stiffness.get(level or ""),
        density=density.get(level or ""),
    )  # fmt: skip


def listen(text: str, table: MaterialTable) -> Sentence:
    """Read a text by the words of a table.

    Raises
    ------
    UsageError
        Where the text has more than ``MAX_TEXT`` characters.
    """
    if len(text) > MAX_TEXT:
        raise UsageError(
            f"the text has {len(text)} characters, at most {MAX_TEXT} are read: shorten it"
        )
    drafts = _merge(_scan(tokenise(text, vocabulary_of(table))))
    clauses = (draft.clause(text) for draft in drafts if draft.material or draft.subject)
    return Sentence(text, tuple(clauses))


def _scan(tokens: list[Token]) -> list[_Draft]:
    """Cut the tokens into drafts: one material each, with the nouns that stand by it."""
    drafts = [_Draft()]
    tokens = [token for token in tokens if token.role != "filler"]
    for at, token in enumerate(tokens):
        draft = drafts[-1]
        ahead = tokens[at + 1 :]
        if token.word == "but" and not draft.material and _says_not(draft):
            continue  # "not steel but oak"
        inside = token.word == "in" and ahead[:1] and ahead[0].role == "start"
        if token.role in ("break", "joint") or inside:  # "a tree in a ceramic pot"
            drafts.append(_Draft("." if token.role == "break" else token.word, token))
            continue
        if token.role == "not":
            draft.negated = True
        elif token.role == "start" and draft.material and (draft.nouns or draft.linked):
            after_of = at > 0 and tokens[at - 1].word == "of"  # "oak legs of the chair"
            draft = draft if after_of else _open(drafts)
        elif token.role == "level":
            draft.level = LEVEL_OF[token.word]
        elif token.role == "link":
            draft = _link(drafts, token, ahead)
        elif token.role == "noun":
            draft = _noun(drafts, token, ahead)
        elif token.role == "material" and draft.negated:
            draft.negated = False
        elif token.role == "material" and draft.joint == "for" and drafts[-2].material:
            draft.nouns += token.stems  # "velvet for the fabric": a part, not a material
        elif token.role == "material":
            draft = _material(drafts, token, ahead, beside=at > 0 and tokens[at - 1])
        draft.words.append(token)
    return drafts


def _says_not(draft: _Draft) -> bool:
    return any(token.said == "not" for token in draft.words)


def _open(drafts: list[_Draft], joint: str = "") -> _Draft:
    drafts.append(_Draft(joint=joint))
    return drafts[-1]


def _next(ahead: list[Token], skip: Iterable[Role]) -> Role | None:
    """Role of the first token ahead that is not to be skipped."""
    return next((token.role for token in ahead if token.role not in skip), None)


def _link(drafts: list[_Draft], token: Token, ahead: list[Token]) -> _Draft:
    draft = drafts[-1]
    material_next = _next(ahead, ("link", "start", "level", "not")) == "material"
    if token.word == ":" and material_next:
        after = ahead[[other.role for other in ahead].index("material") + 1 :]
        if _next(after, ()) == "noun":  # "chair: oak legs"
            return _open(drafts, ".")
    if draft.material and not draft.nouns and not draft.linked:
        draft.nouns = list(draft.material_stems)  # "the leaves are ...": a part, not a material
        if material_next:
            draft.material = None
    elif draft.material and not draft.linked and len(draft.nouns) > 1 and material_next:
        noun = draft.nouns.pop()  # "steel frame seat is oak"
        draft = _open(drafts)
        draft.nouns = [noun]
    elif draft.material and token.word == "of":
        return draft
    draft.subjectless = draft.subjectless or not (draft.nouns or draft.material)
    draft.linked = True
    return draft


def _noun(drafts: list[_Draft], token: Token, ahead: list[Token]) -> _Draft:
    draft = drafts[-1]
    noun = token.stems[0]
    if draft.material and draft.predicate:
        # "legs are oak seat is foam" starts anew; "the seat is a foam cushion" does not.
        if _next(ahead, ("noun", "level")) not in ("link", "material"):
            return draft
        draft = _open(drafts)
    (draft.asides if draft.linked and not draft.material else draft.nouns).append(noun)
    return draft


def _material(
    drafts: list[_Draft], token: Token, ahead: list[Token], *, beside: Token | Literal[False]
) -> _Draft:
    draft = drafts[-1]
    if draft.material is None:
        rest = [other.role for other in _until_cut(ahead)]
        pair_list = not rest or rest[-1] != "noun"  # "legs oak seat foam" ends on a material
        if draft.nouns and not draft.linked and rest[:1] == ["noun"] and not pair_list:
            draft = _open(drafts)  # "chair steel frame"
        draft.name(token)
    elif beside and beside.role == "material":
        if token.stems[-1] not in parts.FAMILIES and not draft.predicate:
            draft.nouns += token.stems  # "plastic leaves", but not "oak wood"
    else:
        draft = _open(drafts)
        draft.name(token)
    return draft


def _until_cut(ahead: list[Token]) -> list[Token]:
    ends = (at for at, token in enumerate(ahead) if token.role in ("break", "joint"))
    return ahead[: next(ends, len(ahead))]


_LIST = frozenset([",", "and", "&", "+", "plus"])


def _merge(drafts: list[_Draft]) -> list[_Draft]:
    """Join what commas and "and" have cut: relative clauses, lists of parts, adjectives."""
    drafts = [draft for draft in drafts if draft.words]
    drafts = _fold(drafts, _is_relative, _take_predicate)
    drafts = _fold(drafts[::-1], lambda later, d: _shares_predicate(d, later), _give_nouns)[::-1]
    return _fold(drafts, _continues_list, _take_nouns)


def _fold(drafts: list[_Draft], joins, join) -> list[_Draft]:
    """Merge each draft into the one before it where ``joins(before, draft)`` holds."""
    out: list[_Draft] = []
    for draft in drafts:
        if out and joins(out[-1], draft):
            join(out[-1], draft)
        else:
            out.append(draft)
    return out


def _is_relative(before: _Draft, draft: _Draft) -> bool:
    """Tell "legs, which are oak": a material without a part, after a part without a material."""
    adjective = not (before.nouns or before.material) and before.level and draft.joint in _LIST
    return bool(adjective) or (
        not before.material
        and bool(before.nouns)
        and draft.material is not None
        and (draft.subjectless or (not draft.nouns and draft.joint == ","))
    )


def _take_predicate(before: _Draft, draft: _Draft) -> None:
    before.material, before.material_stems = draft.material, draft.material_stems
    before.level = draft.level or before.level
    before.nouns += draft.nouns
    before.linked, before.predicate = before.linked or draft.linked, bool(before.nouns)
    before.words += draft.words


def _shares_predicate(draft: _Draft, later: _Draft) -> bool:
    """Tell "legs and back are oak": bare nouns before a list's last part."""
    return draft.bare and later.joint in _LIST and later.predicate and bool(later.nouns)


def _give_nouns(later: _Draft, draft: _Draft) -> None:
    later.nouns = draft.nouns + later.nouns
    later.words = [*draft.words, _and(later), *later.words]
    later.joint, later.cut = draft.joint, draft.cut


def _continues_list(before: _Draft, draft: _Draft) -> bool:
    """Tell "oak legs and back": bare nouns after a material and its part; or "oak for the legs"."""
    attributive = before.material is not None and not before.predicate
    listed = draft.joint in _LIST and bool(before.nouns)
    return draft.bare and attributive and (listed or draft.joint == "for")


def _take_nouns(before: _Draft, draft: _Draft) -> None:
    before.nouns += draft.nouns
    before.words += [_and(draft), *draft.words]


def _and(draft: _Draft) -> Token:
    """The word between a draft and the one before, "and" where that is a comma."""
    written = draft.cut.span if draft.cut and draft.joint == "and" else None
    return Token("and", "joint", ("and",), "and", written)


# Tokens of a text: its words and the material phrases in it, each with its role and its place.

Role = Literal["material", "break", "joint", "link", "start", "level", "not", "noun", "filler"]

_UNITS = "mm cm dm km m kg g mg lb oz ft inches inch litres litre l % degrees percent metres metre"
_NUMBER = r"\d+(?:[.,]\d+)?"
_DASH = re.compile(r"\s[-–—]\s|→|->")
_SIZE = re.compile(
    rf"(?<![\w.])(?:{_NUMBER}(?:\s*(?:x|×|by)\s*{_NUMBER})*\s*(?:"
    + "|".join(map(re.escape, _UNITS.split()))
    + rf")|{_NUMBER}(?:\s*[x×]\s*{_NUMBER})+|\d+[.,]\d+)(?!\w)"
)


class Token(NamedTuple):
    """A word, or a material's phrase."""

    word: str  # of a material: its phrase in the table
    role: Role
    stems: tuple[str, ...]  # of a material: all words of its phrase
    said: str
    span: tuple[int, int] | None  # characters of the text; None for a word that is not there


def tokenise(text: str, vocabulary: Vocabulary) -> list[Token]:
    """Return the tokens of a text in order; sizes ("30 cm") are none, grades ("316L") are."""
    found = list(TOKEN.finditer(_plain(text, vocabulary)))
    raw = [match[0] for match in found]
    stems = [stem(word) for word in raw]
    tokens: list[Token] = []
    at = 0
    while at < len(raw):
        phrase, length = vocabulary.match(stems, at) or (None, 1)
        end = at + length
        span = found[at].start(), found[end - 1].end()
        if phrase is not None:
            said = " ".join(raw[at:end])
            tokens.append(Token(phrase, "material", tuple(stems[at:end]), said, span))
        else:
            follows_participle = bool(tokens) and tokens[-1].stems[0] in PARTICIPLES
            role = _role(raw[at], stems[at], follows_participle)
            tokens.append(Token(raw[at], role, (stems[at],), raw[at], span))
        at = end
    return tokens


def _plain(text: str, vocabulary: Vocabulary) -> str:
    """Lower case without sizes and genitives, dashes as "=": every word stays at its place."""

    def without_size(size: re.Match[str]) -> str:
        words = [stem(word) for word in TOKEN.findall(size[0])]
        named = vocabulary.match(words, 0)
        return size[0] if named and named[1] == len(words) else " " * len(size[0])

    lower = "".join(c.lower() if len(c.lower()) == 1 else c for c in text)
    blank = _SIZE.sub(without_size, lower)
    return _DASH.sub(lambda dash: "=".center(len(dash[0])), blank).replace("'s", "  ")


def _role(word: str, stem: str, follows_participle: bool) -> Role:
    if word == "with" and follows_participle:
        return "link"
    if word == "\n" or stem in words.BREAKS:
        return "break"
    if word == ":" or stem in words.LINKS or word in words.LINKS:
        return "link"
    if stem in words.JOINTS or word in words.JOINTS:
        return "joint"
    if stem in words.DETERMINERS:
        return "start"
    if word in LEVEL_OF:
        return "level"
    if word in NEGATIONS:
        return "not"
    return "filler" if stem in parts.FILLERS or word.isdigit() else "noun"
