"""The trainer: Adam, warm-up and cosine, bfloat16, moving average, clipping, exact resume.

Started by ``torchrun``, every process trains on batches of its own and the gradients are averaged
(``DistributedDataParallel``); the first process alone reports and writes.
"""

from __future__ import annotations

import copy
import json
import logging
import math
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F
from torch.nn.parallel import DistributedDataParallel
from torch.optim.swa_utils import get_ema_multi_avg_fn

from ...fem.errors import InputError
from ..datasets.objects import make_composites, make_objects
from ..datasets.real import load_real
from ..datasets.text_table import load_text_table
from ..film.checkpoint import load_matching
from ..film.config import Scene
from ..film.unet import FilmUNet
from .config import TrainingConfig
from .loss import losses
from .processes import agreed, gathered, joined, mean, processes, rank
from .real_slots import Wardrobe, dressed_store, with_changes_of_dress
from .samples import Sampler
from .sentences import Phrasebook
from .stores import procedural_store, real_store

log = logging.getLogger(__name__)

Report = Callable[[dict], None]


class Trained(NamedTuple):
    """The averaged network, the reports of the run, and how many steps it took."""

    network: FilmUNet
    history: list[dict]
    steps: int


def make_sampler(config: TrainingConfig, text: Path, real: Path | None) -> Sampler:
    """Build the stores of shapes and load the clauses; each process draws its own."""
    rng = np.random.default_rng((config.seed, rank()))
    table = load_text_table(text)
    cells, device = config.cells, config.device
    book = Phrasebook(table, device)
    shapes = procedural_store(make_objects(config.objects, rng), cells=cells, device=device)
    heaps = furniture = dressed = None
    if config.composites:
        heaps = make_composites(config.composites, rng)
        heaps = procedural_store(heaps, cells=cells, device=device)
    if real is not None:
        objects = load_real(real)
        wardrobe = Wardrobe(objects, table)
        furniture = real_store(objects, table, cells=cells, device=device)
        dressed = dressed_store(shapes, wardrobe, book, config.seed)
        furniture = with_changes_of_dress(furniture, wardrobe, rng)
    return Sampler(
        book, shapes, heaps, furniture, mixture=config.mixture, seed=config.seed + 7919 * rank(),
        dressed=dressed, coarse_evidence=config.network.fine,
    )  # fmt: skip


def train(
    config: TrainingConfig,
    *,
    text: Path,
    real: Path | None = None,
    start: Path | None = None,
    resume: Path | None = None,
    report: Report | None = None,
    sampler: Sampler | None = None,
    pause: float | None = None,
) -> Trained:
    """Train a network.

    Parameters
    ----------
    text, real
        Files of clauses and of real objects for training.
    start
        Weights to begin with; the optimiser is new.
    resume
        Folder of a whole state: continued if it is there, kept up to date at every report.
    report
        Called with each report: step, loss, mse, right, rate, samples per second.
    sampler
        Where batches come from, if not from ``text`` and ``real``.
    pause
        Seconds after which to stop for now: ``resume`` holds the state to go on from.
    """
    with joined(config.device):
        return _train(config, text, real, start, resume, report, sampler, pause)


def _train(config, text, real, start, resume, report, sampler, pause) -> Trained:
    torch.manual_seed(config.seed + rank())
    sampler = make_sampler(config, text, real) if sampler is None else sampler
    torch.manual_seed(config.seed)  # the same first weights in every process
    network = FilmUNet(config.network)
    if start is not None:
        load_matching(network, start)
    network.to(device=config.device)
    network.to(memory_format=torch.channels_last_3d)  # type: ignore[call-overload]
    torch.manual_seed(config.seed + rank())
    state = _State(config, network)
    if resume is not None:
        state.load(resume / STATE, sampler)
    state.run(sampler, report or _log, resume, pause)
    return Trained(state.average, state.history, state.step)


STATE = "state.pt"
_CLOCK = 10  # steps between two looks at the first process's clock


class _Step(nn.Module):
    """All that a step asks of the network, as one call: what parallel training needs."""

    def __init__(self, network: FilmUNet, compiled: bool) -> None:
        super().__init__()
        self.network = network
        if compiled:
            network.compile(dynamic=False)

    def forward(self, scene: Scene, clauses: tuple[Tensor, Tensor] | None):
        """Return the output for a scene, and the values of clauses alone."""
        output = self.network(scene)
        return output, None if clauses is None else self.network.text_values(*clauses)


