"""The reader: a text to a Sentence, once.

Its lexemes are joined to tokens (a part, what is said of one, or both, and what stands between
them), the grammar joins these to statements, and each statement becomes a clause.
"""

from __future__ import annotations

import re
import sys
import tomllib
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import pairwise, takewhile
from operator import itemgetter
from pathlib import Path
from typing import Any, Literal, NamedTuple

from ...fem.errors import UsageError
from ...fem.note import Note
from ...fem.table import Material, MaterialTable
from .clauses import Bound, Clause, Scope, Sentence, Subject, bind
from .english import Phrase, words
from .lexing import (
    Lexed,
    Lexeme,
    bare_numbers,
    finer,
    in_english,
    in_sentences,
    is_hue,
    join_comparisons,
    lex,
    lone_grades,
    one_of,
    point_back,
    puts_hue,
    same_again,
)
from .materials import SHORT, ReaderLexicon, lexicon_of
from .numerals import Blend, Comparison, Quantity, counted_by
from .parts import known_parts, part_name_words, part_words, places

LONGEST = 4000  # characters: a page of notes; a book is a mistake
_GROUPED = (
    "word material part number stiffness density character degree fake coat coating look attributes"
    " empty compare idle factors vague digits size told sign hyphen nobody all"
).split()


def parse(
    text: str, table: MaterialTable, names: Sequence[str] = (), *, language: str = "",
    beside: str = "",
) -> Sentence:  # fmt: skip
    """Return what a text says of materials, read once.

    text: Plain English, as a sentence, a list, a table or a note.
    table: Whose rows are materials.
    names: What the asset calls its parts: a word of theirs is a part before it is a material.
    language: What it is in, "" where its words tell.
    beside: What it is a part of: words there tell in which sense others are meant.
    Raises UsageError: Where the text is longer than ``LONGEST`` characters.
    Raises InputError: Where the English model is not installed.
    """
    if len(text) > LONGEST:
        raise UsageError("reader.text_characters", count=len(text), longest=LONGEST)
    lexicon = lexicon_of(table)
    text = in_sentences(text, names, lexicon)
    lexed = lex(text, lexicon, names, language=language)
    gloss = in_english(text, lexed)
    matters = tuple((x.start, x.end) for x in lexed.lexemes if x.role == "material")
    numbers = tuple((x.start, x.end) for x in lexed.lexemes if x.role == "number")
    lexed.lexemes = point_back(one_of(lone_grades(bare_numbers(lexed.lexemes))))
    lexed.lexemes = finer(same_again(lexed.lexemes, lexicon), lexicon)
    cascade = Cascade(list(_tokens(join_comparisons(lexed.lexemes), lexicon)), lexicon)
    left = _numbers_joined(cascade.run(), lexed.lexemes)
    for draft in left:
        take_state(draft, lexed.lexemes, lexicon)
    told = {name for draft in left if draft.says for name in draft.names}
    for draft in left:
        if draft.named and not draft.says and not told & {*draft.names}:
            take_strange(draft, lexed.lexemes)
    drafts = [draft for draft in left if draft.says]
    mute = [name for draft in left if draft.named and not draft.says for name in draft.names]
    _tell_compounds(lexed.lexemes, drafts)
    take_caption(drafts, lexed.lexemes)
    settle(drafts, lexed)
    take_values(drafts)
    drafts += _filled(drafts, names, lexicon)
    unread = unread_lexemes(drafts, lexed, cascade.dropped)
    tell(unread, drafts, lexed.lexemes)
    spoken = {*re.findall(r"[^\W\d_]+", f"{text} {beside}".lower())}
    clauses = tuple(clause_of(text, draft, lexicon, spoken) for draft in drafts)
    notes = dict.fromkeys([*lexed.notes, *(x.note for x in lexed.lexemes if x.note)])
    # What is of none: "it only looks like marble"
    told = [*notes, *(doubt for clause in clauses for doubt in clause.doubts)]
    told = " ".join([*map(str, told), *(x.text for x in unread)]).lower()
    states = {*words()["states"]["words"]}
    aside = [
        x.text for x in lexed.lexemes
        if (
            x.role == "material" or not x.known or x.text.lower() in states
            or (x.role == "word" and not lexicon.model.is_word(x.text.lower()))  # "moly faced"
        )
        and not x.part
        and not any(a <= x.start < b for a, b in (clause.span for clause in clauses))
        and x.text.lower() not in told
    ]  # fmt: skip
    if aside:
        said = ", ".join(map(repr, dict.fromkeys(aside)))
        notes[Note("reader.aside", words=said)] = None
    return Sentence(
        text,
        clauses,
        tuple(x.text for x in unread),
        tuple(notes),
        _first_phrase(lexed.lexemes, {*grammar()["signs"], "sign"} - {"word"}),
        tuple(dict.fromkeys(mute)),
        matters,
        numbers,
        gloss,
    )


def _numbers_joined(drafts: Sequence[Draft], lexemes: Sequence[Lexeme]) -> list[Draft]:
    """Drafts, with numbers of what is no part joined to the part before: "the maker says ..."."""
    out = list(drafts[:1])
    for draft in drafts[1:]:
        alone = draft.numbers and not (draft.named or draft.material or draft.unknown)
        here, after = ([x.start for x in each.lexemes] for each in (out[-1], draft))
        joins = alone and draft.names and out[-1].named and out[-1].says and here and after
        stops = (x.start for x in lexemes if x.role == "stop")
        if joins and not any(max(here) < at < min(after) for at in stops):
            out[-1].add(draft)
            out[-1].lexemes += draft.lexemes
        else:
            out.append(draft)
    return out


def read_sentence(text: str, labels: Sequence[Sequence[str]], table: MaterialTable) -> Bound:
    """Read a text, and say which of its clauses speak of which part.

    text: What the user says of the object.
    labels: For each part its name, then all other words that the asset has for it.
    table: Whose rows are materials.
    """
    return bind(parse(text, table, [own[0] for own in labels]), labels)


