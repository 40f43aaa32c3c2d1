"""The verb `features`: a red box seen in RGB is red on every voxel, inside and out."""

import json

import trimesh
from autophyx_tet.converters.npz import load_npz
from autophyx_tet.toolkit.cli import main


def test_a_red_box_is_red_all_through(tmp_path, capsys):
    box = trimesh.creation.box((0.2, 0.1, 0.1))
    box.visual.vertex_colors = [200, 20, 20, 255]
    box.export(tmp_path / "box.glb")
    target = tmp_path / "box.npz"
    arguments = ["features", str(tmp_path / "box.glb"), "-o", str(target)]
    assert main([*arguments, "--encoder", "rgb", "--cells", "12", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    arrays = load_npz(target)
    assert document["voxels"] == len(arrays["cells"]) == len(arrays["values"])
    # 12 cells along 0.2 m: the solid holds at least the cells whose centre is inside.
    assert document["voxels"] >= 12 * 6 * 6
    red, green, _ = arrays["values"].astype(float).mean(axis=0)[:3]
    assert red > 3 * abs(green)


def test_an_unknown_encoder_is_one_line(tmp_path, capsys):
    trimesh.creation.box().export(tmp_path / "box.glb")
    code = main(
        ["features", str(tmp_path / "box.glb"), "-o", str(tmp_path / "f.npz"), "--encoder", "eyes"]
    )
    assert code in (2, 3)
    assert "rgb" in capsys.readouterr().err
    assert not (tmp_path / "f.npz").exists()
