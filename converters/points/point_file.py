"""The file of a point table by its suffix: read and written with all that its format keeps."""

from __future__ import annotations

import logging
import os

from ...fem.errors import InputError
from ..registry import POINT_FORMATS, Keeps, format_of, told_lost, written
from .table import PointTable

log = logging.getLogger(__name__)


def read_points(path: str | os.PathLike) -> PointTable:
    """Read a point cloud or Gaussian splats by suffix."""
    reader = format_of(path, POINT_FORMATS).read
    if reader is None:
        raise InputError(f"{path}: its format is written only")
    return reader(path)


def write_points(path: str | os.PathLike, table: PointTable) -> None:
    """Write a table in a format with room for its columns, all or nothing; losses are logged."""
    chosen = format_of(path, POINT_FORMATS)
    if chosen.write is None:
        room = ", ".join(written(POINT_FORMATS))
        raise InputError(f"{path}: {chosen.title} has no room for further columns; {room} have")
    chosen.write(path, table)
    if lost := point_losses(path, table):
        log.warning(told_lost(path, chosen, lost))


def point_losses(path: str | os.PathLike, table: PointTable) -> tuple[Keeps, ...]:
    """What of the table a file of that suffix does not keep."""
    form = format_of(path, POINT_FORMATS)
    lost = form.loses(table.items())
    foreign = table.others is not None and table.others.names and table.others.title != form.title
    return (*lost, Keeps.OTHERS) if foreign and Keeps.OTHERS not in lost else lost