def _tokens(lexemes: Sequence[Lexeme], lexicon: ReaderLexicon) -> Iterator[Constituent]:
    """Cut lexemes into connectors and the runs between them, and these into groups."""
    signs, before, last, at, draft = grammar()["signs"], "", (), 0, Draft()
    while at < len(lexemes):
        # The run of grouped lexemes; "the legs are oak the seat is foam" are two
        end, owed = at, False
        while end < len(lexemes) and _is_grouped(lexemes, end, at):
            if owed and lexemes[end + 1 : end + 2] and lexemes[end + 1].role == "is":
                break
            owed = owed or (before == "=" and lexemes[end].role == "material")
            end += 1
        after = signs.get(lexemes[end].role, "") if end < len(lexemes) else ""
        if end > at:
            for token in _groups(lexemes[at:end], lexicon, before, after, last):
                draft = token.draft or draft
                last = draft.names[-1] if draft.names else last
                before = ""
                yield token
            at = end
            continue
        lexeme = lexemes[at]
        sign = signs.get(lexeme.role, "p")
        if sign == "W":
            scope = "rest" if lexeme.role == "rest" else "whole"
            yield Constituent("W", Draft(scope, lexemes=[lexeme]))
        elif sign == "O":
            yield Constituent("O", Draft("parts", [("other", *last[-1:])]))
        elif sign == "m":
            yield Constituent("m", Draft(same=()))
        elif sign in "tY":
            yield Constituent(sign, Draft("whole"))
        else:
            after = next((x.role for x in lexemes[at + 1 :] if x.tag != "DT"), "")
            draft.holds = draft.holds or (sign == "w" and after not in ("number", "told"))
            yield Constituent(sign)
        before, at = sign, at + 1


def _is_grouped(lexemes: Sequence[Lexeme], i: int, start: int) -> bool:
    """Whether a lexeme is of a group; a verb is, as the participle before a noun."""
    lexeme, run = lexemes[i], lexemes[start:i]
    role = lexemes[i + 1].role if i + 1 < len(lexemes) else ""
    if lexeme.part and lexeme.role not in ("is", "of", "and", "comma"):
        return True
    changed = (lexeme.text.lower() in words()[said]["words"] for said in ("conditions", "states"))
    if role in ("material", "word") and any(changed):
        return True
    if lexeme.role == "coat" and role in ("with", "of"):
        return bool(run) and run[-1].end == lexeme.start  # "leather-covered in ..."
    if lexeme.role == "word" and lexeme.tag.startswith("V") and lexeme.known:
        if lexeme.tag == "VB" and run and run[-1].role == "material" and lexemes[i + 1 : i + 2]:
            return lexemes[i + 1].part  # "a brass stop tap"
        said = bool(run) and role in ("material", "word") and lexemes[i + 1].tag[:2] in ("NN", "JJ")
        return said and lexeme.tag in ("VBN", "VBG")
    return lexeme.role in _GROUPED


def _groups(
    run: Sequence[Lexeme], lexicon: ReaderLexicon, before: str, after: str, last: Phrase
) -> Iterator[Constituent]:
    """Tokens of a run, ``before`` and ``after`` which signs stand."""
    opens = after in ("=", "o") or before in ("x", "F")
    owes = before in tuple("=o^cf!mTAW~") and not opens
    at = next((i for i, x in enumerate(run) if x.text.lower() in ("whole", "entire")), None)
    if at is not None:
        if any(x.part for x in run[:at]):
            yield from _groups(run[:at], lexicon, before, "", last)
            run = run[at:]
        run = [x for x in run if x.role != "word" or x.part]
        yield Constituent("W", Draft("whole", lexemes=[x for x in run if x.role == "all"]))
    for group in groups_of(run, lexicon, owes=owes, opens=opens):
        part = group.part
        side = part[-1:] and part[-1] in places() and not group.named
        side = side or (len(part) > 1 and {*part} <= places())  # "the back left one"
        if last and part and all(word.isdigit() for word in part):  # "leg 1, 2"
            part = (*(word for word in last if not word.isdigit()), *part)
        elif last and side and not (group.values and known_parts() & {*part[-1:]}):
            part = (*part, last[-1])  # "the second", but "a glass top"
        if part and part[-1] in words()["attributes"]["matter"] and after == "=":
            part = part[:-1]
            if not part:
                yield Constituent("W", Draft("whole", lexemes=group.lexemes))
                continue
        # How many of a kind are spoken of, 0 for "some": "three legs"
        counts = map(counted_by, (x.text for x in takewhile(lambda x: not x.part, group.lexemes)))
        # Nouns before a material that may make another of it: "polymer clay"
        start = next((m.lexeme.start for m in group.values), 0)
        nouns = (x for x in group.lexemes if x.role == "word" and x.tag in ("NN", "NNP"))
        draft = Draft(
            "parts" if part else "none", [part] if part else [], named=group.named, own=group.own,
            count=next((n for n in counts if n is not None), None), mixed=is_mixed(run),
            loose=[] if group.named else [x.text for x in nouns if x.end < start],
            article=any(x.tag in ("DT", "PRP$") for x in group.lexemes),
            lexemes=list(group.lexemes),
            # Introduced as the thing that the text is about: "a bookcase"
            holds=any(x.text.lower() in ("a", "an") for x in group.lexemes)
            and not (last and group.values),
        )  # fmt: skip
        for mention in group.values:
            draft.take(mention, lexicon)
        # S a part, V what is said, N that without a matter, B and P both
        if not part:
            yield Constituent("V" if draft.material or draft.unknown else "N", draft)
        else:
            sign = "S" if group.own or not group.values else "P" if group.part_first else "B"
            yield Constituent(sign if group.named else sign.lower(), draft)
        last = part or last


# The grammar: constituents of a text, joined by rules over the signs of their sequence.
#
# Each has a sign of one character (``data/grammar.toml`` lists them). A rule is a regular
# expression over the signs of a text with named groups: the one called ``head`` takes what the
# others say, each in the role that its name says, and stands for all of them. Rules are tried in
# their order, each until it fits nowhere: a cascade of finite-state transducers (Hobbs et al.
# 1997, FASTUS).

SAYING = "VNXBbPpDGSsWtOEmY"  # signs of tokens that have a draft


@dataclass(eq=False)
class Constituent:
    """One sign of a text: a connector without a draft, or what a draft says."""

    sign: str
    draft: Draft | None = None


class Rule(NamedTuple):
    """Where a rule fits, the sign of what it makes, and the role that it leaves standing after."""

    find: re.Pattern
    to: str
    keep: str


@lru_cache(maxsize=1)
def grammar() -> dict[str, Any]:
    """Signs by role, and rules: ``data/grammar.toml``."""
    data = tomllib.loads((Path(__file__).parent / "data/grammar.toml").read_text(encoding="utf-8"))

    def spelt(pattern: str) -> str:
        return re.sub(r"<([A-Z_]+)>", lambda m: spelt(data["sets"][m[1]]), pattern)

    rules = [
        Rule(re.compile(spelt(r["find"])), r.get("to", ""), r.get("keep", "")) for r in data["rule"]
    ]
    return {"signs": data["signs"], "rules": rules}


