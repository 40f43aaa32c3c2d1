"""The trainer: Adam, warm-up and cosine, bfloat16, moving average, clipping, exact resume."""

from __future__ import annotations

import copy
import json
import logging
import math
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from ...fem.errors import InputError
from ..dataset.objects import make_composites, make_objects
from ..dataset.real import load_real
from ..dataset.texttable import load_text_table
from ..film_unet import FilmUNet, NetworkConfig
from ..normalisation import DEFAULT
from .loss import losses
from .samples import Mixture, Phrasebook, Sampler, procedural_store, real_store

log = logging.getLogger(__name__)

Report = Callable[[dict], None]


@dataclass(frozen=True)
class TrainingConfig:
    """A run. ``minutes`` ends it early; a run is repeatable only if ``steps`` end it."""

    cells: int = 32
    batch: int = 96
    steps: int = 10_000
    minutes: float | None = None
    rate: float = 1e-3
    final_rate: float = 2e-5
    warm_up: int = 200
    decay: float = 0.999  # of the moving average of the weights
    clip: float = 1.0
    text_batch: int = 2048  # clauses a step that train the slots alone, without an object
    objects: int = 12_000
    composites: int = 4_000
    seed: int = 0
    device: str = "cuda"
    bfloat16: bool = True
    compile: bool = False
    every: int = 100  # steps between two reports
    network: NetworkConfig = field(default_factory=NetworkConfig)
    mixture: Mixture = field(default_factory=Mixture)

    @classmethod
    def from_dict(cls, data: dict) -> TrainingConfig:
        """Build from plain data, as a TOML file holds it."""
        data = dict(data)
        network = NetworkConfig.from_dict(data.pop("network", {}))
        mixture = data.pop("mixture", {})
        if "noise" in mixture:
            mixture = {**mixture, "noise": tuple(mixture["noise"])}
        try:
            return cls(**data, network=network, mixture=Mixture(**mixture))
        except TypeError as error:
            raise InputError(f"training config: {error}") from error


class Trained(NamedTuple):
    """The averaged network, the reports of the run, and how many steps it took."""

    network: FilmUNet
    history: list[dict]
    steps: int


def make_sampler(config: TrainingConfig, text: Path, real: Path | None) -> Sampler:
    """Build the stores of shapes and load the clauses."""
    rng = np.random.default_rng(config.seed)
    table = load_text_table(text)
    cells, device = config.cells, config.device
    shapes = procedural_store(make_objects(config.objects, rng), cells=cells, device=device)
    heaps = None
    if config.composites:
        heaps = make_composites(config.composites, rng)
        heaps = procedural_store(heaps, cells=cells, device=device)
    furniture = None
    if real is not None:
        furniture = real_store(load_real(real), table, cells=cells, device=device)
    book = Phrasebook(table, device)
    return Sampler(book, shapes, heaps, furniture, mixture=config.mixture, seed=config.seed)


