"""The log of one object: a file that a person can read, edit and continue."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any

from ....fem.errors import InputError
from .actor import AuditObject, draw_object
from .proposal import Proposal, proposal_from


class RangeOutcome(StrEnum):
    """What becomes of a proposal."""

    ACCEPTED = "accepted at once"
    REFINED = "refined"
    REJECTED = "rejected"


@dataclass(frozen=True)
class RangeLog:
    """What was proposed for an object, what was found in every round, and what became of it.

    ``first`` is the actor's proposal and ``proposal`` the one that stands, None where the actor's
    answer was none; ``rounds`` are plain data with proposal, findings, measures and actions,
    ``review`` that of the critic, where there was one.
    """

    thing: AuditObject
    actor: str
    first: Proposal | None
    proposal: Proposal | None
    outcome: RangeOutcome
    reason: str
    load: dict[str, Any] = field(default_factory=dict)
    rounds: tuple[dict[str, Any], ...] = ()
    review: dict[str, Any] = field(default_factory=dict)

    @property
    def file_name(self) -> str:
        """Name of the file in the folder of an audit."""
        return f"object_{self.thing.number:03d}.json"

    def save(self, folder: Path) -> Path:
        """Write the log; return its path."""
        thing = self.thing
        document = {
            "object": thing.name,
            "seed": thing.seed,
            "number": thing.number,
            "called": {name: named.text for name, named in thing.parts.items()},
            "actor": self.actor,
            "outcome": str(self.outcome),
            "reason": self.reason,
            "review": self.review,
            "load": self.load,
            "proposal": _plain(self.proposal),
            "first": _plain(self.first),
            "rounds": list(self.rounds),
        }
        path = folder / self.file_name
        path.write_text(json.dumps(document, indent=1) + "\n")
        return path


def _plain(proposal: Proposal | None) -> dict[str, Any] | None:
    return None if proposal is None else proposal.document()


def load_log(path: Path) -> tuple[RangeLog, bool]:
    """Read a log, and whether a person has edited its ``proposal`` since the last round.

    Raises ``InputError`` where it cannot be read, or the proposal is none.
    """
    try:
        data = json.loads(path.read_text())
        thing = draw_object(int(data["seed"]), int(data["number"]))
        parts = list(thing.parts)
        first, now = (
            None if data[key] is None else proposal_from(data[key], parts)
            for key in ("first", "proposal")
        )
        rounds = tuple(dict(entry) for entry in data["rounds"])
        last = proposal_from(rounds[-1]["proposal"], parts) if rounds else first
        found = RangeLog(
            thing, str(data["actor"]), first, now, RangeOutcome(data["outcome"]),
            str(data["reason"]), dict(data["load"]), rounds, dict(data.get("review", {})),
        )  # fmt: skip
    except (OSError, KeyError, TypeError, ValueError, InputError) as error:
        raise InputError(f"{path} is no log of an audit: {error}") from error
    return found, now is not None and now != last
