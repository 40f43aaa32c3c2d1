"""The material field: E, nu, rho on the occupied cells of a grid."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ..fem.errors import InputError
from .grid import Grid


class Ranges(NamedTuple):
    """[min, max] of E [Pa], nu [1] and rho [kg/m^3] in every cell, each (nx, ny, nz, 2)."""

    E: np.ndarray
    nu: np.ndarray
    rho: np.ndarray


@dataclass(frozen=True, eq=False)
class MaterialField:
    """E, nu and rho on the occupied cells of a grid; other cells are ignored.

    Parameters
    ----------
    grid
        The cells [m].
    occupied
        Cells that hold matter, shape (nx, ny, nz).
    E, nu, rho
        Young's modulus [Pa], Poisson's ratio [1], density [kg/m^3], shape (nx, ny, nz).
    part, part_names
        Index of every cell into the names, -1 outside.
    material, material_names
        The same for the rows of the table.
    ranges
        Lowest and highest values that E, nu and rho were chosen from.
    alpha
        Where between them, in [0, 1], soft to stiff, if the predictor knows.

    Raises
    ------
    InputError
        Where shapes differ, or an occupied cell has no valid value or part.

    Examples
    --------
    >>> import numpy as np
    >>> from autophyx_tet.predictors import Grid, MaterialField
    >>> cells = (2, 2, 2)
    >>> E, nu, rho = (np.full(cells, value) for value in (1e6, 0.3, 1e3))
    >>> field = MaterialField(Grid(np.zeros(3), 0.5, cells), np.ones(cells, dtype=bool), E, nu, rho)
    >>> float(field.rho[field.occupied].sum() * field.grid.h**3)  # kg: rho V
    1000.0
    """

    grid: Grid
    occupied: Bool[np.ndarray, "nx ny nz"]
    E: Float[np.ndarray, "nx ny nz"]
    nu: Float[np.ndarray, "nx ny nz"]
    rho: Float[np.ndarray, "nx ny nz"]
    part: Int[np.ndarray, "nx ny nz"] | None = None
    part_names: tuple[str, ...] = ()
    material: Int[np.ndarray, "nx ny nz"] | None = None
    material_names: tuple[str, ...] = ()
    ranges: Ranges | None = None
    alpha: float | None = None

    def __post_init__(self) -> None:
        for name in ("occupied", "E", "nu", "rho", "part", "material"):
            array = getattr(self, name)
            if array is not None and array.shape != (wanted := self.grid.shape):
                raise InputError("field.shape_grid", name=name, shape=array.shape, shape_2=wanted)
        if not self.occupied.any():
            raise InputError("field.material_field")
        E, nu, rho = (getattr(self, name)[self.occupied] for name in ("E", "nu", "rho"))
        good = (E > 0) & (nu >= 0) & (nu < 0.5) & (rho > 0) & np.isfinite(E * rho)
        if not good.all():
            cell = np.argwhere(self.occupied)[np.flatnonzero(~good)[0]]
            raise InputError(
                "field.occupied_cells", count=(~good).sum(), size=good.size, cell=tuple(cell)
            )
        if self.part is not None and (self.part[self.occupied] < 0).any():
            raise InputError("field.field_part")


# How E, nu and rho become numbers in [-1, 1] for a network, and back.


@dataclass(frozen=True)
class Normalisation:
    """Ranges that map (log10 E [Pa], nu, log10 rho [kg/m^3]) linearly to [-1, 1].

    Predictions of nu are capped at ``nu_cap``, where elements do not lock yet.
    """

    log10_E: tuple[float, float] = (3.0, 12.0)
    nu: tuple[float, float] = (0.0, 0.5)
    log10_rho: tuple[float, float] = (0.7, 4.4)
    nu_cap: float = 0.495

    @property
    def low(self) -> np.ndarray:
        """Lower ends of the three ranges, (3,)."""
        return np.array([self.log10_E[0], self.nu[0], self.log10_rho[0]])

    @property
    def span(self) -> np.ndarray:
        """Widths of the three ranges, (3,)."""
        return np.array([self.log10_E[1], self.nu[1], self.log10_rho[1]]) - self.low

    def normalise(self, E, nu, rho) -> np.ndarray:
        """Numbers in [-1, 1], shape (..., 3), of E [Pa], nu [1], rho [kg/m^3]; outliers clip."""
        raw = np.stack(np.broadcast_arrays(np.log10(E), nu, np.log10(rho)), axis=-1)
        return np.clip(2 * (raw - self.low) / self.span - 1, -1.0, 1.0)

    def physical(self, normalised) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """E [Pa], nu [1], rho [kg/m^3] of numbers in [-1, 1], shape (..., 3)."""
        unit = (np.clip(np.asarray(normalised, dtype=np.float64), -1.0, 1.0) + 1) / 2
        raw = self.low + unit * self.span
        nu = np.clip(raw[..., 1], 0.0, self.nu_cap)
        return np.asarray(10 ** raw[..., 0]), np.asarray(nu), np.asarray(10 ** raw[..., 2])

    def to_dict(self) -> dict:
        """Plain data for a checkpoint's metadata."""
        return asdict(self)

    @classmethod
    def from_dict(cls, data: dict) -> Normalisation:
        """Rebuild from ``to_dict``; a missing or unknown key is an ``InputError``."""
        try:
            plain: dict[str, Any] = {
                k: tuple(v) if isinstance(v, list | tuple) else v for k, v in data.items()
            }
            return cls(**plain)
        except TypeError as error:
            raise InputError("field.normalisation", data=data, error=error) from error


