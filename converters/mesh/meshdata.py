"""What a mesh file holds: the tet mesh and every other array on its points and tets."""

from __future__ import annotations

import logging
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import TYPE_CHECKING
from urllib.parse import quote

import numpy as np
from jaxtyping import Float, Int

from ...fem.errors import InputError
from ...fem.grain import grained_parts
from ...fem.material import GRAIN, material_arrays, material_from
from ...fem.mesh import TetMesh, signed_volumes
from ...fem.note import Note
from .. import npz
from ..files import check_counts, reading
from ..registry import MATERIAL, MESH_FORMATS, Format, Keeps, format_of, warn_of_losses, written

if TYPE_CHECKING:
    import meshio


log = logging.getLogger(__name__)

COLUMNS = ("E", "nu", "rho")  # arrays of the material, in this order
# All that a mesh and its arrays may hold: what a format with room for everything keeps.
WHOLE = MATERIAL | {Keeps.GRAIN, Keeps.REGIONS, Keeps.POINT_DATA, Keeps.CELL_DATA}
# Cell arrays that say which region a tet belongs to, the most specific first; what others call
# them, taken where their numbers are whole and few.
REGION_TAGS = ("region", "gmsh:physical", "medit:ref", "mat_id")
GUESSED_TAGS = (
    "materialids", "material_id", "materialid", "material", "matid", "region_id", "regionid",
    "regions", "part_id", "partid", "part", "subdomain", "subdomain_id", "domain", "block_id",
    "blockid", "elementblockids", "cellentityids", "label", "labels", "group", "gmsh:geometrical",
)  # fmt: skip
MOST_REGIONS = 256
COARSEST = 1e-3  # of the shortest edge: a step that changes the volume of its tets by .3 %
SOFTEST = 1e3  # Pa: below it even jelly does not keep its shape on a table; E was likely in GPa
MOST_REPEATED = 0.1  # of the tets: a file with more copies is broken
SOLIDS = re.compile(r"hexahedr|wedge|prism|pyramid|polyhedr", re.IGNORECASE)
_OURS = {*COLUMNS, *GRAIN, *REGION_TAGS, "gmsh:geometrical"}

# What a name between quotes or on a line of its own cannot hold, and the escape itself.
_SPECIAL = re.compile(r'[\x00-\x1f\x7f-\xa0"%\u2028\u2029]')

