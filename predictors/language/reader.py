"""The reader: a text to a Sentence, once.

Its lexemes are joined to tokens (a part, what is said of one, or both, and what stands between
them), the grammar joins these to statements, and each statement becomes a clause.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from ...fem.errors import UsageError
from ...fem.scene.materials import MaterialTable
from ..lexemes.bare_numbers import bare_numbers, lone_grades
from ..lexemes.comparisons import join_comparisons
from ..lexemes.lexeme import Lexeme
from ..lexemes.lexing import lex
from ..lexemes.pointers import first_phrase, point_back
from ..vocabulary.lexicon import Phrase, ReaderLexicon, known_parts, lexicon_of, places, words
from .clauses import Sentence
from .drafts import Draft, clause_of, is_mixed, settle, take_strange, tell, unread_lexemes
from .grammar import Cascade, Constituent, grammar
from .groups import Group, groups_of

LONGEST = 4000  # characters: a page of notes; a book is a mistake
_GROUPED = (
    "word material part number stiffness density character degree fake coat coating look attributes"
    " empty compare idle factors vague digits size told sign hyphen nobody all"
).split()


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
    lexed.lexemes = point_back(lone_grades(bare_numbers(lexed.lexemes)))
    cascade = Cascade(list(_tokens(join_comparisons(lexed.lexemes), lexicon)), lexicon)
    left = cascade.run()
    told = {name for draft in left if draft.says for name in draft.names}
    for draft in left:
        if draft.named and not draft.says and not told & {*draft.names}:
            take_strange(draft, lexed.lexemes)
    drafts = [draft for draft in left if draft.says]
    settle(drafts, lexed)
    unread = unread_lexemes(drafts, lexed, cascade.dropped)
    tell(unread, drafts, lexed.lexemes)
    return Sentence(
        text,
        tuple(clause_of(text, draft, lexicon) for draft in drafts),
        tuple(x.text for x in unread),
        tuple(dict.fromkeys([*lexed.notes, *(x.note for x in lexed.lexemes if x.note)])),
        first_phrase(lexed.lexemes, {*grammar()["signs"], "sign"} - {"word"}),
    )


def _tokens(lexemes: Sequence[Lexeme], lexicon: ReaderLexicon) -> Iterator[Constituent]:
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


def _run_end(lexemes: Sequence[Lexeme], at: int, before: str) -> int:
    """Where a run of grouped lexemes ends; "the legs are oak the seat is foam" are two."""
    end = at
    while end < len(lexemes) and _is_grouped(lexemes, end, at):
        after = lexemes[end + 1].role if end + 1 < len(lexemes) else ""
        owed = before == "=" and any(x.role == "material" for x in lexemes[at:end])
        if owed and after == "is":
            break
        end += 1
    return end


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
        return bool(run) and lexeme.dep == "amod" and role in ("material", "word")
    return lexeme.role in _GROUPED


def _groups(
    run: Sequence[Lexeme], lexicon: ReaderLexicon, before: str, after: str, last: Phrase
) -> Iterator[Constituent]:
    """Tokens of a run, ``before`` and ``after`` which signs stand."""
    opens = after in ("=", "o") or before in ("x", "F")
    owes = before in tuple("=o^cf!mTAW~") and not opens
    said = next((i for i, x in enumerate(run) if x.text.lower() in ("whole", "entire")), None)
    if said is not None:
        if any(x.part for x in run[:said]):
            yield from _groups(run[:said], lexicon, before, "", last)
            run = run[said:]
        run = [x for x in run if x.role != "word" or x.part]
        yield Constituent("W", Draft("whole", lexemes=[x for x in run if x.role == "all"]))
    for group in groups_of(run, lexicon, owes=owes, opens=opens):
        part = _full_name(group, last)
        if part and part[-1] in words()["attributes"]["matter"] and after == "=":
            part = part[:-1]
            if not part:
                yield Constituent("W", Draft("whole", lexemes=group.lexemes))
                continue
        yield _token(replace(group, part=part), lexicon, last, mixed=is_mixed(run))
        last = part or last


def _full_name(group: Group, last: Phrase) -> Phrase:
    """A number or a side alone has the noun that came before it: "leg 1, 2", "the second"."""
    if last and group.part and all(word.isdigit() for word in group.part):
        return (*(word for word in last if not word.isdigit()), *group.part)
    side = group.part[-1:] and group.part[-1] in places() and not group.named
    own = group.values and side and group.part[-1] in known_parts()  # "a glass top"
    return (*group.part, last[-1]) if last and side and not own else group.part


def _token(group: Group, lexicon: ReaderLexicon, last: Phrase, *, mixed: bool) -> Constituent:
    """A group as a token: S a part, V what is said, N that without a matter, B and P both."""
    draft = Draft(
        "parts" if group.part else "none", [group.part] if group.part else [],
        named=group.named, count=group.count, mixed=mixed, own=group.own, loose=group.modifiers,
        article=any(x.tag in ("DT", "PRP$") for x in group.lexemes), lexemes=list(group.lexemes),
        holds=group.is_thing and not (last and group.values),
    )  # fmt: skip
    for mention in group.values:
        draft.take(mention, lexicon)
    if not group.part:
        return Constituent("V" if draft.material or draft.unknown else "N", draft)
    sign = "S" if group.own or not group.values else "P" if group.part_first else "B"
    return Constituent(sign if group.named else sign.lower(), draft)
