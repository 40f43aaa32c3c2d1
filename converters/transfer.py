"""Material fields from tets, labelled points, VoMP or Pixie, and onto splats, clouds and grids."""

from __future__ import annotations

import itertools
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from ..fem.errors import InputError
from ..fem.material import ElementMaterial
from ..fem.mesh import TetMesh
from ..fem.mpm.materials import Substance
from ..fem.mpm.particles import JELLY, Particles
from ..predictors.field import ANY_PART, FieldSample, MaterialField, sample_field
from ..predictors.grid import Grid, PartVoxels
from . import npz
from .files import writing
from .grids import DensityGrid, density_losses, read_density, write_density
from .mesh.meshdata import containing_tets
from .points.gaussians import gaussians
from .points.table import PointTable, point_losses, read_points, write_points
from .registry import GRID_FORMATS, POINT_FORMATS, Keeps, format_of

# What other programs call the three values and the label, ours first.
ALIASES: Mapping[str, tuple[str, ...]] = {
    "E": ("E", "youngs_modulus", "young_modulus"),
    "nu": ("nu", "poisson_ratio", "poissons_ratio"),
    "rho": ("rho", "density"),
    "part": ("part", "part_label", "segment"),
}
NU_MAX = 0.495  # predictors may say 0.5; an elastic solid stays below it


def field_from_tets(mesh: TetMesh, *, cells: int = 64) -> MaterialField:
    """Field of per-tet E, nu, rho: each voxel takes the values of the tet around its centre.

    Regions become parts; one too thin to hold a centre gets a voxel with its mean values.
    """
    if mesh.material is None:
        raise InputError("transfer.mesh_material")
    voxels = voxelize(mesh, cells=cells)
    owner = containing_tets(mesh, voxels.grid.centers())
    stamped = voxels.occupied & (mesh.region[owner] != voxels.part)
    for region in np.unique(voxels.part[stamped]):
        inside = np.flatnonzero(mesh.region == region)
        owner[stamped & (voxels.part == region)] = inside[np.argmax(mesh.volumes[inside])]
    return MaterialField(
        voxels.grid,
        voxels.occupied,
        *(getattr(mesh.material, name)[owner] for name in ("E", "nu", "rho")),
        part=voxels.part,
        part_names=voxels.part_names,
    )


