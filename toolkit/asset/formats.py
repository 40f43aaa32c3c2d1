"""The formats of assets by suffix, what a file of one holds, and what other files it refers to.

``keeps`` of a format is what its files state: the unit of length, the up axis, names of parts.
"""

from __future__ import annotations

import hashlib
import io
import logging
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple
from urllib.parse import unquote

import numpy as np

from ...converters.registry import Format
from ...fem.errors import AutophyxError, InputError
from ...fem.note import Note
from ...fem.registry import Registry
from ...predictors.asset import PlainMesh, UpAxis

if TYPE_CHECKING:
    import trimesh

    from ...converters.points.views import Pruning

log = logging.getLogger(__name__)

ASSET_FORMATS: Registry[Format] = Registry(
    "asset suffix",
    __package__ or "",
    {
        ".obj": "obj:OBJ",
        ".ply": "readers:PLY_SURFACE",
        ".stl": "readers:STL",
        ".off": "readers:OFF",
        ".glb": "gltf:GLTF",
        **dict.fromkeys((".vrm", ".gltf"), "gltf:GLTF"),
        ".3mf": "threemf:THREEMF",
        ".dae": "collada:COLLADA",
        ".fbx": "foreign:FBX",
        **dict.fromkeys((".3ds", ".x3d", ".lwo"), "foreign:SCENE"),
        **dict.fromkeys((".step", ".stp", ".iges", ".igs"), "foreign:CAD"),
        **dict.fromkeys((".splat", ".spz", ".ksplat"), "readers:CARRIER"),
        **dict.fromkeys((".npz", ".nvdb", ".ingp", ".msgpack"), "readers:CARRIER"),
        **dict.fromkeys((".pt", ".pth", ".ckpt", ".safetensors"), "readers:CARRIER"),
        **dict.fromkeys((".xyz", ".pcd", ".las", ".laz"), "readers:CARRIER"),
    },
)


# Names that exporters and loaders make up for things that have none; long numbers are of them.
MADE_UP_NAME = re.compile(
    r"(geometry|node|mesh|gltf|default|world|none|\W|_|\d)*|[0-9a-f]{16,}", re.IGNORECASE
)


# A unit of length as headers and remarks say it, "File units = inches", and its metres.
_UNIT = re.compile(r"\bunits?\s*[=:]\s*([a-z]+)", re.IGNORECASE)
_METRES = {
    **dict.fromkeys(("mm", "millimeter", "millimeters", "millimetre", "millimetres"), 1e-3),
    **dict.fromkeys(("cm", "centimeter", "centimeters", "centimetre", "centimetres"), 1e-2),
    **dict.fromkeys(("m", "meter", "meters", "metre", "metres"), 1.0),
    **dict.fromkeys(("in", "inch", "inches"), 0.0254),
    **dict.fromkeys(("ft", "foot", "feet"), 0.3048),
}


def stated_metres(remark: str) -> float | None:
    """Metres per unit that a remark of a file states, None where it states none.

    >>> stated_metres("# File units = inches")
    0.0254
    """
    said = _UNIT.search(remark)
    return _METRES.get(said[1].lower()) if said else None


class NamedSurface(NamedTuple):
    """One piece of a file: a triangle surface and the names around it, nearest first.

    ``material_number`` tells materials apart that share a name or have none.
    """

    mesh: trimesh.Trimesh | PlainMesh
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


# A reference larger than this is no texture or material file that we would want in memory.
MAX_REFERENCE_BYTES = 512 * 2**20


