"""Splats, clouds and density grids as assets: the surface of the body they came from."""

import numpy as np
import pytest
import trimesh
from autophyx_tet.converters.grids import DensityGrid, write_density
from autophyx_tet.converters.points.gaussians import standard_columns
from autophyx_tet.converters.points.table import PointTable, write_points
from autophyx_tet.fem.errors import InputError, NoVolumeError
from autophyx_tet.toolkit.asset import load as clouds
from autophyx_tet.toolkit.asset.load import guessed_fraction, load_asset
from autophyx_tet.toolkit.meshing.convert import tetrahedralize

BALL = 4 / 3 * np.pi


def sphere(n=6000):
    """Points spread evenly over the unit sphere, by the golden angle."""
    z = 1 - (2 * np.arange(n) + 1) / n
    angle = np.arange(n) * np.pi * (3 - 5**0.5)
    ring = np.sqrt(1 - z**2)
    return np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=1)


def splats(x, opacity=0.8):
    """Round splats of 3 % of the radius."""
    n = len(x)
    turns = np.tile([1.0, 0, 0, 0], (n, 1))
    logs = np.full((n, 3), np.log(0.03))
    return PointTable(standard_columns(x, logs, turns, np.full(n, opacity), np.zeros((n, 3))))


def density_ball(n=40):
    """20 inside and 0 outside the unit ball, with a ramp of 0.2 that it halves."""
    lo, hi = np.full(3, -1.3), np.full(3, 1.3)
    r = np.linalg.norm(DensityGrid(lo, hi, np.zeros((n, n, n))).centers(), axis=1)
    return DensityGrid(lo, hi, np.clip(10 + 100 * (1 - r), 0, 20).reshape(n, n, n))


def as_splat_rows(x):
    """The bytes of a .splat file: opaque round splats of 3 % of the radius."""
    dtype = [("p", "<f4", 3), ("s", "<f4", 3), ("rgba", "u1", 4), ("q", "u1", 4)]
    rows = np.zeros(len(x), dtype)
    rows["p"], rows["s"], rows["rgba"], rows["q"] = x, 0.03, 204, (255, 128, 128, 128)
    return rows.tobytes()


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".ply", ".splat"])
def test_splats_are_the_ball_they_cover(suffix, tmp_path):
    """V = 4/3 pi within 3 %, closed; files of splats name no unit."""
    path = tmp_path / f"ball{suffix}"
    if suffix == ".ply":
        write_points(path, splats(sphere()))
    else:
        path.write_bytes(as_splat_rows(sphere()))
    asset = load_asset(path)
    (part,) = asset.parts
    assert part.name == "ball"
    assert asset.samples == "6,000 Gaussians"
    assert part.mesh.is_watertight
    assert part.mesh.volume == pytest.approx(BALL, rel=0.03)
    assert any("no unit" in warning for warning in asset.warnings)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".npz", ".nvdb"])
def test_a_density_grid_is_its_ball(suffix, tmp_path):
    """V within 1 %; our own archive is metres by contract, NanoVDB is asked about."""
    write_density(tmp_path / f"ball{suffix}", density_ball())
    asset = load_asset(tmp_path / f"ball{suffix}")
    assert asset.parts[0].mesh.volume == pytest.approx(BALL, rel=0.01)
    assert any("no unit" in warning for warning in asset.warnings) == (suffix == ".nvdb")
    assert asset.samples.startswith("a grid of ")


@pytest.mark.slow
def test_a_cloud_with_missing_points_is_the_ball_it_covers(tmp_path):
    """A depth camera's NaN is left out; the surface keeps the radius of 0.1 m within 2 %."""
    x = sphere()
    x[::100] = np.nan
    write_points(tmp_path / "cloud.pcd", PointTable(dict(zip("xyz", x.T, strict=True))))
    asset = load_asset(tmp_path / "cloud.pcd", size=0.2)
    vertices = asset.parts[0].mesh.vertices
    radius = np.linalg.norm(vertices - vertices.mean(axis=0), axis=1)
    np.testing.assert_allclose(radius, 0.1, rtol=0.02)


def test_what_is_no_body_is_told(tmp_path):
    write_points(tmp_path / "faint.ply", splats(sphere(500), opacity=0.01))
    with pytest.raises(NoVolumeError, match="none of 500 splats"):
        load_asset(tmp_path / "faint.ply")
    (tmp_path / "cut.splat").write_bytes(b"\0" * 33)
    with pytest.raises(InputError, match="multiple of 32"):
        load_asset(tmp_path / "cut.splat")
    (tmp_path / "text.npz").write_text("not a zip")
    with pytest.raises(InputError, match=r"text\.npz"):
        load_asset(tmp_path / "text.npz")


def test_the_guessed_share_of_a_surface():
    """Points on a unit ball below z = 1/2: the cap above is a quarter of its area, 2 pi (1 - z)."""
    ball, x = trimesh.creation.icosphere(5), sphere(60_000)
    assert guessed_fraction(ball, x) == 0
    assert guessed_fraction(ball, x[x[:, 2] < 0.5]) == pytest.approx(0.25, abs=0.06)


def test_a_cloud_far_from_its_surface_is_refused(tmp_path, monkeypatch):
    """Points on a quarter of a ball, and the whole ball as the surface through them: exit 4."""
    ball = trimesh.creation.icosphere(5, radius=0.5)
    ball.apply_translation((0.5, 0.5, 0.5))
    surface = {"points": ball.vertices, "faces": ball.faces}
    monkeypatch.setattr(clouds, "run_guarded", lambda *_, **__: surface)
    x, path = sphere(), tmp_path / "part.xyz"
    np.savetxt(path, x[x[:, 2] < -0.5])
    with pytest.raises(NoVolumeError, match="cover no closed surface"):
        load_asset(path)


@pytest.mark.slow
def test_points_of_a_field_enclose_nothing(tmp_path):
    """A flat field of points has no other side: exit 4 with a sentence, before any engine."""
    x, y = np.random.default_rng(0).random((2, 1000))
    path = tmp_path / "field.xyz"
    np.savetxt(path, np.stack([x, y, 0.05 * np.sin(9 * x)], axis=1))
    with pytest.raises(NoVolumeError, match=r"volume|closed surface"):
        tetrahedralize(load_asset(path))
