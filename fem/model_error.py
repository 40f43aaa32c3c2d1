"""How far a motion in few coordinates is from the full body's."""

from __future__ import annotations

from typing import NamedTuple

# Beyond this share a reduced motion is not that of the full body.
MOTION_LIMIT = 0.05


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
