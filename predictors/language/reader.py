"""The reader: a text to a Sentence, once.

Lexemes are joined to groups (a part, what is said of one, or both), and the words between groups
say how these hang together: ``data/words.toml`` names what each of them does.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from ...fem.errors import UsageError
from ...fem.scene.materials import MaterialTable
from .clauses import Sentence
from .drafts import Draft, finished
from .lexicon import Phrase, lexicon_of, words
from .lexing import Lexeme, lex
from .phrases import join_comparisons
from .statements import Statements

LONGEST = 4000  # characters: a page of notes; a book is a mistake
_POINTERS = ("this", "that", "these", "those", "one", "its")
_GROUPED = (
    "word", "material", "part", "number", "stiffness", "density", "character", "degree", "fake",
    "coat", "coating", "look", "attributes", "empty", "compare", "idle", "factors", "vague",
    "digits", "size", "told", "sign", "hyphen", "nobody", "all",
)  # fmt: skip


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
    statements = Statements(lexicon)
    _walk(join_comparisons(lexed.lexemes), statements)
    sentence = finished(text, statements.drafts, lexed, lexicon, statements.seen)
    return replace(sentence, thing=_first_phrase(lexed.lexemes))


def _first_phrase(lexemes: Sequence[Lexeme]) -> Phrase:
    """Words of the first noun phrase, up to one that joins: "this is a can of ..." is "a can".

    What a participle says of the noun before it comes first: "a ball inflated with ...".
    """
    phrase, noun = list[str](), False
    for lexeme in lexemes:
        before = lexeme.role == "coat" and not noun  # "a painted drum"
        if (lexeme.role in _CONNECTORS or lexeme.role in ("on", "sign")) and not before:
            if phrase and phrase[-1] != "image":  # "an image of a chair"
                break
            phrase = []
        elif phrase and lexeme.dep == "acl":
            return (*lexeme.words, *phrase)
        else:
            phrase += lexeme.words
            noun = noun or lexeme.tag.startswith("NN")
    return tuple(phrase)


def _walk(lexemes: Sequence[Lexeme], state: Statements) -> None:
    """Take runs of words as groups, and let what stands between them say how they hang together."""
    run: list[Lexeme] = []
    for i, lexeme in enumerate(lexemes):
        after = lexemes[i + 1] if i + 1 < len(lexemes) else None
        if _starts_anew(lexeme, run, after, state):
            state.run(run, None)
            state.stop()
            run = []
        if _is_grouped(lexeme, run, after):
            run.append(lexeme)
            continue
        if run:
            state.run(run, lexeme)
        run = []
        if lexeme.role == "word":
            state.verb = True
        elif not (_owns(lexemes, i, state) or _points(lexeme, after)):
            connect = _CONNECTORS.get(lexeme.role)
            if connect:
                connect(state, lexeme)
            else:
                state.link = lexeme.role
    if run:
        state.run(run, None)
    state.stop()


def _starts_anew(
    lexeme: Lexeme, run: list[Lexeme], after: Lexeme | None, state: Statements
) -> bool:
    """Whether a statement begins without a stop before it: "the legs are oak the seat is foam"."""
    owed = state.link == "is" and any(x.role == "material" for x in run)
    return owed and lexeme.part and after is not None and after.role == "is"


def _is_grouped(lexeme: Lexeme, run: list[Lexeme], after: Lexeme | None) -> bool:
    """Whether a lexeme is of a group; a verb is, as the participle before a noun."""
    role = after.role if after is not None else ""
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


def _owns(lexemes: Sequence[Lexeme], i: int, state: Statements) -> bool:
    """Whether "'s" belongs to an owner, "the drum's shell", and is no "is"."""
    if lexemes[i].text != "'s" or state.pending is None or state.pending.scope != "parts":
        return False
    for lexeme in lexemes[i + 1 : i + 6]:
        if not _is_grouped(lexeme, [], None):
            return False
        if lexeme.role in ("word", "empty", "part") and lexeme.tag.startswith("NN"):
            state.pending = None
            return True
    return False


def _points(lexeme: Lexeme, after: Lexeme | None) -> bool:
    """Whether a pronoun only points at the noun after it: "those wheels"."""
    if lexeme.role != "it" or after is None or lexeme.text.lower() not in _POINTERS:
        return False
    said = ("material", "part", "stiffness", "density", "empty")
    return after.role in said or (after.role == "word" and not after.tag.startswith("V"))


def _on_but(state: Statements, _: Lexeme) -> None:
    whole = state.pending or state.current
    general = whole is not None and whole.scope in ("whole", "rest") and not whole.exceptions
    if general and not state.negated:
        state.mode = "except"
    else:
        state.negated, state.mode, state.link = False, "", "but"


def _on_comma(state: Statements, lexeme: Lexeme) -> None:
    if lexeme.text in "-–—" and state.pending is not None:
        state.link = "is"
        return
    state.mode = state.mode if state.mode == "except" else ""
    state.link, state.negated, state.verb = "comma", False, False


def _on_and(state: Statements, _: Lexeme) -> None:
    state.link = state.link if state.link == "of" and state.mode else "and"
    state.verb = False


def _on_is(state: Statements, lexeme: Lexeme) -> None:
    if lexeme.text.lower() in ("was", "were") and state.link == "bracket":
        state.negated = True  # "brass (was nylon)"
    if lexeme.text.lower() == "now" or (lexeme.text == ":" and state.pending is None):
        state.negated = False
    waits = state.pending is not None or state.current is None or lexeme.text != ":"
    state.link, state.mode = "is" if waits else "comma", ""


def _on_of(state: Statements, _: Lexeme) -> None:
    state.link = state.link if state.mode == "coat" else "of"


def _on_off(state: Statements, lexeme: Lexeme) -> None:
    text = lexeme.text.lower()
    if text in ("to", "for", "into", "by") and state.negated:  # "changed from brass to steel"
        state.negated, state.link = False, "but"
    else:
        state.link = "for" if text == "for" else "off"


def _on_with(state: Statements, _: Lexeme) -> None:
    if state.mode in ("coat", "fill"):
        return
    if state.swaps:  # "replace the wood with foam"
        state.negated, state.swaps, state.link = False, False, "but"
        return
    for draft in (state.pending, state.current):
        if draft is not None:
            draft.holds = True
    state.link, state.verb = "with", False


def _on_not(state: Statements, lexeme: Lexeme) -> None:
    state.negated, state.neither = True, lexeme.text.lower() == "neither"


def _on_swap(state: Statements, _: Lexeme) -> None:
    state.negated = state.swaps = True


def _on_becomes(state: Statements, _: Lexeme) -> None:
    """An arrow is a colon after a part, and a change after its material; so is "no," after it."""
    state.link = "is"
    if state.pending is None and state.current is not None:
        state.current.becomes = True


def _on_same(state: Statements, lexeme: Lexeme) -> None:
    draft = state.pending or state.current
    weak = lexeme.text.lower() in ("too", "as well", "like", "just like")
    if draft is None or (weak and draft is state.current and "like" not in lexeme.text.lower()):
        return
    if not (weak and draft is state.current):
        draft.same = ()
        state.settle(draft)
    state.mode = "same"


def _on_open(state: Statements, _: Lexeme) -> None:
    state.link = "is"
    if state.excepted is not None:
        state.held, state.pending, state.excepted = state.pending, state.excepted, None
    elif state.pending is None and state.current is not None:
        state.link = "bracket"


def _on_close(state: Statements, _: Lexeme) -> None:
    state.link = ""
    if state.held is not None:
        state.pending, state.held = state.held, None


def _on_it(state: Statements, lexeme: Lexeme) -> None:
    """A pronoun takes up the last subject; after a preposition it says nothing."""
    if state.mode == "than":
        state.compare_with(state.last_part)
    elif state.excepted is not None:
        state.pending, state.excepted, state.mode = state.excepted, None, ""
    elif state.fronted and lexeme.text.lower() != "which" and state.waits_for_no_other():
        state.pending, state.link = Draft("whole", exceptions=state.fronted), ""
        state.fronted = []
    elif lexeme.text.lower() == "which" and state.pending is None and state.is_other():
        state.pending, state.link = Draft("parts", [state.last_part], named=True), ""
    elif state.pending is None and state.link not in ("of", "on", "off"):
        state.link = "but" if state.current is not None else ""
        state.pending = None if state.current is not None else Draft("whole")


def _on_general(state: Statements, lexeme: Lexeme) -> None:
    """Start a statement about everything, what is left, or the other of two."""
    busy = state.pending is not None and not (state.fronted and state.waits_for_no_other())
    if lexeme.role == "whole" and (busy or state.link == "of"):
        return
    state.flush()
    state.link, state.current = "swallow", None
    if lexeme.role == "other":
        state.link = ""
        state.pending = Draft("parts", [("other", *state.last_part[-1:])])
    else:
        state.pending = Draft("whole" if lexeme.role == "whole" else "rest")
        state.pending.exceptions, state.fronted = state.fronted, []


def _mode(name: str) -> Callable[[Statements, Lexeme], None]:
    def connect(state: Statements, _: Lexeme) -> None:
        state.mode = name

    return connect


# What the words between groups do, by their role; a role that is not here is only remembered.
_CONNECTORS: dict[str, Callable[[Statements, Lexeme], None]] = {
    "stop": lambda state, _: state.stop(),
    "but": _on_but, "comma": _on_comma, "and": _on_and, "is": _on_is, "of": _on_of, "off": _on_off,
    "with": _on_with, "swap": _on_swap, "becomes": _on_becomes,
    "not": _on_not, "same": _on_same, "open": _on_open, "close": _on_close,
    "it": _on_it, "whole": _on_general, "rest": _on_general, "other": _on_general,
    "except": _mode("except"), "coat": _mode("coat"), "fill": _mode("fill"),
    "looks": _mode("look"), "than": _mode("than"),
    "as": lambda state, _: setattr(state, "mode", "same" if state.mode == "same" else "than"),
}  # fmt: skip
