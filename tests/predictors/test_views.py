"""Laws of pictures: projection inverts rays, analytic depth, textures, alpha, occlusion."""

import json

import numpy as np
import pytest
import trimesh
from autophyx_tet.fem.errors import InputError
from autophyx_tet.predictors.appearance.surface import Finish, finish_of, to_linear, to_srgb
from autophyx_tet.predictors.appearance.views import (
    Camera,
    hemisphere,
    load_photographs,
    look_at,
    render_views,
    ring,
)
from autophyx_tet.predictors.asset import Asset, Part
from PIL import Image
from trimesh.visual.material import PBRMaterial, SimpleMaterial
from trimesh.visual.texture import TextureVisuals

BOUNDS = np.array([[-1.0, -2.0, 0.0], [1.0, 2.0, 3.0]])


def square(colour=(255, 0, 0, 255), *, z=0.0, half=1.0, material=None):
    """A square in the plane z, textured by one colour or a material."""
    points = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * half + [0, 0, z]
    mesh = trimesh.Trimesh(points, [[0, 1, 2], [0, 2, 3]], process=False)
    material = material or PBRMaterial(baseColorFactor=list(colour), alphaMode="BLEND")
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    mesh.visual = TextureVisuals(uv=uv, material=material)
    return mesh


def from_above(asset, pixels=32):
    return render_views(asset, [look_at(np.array([0, 0, 5.0]), np.zeros(3), pixels=pixels)])


def stack(*meshes):
    return Asset("stack", tuple(Part(f"part {i}", mesh) for i, mesh in enumerate(meshes)))


@pytest.mark.parametrize("up", ["x", "y", "z"])
def test_hemisphere_is_above_and_sees_all(up):
    """Every camera is above the centre, all corners are in its picture, and no two are equal."""
    cameras = hemisphere(BOUNDS, count=15, lower=3, up=up)
    axis, center = "xyz".index(up), BOUNDS.mean(axis=0)
    heights = np.array([camera.position[axis] - center[axis] for camera in cameras])
    assert (heights[:15] > 0).all()
    assert (heights[15:] < 0).all()
    assert len({tuple(camera.position.round(6)) for camera in cameras}) == 18
    corners = np.array(np.meshgrid(*BOUNDS.T)).reshape(3, -1).T
    for camera in cameras:
        x, y, depth = camera.project(corners).T
        assert (depth > 0).all()
        assert (np.abs(x - 128) < 128).all()
        assert (np.abs(y - 128) < 128).all()
        assert np.allclose(camera.pose[:3, :3].T @ camera.pose[:3, :3], np.eye(3))


def test_a_framed_ring_fills_its_pictures():
    """Every camera is as high, and has all points within the rim, the farthest right at it."""
    points = np.random.default_rng(0).random((200, 3)) * [1.0, 3.0, 0.5]
    bounds = np.array([points.min(axis=0), points.max(axis=0)])
    for camera in ring(bounds, count=5, height=0.25, up="y", pixels=100):
        away = camera.position - bounds.mean(axis=0)
        assert away[1] / np.linalg.norm(away) == pytest.approx(0.25)
        seen = camera.framing(points, rim=0.1).project(points)[:, :2]
        assert seen.min() == pytest.approx(10, abs=1e-6)
        assert seen.max() == pytest.approx(90, abs=1e-6)
        assert seen.mean(axis=0) == pytest.approx([50, 50], abs=10)


def test_projection_inverts_the_rays():
    """A point along the ray of a pixel projects to that pixel's centre, after any resizing."""
    camera = look_at(np.array([3.0, 1, 2]), np.zeros(3)).resized(24, 32)
    rays = camera.directions()
    points = camera.position + 4.2 * rays.reshape(-1, 3)
    rows, columns = np.meshgrid(np.arange(24) + 0.5, np.arange(32) + 0.5, indexing="ij")
    projected = camera.project(points)
    assert np.allclose(projected[:, 0], columns.ravel())
    assert np.allclose(projected[:, 1], rows.ravel())


