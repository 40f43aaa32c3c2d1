"""Ground floor: tetrahedra, materials, elasticity. Usable alone; imports nothing else of ours.

The public names load on first use: ``from autophyx_tet.fem import TetMesh, solve_static``.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

# Public name -> module that owns it.
_HOME = {
    "TetMesh": "scene.mesh",
    "ElementMaterial": "scene.material",
    "box_mesh": "scene.box",
    "Supports": "scene.supports",
    "Traction": "discrete.forces",
    "pressure": "discrete.forces",
    "Law": "discrete.elastic",
    "StaticResult": "solve.statics",
    "solve_static": "solve.statics",
    "nodal_stress": "solve.statics",
    "von_mises": "discrete.strain",
    "solve_nonlinear": "solve.nonlinear",
    "solve_averaged": "solve.nodal_pressure",
    "Dynamics": "solve.dynamics",
    "Damping": "solve.potential",
    "Motion": "solve.dynamics",
    "Scheme": "solve.schemes",
    "Plane": "scene.obstacles",
    "Box": "scene.obstacles",
    "Sphere": "scene.obstacles",
    "Capsule": "scene.obstacles",
    "gripper": "scene.obstacles",
    "Modes": "solve.modal",
    "natural_modes": "solve.modal",
    "SagResult": "scenarios.static",
    "sag": "scenarios.static",
    "hang": "scenarios.static",
    "wind": "scenarios.static",
    "poke": "scenarios.static",
    "MotionResult": "scenarios.motions",
    "drop": "scenarios.motions",
    "squeeze": "scenarios.motions",
    "Check": "verdicts",
    "static_displacement": "solve.gradients",
    "implicit_step": "solve.gradients",
}
__all__ = [*_HOME]  # noqa: PLE0604  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_HOME[name]}", __name__), name)


def __dir__() -> list[str]:
    return sorted(__all__)
