"""Words that point to others: "the latter", and the noun that a text is about."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from ..vocabulary.lexicon import Phrase, words
from .lexeme import Lexeme


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