def test_depth_and_normal_of_a_sphere():
    """Depth is the nearer root of |o + t d|^2 = r^2, the normal is the point on the unit sphere."""
    asset = Asset("ball", (Part("ball", trimesh.creation.icosphere(subdivisions=5)),))
    views = render_views(asset, hemisphere(asset.bounds, count=2, pixels=48))
    for view, camera in enumerate(views.cameras):
        rays, origin = camera.directions(), camera.position
        middle = rays @ origin
        root = middle**2 - (origin @ origin - 1)
        inside = root > 0.02  # the faceted rim lies up to 1e-3 inside the sphere
        expected = -middle - np.sqrt(np.maximum(root, 0))
        assert np.abs(views.depth[view] - expected)[inside].max() < 5e-3
        assert np.isinf(views.depth[view][root < 0]).all()
        normal = origin + views.depth[view][inside][:, None] * rays[inside]
        assert (np.einsum("nk,nk->n", normal, views.normal[view][inside]) > 0.998).all()


def test_nearer_part_hides_the_farther():
    """Of two opaque squares the upper is seen, with its part, slot and colour."""
    upper = square((0, 255, 0, 255), z=1.0, half=0.5)
    upper.visual.material.name = "leaf"
    views = from_above(stack(square(), upper))
    assert views.slot_names == ("part 0", "leaf")
    assert views.part[0, 16, 16] == 1
    assert views.slot[0, 16, 16] == 1
    assert np.allclose(views.colour[0, 16, 16], [0, 1, 0])
    assert np.allclose(views.depth[0, 16, 16], 4.0, atol=1e-2)
    assert views.part[0, 2, 2] == -1
    assert views.part[0, 9, 9] == 0


def test_glass_blends_and_holes_vanish():
    """Alpha .5 over red is half of each, and names the glass; alpha 0 is no surface at all."""
    glass = from_above(stack(square(), square((0, 0, 255, 128), z=1.0)))
    assert np.allclose(glass.colour[0, 16, 16], [127 / 255, 0, 128 / 255], atol=1e-5)
    assert glass.part[0, 16, 16] == 1
    assert glass.opacity[0, 16, 16] == pytest.approx(1)
    hole = from_above(stack(square(), square((0, 0, 255, 0), z=1.0)))
    assert hole.part[0, 16, 16] == 0
    assert np.allclose(hole.colour[0, 16, 16], [1, 0, 0])
    alone = from_above(stack(square((0, 0, 255, 128))))
    assert alone.opacity[0, 16, 16] == pytest.approx(128 / 255)
    assert np.allclose(alone.colour[0, 16, 16], [0, 0, 1], atol=1e-5)


def test_texture_lands_where_uv_says():
    """A texture's upper left pixel has uv (0, 1); its cut-out alpha makes a hole."""
    pixels = np.full((8, 8, 4), 255, dtype=np.uint8)
    pixels[:4, :4] = [255, 0, 0, 255]
    pixels[4:, 4:, 3] = 0
    for material in (
        PBRMaterial(baseColorTexture=Image.fromarray(pixels), alphaMode="MASK"),
        SimpleMaterial(image=Image.fromarray(pixels)),
    ):
        views = from_above(stack(square(material=material)), pixels=64)
        assert np.allclose(views.colour[0, 26, 26], [1, 0, 0])
        assert np.allclose(views.colour[0, 26, 38], [1, 1, 1])
        assert views.part[0, 38, 38] == -1
        assert views.part[0, 38, 26] == 0


def test_vertex_and_face_colours():
    """A vertex colour is interpolated, a face colour is constant."""
    mesh = square()
    mesh.visual = trimesh.visual.ColorVisuals(
        mesh,
        vertex_colors=[[0, 0, 0, 255], [255, 255, 255, 255], [255, 255, 255, 255], [0, 0, 0, 255]],
    )
    row = from_above(stack(mesh)).colour[0, 16, :, 0]
    seen = row[row > 0]
    assert np.allclose(np.diff(seen), np.diff(seen)[0], atol=1e-4)
    mesh.visual = trimesh.visual.ColorVisuals(mesh, face_colors=[[9, 0, 0, 255], [200, 0, 0, 255]])
    row = from_above(stack(mesh)).colour[0, 16, :, 0]
    assert set(np.unique(row.round(4))) <= {
        0.0,
        np.float32(9 / 255).round(4),
        np.float32(200 / 255).round(4),
    }


def test_srgb_inverts():
    """To linear light and back is the identity."""
    values = np.linspace(0, 1, 101)
    assert np.allclose(to_srgb(to_linear(values)), values)


