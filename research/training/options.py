"""Options of any training run, with the rate of learning that follows from them."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class TrainerOptions:
    """How a network is trained. ``minutes`` end a run early; only ``steps`` make it repeatable."""

    batch: int
    steps: int
    rate: float
    minutes: float | None = None
    final_rate: float = 0.0
    warm_up: int = 0  # steps
    weight_decay: float = 0.0  # decoupled from the gradient, as in AdamW
    decay: float = 0.999  # of the moving average of the weights
    clip: float = 1.0  # largest norm of the gradient
    device: str = "cpu"
    bfloat16: bool = False
    compile: bool = False
    sparse: bool = False  # some steps give some parameters no gradient: several processes must know
    every: int = 100  # steps between two reports

    @property
    def on_gpu(self) -> bool:
        """Whether the run is on a GPU."""
        return self.device.startswith("cuda")

    def progress(self, step: int, seconds: float) -> float:
        """Share of the run that is done, by steps or by time [s], whichever is further."""
        done = step / self.steps
        return done if self.minutes is None else max(done, seconds / 60 / self.minutes)

    def rate_at(self, step: int, seconds: float) -> float:
        """Rate of learning: linear warm-up, then half a cosine."""
        warm = min(1.0, (step + 1) / max(self.warm_up, 1))
        fall = (1 + math.cos(math.pi * min(self.progress(step, seconds), 1.0))) / 2
        return warm * (self.final_rate + (self.rate - self.final_rate) * fall)
