"""What is seen of the cells of an asset."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ..encoders.protocol import TextEncoder

# Opacity and ``surface_colour.Finish`` of what says none.
PLAIN_FINISH = (1.0, 0.0, 0.04, 0.6)


@dataclass(frozen=True, eq=False)
class Appearance:
    """What is seen of the cells: colours in [0, 1] (nx, ny, nz, 3), features (nx, ny, nz, D).

    ``words`` embeds clauses in the space of the features; ``finish`` (nx, ny, nz, 4) are opacity
    and ``surface_colour.Finish`` beside the colours. Any may be missing.
    """

    colours: np.ndarray | None = None
    features: np.ndarray | None = None
    words: TextEncoder | None = None
    finish: np.ndarray | None = None

    def looks(self, inside: np.ndarray) -> np.ndarray | None:
        """Colour and finish (n, 7) of the cells ``inside``, None where no colour is known."""
        if self.colours is None:
            return None
        colours = self.colours[inside]
        if self.finish is not None:
            return np.concatenate([colours, self.finish[inside]], axis=1)
        return np.concatenate([colours, np.tile(PLAIN_FINISH, (len(colours), 1))], axis=1)
