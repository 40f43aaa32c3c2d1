"""Points with named columns: point clouds and Gaussian splats, whatever file they come in."""

from __future__ import annotations

import logging
import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ...fem.errors import InputError
from ...fem.note import Note
from .. import npz
from ..files import reading
from ..registry import POINT_FORMATS, Format, Keeps, format_of, warn_of_losses, written

XYZ = ("x", "y", "z")


class Others(NamedTuple):
    """What a file holds beside columns and remarks, as the reader of its format knows it.

    ``title`` is the format's; ``names`` say what another format has no place for.
    """

    title: str
    names: tuple[str, ...]
    value: Any


@dataclass(frozen=True, eq=False)
class PointTable:
    """Points with named columns, in the order of their file.

    A point may be invalid (not finite), as in clouds of depth cameras.

    Parameters
    ----------
    columns
        Arrays by name, each (n,) or (n, k); x, y and z are positions [m], or in the file's unit.
    comments
        Remarks of the file.
    others
        Whatever else its writer needs to give the whole file back.

    Raises
    ------
    InputError
        Where x, y or z is missing, or columns are not of one length.

    Examples
    --------
    >>> import numpy as np
    >>> from autophyx_tet.converters import PointTable
    >>> table = PointTable({name: np.arange(2.0) for name in "xyz"})
    >>> len(table), table.positions[1].tolist(), table.is_splat
    (2, [1.0, 1.0, 1.0], False)
    """

    columns: Mapping[str, np.ndarray]
    comments: tuple[str, ...] = ()
    others: Others | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        missing = [name for name in XYZ if name not in self.columns]
        if missing:
            raise InputError("table.points_need", columns=list(self.columns))
        lengths = {name: len(values) for name, values in self.columns.items()}
        if len(set(lengths.values())) != 1 or not len(self):
            raise InputError("table.columns_must", lengths=lengths)

    def __len__(self) -> int:
        return len(self.columns["x"])

    @property
    def positions(self) -> Float[np.ndarray, "n 3"]:
        """Positions [m], shape (n, 3), float64."""
        return np.stack([np.asarray(self.columns[name], dtype=np.float64) for name in XYZ], axis=1)

    @property
    def is_splat(self) -> bool:
        """Whether the columns are those of 3D Gaussians."""
        return {"opacity", "scale_0", "rot_0"} <= self.columns.keys()

    def with_columns(self, extra: Mapping[str, np.ndarray], *, comment: str = "") -> PointTable:
        """Return the table with columns replaced in place or appended last."""
        comments = (*self.comments, comment) if comment else self.comments
        return replace(self, columns={**self.columns, **extra}, comments=comments)

    def only(self, rows: np.ndarray | slice) -> PointTable:
        """Return some of the points, without what stands beside them."""
        return PointTable({name: np.asarray(v)[rows] for name, v in self.columns.items()})

    def items(self) -> Iterator[Keeps]:
        """What a file of the table has to keep; of its own format also what stands beside."""
        if len(self.columns) > len(XYZ):
            yield Keeps.COLUMNS
        if any(name.startswith("f_rest_") for name in self.columns):
            yield Keeps.HARMONICS
        if self.comments:
            yield Keeps.REMARKS
        if self.others is not None and self.others.names:
            yield Keeps.OTHERS


# An archive of point columns, .npz: one array a column, or ``points`` (n, 3) for x, y, z.


def read_column_archive(path: str | os.PathLike) -> PointTable:
    """Read every array as a column, and ``comments`` as the remarks."""
    with reading(path, Note("table.npz_point")):
        arrays = npz.load_npz(path)
        comments = tuple(str(arrays.pop("comments")).splitlines()) if "comments" in arrays else ()
        if "points" in arrays:  # a table (n, 3) instead of three columns
            points = arrays.pop("points")
            arrays = {**dict(zip(XYZ, points.T, strict=True)), **arrays}
        return PointTable(arrays, comments)


def write_column_archive(path: str | os.PathLike, table: PointTable) -> None:
    """Write every column, and the remarks as one text."""
    npz.save_npz(path, **table.columns, comments=np.array("\n".join(table.comments)))


COLUMN_ARCHIVE = Format(
    "columns archive",
    (".npz",),
    read_column_archive,
    write_column_archive,
    keeps=frozenset({Keeps.COLUMNS, Keeps.REMARKS, Keeps.HARMONICS}),
)


# Text clouds, .xyz: rows of x y z and further columns; read only, since names have no place.

_DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+([eE][-+]?\d+)?")
_SYMBOL = re.compile(r"[A-Z][a-z]?\d*")  # of a chemical element