class Cascade:
    """The tokens of a text, which rules join to statements."""

    def __init__(self, tokens: list[Constituent], lexicon: ReaderLexicon) -> None:
        self.tokens, self.lexicon = tokens, lexicon
        self.dropped: list[Lexeme] = []  # read, and of nothing that is there

    def run(self) -> list[Draft]:
        """Apply every rule until it fits nowhere; return the drafts that are left."""
        for rule in grammar()["rules"]:
            for _ in range(len(self.tokens)):
                signs = "".join(token.sign for token in self.tokens)
                if not any(self._apply(rule, match) for match in rule.find.finditer(signs)):
                    break
        return [token.draft for token in self.tokens if token.draft is not None]

    def _apply(self, rule: Rule, match: re.Match) -> bool:
        """Join what a match spans, and say whether its sequence is another then."""
        span = self.tokens[slice(*match.span())]
        groups = {
            role: self.tokens[slice(*match.span(role))]
            for role in rule.find.groupindex if match[role]
        }  # fmt: skip
        said = [(role, t.draft) for role, tokens in groups.items() for t in tokens if t.draft]
        made = next((t for t in groups.get("head", []) if t.draft), Constituent(rule.to))
        draft = made.draft = made.draft or Draft()
        if any(not _GUARDS[role](self, draft, other) for role, other in said if role in _GUARDS):
            return False
        for role, other in said:
            if other is not draft and role != "keep":
                _ROLES[role](self, draft, other)
                kept = role in ("exceptions", "outside", rule.keep)
                into = self.dropped if role == "drop" else draft.lexemes
                into += [] if kept else other.lexemes
        if "last" in groups:
            at = match.start()
            said = [t.draft for t in reversed(self.tokens[:at]) if t.draft and t.draft.names]
            before = (other.names[-1] for other in said if other.names[-1] not in draft.names)
            draft.compare_with(next(before, ()))
        if made not in span and made.sign not in SAYING:
            made.draft = None
        made.sign = rule.to.strip("-") or made.sign
        if rule.to == "W":
            draft.scope = "whole"
        for token in groups.get("exceptions", []):
            token.sign = token.sign.replace("E", "S")
        stays = [t for t in span if t is made or t in groups.get(rule.keep, [])]
        new = [] if rule.to == "-" else stays if made in stays else [made, *stays]
        self.tokens[slice(*match.span())] = new
        return "".join(t.sign for t in new) != match[0]


def _names(_: Cascade, head: Draft, other: Draft) -> None:
    head.scope = other.scope if head.scope == "none" else head.scope
    head.names += other.names
    head.exceptions += other.exceptions
    head.named, head.holds = head.named or other.named, head.holds or other.holds
    head.filling = head.filling or other.filling


def _more(cascade: Cascade, head: Draft, other: Draft) -> None:
    _names(cascade, head, other)
    head.add(other)


def _fill(cascade: Cascade, head: Draft, other: Draft) -> None:
    row = other.material.name if other.material else None
    inner = {name[-1] for name in head.names if name} & {*words()["containers"]["inside"]}
    if inner and head.material is None:  # "the inside is full of sand"
        head.material, head.phrase = other.material, other.phrase
    head.filling = cascade.lexicon.contents_called(other.said) or row or head.filling


def _holds_contents(cascade: Cascade, head: Draft, other: Draft) -> bool:
    """Whether "of" says what is in a thing: "a bag of sand", "a box of books"."""
    containers, row = words()["containers"], other.material
    heads = {name[-1] for name in head.names if name}
    fills = row is None or row.category in containers["matter"]
    loose = cascade.lexicon.contents_called(other.said) not in (None, row and row.name)
    plural = bool(other.lexemes) and other.lexemes[-1].text.lower().endswith("s")
    return bool(heads & set(containers["words"])) and loose and (fills or plural)


def _is_strange(cascade: Cascade, head: Draft, other: Draft) -> bool:
    """Whether a noun in the place of a material is meant for one that nobody knows."""
    strange = any(not x.known and x.tag != "RB" for x in other.lexemes) and not other.named
    adjective = cascade.lexicon.model.is_word(other.names[-1][-1], ("adj",))
    return strange or (_is_stuff(cascade, head, other) and not adjective)


def _is_stuff(_: Cascade, __: Draft, other: Draft) -> bool:
    """Whether a name after "of" or "from" is of a matter: "cut from King StarBoard"."""
    return not (other.article or other.named or other.names[-1][-1] in known_parts())


def _unknown(_: Cascade, head: Draft, other: Draft) -> None:
    head.unknown = " ".join(x.text for x in other.lexemes if x.words)


def _again(cascade: Cascade, head: Draft, other: Draft) -> None:
    """Take what is said once more of the same, and tell what it is against: "it is wood"."""
    one, two = head.material, other.material
    if one and two and one.category != two.category and not (head.kind or other.kind):
        head.notes.append(Note("reader.again", first=head.phrase, second=other.phrase))
    head.add(other, instead=True)


def _excluded(cascade: Cascade, head: Draft, other: Draft) -> None:
    other.rule_out(cascade.lexicon)
    _more(cascade, head, other)


# What a rule's groups say of its head.
_ROLES: dict[str, Callable[[Cascade, Draft, Draft], object]] = {
    "head": _more, "pure": _names, "names": _names, "bearers": _names,
    "owner": lambda _, head, other: head.owned_by(other),
    "coating": lambda _, head, other: setattr(
        head, "coating", other.material.name if other.material else other.coating
    ),
    "filling": _fill, "contents": _fill, "unknown": _unknown,
    "strange": _unknown, "stuff": _unknown,
    "excluded": _excluded,
    **dict.fromkeys(
        ("values", "made", "first", "unplaced"), lambda _, head, other: head.add(other)
    ),
    "instead": lambda _, head, other: head.add(other, instead=True), "again": _again,
    "compared": lambda _, head, other: head.compare_with((*other.names, tuple(other.said))[0]),
    "same": lambda _, head, other: setattr(head, "same", (*other.names, ())[0]),
    "exceptions": lambda _, head, other: head.exceptions.extend(other.names),
    "renamed": lambda _, head, other: head.rename(other),
    **dict.fromkeys(("drop", "keep", "last", "outside"), lambda *_: None),
}  # fmt: skip
_GUARDS: dict[str, Callable[[Cascade, Draft, Draft], bool]] = {
    "contents": _holds_contents, "unknown": _is_strange, "stuff": _is_stuff,
    "first": lambda _, head, other: head.material is None and not head.unknown,
    "bearers": lambda _, head, other: not head.comparisons,
    "names": lambda _, head, other: not other.own,
    "pure": lambda _, head, other: not (other.mixed or other.own),
    "strange": lambda _, head, other: any(not x.known for x in other.lexemes),
}  # fmt: skip


