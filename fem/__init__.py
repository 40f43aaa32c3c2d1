"""Ground floor: tetrahedra, materials, elasticity. Usable alone; imports nothing else of ours.

The public names load on first use: ``from autophyx_tet.fem import TetMesh, solve_static``.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

# Public name -> module that owns it.
_HOME = {
    "TetMesh": "mesh",
    "ElementMaterial": "material",
    "box_mesh": "box",
    "Supports": "supports",
    "Traction": "loads",
    "pressure": "loads",
    "Law": "elastic",
    "StaticResult": "statics",
    "solve_static": "statics",
    "nodal_stress": "statics",
    "von_mises": "stress",
    "solve_nonlinear": "nonlinear",
    "solve_averaged": "averaged",
    "Dynamics": "dynamics",
    "Damping": "incremental",
    "Motion": "dynamics",
    "Scheme": "schemes",
    "Plane": "obstacles",
    "Box": "obstacles",
    "Sphere": "obstacles",
    "Capsule": "obstacles",
    "gripper": "obstacles",
    "Modes": "modal",
    "natural_modes": "modal",
    "SagResult": "scenarios",
    "sag": "scenarios",
    "hang": "scenarios",
    "wind": "scenarios",
    "poke": "scenarios",
    "MotionResult": "motions",
    "drop": "motions",
    "squeeze": "motions",
    "Check": "checks",
    "static_displacement": "gradients",
    "implicit_step": "gradients",
}
__all__ = [*_HOME]  # noqa: PLE0604  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_HOME[name]}", __name__), name)


def __dir__() -> list[str]:
    return sorted(__all__)
