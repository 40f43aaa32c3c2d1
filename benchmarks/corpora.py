"""Corpora of real surfaces: Debian's libcgal-demo and sweethome3d-furniture, or a folder."""

from __future__ import annotations

import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

import numpy as np


def root_of(name: str, folder: Path) -> Path:
    """Folder that the inputs of a corpus are named in: ours for the known ones, else itself."""
    return folder / name if name in ("cgal", "sweethome3d") else Path(name).resolve()


def corpus(name: str, root: Path, limit: int | None) -> list[Path]:
    """Surface files of a corpus in a fixed order, evenly thinned to ``limit``."""
    if name == "cgal":
        _fetch_cgal(root)
        files = sorted(p for p in root.rglob("*") if p.suffix in (".off", ".ply", ".stl"))
    elif name == "sweethome3d":
        files = _sweethome3d(root)
    else:
        files = sorted(p for p in root.rglob("*") if p.is_file())
    if limit is not None and limit < len(files):
        files = [files[i] for i in np.linspace(0, len(files) - 1, limit).round().astype(int)]
    return files


def fetch_package(package: str, root: Path) -> Path:
    """Files of a Debian package in the folder ``root``, fetched once; needs no administrator."""
    if not root.exists():
        root.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=root.parent) as work:
            subprocess.run(
                ["apt-get", "download", "-qq", package], cwd=work, check=True, stdout=sys.stderr
            )
            (deb,) = Path(work).glob("*.deb")
            subprocess.run(["dpkg", "-x", str(deb), str(Path(work) / "files")], check=True)
            (Path(work) / "files").rename(root)
    return root


def _fetch_cgal(root: Path) -> None:
    """Meshes of Debian's libcgal-demo, fetched once."""
    if root.exists():
        return
    with tempfile.TemporaryDirectory() as work:
        files = fetch_package("libcgal-demo", Path(work) / "files")
        root.parent.mkdir(parents=True, exist_ok=True)
        with tarfile.open(next(files.rglob("data.tar.gz"))) as archive:
            archive.extractall(root, filter="data")


def _sweethome3d(root: Path) -> list[Path]:
    from autophyx_tet.research.datasets.sweethome3d import SOURCES, catalog, extract

    files = []
    for source in SOURCES:
        for item in catalog(source):
            path = root / source / item.model
            files.append(path if path.exists() else extract(item, root / source))
    return sorted(set(files))
