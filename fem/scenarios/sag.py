"""A body settles under its own weight."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ..errors import InputError
from ..result import SagResult
from ..scene.mesh import TetMesh
from ..scene.scene import Scene
from ..scene.support_finder import find_supports, ground_under
from ..scene.up import UpAxis, up_vector
from ..solve.equilibrium import StaticMethod
from ..validation import checked_number

SUPPORTS = ("base", "three-point")


@dataclass(frozen=True)
class Sag:
    """It stands on its ``supports`` under ``gravity`` [m/s^2], downwards.

    'base': the nodes near the lowest point are clamped; 'three-point': it rests on three of them,
    free to expand sideways.
    """

    title: ClassVar[str] = "Sag under its own weight"
    method: ClassVar[str] = "statics"
    with_modes: ClassVar[bool] = True

    supports: str = "base"
    gravity: float = 9.81

    def scene(self, mesh: TetMesh, *, up: UpAxis = "z") -> Scene:
        """Scene of the standing ``mesh``."""
        if self.supports not in SUPPORTS:
            raise InputError(f"supports {self.supports!r}: wanted one of {', '.join(SUPPORTS)}")
        held, warnings = find_supports(mesh, up, three_point=self.supports == "three-point")
        weight = -checked_number("gravity", self.gravity, "m/s^2", least=0.0) * up_vector(up)
        stands = {"supports": held, "ground": ground_under(mesh, up)}
        return Scene(mesh=mesh, up=up, **stands, gravity_vector=weight, warnings=warnings)


def sag(
    mesh: TetMesh,
    *,
    up: UpAxis = "z",
    order: int | None = None,
    supports: str = "base",
    gravity: float = 9.81,
    law: str | None = None,
    device: str = "cpu",
) -> SagResult:
    """Let ``mesh`` settle under its weight.

    Parameters
    ----------
    mesh
        Tets with a material.
    up
        The axis that points up.
    order
        1: linear tets, 2: quadratic; None: quadratic while they are affordable.
    supports
        'base': the nodes near the lowest point are clamped; 'three-point': it rests on three of
        them, free to expand sideways.
    gravity
        Acceleration [m/s^2], downwards.
    law
        None: the linear law, and neo-Hookean where the linear answer strains more than 5 %.
        ``Law.LINEAR``: never repeat.
    device
        'cpu' or 'cuda'.

    Raises
    ------
    ConvergenceError
        If the linear solve does not reach its tolerance.
    """
    scene = Sag(supports, gravity).scene(mesh, up=up)
    return StaticMethod().solve(scene, law=law, order=order, device=device)
