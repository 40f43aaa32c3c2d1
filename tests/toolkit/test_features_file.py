"""The verb `features`: a red box seen in RGB is red on every voxel, inside and out."""

import json

import numpy as np
import pytest
import trimesh
from autophyx_tet.converters.npz import load_npz
from autophyx_tet.predictors.grid import Grid
from autophyx_tet.toolkit.cli.main import main
from autophyx_tet.toolkit.report.picture import voxel_shell
from PIL import Image


def red_box(folder):
    box = trimesh.creation.box((0.2, 0.1, 0.1))
    box.visual.vertex_colors = [200, 20, 20, 255]
    box.export(folder / "box.glb")
    return str(folder / "box.glb")


@pytest.mark.slow
def test_a_red_box_is_red_all_through(tmp_path, capsys):
    """Values, picture and document of one run; the second run reads the first one's cache."""
    target, picture = tmp_path / "box.npz", tmp_path / "box.png"
    arguments = ["features", red_box(tmp_path), "-o", str(target), "--encoder", "rgb"]
    arguments += ["--cells", "12", "--cache", str(tmp_path / "cache"), "--json"]
    assert main([*arguments, "--picture", str(picture)]) == 0
    document = json.loads(capsys.readouterr().out)
    arrays = load_npz(target)
    assert document["voxels"] == len(arrays["cells"]) == len(arrays["values"])
    # 12 cells along 0.2 m: the solid holds at least the cells whose centre is inside.
    assert document["voxels"] >= 12 * 6 * 6
    red, green, _ = arrays["values"].astype(float).mean(axis=0)[:3]
    assert red > 3 * abs(green)
    with Image.open(picture) as image:
        width, height = image.size
        assert width > 1.5 * height  # the asset and its features, side by side
    (remembered,) = (tmp_path / "cache").glob("*.npz")
    before = remembered.stat().st_ino
    assert main(arguments) == 0
    again = load_npz(target)
    assert all((again[name] == arrays[name]).all() for name in arrays)
    assert [path.stat().st_ino for path in (tmp_path / "cache").glob("*.npz")] == [before]
    remembered.write_bytes(b"damaged")
    assert main(arguments) == 0
    assert (load_npz(target)["values"] == arrays["values"]).all()


def test_shell_is_closed_and_as_large_as_the_cells():
    """Its volume by the divergence theorem is that of the cells, so every face looks outwards."""
    occupied = np.random.default_rng(0).random((5, 6, 7)) < 0.5
    grid = Grid(np.array([1.0, 2, 3]), 0.5, occupied.shape)
    shell = voxel_shell(occupied, grid)
    a, b, c = shell.points[shell.faces].transpose(1, 0, 2)
    volume = np.einsum("nk,nk->n", a, np.cross(b, c)).sum() / 6
    assert np.isclose(volume, occupied.sum() * grid.h**3)
    assert occupied[tuple(shell.cell.T)].all()


@pytest.mark.slow
def test_words_label_every_voxel(tmp_path, capsys):
    """Of two sets the more coherent is kept; its labels are one for each voxel."""
    target = tmp_path / "box.npz"
    arguments = ["features", red_box(tmp_path), "-o", str(target), "--no-cache", "--json"]
    arguments += ["--cells", "12", "--words", "metal, wood", "--words", "glass, cloth, leaf"]
    assert main(arguments) == 0
    parts = json.loads(capsys.readouterr().out)["parts"]
    arrays = load_npz(target)
    assert list(parts["voxels"]) == list(arrays["keywords"])
    assert sum(parts["voxels"].values()) == len(arrays["label"]) == len(arrays["cells"])
    assert 0 <= parts["coherence"] <= 1


def test_words_want_an_encoder_that_reads(tmp_path, capsys):
    target = tmp_path / "f.npz"
    arguments = ["features", red_box(tmp_path), "-o", str(target), "--encoder", "rgb"]
    assert main([*arguments, "--words", "metal, wood"]) == 2
    assert "reads no words" in capsys.readouterr().err
    assert not target.exists()


def test_an_unknown_encoder_is_one_line(tmp_path, capsys):
    """The error names the encoders that there are, and nothing is written."""
    target = tmp_path / "f.npz"
    code = main(["features", red_box(tmp_path), "-o", str(target), "--encoder", "eyes"])
    assert code in (2, 3)
    assert "rgb" in capsys.readouterr().err
    assert not target.exists()
