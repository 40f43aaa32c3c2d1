"""3MF: what the build lists, with units, components, materials and parts in further model files.

After the 3MF Consortium's Core Specification 1.3 and Production Extension 1.1.
"""

from __future__ import annotations

import io
import posixpath
import zipfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...converters.registry import Format, Keeps
from ...fem.errors import InputError
from ...fem.note import Note
from .formats import AssetContent, NamedSurface, References, refuse_entities

MAX_UNPACKED_BYTES = 2 * 2**30  # of an archive: more is a bomb or a scan
MOST_PIECES, DEEPEST = 10_000, 32  # objects that components repeat; levels of components
# Metres of the units that 3MF names; it means millimetres where it names none.
METRES = {
    "micron": 1e-6, "millimeter": 1e-3, "centimeter": 1e-2, "inch": 0.0254, "foot": 0.3048,
    "meter": 1.0,
}  # fmt: skip
# Name spaces of what is read, or changes no shape.
READ = ("core/", "production/", "material/", "trianglesets/")
MATTER = ("", "normal_part", "ModelPart")  # kinds of the slicers' parts
SETTINGS = ("Metadata/model_settings.config", "Metadata/Slic3r_PE_model.config")
SHAPES = {"mesh", "components", "metadatagroup", ""}  # what an object is made of; "": a remark
NOT_MATTER = ("support", "solidsupport", "other")  # types of objects
PATH = "{http://schemas.microsoft.com/3dmanufacturing/production/2015/06}path"
MODEL = "/3D/3dmodel.model"


class _Object(NamedTuple):
    """An object of a model file: a mesh, or components (path, id, matrix)."""

    name: str
    kind: str
    points: np.ndarray
    faces: np.ndarray
    material: np.ndarray  # of every face its number among the names, -1: none
    materials: tuple[str, ...]
    components: list[tuple[str, str, np.ndarray]]


def read_threemf(path: Path, data: bytes, references: References) -> AssetContent:
    """Read one surface per object and material of the build.

    Raises InputError: Where it requires an extension that is not read, or builds nothing.
    """
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        if sum(member.file_size for member in archive.infolist()) > MAX_UNPACKED_BYTES:
            raise InputError(f"{path}: unpacks to more than {MAX_UNPACKED_BYTES} bytes")
        if any(name.lower().startswith("secure/") for name in archive.namelist()):
            raise InputError("threemf.secure", path=path)
        package = _Package(path, archive)
        metres, items = package.root()
        surfaces = []
        for item in items:
            for piece in package.pieces(*item):
                surfaces.append(piece)
                if len(surfaces) > MOST_PIECES:
                    raise InputError("threemf.pieces", path=path, most=MOST_PIECES)
    warnings = []
    for kind, count in package.left.items():
        told = Note("threemf.left_out", count=count, kind=kind)
        if kind.lower().startswith("negative"):
            told = Note("threemf.hole", count=count, kind=kind)
        warnings.append(told)
    if not surfaces:
        left = "; ".join([*package.warnings, *warnings]) or "it lists no object"
        raise InputError("threemf.empty", path=path, left=left)
    return AssetContent(surfaces, metres=metres, up="z", warnings=(*package.warnings, *warnings))


THREEMF = Format(
    "3MF", (".3mf",), read=read_threemf, keeps=frozenset({Keeps.UNIT, Keeps.UP, Keeps.PARTS})
)


class _Volume(NamedTuple):
    """What a slicer says of a part of an object: of a component, or of faces ``first`` to ``last``.

    Its ``kind`` tells bodies from modifiers, supports and holes.
    """

    name: str
    kind: str
    first: int
    last: int
    part: str


