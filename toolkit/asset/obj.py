"""OBJ: polygons of objects, groups and materials, by one tokenizer.

After Wavefront's "Object Files (.obj)", appendix B1 of the Advanced Visualizer manual.
"""

from __future__ import annotations

import codecs
import re
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...converters.registry import Format, Keeps
from ...fem.errors import InputError
from ...fem.note import Note
from ...predictors.asset import PlainMesh
from .formats import AssetContent, NamedSurface, References, decoded, stated_metres

# Free-form curves and surfaces: the statements that end one.
FREE_FORM = {"curv", "curv2", "surf", "cstype", "bzp", "bsp", "cdc", "cdp"}
COMMENT = re.compile(r"(?:^|\s)#.*")  # a name may hold the sign
HANZI = re.compile(
    rb"(?:[\xb0-\xf7][\xa1-\xfe])+"
)  # pairs of bytes of the common characters of GBK
HIGH = re.compile(rb"[\x80-\xff]+")


class _Piece(NamedTuple):
    """Whose a face is: number and name of the object, its group, its material."""

    number: int
    object: str
    group: str
    material: str | None


def read_obj(path: Path, data: bytes, references: References) -> AssetContent:
    """Read one surface per object, group and material; of a file without faces its points.

    Raises InputError: Where numbers have decimal commas, or a face names what is not there.
    """
    text, encoding = _text(data)
    warnings: list[str] = []
    rows: dict[str, list[list[str]]] = {"v": [], "vt": []}
    # Of every piece its faces, and how many vertices and places stood before each
    pieces: dict[_Piece, tuple[list[list[str]], list[tuple[int, int]]]] = {}
    piece, objects, libraries = _Piece(0, "", "", None), 0, []
    ignored = Counter[str]()
    own = metres = None
    for line in text.split("\n"):
        words = (COMMENT.sub("", line) if "#" in line else line).split()
        if line[:1] == "#" and metres is None:
            metres = stated_metres(line)
        if not words:
            continue
        key, *rest = words
        key = key.lower()
        if key in rows:
            rows[key].append(rest)
        elif key in ("f", "fo"):
            own = own or pieces.setdefault(piece, ([], []))
            own[0].append(rest)
            own[1].append((len(rows["v"]), len(rows["vt"])))
        elif key in ("o", "g", "usemtl"):
            name, own = " ".join(rest), None
            if key == "o":
                objects += 1
                piece = _Piece(objects, name, "", piece.material)
            else:
                given: dict[str, Any] = (
                    {"group": name} if key == "g" else {"material": name or None}
                )
                piece = piece._replace(**given)
        elif key == "mtllib":
            libraries.append(line.split(None, 1)[1].strip())
        elif key in FREE_FORM or key == "l":
            ignored[key] += 1
    if names := sorted(ignored.keys() & FREE_FORM):
        warnings.append(Note("obj.free_form", names=", ".join(names)))
    if ignored["l"]:
        warnings.append(Note("obj.lines", count=ignored["l"]))
    points, colours = _table(path, rows["v"], 3)
    uv, _ = _table(path, rows["vt"], 2)
    if encoding and pieces:  # without any it is no reason
        warnings.append(Note("obj.encoding", encoding=encoding))
    materials = _materials(libraries, references)
    surfaces = []
    for (piece, (faces, starts)), names in zip(pieces.items(), _names(pieces), strict=True):
        corners = _corners(path, faces, np.array(starts), (len(points), len(uv)))
        # A vertex for every pair of a point and a place
        key, index = np.unique(corners @ [len(uv) + 1, 1] + 1, return_inverse=True)
        used, place = np.divmod(key, len(uv) + 1)
        mesh = PlainMesh(points[used], index.reshape(-1, 3))
        look = materials.get(piece.material or "", None)
        if piece.material is not None and (look or colours is None):
            from trimesh.visual import TextureVisuals
            from trimesh.visual.material import SimpleMaterial

            skinned = len(uv) > 0 and bool((place > 0).all())
            mesh.whole.visual = TextureVisuals(
                uv=uv[place - 1] if skinned else None,
                material=SimpleMaterial(**(look or {"name": piece.material})),
            )
        elif colours is not None:
            mesh.visual.vertex_colors = colours[used]
        surfaces.append(NamedSurface(mesh, names, piece.material))
    cloud = points if len(points) and not surfaces and not ignored else None
    known: dict[str, Any] = {"metres": metres, "cloud": cloud, "warnings": tuple(warnings)}
    return AssetContent(surfaces, up_guess="y", **known)


OBJ = Format("OBJ", (".obj",), read=read_obj, keeps=frozenset({Keeps.PARTS}))


