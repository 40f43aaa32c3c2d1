"""The trainer: AdamW, warm-up and cosine, bfloat16, moving average, clipping, exact resume.

It knows no network, no data and no loss: all three are given. Started by ``torchrun``, every
process trains on batches of its own and the gradients are averaged (``DistributedDataParallel``);
the first process alone reports and writes.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, NamedTuple, Protocol, TypeVar, runtime_checkable

import torch
from torch import Tensor, nn
from torch.nn.parallel import DistributedDataParallel

from ...fem.errors import InputError
from .options import TrainerOptions
from .processes import agreed, join, mean, processes, rank
from .state import FILE, N, TrainingState

log = logging.getLogger(__name__)

_CLOCK = 10  # steps between two looks at the first process's clock

B = TypeVar("B", covariant=True)
Report = Callable[[dict], None]


@runtime_checkable
class Sampler(Protocol[B]):
    """Where batches come from; all its randomness is that of ``generator``, kept in the state."""

    @property
    def generator(self) -> torch.Generator:
        """The source of everything random in the batches."""

    def draw(self, n: int) -> B:
        """Return a batch of ``n`` samples."""


class Losses(NamedTuple):
    """The scalar that is minimised, and scalars to report by name."""

    total: Tensor
    reported: Mapping[str, Tensor]


@dataclass(frozen=True, eq=False)
class Trained(Generic[N]):
    """The averaged network, the reports of the run, and how many steps it took."""

    network: N
    history: list[dict]
    steps: int


def _call(network: nn.Module, batch: Any) -> Any:
    """Return what the network makes of a batch."""
    return network(batch)


def train_network(
    network: N,
    sampler: Sampler,
    loss: Callable[[Any, Any], Losses],
    options: TrainerOptions,
    *,
    forward: Callable[[N, Any], Any] = _call,
    resume: Path | None = None,
    config: Mapping[str, Any] | None = None,
    save: Callable[[N, int], None] | None = None,
    report: Report | None = None,
    pause: float | None = None,
) -> Trained[N]:
    """Train a network.

    Parameters
    ----------
    network
        What is trained, in place.
    sampler
        Where batches come from.
    loss
        Called with what ``forward`` gives and the batch, in full precision.
    options
        How the run goes.
    forward
        Called with the network and a batch, in bfloat16 if the options say so; by default the
        network is called with the batch.
    resume
        Folder of a whole state: continued if it is there, kept up to date at every report.
    config
        Plain data that the state belongs to: a state of other data is an ``InputError``.
    save
        Called by the first process with the averaged network and the steps taken, at the end.
    report
        Called with each report: step, what the loss reports, rate, samples per second.
    pause
        Seconds after which to stop for now: ``resume`` holds the state to go on from.
    """
    join(options.device)
    state = TrainingState(network.to(options.device), options)
    run = _Run(state, sampler, loss, forward)
    keep = None if resume is None else _Keeper(resume / FILE, sampler.generator, config or {})
    if keep is not None:
        state.load(*keep)
    for line in run.reports(pause):
        if rank() == 0:
            (report or _log)(line)
        if keep is not None:
            state.save(*keep)
    if save is not None and rank() == 0:
        save(state.average, state.step)
    return Trained(state.average, state.history, state.step)


class _Forward(nn.Module):
    """All that a step asks of the network, as one call: what parallel training needs."""

    def __init__(self, network: nn.Module, compute: Callable[[Any, Any], Any]) -> None:
        super().__init__()
        self.network, self.compute = network, compute

    def forward(self, batch: Any) -> Any:
        return self.compute(self.network, batch)


class _Keeper(NamedTuple):
    """What saving and loading a state need."""

    file: Path
    generator: torch.Generator
    config: Mapping[str, Any]


class _Means:
    """Means of what the loss reports, since the last report."""

    def __init__(self) -> None:
        self.names: tuple[str, ...] = ()
        self.sums: Tensor | float = 0.0
        self.taken, self.since = 0, time.monotonic()

    def add(self, losses: Losses) -> None:
        """Take in the losses of one step, without waiting for the device."""
        self.names = tuple(losses.reported)
        self.sums = self.sums + torch.stack([*losses.reported.values(), losses.total]).detach()
        self.taken += 1

    def found(self) -> tuple[dict[str, float], float]:
        """Means over steps and processes by name, and that of the total."""
        assert isinstance(self.sums, Tensor)
        *values, total = mean(self.sums / self.taken).tolist()
        return dict(zip(self.names, values, strict=True)), total

    def steps_per_second(self) -> float:
        """Speed since the last report."""
        return self.taken / (time.monotonic() - self.since)


class _Run(NamedTuple):
    """One way through the steps that are left."""

    state: TrainingState
    sampler: Sampler
    loss: Callable[[Any, Any], Losses]
    forward: Callable[[Any, Any], Any]

    def reports(self, pause: float | None) -> Iterator[dict[str, Any]]:
        """Take the steps that are left, or those that fit before the pause; yield each report."""
        state, options = self.state, self.state.options
        model, means = self._parallel(), _Means()
        began, before, stop = time.monotonic(), state.seconds, False
        while state.progress < 1 and not stop:
            means.add(self._step(model))
            timed = options.minutes is not None or pause is not None
            if timed and state.step % _CLOCK == 0:
                elapsed = agreed(time.monotonic() - began, options.device)
                state.seconds = before + elapsed
                stop = pause is not None and elapsed >= pause
            if state.step % options.every == 0 or state.progress >= 1 or stop:
                yield self._line(means)
                means = _Means()

    def _parallel(self) -> nn.Module:
        """The forward pass, compiled and joined to those of the other processes if asked."""
        options = self.state.options
        if options.compile:
            self.state.network.compile(dynamic=False)
        model = _Forward(self.state.network, self.forward)
        if processes() == 1:
            return model
        return DistributedDataParallel(
            model, find_unused_parameters=options.sparse, gradient_as_bucket_view=True
        )

    def _step(self, model: nn.Module) -> Losses:
        options = self.state.options
        with torch.no_grad():
            batch = self.sampler.draw(options.batch)
        kind = "cuda" if options.on_gpu else "cpu"
        with torch.autocast(kind, dtype=torch.bfloat16, enabled=options.bfloat16):
            output = model(batch)
        losses = self.loss(output, batch)
        self.state.descend(losses.total)
        return losses

    def _line(self, means: _Means) -> dict[str, Any]:
        """Put a report on record; a loss that is no number is an ``InputError``."""
        state = self.state
        found, total = means.found()
        if not math.isfinite(total):
            raise InputError(f"training diverged at step {state.step}: lower `rate`")
        speed = means.steps_per_second() * state.options.batch * processes()
        line = {"step": state.step, **found}
        state.history.append({**line, "rate": state.rate, "samples_per_second": round(speed, 1)})
        return state.history[-1]


def _log(line: Mapping[str, float]) -> None:
    log.info("%s", "  ".join(f"{name} {value:.4g}" for name, value in line.items()))
