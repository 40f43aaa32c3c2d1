"""What of an asset the network is given."""

import pytest
import torch
from autophyx_tet.predictors.film.predictor import _distinct
from autophyx_tet.predictors.film.unet import FilmUNet, NetworkConfig, VoxelScene

SMALL = NetworkConfig(widths=(8, 16, 16, 16, 16), text_dim=12, slot_width=16, key_width=8)

pytestmark = pytest.mark.usefixtures("one_thread")


def scene(names: torch.Tensor, part: torch.Tensor) -> VoxelScene:
    """A text of one clause about parts of these names, all known."""
    occupied = (part >= 0).float()[:, None]
    clause = torch.nn.functional.normalize(torch.ones(1, 1, 12), dim=-1)
    return VoxelScene(
        occupied.expand(-1, 8, -1, -1, -1), clause, torch.ones(1, 1, dtype=torch.bool),
        clause[:, 0], torch.tensor([True]), torch.zeros(1, 2, 1, *part.shape[1:]),
        torch.zeros(1, 2), names, torch.ones(1, names.shape[1], dtype=torch.bool), part,
    )  # fmt: skip


def test_parts_of_one_name_are_one_to_the_network():
    """Two legs and a seat are two names: the values are those of a slot for each part."""
    torch.manual_seed(0)
    net = FilmUNet(SMALL).eval()
    own = torch.nn.functional.normalize(torch.randn(1, 2, 12), dim=-1)[:, [0, 0, 1]]
    part = torch.full((1, 16, 16, 16), -1)
    part[:, 2:14, 2:6, 2:14], part[:, 2:14, 6:10, 2:14], part[:, 2:14, 10:14, 2:14] = 0, 1, 2
    first, same = _distinct(own[0].numpy())
    assert (first.tolist(), same.tolist()) == ([0, 2], [0, 0, 1])
    merged = torch.where(part < 0, -1, torch.from_numpy(same)[part])
    with torch.inference_mode():
        each = net(scene(own, part)).values
        once = net(scene(own[:, first.tolist()], merged)).values
    torch.testing.assert_close(once, each, rtol=1e-4, atol=1e-5)  # sums in another order
