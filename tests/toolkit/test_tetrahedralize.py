"""Conversions of analytic bodies, clean and dirty: volumes, regions, guarantees, clear ends."""

import json

import numpy as np
import pytest
import trimesh
from autophyx_tet.fem.errors import NoVolumeError, UsageError
from autophyx_tet.fem.scene.box import box_mesh
from autophyx_tet.predictors.asset import Asset, Part
from autophyx_tet.toolkit.meshing.tetrahedralize import tetrahedralize
from autophyx_tet.toolkit.native import cache
from autophyx_tet.toolkit.native.child import ChildFailure

# Coarse and quick: the laws below do not depend on resolution.
QUICK = {"edge_length_rel": 0.2, "epsilon_rel": 5e-3, "stop_energy": 20.0}


def _asset(**meshes):
    return Asset("test", tuple(Part(name, mesh) for name, mesh in meshes.items()))


def _convert(options=QUICK, **meshes):
    mesh, report = tetrahedralize(_asset(**meshes), **options)
    assert report.ok, report.failed
    assert report.quality.boundary.bad_edges == 0
    assert (mesh.volumes > 0).all()
    return mesh, report


def test_cube():
    """A flat boundary inside the envelope: volume a^3 far better than area times epsilon."""
    mesh, report = _convert(cube=trimesh.creation.box((0.1, 0.1, 0.1)))
    assert mesh.volume == pytest.approx(1e-3, rel=1e-3)
    assert mesh.region_names == ("cube",)
    assert report.quality.components == 1
    json.dumps(report.as_dict())


def test_nested_balls():
    """Inner ball and shell keep their volumes within what epsilon allows: area times epsilon."""
    inner, outer = trimesh.creation.icosphere(2, radius=0.5), trimesh.creation.icosphere(2)
    mesh, report = _convert(outer=outer, inner=inner)
    volume = dict(zip(mesh.region_names, mesh.region_volumes(), strict=True))
    assert volume["inner"] == pytest.approx(inner.volume, abs=inner.area * report.epsilon)
    shell = outer.volume - inner.volume
    assert volume["outer"] == pytest.approx(shell, abs=(inner.area + outer.area) * report.epsilon)


def test_touching_cubes_share_their_wall():
    """Two parts face to face: exact volumes, one connected mesh, no node doubled."""
    a = trimesh.creation.box((1, 1, 1))
    b = trimesh.creation.box((1, 1, 1))
    b.apply_translation((1, 0, 0))
    mesh, report = _convert(left=a, right=b)
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


def test_dirty_ball():
    ball, dirty = _dirty_ball()
    mesh, report = tetrahedralize(_asset(ball=dirty), **QUICK)
    assert mesh.volume == pytest.approx(ball.volume, rel=0.05)
    assert report.repair.merged_vertices > 0
    assert report.repair.closed_holes > 0
    assert report.repair.flipped_faces > 0
    assert report.quality.boundary.bad_edges == 0


