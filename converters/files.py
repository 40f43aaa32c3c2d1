"""Files at the border: guarded reading, and writing that leaves no half-written output."""

from __future__ import annotations

import json
import os
import re
import secrets
import shutil
import struct
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import fields
from pathlib import Path

import numpy as np

from ..fem.errors import AutophyxError, InputError
from ..fem.material import material_arrays, material_from
from ..fem.mesh import TetMesh
from ..fem.note import Note
from ..predictors.field import MaterialField, Ranges
from ..predictors.grid import Grid

UNFINISHED = ".tmp-"  # begins the name of a file while it is being written
UNFINISHED_LIST = "AUTOPHYX_TET_UNFINISHED"  # variable: a file that lists them for who cleans up


@contextmanager
def reading(path: str | os.PathLike, wanted: str) -> Iterator[Path]:
    """Yield ``path`` once it is known to be a non-empty file.

    Whatever a parser raises in the block becomes an ``InputError`` that names the file and what
    was ``wanted`` of it: a foreign parser meets hostile bytes with any exception there is.
    """
    path = Path(path)
    if not path.exists():
        raise InputError("files.such_file", path=path, wanted=wanted)
    if not path.is_file():
        raise InputError("files.file_wanted", path=path, wanted=wanted)
    try:
        if path.stat().st_size == 0:
            raise InputError("files.empty_bytes", path=path, wanted=wanted)
        yield path
    except AutophyxError as error:
        if str(path) in str(error):
            raise
        raise type(error)(f"{path}: {error}") from error
    except Exception as error:
        reason = str(error) or type(error).__name__
        raise InputError("files.cannot_read", path=path, reason=reason, wanted=wanted) from error


@contextmanager
def writing(path: str | os.PathLike) -> Iterator[Path]:
    """Yield a temporary path beside ``path``; rename it on success, delete it on failure.

    A failed or interrupted write leaves whatever was there before.
    """
    path = Path(path)
    temporary = _unfinished(path.parent, path.suffix)
    try:
        yield temporary
        temporary.replace(path)
    except OSError as error:
        raise _unwritable(path, error) from error
    finally:
        discard(temporary)


@contextmanager
def writing_folder(folder: str | os.PathLike) -> Iterator[Path]:
    """Yield a temporary folder inside ``folder``; on success its files move there, oldest first.

    A failed or interrupted write leaves whatever was there before; ``folder`` itself may be new.
    """
    folder = Path(folder)
    with holding(folder):
        temporary = _unfinished(folder)
        try:
            temporary.mkdir()
            yield temporary
            files = [path for path in temporary.rglob("*") if path.is_file()]
            for file in sorted(files, key=lambda path: path.stat().st_mtime_ns):
                target = folder / file.relative_to(temporary)
                target.parent.mkdir(parents=True, exist_ok=True)
                file.replace(target)
        except OSError as error:
            raise _unwritable(folder, error) from error
        finally:
            discard(temporary)


@contextmanager
def holding(folder: str | os.PathLike) -> Iterator[None]:
    """Make a folder for the time of a block; what is empty at its end goes again."""
    folder = Path(folder).absolute()
    new = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        for path in reversed(new):
            _listed(path)
            path.mkdir(exist_ok=True)
        yield
    except OSError as error:
        raise _unwritable(folder, error) from error
    finally:
        for path in new:
            discard(path)


@contextmanager
def alone(folder: str | os.PathLike) -> Iterator[None]:
    """Hold a folder for this process, and no other one, for the time of a block.

    Raises InputError: Where another process holds it, or it cannot be made.
    """
    import fcntl

    with holding(folder):
        lock = os.open(folder, os.O_RDONLY)  # of the folder itself: no file that stays behind
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            os.close(lock)
            raise InputError("files.another_run", folder=folder) from error
        try:
            yield
        finally:
            os.close(lock)


def discard(path: str | os.PathLike) -> None:
    """Remove an unfinished file or folder, or another folder if it is empty."""
    path = Path(path)
    with suppress(OSError):  # gone already: renamed, or it never was there
        if not path.name.startswith(UNFINISHED):
            path.rmdir()
        elif path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()


def _unfinished(folder: Path, suffix: str = "") -> Path:
    return _listed(folder / f"{UNFINISHED}{secrets.token_hex(6)}{suffix}")


def _listed(path: Path) -> Path:
    """Put a path on the list of who removes it where this process is killed meanwhile."""
    if listed := os.environ.get(UNFINISHED_LIST):
        with suppress(OSError), open(listed, "a", encoding="utf-8") as names:
            names.write(f"{path.absolute()}\n")
    return path


