"""Pictures: light, shadow, colour and size are what the scene says, without any display."""

import numpy as np
import pytest
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.predictors.appearance.surface import to_srgb
from autophyx_tet.predictors.appearance.views import look_at
from autophyx_tet.predictors.asset import Asset, Part
from autophyx_tet.toolkit.asset.bonsai import FINISHES, bonsai
from autophyx_tet.toolkit.report.picture import (
    ColouredSurface,
    Scale,
    asset_panel,
    exaggeration,
    mesh_panel,
    render_animation,
    render_png,
    rgb,
    story,
    trace,
)
from PIL import Image


@pytest.fixture(scope="module")
def mesh():
    box = box_mesh((0.1, 0.1, 0.2), (3, 3, 6))
    share = box.centroids[:, 2] / 0.2
    return box.with_material(ElementMaterial(1e6 * 1e3**share, 0.3 + 0 * share, 1000 + 0 * share))


@pytest.fixture(scope="module")
def asset():
    parts = (Part(name, shape) for name, shape in bonsai().geometry.items())
    return Asset("bonsai", tuple(parts), up="y")


def pixels_of(path):
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB")).astype(int)


def coloured(mesh, color):
    faces = mesh.boundary.faces
    return ColouredSurface(mesh.points, faces, np.broadcast_to(rgb(color), (len(faces), 3, 3)))


def test_the_shadow_falls_away_from_the_sun_and_fades(mesh):
    """The ground is white far away, darker at the foot, and darker on one side than the other."""
    camera = look_at(np.array([0.0, -0.6, 0.5]), np.array([0.05, 0.05, 0.0]), pixels=120)
    picture = trace(coloured(mesh, "#b03020"), camera).mean(axis=2)
    assert picture[:4].min() > 0.99
    foot = camera.project(np.array([[-0.03, 0.05, 0.0], [0.13, 0.05, 0.0]]))[:, :2].astype(int)
    left, right = (picture[y - 2 : y + 3, x - 2 : x + 3].mean() for x, y in foot)
    assert min(left, right) < 0.97
    assert abs(left - right) > 0.05


def test_a_surface_shows_its_own_hue(mesh):
    """White light changes how bright a colour is, not which of its channels leads."""
    camera = look_at(np.array([0.5, -0.5, 0.5]), np.array([0.05, 0.05, 0.1]), pixels=64)
    for color, channel in (("#c03030", 0), ("#30c030", 1), ("#3030c0", 2)):
        shot = trace(coloured(mesh, color), camera)
        assert shot[32, 32].argmax() == channel
        assert np.ptp(shot[32, 32]) > 0.2


