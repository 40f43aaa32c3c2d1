"""What training minimises: flow matching, classes, and latents that bear a little noise.

UniPixie supplement, B.2, for the head of the material point method; where the network predicts x1
its squared error is that of x1. At the flow's start it leans: the soft end of a range that the
evidence leaves uncertain is sought at its soft side, the stiff end at its stiff side, so that
ranges hold. That is expectile regression (Newey & Powell 1987), in which alpha decides the
expectile; later in the flow each step would lean once more.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional as F

from ....predictors.unipixie.network import UniPixie
from ....predictors.unipixie.predictor import ANY
from ..trainer import Losses
from .batch import MatterBatch, voxels_of

CLASS_WEIGHT = 0.05  # of the cross-entropy: begins at the size of the squared error
CONSISTENCY = 1e-4  # lambda_KL of Table S4
PERTURBATION = 0.01  # deviation of the perturbed input
CONSISTENCY_SHARE = 8  # one object in so many is encoded twice


def on_the_way(x0: Tensor, x1: Tensor, time: Tensor) -> Tensor:
    """Return x at ``time`` (batch,) of ``x0`` and ``x1`` (batch, ...)."""
    t = time.reshape(-1, *(1,) * (x0.ndim - 1))
    return (1 - t) * x0 + t * x1


class MatterOutput(NamedTuple):
    """What the head says (n, K, 3), logits (n, K, 8), and how far noise moved the latents."""

    said: Tensor
    logits: Tensor
    moved: Tensor


def matter_forward(network: UniPixie, batch: MatterBatch) -> MatterOutput:
    """Return what the network makes of a batch."""
    voxels = voxels_of(network.project, batch)
    latents = network.encode(voxels)
    x = on_the_way(batch.start, batch.end, batch.time)
    said, tokens = network.matter(x, batch.time, batch.alpha, latents, voxels)
    # The divergence of two normal distributions of unit deviation, over a share of the objects.
    some = slice(0, max(len(latents) // CONSISTENCY_SHARE, 1))
    shaken = voxels.grid[some] + PERTURBATION * batch.shake[some].movedim(-1, 1)
    shaken = shaken.to(voxels.grid.dtype)
    moved = (network.encode(voxels._replace(grid=shaken)) - latents[some]).square().mean() / 2
    return MatterOutput(said, network.classes(tokens), moved)


@dataclass(frozen=True)
class MatterLoss:
    """Means over voxels; ``lean`` as in ``MatterConfig``, ``velocity`` if that is predicted."""

    lean: float = 0.8
    velocity: bool = False

    def __call__(self, output: MatterOutput, batch: MatterBatch) -> Losses:
        """Compare what the network says of a batch with its truth."""
        wanted = batch.end - batch.start if self.velocity else batch.end
        error = wanted - output.said.float()
        leans = (batch.alpha != ANY) & (batch.time == 0)
        expectile = torch.where(leans, 0.5 + self.lean * (batch.alpha - 0.5), 0.5)
        expectile = expectile[:, None, None]
        weight = 2 * torch.where(error > 0, expectile, 1 - expectile)
        counts = batch.counts.float()

        def mean(values: Tensor) -> Tensor:
            return (values * counts).sum() / counts.sum().clamp(min=1)

        flow = mean((weight * error.square()).mean(-1))
        logits = output.logits.movedim(-1, 1).float()
        crossed = F.cross_entropy(logits, batch.matter, reduction="none")
        total = flow + CLASS_WEIGHT * mean(crossed) + CONSISTENCY * output.moved.float()
        right = (output.logits.argmax(-1) == batch.matter).float()
        found = {"mse": error.square().mean(-1), "right": right}
        return Losses(total, {name: mean(values).detach() for name, values in found.items()})