# Groups of words between connectors: a part, what is said of one, or both, in either order.

_SAYING = ("material", "level", "number", "unknown")
# Roles of words that a part may be called by all the same: "cover", "core", "body".
_SMALL = "character empty attributes coating idle look factors fill vague coat".split()
# Roles that a part's name does not take from a word.
_OWN = ("material", "number", "part", "digits", "compare", "hyphen", "sign", "told", "size")
Kind = Literal["part", "modifier", "material", "level", "number", "coating", "filling", "unknown",
               "left", "kin"]  # fmt: skip


@dataclass(frozen=True)
class Mention:
    """A lexeme in its group: what it is for the statement, and what it says."""

    kind: Kind
    lexeme: Lexeme
    value: Any = None  # a Material, Quantity, Blend or Comparison; a level with its role

    @property
    def says(self) -> bool:
        """Whether it says something of a part, and is none."""
        return self.kind not in ("part", "modifier")


@dataclass
class Group:
    """A part and what is said of it in the same breath; either may be missing."""

    part: Phrase = ()
    values: list[Mention] = field(default_factory=list)
    lexemes: list[Lexeme] = field(default_factory=list)
    named: bool = False  # a part of the asset has this head
    part_first: bool = False  # "hull teak"
    own: bool = False  # what is said of it is its name alone: "bones"


def groups_of(
    run: Sequence[Lexeme], lexicon: ReaderLexicon, *, owes: bool, opens: bool
) -> list[Group]:
    """Cut a run of words into groups.

    ``owes`` says that a subject waits for its material, ``opens`` that the run is itself a subject:
    a word for a part and for a material is the material there, and the part here.
    """
    mentions = _one_material(_mentions(list(run), owes=owes), lexicon)
    if not any(m.kind == "material" for m in mentions):
        mentions = [Mention("material", *found) for found in _implied(run, lexicon)] + mentions
    if opens:
        mentions = [replace(m, value=None) if m.kind == "part" else m for m in mentions]
    # Cut where parts and what is said of them alternate; modifiers go with what follows
    blocks: list[list[Mention]] = []
    waiting: list[Mention] = []
    for mention in mentions:
        if mention.kind == "modifier":
            waiting.append(mention)
            continue
        if blocks and blocks[-1][-1].says == mention.says:
            blocks[-1] += [*waiting, mention]
        else:
            blocks.append([*waiting, mention])
        waiting = []
    placed = not blocks and any(word in places() for m in waiting for word in m.lexeme.words)
    if placed or (waiting and waiting[-1].lexeme.part):
        blocks.append(waiting)  # "the second is pine"
    # Join each part with what is said of it, before it or after it
    says = [block[-1].says for block in blocks]
    if says == [False, True, False]:
        # "top beech ply" of a part "top"; "bench: oak slats" would have its colon.
        if not any(m.lexeme.part for m in blocks[2]):
            return [_group(blocks[0], blocks[1], part_first=True)]
        return [_group(blocks[0], []), _group(blocks[2], blocks[1])]
    part_first = bool(says) and not says[0]
    out: list[Group] = []
    while blocks:
        first, *blocks = blocks
        if blocks and first[-1].says != part_first:
            second, *blocks = blocks
            parts, values = (first, second) if part_first else (second, first)
            named = [i for i, m in enumerate(parts) if m.lexeme.part]
            if part_first and named:  # "blade damascus steel" speaks of the blade
                parts = parts[: named[-1] + 1]
            out.append(_group(parts, values, part_first=part_first))
        else:
            out.append(_group([], first) if first[-1].says else _group(first, []))
    return out


def _mentions(run: list[Lexeme], *, owes: bool) -> list[Mention]:
    """Say of every lexeme what it is for the statement; coats and looks take what names them."""
    out: list[Mention] = []
    degree, fake = "", False
    for i, lexeme in enumerate(run):
        place = len(lexeme.words) == 1 and {*lexeme.words} & places() and lexeme.role in _SMALL
        called = lexeme.part and lexeme.role not in _OWN
        role = "word" if place or called else lexeme.role
        if role == "degree":
            degree = lexeme.value
        elif role == "fake" or (role == "look" and not out and _is_material(run[i + 1 : i + 2])):
            fake = True  # "imitation ivory"
        elif role == "material" and lexeme.names and len(lexeme.words) > 1:
            # "cardboard box" of a part "box", "spring steel" of a spring: the phrase names the
            # matter, one word of it the part.
            out.append(Mention("material", replace(lexeme, part=False), lexeme.value))
            out.append(Mention("part", replace(lexeme, words=lexeme.names)))
        elif role == "material":
            # Or the part that is called after one: "loose soil", "the glass is sapphire"
            others = any(x.role == "material" for x in run if x is not lexeme)
            alone = not any(x.role == "word" for x in run if x is not lexeme)
            owed = owes and not any(x.text.lower() == "the" for x in run[:i])
            if lexeme.part and not owed and (others or alone or run[-1] is lexeme):
                out.append(Mention("part", lexeme, None if others else lexeme.value))
            else:
                out.append(Mention("coating" if fake else "material", lexeme, lexeme.value))
            fake = False
        elif role == "coat" and puts_hue(lexeme, [m.value for m in out[-1:]], run[i + 1 : i + 2]):
            fake = True
        elif role in ("coat", "coating", "look", "attributes", "fill"):
            # It turns the material before it into what it is there for, or goes: "powder-coated"
            last = out[-1] if out else None
            if last and last.kind == "material":
                before = any(m.kind == "material" for m in out[:-1])  # "CuSn6 gold plated"
                bears = {*lexeme.words} & {*words()["implied"]}  # "laiton chromé": on brass
                if not bears and (role != "coat" or len(out) == 1 or before or i + 1 < len(run)):
                    out[-1] = replace(last, kind="filling" if role == "fill" else "coating")
            elif last and not last.says and not last.lexeme.part:
                if lexeme.start - last.lexeme.end <= 1:
                    out.pop()
        elif role == "density" and lexeme.text.lower() == "light" and is_hue(run[i + 1 : i + 2]):
            continue  # "light oak", "light grey"
        elif role in ("stiffness", "density", "character"):
            level = lexeme.value
            if isinstance(level, int) and degree == "more":  # outwards: "very soft"
                level = max(1, level - 1) if level < 3 else min(5, level + 1)
            out.append(Mention("level", lexeme, (role, level)))
            degree = ""
        elif role in ("number", "compare"):
            out.append(Mention("number", lexeme, lexeme.value))
        elif role in ("word", "part"):
            out.append(_word(lexeme, run, i))
        elif (
            role == "digits"
            and lexeme.part
            and (
                (out and out[-1].lexeme.part)
                or (
                    not any(x.words for x in run[i + 1 :] if x.role == "word")
                    and not any(x.part for x in run[i + 1 :])
                )
            )
        ):
            out.append(Mention("part", lexeme))  # "gear 3" of a part "gear3", "gears 1 and 2"
        elif counted_by(lexeme.text) is not None and not _hyphened(run, i):
            out.append(Mention("modifier", replace(lexeme, words=())))  # "three legs"
        elif role == "empty" and not any(m.kind in _SAYING for m in out[-2:]):
            out.append(Mention("part" if i + 1 == len(run) else "modifier", lexeme))
    return out


