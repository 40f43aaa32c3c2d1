"""The demo asset: a bonsai in a ceramic pot, grown by this generator, in metres, +Y up."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from jaxtyping import Float

if TYPE_CHECKING:
    import trimesh

# All lengths in metres; y is up and the pot stands on y = 0.
POT_HALF = (0.110, 0.080)  # half extents of the outline along x and z
# (inset from the outline, height) around the wall: outside up to the lip, then inside down.
POT_OUTSIDE = (
    (0.034, 0.008), (0.026, 0.010), (0.014, 0.034), (0.007, 0.062), (0.000, 0.067), (0.000, 0.078),
)  # fmt: skip
POT_INSIDE = ((0.011, 0.078), (0.013, 0.068), (0.017, 0.050), (0.025, 0.028), (0.034, 0.020))
SOIL_DOME = 0.010  # height of the dome above the soil's edge, which is the second ring inside
FOOT_AT, FOOT_RADIUS, FOOT_HEIGHT = (0.060, 0.036), 0.011, 0.014
TRUNK = (
    (-0.012, 0.058, 0.000), (-0.008, 0.085, 0.000), (0.018, 0.130, 0.006), (0.026, 0.175, -0.004),
    (0.002, 0.222, -0.010), (-0.020, 0.264, 0.000), (-0.012, 0.310, 0.008), (-0.004, 0.345, 0.004),
)  # fmt: skip
TRUNK_RADIUS = (0.0330, 0.0225, 0.0155, 0.0135, 0.0120, 0.0100, 0.0075, 0.0055)
BRANCHES = (
    ((0.020, 0.158, 0.000), (0.056, 0.178, 0.014), (0.092, 0.204, 0.010)),
    ((-0.002, 0.216, -0.008), (-0.044, 0.226, -0.020), (-0.090, 0.252, -0.012)),
    ((-0.016, 0.270, 0.002), (0.022, 0.278, 0.026), (0.056, 0.296, 0.038)),
)
BRANCH_RADIUS = (0.0095, 0.0075, 0.0050)


class Pad(NamedTuple):
    """One cloud of leaves: ``center`` [m] and half extents [m]."""

    center: tuple[float, float, float]
    half: tuple[float, float, float]


PADS = (
    Pad((0.102, 0.212, 0.010), (0.066, 0.036, 0.056)),
    Pad((-0.098, 0.260, -0.012), (0.070, 0.038, 0.058)),
    Pad((0.062, 0.304, 0.040), (0.058, 0.034, 0.050)),
    Pad((-0.004, 0.352, 0.002), (0.080, 0.050, 0.068)),
)


class Coat(NamedTuple):
    """How a part looks: its material name, base colour (linear, as glTF has it) and roughness."""

    material: str
    color: tuple[float, float, float]
    roughness: float


FINISHES = {
    "pot": Coat("glazed ceramic", (0.019, 0.107, 0.156), 0.25),
    "soil": Coat("potting soil", (0.054, 0.028, 0.018), 1.0),
    "trunk": Coat("juniper wood", (0.209, 0.098, 0.045), 0.85),
    "foliage": Coat("juniper leaves", (0.068, 0.195, 0.042), 0.9),
}


def bonsai(*, seed: int = 7) -> trimesh.Scene:
    """Return the bonsai: closed surfaces [m] named pot, soil, trunk and foliage.

    The parts reach into each other, soil and pot share a wall, so that the tet mesh is one piece.

    Parameters
    ----------
    seed
        Shapes the bark and the lumps of the leaves.

    Returns
    -------
    trimesh.Scene
        A surface a part, y up.

    Examples
    --------
    >>> import autophyx_tet as apx
    >>> tree = apx.bonsai()
    >>> sorted(tree.geometry), all(part.is_watertight for part in tree.geometry.values())
    (['foliage', 'pot', 'soil', 'trunk'], True)
    """
    import trimesh

    rng = np.random.default_rng(seed)
    rings = np.stack([_outline(*step) for step in (*POT_OUTSIDE, *POT_INSIDE)])
    parts = {
        "pot": [_closed(rings, (0, POT_OUTSIDE[0][1], 0), (0, POT_INSIDE[-1][1], 0)), *_feet()],
        "soil": [_soil()],
        "trunk": [
            _tube(TRUNK, TRUNK_RADIUS, sides=12, rings=16, rng=rng),
            *(_tube(path, BRANCH_RADIUS, sides=8, rings=7, rng=rng) for path in BRANCHES),
        ],
        "foliage": [_leaves(pad, rng) for pad in PADS],
    }
    scene = trimesh.Scene()
    for name, surfaces in parts.items():
        coat, surfaces = FINISHES[name], list(surfaces)
        points, faces = trimesh.util.append_faces(
            [surface.vertices for surface in surfaces], [surface.faces for surface in surfaces]
        )
        part = trimesh.Trimesh(points, faces, process=False)  # closed surfaces may overlap
        from trimesh.visual.material import PBRMaterial
        from trimesh.visual.texture import TextureVisuals

        part.visual = TextureVisuals(
            material=PBRMaterial(
                name=coat.material,
                baseColorFactor=[*coat.color, 1.0],
                roughnessFactor=coat.roughness,
                metallicFactor=0.0,
            )
        )
        scene.add_geometry(part, node_name=name, geom_name=name)
    return scene


def write_bonsai(path: str | os.PathLike[str], *, seed: int = 7) -> Path:
    """Write the bonsai as binary glTF (metres, +Y up).

    Parameters
    ----------
    path
        File to write, .glb; its folder is made.
    seed
        Shapes the bark and the lumps of the leaves.

    Returns
    -------
    Path
        The file.

    Examples
    --------
    >>> import autophyx_tet as apx
    >>> asset = apx.load_asset(apx.write_bonsai("bonsai.glb"))
    >>> sorted(asset.part_names), asset.metres_per_unit, asset.up  # metres [m] per unit
    (['foliage', 'pot', 'soil', 'trunk'], 1.0, 'y')
    """
    from trimesh.exchange.gltf import export_glb

    path = Path(path)
    data = export_glb(bonsai(seed=seed))
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(path.name + ".partial")
    partial.write_bytes(data)
    partial.replace(path)
    return path


def _outline(inset: float, height: float, *, sides: int = 36) -> Float[np.ndarray, "sides 3"]:
    """Rounded rectangle (superellipse of degree 4) at ``height``, ``inset`` from the pot's."""
    angle = 2 * np.pi * np.arange(sides) / sides
    cos, sin = np.cos(angle), np.sin(angle)
    x = (POT_HALF[0] - inset) * np.sign(cos) * np.sqrt(np.abs(cos))
    z = (POT_HALF[1] - inset) * np.sign(sin) * np.sqrt(np.abs(sin))
    return np.stack([x, np.full(sides, height), z], axis=1)