DEFAULT = Normalisation()


def read_weights(path: Path) -> tuple[dict[str, Any], Normalisation, dict[str, Any]]:
    """Facts, the meaning of the numbers and, in float32 on the CPU, the tensors of a network.

    Of a file of float16 safetensors. Raises KeyError, OSError, TypeError or ValueError if it is no
    such file.
    """
    from safetensors import SafetensorError, safe_open

    try:
        with safe_open(path, framework="pt") as file:
            facts = {name: json.loads(fact) for name, fact in file.metadata().items()}
            tensors = {key: file.get_tensor(key).float() for key in file.keys()}
    except (SafetensorError, AttributeError) as error:  # no metadata at all is None
        raise ValueError(error) from error
    return facts, Normalisation.from_dict(facts["normalisation"]), tensors


# The sampler: E, nu, rho of a material field at points; tets, splats, clouds and rays use it.
#
# Trilinear in (log10 E, nu, log10 rho) with the weights renormalised over the occupied voxels of
# the point's own part; the nearest such voxel where none of the eight around the point is one.

# Points a step: the temporaries of a step (about 15 MB) stay near the caches.
_CHUNK = 1 << 16
_THREADS = 2  # numpy leaves the interpreter lock in the large gathers; more threads wait for memory
ANY_PART = -1


class FieldSample(NamedTuple):
    """The field at points: E [Pa], nu [1], rho [kg/m^3], part and material labels, each (n,).

    ``n_fallback`` points had no voxel of their part around them and took the nearest one, at most
    ``max_fallback_distance`` [m] away.
    """

    E: np.ndarray
    nu: np.ndarray
    rho: np.ndarray
    part: np.ndarray | None
    material: np.ndarray | None
    n_fallback: int
    max_fallback_distance: float


class _Voxels(NamedTuple):
    """Occupied voxels as rows of a table; row 0 is empty space.

    ``rows`` (nx+2, ny+2, nz+2) maps padded cells to rows, ``values`` (rows, 4) holds 1, log10 E,
    nu, log10 rho, so that weight x row sums weights and values at once; ``part`` and ``material``
    (rows,) are labels; ``cells`` (rows - 1, 3) are the indices of row 1, 2 ...
    """

    rows: np.ndarray
    values: np.ndarray
    part: np.ndarray
    material: np.ndarray
    cells: np.ndarray


def sample_field(
    field: MaterialField,
    points: Float[np.ndarray, "n 3"],
    *,
    part: Int[np.ndarray, "n"] | None = None,
) -> FieldSample:
    """Sample a field at points [m].

    field: The field; labels of its parts, where it has them, are never mixed.
    points: Positions [m], shape (n, 3), inside the grid or not.
    part: Label of each point in the field's ``part_names``, shape (n,), or ``ANY_PART`` (-1) for a
        point that belongs to the part of the nearest voxel. None is ``ANY_PART`` for all.
    Raises InputError: Where a point is not finite, or a label names a part that has no voxel.
    """
    points = np.asarray(points, dtype=np.float64)
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if bad.size:
        at, count = bad[0], len(points)
        raise InputError(
            "field.point_finite", bad=at, size=bad.size, count=count, points=points[at]
        )
    wanted = np.full(len(points), ANY_PART)
    if part is not None and field.part is not None:
        wanted = part
        missing = np.setdiff1d(part, [ANY_PART, *np.unique(field.part[field.occupied])])
        if missing.size:
            raise InputError(
                "field.part_labels", tolist=missing.tolist(), dict=dict(enumerate(field.part_names))
            )
    voxels = _voxels(field)
    nearest = np.zeros(len(points), dtype=np.int64)
    values = np.empty((len(points), 3))

    def step(chunk: slice) -> None:
        nearest[chunk] = _interpolate(field, voxels, points[chunk], wanted[chunk], values[chunk])

    with ThreadPoolExecutor(_THREADS) as pool:
        count = len(points)
        list(pool.map(step, (slice(start, start + _CHUNK) for start in range(0, count, _CHUNK))))
    lost = np.flatnonzero(nearest == 0)
    distance = 0.0
    if lost.size:
        nearest[lost], distance = _nearest(field, voxels, points[lost], wanted[lost])
        values[lost] = voxels.values[nearest[lost], 1:]
    return FieldSample(
        E=10 ** values[:, 0],
        nu=values[:, 1],
        rho=10 ** values[:, 2],
        part=None if field.part is None else voxels.part[nearest],
        material=None if field.material is None else voxels.material[nearest],
        n_fallback=lost.size,
        max_fallback_distance=distance,
    )