def _is_material(lexemes: Sequence[Lexeme]) -> bool:
    return any(x.role == "material" for x in lexemes)


def _word(lexeme: Lexeme, run: list[Lexeme], i: int) -> Mention:
    """A part's word, a modifier, or a name that nobody knows beside a part of the asset."""
    plain = replace(lexeme, words=())
    after = next((x for x in run[i + 1 :] if x.role != "hyphen"), None)
    if not lexeme.part and {*lexeme.words} & places():
        if after and (after.part or {*after.words} & places()):
            return Mention("modifier", lexeme)  # "back left leg", "back-left leg"
        if i and run[i - 1].role == "material" and {*lexeme.words} & known_parts():
            return Mention("part", lexeme)  # "a leather back", whatever its tag
    strange = not lexeme.known
    compound = _hyphened(run, i) and i + 1 < len(run)
    if not lexeme.part and (compound or (strange and lexeme.text.lower().endswith("ed"))):
        return Mention("modifier", plain)  # "hot-dip", "rotomoulded"
    if lexeme.part or strange or lexeme.tag.startswith(("NN", "FW", "XX", "ADD")):
        others = [x for x in run if x is not lexeme]
        beside = any(x.part for x in others) and not any(x.role == "material" for x in others)
        return Mention("unknown" if strange and beside else "part", lexeme)
    is_adjective = lexeme.tag.startswith(("JJ", "CD", "V", "RP"))
    return Mention("modifier", lexeme if is_adjective else plain)


def _hyphened(run: list[Lexeme], i: int) -> bool:
    return any(x.role == "hyphen" for x in run[max(i - 1, 0) : i + 2])


def _one_material(mentions: list[Mention], lexicon: ReaderLexicon) -> list[Mention]:
    """Of materials side by side keep the one that is meant: "ABS plastic", "walnut MDF"."""
    out: list[Mention] = []
    for mention in mentions:
        last = next((m for m in reversed(out) if m.kind not in ("modifier", "level")), None)
        if mention.kind == "material" and last is not None and last.kind == "material":
            if lexicon.repeats(mention.value, mention.lexeme.words, last.value):
                out.append(replace(mention, kind="kin", value=None))
                continue
            # The later of two is the head; what the other says is told, but "steel St37".
            repeats = lexicon.repeats(last.value, last.lexeme.words, mention.value)
            # Or says more of it: "beech ply", "music wire A228", a colour.
            beside = mention.lexeme.start - last.lexeme.end <= 1
            alike = last.value.category == mention.value.category and beside
            hue = last.lexeme.text.lower() in words()["hues"]["colours"]
            kin = repeats or alike or hue
            out[out.index(last)] = replace(last, kind="kin" if kin else "left", value=None)
        out.append(mention)
    return out


def _group(parts: list[Mention], values: list[Mention], *, part_first: bool = False) -> Group:
    nouns = [m for m in parts if m.kind == "part"]
    own = [replace(m, kind="material") for m in nouns if isinstance(m.value, Material)]
    return Group(
        part=tuple(word for m in parts for word in m.lexeme.words),
        values=[m for m in values if m.says] or own,
        lexemes=[m.lexeme for m in (*parts, *values)],
        named=any(m.lexeme.part for m in parts),
        part_first=part_first,
        own=bool(own) and not any(m.says for m in values),
    )


# Drafts of clauses: what is said of one subject while a text is read, and what it becomes.

SURE, MENDED = 1.0, 0.8  # certainty: as it stands; with something mended, guessed or left out
_BEFORE = 30  # letters before a matter that may hold its state: "rusty galvanised steel"
_HEDGE, _OPEN, _REQUEST = (
    re.compile(words()["hedges"][kind]) for kind in ("hedge", "open", "request")
)
_LISTS = ("character", "numbers", "comparisons")  # fields that a clause has from its draft
_SAME = ("phrase", "kind", "coating", "filling", "blend")
_SAYS = ("material", "unknown", "excluded", "levels", *_LISTS, "coating", "filling", "blend")
_ENDING = ("comma", "stop", "and", "close", "open", "is", "but")
_NAMING = ("word", "part", "digits", "told", "sign", "hyphen", "idle", "size", "empty")


