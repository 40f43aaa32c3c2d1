"""What an asset file refers to: material files, textures, buffers, all from its own folder."""

from __future__ import annotations

import hashlib
import logging
import re
from pathlib import Path
from urllib.parse import unquote

log = logging.getLogger(__name__)

# A reference larger than this is no texture or material file that we would want in memory.
MAX_REFERENCE_BYTES = 512 * 2**20


class References:
    """Reads the files that an asset refers to, only from the asset's own folder.

    It has the interface that trimesh wants from a resolver. ``found`` holds the bytes by name,
    ``warnings`` a sentence for each reference that was missing, refused or too large.

    Parameters
    ----------
    folder
        The folder of the asset; a reference that leads out of it is refused.
    materials
        Material names for which a missing material file is replaced by bare entries, so that the
        names of the parts survive.
    """

    def __init__(self, folder: Path, *, materials: tuple[str, ...] = ()) -> None:
        self.folder = folder.resolve()
        self.materials = materials
        self.found: dict[str, bytes] = {}
        self.warnings: list[str] = []

    def get(self, name: str) -> bytes:
        """Bytes of the file ``name``, relative to the folder; OSError if there are none."""
        name = unquote(name.strip()).replace("\\", "/")
        if name in self.found:
            return self.found[name]
        path = (self.folder / name).resolve()
        reason = _refusal(path, self.folder)
        if reason is None:
            self.found[name] = path.read_bytes()
            return self.found[name]
        self.warn(f"{name!r} {reason}: the asset is used without it")
        if name.lower().endswith(".mtl") and self.materials:
            return "".join(f"newmtl {material}\n" for material in self.materials).encode()
        raise FileNotFoundError(f"{name!r} {reason}")

    __getitem__ = get

    def keys(self) -> tuple[str, ...]:
        """Names read so far."""
        return tuple(self.found)

    def digest(self, data: bytes) -> str:
        """SHA-256 of the asset's own bytes and of all that it referred to."""
        sha = hashlib.sha256(data)
        for name in sorted(self.found):
            sha.update(name.encode() + b"\0" + hashlib.sha256(self.found[name]).digest())
        return sha.hexdigest()

    def warn(self, sentence: str) -> None:
        """Keep a sentence for the user, once."""
        if sentence not in self.warnings:
            log.info(sentence)
            self.warnings.append(sentence)


def _refusal(path: Path, folder: Path) -> str | None:
    """Why a referenced file is not read, or None."""
    if not path.is_relative_to(folder):
        return "lies outside the asset's folder and is not read"
    if not path.is_file():
        return f"is not in {folder.name}/"
    if path.stat().st_size > MAX_REFERENCE_BYTES:
        return f"is larger than {MAX_REFERENCE_BYTES >> 20} MiB"
    return None


def used_materials(obj_text: str) -> tuple[str, ...]:
    """Names after ``usemtl`` in an OBJ text, in order of first use."""
    return tuple(dict.fromkeys(re.findall(r"^usemtl[ \t]+(\S+)", obj_text, flags=re.MULTILINE)))
