"""The colour of a surface: texture, vertex and face colours, base-colour factors, alpha."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ..asset import Asset, PlainMesh
from ..grid import Grid, PartVoxels

if TYPE_CHECKING:
    import trimesh


GREY = np.array([0.6, 0.6, 0.6, 1.0], dtype=np.float32)  # of a surface that says nothing
# Colour (n, 4), sRGB and opacity in [0, 1], of points on faces (n,) at corner weights (n, 3).
Skin = Callable[[Int[np.ndarray, "n"], Float[np.ndarray, "n 3"]], Float[np.ndarray, "n 4"]]
# ``Finish`` (n, 3) of the same.
Gloss = Callable[[Int[np.ndarray, "n"], Float[np.ndarray, "n 3"]], Float[np.ndarray, "n 3"]]


class Finish(NamedTuple):
    """How a surface shines.

    ``metallic`` in [0, 1] as in glTF; ``reflectance`` of the part that is no metal, in [0, 1], at
    normal incidence; ``roughness`` in [0, 1].
    """

    metallic: float = 0.0
    reflectance: float = 0.04
    roughness: float = 0.6


def finish_of(mesh: trimesh.Trimesh | PlainMesh) -> Finish:
    """Return the finish of a mesh's material; the default where it has none."""
    material: Any = getattr(mesh.visual, "material", None)
    if hasattr(material, "metallicFactor"):
        factors = (material.metallicFactor, material.roughnessFactor)
        # glTF 2.0: a factor that is not given is 1.
        metallic, roughness = (1.0 if factor is None else float(factor) for factor in factors)
        return Finish(metallic, roughness=roughness)
    if material is None or not hasattr(material, "specular"):
        return Finish()
    exponent = max(float(np.mean(material.glossiness or 0.0)), 0.0)
    reflectance = float(np.mean(_unit(np.asarray(material.specular))[:3]))
    # Phong's exponent n as a roughness: alpha^2 = 2 / (n + 2).
    return Finish(0.0, min(reflectance, 1.0), (2 / (exponent + 2)) ** 0.25)


def gloss_of(mesh: trimesh.Trimesh | PlainMesh) -> Gloss:
    """Return the function that gives the finish of points of a mesh: factors x glTF's texture."""
    visual: Any = mesh.visual
    factors = np.array(finish_of(mesh))
    image = getattr(getattr(visual, "material", None), "metallicRoughnessTexture", None)
    if image is None or getattr(visual, "uv", None) is None:
        return lambda faces, weights: np.tile(factors, (len(faces), 1))
    texture = _unit(np.asarray(image.convert("RGB")))

    def finish(faces: Int[np.ndarray, "n"], weights: Float[np.ndarray, "n 3"]) -> np.ndarray:
        uv = np.einsum("nc,nck->nk", weights, visual.uv[mesh.faces[faces]])
        texel = _bilinear(texture, uv)
        # glTF 2.0: blue is the metallic factor's share, green the roughness's; neither is sRGB.
        share = np.stack([texel[:, 2], np.ones(len(uv)), texel[:, 1]], axis=1)
        return factors * share

    return finish