@dataclass(eq=False)
class Draft:
    """A clause in the making: its subject and what was said of it up to here."""

    scope: Scope = "none"
    names: list[Phrase] = field(default_factory=list)
    exceptions: list[Phrase] = field(default_factory=list)
    named: bool = False  # a part of the asset is called so
    count: int | None = None  # how many of its kind, 0 for some
    holds: bool = False  # it has parts, by what is said: "a bookcase with ..."
    mixed: bool = False  # numbers or strange words stand beside its name
    own: bool = False  # its matter is but what its name says: "bones", "glass"
    article: bool = False  # "a", "the", "its" stands before it
    material: Material | None = None
    phrase: str = ""
    kind: str | None = None
    unknown: str = ""
    excluded: list[str] = field(default_factory=list)
    levels: dict[str, Any] = field(default_factory=dict)
    character: list[str] = field(default_factory=list)
    numbers: list[Quantity] = field(default_factory=list)
    comparisons: list[Comparison] = field(default_factory=list)
    coating: str | None = None
    filling: str | None = None
    blend: Blend | None = None
    same: Phrase | None = None  # the other part whose matter it has; () for the one before
    left: list[str] = field(default_factory=list)  # words that say a matter and were not taken
    notes: list[str] = field(default_factory=list)  # on numbers beside it that are not used
    loose: list[str] = field(default_factory=list)  # nouns before its matter
    lexemes: list[Lexeme] = field(default_factory=list)

    def take(self, mention: Mention, lexicon: ReaderLexicon) -> None:
        """Take what a mention says."""
        value = mention.value
        if isinstance(value, Material):
            kind = lexicon.kinds.get(" ".join(mention.lexeme.words))
            if mention.kind in ("coating", "filling"):
                setattr(self, mention.kind, value.name)
            elif self.material is None or self.kind:
                self.material, self.kind, self.phrase = value, kind, mention.lexeme.text
        elif isinstance(value, Comparison):
            self.comparisons.append(value)
        elif isinstance(value, Quantity):
            self.numbers.append(value)
        elif isinstance(value, Blend):
            self.blend = value
        elif isinstance(value, tuple):
            role, level = value
            bends = mention.lexeme.text.lower() in words()["bending"]["words"]
            self.character += [level] if role == "character" else ["flexible"] if bends else []
            if role != "character":
                self.levels.setdefault(role, level)
        elif mention.kind == "unknown":
            self.unknown = f"{self.unknown} {mention.lexeme.text}".strip()
        elif mention.kind == "left":
            self.left.append(mention.lexeme.text)

    def add(self, other: Draft, *, instead: bool = False) -> None:
        """Take what another says of the same; its matter ``instead`` of the own."""
        if other.material and self.material and not (self.kind or self.own or instead):
            another = other.phrase and other.material is not self.material
            self.left += [other.phrase] if another else []
        elif other.material:
            self.material, self.kind, self.phrase = other.material, other.kind, other.phrase
            self.own = other.own
        for name in ("excluded", "character", "numbers", "comparisons", "left"):
            getattr(self, name).extend(getattr(other, name))
        self.left += other.loose
        self.levels = {**other.levels, **self.levels}
        for name in ("coating", "filling", "blend", "unknown"):
            setattr(self, name, getattr(self, name) or getattr(other, name))
        self.same = other.same if self.same is None else self.same

    def rule_out(self, lexicon: ReaderLexicon) -> None:
        """Turn what is said into what is not: "not steel" and none of its kin, "not soft"."""
        if self.material:
            self.excluded += (
                [self.kind] if self.kind else lexicon.family(self.material, self.phrase)
            )
        self.levels = {k: 2 if v > 3 else 4 for k, v in self.levels.items()}
        self.material, self.kind, self.phrase, self.character, self.unknown = None, None, "", [], ""

    def owned_by(self, other: Draft) -> None:
        """Put the owner before a name: "the top of the table" is the table's top."""
        self.names[-1:] = [(*other.names[-1], *name) for name in self.names[-1:]]
        self.named = self.named or other.named

    def rename(self, other: Draft) -> None:
        """Speak of what another names, and take what is said of that."""
        self.scope, self.names, self.named = "parts", other.names, other.named
        self.add(other)

    def like(self, other: Draft) -> None:
        """Take the matter of another; its own kind must not be against it."""
        # "The same stuff, just orange", "the same alloy"
        bare = self.phrase.lower() in (*words()["hues"]["colours"], *words()["attributes"]["empty"])
        if self.kind and self.material and other.material:
            if other.material.category != self.material.category:
                return
        elif self.material and not bare:
            return
        self.material, self.phrase, self.kind = other.material, other.phrase, other.kind
        self.levels = {**other.levels, **self.levels}
        own = {"mass", *(q.measure for q in self.numbers)}
        self.numbers += [q for q in other.numbers if q.measure not in own]
        self.blend, self.unknown = self.blend or other.blend, self.unknown or other.unknown

    @property
    def says(self) -> bool:
        """Whether anything was said."""
        return self.same is not None or any(getattr(self, name) for name in _SAYS)

    @property
    def said(self) -> list[str]:
        """All words that were said of it, without plurals."""
        return [word for x in self.lexemes for word in x.words]

    def compare_with(self, part: Phrase) -> None:
        """Say which part the last comparison is with."""
        if self.comparisons:
            self.comparisons[-1] = replace(self.comparisons[-1], other=part)


def take_caption(drafts: list[Draft], lexemes: Sequence[Lexeme]) -> None:
    """Give a thing "of" what it shows the matter that comes next: "head of a horse. Marble."""
    for head, after in pairwise([*drafts]):
        shows = head.named and head.unknown and not (head.material or head.numbers)
        if not (shows and after.material and after.scope == "none" and not after.named):
            continue
        first, last = head.lexemes[0].start, min(x.start for x in after.lexemes)
        span = [x for x in lexemes if first < x.start < last]
        of = any(x.role == "of" or x.text in ("a", "an", "the") for x in span)
        if of and span[-1].role in ("stop", "comma") and not any(x.role == "is" for x in span):
            head.unknown = ""
            head.add(after)
            head.lexemes += after.lexemes
            drafts.remove(after)


def settle(drafts: list[Draft], lexed: Lexed) -> None:
    """Give drafts that are "the same as" others the matter of these."""
    for i, draft in enumerate(drafts):
        if draft.same is None:
            continue
        before = [*reversed(drafts[:i]), *drafts[i + 1 :]]
        others = [d for d in before if d.material or d.levels or d.numbers]
        head = draft.same[-1:]
        called = [d for d in others if any(name[-1:] == head for name in d.names)]
        if head and not called and draft.names:  # "right bracket: same as left"
            own = {*draft.same, draft.names[0][-1]}
            called = [d for d in others if any(own <= {*name} for name in d.names)]
        alike = called if head else others[:1]
        if not alike and draft.material and head:  # "the lid is oak like the box"
            draft.names.append(draft.same)
        elif not alike:
            who = " ".join(draft.same) or Note("reader.came_before")
            draft.unknown = draft.unknown or " ".join(draft.same)
            lexed.notes.append(Note("reader.same_nothing", who=who))
        for other in alike:
            draft.like(other)


