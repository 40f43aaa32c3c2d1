"""Files that large native libraries read, each in a guarded child: FBX and kin, STEP and IGES."""

from __future__ import annotations

import json
import re
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...converters.registry import Format, Keeps
from ...fem.errors import InputError
from ...fem.note import Note
from ...predictors.asset import PlainMesh
from .child import ChildFailure, run_guarded
from .formats import AssetContent, NamedSurface, References
from .gltf import read_gltf

if TYPE_CHECKING:
    import trimesh

TIME_LIMIT = 300.0  # s


def _guarded(path: Path, data: bytes, task: str, **options: Any) -> dict[str, np.ndarray]:
    arrays = {"data": np.frombuffer(data, np.uint8)}
    try:
        return run_guarded(task, arrays, options, time_limit=TIME_LIMIT)
    except ChildFailure as failure:
        raise InputError("foreign.failed", path=path, failure=failure) from failure


# Scenes by assimp, which gives every mesh in the pose that it is stored in.


def read_scene(path: Path, data: bytes, references: References) -> AssetContent:
    """Read one surface per node and mesh, where the node puts it.

    FBX says its unit, which the library applies; a skin is taken as it is bound.
    """
    import trimesh
    from trimesh.visual.material import PBRMaterial
    from trimesh.visual.texture import TextureVisuals

    suffix = path.suffix.lower()
    found = _guarded(path, data, "assimp", suffix=suffix)
    document = json.loads(found["document"].tobytes())
    surfaces = []
    for number, entry in enumerate(document):
        points, faces = found[f"points{number}"], found[f"faces{number}"]
        look = PBRMaterial(
            name=entry["material"], baseColorFactor=entry["colour"], metallicFactor=0.0
        )
        mesh = trimesh.Trimesh(
            points, faces, visual=TextureVisuals(material=look), process=False, validate=False
        )
        surfaces.append(NamedSurface(mesh, tuple(entry["names"]), entry["material"]))
    metres = 1.0 if suffix == ".fbx" else None
    warnings = (Note("foreign.textures"),) if any(e["textured"] for e in document) else ()
    return AssetContent(surfaces, metres=metres, up_guess="y", warnings=warnings)


FBX = Format("FBX", (".fbx",), read=read_scene, keeps=frozenset({Keeps.UNIT, Keeps.PARTS}))
SCENE = Format(
    "other scenes", (".3ds", ".x3d", ".lwo"), read=read_scene, keeps=frozenset({Keeps.PARTS})
)


# CAD by OpenCASCADE, of the extra ``cad``: bodies as glTF, with the names of their products.

_SOLID = re.compile(rb"=\s*(?:MANIFOLD_SOLID_BREP|BREP_WITH_VOIDS)\s*\(\s*'((?:[^']|'')*)'")
MADE_UP = re.compile(r"(open cascade.*|compound|solid|shape|part|body|none|)", re.IGNORECASE)


def read_cad(path: Path, data: bytes, references: References) -> AssetContent:
    """Read one surface per solid of a STEP or IGES file, in metres.

    Raises InputError: Without the extra, with how to install it, and where no solid is read.
    """
    if find_spec("cascadio") is None:
        raise InputError("foreign.cad_extra", path=path, suffix=path.suffix)
    kind = "STEP" if path.suffix.lower() in (".step", ".stp") else "IGES"
    glb = _guarded(path, data, "cad", kind=kind)["glb"].tobytes()
    if not glb:
        raise InputError("foreign.cad_empty", path=path)
    content = read_gltf(path, glb, references)
    surfaces = []
    solids = [name.decode("utf-8", "replace").replace("''", "'") for name in _SOLID.findall(data)]
    for surface in content.surfaces:
        bodies = _bodies(surface.mesh)
        named = solids if len(solids) == len(bodies) > 1 and len(content.surfaces) == 1 else []
        known = [name for name in surface.node if not MADE_UP.fullmatch(name)]
        for number, body in enumerate(bodies):
            own = named[number] if named and not MADE_UP.fullmatch(named[number]) else ""
            if not own and len(bodies) > 1:
                own = f"{known[0] if known else 'solid'} {number + 1}"
            names = (own, *known) if own else tuple(known)
            surfaces.append(surface._replace(mesh=body, node=names))
    metres = 1.0 if kind == "STEP" else 1e-3  # OpenCASCADE reads IGES of any unit in millimetres
    return content._replace(surfaces=surfaces, metres=metres, up=None, up_guess="z")


def _bodies(mesh: trimesh.Trimesh | PlainMesh) -> list[trimesh.Trimesh | PlainMesh]:
    """Pieces of a mesh that hang together nowhere; a cavity stays with the body around it."""
    from trimesh.util import concatenate

    mesh = mesh.copy()
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    pieces = list(mesh.split(only_watertight=False))
    bodies = [[piece] for piece in pieces if piece.volume > 0]
    if len(bodies) < 2:
        return [mesh]
    for hole in (piece for piece in pieces if piece.volume <= 0):
        low, high = hole.bounds
        boxes = [(body[0].bounds, body) for body in bodies]
        around = [body for (a, b), body in boxes if (a <= low).all() and (b >= high).all()]
        min(around or bodies, key=lambda body: body[0].volume).append(hole)
    return [concatenate(body) if len(body) > 1 else body[0] for body in bodies]  # type: ignore


CAD = Format(
    "STEP and IGES", (".step", ".stp", ".iges", ".igs"), read=read_cad,
    keeps=frozenset({Keeps.UNIT, Keeps.PARTS}),
)  # fmt: skip