def test_finish_of_materials():
    """GlTF's missing metallic factor is 1; an OBJ's exponent 96 is a roughness of (2/98)^(1/4)."""
    assert finish_of(square()).metallic == 1
    obj = SimpleMaterial(diffuse=[255, 0, 0], specular=[128, 128, 128], glossiness=96.0)
    finish = finish_of(square(material=obj))
    assert finish.reflectance == pytest.approx(128 / 255, abs=1e-3)
    assert finish.roughness == pytest.approx((2 / 98) ** 0.25)
    assert finish_of(trimesh.creation.box()) == Finish()


def test_finish_comes_from_the_texture():
    """Blue times the metallic factor, green times the roughness factor, wherever uv says."""
    pixels = np.full(
        (8, 8, 3), [0, 255, 0], dtype=np.uint8
    )  # rough on the left, metal on the right
    pixels[:, 4:] = [0, 51, 255]
    material = PBRMaterial(
        metallicFactor=1.0, roughnessFactor=0.5, metallicRoughnessTexture=Image.fromarray(pixels)
    )
    finish = from_above(stack(square(material=material)), pixels=64).finish[0]
    assert np.allclose(finish[32, 26], [0, 0.04, 0.5], atol=1e-3)
    assert np.allclose(finish[32, 38], [1, 0.04, 0.1], atol=1e-3)


def test_gloss_shows_in_the_picture():
    """Of two surfaces of one colour the shinier is brighter under the lamp at the camera."""
    dull = PBRMaterial(baseColorFactor=[90, 90, 90, 255], metallicFactor=0.0, roughnessFactor=1.0)
    shiny = PBRMaterial(baseColorFactor=[90, 90, 90, 255], metallicFactor=1.0, roughnessFactor=0.3)
    pictures = [
        from_above(stack(square(material=m))).images()[0, 16, 16, :3] for m in (dull, shiny)
    ]
    assert (pictures[1] > pictures[0] + 0.2).all()
    assert (pictures[1] <= 1).all()


def test_photographs_and_cameras(tmp_path):
    """A transforms.json gives the camera of every photograph, in the photograph's own pixels."""
    Image.new("RGBA", (32, 24), (255, 0, 0, 128)).save(tmp_path / "a.png")
    pose = look_at(np.array([0, 0, 5.0]), np.zeros(3)).pose
    frame = {"file_path": "./a", "transform_matrix": pose.tolist()}
    document = {"fl_x": 100.0, "w": 64, "frames": [frame]}
    path = tmp_path / "transforms.json"
    path.write_text(json.dumps(document))
    views = load_photographs(path)
    assert views.colour.shape == (1, 24, 32, 3)
    assert views.opacity[0, 0, 0] == pytest.approx(128 / 255)
    assert views.cameras[0].focal == (50.0, 50.0)
    assert views.cameras[0].center == (16.0, 12.0)
    assert np.allclose(views.cameras[0].pose, pose)
    document["frames"][0]["file_path"] = "../a.png"
    Image.new("RGB", (4, 4)).save(tmp_path.parent / "a.png")
    path.write_text(json.dumps(document))
    with pytest.raises(InputError, match="outside"):
        load_photographs(path)
    path.write_text("{}")
    with pytest.raises(InputError, match="frames"):
        load_photographs(path)


def test_intrinsics_of_another_resolution_are_scaled(tmp_path):
    """Photographs at a half and a third of the pixels that the file speaks of: same rays."""
    Image.new("RGB", (32, 24)).save(tmp_path / "a.png")
    pose = look_at(np.array([0, 0, 5.0]), np.zeros(3)).pose
    given = {"fl_x": 100.0, "fl_y": 90.0, "cx": 30.0, "cy": 40.0, "w": 64, "h": 72}
    frame = {"file_path": "a.png", "transform_matrix": pose.tolist()}
    (tmp_path / "transforms.json").write_text(json.dumps({**given, "frames": [frame]}))
    (camera,) = load_photographs(tmp_path / "transforms.json").cameras
    whole = Camera(pose, (100.0, 90.0), (30.0, 40.0), (72, 64)).resized(24, 32)
    np.testing.assert_allclose(camera.directions(), whole.directions())


def test_views_of_two_sizes_are_refused():
    """Pictures are stacked: cameras of two sizes are an error."""
    camera = look_at(np.array([0, 0, 5.0]), np.zeros(3), pixels=16)
    assert isinstance(camera, Camera)
    with pytest.raises(InputError, match="one size"):
        render_views(stack(square()), [camera, camera.resized(8, 8)])