def take_values(drafts: Sequence[Draft]) -> None:
    """Give parts what is said of their matter alone: "Steel: 205 GPa. Frame steel, lid oak"."""
    for one, two in pairwise([*drafts, Draft()]):
        apart = bool(two.numbers and not (two.material or two.names))
        values = one.numbers or two.numbers * apart
        alone = one.material and one.scope == "none"
        if alone and {"E", "rho"} & {q.measure for q in values}:
            for draft in drafts:
                if draft.names and draft.material is one.material and not draft.numbers:
                    draft.numbers += values


def _filled(drafts: Sequence[Draft], names: Sequence[str], lexicon: ReaderLexicon) -> list[Draft]:
    """Give what fills a thing to the part that is called its filling: "a bear full of wool"."""
    spoken = {name[-1] for draft in drafts for name in draft.names if name}
    inner = {*words()["containers"]["inside"]} - spoken
    called = [own for own in map(part_name_words, names) if own and own[-1] in inner]
    filled = [draft for draft in drafts if draft.filling]
    if not called or len(filled) != 1:
        return []
    loose = re.sub(r" \(.*", "", filled[0].filling or "")
    row = lexicon.first_row([filled[0].filling or "", loose, f"{loose} stuffing"])
    return [
        Draft(
            "parts", called, named=True, material=row, phrase=loose if row else "",
            unknown="" if row else loose, lexemes=filled[0].lexemes,
        )
    ]  # fmt: skip


def take_state(draft: Draft, lexemes: Sequence[Lexeme], lexicon: ReaderLexicon) -> None:
    """Take for a food what it is by its state: "the potato is boiled", "the carrot is raw"."""
    own = (draft.material.name, *draft.material.aliases) if draft.material and draft.own else ()
    if not draft.named or (draft.material and not own) or draft.unknown or not draft.lexemes:
        return
    called = {*draft.names, *map(lexicon.phrase, own)}
    after = (x for x in lexemes if x.start >= draft.lexemes[0].start)
    for word in takewhile(lambda x: x.role not in ("stop", "comma"), after):
        for name in called if word.role == "word" else ():
            raw = word.text.lower() in ("raw", "uncooked")
            row = lexicon.rows.get(name if raw else (word.text.lower(), *name))
            if row:
                draft.material, draft.own = row, False
                draft.phrase = " ".join((word.text, *name))
                draft.left = [said for said in draft.left if said != word.text]
                draft.lexemes.append(word)
                return


def take_strange(draft: Draft, lexemes: Sequence[Lexeme]) -> None:
    """Take for an unknown matter what may be one of a mute part: "horsehair tail", "pin QT-500"."""
    ordinary, start = known_parts() | places(), draft.lexemes[0].start
    before = [
        noun for noun, part in pairwise(draft.lexemes)
        if part.part and not noun.part and (noun.role, noun.tag) == ("word", "NN")
        and not {*noun.words} & ordinary
    ]  # fmt: skip
    here = takewhile(lambda x: x.role in _NAMING, (x for x in lexemes if x.start >= start))
    last = max(x.start for x in draft.lexemes if x.part)
    codes = [x for x in here if x.is_code or (x.start > last and x.is_name and not x.part)]
    after = [x for x in lexemes if x.start > last]
    made = list(takewhile(lambda x: x.role not in ("stop", "comma"), after))
    of = next((k for k, x in enumerate(made) if x.role == "of"), None)
    if of is not None and not any(x.part or x.role in ("number", "material") for x in made):
        codes += [x for x in made[of + 1 :] if x.role in ("word", "empty")]  # "of stuff from ..."
    draft.unknown = " ".join(dict.fromkeys(x.text for x in (*before, *codes)))
    if draft.unknown:
        draft.names = [tuple(w for x in draft.lexemes if x.part for w in x.words)]


def _tell_compounds(lexemes: Sequence[Lexeme], drafts: Sequence[Draft]) -> None:
    """Tell nouns behind a matter that make another of it and that nothing took: "walnut burl"."""
    plain = {*part_words()["objects"], *known_parts(), *places(), *words()["attributes"]["empty"]}
    owners = {x.end: draft for draft in drafts for x in draft.lexemes if x.role == "material"}
    for before, matter, noun, after in zip(
        [None, *lexemes], lexemes, lexemes[1:], [*lexemes[2:], None], strict=False
    ):
        # "a steel dowel" is a thing of steel
        thing = before is not None and before.text.lower() in ("a", "an")
        owner = owners.get(matter.end) if noun.start == matter.end + 1 and not thing else None
        ends = after is None or after.role in _ENDING or not after.words
        if owner and ends and noun.role == "word" and noun.tag[:2] in ("NN", "VB"):
            if not (noun.part or {*noun.words} & plain or noun in owner.lexemes):
                owner.left.append(noun.text)


def is_mixed(run: Sequence[Lexeme]) -> bool:
    """Whether more than a part's name stands in a run, as an unread matter after it does."""
    last = max((x.start for x in run if x.part), default=sys.maxsize)
    return any(x.is_code or (x.start > last and x.is_name) for x in run)


def unread_lexemes(
    drafts: Sequence[Draft], lexed: Lexed, dropped: Sequence[Lexeme]
) -> tuple[Lexeme, ...]:
    """Materials, numbers and strange words that no clause took."""
    # A strange word is taken where it is told with its clause; as a mere name it is not.
    taken = [
        x for draft in drafts for x in draft.lexemes
        if x.text in draft.unknown
        or ((x.known or x.part or x.role != "word" or draft.material) and not x.is_measure)
    ]  # fmt: skip
    taken += dropped
    spoken = {word for draft in drafts for name in draft.names for word in name}
    return tuple(
        x for x in lexed.lexemes
        if (x.role in ("number", "told", "material") or not x.known or x.is_measure)
        and not any(y.start <= x.start < y.end for y in taken)
        and not (x.part and set(x.words) <= spoken)  # "the soil is moist soil"
    )  # fmt: skip


def tell(unread: Sequence[Lexeme], drafts: Sequence[Draft], lexemes: Sequence[Lexeme]) -> None:
    """Tell what is unread with the statement that it stands in or after, else with the next."""
    begins = [(min(x.start for x in d.lexemes), d) for d in drafts if d.lexemes]
    begins.sort(key=itemgetter(0))
    stops = [x.start for x in lexemes if x.role == "stop"]
    for lexeme in unread:
        start = max((at for at in stops if at < lexeme.start), default=-1)
        end = min((at for at in stops if at > lexeme.start), default=sys.maxsize)
        near = [(at, d) for at, d in begins if start < at < end]
        before = [d for at, d in near if at <= lexeme.start]
        for draft in before[-1:] or [d for _, d in near[:1]]:
            draft.notes += [lexeme.note] if lexeme.note else []
            draft.left += [] if lexeme.note else [lexeme.text]


