"""The seam of file formats: what a format is, and which there are, by suffix or by program.

A format is one file that defines a ``Format``, and one line here. Suffixes are listed without
importing a reader; ``MESH_FORMATS.register(".toy", TOY)`` adds one from outside.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

from ..fem.errors import InputError
from ..fem.note import Note
from ..fem.registry import Registry


class Keeps(StrEnum):
    """What of a mesh, a scene, a table of points, a grid or an asset may survive in a file."""

    REGIONS = Note("registry.regions_names")
    E = Note("registry.every_tet")
    NU = Note("registry.nu_every")
    RHO = Note("registry.rho_every")
    POINT_DATA = Note("registry.further_arrays")
    CELL_DATA = Note("registry.further_arrays_tets")
    HELD = Note("registry.points_held")
    ROLLERS = Note("registry.points_held_some")
    PRESCRIBED = "prescribed displacements"
    SPRINGS = "springs"
    QUADRATIC = "quadratic elements"
    GRAIN = "the grain"  # the axes of every tet, and its constants along them
    COLUMNS = "further columns"
    REMARKS = "remarks"
    HARMONICS = "spherical harmonics"
    OTHERS = Note("registry.else_file")
    ARRAYS = "further arrays"
    THRESHOLD = Note("registry.density_surface")
    UNIT = Note("registry.unit_length")
    UP = Note("registry.up_axis")
    PARTS = Note("registry.names_parts")


MATERIAL = frozenset({Keeps.E, Keeps.NU, Keeps.RHO})


@dataclass(frozen=True, eq=False)
class Format:
    """A file format: how it is read and written, and what survives.

    Parameters
    ----------
    title
        What it is called in messages and tables.
    suffixes
        Lower case, with the dot; the first is the usual one.
    read, write
        Reader and writer; None where there is none.
    keeps
        What comes back as it was. What is given beside it, a writer refuses or it is told as lost.
    binned
        What is kept as one value a bin of tets, exactly where there are few values.
    lumped
        What is kept on the points: rho as the mass of every point.
    single
        Whether places [m] are kept, or read by the program, in single precision.
    """

    title: str
    suffixes: tuple[str, ...]
    read: Callable[..., Any] | None = None
    write: Callable[..., Any] | None = None
    keeps: AbstractSet[Keeps] = frozenset()
    binned: AbstractSet[Keeps] = frozenset()
    lumped: AbstractSet[Keeps] = frozenset()
    single: bool = False

    def loses(self, given: Iterable[Keeps]) -> tuple[Keeps, ...]:
        """Return those of the items ``given`` that a file neither keeps nor bins nor lumps."""
        kept = self.keeps | self.binned | self.lumped
        return tuple(item for item in given if item not in kept)


@dataclass(frozen=True, eq=False)
class Program:
    """A program that meshes are exported to.

    ``formats`` are those of its main file, the usual one first; ``notes`` gives sentences about how
    the program will take a mesh under the options of a scene.
    """

    formats: tuple[Format, ...]
    notes: Callable[..., Iterable[str]] | None = None

    @property
    def suffixes(self) -> tuple[str, ...]:
        """Suffixes of the main file, the usual one first."""
        return tuple(suffix for form in self.formats for suffix in form.suffixes)

    @property
    def binned(self) -> bool:
        """Whether it knows no material a tet, so that tets of like material are gathered."""
        return any(form.binned for form in self.formats)

    def format(self, suffix: str) -> Format:
        """Return the format of a main file with that suffix."""
        return next(form for form in self.formats if suffix in form.suffixes)


def format_of(path: str | os.PathLike, formats: Registry[Format]) -> Format:
    """Look a path up by its suffix; ``InputError`` with those that are known."""
    suffix = Path(path).suffix.lower()
    if suffix not in formats:
        known = ", ".join(f"{name} ({formats[name].title})" for name in formats)
        raise InputError(
            "registry.unknown_known_2", path=path, kind=formats.kind, suffix=suffix, known=known
        )
    return formats[suffix]


def written(formats: Registry[Format]) -> tuple[str, ...]:
    """Suffixes of the formats that have a writer."""
    return tuple(suffix for suffix in formats if formats[suffix].write is not None)


def warn_of_losses(path: str | os.PathLike, form: Format, lost: Iterable[str]) -> str:
    """Sentence about what of the given a file will not hold."""
    return Note("registry.keep", path=path, title=form.title, lost=", ".join(lost))


_HERE = __package__ or ""

MESH_FORMATS: Registry[Format] = Registry(
    "mesh suffix",
    _HERE,
    {
        ".msh": "mesh.msh:MSH",
        ".vtu": "mesh.vtk:VTU",
        ".vtk": "mesh.vtk:VTK",
        ".npz": "mesh.meshdata:MESH_ARCHIVE",
        ".mesh": "mesh.meshdata:MEDIT",
    },
)
"""Mesh formats by suffix; ``MESH_FORMATS.register(".mine", Format(...))`` adds one."""
POINT_FORMATS: Registry[Format] = Registry(
    "point suffix",
    _HERE,
    {
        ".ply": "points.ply:PLY",
        ".npz": "points.table:COLUMN_ARCHIVE",
        ".pcd": "points.pcd:PCD",
        ".las": "points.las:LAS",
        ".laz": "points.las:LAS",
        ".xyz": "points.table:XYZ_FILE",
        ".splat": "points.gaussians:SPLAT_ROWS",
        ".spz": "points.splat_files:SPZ",
        ".ksplat": "points.splat_files:KSPLAT",
    },
)
GRID_FORMATS: Registry[Format] = Registry(
    "density suffix",
    _HERE,
    {
        ".npz": "grids:DENSITY_ARCHIVE",
        ".nvdb": "grids:NANOVDB",
        **dict.fromkeys((".pt", ".pth", ".ckpt", ".safetensors"), "grids:NERFACC"),
        **dict.fromkeys((".ingp", ".msgpack"), "grids:INSTANT_NGP"),
    },
)
PROGRAMS: Registry[Program] = Registry(
    "program",
    _HERE,
    {
        "gmsh": "programs.export:GMSH",
        "calculix": "programs.calculix:CALCULIX",
        "newton": "programs.newton:NEWTON",
        "mujoco": "programs.mujoco:MUJOCO",
        "usd": "programs.usd:USD",
        "sofa": "programs.sofa:SOFA",
        "fenics": "programs.fenics:FENICS",
    },
)
