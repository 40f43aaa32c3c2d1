"""Rows of the evaluation by name: the network, whole or deprived of something, and baselines."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, runtime_checkable

from ...fem.registry import Registry

if TYPE_CHECKING:
    from ...predictors.encoders import TextEncoder
    from ..datasets.text_table import TextTable
    from .held_out import HeldOutObject

# An object in; normalised values (1, 3, x, y, z) and the logits of the binding (or None) out.
VoxelPredictor = Callable[["HeldOutObject"], tuple[Any, Any]]


class Setting(NamedTuple):
    """What a row may be built from.

    ``text`` holds all clauses of the run, ``weights`` a checkpoint of the network (the shipped one
    by default); ``words`` are those of the image encoder that sees the objects.
    """

    text: TextTable
    weights: Path | None = None
    words: TextEncoder | None = None


@runtime_checkable
class Contender(Protocol):
    """Who is compared in a row; ``names``: whether it sees what the asset calls its parts."""

    @property
    def names(self) -> bool:
        """Whether it sees what the asset calls its parts."""

    def build(self, setting: Setting) -> VoxelPredictor:
        """Return the predictor of the row."""


ROWS: Registry[Contender] = Registry(
    "row",
    __package__ or "",
    {
        "film": "ablations:FILM",
        "film-names": "ablations:FILM_NAMES",
        "film-assigned": "ablations:ASSIGNED",
        "film-nofeatures": "ablations:NO_FEATURES",
        "film-rgb": "ablations:RGB",
        "film-notext": "ablations:NO_TEXT",
        "film-nohints": "ablations:NO_HINTS",
        "film-nolooks": "ablations:NO_LOOKS",
        "film-voxels": "ablations:VOXELS",
        "film-voxels-nolooks": "ablations:VOXELS_NO_LOOKS",
        "unipixie": "ablations:UNIPIXIE",
        "unipixie-names": "ablations:UNIPIXIE_NAMES",
        "constant": "baselines:CONSTANT",
        "table-mean": "baselines:TABLE_MEAN",
        "table-first": "baselines:TABLE_FIRST",
        "retrieval": "baselines:RETRIEVAL",
        "pixie": "ablations:NO_TEXT",
    },
)
BASELINES = ("constant", "table-mean", "table-first", "retrieval", "pixie")
DEFAULT_ROWS = ("film", *BASELINES)
