"""Real assets: the furniture of Debian's sweethome3d-furniture package, from three of its sources.

This is the one door to that package in the whole project. The package's other archives are a hidden
test: nothing here can open them, and a test sees to it that nothing else tries.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Literal, get_args

from ...fem.errors import InputError, UsageError

Source = Literal["Scopia", "BlendSwap-CC-0", "KatorLegaz"]
SOURCES: tuple[Source, ...] = get_args(Source)
TRAINING: tuple[Source, ...] = ("Scopia", "BlendSwap-CC-0")
VALIDATION: tuple[Source, ...] = ("KatorLegaz",)

PACKAGE = "sweethome3d-furniture"
FOLDER_VARIABLE = "AUTOPHYX_SWEETHOME3D"  # a folder that already holds the archives
_INSIDE = Path("usr/share/sweethome3d/furniture")
_CATALOG = "PluginFurnitureCatalog.properties"
_CENTIMETRE = 0.01


@dataclass(frozen=True)
class Furniture:
    """One object: its source, its path in the archive, name, category and real size [m].

    ``size`` is width (x), height (y, up) and depth (z).
    """

    source: Source
    model: str
    name: str
    category: str
    size: tuple[float, float, float]

    @property
    def key(self) -> str:
        """Short unique name: source/folder."""
        return f"{self.source}/{PurePosixPath(self.model).stem}"


def furniture_folder() -> Path:
    """Folder of the archives: the variable's, the installed package's, or a download kept in cache.

    Raises InputError: Where the package is not installed and cannot be fetched.
    """
    cached = _cache() / _INSIDE
    named = os.environ.get(FOLDER_VARIABLE)
    for folder in [Path(named)] if named else [Path("/") / _INSIDE, cached]:
        if (folder / f"{SOURCES[0]}.sh3f").exists():
            return folder
    # Download the Debian package and unpack it; neither step needs root
    folder = _cache()
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder) as work:
        try:
            _call(["apt-get", "download", PACKAGE], work)
            (deb,) = Path(work).glob("*.deb")
            _call(["dpkg", "-x", str(deb), str(folder)], work)
        except (OSError, ValueError, subprocess.CalledProcessError) as error:
            raise InputError(
                f"cannot fetch Debian's {PACKAGE} ({error}): run `apt-get update`, or unpack it "
                f"yourself and set {FOLDER_VARIABLE} to the folder of its .sh3f files"
            ) from error
    return cached


def catalog(source: Source) -> list[Furniture]:
    """All objects of a source that are OBJ models, in the order of its catalogue.

    Parameters
    ----------
    source
        Name of an archive of Debian's package: "Scopia", "BlendSwap-CC-0" or "KatorLegaz".

    Returns
    -------
    list[Furniture]
        Name, category, and size [m] along x, y (up) and z.

    Raises
    ------
    UsageError
        Where there is no such source.
    InputError
        Where the package is not installed and cannot be fetched.
    """
    with _open(source) as archive:
        text = archive.read(_CATALOG).decode("latin-1")
    fields: dict[str, dict[str, str]] = {}
    for line in text.splitlines():
        name, found, value = line.partition("=")
        key, _, number = name.partition("#")
        if found and number:
            fields.setdefault(number, {})[key] = value.strip()
    found = []
    for item in fields.values():
        if item.get("model", "").lower().endswith(".obj"):
            width, height, depth = (
                float(item[side]) * _CENTIMETRE for side in ("width", "height", "depth")
            )
            model = item["model"].lstrip("/")
            size = (width, height, depth)
            found.append(Furniture(source, model, item["name"], item["category"], size))
    return found


def extract(item: Furniture, folder: str | Path) -> Path:
    """Unpack an object with its materials and textures.

    Parameters
    ----------
    item
        Object of a ``catalog``.
    folder
        Where its files go.

    Returns
    -------
    Path
        Its OBJ file.

    Raises
    ------
    InputError
        Where the package is not installed and cannot be fetched.
    """
    home = PurePosixPath(item.model).parent
    with _open(item.source) as archive:
        for name in archive.namelist():
            if PurePosixPath(name).is_relative_to(home) and not name.endswith("/"):
                archive.extract(name, folder)
    return Path(folder) / item.model


def _open(source: Source) -> zipfile.ZipFile:
    if source not in SOURCES:
        raise UsageError(f"sweethome3d source must be one of {', '.join(SOURCES)}, got {source!r}")
    return zipfile.ZipFile(furniture_folder() / f"{source}.sh3f")


def _cache() -> Path:
    from platformdirs import user_cache_path

    return user_cache_path("autophyx-tet") / PACKAGE


def _call(command: list[str], folder: str) -> None:
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
