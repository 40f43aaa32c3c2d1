"""Lattices cut to analytic bodies: volumes, corners, angles, thin things, the same mesh twice."""

import numpy as np
import pytest
import trimesh
from autophyx_tet.fem.errors import NoVolumeError, UsageError
from autophyx_tet.toolkit.meshing.tetrahedralize import tetrahedralize

from .test_tetrahedralize import asset_of


def stuffed(edge, **meshes):
    """A mesh that keeps all that a lattice promises."""
    mesh, report = tetrahedralize(asset_of(**meshes), mesher="stuffing", edge_length=edge)
    assert report.ok, report.failed
    assert (report.mesher, report.quality.components) == ("stuffing", 1)
    assert report.quality.dihedral_min >= 9
    assert report.quality.dihedral_max <= 166
    return mesh, report


def turned(mesh, seed=0):
    """The same body in a random pose."""
    angles = np.random.default_rng(seed).random(3)
    return mesh.copy().apply_transform(trimesh.transformations.random_rotation_matrix(angles))


def volumes(mesh):
    return dict(zip(mesh.region_names, mesh.region_volumes(), strict=True))


def test_a_box_in_line_is_exact():
    """Its faces are planes of the lattice or cut parallel to them: not a digit is lost."""
    mesh, _ = stuffed(0.1, box=trimesh.creation.box((1, 0.5, 0.3)))
    assert mesh.volume == pytest.approx(0.15, rel=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_a_tilted_box_keeps_its_corners(seed):
    """Unsnapped they are .7 edges off; each is a node then, to single precision."""
    box = turned(trimesh.creation.box((1, 0.6, 0.4)), seed)
    mesh, _ = stuffed(0.08, box=box)
    away = np.linalg.norm(mesh.points[:, None] - box.vertices, axis=-1).min(axis=0)
    assert away.max() < 1e-5
    assert mesh.volume == pytest.approx(0.24, rel=5e-3)


def test_nested_balls_and_touching_cubes():
    """Volumes to .5 % of the polyhedra, the cubes' common wall to the digit."""
    inner, outer = trimesh.creation.icosphere(2, radius=0.5), trimesh.creation.icosphere(2)
    mesh, _ = stuffed(0.15, outer=outer, inner=inner)
    found = {"inner": inner.volume, "outer": outer.volume - inner.volume}
    assert volumes(mesh) == pytest.approx(found, rel=5e-3)
    a, b = trimesh.creation.box((1, 1, 1)), trimesh.creation.box((1, 1, 1))
    mesh, report = stuffed(0.2, left=a, right=b.apply_translation((1, 0, 0)))
    assert volumes(mesh) == pytest.approx({"left": 1, "right": 1}, rel=1e-6)
    assert report.doubled_points == 0


@pytest.mark.parametrize("edges", [2.0, 1.5, 1.0])
def test_a_tilted_rod_keeps_its_volume(edges):
    """As thick as the lattice's edge it loses three quarters when cut, 1 % when matched."""
    rod = turned(trimesh.creation.cylinder(0.025 * edges, 1, sections=48))
    mesh, _ = stuffed(0.05, rod=rod)
    assert mesh.volume == pytest.approx(rod.volume, rel=1e-2)


@pytest.mark.parametrize("edges", [1.2, 1.0])
def test_a_tilted_plate_keeps_its_volume(edges):
    mesh, _ = stuffed(0.05, plate=turned(trimesh.creation.box((0.8, 0.8, 0.05 * edges))))
    assert mesh.volume == pytest.approx(0.8 * 0.8 * 0.05 * edges, rel=1e-2)


def test_what_is_thinner_than_the_lattice_is_said():
    """A plate of half an edge beside a cube: its volume is off, and fTetWild is offered."""
    plate = turned(trimesh.creation.box((1, 1, 0.025)))
    cube = trimesh.creation.box((1, 1, 1)).apply_translation((1.2, 0, 0))
    mesh, report = tetrahedralize(
        asset_of(cube=cube, plate=plate), mesher="stuffing", edge_length=0.05
    )
    assert (mesh.volumes > 0).all()
    said = [warning for warning in report.warnings if "thinner than the lattice" in warning]
    assert any("'plate'" in one and "--mesher ftetwild" in one for one in said)


def test_a_body_that_would_fall_apart_is_refused():
    """A plate of a third of an edge comes in pieces: exit 4, unless they are accepted."""
    plate = asset_of(plate=turned(trimesh.creation.box((1, 1, 0.03))))
    options = {"mesher": "stuffing", "edge_length": 0.1}
    with pytest.raises(NoVolumeError, match=r"loose pieces .*wanted at most 0.05"):
        tetrahedralize(plate, **options)
    _, report = tetrahedralize(plate, **options, accept_broken=True)
    assert any("'plate'" in one and "fell off" in one for one in report.warnings)


def test_the_same_input_gives_the_same_mesh():
    """To the bit, and again with another wanted number of tets."""
    ball = turned(trimesh.creation.icosphere(2))
    first, second = (stuffed(None, ball=ball)[0] for _ in range(2))
    assert (first.points == second.points).all()
    assert (first.tets == second.tets).all()
    assert len(first.tets) == pytest.approx(50_000, rel=0.2)


def test_budget_of_tets_is_kept_by_a_lattice():
    mesh, _ = tetrahedralize(
        asset_of(ball=trimesh.creation.icosphere(2)), mesher="stuffing", max_tets=3000
    )
    assert 1000 < len(mesh.tets) <= 3000


def test_wrong_meshers_and_edges_are_usage_errors():
    cube = asset_of(cube=trimesh.creation.box((1, 1, 1)))
    for options, words in (
        ({"mesher": "stufing"}, "did you mean 'stuffing'"),
        ({"mesher": "stuffing", "edge_length": 1e-4}, "--edge-length"),
    ):
        with pytest.raises(UsageError, match=words):
            tetrahedralize(cube, **options)