def clause_of(text: str, draft: Draft, lexicon: ReaderLexicon, spoken: set[str]) -> Clause:
    """Return the clause that a draft has become; ``spoken`` words tell in which sense it is."""
    start = min((x.start for x in draft.lexemes), default=0)
    end = max((x.end for x in draft.lexemes), default=0)
    names = tuple(dict.fromkeys(name for name in draft.names if name))
    liquid = lexicon.contents_called(draft.unknown.lower().split())
    said = draft.unknown.lower()
    if not draft.material and lexicon.needs_capitals(lexicon.phrase(said) or ("",)):
        draft.material, draft.phrase = lexicon.rows[lexicon.phrase(said)], draft.unknown  # "pp"
    noun = lexicon.model.is_word(said, ("noun",)) and lexicon.model.singular(said) == said
    noun = noun and not said.endswith("sss")  # "brasss"
    meant = lexicon.meant(said) if not (draft.material or liquid or noun) else ()
    if meant and len(draft.unknown) > SHORT:
        draft.material, draft.phrase = lexicon.rows[meant], meant[0]
        draft.notes.append(Note("lexing.spelt", word=draft.unknown, near=meant[0]))
    heads = {name[-1] for name in names}
    for sense in words()["sense"]:
        near = heads & {*sense.get("things", ())} or {*sense.get("text", ())} & spoken
        if draft.material and near and draft.phrase.lower() == sense["word"]:
            draft.material = lexicon.first_row([sense["row"]]) or draft.material
    # What of a draft was guessed or left out
    strange = [
        x.text for x in draft.lexemes
        if x.role == "word" and not (x.known or x.part or x.text in draft.unknown)
        and not x.text.endswith("ed")  # a treatment that no dictionary has: "rotomoulded"
    ]  # fmt: skip
    left = [*draft.left, *strange * bool(draft.material)]
    # Beside a matter by its own name a code, a brand or a treatment changes nothing; not so where
    # that name was mended, or is a family's with the word before it: "brondium alloy"
    mended = any(getattr(x.note, "kind", "") == "lexing.spelt" for x in draft.lexemes)
    row = None if draft.kind or mended else draft.material
    head = draft.phrase if row and not row.grade and " " not in draft.phrase else ""
    idle = [
        word for word in left
        if row and not lexicon.rows.get(lexicon.phrase(word))
        and not (head and word.isalpha() and re.search(rf"{word}[ -]{re.escape(head)}", text))
        and word not in words()["states"]["words"] and not lexicon.model.is_noun(word.lower())
    ]  # fmt: skip
    # Nor do other words for what was taken: "POM (black acetal)"
    left = [x for x in left if x not in idle and not (row and lexicon.row_called(x) is row)]
    told = [Note("reader.beside_left", word=word) for word in left]
    if idle:
        said = ", ".join(map(repr, dict.fromkeys(idle)))
        told.append(Note("reader.beside_idle", words=said, phrase=draft.phrase))
    if draft.material:
        states = {*words()["states"]["words"]} - lexicon.row_words(draft.material)
        at = next((x.start for x in draft.lexemes if x.text == draft.phrase), 0)
        before = text[max(at - _BEFORE, 0) : at].lower()
        stands = r"\b[ ,]+(?!rolled|dip|forged|worked|formed|pressed)(?:\w+ )?$"
        states = {word for word in states if word in before}
        said = [word for word in sorted(states) if re.search(rf"\b{word}{stands}", before)]
        told += [Note("reader.used_values", word=word, phrase=draft.phrase) for word in said]
    after = re.split(r"[;.\n]", text[end:])[0]
    opened, sentence = _OPEN.search(after), re.split(r"[.!?;\n]\s", text[:end])[-1]
    if opened and opened[0].endswith("?") and _REQUEST.search(sentence):
        opened = None
    hedge = _HEDGE.search(text[start:end] + after[:_BEFORE]) or opened
    if draft.material and hedge:
        told.append(Note("reader.unsure", hedge=hedge[0].strip(), phrase=draft.phrase))
    noted = [x.note for x in draft.lexemes if x.note]
    unknown, doubts = (
        "" if draft.material else draft.unknown,
        tuple(dict.fromkeys([*noted, *draft.notes, *told])),
    )
    scope = "none" if draft.scope == "parts" and not names else draft.scope
    same: dict[str, Any] = {name: getattr(draft, name) for name in _SAME}
    same |= {name: tuple(dict.fromkeys(getattr(draft, name))) for name in _LISTS}
    return Clause(
        text[start:end],
        (start, end),
        Subject(scope, names, tuple(draft.exceptions), draft.holds, draft.count),
        draft.material.name if draft.material else None,
        unknown=unknown,
        nearest=lexicon.nearest(unknown),
        stiffness=draft.levels.get("stiffness"),
        density=draft.levels.get("density"),
        excluded=tuple(x for x in draft.excluded if not draft.material or x != draft.material.name),
        doubts=doubts,
        certainty=MENDED if doubts else SURE,
        **same,
    )


def _first_phrase(lexemes: Sequence[Lexeme], stops: Collection[str]) -> Phrase:
    """Words of the first noun phrase, up to one that joins: "this is a can of ..." is "a can".

    What a participle says of the noun before it comes first: "a ball inflated with ...".
    """
    phrase, noun = list[str](), False
    for lexeme, after in zip(lexemes, [*lexemes[1:], None], strict=False):
        before = lexeme.role == "coat" and not noun  # "a painted drum"
        if lexeme.role in stops and not before:
            if phrase and phrase[-1] != "image":  # "an image of a chair"
                break
            phrase = []
        elif noun and lexeme.tag in ("VBN", "VBG") and after and after.tag == "IN":
            return (*lexeme.words, *phrase)
        else:
            phrase += lexeme.words
            noun = noun or lexeme.tag.startswith("NN")
    return tuple(phrase)


def _implied(run: Sequence[Lexeme], lexicon: ReaderLexicon) -> list[tuple[Lexeme, Material]]:
    """The metal that a treatment speaks of: "galvanised" is steel, until another is named."""
    rows = ((x, words()["implied"].get(x.text.lower())) for x in run if x.role == "coat")
    return [
        (replace(x, words=("metal",)), lexicon.table.exact(row))
        for x, row in rows
        if row in lexicon.table.phrases
    ][:1]
