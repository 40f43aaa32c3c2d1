"""Bodies keep what their files had, and say in volume, place and number what they lost."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from autophyx_tet.converters.points.gaussians import standard_columns
from autophyx_tet.converters.points.table import PointTable, write_points
from autophyx_tet.converters.points.views import splat_surface
from autophyx_tet.fem.errors import NoVolumeError, UsageError
from autophyx_tet.fem.mesh import TetMesh
from autophyx_tet.predictors.appearance.surface import skin_of
from autophyx_tet.predictors.asset import Asset, Part
from autophyx_tet.toolkit.asset.load import load_asset
from autophyx_tet.toolkit.asset.repair import stacked
from autophyx_tet.toolkit.meshing import convert as conversion
from autophyx_tet.toolkit.meshing.convert import tetrahedralize
from autophyx_tet.toolkit.meshing.guarantees import swallowed
from autophyx_tet.toolkit.meshing.stuffing.pieces import MANY, SPECK, without_floaters
from autophyx_tet.toolkit.options import ConvertOptions

from ..converters.test_isosurface import ball_of_splats

LATTICE = {"mesher": "stuffing", "max_tets": 4000}


def asset_of(samples="", **meshes):
    parts = tuple(Part(name, mesh) for name, mesh in meshes.items())
    return Asset("thing", parts, samples=samples)


def ball(radius, at=(0.0, 0, 0), subdivisions=2):
    mesh = trimesh.creation.icosphere(subdivisions, radius)
    mesh.apply_translation(at)
    return mesh


def test_a_speck_in_the_air_is_left_out_and_told_and_another_one_stays():
    """Volumes go with r^3: .1 of the radius is .001 of it, .3 is .027."""
    both = trimesh.util.concatenate([ball(1), ball(0.1, (2, 0, 0)), ball(0.3, (0, 2, 0))])
    mesh, report = tetrahedralize(asset_of(ball=both), **LATTICE)
    assert report.floaters == 1
    assert report.floating == pytest.approx(0.001 / 1.028, rel=0.05)
    assert mesh.bounds[1, 0] < 1.1
    assert mesh.bounds[1, 1] > 2
    assert any("1 loose pieces" in told and "--keep all" in told for told in report.warnings)


@pytest.mark.parametrize(
    ("keep", "left"), [("all", 3), ("largest", 1), ("1", 1), ("2", 2), (".5", 1), (".01", 2)]
)
def test_keep_says_which_pieces_stay(keep, left):
    both = trimesh.util.concatenate([ball(1), ball(0.1, (2, 0, 0)), ball(0.3, (0, 2, 0))])
    kept = without_floaters(asset_of(ball=both), keep)
    assert kept.asset.parts[0].mesh.body_count == left
    assert kept.left_out == 3 - left


@pytest.mark.parametrize("keep", ["none", "0", "-1", "1.5"])
def test_another_keep_is_refused(keep):
    with pytest.raises(UsageError, match="wanted all, largest"):
        without_floaters(asset_of(ball=ball(1)), keep)


def test_what_touches_is_no_floater_nor_what_is_a_part_nor_many():
    """An eye half in the head, a screw that has a name, and gravel stay."""
    head = trimesh.util.concatenate([ball(1), ball(0.1, (1, 0, 0))])
    assert without_floaters(asset_of(head=head), None).left_out == 0
    assert without_floaters(asset_of(head=ball(1), screw=ball(0.1, (2, 0, 0))), None).left_out == 0
    count = int(2 * MANY / 0.15**3)
    gravel = [ball(0.15, (2 + k, 0, 0), 1) for k in range(count)]
    assert 0.15**3 < SPECK
    whole = trimesh.util.concatenate([ball(1), *gravel])
    assert without_floaters(asset_of(gravel=whole), None).left_out == 0
    assert without_floaters(asset_of(samples="a scan", gravel=whole), None).left_out == count


@pytest.mark.slow
def test_a_shell_within_another_of_the_same_way_is_told_and_a_cavity_is_none():
    outer, inner = ball(1, subdivisions=3), ball(0.5)
    both = trimesh.util.concatenate([outer, inner])
    assert swallowed(stacked((Part("a", both),))) == [0]
    _, report = tetrahedralize(asset_of(egg=both), **LATTICE)
    assert any("'egg': a closed surface inside another" in told for told in report.warnings)
    inner.invert()
    hollow = trimesh.util.concatenate([outer, inner])
    assert swallowed(stacked((Part("a", hollow),))) == []
    beside = trimesh.util.concatenate([outer, ball(0.5, (0.8, 0, 0))])  # they cross, none is lost
    assert swallowed(stacked((Part("a", beside),))) == []


@pytest.mark.slow
def test_what_a_coarse_lattice_cuts_off_has_its_part_volume_and_place():
    """The thin end of a wedge: the last eighth of its length is (1/8)^2 of its volume."""
    corners = [[x, y, z] for x, z in ((0, 0), (1, 0), (0, 0.5)) for y in (0, 0.3)]
    wedge = trimesh.convex.convex_hull(np.array(corners, float))
    _, report = tetrahedralize(asset_of(wedge=wedge), mesher="stuffing", max_tets=500)
    (loss,) = report.part_losses
    assert loss.name == "wedge"
    assert loss.place[0] > 0.6  # towards the thin end
    assert loss.volume < 2 * loss.shorter**2 + 0.03
    assert any(
        "the mesh lacks 'wedge'" in told and "of its box" in told for told in report.warnings
    )


def test_a_part_without_tets_has_a_row():
    lid = trimesh.creation.box((1, 1, 0.004))
    lid.apply_translation((0, 0, 1.0))
    mesh, report = tetrahedralize(asset_of(box=trimesh.creation.box((1, 1, 1)), lid=lid), **LATTICE)
    rows = {region.name: region.tets for region in report.regions}
    assert rows == {"box": len(mesh.tets), "lid": 0}


@pytest.mark.slow
@pytest.mark.parametrize(("share", "attempts"), [(0.004, 1), (0.006, 2)])
def test_a_crumb_that_comes_off_makes_no_lattice_finer(monkeypatch, share, attempts):
    """.4 % of a part is told, if anything; .6 % is mended: within a budget by beads alone."""
    asked = []

    def cutting(solids, target, runner):
        asked.append(target.beads)
        filling = real(solids, target, runner)
        return filling._replace(lattice=filling.lattice._replace(parted_shares={0: share}))

    real = conversion.MESHERS["stuffing"]
    monkeypatch.setattr(conversion, "MESHERS", {"stuffing": cutting})
    tetrahedralize(asset_of(cube=trimesh.creation.box((1, 1, 1))), **LATTICE)
    assert asked == [False, True][:attempts]


def test_two_fans_at_a_vertex_are_told(monkeypatch):
    """Quality counts them; a conversion with some says that it is manifold by edges alone."""
    found = conversion.quality

    def pinched(mesh: TetMesh):
        measured = found(mesh)
        return replace(measured, boundary=replace(measured.boundary, pinched_vertices=3))

    monkeypatch.setattr(conversion, "quality", pinched)
    _, report = tetrahedralize(asset_of(ball=ball(1)), **LATTICE)
    assert any("at 3 vertices of the boundary two fans" in told for told in report.warnings)


@pytest.mark.slow
def test_a_first_body_is_shown_while_the_engine_works(monkeypatch):
    """Once, after the seconds that are waited for: a lattice, and then the engine's answer."""
    monkeypatch.setattr(conversion, "FORESEEN", 0.0)
    shown = []
    mesh, report = tetrahedralize(asset_of(ball=ball(1)), epsilon_rel=1e-3, first=shown.append)
    assert len(shown) == 1
    assert shown[0].volume == pytest.approx(mesh.volume, rel=0.01)
    assert (report.mesher, len(report.attempts)) == ("ftetwild", 1)


