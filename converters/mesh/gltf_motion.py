"""Motions as glTF binary: the surface, a shape key a frame, and an animation that plays them.

The layout is that of the glTF 2.0 specification, https://registry.khronos.org/glTF/specs/2.0,
sections 3.7.2.2 (morph targets), 3.11 (animations) and 4.4 (GLB).
"""

from __future__ import annotations

import colorsys
import json
import logging
import os
import struct
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from ...fem.errors import InputError
from ...fem.mesh import TetMesh
from ...fem.note import Note
from ...fem.scene.up import UpAxis, half_turn
from ..files import writing
from .meshdata import far_offset

log = logging.getLogger(__name__)

FLOAT, INDEX, BYTE = 5126, 5125, 5121  # component types
VERTICES, INDICES = 34962, 34963  # what a buffer view is for
GOLDEN = (5**0.5 - 1) / 2  # turns of the colour wheel between two parts: neighbours differ


def write_motion_glb(
    path: str | os.PathLike[str],
    mesh: TetMesh,
    times: Float[np.ndarray, "frames"],
    displacement: Float[np.ndarray, "frames points 3"],
    *,
    up: UpAxis = "z",
) -> Path:
    """Write the surface of a mesh [m] that moves by ``displacement`` [m] at ``times`` [s].

    ``up`` is the mesh's axis that points up; it becomes +y. What lies far from the origin is moved
    there, for the file's single precision: its node says from where.

    Raises InputError: Where there is no frame, or times do not rise.
    """
    path = Path(path)
    if not len(times) or np.any(np.diff(times) <= 0):
        raise InputError("gltf_motion.motion_needs", name=path.name, count=len(times))
    body = _Buffers()
    # Faces over drawn points, and of each of these its point and its part: none is of two
    part = np.repeat(mesh.region[mesh.boundary.tet], 3)
    pairs = np.column_stack([mesh.boundary.faces.reshape(-1), part])
    drawn, corner = np.unique(pairs, axis=0, return_inverse=True)
    faces, (points, parts) = corner.reshape(-1, 3), drawn.T
    turn, offset = to_y(up).T, far_offset(mesh)
    if offset.any():
        x, y, z = offset.tolist()
        log.warning(Note("export.recentred", x=x, y=y, z=z))
    shapes = [body.add(u[points] @ turn, "VEC3", VERTICES, ends=True) for u in displacement]
    shades = [colorsys.hsv_to_rgb(part * GOLDEN % 1, 0.45, 0.75) for part in range(parts.max() + 1)]
    colours = np.round(255 * np.array([(*shade, 1.0) for shade in shades])).astype(np.uint8)
    primitive = {
        "attributes": {
            "POSITION": body.add(
                (mesh.points - offset)[points] @ turn, "VEC3", VERTICES, ends=True
            ),
            "COLOR_0": body.add(colours[parts], "VEC4", VERTICES, BYTE, normalized=True),
        },
        "indices": body.add(faces.reshape(-1), "SCALAR", INDICES, INDEX),
        "material": 0,
        "targets": [{"POSITION": shape} for shape in shapes],
    }
    sampler = {
        "input": body.add(np.asarray(times), "SCALAR", None, ends=True),
        "output": body.add(np.eye(len(times)).reshape(-1), "SCALAR", None),
        "interpolation": "LINEAR",
    }
    document = {**_scene(primitive, sampler, times), **body.described()}
    if offset.any():
        document["nodes"][0]["extras"] = {"moved_by": (-offset @ turn).tolist()}
    with writing(path) as target:
        # Header, JSON chunk and binary chunk
        binary = bytes(body.bytes)
        text = json.dumps(document, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        total = 12 + 8 + len(text) + 8 + len(binary)
        header = struct.pack("<4sII", b"glTF", 2, total)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        target.write_bytes(header + chunks + struct.pack("<I4s", len(binary), b"BIN\0") + binary)
    return path


def to_y(up: UpAxis) -> Float[np.ndarray, "3 3"]:
    """Return the rotation that takes the up axis of a mesh to +y, glTF's."""
    turns = {
        "x": [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
        "y": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        "z": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
    }
    return np.array(turns[up[-1]]) * half_turn(up)


def _scene(primitive: dict[str, Any], sampler: dict[str, Any], times: np.ndarray) -> dict[str, Any]:
    """One node with the body, its material and its motion, which is that of its weights."""
    names = [f"{time:.4g} s" for time in times]
    return {
        "asset": {"version": "2.0", "generator": "autophyx-tet"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "body"}],
        "meshes": [
            {
                "name": "body",
                "primitives": [primitive],
                "weights": [0.0] * len(times),
                "extras": {"targetNames": names},
            }
        ],
        "materials": [{"doubleSided": True, "pbrMetallicRoughness": {"metallicFactor": 0.0}}],
        "animations": [
            {
                "name": "motion",
                "samplers": [sampler],
                "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}],
            }
        ],
    }


class _Buffers:
    """One buffer, its views and accessors."""

    def __init__(self) -> None:
        self.bytes = bytearray()
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(
        self,
        array: np.ndarray,
        kind: str,
        target: int | None,
        component: int = FLOAT,
        *,
        ends: bool = False,
        normalized: bool = False,
    ) -> int:
        """Append an array; return the number of its accessor, with its ``ends`` where wanted."""
        packed = np.ascontiguousarray(array, {FLOAT: "<f4", INDEX: "<u4", BYTE: "u1"}[component])
        view = {"buffer": 0, "byteOffset": len(self.bytes), "byteLength": packed.nbytes}
        self.views.append(view | ({"target": target} if target else {}))
        self.bytes += packed.tobytes()
        self.bytes += bytes(-len(self.bytes) % 4)
        known = {"bufferView": len(self.views) - 1, "componentType": component, "type": kind}
        known |= {"count": len(packed)} | ({"normalized": True} if normalized else {})
        if ends:
            rows = packed.reshape(len(packed), -1)
            known |= {"min": rows.min(0).tolist(), "max": rows.max(0).tolist()}
        self.accessors.append(known)
        return len(self.accessors) - 1

    def described(self) -> dict[str, Any]:
        """Return the buffer, its views and accessors as glTF has them."""
        buffers = [{"byteLength": len(self.bytes)}]
        return {"buffers": buffers, "bufferViews": self.views, "accessors": self.accessors}
