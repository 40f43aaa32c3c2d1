"""The grammar: constituents of a text, joined by rules over the signs of their sequence.

Each has a sign of one character (``data/grammar.toml`` lists them). A rule is a regular expression
over the signs of a text with named groups: the one called ``head`` takes what the others say, each
in the role that its name says, and stands for all of them. Rules are tried in their order, each
until it fits nowhere: a cascade of finite-state transducers (Hobbs et al. 1997, FASTUS).
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from ..lexemes.lexeme import Lexeme
from ..vocabulary.lexicon import ReaderLexicon, known_parts, words
from .drafts import Draft

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
            self._compare_with_last(draft, match.start())
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

    def _compare_with_last(self, draft: Draft, at: int) -> None:
        """Compare with the last part that was named before: "lighter than them"."""
        said = [t.draft for t in reversed(self.tokens[:at]) if t.draft and t.draft.names]
        before = (other.names[-1] for other in said if other.names[-1] not in draft.names)
        draft.compare_with(next(before, ()))


def _names(_: Cascade, head: Draft, other: Draft) -> None:
    head.scope = other.scope if head.scope == "none" else head.scope
    head.names += other.names
    head.exceptions += other.exceptions
    head.named, head.holds = head.named or other.named, head.holds or other.holds
    head.filling = head.filling or other.filling


def _more(cascade: Cascade, head: Draft, other: Draft) -> None:
    _names(cascade, head, other)
    head.add(other)


def _owned(_: Cascade, head: Draft, other: Draft) -> None:
    """Put the owner before a name: "the top of the table" is the table's top."""
    head.names[-1:] = [(*other.names[-1], *name) for name in head.names[-1:]]
    head.named = head.named or other.named


def _renamed(_: Cascade, head: Draft, other: Draft) -> None:
    head.scope, head.names, head.named = "parts", other.names, other.named
    head.add(other)


def _fill(cascade: Cascade, head: Draft, other: Draft) -> None:
    row = other.material.name if other.material else None
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


def _negated(cascade: Cascade, head: Draft, other: Draft) -> None:
    other.rule_out(cascade.lexicon)
    _more(cascade, head, other)


def _coat(_: Cascade, head: Draft, other: Draft) -> None:
    head.coating = other.material.name if other.material else other.coating


# What a rule's groups say of its head.
_ROLES: dict[str, Callable[[Cascade, Draft, Draft], None]] = {
    "head": _more, "pure": _names, "names": _names, "bearers": _names, "owner": _owned,
    "coating": _coat, "filling": _fill, "contents": _fill, "unknown": _unknown,
    "strange": _unknown, "stuff": _unknown, "excluded": _negated,
    "values": lambda _, head, other: head.add(other),
    "made": lambda _, head, other: head.add(other),
    "first": lambda _, head, other: head.add(other),
    "instead": lambda _, head, other: head.add(other, instead=True),
    "compared": lambda _, head, other: head.compare_with((*other.names, tuple(other.said))[0]),
    "same": lambda _, head, other: setattr(head, "same", (*other.names, ())[0]),
    "exceptions": lambda _, head, other: head.exceptions.extend(other.names),
    "renamed": _renamed, **dict.fromkeys(("drop", "keep", "last", "outside"), lambda *_: None),
}  # fmt: skip
_GUARDS: dict[str, Callable[[Cascade, Draft, Draft], bool]] = {
    "contents": _holds_contents, "unknown": _is_strange, "stuff": _is_stuff,
    "first": lambda _, head, other: head.material is None and not head.unknown,
    "bearers": lambda _, head, other: not head.comparisons,
    "names": lambda _, head, other: not other.own,
    "pure": lambda _, head, other: not (other.mixed or other.own),
    "strange": lambda _, head, other: any(not x.known for x in other.lexemes),
}  # fmt: skip
