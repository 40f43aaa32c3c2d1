"""The whole state of a run, and its file: what is read goes on exactly as if it had not stopped."""

from __future__ import annotations

import copy
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Generic, TypeVar

import torch
from torch import nn
from torch.optim.swa_utils import get_ema_multi_avg_fn

from ...fem.errors import InputError
from .options import TrainerOptions
from .processes import gathered, processes, rank

FILE = "state.pt"
_BETAS = (0.9, 0.98)

N = TypeVar("N", bound=nn.Module)


class TrainingState(Generic[N]):
    """Weights, their moving average, the optimiser, the steps taken and the seconds they took."""

    def __init__(self, network: N, options: TrainerOptions) -> None:
        self.network, self.options = network, options
        self.average = copy.deepcopy(network).requires_grad_(False).eval()
        self.optimiser = torch.optim.AdamW(
            network.parameters(),
            lr=options.rate,
            betas=_BETAS,
            weight_decay=options.weight_decay,
            fused=options.on_gpu,
        )
        self.step, self.seconds = 0, 0.0
        self.history: list[dict[str, Any]] = []

    @property
    def progress(self) -> float:
        """Share of the run that is done."""
        return self.options.progress(self.step, self.seconds)

    @property
    def rate(self) -> float:
        """Rate of learning of the next step."""
        return self.options.rate_at(self.step, self.seconds)

    def descend(self, loss: torch.Tensor) -> None:
        """Take one step down the gradient of ``loss``, and follow with the average."""
        for group in self.optimiser.param_groups:
            group["lr"] = self.rate
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()
        nn.utils.clip_grad_norm_(self.network.parameters(), self.options.clip)
        self.optimiser.step()
        # A young average would remember the random start.
        decay = min(self.options.decay, (self.step + 1) / (self.step + 10))
        with torch.no_grad():
            average = get_ema_multi_avg_fn(decay)
            average(list(self.average.parameters()), list(self.network.parameters()), None)
        self.step += 1

    def save(self, path: Path, dice: torch.Generator, config: Mapping[str, Any]) -> None:
        """Write all that an exact continuation needs; every process has to call it.

        Parameters
        ----------
        path
            File to write, whole or not at all.
        dice
            The generator of the batches.
        config
            Plain data that the state belongs to.
        """
        every = gathered(self._randomness(dice))
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
            "config": json.dumps(config),
        }
        path.parent.mkdir(parents=True, exist_ok=True)
        half = path.with_suffix(".part")
        torch.save(state, half)
        half.replace(path)

    def load(self, path: Path, dice: torch.Generator, config: Mapping[str, Any]) -> None:
        """Continue from ``path`` if it is there; another config is an ``InputError``."""
        if not path.is_file():
            return
        saved = torch.load(path, map_location=self.options.device, weights_only=True)
        if json.loads(saved["config"]) != json.loads(json.dumps(config)):
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
        self._roll_back(saved["dice"][rank()], dice)

    def _randomness(self, dice: torch.Generator) -> dict[str, torch.Tensor]:
        """Where this process stands in everything random."""
        found = {"sampler": dice.get_state().cpu(), "cpu": torch.get_rng_state()}
        if self.options.on_gpu:
            found["cuda"] = torch.cuda.get_rng_state(self.options.device)
        return found

    def _roll_back(self, saved: Mapping[str, torch.Tensor], dice: torch.Generator) -> None:
        dice.set_state(saved["sampler"].cpu())
        torch.set_rng_state(saved["cpu"].cpu())
        if self.options.on_gpu:
            torch.cuda.set_rng_state(saved["cuda"].cpu(), self.options.device)
