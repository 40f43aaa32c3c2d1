"""Batches for the UniPixie network hold what they say, and what is minimised is what is wanted."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from autophyx_tet.predictors.unipixie.network import NOISE
from autophyx_tet.predictors.unipixie.predictor import ANY
from autophyx_tet.research.datasets.objects import make_objects
from autophyx_tet.research.datasets.shapes import EMPTY
from autophyx_tet.research.training.unipixie.batch import spread_parts, voxel_places
from autophyx_tet.research.training.unipixie.config import CPU, EvidenceShares
from autophyx_tet.research.training.unipixie.loss import MatterLoss, MatterOutput
from autophyx_tet.research.training.unipixie.recipe import shapes_of, train_matter
from autophyx_tet.research.training.unipixie.sampler import MatterSampler


@pytest.fixture(scope="module")
def shapes():
    return shapes_of(make_objects(12, np.random.default_rng(0)), CPU)


def sampler_of(names, shapes, **evidence):
    config = replace(CPU, evidence=replace(EvidenceShares(), **evidence))
    return MatterSampler(names, shapes, None, config, seed=1)


def drawn_at(names, shapes, alpha, **evidence):
    """The same objects and evidence for every alpha."""
    sampler = sampler_of(names, shapes, **evidence)
    return sampler.compose(sampler.some(8), torch.full((8,), alpha))


def test_alpha_runs_from_the_soft_end_to_the_stiff_one(names, shapes):
    """UniPixie A.1: the truth at alpha lies on the line between the ends, E in order."""
    soft, middle, stiff = (drawn_at(names, shapes, alpha).end for alpha in (0.0, 0.5, 1.0))
    assert (soft[..., 0] <= stiff[..., 0]).all()
    torch.testing.assert_close(middle, (soft + stiff) / 2)


def test_a_plausible_matter_lies_in_the_range(names, shapes):
    soft, stiff = (drawn_at(names, shapes, alpha).end for alpha in (0.0, 1.0))
    asked = drawn_at(names, shapes, ANY).end
    slack = 1e-5  # round-off of single precision
    assert ((asked >= soft - slack) & (asked <= stiff + slack)).all()


def test_voxels_lie_inside_and_know_their_part(names, shapes):
    """Their label is their part, their place that of the cell."""
    batch = drawn_at(names, shapes, 0.5)
    label = batch.label.flatten(1).gather(1, batch.voxel)
    assert (label != EMPTY).all()
    assert (label == batch.part).all()
    cells = batch.label.shape[-1]
    index = ((voxel_places(batch.voxel, cells) + 1) / 2 * cells).long()
    again = batch.label[torch.arange(8)[:, None], *index.unbind(-1)]
    assert (again == batch.part).all()


def test_values_are_spread_to_their_part_and_nowhere_else(names, shapes):
    batch = drawn_at(names, shapes, 0.5)
    own = torch.arange(6.0).expand(8, -1)[..., None]
    cube = spread_parts(own + 1, batch.label)[..., 0]
    wanted = torch.where(batch.label == EMPTY, 0, batch.label.float() + 1)
    assert torch.equal(cube, wanted)


def test_exact_words_are_the_features(names, shapes):
    """Without noise, a part's numbers hold the vector of one of the names."""
    batch = drawn_at(names, shapes, 0.5, exact=1.0, silent=0.0, coloured=0.0)
    there = batch.known[..., :384].flatten(0, 1)
    known = there[there.norm(dim=1) > 0] / 20.0
    nearest = (known @ names.embedding.float().T).max(1).values
    torch.testing.assert_close(nearest, torch.ones_like(nearest), atol=2e-3, rtol=0)  # float16
    assert (batch.known[..., 385:] == 0).all()


def test_noise_is_normal_and_mostly_shared_in_a_part(names, shapes):
    """Deviation as the flow wants it; correlation .8 within a part, 0 between parts."""
    sampler = sampler_of(names, shapes)
    part = torch.tensor([[0, 0, 1]]).expand(4000, -1)
    noise = sampler.noise(part, torch.Generator().manual_seed(0))[..., 0]
    found = torch.corrcoef(noise.T)
    sampling = 4 / 4000**0.5
    assert noise.std().item() == pytest.approx(NOISE, rel=sampling)
    assert found[0, 1].item() == pytest.approx(0.8, abs=sampling)
    assert found[0, 2].item() == pytest.approx(0.0, abs=sampling)


@pytest.mark.parametrize("alpha", [0.0, 0.25, 1.0, ANY])
def test_ends_lean_outwards(alpha, names, shapes):
    """Of a truth that is 0 or 1 with equal odds, the best answer is its expectile.

    Newey & Powell: tau (1 - x) = (1 - tau) x, so x = tau; a plausible matter wants the mean.
    """
    batch = drawn_at(names, shapes, 0.5)
    batch = batch._replace(
        alpha=torch.full((8,), alpha),
        end=torch.arange(batch.end.numel()).reshape(batch.end.shape) % 2 * 1.0,
        counts=torch.ones_like(batch.counts),
        time=torch.zeros(8),
    )
    tau = 0.5 if alpha == ANY else 0.5 + 0.8 * (alpha - 0.5)
    said = torch.full_like(batch.end, tau, requires_grad=True)
    logits = torch.zeros(*batch.matter.shape, 8)
    MatterLoss(lean=0.8)(MatterOutput(said, logits, torch.zeros(())), batch).total.backward()
    assert said.grad is not None
    assert said.grad.sum().abs().item() < 1e-5  # round-off of a sum of some thousand


@pytest.mark.long
@pytest.mark.parametrize(
    ("model", "steps"),
    [("flow", 120), ("regression", 24), pytest.param("diffusion", 36, marks=pytest.mark.long)],
)
def test_a_short_training_learns(model, steps, ranges):
    """On the CPU in seconds: the error of the last steps is half of that of the first."""
    plain = EvidenceShares(exact=1, silent=0, named=0, foreign=0, swapped=0, any=0)
    config = replace(CPU, steps=steps, every=2, objects=3, model=model, evidence=plain)
    trained = train_matter(config, ranges=ranges)
    errors = [line["mse"] for line in trained.history]
    assert np.mean(errors[-5:]) < np.mean(errors[:5]) / 2, errors
