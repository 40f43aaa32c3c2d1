"""Conversions of analytic bodies, clean and dirty: volumes, regions, guarantees, clear ends."""

import json

import numpy as np
import pytest
import trimesh
from autophyx_tet.fem.errors import NoVolumeError, UsageError
from autophyx_tet.predictors.asset import Asset, Part
from autophyx_tet.toolkit.meshing.convert import tetrahedralize

# Coarse and quick: the laws below do not depend on resolution.
QUICK = {"edge_length_rel": 0.2, "epsilon_rel": 5e-3, "stop_energy": 20.0}


def asset_of(**meshes):
    return Asset("test", tuple(Part(name, mesh) for name, mesh in meshes.items()))


def converted(options=QUICK, **meshes):
    mesh, report = tetrahedralize(asset_of(**meshes), **options)
    assert report.ok, report.failed
    assert report.quality.boundary.bad_edges == 0
    assert (mesh.volumes > 0).all()
    return mesh, report


def test_cube():
    """A flat boundary inside the envelope: volume a^3 far better than area times epsilon."""
    mesh, report = converted(cube=trimesh.creation.box((0.1, 0.1, 0.1)))
    assert mesh.volume == pytest.approx(1e-3, rel=1e-3)
    assert mesh.region_names == ("cube",)
    assert report.quality.components == 1
    json.dumps(report.as_dict())


@pytest.mark.slow
def test_nested_balls():
    """Inner ball and shell keep their volumes within what epsilon allows: area times epsilon."""
    inner, outer = trimesh.creation.icosphere(2, radius=0.5), trimesh.creation.icosphere(2)
    mesh, report = converted(outer=outer, inner=inner)
    volume = dict(zip(mesh.region_names, mesh.region_volumes(), strict=True))
    assert volume["inner"] == pytest.approx(inner.volume, abs=inner.area * report.epsilon)
    shell = outer.volume - inner.volume
    assert volume["outer"] == pytest.approx(shell, abs=(inner.area + outer.area) * report.epsilon)


@pytest.mark.slow
def test_touching_cubes_share_their_wall():
    """Two parts face to face: exact volumes, one connected mesh, no node doubled."""
    a = trimesh.creation.box((1, 1, 1))
    b = trimesh.creation.box((1, 1, 1))
    b.apply_translation((1, 0, 0))
    mesh, report = converted(left=a, right=b)
    assert dict(zip(mesh.region_names, mesh.region_volumes(), strict=True)) == pytest.approx(
        {"left": 1, "right": 1}, rel=1e-2
    )
    assert report.quality.components == 1
    assert report.doubled_points == 0


def _dirty_ball():
    """Torn, with random windings, a hole, repeated faces and a fin: a ball all the same."""
    rng = np.random.default_rng(3)
    ball = trimesh.creation.icosphere(2)
    corners = ball.vertices[ball.faces[4:]]
    turned = rng.random(len(corners)) < 0.5
    corners[turned] = corners[turned][:, ::-1]
    fin = np.array([[corners[50, 0], corners[50, 1], 1.5 * corners[50].mean(axis=0)]])
    soup = np.concatenate([corners, corners[:7], fin]).reshape(-1, 3)
    return ball, trimesh.Trimesh(soup, np.arange(len(soup)).reshape(-1, 3), process=False)


@pytest.mark.slow
def test_dirty_ball():
    ball, dirty = _dirty_ball()
    mesh, report = tetrahedralize(asset_of(ball=dirty), **QUICK)
    assert mesh.volume == pytest.approx(ball.volume, rel=0.05)
    assert report.repair.merged_vertices > 0
    assert report.repair.closed_holes > 0
    assert report.repair.flipped_faces > 0
    assert report.quality.boundary.bad_edges == 0


