"""How well a network of ranges does: errors at every alpha, order, and whether its ranges hold.

Objects are drawn as in training, from shapes and categories of choice; the truth of a part is one
plausible matter of what it is called.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from ....predictors.unipixie.network import UniPixie
from ....predictors.unipixie.predictor import ANY, SAMPLE_STEPS, RangeCalibration
from .batch import MatterBatch, part_means, voxels_of
from .diffusion import DiffusionUNet, sample_diffusion
from .regression import RegressionUNet, regress
from .sampler import MatterSampler

ENDS = (0.0, 0.5, 1.0)
LADDER = (0.0, 0.25, 0.5, 0.75, 1.0)
SAMPLES = 24  # of which the 80 % interval leaves out the outer tenths
INTERVAL = (0.1, 0.9)
WANTED = 0.8  # share of the truth that the interval is to hold
HELD = 0.95  # share of the truth that a range is to hold
OBJECTS_AT_ONCE = 16
UNCALIBRATED = RangeCalibration()

# For alpha, or for ``ANY`` and where the flow starts: values (n, K, 3) and logits (n, K, 8).
Answers = Callable[[float, Tensor], tuple[Tensor, Tensor]]


@dataclass(frozen=True)
class RangeScores:
    """Scores of one network on one set of objects.

    ``mse`` by alpha, of normalised log E, nu, log rho; ``right`` share of voxels with the right
    class; ``monotone`` share of voxels whose E never falls as alpha rises; ``covered`` share of
    parts whose true E lies between the ends, and ``margin`` by how much (normalised log E) the ends
    must move for 95 % of them; ``in_interval`` share of parts in the 80 % interval of samples, and
    ``spread`` by what factor they must lie further apart for 80 %. Shares are with the calibration
    that was given, margin and spread without.
    """

    mse: dict[float, tuple[float, float, float]]
    right: float
    monotone: float
    covered: float
    margin: float
    in_interval: float
    spread: float


class _Answered(NamedTuple):
    """Of some objects: values on the ladder and truth at its ends, the class right, samples.

    ``values`` (rungs, n, K, 3), ``ends`` (2, n, K, 3), ``right`` and ``counts`` (n, K); of parts
    ``outside`` (n, 6), by how much their true E lies outside the range, and ``factor`` (n, 6), how
    much wider the samples' interval must be to hold it; NaN where there is no part.
    """

    values: Tensor
    ends: Tensor
    right: Tensor
    counts: Tensor
    outside: Tensor
    factor: Tensor


def answers_of(
    network: UniPixie | RegressionUNet, batch: MatterBatch, *, steps: int = SAMPLE_STEPS
) -> Answers:
    """Return how a network answers for the objects of a batch, as at run time.

    A flow takes ``steps`` to a sample, and one from the noise's middle to a place in the range.
    """
    if isinstance(network, DiffusionUNet):
        return _denoised(network, batch)
    if isinstance(network, RegressionUNet):
        return lambda alpha, _: regress(network, batch._replace(alpha=batch.alpha * 0 + alpha))[:2]
    voxels = voxels_of(network.project, batch)
    latents = network.encode(voxels)

    def answer(alpha: float, start: Tensor) -> tuple[Tensor, Tensor]:
        asked = batch.alpha * 0 + alpha
        if alpha == ANY:
            return network.sample_matter(latents, voxels, asked, start, steps=steps)
        return network.sample_matter(latents, voxels, asked, torch.zeros_like(start), steps=1)

    return answer


def _denoised(network: DiffusionUNet, batch: MatterBatch) -> Answers:
    """Answers of the diffusion, each from noise of its own: it has no middle to start from."""
    grid = voxels_of(network.project, batch).grid
    index = batch.voxel[..., None]

    def answer(alpha: float, start: Tensor) -> tuple[Tensor, Tensor]:
        noise = torch.randn(len(grid), start.shape[-1], *grid.shape[2:], device=grid.device)
        field = sample_diffusion(network, grid, batch.alpha * 0 + alpha, noise)
        flat = (cube.flatten(2).movedim(1, -1) for cube in field)
        values, logits = (f.gather(1, index.expand(-1, -1, f.shape[-1])) for f in flat)
        return values, logits

    return answer


@torch.no_grad()
def range_scores(
    network: UniPixie | RegressionUNet,
    sampler: MatterSampler,
    *,
    objects: int = 96,
    seed: int = 5,
    samples: int = SAMPLES,
    calibration: RangeCalibration = UNCALIBRATED,
) -> RangeScores:
    """Score a network on ``objects`` objects of a sampler, ``samples`` drawn for an interval."""
    found = [
        _answered(network, sampler, min(OBJECTS_AT_ONCE, objects - begin), seed + begin, samples)
        for begin in range(0, objects, OBJECTS_AT_ONCE)
    ]
    values = torch.cat([one.values for one in found], 1)
    ends = torch.cat([one.ends for one in found], 1)
    right, counts, outside, factor = (
        torch.cat([getattr(one, name) for one in found])
        for name in ("right", "counts", "outside", "factor")
    )
    mse: dict[float, tuple[float, float, float]] = {}
    for alpha in ENDS:
        truth = ends[0] + alpha * (ends[1] - ends[0])
        error = (values[LADDER.index(alpha)] - truth).square()[counts]
        E, nu, rho = error.mean(0).tolist()
        mse[alpha] = (E, nu, rho)
    rising = (values[..., 0].diff(dim=0) >= 0).all(0)[counts]
    outside, factor = outside[~outside.isnan()], factor[~factor.isnan()]
    return RangeScores(
        mse,
        right[counts].float().mean().item(),
        rising.float().mean().item(),
        (outside <= calibration.margin).float().mean().item(),
        outside.quantile(HELD).clamp(min=0).item(),
        (factor <= calibration.spread).float().mean().item(),
        factor.quantile(WANTED).item(),
    )


def _answered(
    network: UniPixie | RegressionUNet, sampler: MatterSampler, count: int, seed: int, samples: int
) -> _Answered:
    soft, stiff, plausible = (_drawn(sampler, count, alpha, seed) for alpha in (0.0, 1.0, ANY))
    answer = answers_of(network, soft)
    ladder = [answer(alpha, soft.start) for alpha in LADDER]
    values = torch.stack([found.float() for found, _ in ladder])
    right = ladder[LADDER.index(0.5)][1].argmax(-1) == soft.matter
    dice = torch.Generator(soft.label.device).manual_seed(seed)
    drawn = torch.stack(
        [
            part_means(answer(ANY, sampler.noise(soft.part, dice))[0][..., 0].float(), soft)
            for _ in range(samples)
        ]
    )
    value = part_means(plausible.end[..., 0], soft)
    low, high = (part_means(values[rung, ..., 0], soft) for rung in (0, -1))
    mean = drawn.mean(0)
    bottom, top = torch.quantile(drawn, drawn.new_tensor(INTERVAL), dim=0)
    factor = torch.maximum((mean - value) / (mean - bottom), (value - mean) / (top - mean))
    return _Answered(
        values, torch.stack([soft.end, stiff.end]), right, soft.counts,
        torch.maximum(low - value, value - high), factor,
    )  # fmt: skip


def _drawn(sampler: MatterSampler, count: int, alpha: float, seed: int) -> MatterBatch:
    """The same objects, evidence and noise for every alpha."""
    sampler.generator.manual_seed(seed)
    item = sampler.some(count)
    return sampler.compose(item, torch.full((count,), alpha, device=item.label.device))
