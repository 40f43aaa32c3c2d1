"""Load an asset file: named surface parts in metres, with all that the file says about them."""

from __future__ import annotations

import io
import logging
import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..fem.errors import InputError, UsageError
from ..predictors.asset import Asset, Part, UpAxis
from .options import METRES, Unit
from .references import References, used_materials

if TYPE_CHECKING:
    import trimesh

log = logging.getLogger(__name__)

MAX_FILE_BYTES = 2 * 2**30  # more than this is not an asset but a scan archive
MAX_TRIANGLES = 20_000_000  # about 2 GB of arrays on the way: the limit of a 24 GB machine
MAX_PARTS = 256  # beyond it parts are merged by material: nobody names 300 materials in a sentence
COORDINATE_LIMIT = 1e12  # squares and volumes of larger numbers leave float64
SMALLEST, LARGEST = 1e-3, 100.0  # longest side [m] outside which a forgotten unit is likely
# Names that exporters and loaders make up for things that have none.
MADE_UP_NAME = re.compile(r"(geometry|node|mesh|gltf|default|world|none|\W|_|\d)*", re.IGNORECASE)


class Surface(NamedTuple):
    """One piece of a file: a triangle surface and the names around it."""

    mesh: trimesh.Trimesh
    node: tuple[str, ...] = ()
    material: str | None = None


def load_asset(
    path: str | Path,
    *,
    size: float | None = None,
    units: Unit | None = None,
    up: UpAxis | None = None,
) -> Asset:
    """Load a surface file; every named node, group or material becomes a part, in metres.

    Parameters
    ----------
    path
        File of one of the suffixes in ``READERS``.
    size
        Longest side of the bounding box [m]; the file's own numbers only give the shape then.
    units
        Unit of the file's numbers. Without ``size`` and ``units`` glTF is metres, others are taken
        as metres with a warning.
    up
        Axis that points up: by default y for glTF and OBJ, z with a warning for others.

    Raises
    ------
    InputError
        Where the file is missing, unreadable, invalid or holds no triangle.
    UsageError
        Where both ``size`` and ``units`` are given, or ``size`` is not positive.
    """
    path = Path(path)
    _check_scale(size, units)
    suffix = _check_path(path)
    data = path.read_bytes()
    references = References(path.parent, materials=_materials(suffix, data))
    surfaces = READERS[suffix](path, data, references)
    surfaces, warnings = _with_extent(path, [_checked(path, surface) for surface in surfaces])
    warnings = [*references.warnings, *warnings]
    parts = _parts(surfaces, path.stem, warnings)
    asset = Asset(
        name=path.stem,
        parts=parts,
        up=up or ("y" if suffix in Y_UP else "z"),
        source=str(path),
        source_hash=references.digest(data),
    )
    if up is None and suffix not in METRIC:
        warnings.append(f"the file does not say which axis is up: taken as +{asset.up.upper()}")
    return _in_metres(asset, size, units, suffix in METRIC, warnings)


def _check_scale(size: float | None, units: Unit | None) -> None:
    if size is not None and units is not None:
        raise UsageError(f"got both --size {size:g} and --units {units}: give one of them")
    if size is not None and not (np.isfinite(size) and size > 0):
        raise UsageError(f"--size must be a length > 0 m, got {size:g}")
    if units is not None and units not in METRES:
        raise UsageError(f"--units must be one of {', '.join(METRES)}, got {units!r}")


def _check_path(path: Path) -> str:
    """Suffix of a readable, non-empty file that there is a reader for."""
    suffix = path.suffix.lower()
    if not path.exists():
        raise InputError(f"{path}: no such file")
    if path.is_dir():
        raise InputError(f"{path}: is a folder, wanted one file of {', '.join(READERS)}")
    if suffix not in READERS:
        raise InputError(f"{path}: unknown suffix {suffix!r}, wanted one of {', '.join(READERS)}")
    bytes_ = path.stat().st_size
    if bytes_ == 0:
        raise InputError(f"{path}: is empty (0 bytes): export it again")
    if bytes_ > MAX_FILE_BYTES:
        raise InputError(
            f"{path}: {bytes_} bytes, the limit is {MAX_FILE_BYTES}: simplify it first"
        )
    return suffix


def _materials(suffix: str, data: bytes) -> tuple[str, ...]:
    return used_materials(data.decode(errors="replace")) if suffix == ".obj" else ()


