"""The reader: a text to a Sentence, once.

Its lexemes are joined to tokens (a part, what is said of one, or both, and what stands between
them), the grammar joins these to statements, and each statement becomes a clause.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise, takewhile

from ...fem.errors import UsageError
from ...fem.scene.materials import MaterialTable
from .clauses import Clause, Sentence, Subject
from .grammar import Cascade, Draft, Token, grammar
from .groups import Group, groups_of
from .lexicon import Phrase, ReaderLexicon, known_parts, lexicon_of, places, words
from .lexing import Lexed, Lexeme, lex
from .phrases import bare_numbers, first_phrase, join_comparisons

LONGEST = 4000  # characters: a page of notes; a book is a mistake
SURE, MENDED = 1.0, 0.8  # certainty: as it stands; with something mended, guessed or left out
_GROUPED = (
    "word", "material", "part", "number", "stiffness", "density", "character", "degree", "fake",
    "coat", "coating", "look", "attributes", "empty", "compare", "idle", "factors", "vague",
    "digits", "size", "told", "sign", "hyphen", "nobody", "all",
)  # fmt: skip
_NAMING = ("is", "of", "word", "part", "digits", "told", "sign", "hyphen", "idle", "size", "empty")


def parse(text: str, table: MaterialTable, names: Sequence[str] = ()) -> Sentence:
    """Return what a text says of materials, read once.

    Parameters
    ----------
    text
        Plain English, as a sentence, a list, a table or a note.
    table
        Whose rows are materials.
    names
        What the asset calls its parts: a word of theirs is a part before it is a material.

    Raises
    ------
    UsageError
        Where the text is longer than ``LONGEST`` characters.
    InputError
        Where the English model is not installed.
    """
    if len(text) > LONGEST:
        raise UsageError(f"the text has {len(text)} characters: at most {LONGEST} are read")
    lexicon = lexicon_of(table)
    lexed = lex(text, lexicon, names)
    lexed.lexemes = bare_numbers(lexed.lexemes)
    cascade = Cascade(list(_tokens(join_comparisons(lexed.lexemes), lexicon)), lexicon)
    left = cascade.run()
    told = {name for draft in left if draft.says for name in draft.names}
    for draft in left:
        if draft.named and not draft.says and not told & {*draft.names}:
            _take_strange(draft, lexed.lexemes)
    drafts = [draft for draft in left if draft.says]
    _settle(drafts, lexed)
    return Sentence(
        text,
        tuple(_clause(text, draft, lexicon) for draft in drafts),
        _unread(drafts, lexed, cascade.dropped),
        tuple(dict.fromkeys([*lexed.notes, *(x.note for x in lexed.lexemes if x.note)])),
        first_phrase(lexed.lexemes, {*grammar()["signs"], "sign"} - {"word"}),
    )


def _tokens(lexemes: Sequence[Lexeme], lexicon: ReaderLexicon) -> Iterator[Token]:
    """Cut lexemes into connectors and the runs between them, and these into groups."""
    signs, before, last, at, draft = grammar()["signs"], "", (), 0, Draft()
    while at < len(lexemes):
        end = _run_end(lexemes, at, before)
        after = signs.get(lexemes[end].role, "") if end < len(lexemes) else ""
        if end > at:
            for token in _groups(lexemes[at:end], lexicon, before, after, last):
                draft = token.draft or draft
                last = draft.names[-1] if draft.names else last
                before = ""
                yield token
            at = end
            if end < len(lexemes) and _is_grouped(lexemes, end, at):
                yield Token(".")
            continue
        lexeme = lexemes[at]
        sign = signs.get(lexeme.role, "p")
        if sign == "W":
            yield Token("W", Draft("rest" if lexeme.role == "rest" else "whole", lexemes=[lexeme]))
        elif sign == "O":
            yield Token("O", Draft("parts", [("other", *last[-1:])]))
        elif sign == "m":
            yield Token("m", Draft(same=()))
        elif sign == "t":
            yield Token("t", Draft("whole"))
        else:
            draft.holds = draft.holds or sign == "w"
            yield Token(sign)
        before, at = sign, at + 1


def _run_end(lexemes: Sequence[Lexeme], at: int, before: str) -> int:
    """Where a run of grouped lexemes ends; "the legs are oak the seat is foam" are two."""
    end = at
    while end < len(lexemes) and _is_grouped(lexemes, end, at):
        after = lexemes[end + 1].role if end + 1 < len(lexemes) else ""
        owed = before == "=" and any(x.role == "material" for x in lexemes[at:end])
        if owed and lexemes[end].part and after == "is":
            break
        end += 1
    return end


def _is_grouped(lexemes: Sequence[Lexeme], i: int, start: int) -> bool:
    """Whether a lexeme is of a group; a verb is, as the participle before a noun."""
    lexeme, run = lexemes[i], lexemes[start:i]
    role = lexemes[i + 1].role if i + 1 < len(lexemes) else ""
    if lexeme.part and lexeme.role not in ("is", "of", "and", "comma"):
        return True
    if lexeme.text.lower() in words()["conditions"]["words"] and role in ("material", "word"):
        return True
    if lexeme.role == "fill":  # "foam-filled"
        close = bool(run) and run[-1].role in ("material", "hyphen")
        return close and lexeme.text.lower() in ("filled", "stuffed")
    if lexeme.role == "coat" and role in ("with", "of"):
        return bool(run) and run[-1].end == lexeme.start  # "leather-covered in ..."
    if lexeme.role == "word" and lexeme.tag.startswith("V") and lexeme.known:
        return bool(run) and lexeme.dep == "amod" and role in ("material", "word")
    return lexeme.role in _GROUPED


def _groups(
    run: Sequence[Lexeme], lexicon: ReaderLexicon, before: str, after: str, last: Phrase
) -> Iterator[Token]:
    """Tokens of a run, ``before`` and ``after`` which signs stand."""
    opens = after in ("=", "o") or before in ("x", "F")
    owes = before in tuple("=o^cf!mTAW~") and not opens
    if any(x.text.lower() in ("whole", "entire") for x in run):
        run = [x for x in run if x.role != "word" or x.part]
        yield Token("W", Draft("whole"))
    for group in groups_of(run, lexicon, owes=owes, opens=opens):
        part = _full_name(group, last)
        if part and part[-1] in words()["attributes"]["matter"] and after == "=":
            part = part[:-1]
            if not part:
                yield Token("W", Draft("whole", lexemes=group.lexemes))
                continue
        if (
            part
            and group.values
            and before == "=" == after
            and group.named
            and not group.part_first
        ):
            said = [m.lexeme for m in group.values]
            yield _token(replace(group, part=(), lexemes=said), lexicon, last)
            group = replace(group, values=[])
        token = _token(replace(group, part=part), lexicon, last)
        if token.draft and token.sign in "Ss":
            token.draft.mixed = any(not x.part and _is_code(x) for x in run)
        yield token
        last = part or last


def _full_name(group: Group, last: Phrase) -> Phrase:
    """A number or a side alone has the noun that came before it: "leg 1, 2", "the second"."""
    if last and group.part and all(word.isdigit() for word in group.part):
        return (*(word for word in last if not word.isdigit()), *group.part)
    side = group.part[-1:] and group.part[-1] in places() and not group.named
    own = bool(group.values) and group.part[-1:] and group.part[-1] in known_parts()
    if last and side and not own:  # "a glass top" is a part of its own
        return (*group.part, last[-1])
    return group.part


def _token(group: Group, lexicon: ReaderLexicon, last: Phrase) -> Token:
    """A group as a token: S a part, V what is said, N that without a matter, B and P both."""
    draft = Draft("parts" if group.part else "none", [group.part] if group.part else [])
    draft.named, draft.lexemes = group.named, list(group.lexemes)
    draft.article = any(x.tag in ("DT", "PRP$") for x in group.lexemes)
    draft.holds = group.is_thing and not (last and group.values)
    for mention in group.values:
        draft.take(mention, lexicon)
    draft.loose = group.modifiers
    if not group.part:
        return Token("V" if draft.material or draft.unknown else "N", draft)
    sign = "S" if not group.values else "P" if group.part_first else "B"
    return Token(sign if group.named else sign.lower(), draft)


def _settle(drafts: list[Draft], lexed: Lexed) -> None:
    """Give drafts that are "the same as" others the matter of these."""
    for i, draft in enumerate(drafts):
        if draft.same is None:
            continue
        others = [d for d in (*reversed(drafts[:i]), *drafts[i + 1 :]) if d.material or d.levels]
        head = draft.same[-1:]
        alike = (d for d in others if not head or any(name[-1:] == head for name in d.names))
        found = next(alike, None)
        if found is None:
            who = " ".join(draft.same) or "what came before"
            lexed.notes.append(f"'the same as {who}': nothing is said of it")
        else:
            draft.like(found)


def _take_strange(draft: Draft, lexemes: Sequence[Lexeme]) -> None:
    """Take for an unknown matter what may be one of a mute part: "horsehair tail", "pin QT-500"."""
    ordinary, start = known_parts() | places(), draft.lexemes[0].start
    before = [
        noun for noun, part in pairwise(draft.lexemes)
        if part.part and not noun.part and (noun.role, noun.tag) == ("word", "NN")
        and not {*noun.words} & ordinary
    ]  # fmt: skip
    here = takewhile(lambda x: x.role in _NAMING, (x for x in lexemes if x.start >= start))
    codes = [x for x in here if not x.part and _is_code(x)]
    draft.unknown = " ".join(dict.fromkeys(x.text for x in (*before, *codes)))
    if draft.unknown:
        draft.names = [tuple(w for x in draft.lexemes if x.part for w in x.words)]


def _is_code(lexeme: Lexeme) -> bool:
    return not lexeme.known or lexeme.role in ("digits", "told")


def _unread(drafts: Sequence[Draft], lexed: Lexed, dropped: Sequence[Lexeme]) -> Phrase:
    """Materials, numbers and strange words that no clause took."""
    # A strange word is taken where it is told with its clause; as a mere name it is not.
    taken = [
        x for draft in drafts for x in draft.lexemes
        if x.text in draft.unknown
        or ((x.known or x.part or x.role != "word" or draft.material) and not _is_measure(x))
    ]  # fmt: skip
    taken += dropped
    spoken = {word for draft in drafts for name in draft.names for word in name}
    return tuple(
        x.text for x in lexed.lexemes
        if (x.role in ("number", "told", "material") or not x.known or _is_measure(x))
        and not any(y.start <= x.start < y.end for y in taken)
        and not (x.part and set(x.words) <= spoken)  # "the soil is moist soil"
    )  # fmt: skip


def _is_measure(lexeme: Lexeme) -> bool:
    """Whether a bare number counts nothing: "0.33"."""
    return lexeme.role == "digits" and not lexeme.part and not lexeme.text.isdigit()


def _doubts(draft: Draft) -> tuple[str, ...]:
    """What of a draft was guessed or left out."""
    strange = (
        x.text for x in draft.lexemes
        if x.role == "word" and not (x.known or x.part or x.text in draft.unknown)
        and not x.text.endswith("ed")  # a treatment that no dictionary has: "rotomoulded"
    )  # fmt: skip
    left = [*draft.left, *(strange if draft.material else ())]
    told = [f"{word!r} beside it is left out" for word in left]
    return tuple(dict.fromkeys([*(x.note for x in draft.lexemes if x.note), *told]))


def _clause(text: str, draft: Draft, lexicon: ReaderLexicon) -> Clause:
    start = min((x.start for x in draft.lexemes), default=0)
    end = max((x.end for x in draft.lexemes), default=0)
    names = tuple(dict.fromkeys(name for name in draft.names if name))
    unknown, doubts = "" if draft.material else draft.unknown, _doubts(draft)
    spoken = (x.text.lower() for x in draft.lexemes)
    scope = "none" if draft.scope == "parts" and not names else draft.scope
    return Clause(
        text=text[start:end],
        span=(start, end),
        subject=Subject(scope, names, tuple(draft.exceptions), draft.holds),
        material=draft.material.name if draft.material else None,
        unknown=unknown,
        nearest=lexicon.nearest(unknown),
        stiffness=draft.levels.get("stiffness"),
        density=draft.levels.get("density"),
        character=tuple(dict.fromkeys(draft.character)),
        condition=next((w for w in spoken if w in words()["conditions"]["words"]), ""),
        doubts=doubts,
        certainty=MENDED if doubts else SURE,
        phrase=draft.phrase,
        kind=draft.kind,
        coating=draft.coating,
        filling=draft.filling,
        blend=draft.blend,
        excluded=tuple(draft.excluded),
        numbers=tuple(draft.numbers),
        comparisons=tuple(draft.comparisons),
    )
