"""The loop: examine, answer, again, until a range holds or is given up."""

from __future__ import annotations

from typing import Any

from ..parts import part_kinds
from .actor import AuditObject, band_of
from .agent import Amendment, respond
from .findings import DISTINCT, Examiner
from .log import RangeLog, RangeOutcome
from .probe import ALONG, Probe
from .proposal import End, Proposal

ROUNDS = 5
METHODS = ("material points", "linear elements")


def refine(
    thing: AuditObject,
    first: Proposal,
    *,
    actor: str,
    linear: bool = False,
    earlier: RangeLog | None = None,
) -> RangeLog:
    """Simulate both ends of a proposal and refine it, in at most ``ROUNDS`` rounds.

    ``linear`` elements take the place of particles; ``earlier`` is the log that a person edited:
    its rounds are kept before the new ones.
    """
    examiner = Examiner(Probe(thing.part, list(thing.parts), linear=linear), first)
    spans = {name: band_of(part_kinds()[name].materials) for name in thing.parts}
    rounds = list(earlier.rounds) if earlier else []
    before, proposal = len(rounds), first
    while True:
        found = examiner.examine(proposal)
        answer = respond(proposal, found.findings, spans)
        rounds.append({
            "round": len(rounds) + 1,
            "proposal": proposal.document(),
            **found.document(),
            "actions": [action.document() for action in answer.actions],
        })  # fmt: skip
        number = len(rounds) - before
        if answer.done or number == ROUNDS:
            break
        proposal = answer.proposal
    outcome, reason = _judged(answer, rounds[before:], by_hand=earlier is not None)
    first = first if earlier is None or earlier.first is None else earlier.first
    load = _load(examiner, proposal)
    return RangeLog(thing, actor, first, proposal, outcome, reason, load, tuple(rounds))


def _judged(
    answer: Amendment, rounds: list[dict[str, Any]], *, by_hand: bool
) -> tuple[RangeOutcome, str]:
    """Return what becomes of a proposal after its last answer, and why."""
    if not answer.accepted:
        return RangeOutcome.REJECTED, answer.reason or f"it did not survive {ROUNDS} rounds"
    deeds = {action["deed"] for entry in rounds[:-1] for action in entry["actions"]}
    refined = [*["edited by hand"] * by_hand, *sorted(deeds)]
    outcome = RangeOutcome.REFINED if refined else RangeOutcome.ACCEPTED
    return outcome, "; ".join([*refined, *[answer.reason] * bool(answer.reason)])


def _load(examiner: Examiner, proposal: Proposal) -> dict[str, Any]:
    """Put down what all rounds were examined under; nothing where a constraint was broken."""
    probe, load = examiner.probe, examiner.load
    if load is None:
        return {}
    return {
        "acceleration": load.acceleration,
        "duration": load.duration,
        "method": METHODS[probe.linear],
        "cells": max(probe.shape) // ALONG,
        "particles": len(probe.x),
        "most_substeps": probe.steps,
        "distinct": DISTINCT,
        "linear_sag": {str(end): probe.sag(proposal, end, load) for end in End},
        "notes": list(probe.notes),
    }