class _State:
    """Weights, their average, the optimiser, the step and the seconds it took."""

    def __init__(self, config: TrainingConfig, network: FilmUNet) -> None:
        self.config, self.network = config, network
        self.average = copy.deepcopy(network).requires_grad_(False).eval()
        self.on_gpu = config.device.startswith("cuda")
        self.optimiser = torch.optim.Adam(
            network.parameters(), lr=config.rate, betas=(0.9, 0.98), fused=self.on_gpu
        )
        self.step, self.history, self.seconds = 0, [], 0.0

    def run(
        self, sampler: Sampler, report: Report, folder: Path | None, pause: float | None
    ) -> None:
        """Take the steps that are left, or those that fit before the pause."""
        config, model = self.config, self._parallel()
        began, before = time.monotonic(), self.seconds
        sums, taken, since = torch.zeros(3, device=config.device), 0, began
        stop = False
        while self.progress < 1 and not stop:
            sums += self._train_step(model, sampler)
            self.step, taken = self.step + 1, taken + 1
            timed = config.minutes is not None or pause is not None
            if timed and self.step % _CLOCK == 0:
                elapsed = agreed(time.monotonic() - began, config.device)
                self.seconds = before + elapsed
                stop = pause is not None and elapsed >= pause
            if self.step % config.every == 0 or self.progress >= 1 or stop:
                now = time.monotonic()
                speed = taken * config.batch * processes() / (now - since)
                self._report(sums / taken, speed, report)
                if folder is not None:
                    self.save(folder / STATE, sampler)
                sums, taken, since = torch.zeros_like(sums), 0, now

    def _parallel(self) -> nn.Module:
        step = _Step(self.network, self.config.compile)
        if processes() == 1:
            return step
        unused = self.config.network.conditioning != "grounded"
        return DistributedDataParallel(
            step, find_unused_parameters=unused, gradient_as_bucket_view=True
        )

    def _report(self, means: Tensor, speed: float, report: Report) -> None:
        loss, mse, right = mean(means).tolist()
        if not math.isfinite(loss):
            raise InputError(f"training diverged at step {self.step}: lower `rate`")
        line = {"step": self.step, "loss": loss, "mse": mse, "right": right}
        self.history.append({**line, "rate": self.rate, "samples_per_second": round(speed, 1)})
        if rank() == 0:
            report(self.history[-1])

    @property
    def progress(self) -> float:
        """Share of the run that is done, by steps or by time, whichever is further."""
        done = self.step / self.config.steps
        if self.config.minutes is not None:
            done = max(done, self.seconds / 60 / self.config.minutes)
        return done

    @property
    def rate(self) -> float:
        """Learning rate: linear warm-up, then half a cosine."""
        config = self.config
        warm = min(1.0, (self.step + 1) / max(config.warm_up, 1))
        fall = (1 + math.cos(math.pi * min(self.progress, 1.0))) / 2
        return warm * (config.final_rate + (config.rate - config.final_rate) * fall)

    def _train_step(self, model: nn.Module, sampler: Sampler) -> Tensor:
        config = self.config
        with torch.no_grad():
            batch = sampler.draw(config.batch)
            alone = None
            if config.text_batch:
                alone = sampler.book.clauses(config.text_batch, sampler.generator)
        kind = "cuda" if self.on_gpu else "cpu"
        with torch.autocast(kind, dtype=torch.bfloat16, enabled=config.bfloat16):
            output, said = model(batch.scene, alone and alone[:2])
        supervise = config.network.conditioning == "grounded"
        result = losses(output, batch, supervise=supervise, edge=config.edge)
        total = result.total
        if alone is not None:
            total = total + F.mse_loss(said, alone[2])
        for group in self.optimiser.param_groups:
            group["lr"] = self.rate
        self.optimiser.zero_grad(set_to_none=True)
        total.backward()
        nn.utils.clip_grad_norm_(self.network.parameters(), config.clip)
        self.optimiser.step()
        # A young average would remember the random start.
        decay = min(config.decay, (self.step + 1) / (self.step + 10))
        with torch.no_grad():
            average = get_ema_multi_avg_fn(decay)
            average(list(self.average.parameters()), list(self.network.parameters()), None)
        return torch.stack([result.total.detach(), result.mse, result.right])

    def save(self, path: Path, sampler: Sampler) -> None:
        """Write all that an exact continuation needs; every process has to call it."""
        dice = {"sampler": sampler.generator.get_state().cpu(), "cpu": torch.get_rng_state()}
        if self.on_gpu:
            dice["cuda"] = torch.cuda.get_rng_state(self.config.device)
        every = gathered(dice)
        if rank() != 0:
            return
        state = {
            "step": self.step,
            "seconds": self.seconds,
            "history": self.history,
            "network": self.network.state_dict(),
            "average": self.average.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "dice": every,
            "config": json.dumps(asdict(self.config)),
        }
        path.parent.mkdir(parents=True, exist_ok=True)
        half = path.with_suffix(".part")
        torch.save(state, half)
        half.replace(path)

    def load(self, path: Path, sampler: Sampler) -> None:
        """Continue from ``path`` if it is there; another config is an ``InputError``."""
        if not path.is_file():
            return
        saved = torch.load(path, map_location=self.config.device, weights_only=True)
        if json.loads(saved["config"]) != json.loads(json.dumps(asdict(self.config))):
            raise InputError(f"{path} was written with another config: resume with the same one")
        if len(saved["dice"]) != processes():
            raise InputError(
                f"{path} is the state of {len(saved['dice'])} processes, not of {processes()}"
            )
        self.step, self.history = saved["step"], saved["history"]
        self.seconds = saved["seconds"]
        self.network.load_state_dict(saved["network"])
        self.average.load_state_dict(saved["average"])
        self.optimiser.load_state_dict(saved["optimiser"])
        dice = saved["dice"][rank()]
        sampler.generator.set_state(dice["sampler"].cpu())
        torch.set_rng_state(dice["cpu"].cpu())
        if self.on_gpu:
            torch.cuda.set_rng_state(dice["cuda"].cpu(), self.config.device)


def _log(line: dict) -> None:
    log.info(
        "step %d  loss %.4f  mse %.4f  right %.4f  rate %.1e  %.0f samples/s",
        *(line[name] for name in ("step", "loss", "mse", "right", "rate", "samples_per_second")),
    )