def field_from_points(
    table: PointTable,
    *,
    cells: int = 64,
    spacing: float | None = None,
    fill: bool = True,
    part_names: tuple[str, ...] = (),
) -> MaterialField:
    """Field of points with E [Pa], nu [1], rho [kg/m^3] and, where known, part.

    A voxel takes the mean of its points in (log10 E, nu, log10 rho), of the commonest part alone.

    Parameters
    ----------
    table
        Points [m] with the columns E, nu and rho, or the names of VoMP and Pixie for them.
    cells
        Voxels along the longest side.
    spacing
        Edge of a voxel [m], where the points lie on a grid of their own.
    fill
        Whether the inside of a shell is closed with the nearest voxel.
    part_names
        Names of the parts that the column of parts counts.

    Returns
    -------
    MaterialField
        E, nu and rho on the occupied voxels.

    Raises
    ------
    InputError
        Where a column is missing, or no point has finite numbers.

    Examples
    --------
    >>> import numpy as np
    >>> from autophyx_tet.converters import PointTable, field_from_points
    >>> places = {name: np.array([0.0, 1.0]) for name in "xyz"}
    >>> values = {"E": np.full(2, 1e6), "nu": np.full(2, 0.3), "rho": np.full(2, 1e3)}
    >>> field = field_from_points(PointTable(places | values), cells=2, fill=False)
    >>> bool(np.allclose(field.E[field.occupied], 1e6))  # Pa
    True
    """
    columns = {
        quantity: next((name for name in names if name in table.columns), None)
        for quantity, names in ALIASES.items()
    }
    values = {}
    for quantity in ("E", "nu", "rho"):
        name = columns[quantity]
        if name is None:
            raise InputError(
                "transfer.points_also",
                quantity=quantity,
                aliases=ALIASES[quantity][1:],
                columns=list(table.columns),
            )
        values[quantity] = np.asarray(table.columns[name], dtype=np.float64).ravel()
    positions = table.positions
    good = np.isfinite(positions).all(axis=1)
    good &= np.all([np.isfinite(v) for v in values.values()], axis=0)
    if not good.any():
        raise InputError("transfer.point_finite")
    positions = positions[good]
    bounds = np.stack([positions.min(axis=0), positions.max(axis=0)])
    if spacing is None:
        grid = Grid.around(bounds, cells=cells)
    else:
        shape = np.rint((bounds[1] - bounds[0]) / spacing).astype(int) + 3
        grid = Grid(
            bounds[0] - 1.5 * spacing, spacing, (int(shape[0]), int(shape[1]), int(shape[2]))
        )
    cell = np.asarray(np.ravel_multi_index(tuple(grid.cell_of(positions).T), grid.shape))
    E, nu, rho = (v[good] for v in values.values())
    scaled = np.stack([np.log10(E), np.minimum(nu, NU_MAX), np.log10(rho)], axis=1)
    name = columns["part"]
    raw = np.zeros(len(cell)) if name is None else np.asarray(table.columns[name])[good]
    ids, label = np.unique(raw.astype(np.int64), return_inverse=True)
    # Mean of `values` (n, 3) over the points of each cell, of its commonest label alone
    size, labels = int(np.prod(grid.shape)), int(label.max()) + 1
    pairs, counts = np.unique(cell * labels + label, return_counts=True)
    order = np.argsort(counts, kind="stable")  # the commonest label of a cell is written last
    part = np.full(size, -1)
    part[pairs[order] // labels] = pairs[order] % labels
    own = label == part[cell]
    count = np.bincount(cell[own], minlength=size)
    means = [np.bincount(cell[own], v[own], size) / np.maximum(count, 1) for v in scaled.T]
    occupied, logE, nu, logrho, part = (
        array.reshape(grid.shape) for array in (count > 0, *means, part)
    )
    if fill:
        # Holes closed, each inner cell a copy of the nearest one that is known
        from scipy.ndimage import binary_fill_holes, distance_transform_edt

        nearest = distance_transform_edt(
            np.logical_not(occupied), return_distances=False, return_indices=True
        )
        occupied = np.asarray(binary_fill_holes(occupied))
        logE, nu, logrho, part = (
            array[tuple(np.asarray(nearest))] for array in (logE, nu, logrho, part)
        )
        part = np.where(occupied, part, -1)
    names = tuple(part_names[i] if 0 <= i < len(part_names) else f"part {i}" for i in ids)
    return MaterialField(
        grid,
        occupied,
        10**logE,
        nu,
        10**logrho,
        part=None if name is None else part,
        part_names=() if name is None else names,
    )


def read_field_points(
    path: str | os.PathLike, *, cells: int = 64, spacing: float | None = None
) -> MaterialField:
    """Field from a file of another predictor: VoMP's .npz, Pixie's .ply, or any labelled cloud."""
    return field_from_points(read_points(path), cells=cells, spacing=spacing)


# A field sampled at every tet of a mesh.

Mode = Literal["centroid", "quadrature"]

# Four-point rule of degree 2 on a tet: barycentric coordinates (5 -+ sqrt 5) / 20.
_NEAR, _FAR = (5 + 3 * 5**0.5) / 20, (5 - 5**0.5) / 20
_QUADRATURE = np.full((4, 4), _FAR) + (_NEAR - _FAR) * np.eye(4)


class SampledMesh(NamedTuple):
    """A mesh with its material, and how it was sampled.

    ``n_fallback`` samples found no voxel of their part around them, the nearest was at most
    ``max_fallback_distance`` [m] away; ``unmatched`` regions have no part of their name in the
    field and took the nearest part.
    """

    mesh: TetMesh
    n_fallback: int
    max_fallback_distance: float
    unmatched: tuple[str, ...]


def sample_material(mesh: TetMesh, field: MaterialField, *, mode: Mode = "centroid") -> SampledMesh:
    """Give every tet E [Pa], nu [1], rho [kg/m^3] of a field.

    A region samples only the part of its own name.

    Parameters
    ----------
    mesh
        Tets [m].
    field
        Values on voxels [m].
    mode
        "centroid": one sample a tet; "quadrature": the mean of four in (log10 E, nu, log10 rho),
        for tets larger than a voxel.

    Returns
    -------
    SampledMesh
        ``mesh`` with its material, and how far [m] a sample was from the nearest voxel.

    Raises
    ------
    InputError
        Where the mode is unknown.

    Examples
    --------
    >>> import numpy as np
    >>> from autophyx_tet.converters import sample_material
    >>> from autophyx_tet.fem import box_mesh
    >>> from autophyx_tet.predictors import Grid, MaterialField
    >>> cells = (2, 2, 2)
    >>> E, nu, rho = (np.full(cells, value) for value in (1e6, 0.3, 1e3))
    >>> field = MaterialField(Grid(np.zeros(3), 0.5, cells), np.ones(cells, dtype=bool), E, nu, rho)
    >>> round(sample_material(box_mesh((1, 1, 1), (1, 1, 1)), field).mesh.mass, 6)  # kg: rho V
    1000.0
    """
    # The part of every tet by the name of its region, and the names without a part
    part, unmatched = np.full(len(mesh.tets), ANY_PART), ()
    if field.part is not None:
        present = set(np.unique(field.part[field.occupied]))
        label = {name: i for i, name in enumerate(field.part_names) if i in present}
        part = np.array([label.get(name, ANY_PART) for name in mesh.region_names])[mesh.region]
        used = (mesh.region_names[i] for i in np.unique(mesh.region))
        unmatched = tuple(name for name in used if name not in label)
    at = np.full((1, 4), 0.25) if mode == "centroid" else _QUADRATURE
    points = np.einsum("qv,tvi->tqi", at, mesh.points[mesh.tets]).reshape(-1, 3)
    sample = sample_field(field, points, part=np.repeat(part, len(at)))
    logE, nu, logrho = (
        values.reshape(-1, len(at)).mean(axis=1)
        for values in (np.log10(sample.E), sample.nu, np.log10(sample.rho))
    )
    return SampledMesh(
        mesh.with_material(ElementMaterial(10**logE, nu, 10**logrho)),
        sample.n_fallback,
        sample.max_fallback_distance,
        unmatched,
    )


# A material field as a body: particles straight from its voxels, or tets that carry them.


def particles_of_field(
    field: MaterialField, *, along: int = 2, substances: Mapping[str, Substance] | None = None
) -> Particles:
    """Fill every occupied voxel with ``along``^3 particles of its values, all at rest.

    ``substances`` are class and yield by name of part; jelly where none is named. A grid of the
    field's own spacing suits them.
    """
    cells, h = np.argwhere(field.occupied), field.grid.h
    offsets = (np.array(list(np.ndindex((along,) * 3))) + 0.5) / along - 0.5
    x = field.grid.to_world(cells[:, None] + offsets).reshape(-1, 3)
    part, names = _particles_parts(field)
    of = np.repeat(np.arange(len(cells)), along**3)
    values = (getattr(field, name)[field.occupied][of] for name in ("E", "nu", "rho"))
    E, nu, rho = values
    return Particles(
        x=x, volume=np.full(len(x), (h / along) ** 3), E=E, nu=nu, rho=rho, part=part[of],
        parts=names, substance=part[of].copy(), velocity=np.zeros_like(x),
        substances=tuple((substances or {}).get(name, JELLY) for name in names),
        rigid=np.full(len(x), -1, dtype=np.int64),
    )  # fmt: skip


def tets_of_field(field: MaterialField) -> TetMesh:
    """Six tets (Kuhn) in every occupied voxel, with its values: what a scene holds and loads.

    Its surface is that of the voxels, in steps: fit for particles, not for stresses.
    """
    cells = np.argwhere(field.occupied)
    points, tets = tets_of_cells(field.grid, cells)
    part, names = _particles_parts(field)
    of = np.repeat(np.arange(len(cells)), len(tets) // len(cells))
    mesh = TetMesh(points, tets, part[of].astype(np.int32), region_names=names)
    values = (getattr(field, name)[field.occupied][of] for name in ("E", "nu", "rho"))
    return mesh.with_material(ElementMaterial(*values))


def tets_of_cells(grid: Grid, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points [m] (n, 3) and, cell by cell, the six tets (Kuhn) of each of ``cells`` (m, 3)."""
    corners = np.array(list(np.ndindex(2, 2, 2)))
    nodes, ids = np.unique((cells[:, None] + corners).reshape(-1, 3), axis=0, return_inverse=True)
    step = np.array([4, 2, 1])  # from a corner to its neighbour along x, y, z
    paths = [
        np.concatenate([[0], np.cumsum(step[list(order)])])
        for order in itertools.permutations(range(3))
    ]
    tets = ids.reshape(-1, 8)[:, paths].reshape(-1, 4)
    mesh = TetMesh.oriented(grid.to_world(nodes - 0.5), tets)
    return mesh.points, mesh.tets


def _particles_parts(field: MaterialField) -> tuple[np.ndarray, tuple[str, ...]]:
    """Index into the names of the parts of every occupied voxel; names that none has are left."""
    if field.part is None:
        return np.zeros(int(field.occupied.sum()), dtype=np.int64), ("body",)
    used, part = np.unique(field.part[field.occupied], return_inverse=True)
    return part, tuple(field.part_names[i] for i in used)


# Tets as labelled voxels, and the regions of tets by voxels that were divided further.

# Regions are one shape where volume and radii differ by less than this share: a leg of 5 cm of a
# table of 1.2 m, meshed four times, differs by .6 %; a bar with the radii of a rod has 4.7 % more.
SAME_SHAPE = 0.02


def voxelize(mesh: TetMesh, *, cells: int = 64) -> PartVoxels:
    """Voxels whose centre lies in a tet, labelled by region, ``cells`` along the longest side.

    A region too thin to hold a centre gets the free voxel nearest to its largest tet.
    """
    grid = Grid.around(mesh.bounds, cells=cells)
    owner = containing_tets(mesh, grid.centers())
    # Give each region without a voxel the nearest one that is no other region's last
    label = np.where(owner >= 0, mesh.region[owner], -1)
    count = np.bincount(label[label >= 0], minlength=len(mesh.region_names))
    volumes = mesh.volumes
    for region in np.setdiff1d(mesh.region, np.flatnonzero(count)):
        largest = np.argmax(np.where(mesh.region == region, volumes, 0))
        distance = np.linalg.norm(grid.centers() - mesh.centroids[largest], axis=-1)
        free = (label < 0) | (count[label] > 1)
        cell = np.unravel_index(np.argmin(np.where(free, distance, np.inf)), grid.shape)
        if label[cell] >= 0:
            count[label[cell]] -= 1
        label[cell], count[region] = region, 1
    return PartVoxels(grid, label, mesh.region_names, shapes=congruent_regions(mesh))


def congruent_regions(mesh: TetMesh) -> tuple[int, ...]:
    """For each region the first one that it is, moved, turned or mirrored; itself if none.

    Compared are volume and principal radii of gyration, which no rigid motion changes.
    """
    rows = []  # the radii [m], the longest last, and the volume [m^3]
    for region in range(len(mesh.region_names)):
        own = mesh.region == region
        volumes, corners = mesh.volumes[own], mesh.points[mesh.tets[own]]
        volume = volumes.sum()
        if not volume:
            rows.append(np.full(4, np.nan))  # like no other
            continue
        corners = corners - np.average(corners.mean(axis=1), axis=0, weights=volumes)
        sums = corners.sum(axis=1)
        # The exact second moment of a tet:
        # V / 20 (sum of x x' over corners + (sum of x) (sum of x)').
        moment = np.einsum("t,tai,taj->ij", volumes, corners, corners)
        moment = (moment + np.einsum("t,ti,tj->ij", volumes, sums, sums)) / (20 * volume)
        rows.append(np.array([*np.sqrt(np.linalg.eigvalsh(moment).clip(min=0)), volume]))
    found = np.array(rows)
    gap = np.abs(found[:, None] - found)
    same = np.all(gap <= SAME_SHAPE * np.minimum(found[:, None], found), axis=2)
    return tuple((same | np.eye(len(found), dtype=bool)).argmax(axis=1).tolist())


def divided_by_voxels(mesh: TetMesh, parts: PartVoxels, parents: Sequence[int]) -> TetMesh:
    """Return the mesh with its regions divided as their voxels were.

    ``parents`` (pieces,) is the region that each of ``parts`` is a piece of; a tet goes to the
    piece of its region whose voxel is nearest to its centroid.
    """
    from scipy.spatial import KDTree

    of_piece = np.asarray(parents)
    region = np.empty_like(mesh.region)
    for parent in np.unique(mesh.region):
        tets = mesh.region == parent
        cells = np.argwhere(parts.occupied & (of_piece[parts.part] == parent))
        _, nearest = KDTree(cells).query(parts.grid.to_index(mesh.centroids[tets]))
        region[tets] = parts.part[tuple(cells[nearest].T)]
        own = np.flatnonzero(tets)
        for piece in np.setdiff1d(np.flatnonzero(of_piece == parent), region[own]):
            # Of a piece that is nearest to no tet: the tet nearest to it, of a piece that has more
            spare = own[np.bincount(region[own])[region[own]] > 1]
            middle = np.argwhere(parts.occupied & (parts.part == piece)).mean(axis=0)
            far = np.linalg.norm(parts.grid.to_index(mesh.centroids[spare]) - middle, axis=1)
            region[spare[far.argmin()]] = piece
    return TetMesh(mesh.points, mesh.tets, region, parts.part_names)


_UNITS = {name: npz.UNITS[name] for name in ("E", "nu", "rho")}


@dataclass(frozen=True)
class Transferred:
    """What a transfer did.

    ``points`` are the splats, points or cells; ``n_fallback`` of them found no voxel around them
    and took the nearest, at most ``max_fallback_distance`` [m] away; ``n_invalid`` have no finite
    position and got NaN. ``volume`` [m^3] and ``mass`` [kg] of splats are weighted by opacity.
    ``lost`` is what the files do not keep of the target.
    """

    files: tuple[Path, ...]
    points: int
    n_fallback: int
    max_fallback_distance: float
    n_invalid: int = 0
    volume: float | None = None
    mass: float | None = None
    lost: tuple[str, ...] = ()


def append_material(
    source: MaterialField | TetMesh,
    target_path: str | os.PathLike,
    out_path: str | os.PathLike,
    *,
    cells: int = 64,
) -> Transferred:
    """Write the target again with E, nu, rho (and part, material where known) appended.

    Every property of the target and its order is kept. A target without room for more columns
    (.splat, .spz, .ksplat, .xyz) is copied to an ``out_path`` of its own suffix, with the values
    in ``STEM.npz`` beside it in the same order; it may also be written as .ply or .npz.

    source: The field; a mesh is first turned into one of ``cells`` voxels along its longest side.
    target_path: Splats, a point cloud or a density grid, in the metres and axes of the source.
    out_path: Where to write.
    """
    field = field_from_tets(source, cells=cells) if isinstance(source, TetMesh) else source
    target_path, out_path = Path(target_path), Path(out_path)
    if is_density(target_path):
        # Values in the cells above the threshold; 0 in empty ones, where there is no material
        grid = read_density(target_path)
        full = grid.density.ravel() > grid.threshold
        sample = sample_field(field, grid.centers()[full])
        arrays = {}
        for name, values in sample_columns(field, sample, real="f4").items():
            array = np.full(grid.density.size, -1 if values.dtype.kind == "i" else 0, values.dtype)
            array[full] = values
            arrays[name] = array.reshape(grid.density.shape)
        written = DensityGrid(
            grid.lo, grid.hi, grid.density, grid.threshold, {**grid.fields, **arrays}
        )
        files = write_density(out_path, written)
        return Transferred(
            tuple(files), int(full.sum()), sample.n_fallback, sample.max_fallback_distance,
            lost=density_losses(out_path, written),
        )  # fmt: skip
    roomless = format_of(out_path, POINT_FORMATS).write is None
    if roomless and target_path.suffix.lower() != out_path.suffix.lower():
        raise InputError(
            "carriers.converted",
            out_path=out_path,
            suffix=target_path.suffix,
            suffix_2=out_path.suffix,
        )
    table = read_points(target_path)
    positions = table.positions
    valid = np.asarray(np.isfinite(positions).all(axis=1))
    sample = sample_field(field, positions[valid])
    columns = {}  # NaN or -1 where a point is not valid
    real = "f4" if table.is_splat else "f8"
    for name, values in sample_columns(field, sample, real=real).items():
        empty = -1 if values.dtype.kind == "i" else np.nan
        columns[name] = np.full(len(valid), empty, dtype=values.dtype)
        columns[name][valid] = values
    # One line of ASCII that says what the columns mean
    names = {"part": field.part_names, "material": field.material_names}
    remark = json.dumps({**_UNITS, **{key: value for key, value in names.items() if value}})
    files, lost = [out_path], []
    if roomless:
        files.append(out_path.with_suffix(".npz"))
        npz.save_npz(files[1], **columns, comments=np.array(remark))
        with writing(out_path) as copy:
            copy.write_bytes(target_path.read_bytes())
    else:
        table = table.with_columns(columns, comment=remark)
        write_points(out_path, table)
        for item in point_losses(out_path, table):
            lost += table.others.names if item is Keeps.OTHERS and table.others else [item]
    volume = mass = None
    if table.is_splat:
        volumes = gaussians(table).volumes[valid]
        volume, mass = float(volumes.sum()), float(volumes @ sample.rho)
    return Transferred(
        tuple(files), len(table), sample.n_fallback, sample.max_fallback_distance,
        int((~valid).sum()), volume, mass, tuple(lost),
    )  # fmt: skip


def is_density(path: Path) -> bool:
    """Whether a path is a density grid; an .npz is one when it says so."""
    suffix = path.suffix.lower()
    if suffix == ".npz":
        return "aabb_min" in npz.load_npz(path)
    if suffix in GRID_FORMATS:
        return True
    if suffix in POINT_FORMATS:
        return False
    known = ", ".join(sorted({*GRID_FORMATS, *POINT_FORMATS}))
    raise InputError("carriers.cannot_transfer", path=path, suffix=suffix, known=known)


def sample_columns(field: MaterialField, sample: FieldSample, *, real: str) -> dict:
    """Columns E, nu, rho of type ``real``, and part, material as int32 where they are known."""
    columns = {name: getattr(sample, name).astype(real) for name in _UNITS}
    for name in ("part", "material"):
        if getattr(sample, name) is not None:
            columns[name] = getattr(sample, name).astype(np.int32)
    return columns
