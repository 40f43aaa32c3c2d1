"""Sweeps: one body under many loads and moduli, by its reduced model or a reduced linear family.

Stiffness and mass of a family are sums over groups of tets, each times numbers of its E, nu and
rho: pulled back once, a member of the family costs small dense matrices. The basis holds what the
full body does at the ends of every range and where it was still wrong (reduced basis method, Rozza,
Huynh & Patera 2008): responses to the loads, and one inverse iteration of the vibrations.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from ..device import single_threaded
from ..elements.assembly import (
    apply_supports,
    discretise,
    linear_stiffness,
    node_supports,
    stiffness,
)
from ..elements.forces import lumped_mass, mass_fractions
from ..errors import ConvergenceError, InputError
from ..laws.law import Law
from ..linalg.cholesky import CholeskyFactor, planned_elimination
from ..material import ElementMaterial, isotropic_tensor, lame_parameters
from ..mesh import TetMesh, material_of
from ..note import Note
from ..scene.supports import Supports
from ..solve.modal import natural_modes
from ..solve.nonlinear import solve_nonlinear
from .basis import orthonormal_fields, relative_error
from .elasticity import ReducedElasticity, reduced_frequencies, reduced_rest
from .model import ReducedModel

# Where a load is too much for Newton's method at once it comes on in so many steps.
LOAD_STEPS = 4


class WhatIf(NamedTuple):
    """Answers of every run.

    ``coordinates`` (runs, dofs) [m sqrt(kg)] at rest, ``largest`` (runs,) displacement of a point
    [m], ``frequency`` (runs,) the first one about the unloaded body [Hz]. NaN: no rest was found.
    """

    coordinates: np.ndarray
    largest: np.ndarray
    frequency: np.ndarray


class WhatIfError(NamedTuple):
    """Reduced runs beside the full body's, for those ``runs`` that were solved in full too.

    Relative errors [1] of the displacement at ``rest``, in the norm of mass, and of the first
    ``frequency``, each (runs,). Of ``unsolved`` others the full body found no rest.
    """

    runs: np.ndarray
    rest: np.ndarray
    frequency: np.ndarray
    unsolved: int


@single_threaded
def what_if(
    model: ReducedModel,
    *,
    scales: Float[np.ndarray, "runs parts"],
    loads: Float[np.ndarray, "runs dofs"],
    law: str = Law.NEO_HOOKEAN,
) -> WhatIf:
    """Rest and first frequency of a body in many runs.

    model: Reduced model of the body as it is held.
    scales: Factor [1] to E of every part, in the order of ``model.region_names``.
    loads: Dead forces on the coordinates [N/sqrt(kg)]; see ``ReducedModel.weight`` and
        ``pull_back``.
    law: Name of the elastic law.
    """
    names = model.region_names
    wanted = Note("sweep.wanted_positive", count=len(names))
    if scales.shape != (len(loads), len(names)):
        raise InputError("sweep.scales_runs", shape=scales.shape, count=len(loads), wanted=wanted)
    if (wrong := np.argwhere(~(scales > 0))).size:
        run, part = wrong[0]
        factor = scales[run, part]
        raise InputError(
            "sweep.run_factor", run=run + 1, factor=factor, names=names[part], wanted=wanted
        )
    elasticity = ReducedElasticity(model, law)
    coordinates = np.full(loads.shape, np.nan)
    frequency = np.empty(len(loads))
    for run, (scale, load) in enumerate(zip(scales, loads, strict=True)):
        elasticity.set_moduli(model.E * scale[model.region], model.nu)
        frequency[run] = reduced_frequencies(elasticity)[0]
        for steps in (1, LOAD_STEPS):
            q = np.zeros_like(load)
            try:
                for fraction in np.arange(1, steps + 1) / steps:
                    q = reduced_rest(elasticity, fraction * load, start=q, tolerance=1e-6).u
            except ConvergenceError:
                continue
            coordinates[run] = q
            break
    largest = np.array([np.linalg.norm(model.displacement(q), axis=1).max() for q in coordinates])
    return WhatIf(coordinates, largest, frequency)


def what_if_error(
    model: ReducedModel,
    found: WhatIf,
    mesh: TetMesh,
    supports: Supports,
    *,
    scales: Float[np.ndarray, "runs parts"],
    forces: Callable[[int], Float[np.ndarray, "nodes 3"]],
    count: int = 4,
    order: int = 1,
    seed: int = 0,
    law: str = Law.NEO_HOOKEAN,
) -> WhatIfError:
    """Solve ``count`` runs, the one that moves farthest among them, by the full body too.

    It has elements of ``order``, at least the model's: with 2 what linear ones lock is in the
    error. ``forces`` gives what the load of a run was pulled back from: [N] at the model's nodes.

    Raises ConvergenceError: Where no run has a rest.
    """
    if not np.isfinite(found.largest).any():
        raise ConvergenceError("sweep.none_runs", count=len(found.largest))
    farthest = int(np.nanargmax(found.largest))
    others = np.setdiff1d(np.flatnonzero(np.isfinite(found.largest)), [farthest])
    drawn = np.random.default_rng(seed).permutation(others)[: count - 1]
    solved, unsolved = [], 0
    for run in (farthest, *drawn):
        material = material_of(mesh)
        moduli = ElementMaterial(material.E * scales[run][mesh.region], material.nu, material.rho)
        body = mesh.with_material(moduli)
        try:
            full = solve_nonlinear(body, supports, forces=forces(int(run)), law=law, order=order)
            modes = natural_modes(body, 1, supports=supports, order=order, lumped=order == 1)
        except ConvergenceError:
            unsolved += 1
            continue
        u, target = model.displacement(found.coordinates[run]), full.node_displacement
        rest = relative_error(model, u, target[: len(model.points)])
        solved.append((run, rest, found.frequency[run] / modes.frequencies[0] - 1))
    runs, rests, frequencies = np.array(solved).reshape(-1, 3).T
    return WhatIfError(runs.astype(np.int64), rests, frequencies, unsolved)


# Numbers of a factor above which a family takes more than some seconds: a dozen are made.
MOST_ENTRIES = 10_000_000
# Snapshots that add less than this to the others are left out.
DEPENDENT = 1e-4
# Displacement fields that are made at a time.
AT_ONCE = 64


class Member(NamedTuple):
    """One body of a family, a value a group: factors to ``E`` and ``rho`` [1], and ``nu`` [1]."""

    E: Float[np.ndarray, "groups"]
    nu: Float[np.ndarray, "groups"]
    rho: Float[np.ndarray, "groups"]


class LinearFamily:
    """Members of a family of held bodies in few coordinates; what holds them must not be moved.

    The material of the tets of a group varies together; the stiffness of ``grained`` ones is a
    tensor, which nu does not change. ``forces`` [N] at the nodes are dead, ``gravity_vector``
    [m/s^2] acts on the mass, which varies; ``shapes`` are vibrations of the body as it is, with
    elements of ``order`` as all here.
    """

    def __init__(
        self,
        mesh: TetMesh,
        supports: Supports,
        groups: Bool[np.ndarray, "groups tets"],
        *,
        grained: Bool[np.ndarray, "groups"],
        forces: Float[np.ndarray, "nodes 3"],
        gravity_vector: Float[np.ndarray, "3"],
        shapes: Float[np.ndarray, "modes nodes 3"],
        order: int = 1,
    ) -> None:
        self.mesh, self.groups, self.grained = mesh, groups, grained
        self.grid = discretise(mesh, order)
        self.held = node_supports(supports, self.grid.space)
        self.forces, self.gravity, self.shapes = forces, np.asarray(gravity_vector, float), shapes
        mass, share = material_of(mesh).rho * mesh.volumes, mass_fractions(order)
        nodes, count = self.grid.space.elements.ravel(), len(self.grid.space.nodes)
        self._masses = [
            np.bincount(nodes, np.outer(np.where(tets, mass, 0.0), share).ravel(), count)
            for tets in groups
        ]
        self._rest = lumped_mass(mesh, self.grid.space) - sum(self._masses)
        self._snapshots: list[np.ndarray] = []

    @property
    def others(self) -> Bool[np.ndarray, "tets"]:
        """Tets whose material does not vary."""
        return np.asarray(~self.groups.any(axis=0))

    def affordable(self) -> bool:
        """Whether the full body is factored quickly enough to do it a dozen times."""
        plan = planned_elimination(self.grid.pattern, self.grid.space.edges)
        return plan.entries <= MOST_ENTRIES

    def material(self, member: Member) -> ElementMaterial:
        """Material of a member's tets."""
        base = material_of(self.mesh)
        E, nu, rho = (np.ones(len(base.E)), base.nu.copy(), np.ones(len(base.E)))
        for tets, *values in zip(self.groups, *member, strict=True):
            E[tets], nu[tets], rho[tets] = values
        tensor = base.tensor
        if tensor is not None:  # of the grain scaled, of the others anew
            grain = np.asarray(self.groups[self.grained].any(axis=0) | self.others)
            plain = isotropic_tensor(*lame_parameters(base.E * E, nu))
            tensor = np.where(grain[:, None, None], tensor * E[:, None, None], plain)
        return ElementMaterial(base.E * E, nu, base.rho * rho, tensor, base.axes)

    def mass(self, member: Member) -> Float[np.ndarray, "nodes"]:
        """Lumped mass [kg] of a member's nodes."""
        return self._rest + sum(r * m for r, m in zip(member.rho, self._masses, strict=True))

    def add(self, members: Iterable[Member]) -> list[np.ndarray]:
        """Solve ``members`` in full and let the basis hold what they do; their rests [m]."""
        rests = []
        for member in members:
            matrix = linear_stiffness(self.grid, self.material(member))
            apply_supports(matrix, self.held.fixed, self.held.springs)
            plan = planned_elimination(matrix, self.grid.space.edges)
            mass, factor = self.mass(member)[:, None], CholeskyFactor(matrix, plan)
            loads = [self.forces] + [m[:, None] * self.gravity for m in (*self._masses, self._rest)]
            loads += [mass * shape for shape in self.shapes]
            whole = self.forces + mass * self.gravity
            all_at_once = np.stack([*(f for f in loads if f.any()), whole], axis=2)
            *fields, rest = np.moveaxis(
                factor.solve(np.where(self.held.fixed[:, :, None], 0.0, all_at_once)), 2, 0
            )
            self._snapshots += fields
            rests.append(rest)
        # Basis of the snapshots, and what is summed for a member, on its coordinates
        fields = np.moveaxis(
            np.stack([*self._snapshots, *np.where(self.held.fixed, 0.0, self.shapes)]), 0, 2
        )
        mass = lumped_mass(self.mesh, self.grid.space)
        self.basis = orthonormal_fields(fields, mass, DEPENDENT)
        flat = self.basis.reshape(-1, self.basis.shape[2])
        pairs, rest = self._parts
        self._stiff = [(flat.T @ (one @ flat), flat.T @ (two @ flat)) for one, two in pairs]
        springs = self.held.springs.reshape(-1, 1) * flat
        self._stiff_rest = flat.T @ (rest @ flat + springs)
        self._mass_parts = [flat.T @ (m.repeat(3)[:, None] * flat) for m in self._masses]
        self._mass_rest = flat.T @ (self._rest.repeat(3)[:, None] * flat)
        weights = [m[:, None] * self.gravity for m in (*self._masses, self._rest)]
        self._loads = np.stack([f.ravel() @ flat for f in (self.forces, *weights)])
        return rests

    @cached_property
    def _parts(self) -> tuple[list[tuple[Any, Any]], Any]:
        """Stiffness of every group by lam and mu (of a grain: all, twice); of the rest."""
        pairs, none = [], np.zeros(len(self.mesh.tets))
        for tets, grained in zip(self.groups, self.grained, strict=True):
            E = np.where(tets, material_of(self.mesh).E, 0.0)
            if grained:
                pair = [self._stiffness_of(tets)] * 2
            else:  # without the blocks of others, on arrays of its own
                pair = [stiffness(self.grid, *m).to_scipy().copy() for m in ((E, none), (none, E))]
                for matrix in pair:
                    matrix.eliminate_zeros()
            pairs.append(tuple(pair))
        return pairs, self._stiffness_of(self.others)

    def _stiffness_of(self, tets: np.ndarray) -> Any:
        """Stiffness of some tets as they are: twice what is missing when they have half of it."""
        base = material_of(self.mesh)
        half = base.times(np.where(tets, 0.5, 1.0))
        whole, rest = (linear_stiffness(self.grid, m).to_scipy() for m in (base, half))
        return 2 * (whole - rest)

    def answers(
        self, member: Member
    ) -> tuple[Float[np.ndarray, "nodes 3"], Float[np.ndarray, "modes"]]:
        """Displacement at rest [m], and as many natural frequencies [Hz] as there are shapes."""
        rest, frequencies = self._reduced_answers(member)
        return self.basis @ rest, frequencies

    def largest(
        self, members: Sequence[Member]
    ) -> tuple[Float[np.ndarray, "members"], Float[np.ndarray, "members modes"]]:
        """Largest displacement at rest [m] and natural frequencies [Hz] of every member."""
        rests, frequencies = zip(*map(self._reduced_answers, members), strict=True)
        flat, sizes = self.basis.reshape(-1, self.basis.shape[2]), []
        for first in range(0, len(rests), AT_ONCE):  # all at once would take much memory
            u = flat @ np.stack(rests[first : first + AT_ONCE], axis=1)
            u = u.reshape(-1, 3, u.shape[1])
            sizes.append(np.sqrt(np.square(u).sum(axis=1).max(axis=0)))
        return np.concatenate(sizes), np.array(frequencies)

    def _reduced_answers(self, member: Member) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates of the displacement at rest, and natural frequencies [Hz]."""
        from scipy.linalg import eigh, solve

        K, M = self._stiff_rest.copy(), self._mass_rest.copy()
        for g, (first, second) in enumerate(self._stiff):
            unit = lame_parameters(np.ones(1), member.nu[g : g + 1])
            lam, mu = (1.0, 0.0) if self.grained[g] else (unit.lam[0], unit.mu[0])
            K += member.E[g] * (lam * first + mu * second)
            M += member.rho[g] * self._mass_parts[g]
        rest = solve(K, np.array([1.0, *member.rho, 1.0]) @ self._loads, assume_a="pos")
        count = len(self.shapes)
        if not count:
            return rest, np.zeros(0)
        square = eigh(K, M, eigvals_only=True, subset_by_index=[0, count - 1])
        return rest, np.sqrt(np.maximum(square, 0.0)) / (2 * np.pi)
