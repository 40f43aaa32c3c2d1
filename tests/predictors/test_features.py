"""Laws from asset to features: hidden parts keep to themselves, names, words, masks."""

import numpy as np
import pytest
import trimesh
from autophyx_tet.fem.errors import UsageError
from autophyx_tet.predictors.appearance.features import features, features_of_views, name_embeddings
from autophyx_tet.predictors.appearance.segmentation import best_segmentation, segment
from autophyx_tet.predictors.appearance.surface import density_of_points
from autophyx_tet.predictors.appearance.views import render_views
from autophyx_tet.predictors.asset import Asset, Part
from autophyx_tet.predictors.encoders import ENCODERS, Encoder, ImageEncoder, load_encoder
from trimesh.visual.material import PBRMaterial
from trimesh.visual.texture import TextureVisuals


class Colours:
    """A space of three words, the primary colours: text and pictures are exact in it."""

    name, dim = "colours", 3

    def dense(self, images):
        return images[..., :3].astype(np.float32)

    def text(self, sentences):
        order = ["red", "green", "blue"]
        rows = [[float(word in sentence) for word in order] for sentence in sentences]
        return np.array(rows, dtype=np.float32)


def painted(mesh, colour):
    mesh.visual = TextureVisuals(
        material=PBRMaterial(baseColorFactor=[*colour, 255], metallicFactor=0.0)
    )
    return mesh


def two_boxes():
    """A red box with a green one on top, both closed."""
    low, high = trimesh.creation.box((1.0, 1, 1)), trimesh.creation.box((0.6, 0.6, 0.6))
    high.apply_translation([0, 0, 0.85])
    parts = (
        Part("low", painted(low, (255, 0, 0)), ("Base_01", "red.jpg")),
        Part("high", painted(high, (0, 255, 0))),
    )
    return Asset("boxes", parts, up="z")


def test_features_of_a_painted_solid():
    """Every cell of the filled solid, inside and hidden ones too, has its own part's colour."""
    found = features(two_boxes(), encoder=Colours(), cells=24, pixels=48)
    expected = np.array([0, 1])[found.part]
    assert (found.values[:, :2].argmax(axis=1) == expected).mean() > 0.99
    inside = ~found.surface
    assert inside.sum() > 1000
    hidden = found.surface & ~found.seen  # the bottom, which no upper camera sees
    assert hidden.sum() > 100
    assert (found.values[hidden, :2].argmax(axis=1) == expected[hidden]).mean() > 0.98
    assert found.residual < 0.2
    assert found.occupied.sum() == len(found.cells)
    assert found.names.shape == (2, 3)
    colours = found.picture()
    assert colours.shape == (len(found.cells), 3)
    assert colours.min() >= 0
    assert colours.max() <= 1


@pytest.mark.slow
def test_a_cloud_with_pictures_has_features():
    """A density without a mesh is seen, lifted and filled all the same."""
    asset = two_boxes()
    views = render_views(asset)
    grid = features(asset, encoder="rgb", cells=16, views=2, pixels=16).grid
    points = np.concatenate([part.mesh.sample(20_000, seed=0) for part in asset.parts])
    found = features_of_views(views, density_of_points(points, grid), grid, encoder=Colours())
    high = grid.to_world(found.cells)[:, 2] > 0.6
    assert (found.values[:, :2].argmax(axis=1) == high).mean() > 0.95
    assert not found.surface.all()


def test_an_encoder_is_one_class_and_one_registration():
    """By its name the toy sees an asset like any other encoder; it takes no weights."""
    ENCODERS.register("colours", Colours)
    try:
        found = features(two_boxes(), encoder="colours", cells=12, pixels=24)
        with pytest.raises(UsageError, match="nothing after a colon"):
            load_encoder("colours:x")
    finally:
        ENCODERS.unregister("colours")
    assert found.encoder == "colours"
    assert found.names.shape == (2, 3)
    with pytest.raises(UsageError, match="unknown encoder 'colours'"):
        load_encoder("colours")


@pytest.mark.parametrize("name", [name for name in ENCODERS if name != "openclip"])
def test_encoders_give_a_vector_per_cell(name):
    """Any picture size gives (views, rows, columns, dim), the same every time."""
    encoder = load_encoder(name)
    assert isinstance(encoder, ImageEncoder)
    images = np.random.default_rng(0).random((2, 50, 66, 3))
    out = encoder.dense(images)
    assert out.shape[0] == 2
    assert out.shape[3] == encoder.dim
    assert out.dtype == np.float32
    assert (encoder.dense(images) == out).all()
    if name == "embedded":
        assert isinstance(encoder, Encoder)
        assert out.shape == (2, 16, 16, 384)
        assert np.allclose(np.linalg.norm(out, axis=-1), 1, atol=1e-4)
        words = encoder.text(["a wooden leg"])
        assert np.allclose(np.linalg.norm(words), 1, atol=1e-4)
    if name == "rgb":
        assert np.allclose(out[0, 0, 0], images[0, :4, :4].mean(axis=(0, 1)), atol=1e-6)


def test_unknown_encoder_is_named():
    """A wrong name lists the right ones."""
    with pytest.raises(UsageError, match="embedded, openclip, rgb, occupancy"):
        load_encoder("clap")


def test_names_are_read_as_words():
    """File suffixes, digits and underscores say nothing; a part without words is all zero."""
    names = name_embeddings([("Base_01", "red.jpg"), ("01",)], Colours())
    assert names.tolist() == [[1, 0, 0], [0, 0, 0]]


def test_segmentation_by_words():
    """Words that fit win every cell of their part; the set that fits is preferred."""
    found = features(two_boxes(), encoder=Colours(), cells=20, pixels=48)
    chosen = best_segmentation(
        found.values,
        found.cells,
        [["blue", "red"], ["red", "green"], ["blue", "yellow"]],
        Colours(),
    )
    assert chosen.keywords == ("red", "green")
    assert (chosen.label == found.part).mean() > 0.98
    assert chosen.coherence.whole > 0.98
    noise = np.random.default_rng(0).normal(size=found.values.shape)
    scattered = segment(noise, found.cells, ["red", "green"], Colours())
    assert scattered.coherence.compact < 0.7 < chosen.coherence.compact
    assert scattered.coherence.score < chosen.coherence.score
    with pytest.raises(UsageError, match="two keywords"):
        segment(found.values, found.cells, ["red"], Colours())
