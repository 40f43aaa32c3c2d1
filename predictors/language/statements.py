"""Statements: groups of words as they come, each given to the subject that it speaks of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from .drafts import Draft
from .groups import Group, Mention, groups_of
from .lexicon import Phrase, ReaderLexicon, known_parts, places, words
from .lexing import Lexeme

_VALUED = ("is", "of", "but")  # links after which a subject's material comes


class Statements:
    """The statements of a text up to a word of it, and what its next words are waited for."""

    def __init__(self, lexicon: ReaderLexicon) -> None:
        self.lexicon = lexicon
        self.drafts: list[Draft] = []
        self.pending: Draft | None = None  # a subject of which nothing is said yet
        self.current: Draft | None = None  # of which something was said last
        self.excepted: Draft | None = None  # what a whole leaves out, until it is spoken of
        self.seen: list[Lexeme] = []  # read, and of nothing that is there
        self.fronted: list[Phrase] = []  # left out of a whole that is still to come
        self.held: Draft | None = None  # a subject that waits while a bracket speaks of another
        self.last_part: Phrase = ()
        self.link = self.mode = self.coming = ""  # the connector before, what it wants, the next
        self.negated = self.neither = self.swaps = self.verb = False

    def run(self, lexemes: list[Lexeme], after: Lexeme | None) -> None:
        """Take the words between two connectors."""
        if any(x.text.lower() in ("whole", "entire") for x in lexemes) and not self.drafts:
            lexemes = [x for x in lexemes if x.role != "word" or x.part]
            self.pending = self.pending or Draft("whole")
        owes = self.pending is not None and self.link in ("is", "of", "")
        owes = owes or self.mode != "" or self.link == "but"
        self.coming = after.role if after is not None else ""
        opens = self.coming in ("is", "of") or self.mode == "except" or self.link == "for"
        groups = groups_of(lexemes, self.lexicon, owes=owes and not opens, opens=opens)
        if not groups and self.link == "is" and self.pending is not None:
            self.settle(self.pending)  # "the handle is ergonomic and the head is steel"
        for group in groups:
            group.part = self._full_name(group)
            if group.part and group.values and self._is_next(group):
                self._values(replace(group, part=()))
                self._part(replace(group, values=[]))
            elif group.part and group.values:
                self._both(group)
            elif group.part:
                self._part(group)
            elif group.values:
                self._values(group)
            self.last_part = group.part or self.last_part

    def _full_name(self, group: Group) -> Phrase:
        """A number or a side alone has the noun that came before it: "leg 1, 2", "the second"."""
        before = self.pending.names[-1] if self.pending and self.pending.names else self.last_part
        if before and group.part and all(word.isdigit() for word in group.part):
            return (*(word for word in before if not word.isdigit()), *group.part)
        side = group.part[-1:] and group.part[-1] in places() and not group.named
        own = bool(group.values) and group.part[-1:] and group.part[-1] in known_parts()
        if before and side and not own:  # "a glass top" is a part of its own
            return (*group.part, before[-1])
        return group.part

    def _is_next(self, group: Group) -> bool:
        """Whether a noun after a material is the next subject: "wheels=rubber body=steel"."""
        waits = self.pending is not None and self.link == "is" and self.coming == "is"
        return waits and group.named and not group.part_first

    def stop(self) -> None:
        """End a sentence."""
        self.flush()
        self.link = self.mode = ""
        self.negated = self.swaps = self.verb = False
        self.excepted = None

    def flush(self) -> None:
        """Let go of a subject of which nothing was said; "and sides" joins what came before."""
        pending, self.pending = self.pending, None
        if pending is not None and pending.joins is not None:
            pending.joins.names += pending.names

    def settle(self, draft: Draft) -> None:
        """Make a waiting subject the current one."""
        if draft not in self.drafts:
            self.drafts.append(draft)
        self.current, self.pending = draft, None

    def compare_with(self, part: Phrase) -> None:
        """Say which part the last comparison is with."""
        if self.current is not None:
            self.current.compare_with(part)
        self.mode = self.link = ""

    def waits_for_no_other(self) -> bool:
        """Whether no subject waits but one that a whole to come leaves out."""
        return self.pending is None or self.pending.names == self.fronted

    def is_other(self) -> bool:
        """Whether the last part that was named is not what the last statement is about."""
        return self.current is None or self.last_part not in self.current.names

    def _both(self, group: Group) -> None:
        """A part with its matter; after "is" and "of" the noun only says its form."""
        pending = self.pending
        if self.mode == "than":  # "softer than the rubber foot"
            self.compare_with(group.part)
            self._new(group)
            return
        only_number = all(m.kind in ("number", "comparison") for m in group.values)
        if only_number and not group.named and self.link in ("comma", "is") and self.current:
            self._values(group)  # "15 % gyroid"
            return
        if self.mode == "except":
            self._except(group)
            self._new(group)
            return
        owed = self.link in _VALUED and pending is not None
        owed = owed or (self.link == "but" and self.current is not None and pending is None)
        owed = owed and not (group.named and pending is not None and not pending.named)
        if owed or self.mode or self.link == "swallow" or self._is_late(group):
            self._values(group)
        else:
            self._new(group)

    def _new(self, group: Group) -> None:
        names = [group.part]
        if self.pending is not None and group.part_first and self._in_list():
            names = [*self.pending.names, *names]
            self.pending = None
        self.flush()
        holds = not self.drafts and group.is_thing
        draft = Draft("parts", names, named=group.named, holds=holds, tight=not group.part_first)
        self.settle(draft)
        self._fill(draft, group.values, group.lexemes)

    def _is_late(self, group: Group) -> bool:
        """Whether what was said before without a subject gets it now: "2 GPa for the bracket"."""
        current = self.current
        scopes = {"for": ("none",), "of": ("none",), "bracket": ("none", "whole")}
        owned = self.link == "for" and group.named and current is not None and not current.named
        if current is None or not (owned or current.scope in scopes.get(self.link, ())):
            return False  # "two boards of ash for the seat"
        current.scope, current.names, current.named = "parts", [group.part], group.named
        return True

    def _in_list(self) -> bool:
        """Whether nouns add up; a comma ends what "and" adds to a pair: "oak top and back, rim"."""
        before = self.pending.joins if self.pending is not None else None
        ends = self.link == "comma" and before is not None and before.tight
        return self.link in ("and", "comma") and not self.verb and not ends

    def _part(self, group: Group) -> None:
        """A noun: a subject, or what a word before it wants of a part."""
        pending = self.pending
        self.negated = self.negated and self.neither
        if self.mode == "except":
            self._except(group)
        elif self.mode == "than":
            self.compare_with(group.part)
        elif self.mode == "same":
            self.mode = self.link = ""
            if self.current is not None:
                self.current.same = group.part
        elif self.mode == "fill" or self._says_content(pending or self.current, group):
            draft = pending or self.current
            if draft is not None:
                self._fill_up(draft, group)
            self.mode = self.link = ""
        elif self.mode:
            self.mode = ""
        elif self.coming == "is" and {*group.part[-1:]} & {*words()["attributes"]["matter"]}:
            self.pending = pending or Draft("whole")
            if group.part[:-1]:
                self.pending = Draft("parts", [group.part[:-1]], named=group.named)
        elif pending is not None and (pending.scope != "parts" and self.link in ("swallow", "of")):
            self.link = "" if not self._object(group) else self.link
        elif pending is not None and self.link in ("is", "of"):
            self._after_link(group, pending)
        elif pending is not None and self._in_list():
            pending.names.append(group.part)
            pending.named = pending.named or group.named
        elif self.link in ("off", "on", "for") and pending is not None and self.coming == "is":
            if set(group.part) & places():  # "the cushion on the left is ..."
                pending.names[-1:] = [(*group.part, *name) for name in pending.names[-1:]]
        elif self.link in ("off", "for") or (self.link in ("of", "bracket") and pending is None):
            self._is_late(group)  # also "oak (top)"
        else:
            joined = self.link == "and" and pending is None
            self.flush()
            self.pending = Draft(
                "parts", [group.part], self.fronted, named=group.named, holds=group.is_thing,
                joins=self.current if joined else None,
            )  # fmt: skip
            self.fronted = []
        self.verb = False

    def _object(self, group: Group) -> bool:
        """Take the noun after "it is" for the object's name: "this is a bookcase with ..."."""
        pending = self.pending
        if pending is None or pending.scope != "whole" or self.link != "is":
            return False
        pending.scope, pending.names, pending.holds = "parts", [group.part], True
        pending.named = group.named
        return True

    def _after_link(self, group: Group, pending: Draft) -> None:
        """A noun where a material is wanted: a part of a part, an unknown name, or nothing."""
        article = any(x.tag in ("DT", "PRP$") for x in group.lexemes)
        strange = any(not x.known for x in group.lexemes) and not group.named
        known = group.named or (group.part[-1:] and group.part[-1] in known_parts())
        if self._object(group):
            pass
        elif self.link == "of" and not self.verb and not strange and (article or known):
            pending.names[-1:] = [(*group.part, *name) for name in pending.names[-1:]]
            pending.named = pending.named or group.named
        elif group.named and not pending.named:  # "A park bench: frames ..."
            self.flush()
            self.pending = Draft("parts", [group.part], named=True)
        elif not strange and self.lexicon.model.is_word(group.part[-1], ("adj",)):
            self.settle(pending)  # "the seat is red"
        elif strange or not (article or group.named):
            self.settle(pending)
            pending.unknown = " ".join(x.text for x in group.lexemes if x.words)
            pending.see(group.lexemes)
        self.link = ""

    def _values(self, group: Group) -> None:
        """What is said without a part: of the subject that waits for it, or of the last."""
        if self.mode in ("than", "same") and group.material:  # "softer than foam"
            said = tuple(word for x in group.lexemes for word in x.words)
            self.seen += group.lexemes
            self.compare_with(said) if self.mode == "than" else None
            self.mode = self.link = ""
            return
        mode = "" if self.mode in ("than", "same") else self.mode
        again = self.pending is None and self.link in ("of", "is") and group.material is not None
        draft = self.pending or self.excepted or self._resumed(group)
        self.mode = self.mode if self.mode in ("than", "same", "fill") else ""
        self.excepted = None
        if mode == "look":
            self.seen += group.lexemes
            return
        if mode == "fill" or self._says_content(draft, group):
            self._fill_up(draft, group)
            return
        self.settle(draft)
        if mode == "coat":
            draft.coating = group.material.name if group.material else None
            draft.see(group.lexemes)
            return
        if again and draft is self.current and draft.material is not None and not self.negated:
            draft.material = None  # "a paper towel holder in brass"
        if self.link == "on" and draft.material is not None and group.material:
            draft.coating, draft.material = draft.material.name, None
        draft.left += group.modifiers
        self._fill(draft, group.values, group.lexemes)

    def _fill_up(self, draft: Draft, group: Group) -> None:
        self.settle(draft)
        draft.filling = group.contents(self.lexicon) or draft.filling
        draft.see(group.lexemes)

    def _says_content(self, draft: Draft | None, group: Group) -> bool:
        """Whether "of" says what is in a thing: "a bag of sand", "a box of books"."""
        containers, row = words()["containers"], group.material
        heads = {name[-1] for name in draft.names if name} if draft is not None else set()
        if self.link != "of" or self.verb or not heads & set(containers["words"]):
            return False
        fills = row is None or row.category in containers["matter"]
        loose = group.contents(self.lexicon) != (row.name if row else None)
        return loose and (fills or group.lexemes[-1].text.lower().endswith("s"))

    def _resumed(self, group: Group) -> Draft:
        """Return the draft that goes on, or a new one of nothing that is said."""
        current = self.current
        if current is not None and (
            self.mode or self.negated or self.link in (*_VALUED, "on", "with")
            or current.material is None or not group.material
        ):  # fmt: skip
            return current
        return Draft("whole" if self.negated and not self.drafts else "none")

    def _fill(self, draft: Draft, values: Sequence[Mention], lexemes: Sequence[Lexeme]) -> None:
        for mention in values:
            draft.take(mention, self.lexicon, negated=self.negated)
        draft.see(lexemes)
        self.link, self.verb = "", False

    def _except(self, group: Group) -> None:
        whole = self.pending or self.current  # none in "apart from the lid, it is all brass"
        (self.fronted if whole is None else whole.exceptions).append(group.part)
        self.excepted = Draft("parts", [group.part], named=True)
        if self.pending is None:
            self.pending, self.excepted = self.excepted, None
        self.mode = self.link = ""