def _unwritable(path: Path, error: OSError) -> InputError:
    return InputError("files.cannot_write", path=path, strerror=error.strerror or error)


# Counts that a file announces, held against its size before a parser allocates for them.

# A keyword and the counts after it, in legacy VTK, Medit and Gmsh files; of VTK's fields the
# counts stand before their type. Whatever is counted takes a byte at least.
_ANNOUNCED = re.compile(
    rb"(?:^|[\r\n])[ \t]*(?:(?:POINTS|CELLS|CELL_TYPES|POINT_DATA|CELL_DATA|Vertices|Edges"
    rb"|Triangles|Quadrilaterals|Tetrahedra|Hexahedra|Prisms|Pyramids|\$Nodes|\$Elements)"
    rb"\s+(\d+)(?:[ \t]+(\d+))?|\S+[ \t]+(\d+)[ \t]+(\d+)[ \t]+(?:float|double|vtktypeint64|int"
    rb"|long|short|char|unsigned_char|unsigned_int|unsigned_long)\b)"
)
VLR_BYTES, EVLR_BYTES = 54, 60  # least of a variable length record of LAS, and of an extended one
LAZ_MOST = 4096  # times that LAZ may shrink points: equal points pack about a thousandfold


def check_counts(path: Path) -> None:
    """Refuse a mesh file that announces more of something than it has bytes."""
    data = path.read_bytes()
    for found in _ANNOUNCED.finditer(data):
        for count in found.groups():
            if count is not None and int(count) > len(data):
                raise InputError(
                    "files.announces_something",
                    path=path,
                    decode=count.decode()[:20],
                    count=len(data),
                )


def check_las(path: Path) -> None:
    """Refuse a LAS or LAZ file whose header announces more records or points than can be there."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(375)
    if len(head) < 227 or head[:4] != b"LASF":
        raise InputError("files.start_like", path=path)
    start, records, kind, width, points = struct.unpack_from("<IIBHI", head, 96)
    extended = 0
    if head[25] >= 4 and len(head) == 375:  # LAS 1.4 counts in 64 bits
        extended, points = struct.unpack_from("<IQ", head, 243)
    packed = LAZ_MOST if kind >= 128 else 1
    for what, need in (
        (Note("files.variable_length"), records * VLR_BYTES),
        ("extended records", extended * EVLR_BYTES),
        (Note("files.bytes_before"), start),
        (Note("files.bytes_points"), points * width // packed),
    ):
        if need > size:
            raise InputError("files.announces_bytes", path=path, need=need, what=what, size=size)


# Our own .npz: a material field or a tet mesh with units and version, no pickles.
#
# Arrays carry the names of the project; ``meta`` is a JSON document with kind, version, units and
# names. ``origin`` is the lower corner of cell (0, 0, 0) and ``spacing`` the edge of a cell [m].

VERSION = 1
UNITS = {"E": "Pa", "nu": "1", "rho": "kg/m^3", "points": "m", "origin": "m", "spacing": "m"}
WANTED = Note("files.npz_file")
# A compressed archive may announce more than a machine holds: 16 GiB is a 512^3 field and more.
MAX_BYTES = 1 << 34


def load_npz(path: str | os.PathLike, *, max_bytes: int = MAX_BYTES) -> dict[str, np.ndarray]:
    """Load every array of an .npz file; pickles and archives above ``max_bytes`` are refused."""
    with reading(path, WANTED) as source:
        with zipfile.ZipFile(source) as archive:
            size = sum(member.file_size for member in archive.infolist())
        if size > max_bytes:
            raise InputError("files.unpacks_bytes", path=path, size=size, max_bytes=max_bytes)
        with np.load(source, allow_pickle=False) as arrays:  # noqa: TID251 - the one place
            return {name: arrays[name] for name in arrays.files}


def save_npz(path: str | os.PathLike, **arrays: np.ndarray) -> None:
    """Save named arrays, compressed, all or nothing; an array of objects is refused."""
    if objects := [name for name, array in arrays.items() if np.asarray(array).dtype.hasobject]:
        raise InputError("files.arrays_python", objects=objects)
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
    with reading(path, Note("files.field_mesh")) as source:
        if "meta" not in arrays:
            raise InputError("files.entry_meta", source=source, arrays=sorted(arrays))
        meta = json.loads(str(arrays.pop("meta")))
        kind, version = meta.get("kind"), meta.get("version")
        if version != VERSION:
            raise InputError(
                "files.version_package", source=source, version=version, version_2=VERSION
            )
        if kind not in ("MaterialField", "TetMesh"):
            raise InputError("files.holds_wanted", source=source, kind=kind)
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
