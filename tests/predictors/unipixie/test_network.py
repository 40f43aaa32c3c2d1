"""The UniPixie network: its size, what its parts promise, and that it learns."""

import numpy as np
import pytest
import torch
from autophyx_tet.predictors.unipixie.network import (
    Attention,
    SteeredBlock,
    Voxels,
    integrate,
    velocity_towards,
)
from autophyx_tet.research.training.unipixie.config import CPU_NETWORK as CPU
from autophyx_tet.research.training.unipixie.config import PAPER
from autophyx_tet.research.training.unipixie.heads import HEADS, JointUniPixie
from autophyx_tet.research.training.unipixie.loss import on_the_way


def size_of(*heads):
    """Parameters of a network, counted without making them."""
    with torch.device("meta"):
        return sum(p.numel() for p in JointUniPixie(PAPER, heads).parameters())


def some_voxels(n=40, batch=2, seed=0):
    random = torch.Generator().manual_seed(seed)
    cells, features = CPU.cells, CPU.features
    grid = torch.randn(batch, features, cells, cells, cells, generator=random)
    place = 2 * torch.rand(batch, n, 3, generator=random) - 1
    return Voxels(grid, place, torch.randn(batch, n, features, generator=random))


def made(seed=0):
    """A network whose gates and outputs are open."""
    torch.manual_seed(seed)
    network = JointUniPixie(CPU)
    for parameter in network.parameters():
        if not parameter.any():
            torch.nn.init.normal_(parameter, std=0.1)
    return network.eval()


@pytest.mark.slow
def test_the_papers_network_has_the_papers_size():
    """Table S3: 167 M parameters jointly, 312 M as three specialists; within 2 %."""
    assert size_of(*HEADS) == pytest.approx(167e6, rel=0.02)
    assert sum(size_of(head) for head in HEADS) == pytest.approx(312e6, rel=0.02)


def test_table_s2():
    """Layers, width and heads of every module of Table S2."""
    with torch.device("meta"):
        network = JointUniPixie(PAPER)
    width, heads = 512, 8
    assert len(network.encoder.blocks) == 6
    assert len(network.matter.decoder.blocks) == len(network.elastic.decoder.blocks) == 6
    assert len(network.springs.decoder.blocks) == 4
    assert sum(isinstance(layer, torch.nn.Linear) for layer in network.body) == 4
    for module in network.modules():
        if isinstance(module, Attention):
            assert (module.out.out_features, module.heads) == (width, heads)
    assert network.encoder.waves.to_width.in_features == 3 * 2 * 16
    assert network.encoder.queries.shape == (64, width)


def test_a_fresh_block_is_the_identity():
    """AdaLN-Zero: what goes in comes out, whatever the latents and the condition."""
    block = SteeredBlock(32, 4)
    x, latents, condition = torch.randn(2, 5, 32), torch.randn(2, 7, 32), torch.randn(2, 32)
    assert torch.equal(block(x, latents, condition), x)


@pytest.mark.parametrize("method", ["euler", "heun"])
def test_a_known_end_is_reached_in_one_step(method):
    """An exact prediction of x1 ends at x1, in as few Euler steps as one."""
    x0, x1 = torch.randn(2, 3, 4), torch.randn(2, 3, 4)
    steps = 1 if method == "euler" else 200  # the corrector stops short of the end by ``LAST``
    found = integrate(lambda x, t: velocity_towards(x1, x, t), x0, steps=steps, method=method)
    torch.testing.assert_close(found, x1, atol=1e-5 if method == "euler" else 0.1, rtol=0)


@pytest.mark.parametrize(("method", "order"), [("euler", 1), ("heun", 2)])
def test_order_of_convergence(method, order):
    """x' = 2 t x, exactly x0 exp(t^2): halving the step divides the error by 2^order."""
    x0 = torch.ones(1, 1, dtype=torch.float64)

    def error(steps):
        field = lambda x, t: 2 * t[:, None] * x  # noqa: E731
        end = integrate(field, x0, steps=steps, method=method)
        return abs(float(end) - np.e)

    assert np.log2(error(64) / error(128)) == pytest.approx(order, abs=0.1)


def test_straight_lines_have_constant_velocity():
    """Anywhere on the way from x0 to x1 the velocity is x1 - x0."""
    x0, x1, time = torch.randn(3, 4), torch.randn(3, 4), torch.tensor([0.1, 0.5, 0.9])
    x = on_the_way(x0, x1, time)
    torch.testing.assert_close(velocity_towards(x1, x, time), x1 - x0)


def test_portions_change_nothing():
    """Voxels see the latents and not each other: decoded in two portions they are the same."""
    network, voxels = made(), some_voxels()
    latents, alpha = network.encode(voxels), torch.tensor([0.2, 0.8])
    noise = torch.randn(2, 40, 3)
    whole = network.sample_matter(latents, voxels, alpha, noise)
    cut = [slice(0, 13), slice(13, 40)]
    parts = [
        network.sample_matter(
            latents, Voxels(voxels.grid, voxels.place[:, s], voxels.own[:, s]), alpha, noise[:, s]
        )
        for s in cut
    ]
    for one, two in zip(whole, zip(*parts, strict=True), strict=True):
        torch.testing.assert_close(one, torch.cat(two, 1), atol=1e-5, rtol=0)  # float32


def test_the_body_does_not_know_alpha():
    """Theta is a function of the latents; E and nu of the skinning move with alpha."""
    network, voxels = made(), some_voxels()
    latents = network.encode(voxels)
    assert network.skinning(latents).shape == (2, 650)
    noise = torch.randn(2, 40, 2)
    soft, stiff = (
        network.elastic.sample(noise, torch.full((2,), a), latents, voxels)[0] for a in (0.0, 1.0)
    )
    assert not torch.allclose(soft, stiff)
    springs = network.springs(torch.randn(2, 2049), torch.rand(2), torch.rand(2), latents)
    assert springs.shape == (2, 2049)
