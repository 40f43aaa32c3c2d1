"""The demo asset is what it says: closed, named parts in metres that touch each other."""

import numpy as np
import pytest
import trimesh
from autophyx_tet.toolkit.asset.bonsai import bonsai, write_bonsai

PARTS = ["pot", "soil", "trunk", "foliage"]


@pytest.fixture(scope="module")
def scene():
    return bonsai()


def test_every_part_encloses_a_volume(scene):
    """Each connected surface is watertight, faces outward and has a volume of its own."""
    for name in PARTS:
        part = scene.geometry[name]
        assert part.is_watertight, name
        assert part.is_winding_consistent, name
        for piece in part.split(only_watertight=False):
            assert piece.is_watertight, name
            assert piece.volume > 1e-7, name  # a tenth of a cubic centimetre


def test_it_is_a_small_tree_standing_on_the_ground(scene):
    """0.4 m tall along +y, its foot on y = 0, light enough to convert in seconds."""
    lo, hi = scene.bounds
    assert lo[1] == pytest.approx(0, abs=1e-9)
    assert 0.38 < hi[1] < 0.42
    assert (hi - lo).argmax() == 1
    assert 2000 < sum(len(g.faces) for g in scene.geometry.values()) < 9000


def test_the_pot_is_hollow(scene):
    """The pot's ceramic fills less than half of what its outline encloses."""
    pot = scene.geometry["pot"]
    assert pot.volume < 0.5 * pot.convex_hull.volume


def test_neighbours_overlap(scene):
    """Some points of one part lie inside the other: the tet mesh becomes one piece."""
    for pair in (("trunk", "soil"), ("foliage", "trunk")):
        a, b = (scene.geometry[name] for name in pair)
        points = np.vstack([a.sample(4000, seed=0), b.sample(4000, seed=0)])
        assert np.sum(a.contains(points[4000:])) + np.sum(b.contains(points[:4000])) > 10, pair


def test_soil_and_pot_share_a_wall(scene):
    """Below its dome every face of the soil is a face of the pot: no gap, no sliver."""
    walls = {name: scene.geometry[name].triangles.round(9) for name in ("pot", "soil")}
    pot, soil = (
        {frozenset(map(tuple, face)) for face in walls[n].tolist()} for n in ("pot", "soil")
    )
    edge = 0.068  # height [m] of the soil's edge
    below = {face for face in soil if max(point[1] for point in face) <= edge}
    assert len(below) > 100
    assert below <= pot


def test_every_cloud_of_leaves_is_carried_by_wood(scene):
    """No foliage floats: each pad contains points of the trunk's surface."""
    wood = scene.geometry["trunk"].sample(20000, seed=0)
    for pad in scene.geometry["foliage"].split():
        assert pad.contains(wood).any()


def test_the_glb_keeps_names_metres_and_materials(tmp_path, scene):
    """What a reader gets back from the file is what was made."""
    path = write_bonsai(tmp_path / "sub" / "bonsai.glb")
    back = trimesh.load_scene(path)
    assert sorted(back.graph.nodes_geometry) == sorted(PARTS)
    np.testing.assert_allclose(back.bounds, scene.bounds, atol=1e-7)
    for name in PARTS:
        geometry = back.geometry[back.graph[name][1]]
        assert geometry.is_watertight
        assert geometry.visual.material.name == scene.geometry[name].visual.material.name
        assert geometry.visual.material.baseColorFactor is not None
    assert [p.name for p in path.parent.iterdir()] == ["bonsai.glb"]


def test_the_same_seed_gives_the_same_file(tmp_path):
    """Byte for byte, so that caches and hashes hold; another seed gives another tree."""
    first = write_bonsai(tmp_path / "a.glb").read_bytes()
    assert first == write_bonsai(tmp_path / "b.glb").read_bytes()
    assert first != write_bonsai(tmp_path / "c.glb", seed=8).read_bytes()
