"""Outputs of the verbs: checked before the work starts, written whole after it is done."""

from __future__ import annotations

import os
from pathlib import Path

from ...fem.errors import InputError


def check_file(path: Path, suffixes: tuple[str, ...]) -> None:
    """Refuse an output that could not be written at the end: unknown suffix, no such folder.

    Raises
    ------
    InputError
        With the suffixes that are known, or the folder that is missing or not writable.
    """
    if path.suffix.lower() not in suffixes:
        raise InputError(
            f"output {path}: unknown suffix {path.suffix!r}, wanted {', '.join(suffixes)}"
        )
    folder = path.parent
    if path.is_dir() or not folder.is_dir():
        what = "is a folder" if path.is_dir() else f"the folder {folder} does not exist"
        raise InputError(f"cannot write {path}: {what}; give a file in an existing folder")
    _check_writable(folder)


def check_folder(folder: Path) -> None:
    """Refuse an output folder that is a file or cannot be made or written."""
    existing = folder
    while not existing.exists():
        existing = existing.parent
    if not existing.is_dir():
        raise InputError(f"cannot write into {folder}: {existing} is a file; give another -o")
    _check_writable(existing)


def _check_writable(folder: Path) -> None:
    if not os.access(folder, os.W_OK | os.X_OK):
        raise InputError(f"cannot write into {folder}: no permission; give another -o")


def mesh_suffixes() -> tuple[str, ...]:
    """Suffixes of the mesh formats that can be written."""
    from ...converters.registry import MESH_FORMATS, written

    return written(MESH_FORMATS)