def skin_of(mesh: trimesh.Trimesh | PlainMesh) -> Skin:
    """Return the function that colours points of a mesh from its ``visual``."""
    visual: Any = mesh.visual
    if visual.kind == "face":
        colours = _unit(visual.face_colors)
        return lambda faces, weights: colours[faces]
    if visual.kind == "vertex":
        corners = _unit(visual.vertex_colors)[mesh.faces]
        return lambda faces, weights: np.einsum("nc,nck->nk", weights, corners[faces])  # type: ignore
    if visual.kind != "texture":
        return lambda faces, weights: np.broadcast_to(GREY, (len(faces), 4))
    # Texture x factor x vertex colour, after glTF 2.0; an OBJ's texture replaces its colour.
    material = visual.material
    simple = not hasattr(material, "baseColorFactor")
    if simple:
        factor = _obj_factor(material)
    else:  # linear; trimesh keeps it as bytes
        base = material.baseColorFactor
        factor = np.ones(4) if base is None else _unit(np.asarray(base)).astype(np.float64)
    image = material.image if simple else material.baseColorTexture
    texture = (
        None if image is None or visual.uv is None else _unit(np.asarray(image.convert("RGBA")))
    )
    if texture is not None and simple:
        factor[:3] = 1.0
    tint = visual.vertex_attributes.get("color")
    corners = None if tint is None else _unit(np.asarray(tint))[mesh.faces]
    mode = getattr(material, "alphaMode", "BLEND") or "OPAQUE"  # of glTF; other formats blend
    cutoff = getattr(material, "alphaCutoff", None)
    cutoff = 0.5 if cutoff is None else cutoff

    def colour(faces: Int[np.ndarray, "n"], weights: Float[np.ndarray, "n 3"]) -> np.ndarray:
        result = np.tile(factor, (len(faces), 1))
        if texture is not None:
            uv = np.einsum("nc,nck->nk", weights, visual.uv[mesh.faces[faces]])
            texel = _bilinear(texture, uv)
            result *= np.concatenate([to_linear(texel[:, :3]), texel[:, 3:]], axis=1)
        if corners is not None:
            vertex = np.einsum("nc,nck->nk", weights, corners[faces])
            result[:, : vertex.shape[1]] *= vertex
        result[:, :3] = to_srgb(result[:, :3])
        if mode == "MASK":
            result[:, 3] = result[:, 3] >= cutoff
        elif mode == "OPAQUE":
            result[:, 3] = 1.0
        return result.astype(np.float32)

    return colour


def material_name(mesh: trimesh.Trimesh | PlainMesh) -> str | None:
    """Name of the material of a mesh, where it has one."""
    return getattr(getattr(mesh.visual, "material", None), "name", None)