def _closed(rings: Float[np.ndarray, "rings sides 3"], first_pole, last_pole):
    """Closed surface through rings of equally many points, capped by two poles, facing outward."""
    import trimesh

    count, sides, _ = rings.shape
    here = np.arange(sides)
    there = np.roll(here, -1)
    base = sides * np.arange(count - 1)[:, None]
    a, b, c, d = (base + i for i in (here, there, there + sides, here + sides))
    walls = [np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))]
    bottom, top = count * sides, count * sides + 1
    last = sides * (count - 1)
    caps = [
        np.stack([there, here, np.full(sides, bottom)], axis=1),
        np.stack([here + last, there + last, np.full(sides, top)], axis=1),
    ]
    points = np.vstack([rings.reshape(-1, 3), first_pole, last_pole])
    surface = trimesh.Trimesh(points, np.vstack(walls + caps), process=False)
    if surface.volume < 0:
        surface.invert()
    return surface


def _feet():
    """Four short posts that reach from the ground into the floor of the pot."""
    for x, z in ((sx * FOOT_AT[0], sz * FOOT_AT[1]) for sx in (-1, 1) for sz in (-1, 1)):
        angle = 2 * np.pi * np.arange(10) / 10
        circle = np.stack([np.cos(angle), np.zeros(10), np.sin(angle)], axis=1)
        heights, radii = (0.0, FOOT_HEIGHT), (0.8 * FOOT_RADIUS, FOOT_RADIUS)
        rings = [r * circle + (x, y, z) for y, r in zip(heights, radii, strict=True)]
        yield _closed(np.stack(rings), (x, 0.0, z), (x, FOOT_HEIGHT, z))


def _soil():
    """Earth that fills the pot, with a slight dome.

    Its wall has the very triangles of the pot's inside: a gap or a sliver would cost many tets.
    """
    edge = POT_INSIDE[1][1]
    center = np.array([0.0, edge, 0.0])
    rings = []
    for share in (1 / 3, 2 / 3):
        ring = center + share * (_outline(*POT_INSIDE[1]) - center)
        ring[:, 1] += SOIL_DOME * (1 - share**2)
        rings.append(ring)
    rings += [_outline(*step) for step in POT_INSIDE[1:]]
    return _closed(np.stack(rings), (0, edge + SOIL_DOME, 0), (0, POT_INSIDE[-1][1], 0))


def _tube(path, radius, *, sides: int, rings: int, rng: np.random.Generator):
    """Curved, tapered, slightly gnarled tube through ``path`` with a rounded end."""
    from scipy.interpolate import CubicSpline

    knots = np.linspace(0, 1, len(path))
    share = np.linspace(0, 1, rings)
    curve = CubicSpline(knots, np.asarray(path))
    center, along = curve(share), curve(share, 1)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    side = np.cross(along, (0.0, 0.0, 1.0))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    other = np.cross(along, side)
    angle = 2 * np.pi * np.arange(sides) / sides
    phase = rng.uniform(0, 2 * np.pi, 2)
    ridges = 1 + 0.07 * np.sin(5 * angle + 9 * share[:, None] + phase[0])
    knobs = 1 + 0.05 * np.sin(2 * angle - 17 * share[:, None] + phase[1])
    size = np.interp(share, knots, radius)[:, None] * ridges * knobs
    spoke = np.cos(angle)[:, None] * side[:, None] + np.sin(angle)[:, None] * other[:, None]
    ends = center[0], center[-1] + 0.5 * radius[-1] * along[-1]
    return _closed(center[:, None] + size[..., None] * spoke, *ends)


def _leaves(pad: Pad, rng: np.random.Generator):
    """Flattened ball with lumps: bumps at random places, fewer and flatter underneath."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=2)
    out = np.asarray(ball.vertices)
    bumps = rng.normal(size=(24, 3))
    bumps /= np.linalg.norm(bumps, axis=1, keepdims=True)
    near = np.exp((out @ bumps.T - 1) / 0.06)  # a bump is about 20 degrees wide
    top = np.clip(1.5 * out[:, 1] + 0.8, 0.25, 1)
    lumpy = out * (0.80 + 0.36 * top * near.max(axis=1))[:, None]
    lumpy[:, 1] *= 0.6 + 0.4 * top
    return trimesh.Trimesh(lumpy * pad.half + np.array(pad.center), ball.faces, process=False)


if __name__ == "__main__":
    write_bonsai(Path(sys.argv[1]))