def train(
    config: TrainingConfig,
    *,
    text: Path,
    real: Path | None = None,
    start: Path | None = None,
    resume: Path | None = None,
    report: Report | None = None,
    sampler: Sampler | None = None,
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
    """
    torch.manual_seed(config.seed)
    sampler = make_sampler(config, text, real) if sampler is None else sampler
    network = FilmUNet(config.network)
    if start is not None:
        _load_matching(network, start)
    network.to(device=config.device)
    network.to(memory_format=torch.channels_last_3d)  # type: ignore[call-overload]
    state = _State(config, network)
    if resume is not None:
        state.load(resume / "state.pt", sampler)
    state.run(sampler, report or _log, resume)
    return Trained(state.average, state.history, state.step)


class _State:
    """Weights, their average, the optimiser and the step."""

    def __init__(self, config: TrainingConfig, network: FilmUNet) -> None:
        self.config, self.network = config, network
        self.average = copy.deepcopy(network).requires_grad_(False).eval()
        fused = config.device.startswith("cuda")
        self.optimiser = torch.optim.Adam(
            network.parameters(), lr=config.rate, betas=(0.9, 0.98), fused=fused
        )
        self.step, self.history = 0, []
        self.began = time.monotonic()

    def run(self, sampler: Sampler, report: Report, folder: Path | None) -> None:
        """Take the steps that are left."""
        config = self.config
        model: nn.Module = self.network
        if config.compile:
            model = torch.compile(self.network)  # type: ignore[assignment]
        sums, since = torch.zeros(3, device=config.device), time.monotonic()
        while self.progress < 1:
            sums += self._train_step(model, sampler)
            self.step += 1
            if self.step % config.every == 0 or self.progress >= 1:
                now = time.monotonic()
                taken = (self.step - 1) % config.every + 1
                loss, mse, right = (sums / taken).tolist()
                rate = taken * config.batch / (now - since)
                line = {"step": self.step, "loss": loss, "mse": mse, "right": right}
                self.history.append(
                    {**line, "rate": self.rate, "samples_per_second": round(rate, 1)}
                )
                report(self.history[-1])
                if not math.isfinite(loss):
                    raise InputError(f"training diverged at step {self.step}: lower `rate`")
                if folder is not None:
                    self.save(folder / "state.pt", sampler)
                sums.zero_()
                since = now

    @property
    def progress(self) -> float:
        """Share of the run that is done, by steps or by time, whichever is further."""
        done = self.step / self.config.steps
        if self.config.minutes is not None:
            done = max(done, (time.monotonic() - self.began) / 60 / self.config.minutes)
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
        kind = "cuda" if config.device.startswith("cuda") else "cpu"
        with torch.autocast(kind, dtype=torch.bfloat16, enabled=config.bfloat16):
            output = model(batch.scene)
        supervised = config.network.conditioning == "grounded"
        result = losses(output, batch, supervise=supervised)
        total = result.total
        if config.text_batch:
            embedding, slot, value = sampler.book.clauses(config.text_batch, sampler.generator)
            total = total + F.mse_loss(self.network.text_values(embedding, slot), value)
        for group in self.optimiser.param_groups:
            group["lr"] = self.rate
        self.optimiser.zero_grad(set_to_none=True)
        total.backward()
        nn.utils.clip_grad_norm_(self.network.parameters(), config.clip)
        self.optimiser.step()
        # A young average would remember the random start.
        decay = min(config.decay, (self.step + 1) / (self.step + 10))
        with torch.no_grad():
            for ours, theirs in zip(
                self.average.parameters(), self.network.parameters(), strict=True
            ):
                ours.lerp_(theirs, 1 - decay)
        return torch.stack([result.total.detach(), result.mse, result.right])

    def save(self, path: Path, sampler: Sampler) -> None:
        """Write all that an exact continuation needs."""
        path.parent.mkdir(parents=True, exist_ok=True)
        torch.save(
            {
                "step": self.step,
                "elapsed": time.monotonic() - self.began,
                "history": self.history,
                "network": self.network.state_dict(),
                "average": self.average.state_dict(),
                "optimiser": self.optimiser.state_dict(),
                "generator": sampler.generator.get_state(),
                "config": json.dumps(asdict(self.config)),
            },
            path,
        )

    def load(self, path: Path, sampler: Sampler) -> None:
        """Continue from ``path`` if it is there; another config is an ``InputError``."""
        if not path.is_file():
            return
        saved = torch.load(path, map_location=self.config.device, weights_only=True)
        if json.loads(saved["config"]) != json.loads(json.dumps(asdict(self.config))):
            raise InputError(f"{path} was written with another config: resume with the same one")
        self.step, self.history = saved["step"], saved["history"]
        self.began = time.monotonic() - saved["elapsed"]
        self.network.load_state_dict(saved["network"])
        self.average.load_state_dict(saved["average"])
        self.optimiser.load_state_dict(saved["optimiser"])
        sampler.generator.set_state(saved["generator"].cpu())


def _log(line: dict) -> None:
    log.info(
        "step %d  loss %.4f  mse %.4f  right %.4f  rate %.1e  %.0f samples/s",
        *(line[name] for name in ("step", "loss", "mse", "right", "rate", "samples_per_second")),
    )


def _load_matching(network: FilmUNet, path: Path) -> None:
    """Take over the weights of a checkpoint that fit; a network of another shape keeps its own."""
    from safetensors.torch import load_file

    own = network.state_dict()
    saved = {
        k: v.float() for k, v in load_file(path).items() if k in own and own[k].shape == v.shape
    }
    log.info("%d of %d tensors taken from %s", len(saved), len(own), path)
    network.load_state_dict({**own, **saved})


def save_checkpoint(path: Path, network: FilmUNet, *, facts: dict | None = None) -> None:
    """Write the network as float16 safetensors, with its config and normalisation."""
    from safetensors.torch import save_file

    tensors = {k: v.detach().half().cpu().contiguous() for k, v in network.state_dict().items()}
    metadata = {
        "network": json.dumps(network.config.to_dict()),
        "normalisation": json.dumps(DEFAULT.to_dict()),
        "facts": json.dumps(facts or {}),
    }
    save_file(tensors, path, metadata=metadata)


def load_checkpoint(path: Path) -> FilmUNet:
    """Read a network that ``save_checkpoint`` wrote, in float32 on the CPU."""
    from safetensors import safe_open

    try:
        with safe_open(path, framework="pt") as file:
            config = NetworkConfig.from_dict(json.loads(file.metadata()["network"]))
            tensors = {key: file.get_tensor(key).float() for key in file.keys()}
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path} is not a checkpoint of the FiLM network: {error}") from error
    network = FilmUNet(config)
    network.load_state_dict(tensors)
    return network.eval()