def test_fast_ends_with_the_lattice():
    assert ConvertOptions(fast=True).engine()["mesher"] == "stuffing"
    assert ConvertOptions(fast=True, mesher="ftetwild").engine()["mesher"] == "ftetwild"
    assert ConvertOptions().engine()["mesher"] == "auto"


def dirty_capture(rng):
    """The ball of splats, half of it blue, with haze, a loose cluster and a stray far off."""
    clean = ball_of_splats()
    rows = rng.choice(len(clean), 400)
    more = {name: np.asarray(values)[rows].copy() for name, values in clean.columns.items()}
    far = np.concatenate([rng.uniform(-2, 2, (300, 3)), rng.normal((0, 0, 3), 0.02, (99, 3))])
    far = np.concatenate([far, [[0, 100.0, 0]]])
    for axis, name in enumerate("xyz"):
        more[name] = far[:, axis].astype(np.float32)
    more["opacity"][:300] = -4  # the logit of .02
    table = {k: np.concatenate([np.asarray(v), more[k]]) for k, v in clean.columns.items()}
    table["f_dc_2"] = np.where(table["z"] > 0, 1.7, -1.7).astype(np.float32)
    return PointTable(table)


@pytest.mark.slow
def test_splats_are_pruned_cropped_coloured_and_stand_upright(tmp_path):
    """4/3 pi within 3 % whatever floats around; half of it by a crop; blue above, none below."""
    path = tmp_path / "ball.ply"
    write_points(path, dirty_capture(np.random.default_rng(0)))
    asset = load_asset(path)
    (part,) = asset.parts
    assert part.mesh.volume == pytest.approx(4 / 3 * np.pi, rel=0.03)
    assert part.mesh.body_count == 1
    assert asset.up == "-y"
    assert any("100 of 20400 splats float" in told for told in asset.warnings)
    faces = np.arange(len(part.mesh.faces))
    blue = skin_of(part.mesh)(faces, np.full((len(faces), 3), 1 / 3))[:, 2]
    height = part.mesh.triangles_center[:, 2]
    assert blue[height > 0.1].min() > 0.9
    assert blue[height < -0.1].max() < 0.1
    half = load_asset(path, crop="-2,-2,0,2,2,2").parts[0].mesh
    assert half.bounds[0, 2] > -0.1
    with pytest.raises(NoVolumeError, match="no opaque splat lies within"):
        load_asset(path, crop="5,5,5,6,6,6")
    with pytest.raises(UsageError, match="wanted two corners"):
        load_asset(path, crop="1,2,3")
    with pytest.raises(NoVolumeError, match=r"above 0\.9"):
        load_asset(path, opacity=0.9)


