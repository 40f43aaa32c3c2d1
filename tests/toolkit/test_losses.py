"""What of the raw file is not in the solids: patches, panels, loose pieces, scans."""

import numpy as np
import pytest
import trimesh
from autophyx_tet.fem.errors import NoVolumeError
from autophyx_tet.predictors.asset import Asset, Part
from autophyx_tet.toolkit.meshing.losses import MOST_LOST
from autophyx_tet.toolkit.meshing.preparation import Preparation
from autophyx_tet.toolkit.meshing.tetrahedralize import tetrahedralize

from .bodies import part_of

QUICK = {"edge_length_rel": 0.2, "epsilon_rel": 5e-3}


def prepared(*parts, thinnest=1e-3):
    asset = Asset("test", tuple(parts))
    diagonal = float(np.linalg.norm(asset.size))
    way = Preparation.of(asset, thinnest=thinnest * diagonal, thicken=None, walls={})
    return way.prepared(epsilon=2 * thinnest * diagonal, rng=np.random.default_rng(0))


def volume_of(ready):
    """Volume that the solids enclose, sampled in their box: good to about 1 %."""
    lo, hi = ready.solids.bounds
    where = np.random.default_rng(1).uniform(lo, hi, (20_000, 3))
    return float((ready.solids.label(where) >= 0).mean() * np.prod(hi - lo))


def patches(mesh, count, *, seed=0, gap=0.0, turned=True):
    """A surface in patches around random faces: torn apart, shrunk by ``gap``, wound anyhow."""
    rng = np.random.default_rng(seed)
    centres = mesh.triangles_center
    seeds = centres[rng.choice(len(centres), count, replace=False)]
    owner = np.linalg.norm(centres[:, None] - seeds, axis=2).argmin(axis=1)
    pieces = []
    for i in np.unique(owner):
        piece = trimesh.Trimesh(mesh.vertices, mesh.faces[owner == i], process=False)
        piece.remove_unreferenced_vertices()
        piece.vertices = piece.centroid + (1 - gap) * (piece.vertices - piece.centroid)
        if turned and rng.random() < 0.5:
            piece.invert()
        pieces.append(piece)
    return trimesh.util.concatenate(pieces)


def panels(*boxes, gap=0.002):
    """The sides of boxes as single panels with gaps between them: no piece encloses anything."""
    sides = []
    for lo, hi in boxes:
        box = trimesh.creation.box(bounds=[lo, hi])
        for axis in range(3):
            for end in (lo, hi):
                on = (box.vertices[box.faces][:, :, axis] == end[axis]).all(axis=1)
                side = trimesh.Trimesh(box.vertices, box.faces[on], process=False)
                side.remove_unreferenced_vertices()
                side.vertices = side.centroid + (1 - gap) * (side.vertices - side.centroid)
                sides.append(side)
    return sides


def pig():
    """A body, a head and four legs that run into each other, each open where it does."""
    parts = [trimesh.creation.capsule(1.2, 0.5, count=[24, 24])]
    parts[0].apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0]))
    for x, y in ((0.2, 0.3), (0.2, -0.3), (1.0, 0.3), (1.0, -0.3)):
        leg = trimesh.creation.cylinder(0.12, 0.6, sections=24)
        leg.apply_translation((x, y, -0.6))
        leg.update_faces(leg.triangles_center[:, 2] < -0.31)  # no lid where it meets the body
        parts.append(leg)
    return parts


@pytest.mark.parametrize("gap", [0.0, 1e-3])
def test_a_ball_in_forty_patches_is_a_ball(gap):
    """Torn, wound at random, with and without gaps: 4/3 pi, but for the flat triangles."""
    ball = trimesh.creation.icosphere(3)
    ready = prepared(Part("ball", patches(ball, 40, gap=gap)))
    assert ready.losses.lost < 0.01
    assert volume_of(ready) == pytest.approx(ball.volume, rel=0.03)


def test_a_body_whose_pieces_run_into_each_other_is_one_body():
    """Legs without lids in a closed trunk: what both enclose together, no piece is dropped."""
    pieces = pig()
    ready = prepared(Part("pig", trimesh.util.concatenate(pieces)))
    alone = sum(piece.convex_hull.volume for piece in pieces)
    assert ready.losses.lost < 0.01
    assert 0.9 * alone < volume_of(ready) < alone


def test_a_car_of_open_panels_is_as_large_as_its_boxes():
    """Hull and cabin, twelve panels with gaps, as one part and as twelve: two boxes."""
    boxes = (([0, 0, 0], [4, 1.6, 0.8]), ([1, 0.1, 0.8], [3, 1.5, 1.4]))
    whole = 4 * 1.6 * 0.8 + 2 * 1.4 * 0.6
    sides = panels(*boxes)
    for parts in (
        [Part("car", trimesh.util.concatenate(sides))],
        [Part(f"panel {i}", side) for i, side in enumerate(sides)],
    ):
        ready = prepared(*parts)
        assert ready.losses.lost < 0.01
        assert volume_of(ready) == pytest.approx(whole, rel=0.03)


