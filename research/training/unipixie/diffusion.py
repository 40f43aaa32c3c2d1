"""What the paper compares its flow with: a conditional 3D U-Net that denoises the whole field.

UniPixie supplement, C.2: DDPM with 1,000 steps and linear variances (Ho et al. 2020), sampled by 50
deterministic ones (DDIM, Song et al. 2021), time and alpha by adaptive group norm, widths 1, 2, 4,
8 times the first. It reads the cube of learned features that the flow reads.
"""

from __future__ import annotations

from itertools import pairwise

import torch
from torch import Tensor, nn

from ....predictors.unipixie.network import MATTER, TIMES, TimeWaves, UniPixieConfig
from .batch import MatterBatch, part_means, spread_parts, voxels_of
from .loss import MatterOutput
from .regression import STEER, RegressionUNet

NOISINGS, STEPS = 1000, 50
FIRST, LAST = 1e-4, 0.02  # variances that the first and the last noising add (Ho et al. 2020)
WIDTHS = (24, 48, 96, 192)
EASE = 3.0  # deviations of matter become one: it lies within [-1, 1] with a deviation of a third


class DiffusionUNet(RegressionUNet):
    """Noise in a field of matter (batch, 3, x, y, z), and classes, steered by alpha and time."""

    def __init__(self, config: UniPixieConfig, widths: tuple[int, ...] = WIDTHS) -> None:
        super().__init__(config, widths)
        self.enter = nn.Conv3d(config.features + MATTER, widths[0], 3, padding=1)
        steer = (nn.Linear(2 * TIMES, STEER), nn.SiLU(), nn.Linear(STEER, STEER))
        self.time = nn.Sequential(TimeWaves(), *steer)

    def denoise(self, grid: Tensor, noisy: Tensor, alpha: Tensor, time: Tensor) -> Tensor:
        """Return (batch, 3 + 8, x, y, z) at ``time`` (batch,), a whole number of noisings."""
        steer = self.alpha(alpha[:, None]) + self.time(time / NOISINGS)
        return self.unet(torch.cat([grid, noisy.to(grid.dtype)], 1), steer)


def kept(time: Tensor) -> Tensor:
    """Share of the field's variance that ``time`` noisings leave: the product of 1 - beta."""
    beta = torch.linspace(FIRST, LAST, NOISINGS, device=time.device)
    return torch.cat([beta.new_ones(1), (1 - beta).cumprod(0)])[time.long()]


def denoise(network: DiffusionUNet, batch: MatterBatch) -> MatterOutput:
    """Return the matter that the U-Net makes of a noised batch, as its noise implies it."""
    grid = voxels_of(network.project, batch).grid
    ends = torch.stack([part_means(axis, batch) for axis in batch.end.unbind(-1)], -1)
    clean = EASE * spread_parts(ends.nan_to_num(), batch.label).movedim(-1, 1)
    # Evenly: the flow's times are seldom near its start, where sampling begins.
    time = torch.randint(1, NOISINGS + 1, batch.time.shape, device=clean.device).float()
    share = kept(time)[:, None, None, None, None]
    noise = torch.randn_like(clean)
    noisy = share.sqrt() * clean + (1 - share).sqrt() * noise
    found = network.denoise(grid, noisy, batch.alpha, time)
    index = batch.voxel[..., None]

    def there(cube: Tensor) -> Tensor:
        flat = cube.flatten(2).movedim(1, -1)
        return flat.gather(1, index.expand(-1, -1, flat.shape[-1]))

    # What is minimised is the error of the noise: said as an end of the flow that is as far off.
    wrong = there((found[:, :MATTER] - noise).float())
    return MatterOutput(batch.end - wrong, there(found[:, MATTER:]), wrong.new_zeros(()))


@torch.no_grad()
def sample_diffusion(
    network: DiffusionUNet, grid: Tensor, alpha: Tensor, noise: Tensor, *, steps: int = STEPS
) -> tuple[Tensor, Tensor]:
    """Field (batch, 3, x, y, z) and logits of classes that ``noise`` of that shape becomes."""
    x, line = noise, torch.linspace(NOISINGS, 0, steps + 1, device=noise.device).round()
    found = grid.new_zeros(())
    for now, then in pairwise(line):
        found = network.denoise(grid, x, alpha, now.expand(len(x))).float()
        here, next_ = kept(now), kept(then)
        end = (x - (1 - here).sqrt() * found[:, :MATTER]) / here.sqrt()
        end = end.clamp(-EASE, EASE)  # matter lies within [-1, 1]
        left = (x - here.sqrt() * end) / (1 - here).sqrt()
        x = next_.sqrt() * end + (1 - next_).sqrt() * left
    return x / EASE, found[:, MATTER:]