def _scene(path: Path, data: bytes, references: References, **options: Any) -> trimesh.Scene:
    """Parse with trimesh; whatever a parser stumbles over becomes one sentence."""
    import trimesh

    kind = path.suffix[1:].lower()
    try:
        return trimesh.load_scene(
            io.BytesIO(data),
            file_type=kind,
            resolver=references,  # type: ignore[arg-type]
            process=False,
            **options,
        )
    except Exception as error:  # a parser of untrusted bytes may raise anything
        reason = f"{type(error).__name__}: {error}"[:300]
        raise InputError(
            f"{path}: is not a valid {kind} file ({reason}): export it again"
        ) from error


def _read_plain(path: Path, data: bytes, references: References) -> list[Surface]:
    """Formats with one surface, or several named solids, and no tree of nodes."""
    scene = _scene(path, data, references)
    named = len(scene.geometry) > 1
    return [Surface(mesh, (name,) if named else ()) for name, mesh in _meshes(scene)]


def _read_obj(path: Path, data: bytes, references: References) -> list[Surface]:
    """OBJ: one surface per object (or group, where there are no objects) and material."""
    text = absolute_indices(data.decode(errors="replace"))
    objects = re.search(r"^o[ \t]+\S", text, flags=re.MULTILINE) is not None
    scene = _scene(
        path,
        text.encode(),
        references,
        group_material=True,
        split_objects=objects,
        split_groups=not objects,
    )
    surfaces = []
    for name, mesh in _meshes(scene):
        material = _material_name(mesh)
        node = name.removesuffix(f"_{material}")
        surfaces.append(Surface(mesh, (node,), material))
    return surfaces


def _read_gltf(path: Path, data: bytes, references: References) -> list[Surface]:
    """GLTF and GLB: one surface per node and material, in world coordinates, metres."""
    scene = _scene(path, data, references)
    surfaces = []
    for node in sorted(scene.graph.nodes_geometry):
        transform, geometry = scene.graph[node]
        mesh = scene.geometry[geometry]
        if not _is_surface(mesh):
            continue
        mesh = mesh.copy()
        mesh.apply_transform(transform)
        surfaces.append(Surface(mesh, _ancestry(scene, node, str(geometry)), _material_name(mesh)))
    if not surfaces and references.warnings:
        raise InputError(f"{path}: {references.warnings[0]}")
    return surfaces


def _meshes(scene: trimesh.Scene) -> Iterable[tuple[str, trimesh.Trimesh]]:
    return [(name, mesh) for name, mesh in scene.geometry.items() if _is_surface(mesh)]


def _is_surface(geometry: Any) -> bool:
    return getattr(geometry, "faces", None) is not None and len(geometry.faces) > 0


def _material_name(mesh: trimesh.Trimesh) -> str | None:
    return getattr(getattr(mesh.visual, "material", None), "name", None)


def _ancestry(scene: trimesh.Scene, node: str, geometry: str) -> tuple[str, ...]:
    """Names of a node, of its mesh and of the nodes above it, nearest first."""
    parents = scene.graph.transforms.parents
    names = [node, geometry]
    while node in parents:
        node = parents[node]
        names.append(node)
    return tuple(names)


_FACE_LINE = re.compile(r"^(?:v|vt|vn|f)[ \t].*$", flags=re.MULTILINE)


def absolute_indices(text: str) -> str:
    """Rewrite an OBJ text's relative (negative) indices, which count back from their own line."""
    if not re.search(r"^f[ \t].*-\d", text, flags=re.MULTILINE):
        return text
    count = {"v": 0, "vt": 0, "vn": 0}

    def absolute(match: re.Match[str]) -> str:
        kind, *rest = match.group().split()
        if kind != "f":
            count[kind] += 1
            return match.group()
        return " ".join(["f", *(_absolute_corner(corner, count) for corner in rest)])

    return _FACE_LINE.sub(absolute, text)


def _absolute_corner(corner: str, count: dict[str, int]) -> str:
    pairs = zip(corner.split("/"), count.values(), strict=False)
    return "/".join(str(n + 1 + int(i)) if i.startswith("-") else i for i, n in pairs)


def _checked(path: Path, surface: Surface) -> Surface:
    """Refuse what no later step could make sense of: indices, numbers, counts."""
    points, faces = surface.mesh.vertices, surface.mesh.faces
    if len(faces) > MAX_TRIANGLES:
        raise InputError(
            f"{path}: {len(faces)} triangles, the limit is {MAX_TRIANGLES}: simplify it"
        )
    out = np.flatnonzero((faces < 0).any(axis=1) | (faces >= len(points)).any(axis=1))
    if out.size:
        raise InputError(
            f"{path}: face {out[0]} names vertices {faces[out[0]].tolist()} of {len(points)} "
            f"({out.size} such faces): export it again"
        )
    bad = np.flatnonzero(~(np.abs(points) < COORDINATE_LIMIT).all(axis=1))  # also catches NaN
    if bad.size:
        raise InputError(
            f"{path}: vertex {bad[0]} is {points[bad[0]].tolist()} ({bad.size} such vertices), "
            f"wanted finite numbers below {COORDINATE_LIMIT:g}: export it again"
        )
    return surface