Arrays = Mapping[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class MeshData:
    """A mesh with the other arrays of its file.

    Parameters
    ----------
    mesh
        Tets [m].
    point_data, cell_data
        Arrays by name with one row a point, and one row a tet.
    ignored
        What the file held beside tets, by kind of cell, and how many unused points were left out.
    warnings
        What was dropped or guessed that changes the body.

    Examples
    --------
    >>> from autophyx_tet.converters import MeshData
    >>> from autophyx_tet.fem import box_mesh
    >>> box = box_mesh((1, 1, 1), (1, 1, 1))
    >>> held = MeshData(box, cell_data={"volume": box.volumes})
    >>> round(float(held.cell_data["volume"].sum()), 9)  # m^3
    1.0
    """

    mesh: TetMesh
    point_data: Arrays = field(default_factory=dict)
    cell_data: Arrays = field(default_factory=dict)
    ignored: Mapping[str, int] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()


def items_of(
    mesh: TetMesh, point_data: Arrays | None = None, cell_data: Arrays | None = None
) -> Iterator[Keeps]:
    """What a file of the mesh and its arrays has to keep; one region needs no name."""
    if len(mesh.region_names) > 1:
        yield Keeps.REGIONS
    if mesh.material is not None:
        yield from (Keeps.E, Keeps.NU, Keeps.RHO)
        if mesh.material.tensor is not None:
            yield Keeps.GRAIN
    if point_data:
        yield Keeps.POINT_DATA
    if cell_data:
        yield Keeps.CELL_DATA


def lost_words(lost: Iterable[Keeps], mesh: TetMesh) -> list[str]:
    """What of ``mesh`` is lost, in words: of a grain, the parts that have one."""
    own = {Keeps.GRAIN: grain_words(grained_parts(mesh))}
    return [own.get(item, str(item)) for item in lost]


def grain_words(parts: Iterable[str]) -> str:
    """The grain of ``parts``, in words."""
    return f"{Keeps.GRAIN} of {', '.join(parts)}"


def escape(name: str) -> str:
    """Name without quotes and line ends: those are percent-encoded, ``unquote`` gives them back."""
    return _SPECIAL.sub(lambda match: quote(match[0]), name)


def cell_arrays(mesh: TetMesh, extra: Arrays | None = None) -> dict[str, np.ndarray]:
    """Cell arrays of a mesh by the names of the project: E, nu, rho, region, mat_id, and more."""
    arrays = material_arrays(mesh.material) | {"region": mesh.region, "mat_id": mesh.region + 1}
    return arrays | checked(extra, len(mesh.tets), "tet")


def checked(arrays: Arrays | None, count: int, what: str) -> dict[str, np.ndarray]:
    """Return the arrays after a check that each has ``count`` rows; flags become uint8."""
    result = {}
    for name, values in (arrays or {}).items():
        values = np.asarray(values)
        if len(values) != count:
            raise InputError(
                "meshdata.array_rows", name=name, count=len(values), what=what, count_2=count
            )
        result[name] = values.astype(np.uint8) if values.dtype == bool else values
    return result


def assemble(
    points: np.ndarray,
    tets: np.ndarray,
    *,
    point_data: Arrays,
    cell_data: Arrays,
    names: Mapping[int, str],
    ignored: Mapping[str, int],
    warnings: Sequence[str] = (),
) -> MeshData:
    """Build the mesh from what a file held: tags become regions, E, nu, rho the material.

    ``names`` maps a tag to the name of its region. Points that no tet uses, and tets that repeat
    another, are left out.
    """
    warnings = list(warnings)
    if len(tets) == 0:
        held = ", ".join(f"{n} {kind}" for kind, n in ignored.items()) or "no cells"
        raise InputError("meshdata.file_holds", held=held)
    points, tets = np.asarray(points), np.asarray(tets)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError("meshdata.points_must", shape=points.shape)
    if tets.min() < 0 or tets.max() >= len(points):
        raise InputError(
            "meshdata.tets_name", min=tets.min(), max=tets.max(), count=len(points) - 1
        )
    once = first_of_equal(tets)
    if repeated := len(tets) - len(once):
        if repeated > MOST_REPEATED * len(tets):
            raise InputError("meshdata.repeated", repeated=repeated, count=len(tets))
        warnings.append(Note("meshdata.repeated_dropped", repeated=repeated))
        tets = tets[once]
        cell_data = {name: values[once] for name, values in cell_data.items()}
    if solids := ", ".join(f"{n} {kind}" for kind, n in ignored.items() if SOLIDS.search(kind)):
        warnings.append(Note("meshdata.solids", solids=solids))
    used = np.zeros(len(points), dtype=bool)
    used[tets] = True
    points, tets = points[used], (np.cumsum(used) - 1)[tets]
    point_data = {name: values[used] for name, values in point_data.items()}
    unused = int((~used).sum())
    ignored = {**ignored, **({"unused points": unused} if unused else {})}
    if ignored:
        log.warning("ignored: %s", ", ".join(f"{n} {kind}" for kind, n in ignored.items()))
    mirrored = int((signed_volumes(points, tets) < 0).sum())
    if mirrored:
        log.info("turned %d mirrored tets of %d", mirrored, len(tets))
    region, region_names, tag = _regions(cell_data, names, len(tets))
    if tag.lower() in GUESSED_TAGS:
        warnings.append(Note("meshdata.guessed_regions", tag=tag, count=len(region_names)))
    material = material_from(cell_data)
    mesh = TetMesh.oriented(points, tets, region, region_names=region_names, material=material)
    if material is not None and material.E.max() < SOFTEST:
        warnings.append(Note("meshdata.soft", e=material.E.max()))
    known = _OURS if material is not None else _OURS - {*COLUMNS, *GRAIN}
    extra = {name: values for name, values in cell_data.items() if name not in known}
    for warning in warnings:
        log.warning(warning)
    return MeshData(mesh, point_data, extra, ignored, tuple(warnings))


def first_of_equal(tets: np.ndarray) -> np.ndarray:
    """The first of all tets (n, 4) with the same four corners, in rising order."""
    rows = np.sort(tets, axis=1)
    order = np.lexsort(rows.T)  # stable
    new = np.ones(len(rows), dtype=bool)
    new[1:] = (rows[order[1:]] != rows[order[:-1]]).any(axis=1)
    return np.sort(order[new])


def containing_tets(mesh: TetMesh, where: Float[np.ndarray, "*n 3"]) -> Int[np.ndarray, "*n"]:
    """A tet around each place [m], of several on a common face any; -1 outside the mesh."""
    import igl

    tets, tree = mesh.tets.astype(np.int64), igl.AABB()
    tree.init(mesh.points, tets)
    flat = np.ascontiguousarray(where.reshape(-1, 3))
    found = np.asarray(igl.in_element(mesh.points, tets, flat, tree), dtype=np.int64)
    return found.reshape(where.shape[:-1])


def far_offset(mesh: TetMesh) -> Float[np.ndarray, "3"]:
    """What to take from all points [m] before they are written in single precision.

    Nothing where its steps are fine enough for the shortest edge; else the middle of the box.
    """
    a, b = (
        mesh.points[mesh.tets[:, [0, 0, 0, 1, 1, 2]]],
        mesh.points[mesh.tets[:, [1, 2, 3, 2, 3, 3]]],
    )
    shortest = np.linalg.norm(a - b, axis=2).min()
    step = np.abs(mesh.bounds).max() * np.finfo(np.float32).eps
    return mesh.bounds.mean(axis=0) if step > COARSEST * shortest else np.zeros(3)


def from_meshio(source: meshio.Mesh) -> MeshData:
    """Keep the tets of a meshio mesh with their data; other cells are counted in ``ignored``."""
    blocks = [i for i, block in enumerate(source.cells) if block.type in ("tetra", "tetra10")]
    ignored: dict[str, int] = {}
    for i, block in enumerate(source.cells):
        if i not in blocks:
            ignored[block.type] = ignored.get(block.type, 0) + len(block.data)
    # Of quadratic ones the corners
    tets = [np.asarray(source.cells[i].data)[:, :4] for i in blocks]
    # Gmsh's physical names, which meshio keeps as {name: [tag, dimension]}
    names = {int(v[0]): k for k, v in source.field_data.items() if len(v) == 2 and v[1] == 3}
    return assemble(
        source.points,
        np.concatenate(tets) if tets else np.empty((0, 4), dtype=np.int32),
        point_data={name: np.asarray(values) for name, values in source.point_data.items()},
        cell_data={
            name: np.concatenate([np.asarray(values[i]) for i in blocks])
            for name, values in source.cell_data.items()
            if blocks
        },
        names=names,
        ignored=ignored,
    )


def _regions(cell_data, names, count) -> tuple[np.ndarray, tuple[str, ...], str]:
    """Region of every tet, the names of all, and the first tag array there is."""
    key = next((name for name in REGION_TAGS if name in cell_data), None)
    lower = {name.lower(): name for name in cell_data}
    guesses = [lower[name] for name in GUESSED_TAGS if name in lower] if key is None else []
    for guess in guesses:
        tags = np.ravel(cell_data[guess])
        whole = len(tags) == count and np.isfinite(tags).all() and (tags == np.rint(tags)).all()
        if whole and 1 < len(np.unique(tags)) <= MOST_REGIONS:
            key = guess
            break
    if key is None:
        return np.zeros(count, dtype=np.int32), ("body",), ""
    tags = np.ravel(cell_data[key])
    if not np.array_equal(tags, np.rint(tags)):
        raise InputError("meshdata.cell_array", key=key, tags=tags[:3])
    tags = tags.astype(np.int64)
    wanted = np.union1d(tags, np.fromiter(names, dtype=np.int64))
    labels = [names.get(int(tag), f"region {tag}") for tag in wanted]
    return np.searchsorted(wanted, tags).astype(np.int32), tuple(labels), key


# Our own archive of a tet mesh, .npz: the mesh and its material, and nothing beside.


def read_mesh_archive(path: str | os.PathLike) -> MeshData:
    """Read what ``npz.save`` wrote of a mesh."""
    value = npz.load(path)
    if not isinstance(value, TetMesh):
        raise InputError("meshdata.holds_material", path=path)
    return MeshData(value)


def write_mesh_archive(
    path: str | os.PathLike,
    mesh: TetMesh,
    *,
    point_data: Arrays | None = None,
    cell_data: Arrays | None = None,
) -> None:
    """Write the mesh; further arrays are refused, since there is no room for them."""
    if point_data or cell_data:
        raise InputError("meshdata.npz_holds", path=path)
    npz.save(path, mesh)


MESH_ARCHIVE = Format(
    "own archive",
    (".npz",),
    read_mesh_archive,
    write_mesh_archive,
    keeps=MATERIAL | {Keeps.GRAIN, Keeps.REGIONS},
)


# Medit .mesh, read through meshio: references become regions, which have no names there.


COUNTED = re.compile(r"^[ \t]*((?!Mesh|Dim)[A-Z]\w+)[ \t]+(\d+)[ \t]*$", re.MULTILINE)


def read_medit(path: str | os.PathLike) -> MeshData:
    """Read the tets of a Medit file and their references."""
    with reading(path, Note("meshdata.medit_mesh")) as source:
        check_counts(source)
        import meshio

        # A count may stand behind its keyword, where meshio wants it on the next line
        with NamedTemporaryFile("w", suffix=".mesh") as parted:
            parted.write(COUNTED.sub(r"\1\n\2", source.read_text(errors="replace")))
            parted.flush()
            return from_meshio(meshio.medit.read(parted.name))


MEDIT = Format("Medit", (".mesh",), read_medit)


# A tet mesh file by its suffix: read and written with all that its format keeps.


def read_mesh(path: str | os.PathLike) -> TetMesh:
    """Read a tet mesh [m] with its regions and, where E, nu and rho are there, its material.

    Parameters
    ----------
    path
        File: .msh, .vtu, .vtk, .mesh or .npz.

    Returns
    -------
    TetMesh
        Points [m], tets and regions; E [Pa], nu [1] and rho [kg/m^3] where the file has them.

    Raises
    ------
    InputError
        Where the suffix is unknown, or the file cannot be read or has no tets.

    Examples
    --------
    >>> from autophyx_tet.converters import read_mesh, write_mesh
    >>> from autophyx_tet.fem import box_mesh
    >>> lost = write_mesh("box.vtu", box_mesh((0.2, 0.1, 0.1), (1, 1, 1)))
    >>> round(read_mesh("box.vtu").volume, 9)  # m^3
    0.002
    """
    return read_data(path).mesh


def read_data(path: str | os.PathLike) -> MeshData:
    """Read a tet mesh together with every other array on its points and tets."""
    if not Path(path).exists():
        raise InputError("meshdata.such_file", path=path)
    reader = format_of(path, MESH_FORMATS).read
    if reader is None:
        known = ", ".join(suffix for suffix in MESH_FORMATS if MESH_FORMATS[suffix].read)
        raise InputError("meshdata.cannot_read", path=path, suffix=Path(path).suffix, known=known)
    data: MeshData = reader(path)
    # A centroid that lies in another tet too is of two bodies in one place
    around = containing_tets(data.mesh, data.mesh.centroids)
    if overlapping := int((around != np.arange(len(around))).sum()):
        note = Note("meshdata.overlapping", overlapping=overlapping, count=len(around))
        log.warning(note)
        data = replace(data, warnings=(*data.warnings, note))
    return data


def write_mesh(
    path: str | os.PathLike,
    mesh: TetMesh,
    *,
    point_data: Arrays | None = None,
    cell_data: Arrays | None = None,
) -> tuple[Keeps, ...]:
    """Write a mesh with its regions, material and further arrays, all or nothing.

    Parameters
    ----------
    path
        File to write: .msh, .vtu, .vtk, .mesh or .npz.
    mesh
        Tets [m], with E [Pa], nu [1] and rho [kg/m^3] or without.
    point_data, cell_data
        Further arrays by name, one row a point, and one row a tet.

    Returns
    -------
    tuple[Keeps, ...]
        What of them the format does not keep, after a warning in the log.

    Raises
    ------
    InputError
        Where the suffix is unknown or cannot be written, or an array has not one row each.

    Examples
    --------
    >>> from autophyx_tet.converters import write_mesh
    >>> from autophyx_tet.fem import ElementMaterial, box_mesh
    >>> jelly = ElementMaterial.uniform(6, E=1e5, nu=0.3, rho=1e3)
    >>> write_mesh("jelly.vtu", box_mesh((1, 1, 1), (1, 1, 1)).with_material(jelly))
    ()
    """
    form = format_of(path, MESH_FORMATS)
    if form.write is None:
        can = ", ".join(written(MESH_FORMATS))
        raise InputError("meshdata.cannot_written", path=path, suffix=Path(path).suffix, can=can)
    form.write(path, mesh, point_data=point_data, cell_data=cell_data)
    lost = form.loses(items_of(mesh, point_data, cell_data))
    if lost:
        log.warning(warn_of_losses(path, form, lost_words(lost, mesh)))
    return lost