class References:
    """Reads the files that an asset refers to, only from the asset's own folder.

    It has the interface that trimesh wants from a resolver. ``found`` holds the bytes by name,
    ``warnings`` a sentence for each reference that was missing, refused or too large.

    folder: The folder of the asset; a reference that leads out of it is refused.
    pruning: Which splats are matter.
    """

    def __init__(self, folder: Path, *, pruning: Pruning | None = None) -> None:
        self.folder = folder.resolve()
        self.found: dict[str, bytes] = {}
        self.pruning = pruning
        self.warnings: list[str] = []

    def get(self, name: str) -> bytes:
        """Bytes of the file ``name``, relative to the folder; OSError if there are none."""
        name = unquote(name.strip()).replace("\\", "/")
        if name in self.found:
            return self.found[name]
        path, reason = (self.folder / name).resolve(), None
        if not path.is_relative_to(self.folder):
            reason = "lies outside the asset's folder and is not read"
        elif not path.is_file():
            reason = f"is not in {self.folder.name}/"
        elif path.stat().st_size > MAX_REFERENCE_BYTES:
            reason = f"is larger than {MAX_REFERENCE_BYTES >> 20} MiB"
        if reason is None:
            self.found[name] = path.read_bytes()
            return self.found[name]
        self.warn(f"{name!r} {reason}: the asset is used without it")
        raise FileNotFoundError(f"{name!r} {reason}")

    __getitem__ = get

    def keys(self) -> tuple[str, ...]:
        """Names read so far."""
        return tuple(self.found)

    def digest(self, data: bytes) -> str:
        """SHA-256 of the asset's own bytes and of all that it referred to."""
        sha = hashlib.sha256(data)
        for name in sorted(self.found):
            sha.update(name.encode() + b"\0" + hashlib.sha256(self.found[name]).digest())
        return sha.hexdigest()

    def warn(self, sentence: str) -> None:
        """Keep a sentence for the user, once."""
        if sentence not in self.warnings:
            log.info(sentence)
            self.warnings.append(sentence)


def decoded(data: Any, material: str | None, references: References) -> Any:
    """Texture of a material, of bytes or an open picture; None, told, if it cannot be decoded."""
    from PIL import Image

    try:
        image = Image.open(io.BytesIO(data)) if isinstance(data, bytes) else data
        image.load()
    except Exception as error:  # a parser of untrusted bytes may raise anything
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        references.warn(
            Note("formats.texture", material=material or "without a name", reason=reason)
        )
        return None
    return image


def parse_scene(path: Path, data: bytes, references: References, **options: Any) -> trimesh.Scene:
    """Parse with trimesh, changing nothing; textures are decoded."""
    import trimesh

    scene = trimesh.load_scene(
        io.BytesIO(data),
        file_type=path.suffix[1:].lower(),
        resolver=references,  # type: ignore
        process=False,
        **options,
    )
    # Decode the pictures that a skin is made of, once, and let go of all others
    visuals = (getattr(geometry, "visual", None) for geometry in scene.geometry.values())
    materials = (getattr(visual, "material", None) for visual in visuals)
    for material in {id(material): material for material in materials}.values():
        for kind in ("image", "baseColorTexture"):
            if (image := getattr(material, kind, None)) is not None:
                name = getattr(material, "name", None)
                setattr(material, kind, decoded(image, name, references))
    return scene


def refuse_entities(path: Path, text: bytes) -> None:
    """No XML entities: they can read files and grow without bound."""
    if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
        raise InputError(f"{path}: declares XML entities, which are not read: export it again")


def read_content(path: Path, data: bytes, references: References) -> AssetContent:
    """Read a file by its suffix; whatever a parser stumbles over becomes one sentence."""
    suffix = path.suffix.lower()
    reader = ASSET_FORMATS[suffix].read
    if reader is None:
        raise InputError(f"{path}: {suffix} files are not read")
    try:
        return reader(path, data, references)
    except AutophyxError as error:
        if str(path) in str(error):
            raise
        raise type(error)(f"{path}: {error}") from error
    except Exception as error:  # a parser of untrusted bytes may raise anything
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:300]
        if re.search(r"string to float: .*\d,\d", reason):
            raise InputError("obj.commas", path=path) from error
        raise InputError(
            f"{path}: is not a valid {suffix[1:]} file ({reason}): export it again"
        ) from error