def test_large_surfels_leave_no_holes(tmp_path):
    """1,500 flat splats of a tenth of the diameter on a ball of .5 m: .5236 m3 within 2 %."""
    rng = np.random.default_rng(0)
    table = ball_of_splats(1500, 0.98)
    columns = {name: np.asarray(values) for name, values in table.columns.items()}
    for name in "xyz":
        columns[name] = (columns[name] / 2).astype(np.float32)
    for axis, size in enumerate((0.05, 0.05, 0.01)):
        columns[f"scale_{axis}"] = np.full(1500, np.log(size), np.float32)
    columns["opacity"] = (columns["opacity"] + rng.normal(0, 0.1, 1500)).astype(np.float32)
    write_points(tmp_path / "surfels.ply", PointTable(columns))
    mesh = load_asset(tmp_path / "surfels.ply").parts[0].mesh
    assert mesh.volume == pytest.approx(np.pi / 6, rel=0.02)
    assert mesh.body_count == 1


@pytest.mark.parametrize(("shape", "within"), [("ball", 0.005), ("box", 0.015)])
def test_flat_splats_enclose_what_they_lie_on(shape, within):
    """Surfels on a ball and a box of known volume; a box's edges are rounded by what covers them.

    By the median depth along normals the ball was .9 % too small, the box 1.9 %. By the mean depth
    of what lies near the surface the box is 1.2 % too small, where the chair of a rough capture is
    2 % too large and was 9 %.
    """
    rng = np.random.default_rng(1)
    if shape == "ball":
        count, volume, area = 400, np.pi / 6, np.pi
        height = 1 - (2 * np.arange(count) + 1) / count
        turn = np.arange(count) * np.pi * (1 + 5**0.5)
        ring = np.sqrt(1 - height**2)
        normal = np.column_stack([ring * np.cos(turn), ring * np.sin(turn), height])
        places, sigma = normal / 2, 0.9 * np.sqrt(area / count)
    else:
        count, sides = 3000, np.array([1.0, 0.8, 0.6])
        of_axis = sides.prod() / sides  # area of a face across each axis
        volume, area = sides.prod(), 2 * of_axis.sum()
        axis, rows = rng.choice(3, count, p=of_axis / of_axis.sum()), np.arange(count)
        normal, places = np.zeros((count, 3)), rng.uniform(-0.5, 0.5, (count, 3)) * sides
        normal[rows, axis] = rng.choice([-1, 1], count)
        places[rows, axis] = normal[rows, axis] * sides[axis] / 2
        sigma = 1.2 * np.sqrt(area / count)
    turns = np.column_stack([1 + normal[:, 2], -normal[:, 1], normal[:, 0], np.zeros(count)])
    turns[normal[:, 2] == -1] = 0, 1, 0, 0  # z to the normal
    flat = np.tile(np.log([sigma, sigma, sigma / 10]), (count, 1))
    table = PointTable(
        standard_columns(places, flat, turns, np.full(count, 0.98), np.zeros((count, 3)))
    )
    assert splat_surface(table).volume == pytest.approx(volume, rel=within)


def test_a_scan_whose_surface_encloses_little_is_refused():
    """One ball and, of four times its surface, sheets: a body of a part is another body."""
    sheets = []
    for k in range(4):
        sheet = trimesh.creation.box((1.8, 1.8, 1))
        sheet.update_faces(sheet.triangles_center[:, 2] > 0.4)
        sheet.apply_translation((3 * (k + 1), 0, 0))
        sheets.append(sheet)
    scan = trimesh.util.concatenate([ball(0.3), *sheets])
    with pytest.raises(NoVolumeError, match="encloses nothing and would be left out"):
        tetrahedralize(asset_of(samples="1,000 points", scan=scan), **LATTICE)
