"""Finite elements: tetrahedra, materials, elasticity; usable alone, it imports no other room.

In: a mesh with E, nu, rho on every tet, and what holds, loads and meets it.
Out: how it settles, moves or rings, with verdicts; gradients by E, nu, rho.
Read: scene, conditions, laws, discrete, linalg, contact, result, solve, reduced, scenarios.

The public names load on first use: ``from autophyx_tet.fem import TetMesh, solve_static``.
"""

from __future__ import annotations

from .public_names import on_first_use

# Public name -> module that owns it.
_HOME = {
    "TetMesh": "scene.mesh",
    "ElementMaterial": "scene.material",
    "load_table": "scene.materials",
    "box_mesh": "scene.box",
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
    "BoundaryConditions": "conditions.boundary_conditions",
    "Law": "laws.law",
    "ElasticLaw": "laws.law",
    "LAWS": "laws.law",
    "StaticResult": "result",
    "SagResult": "result",
    "Motion": "result",
    "MotionResult": "result",
    "Modes": "result",
    "METHODS": "solve.method",
    "solve_static": "solve.statics",
    "nodal_stress": "solve.statics",
    "von_mises": "discrete.strain",
    "solve_nonlinear": "solve.nonlinear",
    "solve_averaged": "solve.nodal_pressure",
    "Dynamics": "solve.dynamics",
    "Damping": "damping.rayleigh",
    "Scheme": "solve.schemes",
    "natural_modes": "solve.modal",
    "static_displacement": "solve.gradients",
    "implicit_step": "solve.gradients",
    "MpmMethod": "mpm.method",
    "Substance": "mpm.classes",
    "rigid_labels": "mpm.rigid",
    "ReducedModel": "reduced.model",
    "reduce_body": "reduced.reduction",
    "SCENARIOS": "scenarios.scenario",
    "sag": "scenarios.sag",
    "hang": "scenarios.hang",
    "wind": "scenarios.wind",
    "poke": "scenarios.poke",
    "drop": "scenarios.drop",
    "squeeze": "scenarios.squeeze",
    "Check": "verdicts",
}
__all__ = [*_HOME]  # noqa: PLE0604  # pyright: ignore[reportUnsupportedDunderAll]
__getattr__, __dir__ = on_first_use(__name__, _HOME)
