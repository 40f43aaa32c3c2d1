"""What is found of an asset: ordered from soft to stiff, coherent, whatever the portions."""

import numpy as np
import pytest
import torch
from autophyx_tet.predictors.appearance.features import Appearance
from autophyx_tet.predictors.field import DEFAULT
from autophyx_tet.predictors.grid import Grid, PartVoxels
from autophyx_tet.predictors.unipixie import predictor as inference
from autophyx_tet.predictors.unipixie.network import UniPixie
from autophyx_tet.predictors.unipixie.predictor import (
    Cube,
    Found,
    Loaded,
    RangeCalibration,
    load_unipixie,
    voxels_on,
)
from autophyx_tet.research.training.unipixie.config import CPU_NETWORK as CPU
from autophyx_tet.research.training.unipixie.recipe import save_unipixie


@pytest.fixture(scope="module")
def network():
    torch.manual_seed(0)
    made = UniPixie(CPU)
    for parameter in made.parameters():
        if not parameter.any():
            torch.nn.init.normal_(parameter, std=0.1)
    return made.eval()


@pytest.fixture(scope="module")
def parts():
    part = np.full((12, 10, 20), -1)
    part[1:11, 1:9, 1:6] = 0
    part[4:8, 3:7, 6:19] = 1
    return PartVoxels(Grid(np.zeros(3), 0.05, part.shape), part, ("seat", "leg"))


def found_of(network, parts, seed=0):
    random = np.random.default_rng(seed)
    names = random.normal(size=(2, 384)).astype(np.float32)
    names /= np.linalg.norm(names, axis=1, keepdims=True)
    seen = Appearance(colours=random.random((*parts.part.shape, 3)).astype(np.float32))
    named = np.array([True, False])
    cube = Cube.of(parts, "z", cells=CPU.cells)
    loaded = Loaded(network, DEFAULT, RangeCalibration())
    return Found(loaded, cube, voxels_on(network, cube, parts, names, named, seen))


def test_e_never_falls_as_alpha_rises(network, parts):
    """In every token, also of a network that has learned nothing."""
    found = found_of(network, parts)
    ladder = np.stack([found.at(alpha)[:, 0] for alpha in np.linspace(0, 1, 11)])
    assert (np.diff(ladder, axis=0) >= 0).all()
    np.testing.assert_array_equal(ladder[[0, -1]], [end[:, 0] for end in found.ends])


def test_portions_change_nothing(network, parts, monkeypatch):
    """Tokens do not see each other: decoded in portions of 7 they are the same to round-off."""
    whole = found_of(network, parts).ends[0]
    monkeypatch.setattr(inference, "CHUNK", 7)
    np.testing.assert_allclose(found_of(network, parts).ends[0], whole, atol=2e-6)


def test_a_seed_is_a_sample(network, parts):
    """The same seed gives the same matter, another one another."""
    found = found_of(network, parts)
    np.testing.assert_array_equal(found.sample(3), found.sample(3))
    assert np.abs(found.sample(3) - found.sample(4)).max() > 1e-3


def test_samples_of_parts_are_means_of_samples(network, parts, monkeypatch):
    """Two of them are the first two of four; few tokens of a part tell what all of them do."""
    found = found_of(network, parts)
    four, two = found.samples(4, seed=5), found.samples(2, seed=5)
    assert four.shape == (4, 2, 3)
    np.testing.assert_allclose(four[:2], two, atol=1e-6)  # portions sum in another order
    assert (np.ptp(four, axis=0) > 1e-3).all()
    monkeypatch.setattr(inference, "MEANT", 10**6)
    whole = found_of(network, parts).samples(4, seed=5)
    state = int(np.random.SeedSequence(5).generate_state(1)[0])
    each = found.sample(state)
    for number in range(2):
        mean = each[found.cube.part == number].mean(axis=0)
        np.testing.assert_allclose(whole[0, number], mean, atol=1e-6)
    # What 128 tokens do not share averages out: less than a third of what samples differ by.
    assert np.abs(four - whole).max() < np.ptp(whole, axis=0).min() / 3


def test_a_file_gives_the_network_back(network, parts, tmp_path):
    """Weights are kept in half precision: answers agree to its round-off."""
    save_unipixie(tmp_path / "w.safetensors", network)
    read, normalisation, calibration = load_unipixie(tmp_path / "w.safetensors")
    assert (normalisation, calibration) == (DEFAULT, RangeCalibration())
    np.testing.assert_allclose(
        found_of(read, parts).likeliest[0], found_of(network, parts).likeliest[0], atol=5e-3
    )
