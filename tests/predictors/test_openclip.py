"""OpenCLIP's value path on a tiny model with random weights: there are none to download here."""

import sys
from importlib.util import find_spec

import numpy as np
import pytest
from autophyx_tet.fem.errors import InputError
from autophyx_tet.predictors.encoders import Encoder, load_encoder

from .torchvision import with_operators

absent = find_spec("open_clip") is None
needs_package = pytest.mark.skipif(absent, reason="extra openclip not installed")
WIDTH, PATCH, DIM = 32, 8, 12


def packages():
    """Torch and open_clip, imported where they are needed: six seconds."""
    with_operators()
    import open_clip
    import torch

    return torch, open_clip


@pytest.fixture(scope="module")
def encoder():
    from autophyx_tet.predictors.encoders.openclip import OpenClip

    torch, open_clip = packages()
    torch.manual_seed(0)
    vision = {"layers": 3, "width": WIDTH, "head_width": 8, "patch_size": PATCH, "image_size": 32}
    text = {"context_length": 16, "vocab_size": 49408, "width": WIDTH, "heads": 4, "layers": 2}
    model = open_clip.CLIP(DIM, vision, text)
    model.visual.image_mean, model.visual.image_std = (0.5,) * 3, (0.25,) * 3
    return OpenClip.of(model, open_clip.SimpleTokenizer(context_length=16))


def pictures(*size):
    return np.random.default_rng(0).random((5, *size, 3))


@pytest.mark.external
@needs_package
def test_shape_norm_and_determinism(encoder):
    """A unit vector per patch at any size, the same on every call; texts share the space."""
    assert isinstance(encoder, Encoder)
    for size, cells in (((32, 32), (4, 4)), ((50, 24), (6, 3))):
        first, second = encoder.dense(pictures(*size)), encoder.dense(pictures(*size))
        assert first.shape == (5, *cells, DIM)
        assert np.allclose(np.linalg.norm(first, axis=-1), 1, atol=1e-5)
        assert (first == second).all()
    words = encoder.text(["wood", "a chair of steel"])
    assert words.shape == (2, DIM)
    assert np.allclose(np.linalg.norm(words, axis=1), 1, atol=1e-5)


@pytest.mark.external
@needs_package
def test_last_block_has_no_residual_and_no_mlp(encoder):
    """Scaling the last block's MLP, keys and queries changes nothing; its values do."""
    last = encoder._network.visual.transformer.resblocks[-1]
    before = encoder.dense(pictures(32, 32))
    torch, _ = packages()
    with torch.no_grad():
        last.mlp.c_proj.weight.mul_(100)
        last.attn.in_proj_weight[: 2 * WIDTH].normal_()
        assert np.allclose(encoder.dense(pictures(32, 32)), before)
        last.attn.in_proj_weight[2 * WIDTH :].zero_()
        blank = encoder.dense(pictures(32, 32))
    # Without values nothing of the picture is left: with a residual path it would be.
    assert np.ptp(blank, axis=(0, 1, 2)).max() < 1e-6


@pytest.mark.external
@needs_package
def test_absent_weights_say_the_way_out():
    """A tag whose weights are not on this machine names the command that fetches them."""
    with pytest.raises(InputError, match=r"hf download laion/.* or name a file"):
        load_encoder("openclip")
    with pytest.raises(InputError, match="its tags are"):
        load_encoder("openclip:no_such_tag")


def test_absent_package_says_the_way_out(monkeypatch):
    """Without the extra, the message names it and the encoder that needs none."""
    monkeypatch.setitem(sys.modules, "open_clip", None)
    with pytest.raises(InputError, match=r"autophyx-tet\[openclip\].*--encoder embedded"):
        load_encoder("openclip")
