"""The diffusion that the flow is compared with, where the right noise is known."""

import pytest
import torch
from autophyx_tet.research.training.unipixie.config import CPU_NETWORK as CPU
from autophyx_tet.research.training.unipixie.diffusion import (
    EASE,
    NOISINGS,
    DiffusionUNet,
    kept,
    sample_diffusion,
)

pytestmark = pytest.mark.usefixtures("one_thread")


class Knowing(DiffusionUNet):
    """Says the noise in a field whose matter it knows."""

    def __init__(self, truth: torch.Tensor) -> None:
        super().__init__(CPU)
        self.truth = truth

    def denoise(self, grid, noisy, alpha, time):
        share = kept(time)[:, None, None, None, None]
        noise = (noisy - share.sqrt() * EASE * self.truth) / (1 - share).sqrt()
        return torch.cat([noise, torch.zeros(len(noisy), 8, *noisy.shape[2:])], 1)


def test_noising_ends_in_noise():
    """Nothing is lost at time 0, ever more later, and of 1,000 noisings 4e-5 is left."""
    left = kept(torch.arange(NOISINGS + 1))
    assert left[0] == 1
    assert (left.diff() < 0).all()
    assert left[1].item() == pytest.approx(1 - 1e-4)
    assert left[-1].item() == pytest.approx(4.04e-5, rel=0.01)  # Ho et al. 2020, section 4


@pytest.mark.slow
@pytest.mark.parametrize("steps", [1, 50])
def test_who_knows_the_noise_finds_the_matter(steps):
    """From any noise, in any number of steps: the deterministic sampler is exact where eps is."""
    g = torch.Generator().manual_seed(0)
    truth = torch.rand(2, 3, 4, 4, 4, generator=g) * 1.8 - 0.9
    noise = torch.randn(2, 3, 4, 4, 4, generator=g)
    found, _ = sample_diffusion(Knowing(truth), truth, torch.zeros(2), noise, steps=steps)
    # Of a field under 4e-5 of its variance single precision keeps four digits.
    torch.testing.assert_close(found, truth, atol=1e-3, rtol=0)


def test_time_and_alpha_steer():
    """Both reach every voxel once the steering has weights."""
    torch.manual_seed(0)
    network = DiffusionUNet(CPU).eval()
    for block in (*network.falling, *network.rising):
        torch.nn.init.normal_(block.steer.weight, std=0.1)
    grid, x = torch.randn(1, CPU.features, 8, 8, 8), torch.randn(1, 3, 8, 8, 8)
    with torch.no_grad():
        early, late, stiff = (
            network.denoise(grid, x, torch.tensor([alpha]), torch.tensor([time]))
            for alpha, time in ((0.0, 10.0), (0.0, 900.0), (1.0, 10.0))
        )
    assert early.shape == (1, 11, 8, 8, 8)
    for other in (late, stiff):
        assert ((other - early).abs().amax(1) > 0).all()
