"""How far a motion is from the body's: by few coordinates, and by elements that lock."""

from __future__ import annotations

from typing import NamedTuple

# Beyond this share a reduced motion is not that of the full body.
MOTION_LIMIT = 0.05
# Linear elements bend as quadratic ones do while they are less than this many times as stiff.
BENDS_ALIKE = 1.1


class ModelError(NamedTuple):
    """Error of a motion, estimated beside it.

    ``share`` [1] is over the motion, all frames together in the norm of mass, ``largest`` [m] that
    of a point in a frame.
    """

    share: float
    largest: float

    @property
    def words(self) -> str:
        """The error in a few words."""
        return f"about {100 * self.share:.2g} % of the motion, at most {self.largest:.2g} m"


def too_coarse(stiffening: float) -> str | None:
    """Say that linear elements are so many times too stiff [1] in bending; None where not."""
    if not stiffening > BENDS_ALIKE:
        return None
    return (
        f"the mesh is too coarse for linear elements: {stiffening:.2g} times too stiff in bending"
    )
