"""Laws of the image encoder: corpus round trip, light, regression, learning."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh
from autophyx_tet.fem.scene.up import up_vector
from autophyx_tet.predictors.appearance.views import hemisphere, render_views
from autophyx_tet.predictors.asset import Asset, Part
from autophyx_tet.predictors.encoders.plain import LENGTH, STRIDE, Embedded, head, levels
from autophyx_tet.predictors.text.parts import KINDS, bare_words, kind_of
from autophyx_tet.research.training.encoder.corpus import Specimen, read_corpus, write_corpus
from autophyx_tet.research.training.encoder.head import (
    HeadOptions,
    fit_head,
    free_directions,
    principal,
    region_features,
    region_means,
    ridge,
    shipped_weights,
)
from autophyx_tet.research.training.encoder.pictures import NO_VARIETY, Variety, draw_pictures
from trimesh.visual.material import SimpleMaterial
from trimesh.visual.texture import TextureVisuals

from .backbone import SMALLEST, new_backbone

ROOT = Path(__file__).resolve().parents[2]
PIXELS = 64
DIM = 24
SMALL = HeadOptions(side=PIXELS, rounds=1, smallest=4, rank=1, directions=3)


pytestmark = pytest.mark.usefixtures("one_thread")


class Words:
    """A text encoder of random but fixed vectors; it knows every word."""

    def text(self, sentences):
        rows = [np.random.default_rng(sum(s.encode())).normal(size=DIM) for s in sentences]
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
    assert corpus.colour.shape == (15, 3, PIXELS, PIXELS)
    assert corpus.sources == ("here",) * 3
    assert corpus.texts[: len(KINDS)] == KINDS
    words = [[corpus.texts[row] for row in rows] for rows in corpus.words[1:3].tolist()]
    assert words[0] == ["wood", "wood red", "seat", "small thing"]
    assert words[1] == ["metal", "metal", "ball", "small thing"]
    views = render_views(thing(1), hemisphere(thing(1).bounds, count=4, lower=1, pixels=PIXELS))
    assert (corpus.part[5:10].numpy() == np.where(views.part >= 0, views.part + 3, 0)).all()
    shown = views.opacity > 0
    colour = corpus.colour[5:10].permute(0, 2, 3, 1).numpy() / 255
    assert np.abs(colour - views.colour)[shown].mean() < 0.06  # colours at half resolution
    assert torch.allclose(corpus.mean_colour[1], torch.tensor([230, 40, 30]) / 255, atol=0.06)


def test_still_pictures_are_the_views_own(corpus):
    """Without variety the trainer's light is that of the views, within JPEG's error."""
    drawn = draw_pictures(
        corpus, torch.arange(5), variety=NO_VARIETY, side=PIXELS, generator=torch.Generator()
    )
    asset = thing(0)
    views = render_views(asset, hemisphere(asset.bounds, count=4, lower=1, pixels=PIXELS))
    error = np.abs(drawn.images.permute(0, 2, 3, 1).numpy() - views.images())
    assert error.mean() < 0.02
    assert np.median(error[views.part >= 0]) < 0.03
    assert np.allclose(corpus.up[0], up_vector("z") @ views.cameras[0].pose[:3, :3])


def test_variety_keeps_labels_on_their_pixels(corpus):
    """Turned, zoomed and recoloured, a pixel of the ball still looks unlike the background."""
    drawn = draw_pictures(
        corpus,
        torch.arange(15),
        variety=Variety(recolour=0.0, background=0.0, noise=0.0),
        side=96,
        generator=torch.Generator().manual_seed(1),
    )
    blue = drawn.images[:, 2] - drawn.images[:, 0]
    balls = torch.isin(drawn.part, torch.tensor([2, 4, 6]))
    assert (blue[balls] > 0.05).float().mean() > 0.8
    assert (blue[drawn.part == 0] > 0.05).float().mean() < 0.05


def test_region_means_are_means(corpus):
    """At the finest level the mean of the part's cells; a constant level gives its constant."""
    drawn = draw_pictures(
        corpus, torch.arange(2), variety=NO_VARIETY, side=PIXELS, generator=torch.Generator()
    )
    fine = torch.rand(2, 3, PIXELS // STRIDE, PIXELS // STRIDE)
    means = region_means([fine, torch.full((2, 1, 2, 2), 7.0)], drawn.part, smallest=4)
    cells = drawn.part[:, STRIDE // 2 :: STRIDE, STRIDE // 2 :: STRIDE]
    assert means.part[:2].tolist() == [1, 2]
    for part, mean in zip((1, 2), means.features[:2], strict=True):
        assert np.allclose(mean[:3], fine[0].permute(1, 2, 0)[cells[0] == part].mean(dim=0))
    assert np.allclose(means.features[:, 3], 7)


def test_ridge_is_least_squares_without_penalty():
    """Weights count as repeated rows; a penalty shrinks the map towards the weighted mean."""
    rng = np.random.default_rng(0)
    x, matrix = rng.normal(size=(50, 4)), rng.normal(size=(4, 3))
    wanted = x @ matrix + 2 + 0.1 * rng.normal(size=(50, 3))
    weight = rng.integers(1, 4, size=50).astype(float)
    found = ridge(x, wanted, weight, penalty=0.0)
    again = np.repeat(np.arange(50), weight.astype(int))
    rows = np.column_stack([x[again], np.ones(len(again))])
    exact = np.linalg.lstsq(rows, wanted[again], rcond=None)[0]
    assert np.allclose(found.matrix, exact[:4])
    assert np.allclose(found.bias, exact[4])
    shrunk = ridge(x, wanted, weight, penalty=1e6)
    assert np.allclose(shrunk(x), np.average(wanted, axis=0, weights=weight), atol=1e-4)


def test_fitted_head_tells_wood_from_metal(corpus):
    """Fitted on two objects, the word nearest to a region of the third is its own material."""
    backbone = new_backbone(SMALLEST, seed=0)
    regions = region_features(corpus, backbone, SMALL)
    unseen = corpus.object_of[regions.part].numpy() == 2
    fitted = fit_head(regions, corpus, SMALLEST.groups, SMALL, use=~unseen)
    rows = [KINDS.index("wood"), KINDS.index("metal")]
    guess = (fitted(regions.features) @ corpus.embeddings[rows].numpy().T).argmax(axis=1)
    label = (corpus.words[regions.part, 0].numpy() == rows[1]).astype(int)
    assert unseen.sum() > 10
    assert (guess == label)[unseen].mean() > 0.9


def test_the_network_computes_the_fitted_head(corpus):
    """On a picture of one colour the network's vectors are those of the fitted head, in halves."""
    backbone = new_backbone(SMALLEST, seed=0)
    options = replace(SMALL, rounds=0)
    fitted = fit_head(region_features(corpus, backbone, options), corpus, SMALLEST.groups, options)
    weights = {k: v.float() for k, v in shipped_weights(fitted, SMALLEST).items()}
    picture = torch.tensor([0.7, 0.4, 0.2, 0.5])[None, :, None, None].expand(1, 4, 64, 64)
    found = levels(backbone, picture)
    middle = head(backbone | weights, found)[0, 8, 8].numpy()
    rows = torch.cat([level[0, :, level.shape[2] // 2, level.shape[3] // 2] for level in found])
    assert middle @ fitted(rows.numpy()[None])[0] > 0.99


def test_what_is_plainly_seen_lies_across_words(corpus):
    """Whatever its length, a cosine to a text that the directions spare only scales."""
    regions = region_features(corpus, new_backbone(SMALLEST, seed=0), replace(SMALL, rounds=0))
    heads = [
        fit_head(regions, corpus, SMALLEST.groups, replace(SMALL, plain=length))
        for length in (0.01, 0.5)
    ]
    assert np.allclose(heads[0].axes.T @ heads[0].across, 0, atol=1e-9)
    assert np.allclose(heads[0].across.T @ heads[0].across, np.eye(10), atol=1e-9)
    spared = corpus.embeddings.numpy() - corpus.embeddings.numpy() @ heads[0].across @ (
        heads[0].across.T
    )
    few, many = (found(regions.features) @ spared.T for found in heads)
    assert np.allclose(few, many, atol=1e-6)


def test_no_number_is_divided_by_another(corpus):
    """Of constant length before it becomes 1: what is plainly seen is linear in the features."""
    regions = region_features(corpus, new_backbone(SMALLEST, seed=0), replace(SMALL, rounds=0))
    found = fit_head(regions, corpus, SMALLEST.groups, SMALL)
    vectors = found(regions.features)
    plain = found.read(regions.features)[:, SMALL.rank :]
    assert np.allclose(np.linalg.norm(vectors, axis=1), 1)
    assert np.allclose(vectors @ found.across[:, :-1] * LENGTH, plain, atol=1e-9)
    assert np.isclose((plain**2).sum(axis=1).mean(), SMALL.plain**2)


def test_principal_directions():
    """They are orthonormal, and the first holds most of what varies."""
    rng = np.random.default_rng(0)
    rows = rng.normal(size=(200, 5)) * [1, 5, 0.1, 3, 0.1]
    axes = principal(rows, 2)
    assert np.allclose(axes.T @ axes, np.eye(2))
    assert np.allclose(np.abs(axes), np.eye(5)[:, [1, 3]], atol=0.1)


def test_free_directions_are_across_texts():
    """Where texts span few directions, none of them has a part along the free ones."""
    rng = np.random.default_rng(0)
    texts = rng.normal(size=(40, 8)) @ rng.normal(size=(8, DIM))
    assert np.allclose(texts @ free_directions(texts, 4), 0, atol=1e-9)


def test_describing_twice_is_the_same(corpus):
    """Light, place and noise come from the seed alone."""
    backbones = (new_backbone(SMALLEST, seed=0) for _ in range(2))
    first, second = (region_features(corpus, backbone, SMALL) for backbone in backbones)
    assert (first.features == second.features).all()


@pytest.mark.long
def test_script_from_corpus_to_head(tmp_path):
    """Every command of the script runs on three objects a source and leaves a loadable head."""
    script = [sys.executable, str(ROOT / "benchmarks" / "train_image_encoder.py")]
    corpus, regions, weights = (tmp_path / n for n in ("c.safetensors", "r.npz", "h.safetensors"))
    small = ["--side", "96"]
    for command in (
        ["corpus", corpus, "--limit", "3"],
        ["describe", corpus, "--out", regions, *small],
        ["fit", corpus, regions, "--out", weights],
    ):
        subprocess.run([*script, *map(str, command)], check=True, capture_output=True)
    vectors = Embedded(weights).dense(np.random.default_rng(0).random((1, 64, 64, 4)))
    assert vectors.shape == (1, 16, 16, 384)
    assert np.isfinite(vectors).all()


def test_kinds_of_names():
    """Words, words inside words and other languages; a name without a material has no kind."""
    assert kind_of("Metal_Chrome.001") == "metal"
    assert kind_of("whitePlastic") == kind_of("whiteplastic") == "plastic"
    assert kind_of("madera_oscura") == "wood"
    assert kind_of("fiberglass") == "plastic"
    assert kind_of("Cube.012") is None
    assert bare_words("Dark_Fabric_03.jpg") == ["dark", "fabric"]
