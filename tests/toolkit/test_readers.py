"""Readers: what a file of a rarer kind holds is read, or it is said what it is."""

import json
import struct

import numpy as np
import pytest
import trimesh
from autophyx_tet.fem.errors import InputError
from autophyx_tet.toolkit.io.load import load_asset
from autophyx_tet.toolkit.io.readers.gltf import gltf_json


def _binary_strips(rows, *, count, order):
    points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0), (0, 2, 0)]
    kind, code = {"<": "little", ">": "big"}[order], {"uchar": "B", "int": "i"}[count]
    header = (
        f"ply\nformat binary_{kind}_endian 1.0\nelement vertex 5\nproperty float x\n"
        "property float y\nproperty float z\nproperty uchar red\n"
        f"element tristrips {len(rows)}\nproperty list {count} int vertex_indices\nend_header\n"
    )
    body = b"".join(struct.pack(f"{order}3fB", *point, 9) for point in points)
    lists = (struct.pack(f"{order}{code}{len(row)}i", len(row), *row) for row in rows)
    return header.encode() + body + b"".join(lists)


def test_binary_ply_triangle_strips(tmp_path):
    """One list with -1, and lists of different lengths, in both orders of bytes; and cut short."""
    path = tmp_path / "strips.ply"
    for rows in ([[0, 1, 2, 3, 4, -1, 0, 1, 2]], [[0, 1, 2, 3, 4], [0, 1, 2]]):
        for count in ("uchar", "int"):
            for order in "<>":
                data = _binary_strips(rows, count=count, order=order)
                path.write_bytes(data)
                mesh = load_asset(path).parts[0].mesh
                assert mesh.area == pytest.approx(2.0), (rows, count, order)
                assert mesh.face_normals[:, 2] == pytest.approx(1)
                path.write_bytes(data[:-3])
                with pytest.raises(InputError, match="ends before its triangle strips do"):
                    load_asset(path)


def test_a_texture_that_is_not_read_is_told(tmp_path):
    """A box whose only texture is KTX2: the shape is taken, a warning says what is missing."""
    box = trimesh.creation.box((1, 1, 1))
    box.visual = trimesh.visual.TextureVisuals(
        uv=np.zeros((8, 2)), material=trimesh.visual.material.PBRMaterial(name="oak")
    )
    for suffix in (".gltf", ".glb"):
        folder = tmp_path / suffix[1:]
        folder.mkdir()
        path = folder / f"box{suffix}"
        box.export(path)
        document = json.loads(gltf_json(path.read_bytes()))
        document["images"] = [{"mimeType": "image/ktx2", "uri": "skin.ktx2"}]
        document["textures"] = [{"extensions": {"KHR_texture_basisu": {"source": 0}}}]
        path.write_bytes(_with_json(path.read_bytes(), json.dumps(document).encode()))
        asset = load_asset(path)
        assert abs(asset.parts[0].mesh.volume) == pytest.approx(1)
        (told,) = (w for w in asset.warnings if "KTX2" in w)
        assert "skin.ktx2" in told
        assert "PNG" in told


def _with_json(data, document):
    """A glTF file, text or binary, with another document."""
    if data[:4] != b"glTF":
        return document
    document += b" " * (-len(document) % 4)
    size = struct.unpack_from("<I", data, 12)[0]
    chunks = struct.pack("<I4s", len(document), b"JSON") + document + data[20 + size :]
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


def test_a_capture_says_which_file_is_wanted(tmp_path):
    """Photographs with cameras, and their folder: what they are, and what to give instead."""
    (tmp_path / "transforms_train.json").write_text("{}")
    for path in (tmp_path, tmp_path / "transforms_train.json"):
        with pytest.raises(InputError, match=r"photographs.*\.ingp.*features"):
            load_asset(path)


@pytest.mark.slow
def test_a_checkpoint_is_read_where_it_holds_occupancy(tmp_path):
    """A ball in nerfacc's state has the ball's volume; a network's bare weights are refused."""
    torch = pytest.importorskip("torch")
    torch.save({"field.weight": torch.zeros(3)}, tmp_path / "step.ckpt")
    with pytest.raises(InputError, match=r"occs wanted.*\.npz"):
        load_asset(tmp_path / "step.ckpt")
    at = (torch.stack(torch.meshgrid(*[torch.arange(32)] * 3, indexing="ij")) + 0.5) / 16 - 1
    state = {
        "occs": (at.norm(dim=0) < 0.75).float().reshape(-1),
        "aabbs": torch.tensor([[-1.0, -1, -1, 1, 1, 1]]),
        "resolution": torch.tensor([32, 32, 32]),
    }
    torch.save(state, tmp_path / "ball.pt")
    (part,) = load_asset(tmp_path / "ball.pt").parts
    # The surface lies within half a cell of the ball's.
    assert abs(part.mesh.volume) == pytest.approx(4 / 3 * np.pi * 0.75**3, rel=0.15)
