"""What an encoder sees of an object, on the cells of the evaluation."""

import numpy as np
import pytest
import trimesh
from autophyx_tet.fem.errors import UsageError
from autophyx_tet.predictors.encoders import speaking_encoder
from autophyx_tet.research.datasets.real import voxelise
from autophyx_tet.research.image_features import cached_image_features
from autophyx_tet.research.learning import evaluate
from autophyx_tet.toolkit.asset.load import load_asset

HALF = 16


class Eyes:
    """Sees red, green and blue; has words; says how often it looked."""

    name, dim, looked = "eyes", 3, 0

    def dense(self, images) -> np.ndarray:
        self.looked += 1
        return images[:, ::4, ::4, :3].astype(np.float32)

    def text(self, sentences) -> np.ndarray:
        return np.eye(3, dtype=np.float32)[[0] * len(sentences)]


@pytest.fixture
def tower(tmp_path):
    """A blue box on a red one, y up."""
    scene = trimesh.Scene()
    for name, height, colour in (("red", 0.05, [220, 10, 10]), ("blue", 0.15, [10, 10, 220])):
        box = trimesh.creation.box((0.1, 0.1, 0.1))
        box.apply_translation((0, height, 0))
        box.visual.vertex_colors = [*colour, 255]
        scene.add_geometry(box, node_name=name, geom_name=name)
    scene.export(tmp_path / "tower.glb")
    return load_asset(tmp_path / "tower.glb")


@pytest.mark.slow
def test_every_cell_sees_its_own_colour(tower, tmp_path):
    """On its skin the red half sees red, the blue one blue; the second look remembers."""
    voxels, eyes = voxelise(tower, "tower", "test"), Eyes()
    seen = cached_image_features(tower, voxels, eyes, cells=2 * HALF, memory=tmp_path / "cache")
    z = seen.cells[:, 2]
    red, blue = seen.values[:, 0], seen.values[:, 2]
    ends = (seen.cells.min(axis=0), seen.cells.max(axis=0))
    skin = np.any([seen.cells == end for end in ends], axis=(0, 2))  # inside nothing is seen
    apart = skin & (np.abs(z + 0.5 - HALF / 2) > 1.5)  # not where the boxes touch
    lower = z < HALF / 2
    assert (red > blue)[apart & lower].all()
    assert (blue > red)[apart & ~lower].all()
    again = cached_image_features(tower, voxels, eyes, cells=2 * HALF, memory=tmp_path / "cache")
    assert eyes.looked == 1
    assert all(np.array_equal(a, b) for a, b in zip(seen, again, strict=True))
    eyes.name = "other eyes"
    cached_image_features(tower, voxels, eyes, cells=2 * HALF, memory=tmp_path / "cache")
    assert eyes.looked == 2


@pytest.mark.real
@pytest.mark.slow
def test_furniture_is_seen_scored_and_rendered(tmp_path):
    """Rows of real furniture: looked at once, compared object by object, put under load."""
    stages = []
    document = evaluate(
        "validation", predictors=("film", "constant"), objects=2, cells=32, encoder="embedded",
        renders=1, memory=tmp_path, progress=lambda stage, seconds: stages.append(stage),
    )  # fmt: skip
    film, constant = document["rows"]
    assert (film["objects"], film["rendered"], film["best_baseline"]) == (2, 1, "constant")
    apart = film["mse_mean"] - constant["mse_mean"]
    single = 2e-7 * film["mse_mean"]  # means of single precision, which are nearly equal
    assert film["difference"] == pytest.approx(apart, abs=single)
    assert len(list(tmp_path.glob("*.npz"))) == 2
    assert any("object 2" in stage for stage in stages)


def test_an_encoder_without_words_is_refused():
    """Evidence compares pictures with words: colours alone have none; shapes have no furniture."""
    with pytest.raises(UsageError, match="reads no words"):
        speaking_encoder("rgb")
    with pytest.raises(UsageError, match="--split validation"):
        evaluate("procedural", encoder="embedded")