def _with_extent(path: Path, surfaces: list[Surface]) -> tuple[list[Surface], list[str]]:
    """Surfaces that are more than one point, and a sentence about the others."""
    if not surfaces:
        raise InputError(f"{path}: holds no triangle: wanted a surface mesh")
    kept = [s for s in surfaces if np.ptp(s.mesh.vertices[s.mesh.faces], axis=(0, 1)).max() > 0]
    if not kept:
        raise InputError(f"{path}: all {len(surfaces)} surfaces shrink to one point")
    dropped = len(surfaces) - len(kept)
    return kept, [f"{dropped} surfaces that shrink to one point were left out"] * bool(dropped)


def _parts(surfaces: Sequence[Surface], stem: str, warnings: list[str]) -> tuple[Part, ...]:
    """One part per (node, material); per material alone where that would be too many."""
    groups = _grouped(surfaces, [(s.node[:1], s.material) for s in surfaces])
    if len(groups) > MAX_PARTS:
        groups = _grouped(surfaces, [s.material for s in surfaces])
        warnings.append(f"more than {MAX_PARTS} named pieces: merged by material to {len(groups)}")
    return tuple(
        Part(name, _joined([s.mesh for s in group]), _labels(group))
        for name, group in zip(_unique_names(groups, stem), groups, strict=True)
    )


def _grouped(surfaces: Sequence[Surface], keys: Sequence[Any]) -> list[list[Surface]]:
    groups: dict[Any, list[Surface]] = {}
    for surface, key in zip(surfaces, keys, strict=True):
        groups.setdefault(key, []).append(surface)
    return list(groups.values())


def _joined(meshes: list[trimesh.Trimesh]) -> trimesh.Trimesh:
    import trimesh

    return meshes[0] if len(meshes) == 1 else trimesh.util.concatenate(meshes)  # type: ignore


def _labels(group: Sequence[Surface]) -> tuple[str, ...]:
    """All real names around a part, without repeats."""
    names = [n for s in group for n in (*s.node, *([s.material] if s.material else []))]
    return tuple(dict.fromkeys(n for n in names if _is_name(n)))


def _is_name(name: str | None) -> bool:
    return name is not None and MADE_UP_NAME.fullmatch(name) is None


def _unique_names(groups: Sequence[Sequence[Surface]], stem: str) -> list[str]:
    """The node's name where it has one part, else its material's, else both; counted if equal."""
    nodes = [_first_name(group[0].node[:1]) for group in groups]
    materials = [_first_name((group[0].material,)) for group in groups]
    names: list[str] = []
    for node, material in zip(nodes, materials, strict=True):
        if node and nodes.count(node) == 1:
            wanted = node
        elif material and materials.count(material) == 1:
            wanted = material
        else:
            wanted = "_".join(name for name in (node, material) if name) or stem
        name, count = wanted, 1
        while name in names:
            name, count = f"{wanted}.{count}", count + 1
        names.append(name)
    return names


def _first_name(names: Sequence[str | None]) -> str | None:
    return next((name for name in names if _is_name(name)), None)


def _in_metres(
    asset: Asset, size: float | None, units: Unit | None, metric: bool, warnings: list[str]
) -> Asset:
    """Scale to metres and say what was assumed."""
    longest = float(asset.size.max())
    factor = METRES[units or "m"] if size is None else size / longest
    if size is None and units is None and not metric:
        warnings.append(
            f"the file has no unit: taken as metres (longest side {longest:.4g} m); "
            "--size or --units sets it"
        )
    if not SMALLEST <= longest * factor <= LARGEST:
        warnings.append(
            f"a longest side of {longest * factor:.4g} m is unusual: --size or --units sets it"
        )
    if factor != 1:
        for part in asset.parts:
            part.mesh.vertices = part.mesh.vertices * factor
    for sentence in warnings:
        log.info("%s: %s", asset.source, sentence)
    return replace(asset, metres_per_unit=float(factor), warnings=tuple(warnings))


METRIC = (".glb", ".gltf")  # the standard says metres and +Y up
Y_UP = (*METRIC, ".obj")  # OBJ says nothing, but nearly all exporters write +Y
READERS = {
    ".obj": _read_obj,
    ".ply": _read_plain,
    ".stl": _read_plain,
    ".off": _read_plain,
    ".glb": _read_gltf,
    ".gltf": _read_gltf,
}
