"""What trimesh reads of a file: its surfaces in their places, with the names around them."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...converters.points.gaussians import sound_splats
from ...converters.points.ply import listed, parse_ply, ply_points
from ...converters.points.table import PointTable, read_points
from ...converters.registry import Format, Keeps
from ...fem.errors import InputError
from ...fem.note import Note
from ...predictors.asset import PlainMesh, UpAxis
from .formats import AssetContent, NamedSurface, References, decoded, stated_metres

if TYPE_CHECKING:
    from ...converters.points.views import Pruning


# OFF with polygons of any size and per-face colours; the keyword may be missing.


def read_off(path: Path, data: bytes, references: References) -> AssetContent:
    """Read one surface, its polygons cut into fans of triangles."""
    text = data.decode("utf-8-sig", errors="replace")
    lines = [line.split("#")[0].split() for line in text.splitlines()]
    words = [line for line in lines if line]
    kind = re.fullmatch(r"(ST)?(?:C?N?|NC)(4|n)?OFF", words[0][0])  # MeshLab's are NC
    if "BINARY" in words[0] or (kind and kind[2]):
        raise InputError("readers.off", path=path, kind=" ".join(words[0][:2]))
    if kind:
        words[0] = words[0][1:]
        words = [line for line in words if line]
    elif not words[0][0].isdigit():
        raise ValueError(f"starts with {words[0][0][:20]!r}")
    vertices, faces = (int(n) for n in words[0][:2])
    if vertices + faces > len(words) - 1 and not (kind and kind[0] != "OFF"):
        # Not a line each: plain points and polygons one after the other
        flat = [word for line in words for word in line][3:]
        words = [words[0], *(flat[3 * i : 3 * i + 3] for i in range(min(vertices, len(flat) // 3)))]
        at = 3 * vertices
        while at < len(flat) and len(words) <= vertices + faces:
            end = at + 1 + int(flat[at])
            words.append(flat[at:end])
            at = end
    if vertices + faces > len(words) - 1:
        raise InputError("readers.off_cut", path=path, vertices=vertices, faces=faces)
    points = np.array([[float(x) for x in w[:3]] for w in words[1 : vertices + 1]])
    polygons = words[vertices + 1 : vertices + faces + 1]
    if any(int(w[0]) >= len(w) for w in polygons):
        raise ValueError("a face announces more corners than it has")
    corners = [[int(i) for i in w[1 : int(w[0]) + 1]] for w in polygons]
    fans = [(p[0], p[i], p[i + 1]) for p in corners for i in range(1, len(p) - 1)]
    triangles = np.array(fans, dtype=np.int64).reshape(-1, 3)
    mesh = PlainMesh(points.reshape(-1, 3), triangles)
    return AssetContent(
        [NamedSurface(mesh)] if len(triangles) else [], cloud=points if len(points) else None
    )


OFF = Format("OFF", (".off",), read=read_off)


# STL, text and binary: triangles without a unit, unless the header tells.

_FACET = re.compile(rb"\bfacet\b|\bendsolid\b", re.IGNORECASE)
_VERTEX = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)
_SOLID = re.compile(rb"^[ \t]*(end)?solid\b[ \t]*([^\r\n]*)", re.IGNORECASE | re.MULTILINE)
_CRAMPED = re.compile(rb"\s+(?=(?:facet|(?:end)?solid)\b)", re.IGNORECASE)
STL_HEADER, STL_TRIANGLE = 84, 50  # bytes
BOM = b"\xef\xbb\xbf"  # of UTF-8, which editors put before a text


def read_stl(path: Path, data: bytes, references: References) -> AssetContent:
    """Read one surface, or several named solids of a text file.

    Raises InputError: Where the file is cut short.
    """
    data = data.removeprefix(BOM)
    metres = stated_metres(data[:256].decode("ascii", "replace"))
    found: list[tuple[str, np.ndarray]] = []
    warnings = []
    announced = int.from_bytes(data[80:STL_HEADER], "little")
    binary = len(data) == STL_HEADER + STL_TRIANGLE * announced  # whatever the header says
    if not binary and data.lstrip()[:5].lower() == b"solid" and _FACET.search(data[:4096]):
        if b"\n" not in data.strip():  # one line, or lines that end in \r alone
            data = _CRAMPED.sub(b"\n", data.replace(b"\r", b"\n"))
        marks = [(m.start(), m[1] is None, m[2].decode("utf-8", "replace").strip())
                 for m in _SOLID.finditer(data)]  # fmt: skip
        begins = [(at, name) for at, begin, name in marks if begin]
        for (at, name), (end, _) in zip(begins, [*begins[1:], (len(data), "")], strict=True):
            corners = _VERTEX.findall(data, at, end)
            if any(b"," in word for word in sum(corners[:3], ())):
                raise InputError("readers.stl_commas", path=path)
            if len(corners) % 3:
                raise InputError("readers.stl_cut", path=path, count=len(corners) // 3)
            found.append((name, np.array(corners, dtype="S").astype(np.float64)))
        if marks and marks[-1][1]:  # no endsolid
            if not re.search(rb"endfacet\s*$", data, re.IGNORECASE):
                raise InputError("readers.stl_cut", path=path, count=len(found[-1][1]) // 3)
            warnings.append(Note("readers.stl_end"))
    elif len(data) >= STL_HEADER:
        there, rest = divmod(len(data) - STL_HEADER, STL_TRIANGLE)
        if announced > there:
            raise InputError("readers.stl_announced", path=path, announced=announced, there=there)
        # A count that was never filled in, or that of an earlier state, before whole triangles
        count = there if announced == 0 or rest == 0 else announced
        if announced < count:
            warnings.append(Note("readers.stl_count", announced=announced, there=there))
        if left := len(data) - STL_HEADER - STL_TRIANGLE * count:
            warnings.append(Note("readers.stl_tail", left=left))
        row = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
        rows: Any = np.frombuffer(data, row, count, STL_HEADER)
        found.append(("", rows["corners"].reshape(-1, 3).astype(np.float64)))
    surfaces, names = [], Counter[str]()
    for name, corners in found:
        if len(corners):
            own = f"{name}.{names[name]}" if names[name] else name
            names[name] += 1
            mesh = PlainMesh(corners, np.arange(len(corners)).reshape(-1, 3))
            surfaces.append(NamedSurface(mesh, (own, name) if len(found) > 1 else ()))
    return AssetContent(surfaces, metres=metres, warnings=tuple(warnings))


STL = Format("STL", (".stl",), read=read_stl, keeps=frozenset({Keeps.PARTS}))


# Carriers as assets: the surface of splats or of a density grid, the points of a cloud.


def read_carrier(path: Path, data: bytes, references: References) -> AssetContent:
    """Read splats and density grids as one closed surface, a cloud as its finite points.

    Our own archive of a density grid is metres by contract; nothing else names its unit.
    """
    from ...converters.transfer import is_density

    if not is_density(path):
        up = "y" if path.suffix.lower() == ".spz" else "-y"  # its specification says y up
        return points_content(read_points(path), references.pruning, up=up)
    from ...converters.grids import density_surface, read_density

    grid = read_density(path)
    surface = NamedSurface(density_surface(grid))
    cells = " × ".join(map(str, grid.density.shape))
    metres = 1.0 if path.suffix.lower() == ".npz" else None
    return AssetContent([surface], metres=metres, samples=f"a grid of {cells} cells")


def points_content(
    table: PointTable, pruning: Pruning | None, *, up: UpAxis = "-y"
) -> AssetContent:
    """Surface through splats, or the finite points of a cloud.

    y points down in COLMAP, by whose cameras most splats are trained.
    """
    if table.is_splat:
        sound, warnings = sound_splats(table)
        if not sound.any():
            raise InputError("readers.no_splats", count=len(table))
        from ...converters.points.views import Pruning, splat_body

        surface, told = splat_body(table.only(sound), pruning or Pruning())
        samples = f"{int(sound.sum()):,} Gaussians"
        notes = (*warnings, *told)
        return AssetContent([NamedSurface(surface)], up_guess=up, samples=samples, warnings=notes)
    finite = np.isfinite(table.positions).all(axis=1)
    lost = int((~finite).sum())
    warnings = (Note("readers.not_finite", lost=lost, count=len(table)),) if lost else ()
    return AssetContent([], cloud=table.positions[finite], warnings=warnings)


_SPLATS, _CLOUDS = (".splat", ".spz", ".ksplat"), (".pcd", ".las", ".laz", ".xyz")
_GRIDS = (".npz", ".nvdb", ".ingp", ".msgpack", ".pt", ".pth", ".ckpt", ".safetensors")
CARRIER = Format("splats, cloud or density grid", (*_SPLATS, *_GRIDS, *_CLOUDS), read=read_carrier)


# PLY as an asset: polygons, triangle strips, Gaussian splats, or points alone.


def read_ply_surface(path: Path, data: bytes, references: References) -> AssetContent:
    """Read polygons as fans, strips as triangles; of a file without both its points."""
    ply = parse_ply(data, surface=True)
    table = ply_points(ply)
    if table.is_splat:
        return points_content(table, references.pruning)
    faces, skin, colours = [np.zeros((0, 3), np.int64)], [], []
    lists = listed(ply)
    for rows in lists.get("face", ()):
        corners = rows.values.get("vertex_indices", rows.values.get("vertex_index"))
        if corners is None:
            raise InputError(f"{path}: its faces list no vertex_indices, got {[*rows.values]}")
        count = corners.shape[1]
        fan = np.array([(0, i, i + 1) for i in range(1, count - 1)], dtype=np.int64).reshape(-1, 3)
        faces.append(corners.astype(np.int64)[:, fan].reshape(-1, 3))
        places = rows.values.get("texcoord")
        if places is not None and places.shape[1] == 2 * count:
            skin.append(places.reshape(-1, count, 2)[:, fan].reshape(-1, 2))
        if "red" in rows.values:
            own = np.column_stack([rows.values[name] for name in ("red", "green", "blue")])
            colours.append(np.repeat(own, len(fan), axis=0))
    for rows in lists.get("tristrips", ()):  # -1 ends a strip within a row
        for row in np.concatenate([*rows.values.values()], axis=1).astype(np.int64):
            ends = np.flatnonzero(row < 0)
            strips = [strip[strip >= 0] for strip in np.split(row, ends)]
            strips = [strip for strip in strips if len(strip) > 2]
            if strips:
                from trimesh.util import triangle_strips_to_faces

                faces.append(triangle_strips_to_faces(strips))
    points, faces = table.positions, np.concatenate(faces)
    metres = next(filter(None, map(stated_metres, ply.comments)), None)
    if not len(faces):
        return points_content(table, references.pruning)
    mesh = PlainMesh(points, faces)
    channels = [table.columns[name] for name in ("red", "green", "blue") if name in table.columns]
    image = _ply_texture(ply.comments, references)
    uv = [table.columns[name] for name in UV if name in table.columns][:2]
    if image is not None and (sum(map(len, skin)) == 3 * len(faces) or len(uv) == 2):
        from trimesh.visual import TextureVisuals
        from trimesh.visual.material import SimpleMaterial

        if len(uv) == 2:
            places = np.column_stack(uv)
        else:  # places of the corners of faces: a vertex for each
            flat = np.arange(3 * len(faces)).reshape(-1, 3)
            mesh = PlainMesh(points[faces].reshape(-1, 3), flat)
            places = np.concatenate(skin)
        mesh.whole.visual = TextureVisuals(uv=places, material=SimpleMaterial(image=image))
    elif len(channels) == 3:
        mesh.visual.vertex_colors = np.column_stack(channels)
    elif sum(map(len, colours)) == len(faces):
        mesh.visual.face_colors = np.concatenate(colours)
    return AssetContent([NamedSurface(mesh)], metres=metres)


UV = ("s", "t", "u", "v", "texture_u", "texture_v")  # names of places in a texture


def _ply_texture(comments: Sequence[str], references: References) -> Any:
    """Picture that a comment names, as MeshLab and others write it; None where there is none."""
    for comment in comments:
        key, _, name = comment.partition(" ")
        if key.lower() == "texturefile" and name.strip():
            try:
                return decoded(references.get(name), None, references)
            except FileNotFoundError:  # told by the references
                return None
    return None


PLY_SURFACE = Format("PLY surface, splats or cloud", (".ply",), read=read_ply_surface)
