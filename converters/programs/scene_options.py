"""What the writer of a program may use beside the mesh."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...fem.scene.mesh import TetMesh
from ...fem.scene.supports import Supports
from ...predictors.asset import UpAxis
from ..mesh.meshdata import items_of
from ..registry import Keeps
from .material_bins import NameStyle


@dataclass(frozen=True)
class SceneOptions:
    """What the user says beside the mesh.

    ``names`` of the arrays, the axis ``up`` against gravity, its size ``gravity`` [m/s^2], the
    ``supports`` that hold the body, and the ``order`` of the elements; None: the program's choice.
    """

    names: NameStyle = "symbols"
    up: UpAxis = "z"
    gravity: float = 9.81
    supports: Supports | None = None
    order: Literal[1, 2] | None = None

    def items(self, mesh: TetMesh) -> Iterator[Keeps]:
        """What the files for ``mesh`` have to keep; what does not vary is no value a tet."""
        for item in items_of(mesh):
            if item not in _VARYING or _varies(getattr(mesh.material, _VARYING[item])):
                yield item
        if self.supports is not None:
            yield from _held(self.supports)
        if self.order == 2:
            yield Keeps.QUADRATIC


# Values of one part that went through a field differ in their last bits, and are one value.
_SAME = 1e-9
_VARYING = {Keeps.E: "E", Keeps.NU: "nu", Keeps.RHO: "rho"}


def _varies(values: np.ndarray) -> bool:
    return bool(np.ptp(values) > _SAME * values.max())


def _held(supports: Supports) -> Iterator[Keeps]:
    whole = supports.fixed.all(axis=1)
    if whole.any():
        yield Keeps.HELD
    if (supports.fixed.any(axis=1) & ~whole).any():
        yield Keeps.ROLLERS
    if supports.values[supports.fixed].any():
        yield Keeps.PRESCRIBED
    if supports.springs.any():
        yield Keeps.SPRINGS