def test_normals_are_smooth_on_a_ball_and_sharp_on_a_box(mesh):
    """On a fine sphere they point from the centre; on a box they are the faces' own."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=4)
    faces = np.asarray(ball.faces)
    surface = ColouredSurface(np.asarray(ball.vertices), faces, np.ones((len(faces), 3, 3)))
    np.testing.assert_allclose(surface.corner_normals, surface.triangles, atol=0.01)
    normals = coloured(mesh, "#808080").corner_normals
    np.testing.assert_allclose(np.sort(np.abs(normals), axis=2)[..., :2], 0, atol=1e-12)


def test_the_same_scene_gives_the_same_picture(mesh):
    """The directions of the rays come from a seed: no noise from run to run."""
    camera = look_at(np.array([0.5, 0.4, 0.5]), np.array([0.05, 0.05, 0.1]), pixels=40)
    one, two = (trace(coloured(mesh, "#808080"), camera) for _ in range(2))
    np.testing.assert_array_equal(one, two)


def test_every_panel_gets_its_square_and_the_whole_object_fits(tmp_path, asset, mesh):
    """Asset, stiffness and sag side by side: three drawings, none cut off at an edge."""
    bend = np.zeros_like(mesh.points)
    bend[:, 0] = 1e-4 * (mesh.points[:, 2] / 0.2) ** 2
    path = render_png(tmp_path / "a.png", story(asset, mesh, bend), pixels=96, samples=2, up="y")
    picture = pixels_of(path)
    assert picture.shape[1] == 3 * 96
    strong = np.ptp(picture, axis=2) > 40
    for i in range(3):
        panel = strong[28 : 28 + 96, 96 * i : 96 * (i + 1)]
        assert 0.03 < panel.mean() < 0.8
        assert not panel[:, 0].any()
        assert not panel[:, -1].any()
        assert not panel[0].any()
    assert [p.name for p in tmp_path.iterdir()] == ["a.png"]


def test_the_asset_wears_its_own_colours(asset):
    """Base colours of the glTF materials come back, as sRGB."""
    colors = asset_panel(asset).frames[0].colors.reshape(-1, 3)
    for finish in FINISHES.values():
        gap = np.abs(colors - to_srgb(np.array(finish.color))).max(axis=1)
        assert gap.min() < 0.02


def test_a_motion_becomes_as_many_frames(tmp_path, mesh):
    """Each frame shows another state; the file repeats forever in the time that was asked for."""
    swing = np.array([-1.0, 0.0, 1.0])[:, None, None] * np.array([0.02, 0, 0])
    motion = swing * (mesh.points[:, 2:] / 0.2)
    moved = np.linalg.norm(motion, axis=-1)
    scale = Scale.around(moved, label="Displacement", unit="m", palette="displacement")
    panel = mesh_panel(mesh, moved, on="points", scale=scale, displacement=motion)
    for suffix in (".gif", ".webp", ".png"):
        path = render_animation(
            tmp_path / f"m{suffix}", [panel, mesh_panel(mesh)], pixels=48, seconds=0.6, samples=1
        )
        with Image.open(path) as image:
            assert image.n_frames == 3
            image.seek(1)
            image.load()
            assert image.info["duration"] == pytest.approx(200, abs=1)
            assert image.info["loop"] == 0
    with pytest.raises(InputError, match=r"'\.mp4'.*\.gif"):
        render_animation(tmp_path / "m.mp4", [panel])


def test_exaggeration_is_round_visible_and_never_weakens(mesh):
    """1, 2 or 5 times a power of ten; drawn displacements of 2 to 6 % of the diagonal."""
    diagonal = np.linalg.norm(mesh.bounds[1] - mesh.bounds[0])
    for largest in np.geomspace(1e-9, 1e-3, 23):
        factor = exaggeration(mesh, np.full((len(mesh.points), 3), largest / np.sqrt(3)))
        assert f"{factor:e}"[0] in "125"
        assert 0.02 < factor * largest / diagonal <= 0.06 * (1 + 1e-9)
    assert exaggeration(mesh, np.ones((2, len(mesh.points), 3))) == 1
    assert exaggeration(mesh, np.zeros((len(mesh.points), 3))) == 1


def test_scales_place_values():
    """Ends on 0 and 1, decades evenly apart, one value in the middle, nothing outside."""
    decades = Scale("E", "Pa", "E", 1e3, 1e9, log=True)
    np.testing.assert_allclose(
        decades.share(np.array([1e3, 1e6, 1e9, 1e12, 1.0])), [0, 0.5, 1, 1, 0]
    )
    linear = Scale("u", "m", "displacement", 0, 4)
    np.testing.assert_allclose(linear.share(np.array([0.0, 1, 4])), [0, 0.25, 1])
    one = Scale.around(np.full(3, 7.0), label="nu", unit="", palette="nu")
    assert one.single
    assert one.share(np.array([7.0])) == 0.5
    np.testing.assert_allclose(decades.colors(np.array([1e3]))[0], rgb("#472d7b"))
    with pytest.raises(InputError, match="palette"):
        Scale("x", "", "rainbow", 0, 1)
    with pytest.raises(InputError, match="above 0"):
        Scale("x", "", "E", 0, 1, log=True)
