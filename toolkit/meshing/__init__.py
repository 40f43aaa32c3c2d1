"""Meshing: closed surfaces are filled with tets, and what the mesh keeps is proved.

In: an asset of named surfaces [m], or a file of tets.
Out: one watertight tet mesh [m] with a region a part, and its report.
Read: convert, guarantees, ftetwild, stuffing, messages.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from ...fem.errors import UsageError
from ...fem.registry import Registry

if TYPE_CHECKING:
    from ..asset.cache import Runner
    from ..asset.solids import Solids
    from .ftetwild import EngineTarget, Filling


class Mesher(Protocol):
    """Fills solids with tets."""

    def __call__(self, solids: Solids, target: EngineTarget, runner: Runner) -> Filling:
        """Fill ``solids`` [m] as the ``target`` asks; ``NoFilling`` or ``ChildFailure`` if not."""


# Stuffing for surfaces that are samples themselves, and where fTetWild takes too long; particles
# where neither gives a mesh and these will do.
AUTO, OR_PARTICLES = "auto", "auto-or-particles"
FTETWILD, STUFFING, PARTICLES = "ftetwild", "stuffing", "particles"
MESHERS: Registry[Mesher] = Registry(
    "mesher",
    __package__ or "",
    {
        FTETWILD: "ftetwild:run_engine",
        STUFFING: "stuffing.mesher:stuffed",
        PARTICLES: "stuffing.mesher:filled",
    },
)


def chosen_mesher(name: str, *, sampled: bool) -> str:
    """Return ``name`` if it is a mesher; the automatic one of ``sampled`` surfaces is a lattice."""
    name = AUTO if name == OR_PARTICLES else name
    if name not in (AUTO, *MESHERS):
        raise UsageError(MESHERS.unknown(name))
    return STUFFING if name == AUTO and sampled else name
