"""Finite elements: tetrahedra, materials, elasticity; usable alone, it imports no other room.

In: a mesh with E, nu, rho on every tet, and what holds, loads and meets it.
Out: how it settles, moves or rings; gradients by E, nu, rho.
Read: mesh, material, scene, laws, elements, linalg, solve, mpm, reduced, springs, scenarios.

The public names load on first use: ``from autophyx_tet.fem import TetMesh, solve_static``.
"""

from __future__ import annotations

from .registry import on_first_use

# Public name -> module that owns it.
_HOME = {
    "TetMesh": "mesh",
    "ElementMaterial": "material",
    "load_table": "table",
    "box_mesh": "mesh",
    "Supports": "scene.supports",
    "Traction": "scene.loads",
    "pressure": "scene.loads",
    "spread_force": "scene.loads",
    "spread_torque": "scene.loads",
    "Plane": "scene.obstacles",
    "Box": "scene.obstacles",
    "Sphere": "scene.obstacles",
    "Capsule": "scene.obstacles",
    "gripper": "scene.obstacles",
    "Scene": "scene.scene",
    "BoundaryConditions": "scene.conditions",
    "Law": "laws.law",
    "ElasticLaw": "laws.law",
    "LAWS": "laws.law",
    "StaticResult": "solve.result",
    "SagResult": "solve.result",
    "Motion": "solve.result",
    "MotionResult": "solve.result",
    "Modes": "solve.result",
    "METHODS": "solve.method",
    "solve_static": "solve.statics",
    "nodal_stress": "solve.statics",
    "von_mises": "elements.elastic",
    "solve_nonlinear": "solve.nonlinear",
    "Dynamics": "solve.dynamics",
    "Damping": "solve.dynamics",
    "Scheme": "solve.schemes",
    "natural_modes": "solve.modal",
    "static_displacement": "solve.gradients",
    "implicit_step": "solve.gradients",
    "MpmMethod": "mpm.method",
    "Substance": "mpm.materials",
    "rigid_labels": "mpm.particles",
    "ReducedModel": "reduced.model",
    "reduce_body": "reduced.basis",
    "SCENARIOS": "solve.method",
    "sag": "scenarios",
    "hang": "scenarios",
    "wind": "scenarios",
    "poke": "scenarios",
    "drop": "scenarios",
    "squeeze": "scenarios",
}
__all__ = [*_HOME]  # noqa: PLE0604
__getattr__, __dir__ = on_first_use(__name__, _HOME)
