"""The audit: many objects, three shares, and what they are made of."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ....fem.errors import InputError
from .actor import Actor, draw_object, propose_by_table
from .bias import count_biases
from .findings import DISTINCT
from .log import RangeLog, RangeOutcome, load_log
from .refinement import refine

# UniPixie supplement, A.1.1: shares of 100 objects of their own, judged by people.
PAPER = {RangeOutcome.ACCEPTED: 0.528, RangeOutcome.REFINED: 0.383, RangeOutcome.REJECTED: 0.089}
QUEUE = "review.txt"

Tell = Callable[[str], None]


def audit(
    output: Path,
    *,
    objects: int = 100,
    seed: int = 0,
    actor: Actor = propose_by_table,
    actor_name: str = "table",
    tell: Tell | None = None,
) -> list[RangeLog]:
    """Propose, simulate and refine the ranges of objects; a log of each goes to ``output``.

    Objects whose log of the same seed is there already are not made again.
    """
    output.mkdir(parents=True, exist_ok=True)
    logs = []
    for number in range(objects):
        path = output / f"object_{number:03d}.json"
        if path.is_file():
            log, edited = load_log(path)
            if log.thing.seed == seed and not edited:
                logs.append(log)
                continue
            raise InputError(
                f"{path} is of seed {log.thing.seed}{', and edited' if edited else ''}: --resume "
                "goes on from it, another folder starts afresh"
            )
        thing = draw_object(seed, number)
        if tell is not None:
            tell(f"object {number + 1} of {objects}, {thing.name}")
        try:
            log = refine(thing, actor(thing), actor=actor_name)
        except InputError as error:
            reason = f"no proposal: {error}"
            log = RangeLog(thing, actor_name, None, None, RangeOutcome.REJECTED, reason)
        log.save(output)
        logs.append(log)
    write_queue(output, logs)
    return logs


def resume(folder: Path, *, tell: Tell | None = None) -> list[RangeLog]:
    """Go on with the proposals that a person edited in the logs of a folder."""
    paths = sorted(folder.glob("object_*.json"))
    if not paths:
        raise InputError(f"no logs of an audit in {folder}: wanted object_000.json and so on")
    logs = []
    for path in paths:
        log, edited = load_log(path)
        if edited and log.proposal is not None:
            if tell is not None:
                tell(f"{path.name}, {log.thing.name}")
            log = refine(log.thing, log.proposal, actor=log.actor, earlier=log)
            log.save(folder)
        logs.append(log)
    write_queue(folder, logs)
    return logs


def write_queue(folder: Path, logs: Sequence[RangeLog]) -> Path:
    """List the logs that a person should look at: what was rejected, and why."""
    lines = [
        f"{log.file_name}\t{log.thing.name}\t{log.reason}"
        for log in logs
        if log.outcome == RangeOutcome.REJECTED
    ]
    path = folder / QUEUE
    path.write_text("\n".join(lines) + "\n" * bool(lines))
    return path


def audit_document(logs: Sequence[RangeLog]) -> dict[str, Any]:
    """Shares beside the paper's, reasons, biases, and what the shares hang on, as plain data."""
    count = Counter(log.outcome for log in logs)
    made = [(log.thing, log.first) for log in logs if log.first is not None]
    return {
        "objects": len(logs),
        "shares": [
            {"outcome": str(o), "objects": count[o], "share": count[o] / len(logs),
             "paper": PAPER[o]}
            for o in RangeOutcome
        ],
        "reasons": [
            {"outcome": str(outcome), "reason": reason, "objects": n}
            for (outcome, reason), n in sorted(_reasons(logs).items(), key=lambda kv: -kv[1])
        ],
        "found_in_first_round": dict(Counter(kind for log in logs for kind in _first(log))),
        "biases": [bias._asdict() for bias in count_biases(made)],
        "alike": {f"{limit:g}": _alike(logs, limit) for limit in (DISTINCT / 2, DISTINCT,
                                                                  2 * DISTINCT)},
        "against_the_dial": sum(map(_moves_more, logs)),
    }  # fmt: skip


def _reasons(logs: Sequence[RangeLog]) -> Counter[tuple[RangeOutcome, str]]:
    """Count reasons by their kind: of what is said of one part, the kind of the finding alone."""
    return Counter((log.outcome, _general(log)) for log in logs)


def _general(log: RangeLog) -> str:
    if log.outcome != RangeOutcome.REJECTED:
        return log.reason or "both ends hold and differ"
    last = log.rounds[-1]["findings"] if log.rounds else []
    kinds = {finding["kind"] for finding in last if isinstance(finding, dict)}
    return ", ".join(sorted(kinds)) if kinds else log.reason.partition(":")[0]


def _first(log: RangeLog) -> set[str]:
    found = log.rounds[0]["findings"] if log.rounds else []
    return {finding["kind"] for finding in found if isinstance(finding, dict)}


def _measured(log: RangeLog) -> list[dict[str, Any]]:
    """Rounds in which both ends were followed."""
    return [entry for entry in log.rounds if entry.get("difference") is not None]


def _alike(logs: Sequence[RangeLog], limit: float) -> int:
    """Objects whose ends, when first followed, are nearer to each other than ``limit``."""
    firsts = [rounds[0]["difference"] for rounds in map(_measured, logs) if rounds]
    return int((np.array(firsts) < limit).sum())


def _moves_more(log: RangeLog) -> bool:
    """Whether the stiff end moves further than the soft one: heavier, or of matter that flows."""
    rounds = _measured(log)
    if not rounds:
        return False
    moved = rounds[-1]["largest_displacement"]
    return moved["stiff"] > moved["soft"]
