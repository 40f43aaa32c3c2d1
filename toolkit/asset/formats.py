"""The formats of assets by suffix, and what a file of one holds: named surfaces or a cloud.

``keeps`` of a format is what its files state: the unit of length, the up axis, names of parts.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...converters.registry import Format
from ...fem.errors import AutophyxError, InputError
from ...fem.registry import Registry
from ...predictors.asset import UpAxis
from .textures import References

if TYPE_CHECKING:
    import trimesh

ASSET_FORMATS: Registry[Format] = Registry(
    "asset suffix",
    __package__ or "",
    {
        ".obj": "readers:OBJ",
        ".ply": "readers:PLY_SURFACE",
        ".stl": "readers:STL",
        ".off": "readers:OFF",
        ".glb": "readers:GLTF",
        ".gltf": "readers:GLTF",
        ".3mf": "readers:THREEMF",
        ".dae": "readers:COLLADA",
        ".xyz": "readers:TEXT_CLOUD",
        **dict.fromkeys((".splat", ".spz", ".ksplat"), "readers:CARRIER"),
        **dict.fromkeys((".npz", ".nvdb", ".ingp", ".msgpack"), "readers:CARRIER"),
        **dict.fromkeys((".pt", ".pth", ".ckpt", ".safetensors"), "readers:CARRIER"),
        **dict.fromkeys((".pcd", ".las", ".laz"), "readers:CARRIER"),
    },
)


class NamedSurface(NamedTuple):
    """One piece of a file: a triangle surface and the names around it, nearest first.

    ``material_number`` tells materials apart that share a name or have none.
    """

    mesh: trimesh.Trimesh
    node: tuple[str, ...] = ()
    material: str | None = None
    material_number: int = 0


class AssetContent(NamedTuple):
    """What a file holds: surfaces, and metres per unit and up axis where it states them.

    ``cloud`` (n, 3) are points without triangles; ``up_guess`` is what most such files do;
    ``warnings`` are sentences for the user; ``samples`` says what the surfaces were made through.
    """

    surfaces: list[NamedSurface]
    metres: float | None = None
    up: UpAxis | None = None
    up_guess: UpAxis = "z"
    cloud: np.ndarray | None = None
    warnings: tuple[str, ...] = ()
    samples: str = ""


def read_content(path: Path, data: bytes, references: References) -> AssetContent:
    """Read a file by its suffix; whatever a parser stumbles over becomes one sentence."""
    suffix = path.suffix.lower()
    reader = ASSET_FORMATS[suffix].read
    if reader is None:
        raise InputError(f"{path}: {suffix} files are not read")
    try:
        return reader(path, data, references)
    except AutophyxError:
        raise
    except Exception as error:  # a parser of untrusted bytes may raise anything
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:300]
        raise InputError(
            f"{path}: is not a valid {suffix[1:]} file ({reason}): export it again"
        ) from error
