"""What of the raw file is not in the solids: patches, panels, loose pieces, scans."""

import re

import numpy as np
import pytest
import trimesh
from autophyx_tet.predictors.asset import Asset, Part
from autophyx_tet.toolkit.asset.repair import stacked
from autophyx_tet.toolkit.meshing.convert import Preparation, tetrahedralize
from autophyx_tet.toolkit.meshing.guarantees import MOST_LOST, FileSurface

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


def rosette(count=14):
    """Leaves around a stem: strips that rise and droop, each overlapping its neighbours."""
    leaves, t = [], np.linspace(0, 1, 9)
    for turn in 2 * np.pi * np.arange(count) / count:
        out, up = 1.5 * t, 1.2 * np.sin(np.pi * 0.85 * t)
        half = 0.45 * np.sin(np.pi * (0.05 + 0.9 * t))
        rim = [np.stack([out, side * half, up + 0.02 * side], axis=1) for side in (-1, 1)]
        points = trimesh.transform_points(
            np.concatenate(rim), trimesh.transformations.rotation_matrix(turn, [0, 0, 1])
        )
        i = np.arange(8)
        faces = np.concatenate([np.stack([i, i + 1, i + 10], 1), np.stack([i, i + 10, i + 9], 1)])
        leaves.append(trimesh.Trimesh(points, faces, process=False))
    return trimesh.util.concatenate(leaves)


@pytest.mark.slow
@pytest.mark.parametrize("gap", [0.0, 1e-3])
def test_a_ball_in_forty_patches_is_a_ball(gap):
    """Torn, wound at random, with and without gaps: 4/3 pi, but for the flat triangles."""
    ball = trimesh.creation.icosphere(3)
    ready = prepared(Part("ball", patches(ball, 40, gap=gap)))
    assert ready.losses.lost < 0.01
    assert volume_of(ready) == pytest.approx(ball.volume, rel=0.03)


@pytest.mark.slow
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


@pytest.mark.slow
def test_panels_around_no_floor_are_a_body():
    """A hull of five panels: no piece and no cap closes it, the winding number does, and a lattice.

    Over the missing floor it is a half; the body bulges there by less than a tenth of its height.
    """
    sides = [s for s in panels(([0, 0, 0], [4, 1.6, 0.8])) if s.centroid[2] > 0.01]
    asset = Asset("car", tuple(Part(f"panel {i}", side) for i, side in enumerate(sides)))
    ready = prepared(*asset.parts)
    assert (len(sides), ready.closing.whole) == (5, True)
    assert ready.losses.lost < 0.01
    assert volume_of(ready) == pytest.approx(4 * 1.6 * 0.8, rel=0.1)
    mesh, report = tetrahedralize(asset, max_tets=5_000)
    assert report.mesher == "stuffing"
    assert mesh.volume == pytest.approx(volume_of(ready), rel=0.05)
    assert any("winding number" in told for told in report.warnings)


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


@pytest.mark.slow
def test_a_tower_on_open_ground_is_closed_below():
    """A scan from above with a closed hut: not the hut alone, but the tower too, as far as seen."""
    hut = trimesh.creation.box((0.5, 0.5, 0.5))
    hut.apply_translation((1, 1, 0.5))
    ready = prepared(Part("scan", trimesh.util.concatenate([tower(), hut])))
    assert ready.losses.lost < MOST_LOST
    assert volume_of(ready) == pytest.approx(4 * 2.75**2 + 0.125, rel=0.1)  # sloped by one cell