def read_xyz(path: str | os.PathLike) -> PointTable:
    """Read rows of numbers between blanks, tabs, commas or semicolons, and a header of names.

    Columns without a name are column_3, column_4 ...; a first line that counts the rows goes.

    Raises InputError: For atoms of a molecule, and where the first column counts the rows.
    """
    with reading(path, Note("table.text_file")) as source:
        text = source.read_text(encoding="utf-8-sig", errors="replace")
        lines = [line.strip() for line in text.splitlines() if line.strip()]
        marked = [line.lstrip("#/ ") for line in lines if line.startswith(("#", "//"))]
        lines = [line for line in lines if not line.startswith(("#", "//"))]
        # Blanks between numbers: then a comma within one is its decimal point
        some = lines[-1:] or [""]
        between = ";" if ";" in some[0] else None
        if all(_DECIMAL_COMMA.fullmatch(word.strip()) for word in some[0].split(between)):
            lines = [line.replace(",", ".") for line in lines]
        rows = [line.replace(";", " ").replace(",", " ").split() for line in lines]
        if any(len(row) > 3 and _SYMBOL.fullmatch(row[0]) for row in rows[1:3]):
            raise InputError("table.atoms")
        if len(rows) > 1 and len(rows[0]) == 1 and rows[0][0] == str(len(rows) - 1):
            rows = rows[1:]
        header = marked[-1].replace(",", " ").split() if marked else []
        if rows and not _is_number(rows[0][0]):
            header, rows = rows[0], rows[1:]
        table = np.array(rows, dtype=np.float64)
        if table.ndim != 2 or table.shape[1] < 3:
            raise InputError("table.rows_numbers", shape=table.shape[-1])
        named = [name.lower() for name in header]
        if len(named) != table.shape[1] or not {*XYZ} <= {*named} or len({*named}) < len(named):
            named = [*XYZ, *(f"column_{i}" for i in range(3, table.shape[1]))]
            if table.shape[1] > 3 and (np.diff(table[:, 0]) == 1).all() and len(table) > 2:
                raise InputError("table.counted")
        return PointTable(dict(zip(named, table.T, strict=True)))


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


XYZ_FILE = Format("text cloud", (".xyz",), read_xyz)


# The file of a point table by its suffix: read and written with all that its format keeps.

log = logging.getLogger(__name__)


def read_points(path: str | os.PathLike) -> PointTable:
    """Read a point cloud or Gaussian splats by suffix.

    Parameters
    ----------
    path
        File: .ply, .pcd, .las, .xyz, .npz, .splat, .spz, .ksplat ...

    Returns
    -------
    PointTable
        Every column as it stands there; positions in the unit of the file, often [m].

    Raises
    ------
    InputError
        Where the suffix is unknown, or the file cannot be read.

    Examples
    --------
    >>> import numpy as np
    >>> from autophyx_tet.converters import PointTable, read_points, write_points
    >>> write_points("points.ply", PointTable({name: np.arange(2.0) for name in "xyz"}))
    >>> read_points("points.ply").positions.tolist()
    [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]]
    """
    reader = format_of(path, POINT_FORMATS).read
    if reader is None:
        raise InputError("table.format_written", path=path)
    return reader(path)


def write_points(path: str | os.PathLike, table: PointTable) -> None:
    """Write a table in a format with room for its columns, all or nothing; losses are logged.

    Parameters
    ----------
    path
        File to write: .ply, .pcd, .las, .npz, .splat, .spz ...
    table
        Points, in the unit that the file shall have, often [m].

    Returns
    -------
    None
        The file is whole, or not there.

    Raises
    ------
    InputError
        Where the suffix is unknown or cannot be written.

    Examples
    --------
    >>> import numpy as np
    >>> from autophyx_tet.converters import PointTable, read_points, write_points
    >>> table = PointTable({name: np.zeros(1) for name in "xyz"})
    >>> write_points("one.npz", table.with_columns({"E": np.full(1, 1e6)}))  # Pa
    >>> read_points("one.npz").columns["E"].tolist()
    [1000000.0]
    """
    chosen = format_of(path, POINT_FORMATS)
    if chosen.write is None:
        room = ", ".join(written(POINT_FORMATS))
        raise InputError("table.room_further", path=path, title=chosen.title, room=room)
    chosen.write(path, table)
    if lost := point_losses(path, table):
        log.warning(warn_of_losses(path, chosen, lost))


def point_losses(path: str | os.PathLike, table: PointTable) -> tuple[Keeps, ...]:
    """What of the table a file of that suffix does not keep."""
    form = format_of(path, POINT_FORMATS)
    lost = form.loses(table.items())
    foreign = table.others is not None and table.others.names and table.others.title != form.title
    return (*lost, Keeps.OTHERS) if foreign and Keeps.OTHERS not in lost else lost
