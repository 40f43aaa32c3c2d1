"""A finger presses on a standing body."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..result import SagResult
from ..scene.loads import spread_force
from ..scene.mesh import TetMesh
from ..scene.scene import Scene
from ..scene.support_finder import find_supports, ground_under
from ..scene.up import UpAxis, up_vector
from ..solve.equilibrium import StaticMethod
from ..validation import checked_direction, checked_positive, checked_vector

# Radius of a finger as a share of the body's diagonal.
FINGER_SHARE = 0.05


@dataclass(frozen=True)
class Poke:
    """A finger pushes with ``force`` [N] along ``direction`` (down), ``at`` a point [m] (highest).

    The force is spread over a patch of a twentieth of the diagonal; the weight is left out.
    """

    title: ClassVar[str] = "Under a finger"
    method: ClassVar[str] = "statics"
    with_modes: ClassVar[bool] = False

    force: float = 10.0
    at: Sequence[float] | None = None
    direction: Sequence[float] | None = None

    def scene(self, mesh: TetMesh, *, up: UpAxis = "z") -> Scene:
        """Scene of the standing ``mesh``."""
        used = np.unique(mesh.tets)
        highest = mesh.points[used[np.argmax(mesh.points[used] @ up_vector(up))]]
        place = highest if self.at is None else checked_vector("poke at", self.at, "m")
        given = -up_vector(up) if self.direction is None else self.direction
        pushes = checked_direction("poke direction", given)
        force = checked_positive("poke force", self.force, "N")
        faces = mesh.boundary.faces
        away = np.linalg.norm(mesh.points[faces].mean(axis=1) - place, axis=1)
        patch = FINGER_SHARE * float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
        touched = faces[away <= max(patch, float(away.min()))]
        held, warnings = find_supports(mesh, up)
        loads = (spread_force(mesh, touched, force * pushes)._replace(name="the touched patch"),)
        stands = {"supports": held, "ground": ground_under(mesh, up)}
        return Scene(mesh=mesh, up=up, **stands, tractions=loads, warnings=warnings)


def poke(
    mesh: TetMesh,
    *,
    up: UpAxis = "z",
    force: float = 10.0,
    at: Sequence[float] | None = None,
    direction: Sequence[float] | None = None,
    order: int | None = None,
    law: str | None = None,
    device: str = "cpu",
) -> SagResult:
    """Press a finger on a standing ``mesh``; the weight is left out.

    Parameters
    ----------
    force
        Force of the finger [N], spread over a patch of a twentieth of the diagonal.
    at
        Where [m], shape (3,); by default the highest point.
    direction
        Where the finger pushes to; by default down.
    """
    scene = Poke(force, at, direction).scene(mesh, up=up)
    return StaticMethod().solve(scene, law=law, order=order, device=device)
