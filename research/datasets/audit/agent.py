"""The agent that answers what is wrong with a proposal: it decouples, shifts, evens or widens."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal, NamedTuple

from ....fem.table import FIELDS, Band
from .findings import Flaw
from .proposal import End, PartRange, Proposal

SHIFT = 10**0.5  # an end of E that fails moves by half a decade

Deed = Literal["decouple", "shift", "even density", "widen"]
TOLD = "the matter is told: no range to see"


class Action(NamedTuple):
    """What was done to a part, in a sentence."""

    deed: Deed
    part: str
    what: str

    def document(self) -> dict[str, Any]:
        """Plain data."""
        return self._asdict()


class Amendment(NamedTuple):
    """The proposal after ``actions``; without any it is ``accepted`` or given up."""

    proposal: Proposal
    actions: tuple[Action, ...] = ()
    reason: str = ""
    accepted: bool = False

    @property
    def done(self) -> bool:
        """Whether nothing is left to do."""
        return not self.actions


def respond(proposal: Proposal, findings: Sequence[Flaw], spans: Mapping[str, Band]) -> Amendment:
    """Answer all findings at once; ``spans`` are the whole ranges of the kinds of parts."""
    if not findings:
        return Amendment(proposal, accepted=True)
    actions: list[Action] = []
    for finding in findings:
        if finding.kind == "constraint":
            return Amendment(proposal, reason=f"constraint {finding.message}")
        if finding.kind == "indistinguishable":
            return _told_apart(proposal, finding, spans)
        end, part = finding.end, proposal.parts[finding.part]
        assert end is not None
        changed, action = _answer(finding, end, part)
        if action is None:
            return Amendment(proposal, reason=f"{end} end of {finding.part}: {finding.message}")
        proposal = proposal.with_part(finding.part, changed)
        actions.append(action)
    if all(End.SOFT in part.rigid for part in proposal.parts.values()):
        reason = "no part of the soft end can be followed within the steps"
        return Amendment(proposal, reason=reason)
    return Amendment(proposal, tuple(actions))


def _answer(finding: Flaw, end: End, part: PartRange) -> tuple[PartRange, Action | None]:
    """Make rigid what is too fast; move an end of E or, at the stiff end, of rho that fails."""
    name = finding.part
    if finding.kind == "cfl":
        what = f"rigid at its {end} end in the simulation; its range of matter stays"
        rigid = replace(part, rigid=(*part.rigid, end))
        return rigid, Action("decouple", name, what)
    crushed = finding.kind == "inverted" and end == End.STIFF
    if crushed:  # less E would crush it more: its own weight is what it does not bear
        return _evened(name, part)
    E = part.value(end).E
    moved = part.with_end(end, E * SHIFT if end == End.SOFT else E / SHIFT)
    if moved == part:
        return part, None
    what = f"{end} end of E from {E:.3g} to {moved.value(end).E:.3g} Pa"
    return moved, Action("shift", name, what)


def _evened(name: str, part: PartRange) -> tuple[PartRange, Action | None]:
    if part.even_rho or part.band.rho.min == part.band.rho.max:
        return part, None
    even = replace(part, even_rho=True)
    rho = even.value(End.SOFT).rho
    return even, Action(
        "even density", name, f"rho is {rho:.4g} kg/m^3 at both ends: E alone moves"
    )


def _told_apart(proposal: Proposal, finding: Flaw, spans: Mapping[str, Band]) -> Amendment:
    """Widen what the names leave open; else let E alone move; else accept what the names state."""
    open_parts = {name: part for name, part in proposal.parts.items() if not part.told}
    if not open_parts:
        return Amendment(proposal, reason=TOLD, accepted=True)
    actions: list[Action] = []
    for name, part in open_parts.items():
        wide = _widened(part, spans.get(name))
        if wide is not None:
            proposal = proposal.with_part(name, wide)
            actions.append(Action("widen", name, "to the whole span of its kind"))
    for name, part in open_parts.items() if not actions else ():
        even, action = _evened(name, part)
        if action is not None:
            proposal = proposal.with_part(name, even)
            actions.append(action)
    return Amendment(proposal, tuple(actions), "" if actions else finding.message)


def _widened(part: PartRange, span: Band | None) -> PartRange | None:
    """Return the part with the whole span of its kind; None where it has that already."""
    if span is None:
        return None
    sides = [(getattr(part.band, field), getattr(span, field)) for field in FIELDS]
    if all(own.min <= all_.min and own.max >= all_.max for own, all_ in sides):
        return None
    return replace(part, band=span)
