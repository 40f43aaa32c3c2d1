"""Files at the border: guarded reading, and writing that leaves no half-written output."""

from __future__ import annotations

import os
import re
import secrets
import shutil
import struct
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ..fem.errors import AutophyxError, InputError
from ..fem.note import Note

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

# A keyword of Medit and Gmsh files and the counts after it: what is counted takes a byte at least.
_ANNOUNCED = re.compile(
    rb"(?:^|[\r\n])[ \t]*(?:Vertices|Edges|Triangles|Quadrilaterals|Tetrahedra|Hexahedra|Prisms"
    rb"|Pyramids|\$Nodes|\$Elements)\s+(\d+)(?:[ \t]+(\d+))?"
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
