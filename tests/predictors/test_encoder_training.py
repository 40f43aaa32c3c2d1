"""Laws of the image encoder: corpus round trip, light, exact resume, learning, the probe."""

import numpy as np
import pytest
import torch
import trimesh
from autophyx_tet.predictors.asset import Asset, Part, up_vector
from autophyx_tet.predictors.cameras import hemisphere
from autophyx_tet.predictors.encoders.corpus import Specimen, read_corpus, write_corpus
from autophyx_tet.predictors.encoders.kinds import KINDS, kind_of, plain_words
from autophyx_tet.predictors.encoders.network import (
    MULTIPLE,
    SMALLEST,
    STRIDE,
    Widths,
    head,
    new_weights,
    trunk,
)
from autophyx_tet.predictors.encoders.pictures import STILL, Variety, draw_pictures
from autophyx_tet.predictors.encoders.probe import Regions, fit_probe, score
from autophyx_tet.predictors.encoders.training import (
    TrainingOptions,
    load_state,
    new_state,
    region_features,
    save_state,
    shipped_weights,
    train,
)
from autophyx_tet.predictors.views import render_views
from trimesh.visual.material import SimpleMaterial
from trimesh.visual.texture import TextureVisuals

PIXELS = 64
TINY = TrainingOptions(steps=24, batch=6, side=64, pixels=16, warmup=4, widths=SMALLEST, rate=6e-3)


