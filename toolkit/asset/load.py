"""Load an asset file: named surface parts in metres, with all that the file says about them."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...fem.errors import InputError, NoVolumeError, UsageError
from ...fem.mesh import USUAL_SIZE
from ...predictors.asset import Asset, Part, PlainMesh, UpAxis
from . import Unit
from .child import ChildFailure, run_guarded
from .formats import (
    ASSET_FORMATS,
    MADE_UP_NAME,
    AssetContent,
    NamedSurface,
    References,
    read_content,
)
from .triangles import Places

if TYPE_CHECKING:
    import trimesh

    from ...converters.points.views import Pruning


log = logging.getLogger(__name__)

MAX_FILE_BYTES = 2 * 2**30  # more than this is not an asset but a scan archive
MAX_TRIANGLES = 20_000_000  # about 2 GB of arrays on the way: the limit of a 24 GB machine
MAX_PARTS = 256  # beyond it parts are merged by material: nobody names 300 materials in a sentence
COORDINATE_LIMIT = 1e12  # squares and volumes of larger numbers leave float64
TETS = "save its tets as .msh of Gmsh 4.1 or .vtu, or its surface as STL or PLY"
# Formats that are not read, and what to do.
UNREAD = {
    **dict.fromkeys((".blend", ".max", ".ma", ".mb", ".c4d", ".skp"), "export it as glTF"),
    **dict.fromkeys((".usd", ".usda", ".usdc", ".usdz", ".abc"), "export it as glTF"),
    **dict.fromkeys((".ztl", ".zpr", ".spp", ".bvh", ".vox", ".pmx"), "export it as glTF"),
    **dict.fromkeys((".ifc", ".dxf", ".dwg", ".3dm", ".rvt"), "export its solids as STEP or glTF"),
    **dict.fromkeys((".sldprt", ".sldasm", ".ipt", ".f3d", ".prt", ".brep"), "export it as STEP"),
    **dict.fromkeys((".iam", ".f3z", ".catpart", ".catproduct", ".par"), "export it as STEP"),
    **dict.fromkeys((".x_t", ".x_b", ".sat", ".sab", ".jt", ".fcstd", ".asm"), "export it as STEP"),
    **dict.fromkeys((".3dxml", ".cgr", ".scad", ".u3d", ".prc"), "export it as STEP, 3MF or glTF"),
    **dict.fromkeys((".wrl", ".vrml", ".amf", ".ctm"), "export it as glTF or 3MF"),
    **dict.fromkeys((".e57", ".pts", ".ptx", ".rcs", ".rcp"), "save the cloud as PLY, LAS or XYZ"),
    **dict.fromkeys((".gcode", ".bgcode", ".ctb", ".sl1"), "give the model that was sliced"),
    **dict.fromkeys((".mtl", ".bin", ".ktx2"), "give the .obj or .gltf that names it"),
    **dict.fromkeys((".png", ".jpg", ".jpeg", ".heic", ".mp4", ".mov"), "wanted a shape"),
    **dict.fromkeys((".zip", ".rar", ".7z", ".gz", ".stpz", ".zae", ".tar"), "unpack it first"),
    **dict.fromkeys((".tgz", ".bz2", ".xz", ".zst"), "unpack it first"),
    **dict.fromkeys((".md2", ".md5mesh", ".b3d", ".x", ".drc", ".ase"), "export it as glTF"),
    **dict.fromkeys((".sog", ".lcc", ".rad"), "export the splats as .ply, .splat or .spz"),
    **dict.fromkeys((".inp", ".bdf", ".nas", ".fem", ".cdb", ".feb", ".k", ".med", ".unv"), TETS),
    **dict.fromkeys((".cgns", ".exo", ".e", ".xdmf", ".node", ".ele", ".pvtu", ".pvd"), TETS),
    **dict.fromkeys((".vtm", ".vtr", ".vts", ".vti"), TETS),
    ".vtp": "export it as STL or PLY",
}
# How the files of some kinds begin, the suffixes that they have, and what to do with others.
BEGINNINGS = {
    b"glTF": ("a glTF file", (".glb", ".gltf", ".vrm"), "rename it to .glb"),
    b"ply\n": ("a PLY file", (".ply",), "rename it to .ply"),
    b"ply\r": ("a PLY file", (".ply",), "rename it to .ply"),
    b"Kaydara FBX": ("an FBX file", (".fbx",), "rename it to .fbx"),
    b"ISO-10303-21": ("a STEP file", (".step", ".stp"), "rename it to .step"),
    b"BLENDER": ("a Blender file", (), "export it as glTF"),
    b"PXR-USDC": ("a USD file", (), "export it as glTF"),
    b"#usda": ("a USD file", (), "export it as glTF"),
    b"#VRML": ("a VRML file", (), "export it as glTF or 3MF"),
    b"\x1f\x8b\x08": ("packed by gzip", (".spz", ".ingp", ".nvdb"), "unpack it first"),
    b"PK\x03\x04": ("a zip archive", (".3mf", ".npz", ".pt", ".pth", ".ckpt"), "unpack it first"),
}
MOST_NOTE = 4 << 20  # bytes: a web page or a pointer is smaller


def load_asset(
    path: str | Path,
    *,
    size: float | None = None,
    units: Unit | None = None,
    up: UpAxis | None = None,
    opacity: float | None = None,
    crop: str | None = None,
) -> Asset:
    """Load a surface or a point cloud; every named node, group or material becomes a part [m].

    Parameters
    ----------
    path
        File of one of the suffixes in ``ASSET_FORMATS``.
    size
        Longest side of the bounding box [m]; the file's own numbers only give the shape then.
    units
        Unit of the file's numbers. Without ``size`` and ``units`` glTF is metres, others are taken
        as metres with a warning.
    up
        Axis that points up: by default y for glTF and OBJ, -y with a warning for splats, z for
        others.
    opacity, crop
        Least opacity [1] of splats that are matter, and the box "x,y,z,x,y,z" in the file's units
        that they lie in.

    Returns
    -------
    Asset
        Parts [m] with their names, and the axis that points up.

    Raises
    ------
    InputError
        Where the file is missing, unreadable, invalid or holds no triangle.
    UsageError
        Where both ``size`` and ``units`` are given, or ``size`` is not positive.

    Examples
    --------
    >>> import autophyx_tet as apx
    >>> bonsai = apx.load_asset(apx.write_bonsai("bonsai.glb"), size=0.9)
    >>> round(float(bonsai.size.max()), 9)  # m
    0.9
    """
    path = Path(path)
    _check_scale(size, units)
    _check_path(path)
    data = path.read_bytes()
    references = References(path.parent, pruning=_pruning(opacity, crop))
    content = read_content(path, data, references)
    if not content.surfaces and content.cloud is not None:
        content = reconstructed(path, content)
    surfaces, warnings = [], [*references.warnings, *content.warnings]
    for surface in content.surfaces:
        _check(path, surface)
        if np.ptp(surface.mesh.vertices[surface.mesh.faces], axis=(0, 1)).max() > 0:
            surfaces.append(surface)
    if not content.surfaces:
        if warnings:  # what a parser left out is the reason
            raise InputError("load.nothing_left", path=path, why="; ".join(warnings))
        raise InputError(f"{path}: holds no triangle: wanted a surface mesh")
    if not surfaces:
        raise InputError(f"{path}: all {len(content.surfaces)} surfaces shrink to one point")
    if dropped := len(content.surfaces) - len(surfaces):
        warnings.append(f"{dropped} surfaces that shrink to one point were left out")
    # One part per (node, material); per material alone where that would be too many
    groups = _grouped(surfaces, [(s.node[:1], s.material, s.material_number) for s in surfaces])
    if len(groups) > MAX_PARTS:
        groups = _grouped(surfaces, [s.material for s in surfaces])
        warnings.append(f"more than {MAX_PARTS} named pieces: merged by material to {len(groups)}")
    parts = tuple(
        Part(
            name,
            _joined([surface.mesh for surface in group]),
            tuple(
                dict.fromkeys(n for s in group for n in (*s.node, s.material or "") if _is_name(n))
            ),
        )
        for name, group in zip(_unique_names(groups, path.stem), groups, strict=True)
    )
    asset = Asset(
        name=path.stem,
        parts=parts,
        up=content.up or content.up_guess,
        source=str(path),
        source_hash=references.digest(data),
        samples=content.samples,
        warnings=tuple(warnings),
    )
    stated = Stated(content.metres, content.up is not None)
    return scaled(asset, size=size, units=units, up=up, stated=stated)


class Stated(NamedTuple):
    """What a file says about itself: metres per unit, and whether its up axis is known."""

    metres: float | None = None
    up: bool = False


def scaled(
    asset: Asset,
    *,
    size: float | None = None,
    units: Unit | None = None,
    up: UpAxis | None = None,
    stated: Stated = Stated(),  # noqa: B008 - a tuple does not change
) -> Asset:
    """Return an asset in metres that so far is in the units of its file, and warn of guesses."""
    _check_scale(size, units)
    warnings, guess = list(asset.warnings), ""
    if up is None and not stated.up:
        axis = asset.up.upper() if "-" in asset.up else f"+{asset.up.upper()}"
        guess = f"which axis is up: taken as {axis}; --up sets it"
    longest = float(asset.size.max())
    factor, unit = 1.0, ""
    if size is not None:
        factor = size / longest
    elif units is not None:
        factor = METRES[units]
    elif stated.metres is not None:
        factor = stated.metres
    else:
        # One line for both guesses
        unit = "the file has no unit: taken as metres; "
        guess = guess and f"; nor does it say {guess}"
    given = size is not None or units is not None
    asset = replace(asset, up=up or asset.up, size_stated=given)
    longest *= factor
    smallest, largest = USUAL_SIZE
    if guess and not unit:
        warnings.append(f"the file does not say {guess}")
        guess = ""
    if not smallest <= longest <= largest:
        likely = "likely mm, --units mm or --size" if longest > largest else "--size or --units"
        said = "as was stated" if asset.size_stated else f"{likely} sets it"
        warnings.append(f"{unit}a longest side of {longest:.4g} m is unusual: {said}{guess}")
    elif unit:
        warnings.append(f"{unit}longest side {longest:.4g} m; --size or --units sets it{guess}")
    if factor != 1:
        for part in asset.parts:
            part.mesh.vertices = part.mesh.vertices * factor
    for sentence in warnings:
        log.info("%s: %s", asset.source, sentence)
    return replace(asset, metres_per_unit=float(factor), warnings=tuple(warnings))


def _pruning(opacity: float | None, crop: str | None) -> Pruning | None:
    if opacity is None and crop is None:
        return None
    from ...converters.points.views import Pruning

    if opacity is not None and not 0 <= opacity < 1:
        raise UsageError("load.opacity", opacity=opacity)
    try:
        box = None if crop is None else np.array(crop.split(","), np.float64).reshape(2, 3)
    except ValueError:
        box = np.full((2, 3), np.nan)
    if box is not None and not (box[0] < box[1]).all():
        raise UsageError("load.crop", crop=crop)
    return Pruning(crop=box) if opacity is None else Pruning(opacity, box)


def _check_scale(size: float | None, units: Unit | None) -> None:
    if size is not None and units is not None:
        raise UsageError(f"got both --size {size:g} and --units {units}: give one of them")
    if size is not None and not (np.isfinite(size) and size > 0):
        raise UsageError(f"--size must be a length > 0 m, got {size:g}")
    if units is not None and units not in METRES:
        raise UsageError(f"--units must be one of {', '.join(METRES)}, got {units!r}")


def _check_path(path: Path) -> None:
    """Make sure of a readable, non-empty file that there is a reader for."""
    suffix = path.suffix.lower()
    if not path.exists():
        raise InputError(f"{path}: no such file")
    if path.name.startswith("transforms") or (path.is_dir() and any(path.glob("transforms*.json"))):
        raise InputError(
            f"{path}: is a capture, photographs and cameras without a shape: train it, and give "
            "the snapshot (.ingp, .msgpack) or its density (.npz); `features` sees the photographs"
        )
    if path.is_dir():
        raise InputError(
            f"{path}: is a folder, wanted one file of {', '.join(ASSET_FORMATS)}; "
            "`autophyx-tet batch` takes a folder of them"
        )
    if path.stat().st_size < MOST_NOTE:
        head = path.read_bytes()[:400].lstrip().lower()
        if head.startswith(b"version https://git-lfs"):
            raise InputError("load.pointer", path=path)
        if head.startswith((b"<!doctype html", b"<html")):
            raise InputError("load.web_page", path=path)
    with path.open("rb") as file:
        head = file.read(16)
    for begin, (kind, suffixes, way) in BEGINNINGS.items():
        if head.startswith(begin) and suffix in ASSET_FORMATS and suffix not in suffixes:
            raise InputError("load.other", path=path, kind=kind, suffix=suffix, way=way)
    if suffix in UNREAD:
        raise InputError("load.unread", path=path, suffix=suffix, way=UNREAD[suffix])
    if suffix not in ASSET_FORMATS:
        raise InputError(
            f"{path}: unknown suffix {suffix!r}, wanted one of {', '.join(ASSET_FORMATS)}"
        )
    bytes_ = path.stat().st_size
    if bytes_ == 0:
        raise InputError(f"{path}: is empty (0 bytes): export it again")
    if bytes_ > MAX_FILE_BYTES:
        raise InputError(
            f"{path}: {bytes_} bytes, the limit is {MAX_FILE_BYTES}: simplify it first"
        )


def _check(path: Path, surface: NamedSurface) -> None:
    """Refuse what no later step could make sense of: indices, numbers, counts."""
    points, faces = surface.mesh.vertices, surface.mesh.faces
    if points.shape[1:] != (3,) or faces.shape[1:] != (3,):
        raise InputError(
            f"{path}: has points of {points.shape[-1]} coordinates and faces of {faces.shape[-1]} "
            "corners, wanted 3 and 3: export it again"
        )
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


def _joined(meshes: Sequence[trimesh.Trimesh | PlainMesh]) -> trimesh.Trimesh | PlainMesh:
    if len(meshes) == 1:
        return meshes[0]
    from trimesh.util import concatenate

    plain = (mesh.whole if isinstance(mesh, PlainMesh) else mesh for mesh in meshes)
    return concatenate(list(plain))  # type: ignore


def _grouped(surfaces: Sequence[NamedSurface], keys: Sequence[Any]) -> list[list[NamedSurface]]:
    groups: dict[Any, list[NamedSurface]] = {}
    for surface, key in zip(surfaces, keys, strict=True):
        groups.setdefault(key, []).append(surface)
    return list(groups.values())


def _is_name(name: str | None) -> bool:
    return name is not None and MADE_UP_NAME.fullmatch(name) is None


def _unique_names(groups: Sequence[Sequence[NamedSurface]], stem: str) -> list[str]:
    """The node's name where it has one part, else its material's, else both; counted if equal.

    A node without a name goes by that of its mesh.
    """
    nodes = [_first_name(group[0].node[:2]) for group in groups]
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


# Point clouds: a surface through points that came without triangles.

FEWEST, MOST = 100, 2_000_000  # points: fewer say nothing about a surface, more need no more detail
DEPTH = 8  # of the octree: 256 cells along the longest side
NEIGHBOURS = 20  # points that a normal is fitted to
TRIM = 0.01  # share of the surface's vertices with the fewest points around them that is cut away
TIME_LIMIT = 300.0  # s
# Surface farther from all points than this many times their spacing there is a guess. Clouds of
# whole bodies have none of it; of a half ball's surface, closed, the lid is a third.
FAR, SPACING_NEIGHBOUR = 3.0, 6
GUESS_TOLD, GUESS_MOST = 0.05, 0.4  # shares of the area: said as a warning, refused
# Of the size: points exactly on one sphere have no Delaunay triangulation to orient normals along.
JOGGLE = 1e-7


def reconstructed(path: Path, content: AssetContent) -> AssetContent:
    """Replace a cloud by the surface through it, by screened Poisson reconstruction."""
    cloud = np.unique(np.asarray(content.cloud, np.float64), axis=0)
    if not np.isfinite(cloud).all():
        raise InputError(f"{path}: its points have coordinates that are not finite")
    if not FEWEST <= len(cloud) <= MOST:
        raise InputError(
            f"{path}: holds no triangle, and {len(cloud)} different points: wanted triangles, or a "
            f"cloud of {FEWEST} to {MOST} points on a surface"
        )
    lo, size = cloud.min(axis=0), float(np.ptp(cloud, axis=0).max())
    joggle = np.random.default_rng(0).uniform(-JOGGLE, JOGGLE, cloud.shape)
    try:
        surface = run_guarded(
            "poisson",
            {"points": (cloud - lo) / size + joggle},
            {"depth": DEPTH, "neighbours": NEIGHBOURS, "trim": TRIM},
            time_limit=TIME_LIMIT,
        )
    except ChildFailure as failure:
        raise InputError(
            f"{path}: no surface through its {len(cloud)} points: {failure}"
        ) from failure
    if not len(surface["faces"]):
        raise InputError(f"{path}: no surface through its {len(cloud)} points")
    mesh = PlainMesh(surface["points"] * size + lo, surface["faces"])
    guess = guessed_fraction(mesh, cloud)
    if guess > GUESS_MOST:
        raise NoVolumeError(
            f"{path}: its {len(cloud)} points cover no closed surface: {guess:.0%} of the one "
            f"through them would be a guess, wanted at most {GUESS_MOST:.0%}; scan all sides, or "
            "close the surface in a modeller"
        )
    told = f"{guess:.0%} of the surface through the {len(cloud)} points is a guess: none is near"
    return content._replace(
        surfaces=[NamedSurface(mesh)],
        samples=f"{len(cloud):,} points",
        warnings=(*content.warnings, *([told] if guess > GUESS_TOLD else [])),
    )


def guessed_fraction(mesh: trimesh.Trimesh | PlainMesh, cloud: Places) -> float:
    """Share of a surface's area that lies far from all points, by their spacing there."""
    from scipy.spatial import KDTree

    tree = KDTree(cloud)
    spacing = tree.query(cloud, k=SPACING_NEIGHBOUR + 1)[0][:, -1]
    spacing = np.maximum(spacing, np.median(spacing))
    distance, nearest = tree.query(mesh.triangles_center)
    far = distance > FAR * spacing[nearest]
    return float(mesh.area_faces[far].sum() / mesh.area)


METRES: Mapping[Unit, float] = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}
