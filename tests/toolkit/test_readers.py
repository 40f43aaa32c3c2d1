"""Readers: what a file of a rarer kind holds is read, or it is said what it is."""

import io
import json
import struct
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import numpy as np
import pytest
import trimesh
from autophyx_tet.fem.errors import InputError
from autophyx_tet.predictors.appearance.surface import skin_of
from autophyx_tet.toolkit.asset.gltf import chunks
from autophyx_tet.toolkit.asset.load import load_asset

from .command import run_here


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
                with pytest.raises(InputError, match="ends before its tristrips do"):
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
        document, _ = chunks(path.read_bytes())
        document["images"] = [{"mimeType": "image/ktx2", "uri": "skin.ktx2"}]
        document["textures"] = [{"extensions": {"KHR_texture_basisu": {"source": 0}}}]
        path.write_bytes(_with_json(path.read_bytes(), json.dumps(document).encode()))
        asset = load_asset(path)
        assert abs(asset.parts[0].mesh.volume) == pytest.approx(1)
        (told,) = (w for w in asset.warnings if "KTX2" in w)
        assert "skin.ktx2" in told
        assert "PNG" in told


def _textured(folder, image, kind):
    """A box whose skin is ``image``, as GLB or as OBJ with its MTL and PNG or JPEG beside it."""
    from PIL import Image

    picture = io.BytesIO(image)
    box = trimesh.creation.box((0.1, 0.1, 0.1))
    if kind == "glb":
        box.visual = trimesh.visual.TextureVisuals(
            uv=box.vertices[:, :2] * 10 + 0.5,
            material=trimesh.visual.material.PBRMaterial(
                name="oak", baseColorTexture=Image.open(picture)
            ),
        )
        box.export(folder / "box.glb")
        return folder / "box.glb"
    (folder / "skin.img").write_bytes(image)
    (folder / "box.mtl").write_text("newmtl oak\nKd 1 0 0\nmap_Kd skin.img\n")
    lines = ["mtllib box.mtl", *("v {} {} {}".format(*point) for point in box.vertices)]
    lines += ["vt 0 0", "vt 1 0", "vt 0 1", "usemtl oak"]
    lines += ["f {}/1 {}/2 {}/3".format(*face) for face in box.faces + 1]
    (folder / "box.obj").write_text("\n".join(lines) + "\n")
    return folder / "box.obj"


def _picture(pixels, kind):
    from PIL import Image

    noise = np.random.default_rng(0).integers(0, 256, (pixels, pixels, 3), dtype=np.uint8)
    data = io.BytesIO()
    Image.fromarray(noise).save(data, kind)
    return data.getvalue()


@pytest.mark.blockers
@pytest.mark.slow
@pytest.mark.parametrize("kind", ["obj", "glb"])
def test_threads_may_look_at_one_texture_at_once(tmp_path, kind):
    """Eight threads ask the same asset for its skin at the same moment: all see the same."""
    for coding in ("PNG", "JPEG"):
        path = _textured(tmp_path, _picture(2048, coding), kind)
        mesh = load_asset(path).parts[0].mesh
        start = Barrier(8)

        def look(mesh=mesh, start=start):
            start.wait()
            return skin_of(mesh)(np.arange(12), np.full((12, 3), 1 / 3))

        with ThreadPoolExecutor(8) as pool:
            seen = [future.result() for future in [pool.submit(look) for _ in range(8)]]
        assert all(np.array_equal(colours, seen[0]) for colours in seen)
        assert np.ptp(seen[0][:, :3]) > 0


@pytest.mark.blockers
@pytest.mark.slow
def test_a_run_of_a_large_texture_writes_its_folder(tmp_path):
    """4,096 x 4,096 pixels: picture and report look at them from two threads."""
    path = _textured(tmp_path, _picture(4096, "PNG"), "obj")
    done = run_here(
        "run",
        path,
        "--text",
        "the box is oak",
        "--size",
        0.1,
        "--edge-length-rel",
        0.3,
        "-o",
        tmp_path / "out",
    )
    assert done.returncode == 0, done.stderr
    assert {"picture.png", "report.html", "run.json"} <= {
        p.name for p in (tmp_path / "out").iterdir()
    }


@pytest.mark.blockers
def test_a_texture_that_is_cut_short_is_told(tmp_path):
    """The shape is taken with the plain colour of its material, a warning names the material."""
    path = _textured(tmp_path, _picture(64, "PNG")[:2000], "obj")
    asset = load_asset(path, size=0.1)
    (told,) = (w for w in asset.warnings if "decoded" in w)
    assert "material oak" in told
    colours = skin_of(asset.parts[0].mesh)(np.arange(12), np.full((12, 3), 1 / 3))
    assert colours == pytest.approx(np.tile([1.0, 0, 0, 1], (12, 1)))


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
