"""Laws of the image network: sizes, unit norm, and the colours of its finest level."""

import numpy as np
import pytest
import torch
from autophyx_tet.predictors.encoders.plain import (
    COLOURS,
    MULTIPLE,
    STRIDE,
    Widths,
    colours,
    head,
    levels,
)
from autophyx_tet.research.training.encoder.head import Head, Linear, shipped_weights

from .backbone import SMALLEST, new_backbone

DIM = 24


pytestmark = pytest.mark.usefixtures("one_thread")


def test_head_is_small_and_of_unit_norm():
    """The shipped file is far below 6 MB; a unit vector per 4 x 4 pixels of any size."""
    assert sum(Widths().groups) * 384 * 2 < 1e6
    weights = new_backbone(SMALLEST, seed=0) | random_head()
    found = levels(weights, torch.rand(2, 4, 2 * MULTIPLE, MULTIPLE))
    assert tuple(level.shape[1] for level in found) == SMALLEST.groups
    vectors = head(weights, found)
    assert vectors.shape == (2, 2 * MULTIPLE // STRIDE, MULTIPLE // STRIDE, DIM)
    assert torch.allclose(vectors.norm(dim=-1), torch.ones(()), atol=1e-5)


def random_head():
    """Weights of a head by chance, in the shape that is shipped."""
    rng = np.random.default_rng(0)
    read = Linear(rng.normal(size=(sum(SMALLEST.groups), 9)), rng.normal(size=9))
    axes = np.linalg.qr(rng.normal(size=(DIM, 10)))[0]
    fitted = Head(read, axes[:, :4], rng.normal(size=DIM), axes[:, 4:])
    return {k: v.float() for k, v in shipped_weights(fitted, SMALLEST).items()}


def test_colours_of_a_cell():
    """A half transparent orange: means, saturation, squares, products, brightness."""
    orange = torch.tensor([0.8, 0.4, 0.2, 0.5])[None, :, None, None].expand(1, 4, 8, 8)
    found = colours(orange, (2, 2))
    assert found.shape == (1, COLOURS, 2, 2)
    wanted = [0.8, 0.4, 0.2, 0.5, 0, 0.75, 0.64, 0.16, 0.04, 0.25, 0.16, 0.32, 0.08, 0.8, 0.64, 0.2]
    assert torch.allclose(found[0, :, 1, 1], torch.tensor(wanted))


def test_a_thin_rod_is_not_glass():
    """The opacity of a cell is that of what covers it, however little; an empty cell has zeros."""
    picture = torch.full((1, 4, 10, 10), 0.5)
    picture[:, 3] = 0
    picture[:, 3, :, 2] = 1
    found = colours(picture, (2, 2))
    assert torch.allclose(found[0, 3:5, :, 0], torch.ones(2, 2))
    assert (found[..., 1] == 0).all()