def _voxels(field: MaterialField) -> _Voxels:
    inside = field.occupied
    cells = np.argwhere(inside)
    rows = np.zeros(np.array(inside.shape) + 2, dtype=np.int32)
    rows[tuple((cells + 1).T)] = np.arange(1, len(cells) + 1)
    values = np.zeros((len(cells) + 1, 4))
    values[1:, 0] = 1
    values[1:, 1] = np.log10(field.E[inside])
    values[1:, 2] = field.nu[inside]
    values[1:, 3] = np.log10(field.rho[inside])

    part, material = np.full((2, len(values)), ANY_PART)
    if field.part is not None:
        part[1:] = field.part[inside]
    if field.material is not None:
        material[1:] = field.material[inside]
    return _Voxels(rows, values, part, material, cells)


def _interpolate(
    field: MaterialField, voxels: _Voxels, points: np.ndarray, wanted: np.ndarray, out: np.ndarray
) -> np.ndarray:
    """Fill ``out`` (n, 3) and return the row of the nearest voxel around each point, 0 for none."""
    shape = np.array(field.grid.shape)
    index = np.clip(field.grid.to_index(points), -1, shape)  # outside: all weight on the padding
    base = np.minimum(np.floor(index), shape - 1).astype(np.int64)
    upper = index - base
    stride = np.array(voxels.rows.strides) // voxels.rows.itemsize
    first = (base + 1) @ stride
    flat = voxels.rows.ravel()
    shares = np.stack([1 - upper, upper])  # (2, n, 3): weight of the lower and the upper voxel
    corners, weights = [], []
    for i, j, k in np.ndindex(2, 2, 2):
        row = flat[first + (i * stride[0] + j * stride[1] + k)]
        corners.append(row)
        weights.append(shares[i, :, 0] * shares[j, :, 1] * shares[k, :, 2] * (row > 0))
    rows, weight = np.stack(corners), np.stack(weights)
    point = np.arange(len(points))
    if field.part is not None:
        labels = voxels.part[rows]
        own = np.where(wanted == ANY_PART, labels[weight.argmax(axis=0), point], wanted)
        weight *= labels == own
    nearest = np.where(weight.any(axis=0), rows[weight.argmax(axis=0), point], 0)
    total = np.einsum("cn,cnv->nv", weight, voxels.values[rows])
    np.divide(total[:, 1:], total[:, :1], out=out, where=total[:, :1] > 0)
    return nearest


def _nearest(
    field: MaterialField, voxels: _Voxels, points: np.ndarray, wanted: np.ndarray
) -> tuple[np.ndarray, float]:
    """Row of the nearest occupied voxel of the wanted part, and the largest distance [m]."""
    from scipy.spatial import KDTree

    nearest = np.zeros(len(points), dtype=np.int64)
    far = 0.0
    # Of voxels all of whose neighbours are of the same part none is ever nearest.
    near = np.where(voxels.rows > 0, voxels.part[voxels.rows], ANY_PART - 1).ravel()
    stride = np.array(voxels.rows.strides) // voxels.rows.itemsize
    own = (voxels.cells + 1) @ stride
    inner = np.ones(len(own), dtype=bool)
    for step in (*stride, *-stride):
        inner &= near[own + step] == near[own]
    shell = np.flatnonzero(~inner) + 1
    for label in np.unique(wanted):
        rows = shell if label == ANY_PART else shell[voxels.part[shell] == label]
        mine = np.flatnonzero(wanted == label)
        tree = KDTree(field.grid.to_world(voxels.cells[rows - 1]))
        distance, hit = tree.query(points[mine], workers=_THREADS)
        nearest[mine] = rows[hit]
        far = max(far, float(distance.max()))
    return nearest, far
