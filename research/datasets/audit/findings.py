"""What is wrong with a proposal: constraints that break, ends that fail, ends that move alike."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

from ....fem.mpm.time_step import Failure, FailureKind
from .probe import EndMotion, Load, Probe, difference
from .proposal import End, Proposal

# Motions nearer to each other than this share of the longest side look alike: 1.3 pixels where the
# body fills 128, and more than what a grid of 20 cells gets wrong of a motion of a tenth.
DISTINCT = 0.01

FlawKind = FailureKind | Literal["constraint", "indistinguishable"]


@dataclass(frozen=True)
class Flaw:
    """One thing that is wrong, at an ``end`` and in a ``part`` where it is of one."""

    kind: FlawKind
    message: str
    end: End | None = None
    part: str = ""

    def document(self) -> dict[str, Any]:
        """Plain data."""
        end = None if self.end is None else str(self.end)
        return {"kind": self.kind, "end": end, "part": self.part, "message": self.message}


class Examination(NamedTuple):
    """What was found, and what was measured: ``difference`` [1] is None where an end failed."""

    findings: tuple[Flaw, ...]
    difference: float | None = None
    steps: tuple[int, int] = (0, 0)
    moved: tuple[float, float] = (0.0, 0.0)

    def document(self) -> dict[str, Any]:
        """Plain data: displacements and difference are shares of the longest side."""
        return {
            "findings": [finding.document() for finding in self.findings],
            "difference": self.difference,
            "largest_displacement": dict(zip(End, self.moved, strict=True)),
            "substeps": dict(zip(End, self.steps, strict=True)),
        }


class Examiner:
    """Examines the proposals for one object under one load; an end that stays is run once.

    The load is that of the ``first`` proposal; None before anything was simulated.
    """

    def __init__(self, probe: Probe, first: Proposal) -> None:
        self.probe, self._first = probe, first
        self.load: Load | None = None
        self._known: dict[Any, EndMotion] = {}

    def examine(self, proposal: Proposal) -> Examination:
        """Check constraints, then the number of steps, then run both ends and compare them."""
        if broken := proposal.broken():
            message = "a sample of the ranges may break it, or it cannot be read"
            return Examination(tuple(Flaw("constraint", f"{line}: {message}") for line in broken))
        probe, load = self.probe, self._settled()
        stiff = [(end, f) for end in End for f in probe.too_stiff(proposal, end, load)]
        if stiff:
            return Examination(tuple(_found(end, failure) for end, failure in stiff))
        runs = (self._run(proposal, End.SOFT, load), self._run(proposal, End.STIFF, load))
        failed = [
            _found(end, run.failure)
            for end, run in zip(End, runs, strict=True)
            if run.failure is not None
        ]
        steps = (runs[0].substeps, runs[1].substeps)
        moved = (runs[0].largest / probe.length, runs[1].largest / probe.length)
        if failed:
            return Examination(tuple(failed), None, steps, moved)
        apart = difference(*runs, probe.part, probe.length)
        alike = f"the ends move alike: {apart:.2%} of the longest side apart, wanted {DISTINCT:.0%}"
        findings = () if apart >= DISTINCT else (Flaw("indistinguishable", alike),)
        return Examination(findings, apart, steps, moved)

    def _settled(self) -> Load:
        """Return the load, found at the first call."""
        if self.load is None:
            self.load, run = self.probe.tried_load(self._first)
            self._known[_key(self._first, End.SOFT)] = run
        return self.load

    def _run(self, proposal: Proposal, end: End, load: Load) -> EndMotion:
        key = _key(proposal, end)
        if key not in self._known:
            self._known[key] = self.probe.simulate(proposal, end, load)
        return self._known[key]


def _key(proposal: Proposal, end: End) -> tuple[Any, ...]:
    """What the motion of an end depends on."""
    side = list(End).index(end)
    return (end, *((name, p.value(end), p.matter[side]) for name, p in proposal.parts.items()))


def _found(end: End, failure: Failure) -> Flaw:
    return Flaw(failure.kind, str(failure), end, failure.part)