def test_sheet_among_solids_is_named():
    sheet = trimesh.Trimesh([[2, 0, 0], [3, 0, 0], [3, 1, 0], [2, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    mesh, report = _convert(cube=trimesh.creation.box((1, 1, 1)), label=sheet)
    assert mesh.region_names == ("cube",)
    assert report.sheets == ("label",)
    assert any("'label'" in w and "--thicken" in w for w in report.warnings)


def test_flat_sheet_has_no_volume():
    sheet = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    with pytest.raises(NoVolumeError, match="--thicken") as error:
        tetrahedralize(_asset(sheet=sheet))
    assert error.value.exit_code == 4


@pytest.mark.slow
def test_plate_thinner_than_epsilon_is_left_out_and_said():
    plate = trimesh.creation.box((1, 1, 1e-3))
    plate.apply_translation((3, 0, 0))
    mesh, report = _convert(cube=trimesh.creation.box((1, 1, 1)), plate=plate)
    assert mesh.region_names == ("cube",)
    assert report.thin == 1
    assert any("--epsilon-rel" in w for w in report.warnings)


@pytest.mark.slow
def test_thicken_gives_a_sheet_its_volume():
    """A sheet of 1 m^2 thickened by 2 cm holds 0.02 m^3 and is a region beside the cube's."""
    sheet = trimesh.Trimesh([[2, 0, 0], [3, 0, 0], [3, 1, 0], [2, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    options = {**QUICK, "epsilon_rel": 2e-3, "thicken": 0.02}
    mesh, report = _convert(options, cube=trimesh.creation.box((1, 1, 1)), label=sheet)
    assert report.sheets == ()
    volumes = dict(zip(mesh.region_names, mesh.region_volumes(), strict=True))
    assert volumes["label"] == pytest.approx(0.02, rel=0.1)


@pytest.mark.slow
def test_budget_of_tets_is_kept():
    mesh, report = _convert({**QUICK, "edge_length_rel": 0.1, "max_tets": 3000},
                            cube=trimesh.creation.box((1, 1, 1)))  # fmt: skip
    assert len(mesh.tets) <= 3000
    assert len(report.attempts) > 1


def test_cache_remembers_the_engine(tmp_path, monkeypatch):
    """The second conversion runs no child and gives the same mesh; another option runs one."""
    cube = trimesh.creation.box((1, 1, 1))
    first, _ = _convert({**QUICK, "cache": tmp_path}, cube=cube)

    def no_child(*_, **__):
        raise ChildFailure("crash", "a child was started", 0.0)

    monkeypatch.setattr(cache, "run_guarded", no_child)
    again, _ = _convert({**QUICK, "cache": tmp_path}, cube=cube)
    assert (again.points == first.points).all()
    with pytest.raises(NoVolumeError, match="child was started"):
        _convert({**QUICK, "stop_energy": 21.0, "cache": tmp_path}, cube=cube)


@pytest.mark.slow
def test_damaged_cache_is_made_again(tmp_path):
    cube = trimesh.creation.box((1, 1, 1))
    _convert({**QUICK, "cache": tmp_path}, cube=cube)
    for path in tmp_path.glob("*.npz"):
        path.write_bytes(b"broken")
    mesh, _ = _convert({**QUICK, "cache": tmp_path}, cube=cube)
    assert mesh.volume == pytest.approx(1, rel=1e-2)


@pytest.mark.parametrize(
    "option",
    [
        {"edge_length_rel": 0.0},
        {"epsilon_rel": np.nan},
        {"time_limit": -1.0},
        {"wall": 0.0},
        {"part_wall": {"lid": 0.1}},
    ],
)
def test_wrong_options_are_usage_errors(option):
    with pytest.raises(UsageError, match="--"):
        tetrahedralize(_asset(cube=trimesh.creation.box((1, 1, 1))), **option)


@pytest.mark.slow
def test_far_away_and_tiny_bodies_convert():
    """Bare fTetWild crashes at 1e-9 and hangs at +1e9: position and unit do not matter here."""
    for size, place in ((1e-9, 0.0), (1.0, 1e6)):
        cube = trimesh.creation.box((size,) * 3)
        cube.apply_translation((place,) * 3)
        mesh, _ = tetrahedralize(_asset(cube=cube), **QUICK)
        assert mesh.volume == pytest.approx(size**3, rel=1e-2)


def test_a_time_out_is_followed_by_a_coarser_attempt_and_recorded(monkeypatch):
    """The first attempt runs out of time: the next one doubles edge and epsilon, and says so."""
    real, calls = cache.run_guarded, []

    def slow_at_first(task, arrays, options, **limits):
        calls.append(options)
        if len(calls) == 1:
            raise ChildFailure("time", "no result within 1 s", 1.0)
        return real(task, arrays, options, **limits)

    monkeypatch.setattr(cache, "run_guarded", slow_at_first)
    _, report = tetrahedralize(_asset(cube=trimesh.creation.box((1, 1, 1))), **QUICK)
    first, second = report.attempts
    assert first.outcome.startswith("time")
    assert second.epsilon == pytest.approx(2 * first.epsilon)
    assert report.epsilon == second.epsilon
    assert any("1 of 2 attempts failed" in w for w in report.warnings)


def test_when_nothing_works_the_reasons_are_listed(monkeypatch):
    def crash(*_, **__):
        raise ChildFailure("crash", "the engine crashed (SIGSEGV)", 0.1)

    monkeypatch.setattr(cache, "run_guarded", crash)
    with pytest.raises(NoVolumeError, match=r"5 attempts.*SIGSEGV.*--time-limit"):
        tetrahedralize(_asset(cube=trimesh.creation.box((1, 1, 1))), **QUICK)


def _engine(height, *, right_from=np.inf):
    """In place of the engine: a cube of the given share of its height, whole from an envelope on.

    The cube that it gets has a unit diagonal.
    """
    side = 3**-0.5

    def run(task, arrays, options, **_):
        if task == "alpha_wrap":
            return {"points": arrays["points"], "faces": arrays["faces"]}
        share = 1.0 if options["epsilon_rel"] >= right_from else height
        box = box_mesh((side, side, side * share), (3, 3, 3))
        return {"points": box.points - side / 2, "tets": box.tets}

    return run


def test_a_broken_guarantee_goes_on_to_a_coarser_epsilon_and_says_so(monkeypatch):
    """The engine cuts 2 % off until its envelope doubles: what is stated is what was kept."""
    right = 2 * QUICK["epsilon_rel"] / 2
    monkeypatch.setattr(cache, "run_guarded", _engine(0.98, right_from=0.99 * right))
    mesh, report = tetrahedralize(_asset(cube=trimesh.creation.box((1, 1, 1))), **QUICK)
    assert report.ok
    assert mesh.volume == pytest.approx(1)
    assert report.epsilon == pytest.approx(2 * QUICK["epsilon_rel"] * 3**0.5)
    assert report.asked_epsilon == pytest.approx(report.epsilon / 2)
    assert report.attempts[0].outcome.startswith("broken: distance")
    assert {g.threshold for g in report.guarantees if g.unit == "m"} == {report.epsilon}
    assert any("not the" in w and "asked for" in w for w in report.warnings)


def test_no_mesh_is_handed_out_that_breaks_its_guarantees(monkeypatch):
    """Every attempt lacks a fifth of the cube: exit 4 with the distance, unless it is accepted."""
    cube = _asset(cube=trimesh.creation.box((1, 1, 1)))
    monkeypatch.setattr(cache, "run_guarded", _engine(0.8))
    with pytest.raises(
        NoVolumeError, match=r"distance.*at 'cube', wanted.*--accept-broken"
    ) as error:
        tetrahedralize(cube, **QUICK)
    assert error.value.exit_code == 4
    mesh, report = tetrahedralize(cube, **QUICK, accept_broken=True)
    assert mesh.volume == pytest.approx(0.8)
    assert not report.ok
    assert set(report.failed) <= set(report.warnings)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_torus_keeps_its_volume_wherever_it_is(seed):
    """2 pi^2 R r^2 and area 4 pi^2 R r, turned, moved, scaled, with its faces shuffled."""
    rng = np.random.default_rng(seed)
    ring = trimesh.creation.torus(1.0, 0.3, major_sections=64, minor_sections=32)
    scale = 10 ** rng.uniform(-3, 2)
    turn = trimesh.transformations.random_rotation_matrix(rng.random(3))
    turn[:3] *= scale
    turn[:3, 3] = rng.normal(size=3) * 10 * scale
    ring.apply_transform(turn)
    ring.faces = rng.permutation(ring.faces)
    mesh, report = _convert({"edge_length_rel": 0.1}, ring=ring)
    assert mesh.volume == pytest.approx(2 * np.pi**2 * 0.09 * scale**3, rel=0.02)
    a, b, c = (mesh.points[mesh.boundary.faces[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    assert area == pytest.approx(4 * np.pi**2 * 0.3 * scale**2, rel=0.02)
    assert report.quality.components == 1


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize(
    ("body", "volume", "area"),
    [
        (trimesh.creation.box((1, 2, 3)), 6.0, 22.0),
        (trimesh.creation.icosphere(4), 4 / 3 * np.pi, 4 * np.pi),
    ],
    ids=["box", "ball"],
)
def test_volume_and_area_wherever_it_is(body, volume, area, seed):
    """V and A of a box and a ball within 1 %: turned, moved, scaled, faces and corners shuffled."""
    rng = np.random.default_rng(seed)
    scale = 10 ** rng.uniform(-3, 2)
    turn = trimesh.transformations.random_rotation_matrix(rng.random(3))
    turn[:3] *= scale
    turn[:3, 3] = rng.normal(size=3) * 10 * scale
    order = rng.permutation(len(body.vertices))
    faces = np.argsort(order)[rng.permutation(body.faces)]
    moved = trimesh.Trimesh(body.vertices[order], faces, process=False).apply_transform(turn)
    mesh, _ = _convert({"edge_length_rel": 0.1}, body=moved)
    assert mesh.volume == pytest.approx(volume * scale**3, rel=0.01)
    a, b, c = (mesh.points[mesh.boundary.faces[:, i]] for i in range(3))
    found = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    assert found == pytest.approx(area * scale**2, rel=0.01)


@pytest.mark.slow
def test_nested_balls_region_volumes():
    """At the default envelope each region is within 1 % of its polyhedron's volume."""
    inner, outer = trimesh.creation.icosphere(3, radius=0.6), trimesh.creation.icosphere(3)
    mesh, _ = _convert({"edge_length_rel": 0.1}, outer=outer, inner=inner)
    volume = dict(zip(mesh.region_names, mesh.region_volumes(), strict=True))
    assert volume["inner"] == pytest.approx(inner.volume, rel=0.01)
    assert volume["outer"] == pytest.approx(outer.volume - inner.volume, rel=0.01)
