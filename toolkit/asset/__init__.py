"""Asset: a file read and made a surface that a mesher can take.

In: a path and the unit of its lengths.
Out: named triangles with colours in metres, closed, oriented, without what a surface cannot be.
Read: load, formats, readers, surface, repair, solids.
"""

import os
from pathlib import Path
from typing import Literal, TypeAlias, overload

Unit = Literal["mm", "cm", "m", "in"]  # of length, for files that do not say theirs


AnyPath: TypeAlias = str | os.PathLike[str]


@overload
def path_of(path: AnyPath) -> Path: ...
@overload
def path_of(path: AnyPath | None) -> Path | None: ...
def path_of(path: AnyPath | None) -> Path | None:
    """Path of what a user gives as a text or as a path; None where nothing is given."""
    return None if path is None else Path(path)