def to_linear(srgb: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """Light intensity of an sRGB value in [0, 1] (IEC 61966-2-1)."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def to_srgb(linear: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """SRGB value of a light intensity in [0, 1] (IEC 61966-2-1)."""
    root = np.maximum(linear, 0.0031308) ** (1 / 2.4)
    return np.where(linear <= 0.0031308, linear * 12.92, 1.055 * root - 0.055)


def _obj_factor(material: Any) -> Float[np.ndarray, "4"]:
    """Kd, an sRGB value by custom, as linear, with the opacity ``d`` or 1 - ``Tr``."""
    factor = _unit(np.asarray(material.diffuse)).astype(np.float64)
    factor[:3] = to_linear(factor[:3])
    given = {key.lower(): value for key, value in material.kwargs.items()}
    for key in ("d", "tr"):
        with suppress(KeyError, TypeError, IndexError, ValueError):  # not there, empty, no number
            value = float(given[key][-1])
            value = value if key == "d" else 1 - value
            # Some exporters write 0 for "not transparent": nothing would be left to see.
            factor[3] = value if 0 < value <= 1 else 1.0
            break
    return factor


def _bilinear(
    texture: Float[np.ndarray, "height width channels"], uv: Float[np.ndarray, "n 2"]
) -> Float[np.ndarray, "n channels"]:
    """Texture at repeating coordinates, v upwards from the lower left corner."""
    size = np.array(texture.shape[1::-1])
    at = np.stack([uv[:, 0], 1 - uv[:, 1]], axis=1) % 1.0 * size - 0.5
    low = np.floor(at)
    share = (at - low).astype(np.float32)
    (x0, y0), (x1, y1) = (low % size).astype(np.int64).T, ((low + 1) % size).astype(np.int64).T
    fx, fy = share[:, :1], share[:, 1:]
    top = texture[y0, x0] * (1 - fx) + texture[y0, x1] * fx
    bottom = texture[y1, x0] * (1 - fx) + texture[y1, x1] * fx
    return top * (1 - fy) + bottom * fy


def _unit(colours: np.ndarray) -> Float[np.ndarray, "*n"]:
    """Bytes, shorts or floats as float32 in [0, 1]."""
    scale = np.iinfo(colours.dtype).max if colours.dtype.kind in "ui" else 1
    return np.asarray(colours, dtype=np.float32) / np.float32(scale)


# The surface of an asset on a grid: which cells it touches, and which part is in each.

SPACING = 0.35  # of the samples on a triangle, in cells: a cell cut by less than this may be missed
LARGEST_PIECE = 256  # subdivisions of a triangle's longest edge in one step: 33,000 samples
# Optical depth of a surface cell along its edge: e^-8, a three-thousandth, of the light passes.
OPAQUE = 8.0


def surface_voxels(asset: Asset, grid: Grid) -> PartVoxels:
    """Return the cells that the asset's surface touches, each with the part most seen in it."""
    best = np.zeros(np.prod(grid.shape), dtype=np.int32)
    label = np.full(len(best), -1, dtype=np.int32)
    for index, part in enumerate(asset.parts):
        count = np.zeros_like(best)
        for points in surface_samples(part.mesh, SPACING * grid.h):
            cells = np.clip(grid.cell_of(points), 0, np.array(grid.shape) - 1)
            count += np.bincount(
                np.ravel_multi_index(tuple(cells.T), grid.shape), minlength=len(best)
            ).astype(np.int32)
        more = count > best
        label[more], best[more] = index, count[more]
    labels = tuple(part.labels or (part.name,) for part in asset.parts)
    return PartVoxels(grid, label.reshape(grid.shape), asset.part_names, labels)


def surface_samples(
    mesh: trimesh.Trimesh | PlainMesh, spacing: float
) -> Iterator[Float[np.ndarray, "n 3"]]:
    """Points [m] on every triangle, no farther apart than ``spacing`` [m], corners included."""
    corners = np.asarray(mesh.triangles)
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    # Powers of two: triangles of about one size share one pattern of barycentric weights.
    pieces = 2 ** np.ceil(np.log2(np.maximum(edges / spacing, 1))).astype(int)
    while (big := pieces > LARGEST_PIECE).any():
        # Every triangle as four, by the middles of its edges
        a, b, c = corners[big].transpose(1, 0, 2)
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        four = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        corners = np.concatenate(
            [corners[~big], np.concatenate([np.stack(triangle, axis=1) for triangle in four])]
        )
        pieces = np.concatenate([pieces[~big], np.repeat(pieces[big] // 2, 4)])
    for count in np.unique(pieces):
        i, j = np.meshgrid(np.arange(count + 1), np.arange(count + 1), indexing="ij")
        inside = i + j <= count
        weights = np.stack([i[inside], j[inside], (count - i - j)[inside]], axis=1) / count
        yield np.einsum("wc,tck->twk", weights, corners[pieces == count]).reshape(-1, 3)


def random_points(
    mesh: trimesh.Trimesh | PlainMesh, count: int, rng: np.random.Generator
) -> tuple[Int[np.ndarray, "n"], Float[np.ndarray, "n 3"]]:
    """Faces and corner weights of points uniform on the surface."""
    share = mesh.area_faces / mesh.area_faces.sum()
    faces = rng.choice(len(share), size=count, p=share)
    u, v = rng.random((2, count))
    root = np.sqrt(u)
    return faces, np.stack([1 - root, root * (1 - v), root * v], axis=1)


def opaque_density(
    occupied: Bool[np.ndarray, "nx ny nz"], grid: Grid
) -> Float[np.ndarray, "nx ny nz"]:
    """Density [1/m] of cells that let (almost) no light through."""
    return occupied * (OPAQUE / grid.h)


def density_of_points(
    points: Float[np.ndarray, "n 3"], grid: Grid
) -> Float[np.ndarray, "nx ny nz"]:
    """Density [1/m] of a point cloud [m]: cells that hold a point are opaque."""
    cells = grid.cell_of(points)
    cells = cells[grid.contains(cells)]
    occupied = np.zeros(grid.shape, dtype=bool)
    occupied[tuple(cells.T)] = True
    return opaque_density(occupied, grid)