class _Package:
    """The archive with the objects of its model files."""

    def __init__(self, path: Path, archive: zipfile.ZipFile) -> None:
        self.path, self.archive = path, archive
        self.names = {name.lower(): name for name in archive.namelist()}
        self.objects: dict[str, dict[str, _Object]] = {}
        self.left: Counter[str] = Counter()
        self.warnings: list[str] = []
        self.volumes = self._volumes()
        self.colours: dict[str, list[int]] = {}
        self._called: Counter[str] = Counter()

    def _xml(self, name: str) -> Any:
        from lxml import etree

        member = self.names.get(name.lstrip("/").lower())
        if member is None:
            raise InputError("threemf.missing", path=self.path, name=name)
        text = self.archive.read(member)
        refuse_entities(self.path, text)
        parser = etree.XMLParser(huge_tree=True, resolve_entities=False, no_network=True)
        return etree.fromstring(text, parser)

    def _volumes(self) -> dict[str, list[_Volume]]:
        """Names and kinds that slicers keep beside the model, by object."""
        found: dict[str, list[_Volume]] = {}
        for name in SETTINGS:
            if name.lower() not in self.names:
                continue
            for entry in self._xml(name).iter("object"):
                for part in (*entry.iterfind("part"), *entry.iterfind("volume")):
                    said = {m.get("key"): m.get("value", "") for m in part.iterfind("metadata")}
                    kind = part.get("subtype", said.get("volume_type", ""))
                    first, last = (int(part.get(key, -1)) for key in ("firstid", "lastid"))
                    volume = _Volume(said.get("name", ""), kind, first, last, part.get("id", ""))
                    found.setdefault(entry.get("id"), []).append(volume)
        return found

    def root(self) -> tuple[float, list[tuple[str, str, np.ndarray]]]:
        """Metres per unit, and what is built: file, id and place of an object."""
        name = MODEL
        if "_rels/.rels" in self.names:
            for relation in self._xml("_rels/.rels"):
                if str(relation.get("Type", "")).endswith("/3dmodel"):
                    name = posixpath.join("/", relation.get("Target", MODEL))
        model = self._xml(name)
        self._read(name, model)
        unit = model.get("unit", "millimeter").strip().lower()
        if unit not in METRES:
            raise InputError("threemf.unit", path=self.path, unit=unit)
        items = [
            (item.get(PATH) or name, item.get("objectid"), _matrix(item.get("transform")))
            for item in model.iterfind("{*}build/{*}item")
        ]
        if idle := len(model.findall("{*}build/{*}item[@printable='0']")):
            self.warnings.append(Note("threemf.idle", count=idle))
        return METRES[unit], items

    def _read(self, name: str, model: Any) -> None:
        for prefix in (model.get("requiredextensions") or "").split():
            space = model.nsmap.get(prefix, prefix)
            if not any(f"/{known}" in space for known in READ):
                raise InputError("threemf.required", path=self.path, space=space)
        names: dict[str, tuple[str, ...]] = {
            group.get("id"): tuple(base.get("name", "") for base in group)
            for group in model.iterfind("{*}resources/{*}basematerials")
        }
        for base in model.iterfind("{*}resources/{*}basematerials/{*}base"):
            colour = (base.get("displaycolor") or "").lstrip("#").ljust(8, "F")
            if len(colour) == 8:
                self.colours[base.get("name", "")] = list(bytes.fromhex(colour))
        objects = self.objects[name] = {}
        for found in model.iterfind("{*}resources/{*}object"):
            extra = {str(e.tag).partition("}")[2] for e in found.iterfind("{*}mesh/*")}
            extra -= {"vertices", "triangles", "trianglesets", ""}
            extra |= {str(e.tag).partition("}")[2] for e in found} - SHAPES
            extra |= {key.partition("}")[2] for key in found.keys() if "slicestack" in key}
            if extra:
                note = Note("threemf.dropped", names=", ".join(sorted(extra)))
                self.warnings += [note] if note not in self.warnings else []
            points = [
                (v.get("x"), v.get("y"), v.get("z"))
                for v in found.iterfind("{*}mesh/{*}vertices/{*}vertex")
            ]
            rows = [
                (t.get("v1"), t.get("v2"), t.get("v3"), t.get("pid"), t.get("p1"))
                for t in found.iterfind("{*}mesh/{*}triangles/{*}triangle")
            ]
            own = found.get("pid"), found.get("pindex")
            used = [(row[3] or own[0], row[4] if row[3] or row[4] else own[1]) for row in rows]
            known = {pair: self._material(names, *pair) for pair in set(used)}
            materials = tuple(sorted({name for name in known.values() if name}))
            objects[found.get("id")] = _Object(
                found.get("name") or found.get("partnumber") or "",
                found.get("type", "model"),
                np.array(points, dtype=np.float64).reshape(-1, 3),
                np.array([row[:3] for row in rows], dtype=np.int64).reshape(-1, 3),
                np.array([materials.index(n) if (n := known[p]) else -1 for p in used], int),
                materials,
                [
                    (c.get(PATH) or name, c.get("objectid"), _matrix(c.get("transform")))
                    for c in found.iterfind("{*}components/{*}component")
                ],
            )

    @staticmethod
    def _material(names: dict[str, tuple[str, ...]], group: str | None, row: str | None) -> str:
        listed, number = names.get(group or "", ()), int(row or 0)
        return listed[number] if 0 <= number < len(listed) else ""

    def pieces(
        self, file: str, number: str, matrix: np.ndarray, above: tuple[str, ...] = ()
    ) -> Iterator[NamedSurface]:
        """Surfaces of an object and of its components, where they are put."""
        import trimesh
        from trimesh.visual import TextureVisuals
        from trimesh.visual.material import SimpleMaterial

        file = posixpath.join("/", file)
        if len(above) > DEEPEST:
            raise InputError("threemf.deep", path=self.path)
        if file not in self.objects:
            self._read(file, self._xml(file))
        found = self.objects[file].get(number)
        if found is None:
            raise InputError("threemf.object", path=self.path, number=number, file=file)
        if found.kind in NOT_MATTER:
            self.left[found.kind] += 1
            return
        volumes = self.volumes.get(number, [])
        names = (found.name, *above)
        for path, component, place in found.components:
            inner = [v for v in volumes if v.part == component]
            if inner and inner[0].kind not in MATTER:
                self.left[inner[0].kind] += 1
                continue
            called = (inner[0].name, *names) if inner and inner[0].name else names
            yield from self.pieces(path, component, place @ matrix, called)
        if not len(found.faces):
            return
        ranges = [v for v in volumes if v.last >= 0] or [_Volume("", "", 0, len(found.faces), "")]
        points = found.points @ matrix[:3, :3] + matrix[3, :3]
        turned = found.faces[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0 else found.faces
        for volume in ranges:
            if volume.kind not in MATTER:
                self.left[volume.kind] += 1
                continue
            own = slice(volume.first, volume.last + 1)
            called = next((name for name in (volume.name, *names) if name), "")
            self._called[called] += 1
            if self._called[called] > 1:
                called = f"{called or 'body'}.{self._called[called] - 1}"
            for material in np.unique(found.material[own]).tolist():
                faces = turned[own][found.material[own] == material]
                mesh = trimesh.Trimesh(points, faces, process=False, validate=False)
                label = found.materials[material] if material >= 0 else None
                if label in self.colours:
                    look = SimpleMaterial(name=label, diffuse=self.colours[label])
                    mesh.visual = TextureVisuals(material=look)
                yield NamedSurface(mesh, (called, *names), label)


def _matrix(text: str | None) -> np.ndarray:
    """Matrix (4, 4) of a transform, for rows: (p', 1) = (p, 1) M."""
    matrix = np.eye(4)
    if text:
        matrix[:, :3] = np.array(text.split(), dtype=np.float64).reshape(4, 3)
    return matrix