def test_loose_pieces_of_one_object_are_all_there():
    """32 boxes on a board, half of them without a floor: every one is in, by its volume."""
    board = trimesh.creation.box(bounds=[[0, 0, -0.1], [8, 8, 0]])
    pieces = [board]
    for i in range(32):
        lo = np.array([i % 8 + 0.2, 2 * (i // 8) + 0.2, 0.05])
        box = trimesh.creation.box(bounds=[lo, lo + np.array([0.6, 0.6, 1.0])])
        if i % 2:
            box.update_faces(box.triangles_center[:, 2] > 0.06)
        pieces.append(box)
    ready = prepared(*(Part(f"piece {i}", piece) for i, piece in enumerate(pieces)))
    assert ready.losses.lost < 0.01
    assert not ready.losses.parts
    assert volume_of(ready) == pytest.approx(board.volume + 32 * 0.36, rel=0.03)


def tower():
    """Ground without a bottom, and a tower that is part of it, 4 m high over 2.5 m x 2.5 m."""
    x, y = np.meshgrid(np.linspace(0, 10, 41), np.linspace(0, 10, 41))
    bump = 4.0 * ((np.abs(x - 5) < 1.3) & (np.abs(y - 5) < 1.3))
    i = (np.arange(40)[:, None] * 41 + np.arange(40)).reshape(-1)
    faces = np.concatenate([np.stack([i, i + 1, i + 42], 1), np.stack([i, i + 42, i + 41], 1)])
    return part_of(np.stack([x, y, bump], -1).reshape(-1, 3), faces, "ground").mesh


def test_a_tower_on_open_ground_is_closed_below():
    """A scan from above with a closed hut: not the hut alone, but the tower too, as far as seen."""
    hut = trimesh.creation.box((0.5, 0.5, 0.5))
    hut.apply_translation((1, 1, 0.5))
    ready = prepared(Part("scan", trimesh.util.concatenate([tower(), hut])))
    assert ready.losses.lost < MOST_LOST
    assert volume_of(ready) == pytest.approx(4 * 2.75**2 + 0.125, rel=0.1)  # sloped by one cell


def test_what_would_lose_its_volume_is_refused():
    """A hut and twenty plates thinner than epsilon: 28 % of the volume is no mesh of it.

    The line says how much, where, and the ways out.
    """
    plate = [
        trimesh.creation.box(bounds=[[1, 0, z], [3, 2, z + 0.004]]) for z in np.arange(20) / 10
    ]
    hut = trimesh.creation.box(bounds=[[0, 0, 0], [0.5, 0.5, 0.5]])
    asset = Asset("yard", (Part("hut", hut), Part("plates", trimesh.util.concatenate(plate))))
    ready = prepared(*asset.parts, thinnest=2.5e-3)
    lost = 20 * 0.016 / (20 * 0.016 + 0.125)
    assert ready.losses.lost == pytest.approx(lost, abs=0.1)  # of 350 samples: 4 sigma
    assert not ready.kept_volume.ok
    with pytest.raises(NoVolumeError, match=r"[67].% of the volume .* \('plates'\): .*broken"):
        tetrahedralize(asset, **QUICK)


def test_shares_are_told_by_name():
    """A cube and a sheet of twice a cube's side: no volume lost, a quarter of the area, by name."""
    cube = Part("cube", trimesh.creation.box((1, 1, 1)))
    sheet = part_of([[2, 0, 0], [4, 0, 0], [4, 1, 0], [2, 1, 0]], [[0, 1, 2], [0, 2, 3]], "sheet")
    found = prepared(cube, sheet).losses
    assert found.lost == 0
    assert found.volume == pytest.approx(1, rel=0.05)
    assert found.lost_area == pytest.approx(2 / 8, abs=0.03)  # of 4000 samples: 4 sigma
    assert [(part.name, part.volume, part.area) for part in found.parts] == [("sheet", 0, 1)]


def test_patches_become_one_mesh():
    """Through the engine: the ball's volume, both distances to the file as read within epsilon."""
    ball = trimesh.creation.icosphere(2)
    mesh, report = tetrahedralize(Asset("b", (Part("ball", patches(ball, 12, gap=5e-4)),)), **QUICK)
    assert report.ok, report.failed
    assert mesh.volume == pytest.approx(ball.volume, rel=0.02)
    assert report.distances.bridged_share < 0.005
