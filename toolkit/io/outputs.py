"""Outputs of the verbs: checked before the work starts, written whole after it is done."""

from __future__ import annotations

import json
import os
from pathlib import Path

from ...fem.errors import InputError
from .sidecar import Sidecar

# What tells our documents from those of others.
SIDECAR = frozenset({"schema", "up", "labels", "source", "record"})
RUN = frozenset({"schema", "files", "cases"})
BATCH = frozenset({"schema", "files", "rows"})


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


def check_mesh(path: Path) -> None:
    """Refuse a mesh file that could not be written, or whose sidecar would replace a foreign file.

    Raises
    ------
    InputError
        As ``check_file`` and ``check_document``.
    """
    check_file(path, mesh_suffixes())
    check_document(Sidecar.path(path), SIDECAR)


def check_outputs(mesh: Path | None, field: Path | None) -> None:
    """Refuse a mesh as ``check_mesh`` does, and a field that is no .npz; None is not written."""
    if mesh is not None:
        check_mesh(mesh)
    if field is not None:
        check_file(field, (".npz",))


def check_run(folder: Path) -> None:
    """Refuse a folder of a run that could not be written, or where documents are not of a run."""
    check_folder(folder)
    check_document(Sidecar.path(folder / "mesh.msh"), SIDECAR)
    check_document(folder / "run.json", RUN)


def check_document(path: Path, keys: frozenset[str]) -> None:
    """Refuse to replace a JSON file that has not all ``keys``: somebody else's.

    Raises
    ------
    InputError
        With the file and the way out.
    """
    if not path.exists():
        return
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        found = None
    if not isinstance(found, dict) or not keys <= found.keys():
        raise InputError(
            f"{path} is not ours and would be overwritten: move it away, or give another -o"
        )


def _check_writable(folder: Path) -> None:
    if not os.access(folder, os.W_OK | os.X_OK):
        raise InputError(f"cannot write into {folder}: no permission; give another -o")


def mesh_suffixes() -> tuple[str, ...]:
    """Suffixes of the mesh formats that can be written."""
    from ...converters.registry import MESH_FORMATS, written

    return written(MESH_FORMATS)
