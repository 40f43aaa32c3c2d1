"""Medit .mesh, read through meshio: references become regions, which have no names there."""

from __future__ import annotations

import os

from ..announced_sizes import check_counts
from ..files import reading
from ..registry import Format
from .meshdata import MeshData, from_meshio


def read_medit(path: str | os.PathLike) -> MeshData:
    """Read the tets of a Medit file and their references."""
    with reading(path, "a Medit .mesh file with tets") as source:
        check_counts(source)
        import meshio

        return from_meshio(meshio.medit.read(str(source)))


MEDIT = Format("Medit", (".mesh",), read_medit)