def _text(data: bytes) -> tuple[str, str]:
    """Lines of a file, each whole and ended by one mark, and their encoding if it is a guess."""
    encoding = ""
    if data[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
        data = data.decode("utf-16", errors="replace").encode()
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        high = HIGH.findall(data)
        encoding = "gb18030" if all(HANZI.fullmatch(run) for run in high) else "cp1252"
        text = data.decode(encoding, errors="replace")
    return text.replace("\r\n", "\n").replace("\r", "\n").replace("\\\n", " "), encoding


def _table(path: Path, rows: list[list[str]], width: int) -> tuple[np.ndarray, np.ndarray | None]:
    """The first ``width`` numbers of every row, and three colours behind them if all have them."""
    if not rows:
        return np.zeros((0, width)), None
    least = min(map(len, rows))
    try:
        table = np.array([row[: 6 if least >= 6 else width] for row in rows], dtype=np.float64)
    except ValueError as error:
        if any("," in word for row in rows for word in row):
            raise InputError("obj.commas", path=path) from error
        raise
    if table.shape[1] < width:
        raise ValueError(f"a vertex of {least} numbers")
    colours = table[:, 3:6] if width == 3 and least >= 6 else None
    if colours is not None and colours.max() > 1:
        colours = colours / 255
    return table[:, :width], colours


def _corners(
    path: Path, faces: list[list[str]], counts: np.ndarray, sizes: tuple[int, int]
) -> np.ndarray:
    """Vertex and place in the texture, or -1, of the corners of triangles (n, 3, 2) from 0 on.

    A polygon is cut into a fan. Negative indices count back from their own line, before which there
    were ``counts`` (faces, 2) vertices and places.
    """
    triangles = []
    number = np.array([len(face) for face in faces])
    for many in np.unique(number[number > 2]):
        rows = np.flatnonzero(number == many)
        words = [word for row in rows for word in faces[row]]
        kinds = {word.count("/") + 10 * ("//" in word) for word in words}
        if kinds <= {0} or kinds == {1} or kinds == {2}:  # all alike
            flat = np.array("/".join(words).split("/"), dtype=np.int64).reshape(len(words), -1)
            pairs = flat[:, :2] if flat.shape[1] > 1 else np.column_stack([flat, 0 * flat])
        else:
            split = [[*word.split("/"), ""][:2] for word in words]
            pairs = np.array([[int(v), int(t or 0)] for v, t in split])
        pairs = pairs.reshape(len(rows), many, 2)
        pairs = np.where(pairs < 0, pairs + counts[rows][:, None], pairs - 1)
        for i, what in ((0, "vertex"), (1, "place")):
            column = pairs[..., i]
            if column.min() < (0 if i == 0 else -1) or column.max() >= sizes[i]:
                raise InputError("obj.index", path=path, what=what, count=sizes[i])
        fan = np.array([(0, i, i + 1) for i in range(1, many - 1)])
        triangles.append(pairs[:, fan].reshape(-1, 3, 2))
    return np.concatenate(triangles) if triangles else np.zeros((0, 3, 2), np.int64)


def _names(pieces: dict[_Piece, Any]) -> list[tuple[str, ...]]:
    """Names around every piece, its own first: of the group where its object has several.

    Objects are told apart by their order, groups of one object by their names.
    """
    groups = Counter(number for number, _ in {(p.number, p.group) for p in pieces})
    own: dict[tuple[int, str], str] = {}
    taken: Counter[str] = Counter()
    for piece in pieces:
        key = piece.number, piece.group
        if key not in own:
            name = piece.group if groups[piece.number] > 1 and piece.group else piece.object
            name = name or piece.group
            if taken[name] and name != piece.object and piece.object:
                name = f"{piece.object} {name}"
            own[key] = f"{name}.{taken[name]}" if taken[name] else name
            taken[name] += 1
    return [(own[p.number, p.group], p.object, p.group) for p in pieces]


# Options of a texture, before its name, which may have blanks: -s 1 1 1, -bm .5, -clamp on.
_MAP_OPTIONS = re.compile(
    rb"(?im)^(\s*map_kd)(?:[ \t]+-(?:[ost](?:[ \t]+[-+\d.e]+(?=[ \t])){1,3}|mm[ \t]+\S+[ \t]+\S+"
    rb"|\w+[ \t]+\S+))+"
)


def _materials(libraries: list[str], references: References) -> dict[str, dict[str, Any]]:
    """Materials of the libraries by name; those that are missing are told by the references."""
    found: dict[str, dict[str, Any]] = {}
    for library in dict.fromkeys(libraries):
        from trimesh.exchange.obj import parse_mtl

        try:
            text = _MAP_OPTIONS.sub(rb"\1", references.get(library))
            found |= parse_mtl(text, resolver=references)
        except FileNotFoundError:
            continue
    for name, material in found.items():
        if "image" in material:
            material["image"] = decoded(material["image"], name, references)
    return found