@pytest.fixture(autouse=True)
def one_thread():
    """Tensors this small are slower with more threads, on a busy machine a hundredfold."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


class Words:
    """A text encoder of random but fixed vectors; it knows every word."""

    def text(self, sentences):
        rows = [np.random.default_rng(sum(s.encode())).normal(size=SMALLEST.dim) for s in sentences]
        rows = np.array(rows)
        return (rows / np.linalg.norm(rows, axis=1, keepdims=True)).astype(np.float32)

    def knows(self, word):
        return True


def thing(number):
    """A red wooden box below a blue metal ball, of some size."""
    box, ball = trimesh.creation.box((1, 1, 0.5 + 0.2 * number)), trimesh.creation.icosphere(2, 0.4)
    ball.apply_translation([0, 0, 0.6 + 0.1 * number])
    red = SimpleMaterial(name="wood_red", diffuse=[230, 40, 30], specular=[0, 0, 0])
    blue = SimpleMaterial(name="Metal.001", diffuse=[20, 30, 230], specular=[200] * 3)
    for mesh, material in ((box, red), (ball, blue)):
        mesh.visual = TextureVisuals(material=material)
    parts = (Part("seat", box, ("seat", "wood_red")), Part("ball", ball, ("ball", "Metal.001")))
    return Asset(f"thing {number}", parts, up="z")


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    path = tmp_path_factory.mktemp("corpus") / "corpus.safetensors"
    specimens = [Specimen(thing(i), "Small thing", "here") for i in range(3)]
    assert write_corpus(path, specimens, text_encoder=Words(), pixels=PIXELS) == 3
    return read_corpus(path)


def test_corpus_round_trip(corpus):
    """What is read is what was rendered, but for JPEG; every part has its four texts."""
    assert corpus.colour.shape == (21, 3, PIXELS, PIXELS)
    assert corpus.sources == ("here",) * 3
    assert corpus.texts[: len(KINDS)] == KINDS
    words = [[corpus.texts[row] for row in rows] for rows in corpus.words[1:3].tolist()]
    assert words[0] == ["wood", "wood red", "seat", "small thing"]
    assert words[1] == ["metal", "metal", "ball", "small thing"]
    views = render_views(thing(1), hemisphere(thing(1).bounds, count=6, lower=1, pixels=PIXELS))
    assert (corpus.part[7:14].numpy() == np.where(views.part >= 0, views.part + 3, 0)).all()
    shown = views.opacity > 0
    colour = corpus.colour[7:14].permute(0, 2, 3, 1).numpy() / 255
    assert np.abs(colour - views.colour)[shown].mean() < 0.06  # colours at half resolution
    assert torch.allclose(corpus.mean_colour[1], torch.tensor([230, 40, 30]) / 255, atol=0.06)


def test_still_pictures_are_the_views_own(corpus):
    """Without variety the trainer's light is that of the views, within JPEG's error."""
    drawn = draw_pictures(
        corpus, torch.arange(7), variety=STILL, side=PIXELS, generator=torch.Generator()
    )
    asset = thing(0)
    views = render_views(asset, hemisphere(asset.bounds, count=6, lower=1, pixels=PIXELS))
    error = np.abs(drawn.images.permute(0, 2, 3, 1).numpy() - views.images())
    assert error.mean() < 0.02
    assert np.median(error[views.part >= 0]) < 0.03
    assert np.allclose(corpus.up[0], up_vector("z") @ views.cameras[0].pose[:3, :3])


def test_variety_keeps_labels_on_their_pixels(corpus):
    """Turned, zoomed and recoloured, a pixel of the ball still looks unlike the background."""
    drawn = draw_pictures(
        corpus,
        torch.arange(21),
        variety=Variety(recolour=0.0, background=0.0, noise=0.0),
        side=96,
        generator=torch.Generator().manual_seed(1),
    )
    blue = drawn.images[:, 2] - drawn.images[:, 0]
    balls = torch.isin(drawn.part, torch.tensor([2, 4, 6]))
    assert (blue[balls] > 0.05).float().mean() > 0.8
    assert (blue[drawn.part == 0] > 0.05).float().mean() < 0.05


def test_network_is_small_enough_to_ship():
    """One to three million weights, at most 6 MB in half precision; a unit vector per 4 x 4."""
    count = sum(value.numel() for value in new_weights(Widths(), seed=0).values())
    assert 1e6 < count <= 3e6
    weights = new_weights(SMALLEST, seed=0)
    images = torch.rand(2, 3, 2 * MULTIPLE, MULTIPLE)
    vectors = head(weights, trunk(weights, images).permute(0, 2, 3, 1))
    assert vectors.shape == (2, 2 * MULTIPLE // STRIDE, MULTIPLE // STRIDE, SMALLEST.dim)
    assert torch.allclose(vectors.norm(dim=-1), torch.ones(()), atol=1e-5)


def test_resume_is_exact(corpus, tmp_path):
    """Eight steps are four, saved, loaded, and four more: to the bit."""
    whole = train(corpus, TINY, until=8)
    save_state(train(corpus, TINY, until=4), tmp_path / "state.safetensors")
    resumed = train(corpus, TINY, load_state(tmp_path / "state.safetensors", "cpu"), until=8)
    assert resumed.step == whole.step == 8
    assert all(torch.equal(resumed.weights[k], whole.weights[k]) for k in whole.weights)
    assert all(torch.equal(resumed.average[k], whole.average[k]) for k in whole.weights)


def test_training_tells_wood_from_metal(corpus):
    """A CPU-size network learns which of two parts is wood in under a minute."""
    weights = shipped_weights(train(corpus, TINY))
    found = region_features(weights, corpus, kinds=("wood", "metal"), side=PIXELS, smallest=4)
    rows = [KINDS.index("wood"), KINDS.index("metal")]
    guess = (found.features @ corpus.embeddings[rows].numpy().T).argmax(axis=1)
    assert (guess == found.label).mean() > 0.9


def test_shipped_backbone_is_a_share_of_its_change(corpus):
    """Start plus what is shipped at a share of one half is midway between start and end."""
    state = new_state(TINY, "cpu")
    start = {"stem.weight": torch.ones_like(state.average["stem.weight"])}
    shipped = shipped_weights(state, start, share=0.5)
    midway = (state.average["stem.weight"] + 1) / 2
    # Half precision keeps three digits of the change.
    assert torch.allclose(start["stem.weight"] + shipped["stem.weight"].float(), midway, atol=1e-3)
    assert torch.equal(shipped["head.out.weight"], state.average["head.out.weight"].half())
    assert "scale" not in shipped


def test_probe_scores():
    """Separable classes score 1 whatever their sizes, noise scores chance within its interval."""
    rng = np.random.default_rng(0)
    label = np.repeat([0, 1, 2], [90, 20, 10])
    features = rng.normal(size=(120, 60)) + 8 * np.eye(60)[label]
    regions = Regions(features, label, np.arange(120) // 4)
    assert score(fit_probe(regions)(features), regions, rng=rng).accuracy == 1
    blank = Regions(rng.normal(size=(120, 60)), label, regions.thing)
    fresh = rng.normal(size=(120, 60))
    result = score(fit_probe(blank)(fresh), blank, rng=rng)
    assert result.low < 1 / 3 < result.high


def test_kinds_of_names():
    """Words, words inside words and other languages; a name without a material has no kind."""
    assert kind_of("Metal_Chrome.001") == "metal"
    assert kind_of("whitePlastic") == kind_of("whiteplastic") == "plastic"
    assert kind_of("madera_oscura") == "wood"
    assert kind_of("fiberglass") == "plastic"
    assert kind_of("Cube.012") is None
    assert plain_words("Dark_Fabric_03.jpg") == ["dark", "fabric"]
