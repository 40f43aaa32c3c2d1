"""LAS and LAZ clouds through laspy (extra ``las``): further columns as extra dimensions."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np

from ...fem.errors import InputError
from ..announced_sizes import check_las
from ..files import reading, writing
from .table import PointTable

if TYPE_CHECKING:
    pass

WANTED = "a LAS or LAZ point cloud"
_XYZ = ("x", "y", "z")


def read_las(path: str | os.PathLike) -> PointTable:
    """Read a LAS or LAZ cloud: scaled x, y, z, then every other dimension by name."""
    with reading(path, WANTED) as source:
        check_las(source)
        cloud = _laspy().read(source)
        columns = {name: np.asarray(cloud[name]) for name in _XYZ}
        for name in cloud.point_format.dimension_names:
            if name not in ("X", "Y", "Z"):
                columns[name] = np.asarray(cloud[name])
        return PointTable(columns, keep=cloud)


def write_las(path: str | os.PathLike, table: PointTable) -> None:
    """Write a cloud that was read from LAS: its own dimensions as they were, new ones appended."""
    laspy = _laspy()
    if not isinstance(table.keep, laspy.LasData):
        raise InputError(f"{path}: only a cloud read from LAS or LAZ can be written as one")
    cloud = laspy.LasData(table.keep.header, table.keep.points.copy())
    known = {*cloud.point_format.dimension_names, *_XYZ}
    new = [name for name in table.columns if name not in known]
    cloud.add_extra_dims([laspy.ExtraBytesParams(name, table.columns[name].dtype) for name in new])
    for name, values in table.columns.items():
        if name in new or not np.array_equal(np.asarray(cloud[name]), values):
            cloud[name] = values
    with writing(path) as target:
        cloud.write(str(target))


def _laspy():
    try:
        import laspy
    except ImportError as error:
        raise InputError("LAS needs laspy: pip install 'autophyx-tet[las]'") from error
    return laspy
