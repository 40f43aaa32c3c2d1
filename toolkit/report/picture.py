"""Pictures of results: panels side by side as PNG, in motion as GIF; no GPU and no display needed.

The rays are traced on the CPU, so that a picture comes out alike on every machine.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ...converters.files import writing
from ...converters.points.gaussians import SH_C0, standard_columns
from ...converters.points.table import XYZ, PointTable
from ...converters.points.views import splat_view
from ...fem.errors import InputError, UsageError
from ...fem.mesh import TetMesh, material_of
from ...fem.scene.up import up_vector
from ...fem.solve.result import ParticleRun
from ...predictors.appearance.features import VoxelFeatures
from ...predictors.appearance.surface import skin_of, to_linear, to_srgb
from ...predictors.appearance.views import Camera, hemisphere, look_at
from ...predictors.asset import Asset, UpAxis
from ...predictors.grid import Grid
from ..verdict.check import si
from ..verdict.simulation import Simulation

if TYPE_CHECKING:
    from PIL.Image import Image

SMOOTH_COSINE = np.cos(np.deg2rad(40))  # sharper edges than this are drawn sharp
SMOOTHING = 2  # rays per pixel along each side
# Light on a white surface: from all around, and from the sun when it faces it.
SKY, SUN = 0.62, 0.62
SUN_SPREAD = 0.12  # half width of the sun as seen from the ground, in radians: soft shadows
LIFT = 1e-4  # rays leave the surface this far above it, as a share of its size: it hides not itself
# Steps of a sequence that fills the unit square evenly (powers of the plastic number).
PLASTIC = (0.7548776662466927, 0.5698402909980532)
GROUND_REACH = 1.6  # radius of the shadows on the ground, in sizes of the object


@dataclass(frozen=True, eq=False)
class ColouredSurface:
    """Triangles with a colour (sRGB, [0, 1]) at every corner.

    ``points`` [m] (points, 3), ``faces`` (faces, 3) point ids, ``colors`` (faces, 3 corners, 3).
    """

    points: Float[np.ndarray, "points 3"]
    faces: Int[np.ndarray, "faces 3"]
    colors: Float[np.ndarray, "faces 3 3"]

    @cached_property
    def triangles(self) -> Float[np.ndarray, "faces 3 3"]:
        """Corners [m] of every face."""
        return self.points[self.faces]

    @cached_property
    def bounds(self) -> Float[np.ndarray, "2 3"]:
        """Lower and upper corner [m]."""
        corners = self.triangles.reshape(-1, 3)
        return np.stack([corners.min(axis=0), corners.max(axis=0)])

    @cached_property
    def areas(self) -> Float[np.ndarray, "faces 3"]:
        """Normal of every face, as long as twice its area [m^2]."""
        a, b, c = self.triangles.transpose(1, 0, 2)
        return np.cross(b - a, c - a)

    @cached_property
    def corner_normals(self) -> Float[np.ndarray, "faces 3 3"]:
        """Unit normal at every corner: the mean over the faces around that turn gently."""
        from scipy.sparse import csr_matrix

        area = self.areas
        normal = area / np.maximum(np.linalg.norm(area, axis=1, keepdims=True), 1e-300)
        count = len(self.faces)
        corner = csr_matrix(
            (np.ones(3 * count), (np.repeat(np.arange(count), 3), self.faces.ravel())),
            shape=(count, len(self.points)),
        )
        result = np.repeat(area[:, None], 3, axis=1)
        for k in range(3):
            around = (corner[:, self.faces[:, k]].T).tocoo()  # rows: faces, columns: their fellows
            gentle = np.einsum("ij,ij->i", normal[around.row], normal[around.col]) > SMOOTH_COSINE
            row, col = around.row[gentle], around.col[gentle]
            result[:, k] = csr_matrix((np.ones(len(row)), (row, col)), (count, count)) @ area
        return result / np.maximum(np.linalg.norm(result, axis=2, keepdims=True), 1e-300)


def trace(
    surface: ColouredSurface,
    camera: Camera,
    *,
    up: UpAxis = "z",
    ground: float | None = None,
    samples: int = 6,
) -> Float[np.ndarray, "height width 3"]:
    """Picture (sRGB, [0, 1]) of a surface on white ground.

    surface: What is seen.
    camera: Where it is seen from; its size is the picture's.
    up: Axis that points up.
    ground: Height [m] of the ground, by default where the surface is lowest.
    samples: Rays towards the sky from each point that a ray meets.
    """
    fine = camera.resized(*(SMOOTHING * side for side in camera.size))
    light = _Daylight(surface, up_vector(up), ground, np.random.default_rng(0))
    pixels = light.picture(fine, samples)
    height, width = camera.size
    blocks = pixels.reshape(height, SMOOTHING, width, SMOOTHING, 3)
    return to_srgb(np.clip(blocks.mean(axis=(1, 3)), 0, 1))


class _Daylight:
    """The surface in its light, with lengths in sizes of the surface (for float32)."""

    def __init__(self, surface: ColouredSurface, up, ground: float | None, rng) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self.surface, self.up, self.rng = surface, up, rng
        lo, hi = surface.bounds
        self.center, self.size = (lo + hi) / 2, float(np.linalg.norm(hi - lo)) or 1.0
        floor = min(up @ lo, up @ hi) if ground is None else ground
        self.floor = (floor - up @ self.center) / self.size
        self.scene = EmbreeScene()
        triangles = ((surface.triangles - self.center) / self.size).astype(np.float32)
        self._alive = TriangleMesh(self.scene, triangles)  # embree reads its memory

    def picture(self, camera: Camera, samples: int) -> np.ndarray:
        """Linear colour (height * width, 3) of every pixel."""
        origin = (camera.position - self.center) / self.size
        rays = camera.directions().reshape(-1, 3)
        hit = self.scene.run(
            np.broadcast_to(origin, rays.shape).astype(np.float32),
            rays.astype(np.float32),
            query="INTERSECT",
            output=True,
        )
        pixels = np.ones((len(rays), 3))
        seen = np.flatnonzero(hit["primID"] >= 0)
        face = hit["primID"][seen].astype(np.int64)
        u, v = (hit[name][seen].astype(np.float64) for name in "uv")
        weights = np.stack([1 - u - v, u, v], axis=1)
        at = origin + hit["tfar"][seen, None].astype(np.float64) * rays[seen]
        normal = np.einsum("nc,nck->nk", weights, self.surface.corner_normals[face])
        turned = np.einsum("nk,nk->n", self.surface.areas[face], rays[seen])
        normal *= -np.sign(turned)[:, None]  # both sides of a face are lit
        color = to_linear(np.einsum("nc,nck->nk", weights, self.surface.colors[face]))
        pixels[seen] = color * self._light(at, normal, samples)[:, None]
        # Darken the white ground where the object takes light from it, fading with distance
        free = hit["primID"] < 0
        down = -(rays @ self.up)
        below = np.flatnonzero(free & (down > 1e-6) & (origin @ self.up > self.floor))
        travelled = (origin @ self.up - self.floor) / down[below]
        at = origin + travelled[:, None] * rays[below]
        away = np.linalg.norm(at - self.floor * self.up, axis=1) / GROUND_REACH
        near = away < 1
        at, below = at[near], below[near]
        normal = np.broadcast_to(self.up, at.shape)
        open_light = SKY * _sky(2 / 3) + SUN * (self._sun() @ self.up)  # 2/3: Lambert's mean height
        shadow = 1 - np.minimum(self._light(at, normal, samples) / open_light, 1)
        pixels[below] = (1 - shadow * (1 - away[near] ** 2))[:, None]
        return pixels

    def _light(self, at, normal, samples: int) -> np.ndarray:
        """Light on a white surface: the free share of a bright sky, and the sun if it is seen."""
        start = (at + LIFT * normal).astype(np.float32)
        sky, sun = np.zeros(len(at)), np.zeros(len(at))
        base = self.rng.random((len(at), 2))
        facing = normal @ self._sun()
        lit = np.flatnonzero(facing > 0)
        for i in range(samples):
            pair = (base + i * np.array(PLASTIC)) % 1
            height, turn = 2 * pair[:, 0] - 1, 2 * np.pi * pair[:, 1]
            ring = np.sqrt(1 - height**2)
            ball = np.stack([ring * np.cos(turn), ring * np.sin(turn), height], axis=1)
            towards = normal + 0.999 * ball  # Lambert: the cosine is in the density
            towards /= np.linalg.norm(towards, axis=1, keepdims=True)
            sky += self._free(start, towards) * _sky(towards @ self.up)
            seen = self._free(start[lit], self._sun() + SUN_SPREAD * ball[lit])
            sun[lit] += seen * facing[lit]
        return (SKY * sky + SUN * sun) / samples

    def _sun(self) -> np.ndarray:
        """Direction of the sun: high, to the right of the usual first look."""
        side = np.roll(self.up, 1)
        sun = 1.0 * self.up + 0.75 * side - 0.15 * np.cross(self.up, side)
        return sun / np.linalg.norm(sun)

    def _free(self, start, towards) -> np.ndarray:
        hit = self.scene.run(start, towards.astype(np.float32), query="OCCLUDED")
        return (hit < 0).astype(np.float64)


def _sky(height):
    """Brightness of the sky at a height (sine of the elevation), 1 overhead, dimmer to the side."""
    return (1 + 0.35 * height) / 1.35


# Moving pictures that Pillow writes, by suffix.
ANIMATIONS = {".gif": "GIF", ".webp": "WEBP", ".png": "PNG"}
FIELD_OF_VIEW = np.deg2rad(28)  # a long lens: little perspective
MARGIN = 1.08  # of the distance at which the shape just fills the picture
SHOWN = 0.06  # the largest displacement is drawn this long, as a share of the diagonal
PLAIN = str.maketrans({"\u00a0": " ", "µ": "u"})  # Pillow's own font lacks them
INK, FAINT = (34, 38, 42), (112, 118, 124)


@dataclass(frozen=True, eq=False)
class Panel:
    """One picture beside others: a surface, or one per frame, with a title and a colour scale.

    ``marks`` are words at points [m], drawn over it.
    """

    frames: tuple[ColouredSurface, ...]
    title: str = ""
    scale: Scale | None = None
    marks: tuple[tuple[str, Float[np.ndarray, "3"]], ...] = ()


def asset_panel(asset: Asset, *, title: str = "") -> Panel:
    """Panel of an asset as it looks: textures, vertex and base colours.

    Parameters
    ----------
    asset
        The asset.
    title
        Above the picture.

    Returns
    -------
    Panel
        Its surface, for ``render_png``.
    """
    points, faces, colors, count = [], [], [], 0
    corners = np.eye(3, dtype=np.float32)
    for part in asset.parts:
        ids, skin = np.arange(len(part.mesh.faces)), skin_of(part.mesh)
        weights = (np.repeat(corners[k : k + 1], len(ids), axis=0) for k in range(3))
        colors.append(np.stack([skin(ids, w)[:, :3] for w in weights], axis=1).astype(float))
        points.append(np.asarray(part.mesh.vertices))
        faces.append(np.asarray(part.mesh.faces) + count)
        count += len(points[-1])
    surface = ColouredSurface(np.vstack(points), np.vstack(faces), np.concatenate(colors))
    return Panel((surface,), title)


def mesh_panel(
    mesh: TetMesh,
    values: Float[np.ndarray, "*n"] | None = None,
    *,
    on: Literal["tets", "points"] = "tets",
    scale: Scale | None = None,
    title: str = "",
    displacement: Float[np.ndarray, "*frames points 3"] | None = None,
    factor: float = 1.0,
) -> Panel:
    """Panel of a tet mesh, coloured by values or else by its regions.

    Parameters
    ----------
    mesh
        The mesh [m].
    values, on, scale
        One value per tet or point, with a row per frame where they change; which; their colours.
    title
        Above the picture.
    displacement
        Displacement [m], shape (points, 3), or (frames, points, 3) for a motion.
    factor
        Exaggeration [1] of the displacement.

    Returns
    -------
    Panel
        A surface a frame, for ``render_png`` and ``render_animation``.

    Raises
    ------
    UsageError
        Where values have no scale.
    InputError
        Where there are not as many values as tets or points.

    Examples
    --------
    >>> import autophyx_tet as apx
    >>> from autophyx_tet.fem import box_mesh
    >>> panel = apx.mesh_panel(box_mesh((1, 1, 1), (1, 1, 1)), title="box")
    >>> len(panel.frames), panel.frames[0].faces.shape  # two triangles a side
    (1, (12, 3))
    """
    steps = np.zeros((1, *mesh.points.shape)) if displacement is None else displacement
    steps = steps.reshape(-1, *mesh.points.shape)
    boundary = mesh.boundary
    faces = boundary.faces
    if values is None:  # the colour of the region behind every face
        parts = np.array([rgb(color) for color in PARTS])
        shades = parts[mesh.region[boundary.tet] % len(PARTS)][None, :, None]
    elif scale is None:
        raise UsageError("values need the scale that colours them")
    else:  # of its tet, or one at each corner
        count = len(mesh.tets if on == "tets" else mesh.points)
        if values.shape[-1] != count:
            raise InputError(f"values on {on} must have {count} columns, got {values.shape}")
        rows = np.atleast_2d(values)
        shades = scale.colors(
            rows[:, boundary.tet, None] if on == "tets" else rows[:, boundary.faces]
        )
    frames = (
        ColouredSurface(
            mesh.points + factor * steps[i % len(steps)],
            faces,
            np.broadcast_to(shades[i % len(shades)], (len(faces), 3, 3)),
        )
        for i in range(max(len(steps), len(shades)))
    )
    return Panel(tuple(frames), title, scale)


def exaggeration(mesh: TetMesh, displacement: Float[np.ndarray, "*frames points 3"]) -> float:
    """Round factor (1, 2 or 5 times a power of ten, at least 1) that makes a displacement seen.

    Parameters
    ----------
    mesh
        The mesh [m].
    displacement
        Displacement [m], shape (points, 3), or (frames, points, 3) for a motion.

    Returns
    -------
    float
        The factor [1]: the largest displacement is then drawn at most 6 % of the diagonal long.

    Examples
    --------
    >>> import numpy as np, autophyx_tet as apx
    >>> from autophyx_tet.fem import box_mesh
    >>> box = box_mesh((3, 4, 12), (1, 1, 1))  # its diagonal is 13 m, and 6 % of that .78 m
    >>> apx.exaggeration(box, np.full((8, 3), 0.01 / 3**0.5))  # 1 cm: 78 times, rounded
    50.0
    """
    largest = np.linalg.norm(displacement, axis=-1).max()
    diagonal = np.linalg.norm(mesh.bounds[1] - mesh.bounds[0])
    wanted = SHOWN * diagonal / largest if largest > 0 else 1.0
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(max(1.0, power * max(m for m in (1, 2, 5) if m * power <= wanted * (1 + 1e-9))))


def story(
    asset: Asset,
    mesh: TetMesh,
    displacement: Float[np.ndarray, "points 3"],
    *,
    title: str = "Sag under its own weight",
) -> list[Panel]:
    """Three panels that tell a run: the asset, its stiffness, and what becomes of it.

    Parameters
    ----------
    asset
        The asset.
    mesh
        Its mesh with a material.
    displacement
        Displacement [m] of the points, shape (points, 3).
    title
        Of the third panel.

    Returns
    -------
    list[Panel]
        Panels for ``render_png``.

    Raises
    ------
    InputError
        Where the mesh has no material.
    """
    panels = [_stiffness_panel(mesh), _displacement_panel(mesh, displacement, title)]
    return [asset_panel(asset, title="Asset"), *panels]


def _stiffness_panel(mesh: TetMesh) -> Panel:
    E = material_of(mesh).E
    scale = Scale.around(E, label="Young's modulus", unit="Pa", palette="E", log=True)
    return mesh_panel(mesh, E, scale=scale, title="Stiffness")


def _displacement_panel(mesh: TetMesh, displacement: np.ndarray, title: str) -> Panel:
    """The moving mesh, coloured by how far its points are from where they were."""
    moved, factor = np.linalg.norm(displacement, axis=-1), exaggeration(mesh, displacement)
    return mesh_panel(
        mesh,
        moved,
        on="points",
        scale=Scale.around(moved, label="Displacement", unit="m", palette="displacement"),
        title=title + (f", drawn {factor:g} times larger" if factor > 1 else ""),
        displacement=displacement,
        factor=factor,
    )


def render_png(
    path: str | os.PathLike[str],
    panels: Sequence[Panel],
    *,
    up: UpAxis = "z",
    pixels: int = 480,
    samples: int = 10,
) -> Path:
    """Write the first frame of panels side by side, seen alike.

    Parameters
    ----------
    path
        File to write, .png.
    panels
        At least one.
    up
        Axis that points up.
    pixels
        Side of a panel [px].
    samples
        Rays a pixel.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InputError
        Where there is no panel, or the file cannot be written.
    """
    path = Path(path)
    with writing(path) as target:
        _traced(panels, up, pixels, samples).save(target, format="PNG", optimize=True)
    return path


def _traced(panels: Sequence[Panel], up: UpAxis, pixels: int, samples: int) -> Image:
    """The first frame of panels side by side, with their marks."""
    camera, ground = _view(panels, up, pixels)
    shots = [trace(p.frames[0], camera, up=up, ground=ground, samples=samples) for p in panels]
    return _sheet(panels, shots, camera)


def render_animation(
    path: str | os.PathLike[str],
    panels: Sequence[Panel],
    *,
    up: UpAxis = "z",
    pixels: int = 320,
    seconds: float = 2.0,
    samples: int = 4,
) -> Path:
    """Write panels in motion, endlessly repeated.

    Parameters
    ----------
    path
        File to write: .gif, .webp or animated .png.
    panels
        At least one; those of fewer frames start again.
    up
        Axis that points up.
    pixels
        Side of a panel [px].
    seconds
        How long a round takes [s].
    samples
        Rays a pixel.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InputError
        Where there is no panel, the suffix is unknown, or the file cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() not in ANIMATIONS:
        known = {"suffix": path.suffix, "wanted": ", ".join(ANIMATIONS)}
        raise InputError("picture.suffix", path=path, **known)
    camera, ground = _view(panels, up, pixels)
    count = max(len(panel.frames) for panel in panels)
    sheets = []
    for i in range(count):
        surfaces = (panel.frames[i % len(panel.frames)] for panel in panels)
        shots = [trace(s, camera, up=up, ground=ground, samples=samples) for s in surfaces]
        sheets.append(_sheet(panels, shots))
    form = ANIMATIONS[path.suffix.lower()]
    with writing(path) as target:
        duration = round(1000 * seconds / count)
        sheets[0].save(
            target, form, save_all=True, append_images=sheets[1:], duration=duration, loop=0
        )
    return path


