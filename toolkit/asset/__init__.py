"""Asset: a file read and made a surface that a mesher can take.

In: a path and the unit of its lengths.
Out: named triangles with colours in metres, closed, oriented, without what a surface cannot be.
Read: load, formats, readers, surface, repair, solids.
"""

from typing import Literal

Unit = Literal["mm", "cm", "m", "in"]  # of length, for files that do not say theirs
