"""JSON documents: what `--json` prints, the sidecar of a mesh, the record of a run."""

from __future__ import annotations

import dataclasses
import json
from datetime import datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from ...converters.files import writing
from ...fem.scene.mesh import TetMesh

SCHEMA = 1
_VERSIONED = ("autophyx-tet", "numpy", "scipy", "trimesh", "pytetwild", "libigl", "warp-lang")


def plain(value: Any) -> Any:
    """Turn dataclasses, numpy values and paths into what JSON knows; not-a-number becomes null."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        value = dict(zip(value._fields, value, strict=True))  # type: ignore[attr-defined]
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    if isinstance(value, str | int | float) or value is None:
        return value
    return str(value)


def mesh_document(mesh: TetMesh) -> dict[str, Any]:
    """Size, volume [m^3], mass [kg] and regions of a mesh."""
    return {
        "points": len(mesh.points),
        "tets": len(mesh.tets),
        "volume": mesh.volume,
        "mass": mesh.mass if mesh.material else None,
        "bounds": mesh.bounds,
        "regions": [
            {"name": name, "volume": volume, "tets": int((mesh.region == i).sum())}
            for i, (name, volume) in enumerate(
                zip(mesh.region_names, mesh.region_volumes(), strict=True)
            )
        ],
    }


def dumps(document: Any) -> str:
    """Serialise to one JSON document with two spaces of indent."""
    return json.dumps(plain(document), indent=2, ensure_ascii=False, allow_nan=False)


def write_json(path: Path, document: Any) -> None:
    """Write a document so that a reader sees all of it or none."""
    with writing(path) as temporary:
        temporary.write_text(dumps(document) + "\n", encoding="utf-8")


def now() -> str:
    """Date and time of this moment, with its zone."""
    return datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %Z")


def versions() -> dict[str, str]:
    """Versions of this package and of the libraries that shape its results."""
    found = {}
    for name in _VERSIONED:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found
