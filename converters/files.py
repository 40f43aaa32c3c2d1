"""Files at the border: guarded reading, and writing that leaves no half-written output."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ..fem.errors import AutophyxError, InputError

UNFINISHED = ".tmp-"  # begins the name of a file while it is being written


@contextmanager
def reading(path: str | os.PathLike, wanted: str) -> Iterator[Path]:
    """Yield ``path`` once it is known to be a non-empty file.

    Whatever a parser raises in the block becomes an ``InputError`` that names the file and what
    was ``wanted`` of it: a foreign parser meets hostile bytes with any exception there is.
    """
    path = Path(path)
    if not path.exists():
        raise InputError(f"no such file: {path}; wanted {wanted}")
    if not path.is_file():
        raise InputError(f"{path} is not a file; wanted {wanted}")
    try:
        if path.stat().st_size == 0:
            raise InputError(f"{path} is empty (0 bytes); wanted {wanted}")
        yield path
    except AutophyxError as error:
        if str(path) in str(error):
            raise
        raise type(error)(f"{path}: {error}") from error
    except Exception as error:
        reason = str(error) or type(error).__name__
        raise InputError(
            f"cannot read {path}: {reason}; wanted {wanted}, is it cut short?"
        ) from error


@contextmanager
def writing(path: str | os.PathLike) -> Iterator[Path]:
    """Yield a temporary path beside ``path``; rename it on success, delete it on failure.

    A failed or interrupted write leaves whatever was there before.
    """
    path = Path(path)
    temporary = path.with_name(f"{UNFINISHED}{secrets.token_hex(6)}{path.suffix}")
    try:
        yield temporary
        temporary.replace(path)
    except OSError as error:
        raise InputError(
            f"cannot write {path}: {error.strerror or error}; choose a folder that exists and is "
            "writable"
        ) from error
    finally:
        with suppress(OSError):  # gone already: renamed, or the folder never was there
            temporary.unlink()
