"""LAS and LAZ clouds through laspy (extra ``las``): further columns as extra dimensions."""

from __future__ import annotations

import os

import numpy as np

from ...fem.errors import InputError
from ...fem.note import Note
from ..files import check_las, reading, writing
from ..registry import Format, Keeps
from .table import XYZ, Others, PointTable

WANTED = Note("las.las_laz")
_TITLE = "LAS or LAZ cloud"


def read_las(path: str | os.PathLike) -> PointTable:
    """Read a LAS or LAZ cloud: scaled x, y, z, then every other dimension by name."""
    with reading(path, WANTED) as source:
        check_las(source)
        cloud = _laspy().read(source)
        columns = {name: np.asarray(cloud[name]) for name in XYZ}
        for name in cloud.point_format.dimension_names:
            if name not in ("X", "Y", "Z"):
                columns[name] = np.asarray(cloud[name])
        records = (
            f"record {record.description or record.record_id}" for record in cloud.header.vlrs
        )
        return PointTable(columns, others=Others(_TITLE, tuple(records), cloud))


def write_las(path: str | os.PathLike, table: PointTable) -> None:
    """Write a cloud that was read from LAS: its own dimensions as they were, new ones appended."""
    laspy = _laspy()
    read = None if table.others is None else table.others.value
    if not isinstance(read, laspy.LasData):
        raise InputError("las.only_cloud", path=path)
    cloud = laspy.LasData(read.header, read.points.copy())
    known = {*cloud.point_format.dimension_names, *XYZ}
    new = [name for name in table.columns if name not in known]
    cloud.add_extra_dims([laspy.ExtraBytesParams(name, table.columns[name].dtype) for name in new])
    for name, values in table.columns.items():
        if name in new or not np.array_equal(np.asarray(cloud[name]), values):
            cloud[name] = values
    with writing(path) as target:
        cloud.write(str(target))


LAS = Format(
    _TITLE,
    (".las", ".laz"),
    read_las,
    write_las,
    keeps=frozenset({Keeps.COLUMNS, Keeps.HARMONICS, Keeps.OTHERS}),
)


def _laspy():
    try:
        import laspy
    except ImportError as error:
        raise InputError("las.las_needs") from error
    return laspy
