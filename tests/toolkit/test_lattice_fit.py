"""How a lattice fits: what is thinner than its edge, what it joins, what it cuts off."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from autophyx_tet.fem.errors import NoVolumeError
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.toolkit.asset.repair import repair
from autophyx_tet.toolkit.asset.solids import Solids
from autophyx_tet.toolkit.asset.surface import Surface
from autophyx_tet.toolkit.asset.triangles import edge_components
from autophyx_tet.toolkit.meshing.convert import tetrahedralize
from autophyx_tet.toolkit.meshing.ftetwild import EngineTarget
from autophyx_tet.toolkit.meshing.stuffing.mesher import resolving, without_fragments
from autophyx_tet.toolkit.meshing.stuffing.pieces import came_off

from .test_stuffing import solids_of, turned
from .test_tetrahedralize import asset_of


@pytest.mark.slow
def test_what_is_thinner_than_the_lattice_is_said():
    """A plate of half an edge beside a cube: its volume is off, and fTetWild is offered."""
    plate = turned(trimesh.creation.box((0.6, 0.6, 0.05)))
    cube = trimesh.creation.box((0.6, 0.6, 0.6)).apply_translation((0.8, 0, 0))
    mesh, report = tetrahedralize(
        asset_of(cube=cube, plate=plate), mesher="stuffing", edge_length=0.08
    )
    assert (mesh.volumes > 0).all()
    said = [warning for warning in report.warnings if "thinner than the lattice" in warning]
    assert any("'plate'" in one and "--mesher ftetwild" in one for one in said)


@pytest.mark.slow
def test_gaps_that_a_lattice_closes_are_said():
    """Two blocks .3 edges apart become one body: said of both; 1.5 edges apart, of neither."""
    for gap, bodies in ((0.03, 1), (0.15, 2)):
        block = trimesh.creation.box((0.5, 0.5, 0.5))
        other = turned(block.copy().apply_translation((0.5 + gap, 0, 0)))
        way = {"mesher": "stuffing", "edge_length": 0.1}
        _, report = tetrahedralize(asset_of(left=turned(block), right=other), **way)
        assert report.quality.components == bodies
        told = dict(report.closed_gaps)
        assert set(told) == ({"left", "right"} if bodies == 1 else set())
        # A sixth of each block looks at the other, a twelfth of all surface; rims stay apart.
        assert all(0.5 / 12 < share < 1.1 / 12 for share in told.values())
        assert any("join what is apart" in w for w in report.warnings) == (bodies == 1)
        assert any("join what is apart" in w for w in report.differences) == (bodies == 1)


@pytest.mark.slow
def test_a_leg_thinner_than_the_lattice_gets_a_finer_one():
    """A cube of 50,000 tets with a leg that these cut into pieces: once more, in one piece."""
    cube = trimesh.creation.box((1, 1, 1))
    leg = trimesh.creation.box((0.045, 0.045, 1)).apply_translation((0, 0, -0.99))
    asset = asset_of(cube=turned(cube), leg=turned(leg))
    mesh, report = tetrahedralize(asset, mesher="stuffing")
    assert [a.outcome[:9] for a in report.attempts] == ["in pieces", "ok"]
    assert report.quality.components == 1
    assert mesh.volume == pytest.approx(1 + 0.045**2 * 0.99, rel=0.01)


def test_a_lattice_is_as_fine_as_thin_walls_want():
    """Beside a cube, a plate on a quarter of the surface: three quarters of an edge, if affordable.

    Of a cube alone, or with a plate that is thick enough, the lattice stays as it is.
    """
    cube, target = trimesh.creation.box((1, 1, 1)), EngineTarget.of(2.0, None, 2e-3)
    for thickness, wanted in ((0.03, 0.04), (0.1, None), (1e-3, None)):
        plate = trimesh.creation.box((1, 1, thickness)).apply_translation((0, 0, 0.8))
        found = resolving(solids_of(trimesh.util.concatenate([cube, plate])), target, most=250_000)
        if wanted is None:
            assert found.tets == (50_000 if thickness > 0.05 else 250_000)
        else:  # tets are whole numbers: an edge to a millionth
            assert found.lattice_edge(1 + thickness) == pytest.approx(wanted, rel=1e-5)
    assert resolving(solids_of(turned(cube)), target, most=250_000) == target


@pytest.mark.slow
def test_a_bar_that_touches_a_slab_at_an_edge_hangs_on_it():
    """Half of its length beside the slab, edge on edge: beads of .6 % join what came apart.

    Five epsilons off it there is none, and two bodies.
    """
    slab = trimesh.creation.box((1, 0.6, 0.1))
    for off, bodies in ((0.0, 1), (0.014, 2)):
        bar = trimesh.creation.box((0.1, 0.1, 0.8))
        bar.apply_translation((0.55 + off, 0.35 + off, 0.4))
        way = {"mesher": "stuffing", "edge_length": 0.07}
        mesh, report = tetrahedralize(asset_of(slab=turned(slab), bar=turned(bar)), **way)
        assert report.ok, report.failed
        assert report.quality.components == bodies
        assert (report.beads > 0) == (bodies == 1)
        assert report.beads < 0.01 * mesh.volume
        assert mesh.volume == pytest.approx(0.068 + report.beads, rel=2e-3)
        assert any("would come apart" in w for w in report.differences) == (bodies == 1)


@pytest.mark.slow
def test_a_leg_that_its_lattice_cuts_hangs_on_its_cube():
    """A leg of .6 edges, of which most came off: beads are told, and within the volume promised."""
    leg = trimesh.creation.box((0.06, 0.06, 0.5)).apply_translation((0, 0, -0.75))
    asset = asset_of(cube=turned(trimesh.creation.box((1, 1, 1))), leg=turned(leg))
    mesh, report = tetrahedralize(asset, mesher="stuffing", edge_length=0.1)
    assert report.ok, report.failed
    assert [a.outcome[:9] for a in report.attempts] == ["in pieces", "ok"]
    assert report.quality.components == 1
    assert 0 < report.beads < 0.005 * mesh.volume
    assert mesh.volume == pytest.approx(1.0018 + report.beads, rel=2e-3)


def test_crumbs_go_and_small_bodies_stay():
    """Beside a block a body of a ten thousandth of it is kept, as small a fragment of it is not."""
    block, screw = box_mesh((1, 1, 1), (2, 2, 2)), box_mesh((0.05,) * 3, (1, 1, 1), lo=(2, 0, 0))
    crumb = box_mesh((0.05,) * 3, (1, 1, 1), lo=(1.01, 0.4, 0.4))
    bodies = [trimesh.Trimesh(m.points, m.boundary.faces) for m in (block, screw)]
    surface, _ = repair(asset_of(block=bodies[0], screw=bodies[1]).parts)
    solids = Solids.of(surface, 2, thinnest=1e-6)
    meshes, starts = (block, screw, crumb), (0, 27, 35)
    points = np.concatenate([m.points for m in meshes])
    tets = np.concatenate([m.tets + n for m, n in zip(meshes, starts, strict=True)])
    kept = without_fragments(points, tets, solids)
    assert kept.sum() == len(block.tets) + len(screw.tets)
    assert not kept[-len(crumb.tets) :].any()


def test_houses_on_one_ground_are_not_loose():
    """Two boxes without floors on one sheet: an open surface, two bodies.

    Without nodes within, the small one is a crumb of the other.
    """
    found = [_parted(cells) for cells in ((2, 2, 2), (2, 2, 1))]
    assert found == [{}, {0: pytest.approx(1 / 3)}]


def _parted(cells: tuple[int, int, int]) -> dict[int, float]:
    """What came off of a box of 8 cells and one half as high of these, on one ground."""
    boxes = [box_mesh((1, 1, 1), (2, 2, 2)), box_mesh((1, 1, 0.5), cells, lo=(3, 0, 0))]
    points = np.concatenate([mesh.points for mesh in boxes])
    tets = np.concatenate([boxes[0].tets, boxes[1].tets + 27])
    walls = np.concatenate([boxes[0].boundary.faces, boxes[1].boundary.faces + 27])
    walls = walls[(points[walls][:, :, 2] > 0).any(axis=1)]
    rim = ((1, 0, 0), (1, 0.5, 0), (3, 0, 0), (3, 0.5, 0))
    a, b, c, d = (np.flatnonzero((points == corner).all(axis=1))[0] for corner in rim)
    faces = np.concatenate([walls, [[a, c, b], [c, d, b]]])
    surface = Surface(points, faces, np.zeros(len(faces), int), edge_components(faces))
    solids = Solids.of(surface, 1, thinnest=1e-6, whole=True)
    return came_off(points, tets, np.zeros(len(tets), int), solids, 1e-3)


@pytest.mark.slow
def test_a_table_whose_legs_would_fall_off_is_refused():
    """Legs of half an edge, parts of their own, come off the top as crumbs: nothing would stand."""
    top = trimesh.creation.box((1, 0.6, 0.1))
    places = [(x, y, -0.8) for x in (-0.45, 0.45) for y in (-0.25, 0.25)]
    legs = [trimesh.creation.box((0.04, 0.04, 1.5)).apply_translation(at) for at in places]
    table = asset_of(top=turned(top), legs=turned(trimesh.util.concatenate(legs)))
    with pytest.raises(NoVolumeError, match=r"fell off .*wanted"):
        tetrahedralize(table, mesher="stuffing", edge_length=0.1)


@pytest.mark.slow
def test_a_body_that_would_fall_apart_is_refused():
    """A plate of a third of an edge comes in pieces: exit 4, unless they are accepted."""
    plate = asset_of(plate=turned(trimesh.creation.box((1, 1, 0.03))))
    options = {"mesher": "stuffing", "edge_length": 0.1}
    with pytest.raises(NoVolumeError, match=r"fell off .*wanted at most 0.05"):
        tetrahedralize(plate, **options)
    _, report = tetrahedralize(plate, **options, accept_broken=True)
    assert any("'plate'" in one and "fell off" in one for one in report.warnings)


@pytest.mark.slow
def test_samples_get_a_finer_lattice_than_asked_where_that_one_falls_apart():
    """The plate as a scan has it, and no mesher asked for: whole, and the first try is told."""
    plate = asset_of(plate=turned(trimesh.creation.box((1, 1, 0.03))))
    mesh, report = tetrahedralize(replace(plate, samples="points"), edge_length=0.1)
    assert report.ok
    assert report.quality.components == 1
    assert mesh.volume == pytest.approx(0.03, rel=0.01)
    assert any("1 of 2 attempts failed" in one for one in report.warnings)
