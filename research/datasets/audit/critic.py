"""The critic: whether pictures of an object show its parts where the words for them say.

UniPixie supplement, A.1.1, stage 2, with the numeric critic of ``images.segmentation``: several
sets of words are tried, the most coherent one wins, and below a threshold a person is asked. Of
procedural objects the parts are known, so that it can be told how far the critic is right.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ....fem.table import load_colours
from ....predictors.appearance.features import features_of_views, matter_bounds, render_grid
from ....predictors.appearance.segmentation import best_segmentation
from ....predictors.appearance.surface import opaque_density
from ....predictors.appearance.views import hemisphere
from ....predictors.encoders import Encoder
from ....predictors.grid import Grid
from ..lab import srgb_of_lab
from .actor import AuditObject
from .proposal import Proposal

SETS = 3  # of words: each part's first synonyms, their second ones, ...
VIEWS, PIXELS = 6, 128
COHERENT = 0.5  # coherence below which a person looks
_GREY = (0.5, 0.5, 0.5)  # of matter that has no typical colour


class Review(NamedTuple):
    """The best set of words, its coherence in [0, 1], and the share of cells that it puts right."""

    keywords: tuple[str, ...]
    coherence: float
    right: float

    @property
    def accepted(self) -> bool:
        """Whether no person needs to look."""
        return self.coherence >= COHERENT

    def document(self) -> dict[str, Any]:
        """Plain data."""
        return {**self._asdict(), "accepted": self.accepted}


Critic = Callable[[AuditObject, Proposal], Review | None]


def critic_of(encoder: Encoder) -> Critic:
    """Return a critic that sees by an encoder; of things in one part it says nothing."""

    def critic(thing: AuditObject, proposal: Proposal) -> Review | None:
        names = list(thing.parts)
        if len(names) < 2:
            return None
        words = [proposal.parts[name].synonyms or (name,) for name in names]
        sets = [[own[k % len(own)] for own in words] for k in range(SETS)]
        grid = Grid(np.zeros(3), 1 / max(thing.part.shape), thing.part.shape)
        density = opaque_density(thing.part >= 0, grid)
        cameras = hemisphere(matter_bounds(density, grid), count=VIEWS, pixels=PIXELS)
        pictures = render_grid(density, _painted(thing), grid, cameras)
        seen = features_of_views(pictures, density, grid, encoder=encoder)
        found = best_segmentation(seen.values, seen.cells, sets, encoder)
        true = thing.part[tuple(seen.cells.T)]
        right = (found.label == true)[true >= 0]  # a hollow is filled, and of no part
        return Review(found.keywords, found.coherence.score, float(right.mean()))

    return critic


def _painted(thing: AuditObject) -> np.ndarray:
    """Colours (x, y, z, 3) of an object: of every part the typical one of its first matter."""
    known = load_colours()
    first = [known.get(named.materials[0].name) for named in thing.parts.values()]
    colours = [_GREY if c is None else srgb_of_lab(np.array([c.L, c.a, c.b])) for c in first]
    return np.array([*colours, _GREY])[thing.part]