@pytest.mark.long
def test_thin_plates_are_left_out_by_name():
    """A hut and twenty plates thinner than epsilon: 28 % of the volume are meshed, the rest told.

    The line says how much, of what, and the epsilon that keeps it.
    """
    plate = [
        trimesh.creation.box(bounds=[[1, 0, z], [3, 2, z + 0.004]]) for z in np.arange(20) / 10
    ]
    hut = trimesh.creation.box(bounds=[[0, 0, 0], [0.5, 0.5, 0.5]])
    asset = Asset("yard", (Part("hut", hut), Part("plates", trimesh.util.concatenate(plate))))
    lost = 20 * 0.016 / (20 * 0.016 + 0.125)
    mesh, report = tetrahedralize(asset, **QUICK)
    assert mesh.region_names == ("hut",)
    assert not report.ok
    assert report.losses.thin == report.losses.lost == pytest.approx(lost, abs=0.1)  # 4 sigma
    (told,) = (w for w in report.warnings if "'plates'" in w)
    assert re.search(r"20 closed pieces .* 'plates', [67].% of the volume", told)
    (epsilon,) = (float(number) for number in re.findall(r"--epsilon-rel ([\d.e-]+)", told))
    assert prepared(*asset.parts, thinnest=epsilon / 2).losses.lost == 0


@pytest.mark.slow
def test_leaves_over_a_pot_are_no_body():
    """Leaves that overlap wind three times around what is under them, and enclose nothing."""
    pot = trimesh.creation.cylinder(0.5, 0.6, sections=32)
    pot.apply_translation((0, 0, -0.3))
    ready = prepared(Part("leaves", rosette()), Part("pot", pot))
    assert ready.losses.lost < MOST_LOST
    assert ready.losses.volume == pytest.approx(pot.volume, rel=0.1)
    assert volume_of(ready) == pytest.approx(pot.volume, rel=0.03)


def test_a_channel_without_lid_and_ends_is_closed_by_the_smallest_cap():
    """A beam of three sides: a fan around the rim's centre would cut it in half."""
    beam = trimesh.creation.box(bounds=[[0, 0, 0], [10, 1, 1]])
    middle = beam.triangles_center
    beam.update_faces((middle[:, 2] < 0.99) & (middle[:, 0] > 0.01) & (middle[:, 0] < 9.99))
    plate = trimesh.creation.box(bounds=[[0, 3, 0], [10, 8, 1]])
    ready = prepared(Part("beam", beam), Part("plate", plate))
    assert ready.losses.lost < 0.01
    assert volume_of(ready) == pytest.approx(10 + 50, rel=0.03)


def test_a_cavity_wound_as_a_body_is_no_loss():
    """A bottle whose inner wall looks out as its outer one does: 2 in the cavity, seen as 0."""
    outer, inner = trimesh.creation.box((2, 2, 2)), trimesh.creation.box((1.8, 1.8, 1.8))
    read = stacked([Part("bottle", trimesh.util.concatenate([outer, inner]))])
    seen = read._replace(faces=np.concatenate([read.faces[:12], read.faces[12:, ::-1]]))
    where = np.array([[0, 0, 0], [0.95, 0, 0], [1.1, 0, 0]])
    assert FileSurface(read, seen, coherent=True).encloses(where).tolist() == [False, True, False]
    # Where both say that it is inside it is: two bodies that overlap.
    assert FileSurface(read, read, coherent=True).encloses(where).tolist() == [True, True, False]


def test_shares_are_told_by_name():
    """A cube and a sheet of twice a cube's side: no volume lost, a quarter of the area, by name."""
    cube = Part("cube", trimesh.creation.box((1, 1, 1)))
    sheet = part_of([[2, 0, 0], [4, 0, 0], [4, 1, 0], [2, 1, 0]], [[0, 1, 2], [0, 2, 3]], "sheet")
    found = prepared(cube, sheet).losses
    assert found.lost == 0
    assert found.volume == pytest.approx(1, rel=0.05)
    assert found.lost_area == pytest.approx(2 / 8, abs=0.03)  # of 4000 samples: 4 sigma
    assert [(part.name, part.volume, part.area) for part in found.parts] == [("sheet", 0, 1)]


@pytest.mark.slow
def test_patches_become_one_mesh():
    """Through the engine: the ball's volume, both distances to the file as read within epsilon."""
    ball = trimesh.creation.icosphere(2)
    mesh, report = tetrahedralize(Asset("b", (Part("ball", patches(ball, 12, gap=5e-4)),)), **QUICK)
    assert report.ok, report.failed
    assert mesh.volume == pytest.approx(ball.volume, rel=0.02)
    assert report.distances.bridged_share < 0.005
