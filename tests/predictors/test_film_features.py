"""Features of an image encoder as an input of the FiLM network, in training and at run time."""

import numpy as np
import pytest
import torch
from autophyx_tet.predictors.film.unet import FilmUNet, NetworkConfig, VoxelScene, halve
from autophyx_tet.research.datasets.real import CELLS, RealObject, load_real, save_real
from autophyx_tet.research.training.film.simulated_evidence import (
    simulate_features,
    spread_features,
)
from autophyx_tet.research.training.stores import look_rows

BLIND = NetworkConfig(widths=(8, 16, 16, 16, 16), text_dim=12, slot_width=16, key_width=8)
SEEING = NetworkConfig(**{**BLIND.to_dict(), "features": 6})

pytestmark = pytest.mark.usefixtures("one_thread")


def halves() -> VoxelScene:
    """A block of two halves, spoken of by one clause."""
    g = torch.Generator().manual_seed(3)
    part = torch.full((1, 16, 16, 16), -1)
    part[:, 2:14, 2:14, 2:8], part[:, 2:14, 2:14, 8:14] = 0, 1
    occupied = (part >= 0).float()[:, None]
    clause = torch.nn.functional.normalize(torch.randn(1, 1, 12, generator=g), dim=-1)
    return VoxelScene(
        occupied.expand(-1, 8, -1, -1, -1), clause, torch.ones(1, 1, dtype=torch.bool),
        clause[:, 0], torch.tensor([False]), torch.zeros(1, 2, 1, 16, 16, 16),
        torch.zeros(1, 2), clause, torch.zeros(1, 1, dtype=torch.bool), part,
    )  # fmt: skip


def seen(scene: VoxelScene, dims: int = 6) -> VoxelScene:
    """The upper half looks like one thing, the lower like another."""
    looks = torch.eye(dims)[:2]
    cube = looks[scene.part.clamp(min=0)] * (scene.part >= 0)[..., None]
    return scene._replace(features=cube.movedim(-1, 1))


def test_a_network_without_eyes_minds_no_features():
    """Features that it was not built for, of none or of other numbers, change nothing at all."""
    torch.manual_seed(0)
    for network, dims in ((FilmUNet(BLIND), 6), (FilmUNet(SEEING), 5)):
        with torch.no_grad():
            a, b = network.eval()(halves()), network(seen(halves(), dims))
        assert torch.equal(a.values, b.values)


def test_features_change_nothing_at_first_and_can_be_learned():
    """Old weights stay what they are, and what an eye sees reaches values and binding."""
    torch.manual_seed(0)
    network = FilmUNet(SEEING).eval()  # in training the sentences are blurred
    assert network.eye is not None
    a, b = network(halves()), network(seen(halves()))
    assert torch.equal(a.values, b.values)
    (b.values.square().sum() + b.logits.square().sum()).backward()
    assert network.eye.weight.grad[:, :2].abs().amax() > 0
    assert (network.eye.weight.grad[:, 2:] == 0).all()  # nothing looks like that


def test_half_the_resolution_keeps_the_mean():
    """Of eight cells that look alike the coarse one looks the same; empty cells do not dim it."""
    scene = seen(halves())
    coarse = halve(scene).features
    assert coarse.shape[2:] == (8, 8, 8)
    torch.testing.assert_close(coarse[0, :, 4, 4, 2], torch.eye(6)[0])
    torch.testing.assert_close(halve(scene._replace(features=coarse)).features, coarse)


def test_simulated_features_are_unit_vectors_of_every_quality():
    """From the words themselves to nothing of them, and nothing where there is no part."""
    g = torch.Generator().manual_seed(0)
    words = torch.nn.functional.normalize(torch.randn(400, 6, 32, generator=g), dim=-1)
    made = simulate_features(words, g)
    torch.testing.assert_close(made.norm(dim=-1), torch.ones(400, 6))
    agree = (made * words).sum(-1)
    assert agree.amin() < 0.2
    assert agree.amax() > 0.98
    part = torch.full((400, 4, 4, 4), -1)
    part[:, 1:3] = 2
    cube = spread_features(made, part, g)
    assert (cube[:, :, 0] == 0).all()
    assert torch.allclose(cube[:, :, 1].norm(dim=1), torch.ones(400, 4, 4))
    mean = torch.nn.functional.normalize(cube[:, :, 1:3].mean((2, 3, 4)), dim=-1)
    assert (mean * made[:, 2]).sum(-1).mean() > 0.98  # of 32 voxels the fuzz averages out


def test_what_was_seen_of_slots_is_kept(tmp_path):
    """A file gives back what an encoder saw, also where it looked at some objects alone."""
    label = np.zeros((CELLS,) * 3, dtype=np.uint8)
    rng = np.random.default_rng(0)

    def thing(slots: int, looked: bool) -> RealObject:
        features = rng.standard_normal((slots, 5)).astype(np.float16) if looked else None
        names = tuple(f"wood {i}" for i in range(slots))
        return RealObject("thing", "test", label, names, np.zeros((slots, 3)), features)

    objects = [thing(2, True), thing(3, False), thing(1, True)]
    save_real(tmp_path / "real.safetensors", objects)
    back = load_real(tmp_path / "real.safetensors")
    assert back[1].features is None
    for i in (0, 2):
        np.testing.assert_array_equal(back[i].features, objects[i].features)
    rows = look_rows(back)
    assert rows[0].tolist() == [0, 1, -1, -1, -1, -1]
    assert (rows[1] == -1).all()
    assert rows[2, 0] == 5
