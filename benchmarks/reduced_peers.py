"""Others' ways to reduce a body, for `reduced.py`: their handles, cubature and modes."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from autophyx_tet.fem.elements.space import extend_linear
from autophyx_tet.fem.mesh import TetMesh
from autophyx_tet.fem.reduced.basis import (
    LinearBody,
    laplacian_weights,
    linear_body,
    orthonormal_fields,
    skinned_basis,
    skinned_functions,
    whole_model,
)
from autophyx_tet.fem.reduced.model import ReducedModel, Subspace
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.modal import natural_modes
from autophyx_tet.fem.solve.schemes import Kinematics, Scheme, Step
from real_meshes import cache_folder
from simplicits_weights import kept_weights

# Tets that a cubature of equal weights draws, by volume.
DRAWN = 500
# Stiffness of what pins a free basis, over the stiffest E times the length of a tet.
PINNED = 1.0


@dataclass(frozen=True)
class Reduced:
    """A model with its ``label``, CPU seconds to make it, and ``law`` of its motion.

    ``told``: whether the motion says how far off it is.
    """

    label: str
    model: ReducedModel
    made: float
    options: dict[str, Any] = field(default_factory=dict)
    told: bool = False


def timed(make):
    """What ``make`` returns, and its CPU seconds."""
    started = time.process_time()
    return make(), time.process_time() - started


def equal_weights(mesh: TetMesh, held: Supports, model: ReducedModel) -> ReducedModel:
    """Peers' cubature: 500 tets drawn by volume, all of the same weight."""
    body = linear_body(mesh, held, order=model.order)
    whole = replace(whole_model(body, model.basis, model.kind), springs=model.springs)
    share = whole.weights / mesh.volume
    drawn = np.random.default_rng(0).choice(len(share), DRAWN, p=share)
    return whole.on_cells(drawn, np.full(DRAWN, mesh.volume / DRAWN))


def peers(name: str, mesh: TetMesh, held: Supports, order: int) -> Iterator[Reduced]:
    """Laplacian handles, Simplicits' network, and linear modes with all tets."""
    linear, fixed = linear_body(mesh, held, order=order), held.fixed.any(axis=1)
    weights, seconds = timed(
        lambda: extend_linear(linear.space, laplacian_weights(mesh, 10, fixed))
    )
    functions = skinned_functions(linear, weights, free=False)
    model = whole_model(linear, skinned_basis(functions), Subspace.SKINNING)
    yield Reduced("Laplacian handles", model, seconds)
    weights, seconds = kept_weights(name, mesh, cache_folder())
    weights = extend_linear(linear.space, weights)
    model = pinned(linear, skinned_functions(linear, weights, free=True))
    yield Reduced("Simplicits' network", model, seconds)
    drawn = equal_weights(mesh, held, model)
    yield Reduced("Simplicits' network, 500 equal weights", drawn, seconds)
    shapes, seconds = timed(
        lambda: natural_modes(mesh, 20, supports=held, order=order, lumped=True).shapes
    )
    basis = orthonormal_fields(np.moveaxis(shapes, 0, 2), linear.mass)
    model = whole_model(linear, basis, Subspace.VECTOR)
    yield Reduced("20 linear modes", model, seconds, {"law": "linear"})


def pinned(body: LinearBody, functions: np.ndarray) -> ReducedModel:
    """Model of ``functions`` that no support has made vanish: stiff springs hold its points."""
    model, mesh = whole_model(body, skinned_basis(functions), Subspace.SKINNING), body.mesh
    stiffness = PINNED * mesh.material.E.max() * (mesh.volume / len(mesh.tets)) ** (1 / 3)
    flat = model.basis[body.held.fixed]
    return replace(model, springs=stiffness * flat.T @ flat)


def modal_path(
    stiffness: np.ndarray, load: np.ndarray, velocity: np.ndarray, dt: float, frames: int
) -> list[np.ndarray]:
    """Coordinates of linear modes, each for itself, by the same BDF2 steps."""
    square, modes = np.linalg.eigh(stiffness)
    push, still = modes.T @ load, np.zeros_like(load)
    now, before, path = Kinematics(still, modes.T @ velocity, push), None, []
    for _ in range(frames):
        step = Step.of(Scheme.BDF2, dt, now, before)
        q = (step.factor * step.target + push) / (step.factor + square)
        now, before = step.ended(q), now
        path.append(modes @ q)
    return path