@pytest.mark.slow
def test_sheet_among_solids_is_named():
    sheet = trimesh.Trimesh([[2, 0, 0], [3, 0, 0], [3, 1, 0], [2, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    mesh, report = converted(cube=trimesh.creation.box((1, 1, 1)), label=sheet)
    assert mesh.region_names == ("cube",)
    assert report.sheets == ("label",)
    assert any("'label'" in w and "--thicken" in w for w in report.warnings)


def test_flat_sheet_has_no_volume():
    sheet = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    with pytest.raises(NoVolumeError, match="--thicken") as error:
        tetrahedralize(asset_of(sheet=sheet))
    assert error.value.exit_code == 4


@pytest.mark.slow
def test_plate_thinner_than_epsilon_is_left_out_and_said():
    plate = trimesh.creation.box((1, 1, 1e-3))
    plate.apply_translation((3, 0, 0))
    mesh, report = converted(cube=trimesh.creation.box((1, 1, 1)), plate=plate)
    assert mesh.region_names == ("cube",)
    assert (report.thin.count, report.thin.parts) == (1, ("plate",))
    assert any("--epsilon-rel" in w for w in report.warnings)


@pytest.mark.slow
def test_thicken_gives_a_sheet_its_volume():
    """A sheet of 1 m^2 thickened by 2 cm holds 0.02 m^3 and is a region beside the cube's."""
    sheet = trimesh.Trimesh([[2, 0, 0], [3, 0, 0], [3, 1, 0], [2, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    options = {**QUICK, "epsilon_rel": 2e-3, "thicken": 0.02}
    mesh, report = converted(options, cube=trimesh.creation.box((1, 1, 1)), label=sheet)
    assert report.sheets == ()
    volumes = dict(zip(mesh.region_names, mesh.region_volumes(), strict=True))
    assert volumes["label"] == pytest.approx(0.02, rel=0.1)


@pytest.mark.slow
def test_budget_of_tets_is_kept():
    mesh, report = converted({**QUICK, "edge_length_rel": 0.1, "max_tets": 3000},
                            cube=trimesh.creation.box((1, 1, 1)))  # fmt: skip
    assert len(mesh.tets) <= 3000
    assert len(report.attempts) > 1


def test_wrong_options_are_usage_errors():
    rows = (
        {"edge_length_rel": 0.0},
        {"epsilon_rel": np.nan},
        {"time_limit": -1.0},
        {"wall": 0.0},
        {"part_wall": {"lid": 0.1}},
    )
    for option in rows:
        with pytest.raises(UsageError) as refused:
            tetrahedralize(asset_of(cube=trimesh.creation.box((1, 1, 1))), **option)
        assert "--" in str(refused.value), option


@pytest.mark.slow
def test_far_away_and_tiny_bodiesconverted():
    """Bare fTetWild crashes at 1e-9 and hangs at +1e9: position and unit do not matter here."""
    for size, place in ((1e-9, 0.0), (1.0, 1e6)):
        cube = trimesh.creation.box((size,) * 3)
        cube.apply_translation((place,) * 3)
        mesh, _ = tetrahedralize(asset_of(cube=cube), **QUICK)
        assert mesh.volume == pytest.approx(size**3, rel=1e-2)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("body", "seed"),
    [
        (trimesh.creation.box((1, 2, 3)), 1),
        (trimesh.creation.icosphere(2), 2),
        (trimesh.creation.torus(1.0, 0.4, major_sections=16, minor_sections=8), 3),
    ],
    ids=["box", "ball", "ring"],
)
def test_volume_and_area_wherever_it_is(body, seed):
    """Those of a box, a ball and a ring of few faces to 1 %: turned, moved, scaled, shuffled."""
    rng = np.random.default_rng(seed)
    scale = 10 ** rng.uniform(-3, 2)
    turn = trimesh.transformations.random_rotation_matrix(rng.random(3))
    turn[:3] *= scale
    turn[:3, 3] = rng.normal(size=3) * 10 * scale
    order = rng.permutation(len(body.vertices))
    faces = np.argsort(order)[rng.permutation(body.faces)]
    moved = trimesh.Trimesh(body.vertices[order], faces, process=False).apply_transform(turn)
    mesh, report = converted({"edge_length_rel": 0.1}, body=moved)
    assert report.quality.components == 1
    assert mesh.volume == pytest.approx(body.volume * scale**3, rel=0.01)
    a, b, c = (mesh.points[mesh.boundary.faces[:, i]] for i in range(3))
    found = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    assert found == pytest.approx(body.area * scale**2, rel=0.01)


@pytest.mark.slow
def test_nested_balls_region_volumes():
    """At the default envelope each region is within 1 % of its polyhedron's volume."""
    inner, outer = trimesh.creation.icosphere(3, radius=0.6), trimesh.creation.icosphere(3)
    mesh, _ = converted({"edge_length_rel": 0.1}, outer=outer, inner=inner)
    volume = dict(zip(mesh.region_names, mesh.region_volumes(), strict=True))
    assert volume["inner"] == pytest.approx(inner.volume, rel=0.01)
    assert volume["outer"] == pytest.approx(outer.volume - inner.volume, rel=0.01)
