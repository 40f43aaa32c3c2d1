"""The audit: many objects, three shares, and what they are made of."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ....fem.errors import InputError
from .actor import Actor, AuditObject, draw_object, propose_by_table
from .bias import count_biases
from .critic import Critic
from .findings import DISTINCT
from .log import RangeLog, RangeOutcome, load_log
from .proposal import End
from .refinement import METHODS, refine

# UniPixie supplement, A.1.1: shares of 100 objects of their own, judged by people.
PAPER = {RangeOutcome.ACCEPTED: 0.528, RangeOutcome.REFINED: 0.383, RangeOutcome.REJECTED: 0.089}
QUEUE = "review.txt"
UNCHECKED = (
    "sizes in metres; metals and pastes beyond their yield stress; without --encoder, whether "
    "pictures show the parts: of procedural objects they are known"
)

Tell = Callable[[str], None]


def audit(
    output: Path,
    *,
    objects: int = 100,
    seed: int = 0,
    actor: Actor = propose_by_table,
    actor_name: str = "table",
    critic: Critic | None = None,
    linear: bool = False,
    tell: Tell | None = None,
) -> list[RangeLog]:
    """Propose, simulate and refine the ranges of objects; a log of each goes to ``output``.

    A ``critic`` looks at pictures of them, too; ``linear`` elements are a forecast. Objects whose
    log of the same seed is there already are not made again.
    """
    output.mkdir(parents=True, exist_ok=True)
    logs = []
    for number in range(objects):
        path = output / f"object_{number:03d}.json"
        if path.is_file():
            log, edited = load_log(path)
            method = log.load.get("method", METHODS[linear])
            if log.thing.seed == seed and method == METHODS[linear] and not edited:
                logs.append(log)
                continue
            raise InputError(
                f"{path} is of seed {log.thing.seed}, by {method}{', and edited' * edited}: "
                "--resume goes on from it, another folder starts afresh"
            )
        thing = draw_object(seed, number)
        if tell is not None:
            tell(f"object {number + 1} of {objects}, {thing.name}")
        log = _audited(thing, actor, actor_name, critic, linear=linear)
        log.save(output)
        logs.append(log)
    write_queue(output, logs)
    return logs


def _audited(
    thing: AuditObject, actor: Actor, actor_name: str, critic: Critic | None, *, linear: bool
) -> RangeLog:
    """Ask the actor and refine what it proposes; an answer that is no proposal is rejected."""
    try:
        proposal = actor(thing)
    except InputError as error:
        reason = f"no proposal: {error}"
        return RangeLog(thing, actor_name, None, None, RangeOutcome.REJECTED, reason)
    log = refine(thing, proposal, actor=actor_name, linear=linear)
    review = None if critic is None else critic(thing, proposal)
    return log if review is None else replace(log, review=review.document())


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
            linear = log.load.get("method") == METHODS[True]
            again = refine(log.thing, log.proposal, actor=log.actor, linear=linear, earlier=log)
            log = replace(again, review=log.review)
            log.save(folder)
        logs.append(log)
    write_queue(folder, logs)
    return logs


def write_queue(folder: Path, logs: Sequence[RangeLog]) -> Path:
    """List the logs that a person should look at, with the reasons."""
    lines = [
        f"{log.file_name}\t{log.thing.name}\t{'; '.join(why)}"
        for log in logs
        if (why := _doubts(log))
    ]
    path = folder / QUEUE
    path.write_text("\n".join(lines) + "\n" * bool(lines))
    return path


def _doubts(log: RangeLog) -> list[str]:
    """Why a person should look at a log."""
    doubts = [log.reason] if log.outcome == RangeOutcome.REJECTED else []
    if _against_the_dial(log):
        doubts.append("the stiff end moves further")
    if log.review and not log.review["accepted"]:
        doubts.append(f"the words do not show the parts (coherence {log.review['coherence']:.2f})")
    return doubts


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
        "against_the_dial": sum(map(_against_the_dial, logs)),
        "stiffened": sum(map(_is_stiffened, logs)),
        "as_linear": _as_linear(logs),
        "reviewed": _reviewed(logs),
        "unchecked": UNCHECKED,
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


def _against_the_dial(log: RangeLog) -> bool:
    """Whether the stiff end moves further than the soft one: heavier, or of matter that flows."""
    rounds = _measured(log)
    if not rounds:
        return False
    moved = rounds[-1]["largest_displacement"]
    return moved["stiff"] > moved["soft"]


def _is_stiffened(log: RangeLog) -> bool:
    """Whether a part is rigid at the stiff end though linear elements would let it be seen move."""
    if log.proposal is None or not log.load:
        return False
    rigid = any(End.STIFF in part.rigid for part in log.proposal.parts.values())
    return rigid and log.load["linear_sag"]["stiff"] >= DISTINCT


def _reviewed(logs: Sequence[RangeLog]) -> dict[str, Any]:
    """How many objects the critic looked at, let pass, and how many of their cells were right."""
    reviews = [log.review for log in logs if log.review]
    passed = [review["right"] for review in reviews if review["accepted"]]
    rest = [review["right"] for review in reviews if not review["accepted"]]
    means = {key: float(np.mean(v)) if v else None for key, v in
             (("right_of_passed", passed), ("right_of_rest", rest))}  # fmt: skip
    return {"objects": len(reviews), "passed": len(passed), **means}


def _as_linear(logs: Sequence[RangeLog]) -> dict[str, int]:
    """What linear elements at rest would have told: of how many objects the same, that ends differ.

    The sags of both ends differ by at least half of what motions must, which go twice as far.
    """
    same = total = 0
    for log in logs:
        if rounds := _measured(log):
            sag = log.load["linear_sag"]
            apart = abs(sag["soft"] - sag["stiff"]) >= DISTINCT / 2
            same += apart == (rounds[-1]["difference"] >= DISTINCT)
            total += 1
    return {"same": same, "of": total}
