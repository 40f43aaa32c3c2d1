"""Pictures of results: panels side by side as PNG, in motion as GIF; no GPU and no display needed.

The rays are traced on the CPU, so that a picture comes out alike on every machine.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from jaxtyping import Float

from ....converters.files import writing
from ....fem.errors import InputError, UsageError
from ....fem.scene.mesh import TetMesh
from ....fem.scene.up import UpAxis, up_vector
from ....predictors.asset import Asset
from ....predictors.images.cameras import Camera, look_at
from ....predictors.images.surface_colour import skin_of
from ...results.quantities import si
from ..scale import PALETTES, PARTS, Scale, rgb
from .tracer import ColouredSurface, trace

if TYPE_CHECKING:
    from PIL.Image import Image

# Moving pictures that Pillow writes, by suffix.
ANIMATIONS = {".gif": "GIF", ".webp": "WEBP", ".png": "PNG"}
FIELD_OF_VIEW = np.deg2rad(28)  # a long lens: little perspective
MARGIN = 1.08  # of the distance at which the shape just fills the picture
SHOWN = 0.06  # the largest displacement is drawn this long, as a share of the diagonal
PLAIN = str.maketrans({"\u00a0": " ", "µ": "u"})  # Pillow's own font lacks them
INK, FAINT = (34, 38, 42), (112, 118, 124)


@dataclass(frozen=True, eq=False)
class Panel:
    """One picture beside others: a surface, or one per frame, with a title and a colour scale."""

    frames: tuple[ColouredSurface, ...]
    title: str = ""
    scale: Scale | None = None


def asset_panel(asset: Asset, *, title: str = "") -> Panel:
    """Panel of an asset as it looks: textures, vertex and base colours."""
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
        The mesh.
    values
        One value per tet or point, with a row per frame where they change, and their ``scale``.
    displacement
        Displacement [m], shape (points, 3), or (frames, points, 3) for a motion.
    factor
        Exaggeration of the displacement.
    """
    steps = np.zeros((1, *mesh.points.shape)) if displacement is None else displacement
    steps = steps.reshape(-1, *mesh.points.shape)
    faces = mesh.boundary.faces
    shades = _part_shades(mesh) if values is None else _shades(mesh, values, on, scale)
    frames = (
        ColouredSurface(
            mesh.points + factor * steps[i % len(steps)],
            faces,
            np.broadcast_to(shades[i % len(shades)], (len(faces), 3, 3)),
        )
        for i in range(max(len(steps), len(shades)))
    )
    return Panel(tuple(frames), title, scale)


def _part_shades(mesh: TetMesh) -> Float[np.ndarray, "1 faces 1 3"]:
    """Colour of the region behind every boundary face."""
    parts = np.array([rgb(color) for color in PARTS])
    return parts[mesh.region[mesh.boundary.tet] % len(PARTS)][None, :, None]


def _shades(
    mesh: TetMesh, values: np.ndarray, on: str, scale: Scale | None
) -> Float[np.ndarray, "frames faces corners 3"]:
    """Colour of every boundary face: one of its tet, or one at each of its corners."""
    if scale is None:
        raise UsageError("values need the scale that colours them")
    count = len(mesh.tets if on == "tets" else mesh.points)
    if values.shape[-1] != count:
        raise InputError(f"values on {on} must have {count} columns, got {values.shape}")
    rows, boundary = np.atleast_2d(values), mesh.boundary
    shown = rows[:, boundary.tet, None] if on == "tets" else rows[:, boundary.faces]
    return scale.colors(shown)


def exaggeration(mesh: TetMesh, displacement: Float[np.ndarray, "*frames points 3"]) -> float:
    """Round factor (1, 2 or 5 times a power of ten, at least 1) that makes a displacement seen."""
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
    """Three panels that tell a run: the asset, its stiffness, and what becomes of it."""
    if mesh.material is None:
        raise InputError("the mesh has no material yet: run `assign` first")
    E, moved = mesh.material.E, np.linalg.norm(displacement, axis=1)
    factor = exaggeration(mesh, displacement)
    stiffness = Scale.around(E, label="Young's modulus", unit="Pa", palette="E", log=True)
    sag = Scale.around(moved, label="Displacement", unit="m", palette="displacement")
    drawn = f", drawn {factor:g} times larger" if factor > 1 else ""
    return [
        asset_panel(asset, title="Asset"),
        mesh_panel(mesh, E, scale=stiffness, title="Stiffness"),
        mesh_panel(
            mesh,
            moved,
            on="points",
            scale=sag,
            title=f"{title}{drawn}",
            displacement=displacement,
            factor=factor,
        ),
    ]


def render_png(
    path: str | os.PathLike[str],
    panels: Sequence[Panel],
    *,
    up: UpAxis = "z",
    pixels: int = 480,
    samples: int = 10,
) -> Path:
    """Write the first frame of panels side by side, seen alike; ``pixels`` is a panel's side."""
    camera, ground = _view(panels, up, pixels)
    shots = [trace(p.frames[0], camera, up=up, ground=ground, samples=samples) for p in panels]
    path = Path(path)
    with writing(path) as target:
        _sheet(panels, shots).save(target, format="PNG", optimize=True)
    return path


def render_animation(
    path: str | os.PathLike[str],
    panels: Sequence[Panel],
    *,
    up: UpAxis = "z",
    pixels: int = 320,
    seconds: float = 2.0,
    samples: int = 4,
) -> Path:
    """Write panels in motion, endlessly repeated, as ``.gif``, ``.webp`` or animated ``.png``."""
    path = Path(path)
    if path.suffix.lower() not in ANIMATIONS:
        raise InputError(
            f"unknown suffix {path.suffix!r} of {path}, wanted {', '.join(ANIMATIONS)}"
        )
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


def _sheet(panels: Sequence[Panel], shots: Sequence[np.ndarray]) -> Image:
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
        if panel.scale:
            _bar(draw, panel.scale, (i * side + side // 8, top + side), 3 * side // 4, size, small)
    return sheet


def _bar(draw, scale: Scale, corner: tuple[int, int], width: int, size: int, font) -> None:
    """Colour bar from ``corner`` to the right, its ends in words and its label between them."""
    x, y = corner
    stops = np.array([rgb(stop) for stop in PALETTES[scale.palette]])
    at = np.linspace(0, len(stops) - 1, width)
    strip = np.stack([np.interp(at, np.arange(len(stops)), stops[:, k]) for k in range(3)], axis=1)
    for i, color in enumerate((255 * strip + 0.5).astype(int)):
        draw.line([(x + i, y + size), (x + i, y + 1.7 * size)], fill=tuple(color.tolist()))
    below = y + 2.8 * size
    for place, value, anchor in ((0, scale.lo, "lm"), (1, scale.hi, "rm")):
        words = si(value, scale.unit).translate(PLAIN)
        draw.text((x + place * width, below), words, INK, font=font, anchor=anchor)
    label = scale.label + (" (log)" if scale.log and not scale.single else "")
    draw.text((x + width / 2, below), label, FAINT, font=font, anchor="mm")