def _view(panels: Sequence[Panel], up: UpAxis, pixels: int) -> tuple[Camera, float]:
    """Camera that sees all frames of all panels, from the front, the right and above; the floor."""
    if not panels:
        raise InputError("a picture needs at least one panel, got none")
    boxes = np.array([frame.bounds for panel in panels for frame in panel.frames])
    lo, hi = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
    middle, half = (lo + hi) / 2, (hi - lo) / 2
    axis = up_vector(up)
    front = np.roll(axis, 1)
    right = np.cross(axis, front)
    toward = 0.74 * front + 0.50 * right + 0.45 * axis
    toward /= np.linalg.norm(toward)
    pose = look_at(middle + toward, middle, up=up).pose[:3, :3]
    signs = np.stack(np.meshgrid(*[(-1, 1)] * 3), axis=-1).reshape(-1, 3)
    x, y, z = (signs * half @ pose).T
    distance = MARGIN * np.max(z + np.maximum(abs(x), abs(y)) / np.tan(FIELD_OF_VIEW / 2))
    eye = middle + max(distance, 1e-9) * toward
    camera = look_at(eye, middle, up=up, pixels=pixels, field_of_view=float(FIELD_OF_VIEW))
    return camera, float(min(axis @ lo, axis @ hi))


def _sheet(
    panels: Sequence[Panel], shots: Sequence[np.ndarray], camera: Camera | None = None
) -> Image:
    """Put the traced pictures side by side, each below its title and above its scale."""
    from PIL import Image, ImageDraw, ImageFont

    side = shots[0].shape[0]
    size = max(11, side // 30)
    top = int(2.6 * size) if any(panel.title for panel in panels) else 0
    bottom = int(5 * size) if any(panel.scale for panel in panels) else 0
    sheet = Image.new("RGB", (side * len(panels), top + side + bottom), "white")
    draw = ImageDraw.Draw(sheet)
    title, small = (ImageFont.load_default(size * s) for s in (1.15, 0.9))
    for i, (panel, shot) in enumerate(zip(panels, shots, strict=True)):
        pixels = (255 * shot + 0.5).astype(np.uint8)
        sheet.paste(Image.fromarray(pixels), (i * side, top))
        draw.text((i * side + side / 2, 1.6 * size), panel.title, INK, font=title, anchor="mm")
        for words, point in panel.marks:
            assert camera is not None
            x, y, _ = camera.project(np.asarray(point)[None])[0]
            draw.text((i * side + x, top + y), words, INK, font=title, anchor="mm",
                      stroke_width=2, stroke_fill="white")  # fmt: skip
        if scale := panel.scale:
            # A colour bar, its ends in words and its label between them
            x, y, width = i * side + side // 8, top + side, 3 * side // 4
            colors = scale.palette_at(np.linspace(0, 1, width))
            for k, color in enumerate((255 * colors + 0.5).astype(int)):
                draw.line([(x + k, y + size), (x + k, y + 1.7 * size)], fill=tuple(color.tolist()))
            below = y + 2.8 * size
            for place, value, anchor in ((0, scale.lo, "lm"), (width, scale.hi, "rm")):
                words = si(value, scale.unit).translate(PLAIN)
                draw.text((x + place, below), words, INK, font=small, anchor=anchor)
            label = scale.label + (" (log)" if scale.log and not scale.single else "")
            draw.text((x + width / 2, below), label, FAINT, font=small, anchor="mm")
    return sheet


REGION_CAPTION = (
    "Regions of like look by number: --region N=TEXT says what one is made of, as does --at X,Y,Z="
)


def region_png(
    number: Int[np.ndarray, "nx ny nz"], grid: Grid, *, up: UpAxis = "z", seed: int = 4
) -> bytes:
    """Picture of numbered cells: each number in a colour of its own, named where it is seen.

    Parameters
    ----------
    number
        Number of every cell, 0 for none.
    grid
        The cells [m].
    up
        Axis that points up.
    seed
        Of the colours.

    Returns
    -------
    bytes
        The picture as PNG.

    Examples
    --------
    >>> import numpy as np, autophyx_tet as apx
    >>> number = np.arange(8).reshape(2, 2, 2)
    >>> apx.region_png(number, apx.Grid(np.zeros(3), 0.1, (2, 2, 2)))[1:4]
    b'PNG'
    """
    shell = voxel_shell(number > 0, grid)
    of_face = number[tuple(shell.cell.T)]
    colours = np.random.default_rng(seed).uniform(0.3, 0.95, (number.max() + 1, 3))[of_face]
    surface = ColouredSurface(shell.points, shell.faces, np.repeat(colours[:, None], 3, axis=1))
    camera, _ = _view([Panel((surface,))], up, _SEEN)
    middle = shell.points[shell.faces].mean(axis=1)
    pixel = camera.project(middle)[:, :2].round().astype(int)
    # of the faces behind one pixel the nearest is seen
    order = np.argsort(np.linalg.norm(middle - camera.position, axis=1), kind="stable")
    _, first = np.unique(pixel[order], axis=0, return_index=True)
    seen = order[first]
    marks = []
    for k in np.unique(of_face[seen]):
        mine = middle[seen[of_face[seen] == k]]
        if len(mine) >= _LEAST_SEEN:
            at = mine[np.square(mine - np.median(mine, axis=0)).sum(axis=1).argmin()]
            marks.append((str(k), at))
    out = BytesIO()
    panel = Panel((surface,), marks=tuple(marks))
    # a few hues and their shades: a palette holds them in a third of the bytes
    _traced([panel], up, 640, 6).quantize(256).save(out, format="PNG", optimize=True)
    return out.getvalue()


_SEEN, _LEAST_SEEN = 60, 4  # pixels a side, about a cell each; so many of a region to name it
CAPTION = (
    "What the image encoder sees, lifted onto voxels: the first three principal components of its "
    "features as red, green and blue. Parts of one colour look alike to it."
)


class VoxelShell(NamedTuple):
    """Faces between full and empty cells: points (points, 3) [m], triangles, the cell of each."""

    points: np.ndarray
    faces: np.ndarray
    cell: np.ndarray


def feature_png(
    path: str | os.PathLike[str],
    voxels: VoxelFeatures,
    asset: Asset | None = None,
    *,
    up: UpAxis = "z",
) -> Path:
    """Write the picture of the features, beside the asset as it looks where there is one."""
    # Cells of the asset, coloured by what their features have in common
    shell = voxel_shell(voxels.occupied, voxels.grid)
    row = np.full(voxels.grid.shape, -1)
    row[tuple(voxels.cells.T)] = np.arange(len(voxels.cells))
    colours = voxels.picture()[row[tuple(shell.cell.T)]]
    corners = np.repeat(colours[:, None], 3, axis=1).astype(np.float64)
    surface = ColouredSurface(shell.points, shell.faces, corners)
    panel = Panel((surface,), f"features of {voxels.encoder}")
    panels = [panel] if asset is None else [asset_panel(asset, title=asset.name), panel]
    return render_png(path, panels, up=up if asset is None else asset.up)


def voxel_shell(occupied: Bool[np.ndarray, "nx ny nz"], grid: Grid) -> VoxelShell:
    """Two triangles for every face that a full cell turns to an empty one, facing outwards."""
    corners, cells = [], []
    padded = np.pad(occupied, 1)
    for axis in range(3):
        for side in (0, 1):
            beside = np.roll(padded, 1 - 2 * side, axis=axis)[1:-1, 1:-1, 1:-1]
            bare = np.argwhere(occupied & ~beside)
            cells.append(bare)
            # a unit cell's face across this axis, counter-clockwise seen from outside
            square = np.insert([[0, 0], [1, 0], [1, 1], [0, 1]], 0, side, axis=1)
            square = np.roll(square if side else square[::-1], axis, axis=1)
            corners.append(bare[:, None] + square)
    quads: Int[np.ndarray, "quads 4 3"] = np.concatenate(corners)
    points, index = np.unique(quads.reshape(-1, 3), axis=0, return_inverse=True)
    index = index.reshape(-1, 4)
    faces = np.concatenate([index[:, [0, 1, 2]], index[:, [0, 2, 3]]])
    world: Float[np.ndarray, "points 3"] = grid.to_world(points - 0.5)
    return VoxelShell(world, faces, np.tile(np.concatenate(cells), (2, 1)))


STILL = ".png"
SUFFIXES = (STILL, ".gif", ".webp")
# A loop of this many frames looks smooth, takes about ten seconds of a core and stays near 1 MB.
FRAMES = 24
PARTICLES = "The particles in motion, coloured by part"
# Standard deviation of a particle's ball in spacings of the grid: particles are half of one apart.
BALL = 0.22
# Particles differ in brightness by up to this share, or nobody would see them move.
GRAIN = 0.3


def write_picture(path: Path, simulation: Simulation, *, up: UpAxis) -> Path:
    """Write what becomes of a mesh, beside its stiffness where the picture stands still."""
    mesh, title = simulation.mesh, simulation.title
    if path.suffix.lower() == STILL:
        moved = _displacement_panel(mesh, simulation.displacement, title)
        return render_png(path, [_stiffness_panel(mesh), moved], up=up)
    frames = simulation.animation.displacement
    shown = np.linspace(0, len(frames) - 1, min(FRAMES, len(frames))).round().astype(int)
    return render_animation(path, [_displacement_panel(mesh, frames[shown], title)], up=up)


def particle_film(run: ParticleRun, *, up: UpAxis) -> bytes:
    """GIF of about ``FRAMES`` frames of a run, from aside and above."""
    from PIL import Image

    shown = np.linspace(0, len(run.positions) - 1, min(FRAMES, len(run.positions)))
    states = run.positions[shown.round().astype(int)]
    ends = np.stack([states.min(axis=(0, 1)), states.max(axis=(0, 1))]).astype(np.float64)
    camera = hemisphere(ends, count=5, up=up)[1]
    # Columns of splats: a round one at every particle, of the colour of its part
    count = len(run.part)
    colours = np.array([rgb(colour) for colour in PARTS])[run.part % len(PARTS)]
    shade = 1 - GRAIN * np.random.default_rng(0).random((count, 1))
    table = PointTable(
        standard_columns(
            means=run.positions[0],
            log_scales=np.full((count, 3), np.log(BALL * run.spacing)),
            rotations=np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
            opacity=np.full(count, 0.95),
            f_dc=(shade * colours - 0.5) / SH_C0,
        )
    )
    sheets = []
    for places in states:
        moved = table.with_columns(dict(zip(XYZ, places.T, strict=True)))
        drawn = splat_view(moved, camera)
        sheets.append(Image.fromarray((255 * drawn).round().astype(np.uint8)))
    out = BytesIO()
    each = round(2000 / len(sheets))  # two seconds, as other loops
    sheets[0].save(out, "GIF", save_all=True, append_images=sheets[1:], duration=each, loop=0)
    return out.getvalue()


# Perceptually ordered maps (viridis, cividis, plasma, inferno, mako), cut where they are nearly
# black; the report draws with the same.
PALETTES: dict[str, tuple[str, ...]] = {
    "E": ("#472d7b", "#3e4989", "#31688e", "#26828e", "#1f9e89", "#35b779", "#6ece58", "#b5de2b",
          "#fde725"),
    "nu": ("#123570", "#3b496c", "#575d6d", "#707173", "#8a8678", "#a59c74", "#c3b369", "#e1cc55",
           "#fee838"),
    "rho": ("#35264c", "#403a75", "#3d5296", "#366da0", "#3487a6", "#35a1ab", "#43bbad", "#6cd3ad",
            "#ade3c0", "#def5e5"),
    "displacement": ("#46039f", "#7201a8", "#9c179e", "#bd3786", "#d8576b", "#ed7953", "#fb9f3a",
                     "#fdca26", "#f0f921"),
    "von_mises": ("#420a68", "#6a176e", "#932667", "#bc3754", "#dd513a", "#f37819", "#fca50a",
                  "#f6d746", "#fcffa4"),
}  # fmt: skip
# Colours of parts: muted, told apart by hue, repeated after the last.
PARTS = (
    "#5b8db8", "#d19a55", "#6fa86a", "#b7656c", "#8d7fb5", "#5fb0ac", "#c2a847", "#a0785f",
    "#8a9099", "#d08fb4",
)  # fmt: skip
SINGLE = 1e-6  # relative span below which all values count as one


def rgb(words: str) -> Float[np.ndarray, "3"]:
    """Colour in [0, 1] of ``#rrggbb``."""
    return np.array([int(words[i : i + 2], 16) for i in (1, 3, 5)]) / 255


@dataclass(frozen=True)
class Scale:
    """Values on a palette, with a label and a unit.

    Parameters
    ----------
    label, unit
        What is shown, "Young's modulus", and in which unit, "Pa".
    palette
        Name of the colours: "E", "displacement" ...
    lo, hi
        Values at its ends, in that unit.
    log
        Whether it goes by decades.

    Raises
    ------
    InputError
        Where the palette is unknown, or the ends are not in order.

    Examples
    --------
    >>> import autophyx_tet as apx
    >>> scale = apx.Scale.around([1e6, 2e9], label="E", unit="Pa", palette="E", log=True)
    >>> scale.lo, scale.hi
    (1000000.0, 2000000000.0)
    """

    label: str
    unit: str
    palette: str
    lo: float
    hi: float
    log: bool = False

    def __post_init__(self) -> None:
        if self.palette not in PALETTES:
            raise InputError(f"unknown palette {self.palette!r}, wanted {', '.join(PALETTES)}")
        if not self.lo <= self.hi or (self.log and not self.lo > 0):
            raise InputError(f"scale from {self.lo} to {self.hi}: wanted lo <= hi, above 0 if log")

    @classmethod
    def around(cls, values, *, label: str, unit: str, palette: str, log: bool = False) -> Scale:
        """Return the scale that spans all ``values``."""
        return cls(label, unit, palette, float(np.min(values)), float(np.max(values)), log)

    @property
    def single(self) -> bool:
        """Whether the scale holds one value only."""
        return self.hi - self.lo <= SINGLE * max(abs(self.lo), abs(self.hi))

    def share(self, values: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        """Place of values on the scale, in [0, 1]; one half where it holds one value only."""
        if self.single:
            return np.full(np.shape(values), 0.5)
        inside = np.clip(values, self.lo, self.hi)
        if self.log:
            return np.log(inside / self.lo) / np.log(self.hi / self.lo)
        return (inside - self.lo) / (self.hi - self.lo)

    def colors(self, values: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n 3"]:
        """Colour (sRGB, [0, 1]) of values."""
        return self.palette_at(self.share(values))

    def palette_at(self, places: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n 3"]:
        """Colour (sRGB, [0, 1]) at places of the scale, 0 its lower end and 1 its upper."""
        stops = np.array([rgb(stop) for stop in PALETTES[self.palette]])
        at = np.linspace(0, 1, len(stops))
        return np.stack([np.interp(places, at, stops[:, i]) for i in range(3)], axis=-1)
