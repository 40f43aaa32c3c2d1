"""Our own .npz: a material field or a tet mesh with units and version, no pickles.

Arrays carry the names of the project; ``meta`` is a JSON document with kind, version, units and
names. ``origin`` is the lower corner of cell (0, 0, 0) and ``spacing`` the edge of a cell [m].
"""

from __future__ import annotations

import json
import os
import zipfile
from dataclasses import fields

import numpy as np

from ..fem.errors import InputError
from ..fem.material import material_arrays, material_from
from ..fem.mesh import TetMesh
from ..fem.note import Note
from ..predictors.field import MaterialField, Ranges
from ..predictors.grid import Grid
from .files import reading, writing

VERSION = 1
UNITS = {"E": "Pa", "nu": "1", "rho": "kg/m^3", "points": "m", "origin": "m", "spacing": "m"}
WANTED = Note("npz.npz_file")
# A compressed archive may announce more than a machine holds: 16 GiB is a 512^3 field and more.
MAX_BYTES = 1 << 34


def load_npz(path: str | os.PathLike, *, max_bytes: int = MAX_BYTES) -> dict[str, np.ndarray]:
    """Load every array of an .npz file; pickles and archives above ``max_bytes`` are refused."""
    with reading(path, WANTED) as source:
        with zipfile.ZipFile(source) as archive:
            size = sum(member.file_size for member in archive.infolist())
        if size > max_bytes:
            raise InputError("npz.unpacks_bytes", path=path, size=size, max_bytes=max_bytes)
        with np.load(source, allow_pickle=False) as arrays:  # noqa: TID251 - the one place
            return {name: arrays[name] for name in arrays.files}


def save_npz(path: str | os.PathLike, **arrays: np.ndarray) -> None:
    """Save named arrays, compressed, all or nothing; an array of objects is refused."""
    if objects := [name for name, array in arrays.items() if np.asarray(array).dtype.hasobject]:
        raise InputError("npz.arrays_python", objects=objects)
    with writing(path) as target, target.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **arrays)


def save(path: str | os.PathLike, value: MaterialField | TetMesh) -> None:
    """Save a material field or a tet mesh; ``load`` gives it back exactly, a grain to round-off."""
    if isinstance(value, MaterialField):
        arrays = {"origin": value.grid.lo, "spacing": np.array(value.grid.h)}
        for name in ("occupied", "E", "nu", "rho", "part", "material"):
            if (array := getattr(value, name)) is not None:
                arrays[name] = array
        if value.ranges is not None:
            arrays |= {f"range_{name}": array for name, array in value.ranges._asdict().items()}
        meta = {
            "bounds": np.stack([value.grid.lo, value.grid.hi]).tolist(),
            "alpha": value.alpha,
            "part_names": value.part_names,
            "material_names": value.material_names,
        }
    else:
        arrays = {"points": value.points, "tets": value.tets, "region": value.region}
        arrays |= material_arrays(value.material)
        meta = {"region_names": value.region_names, "bounds": value.bounds.tolist()}
    meta |= {"version": VERSION, "units": {n: u for n, u in UNITS.items() if n in arrays}}
    save_npz(path, **arrays, meta=np.array(json.dumps({"kind": type(value).__name__} | meta)))


def load(path: str | os.PathLike) -> MaterialField | TetMesh:
    """Load what ``save`` wrote, checked as on construction."""
    arrays = load_npz(path)
    with reading(path, Note("npz.field_mesh")) as source:
        if "meta" not in arrays:
            raise InputError("npz.entry_meta", source=source, arrays=sorted(arrays))
        meta = json.loads(str(arrays.pop("meta")))
        kind, version = meta.get("kind"), meta.get("version")
        if version != VERSION:
            raise InputError(
                "npz.version_package", source=source, version=version, version_2=VERSION
            )
        if kind not in ("MaterialField", "TetMesh"):
            raise InputError("npz.holds_wanted", source=source, kind=kind)
        if kind == "TetMesh":
            return TetMesh(
                arrays["points"],
                arrays["tets"],
                arrays["region"],
                region_names=tuple(meta["region_names"]),
                material=material_from(arrays),
            )
        ranges = None
        if "range_E" in arrays:
            ranges = Ranges(*(arrays[f"range_{name}"] for name in Ranges._fields))
        shape: tuple[int, int, int] = arrays["occupied"].shape
        names = {field.name for field in fields(MaterialField)}
        return MaterialField(
            grid=Grid(arrays["origin"], float(arrays["spacing"]), shape),
            ranges=ranges,
            alpha=meta["alpha"],
            part_names=tuple(meta["part_names"]),
            material_names=tuple(meta["material_names"]),
            **{name: array for name, array in arrays.items() if name in names},
        )
