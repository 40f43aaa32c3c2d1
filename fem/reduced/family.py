"""One linear body with many moduli and densities: a basis that can follow all of them.

Stiffness and mass are sums over groups of tets, each times numbers of its E, nu and rho: pulled
back once, a member of the family costs small dense matrices. The basis holds what the full body
does at the ends of every range and where it was still wrong (reduced basis method, Rozza, Huynh &
Patera 2008): responses to the loads, and one inverse iteration of the vibrations.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from ..cholesky.elimination import planned_elimination
from ..cholesky.factor import CholeskyFactor
from ..discrete.assembly import discretise, linear_stiffness, stiffness
from ..discrete.constraints import apply_supports, node_supports
from ..discrete.mass import lumped_mass
from ..scene.material import ElementMaterial, isotropic_tensor, lame_parameters
from ..scene.mesh import TetMesh, material_of
from ..scene.supports import Supports
from .subspace import orthonormal_fields

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
    """Members of a family of held bodies in few coordinates.

    Parameters
    ----------
    mesh, supports
        The body; what holds it must not be moved.
    groups
        Tets whose material varies together, shape (groups, tets).
    grained
        Groups whose stiffness is a tensor: nu does not change it.
    forces
        Dead forces [N] at the points, shape (points, 3).
    gravity_vector
        Acceleration [m/s^2] on the mass, which varies, shape (3,).
    shapes
        Vibrations of the body as it is, shape (modes, points, 3).
    """

    def __init__(
        self,
        mesh: TetMesh,
        supports: Supports,
        groups: Bool[np.ndarray, "groups tets"],
        *,
        grained: Bool[np.ndarray, "groups"],
        forces: Float[np.ndarray, "points 3"],
        gravity_vector: Float[np.ndarray, "3"],
        shapes: Float[np.ndarray, "modes points 3"],
    ) -> None:
        self.mesh, self.groups, self.grained = mesh, groups, grained
        self.grid = discretise(mesh, 1)
        self.held = node_supports(supports, self.grid.space)
        self.forces, self.gravity, self.shapes = forces, np.asarray(gravity_vector, float), shapes
        self._masses = [_mass_of(mesh, tets) for tets in groups]
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
        known = material_of(self.mesh)
        E, nu, rho = (np.ones(len(known.E)), known.nu.copy(), np.ones(len(known.E)))
        for tets, *values in zip(self.groups, *member, strict=True):
            E[tets], nu[tets], rho[tets] = values
        tensor = None if known.tensor is None else self._tensor(E, nu)
        return ElementMaterial(known.E * E, nu, known.rho * rho, tensor, known.axes)

    def _tensor(self, E: np.ndarray, nu: np.ndarray) -> np.ndarray:
        """Stiffness tensors [Pa]: of the grain scaled, of the others anew."""
        known = material_of(self.mesh)
        assert known.tensor is not None
        scaled = known.tensor * E[:, None, None]
        grain = np.asarray(self.groups[self.grained].any(axis=0) | self.others)
        plain = isotropic_tensor(*lame_parameters(known.E * E, nu))
        return np.where(grain[:, None, None], scaled, plain)

    def mass(self, member: Member) -> Float[np.ndarray, "points"]:
        """Lumped mass [kg] of a member's points."""
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
        self._pull_back()
        return rests

    def _pull_back(self) -> None:
        """Basis of the snapshots, and what is summed for a member, on its coordinates."""
        fields = np.moveaxis(np.stack([*self._snapshots, *self._held_shapes()]), 0, 2)
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

    def _held_shapes(self) -> Float[np.ndarray, "modes points 3"]:
        return np.where(self.held.fixed, 0.0, self.shapes)

    @cached_property
    def _parts(self) -> tuple[list[tuple[Any, Any]], Any]:
        """Stiffness of every group by lam and mu (of a grain: all and nothing); of the rest."""
        known, pairs = material_of(self.mesh), []
        for tets, grained in zip(self.groups, self.grained, strict=True):
            E = np.where(tets, known.E, 0.0)
            none = np.zeros_like(E)
            if grained:
                empty = _trimmed(stiffness(self.grid, none, none).to_scipy())
                pairs.append((self._stiffness_of(tets), empty))
            else:
                moduli = ((E, none), (none, E))
                pairs.append(tuple(_trimmed(stiffness(self.grid, *m).to_scipy()) for m in moduli))
        return pairs, self._stiffness_of(self.others)

    def _stiffness_of(self, tets: np.ndarray) -> Any:
        """Stiffness of some tets as they are: twice what is missing when they have half of it."""
        known = material_of(self.mesh)
        share = np.where(tets, 0.5, 1.0)
        tensor = None if known.tensor is None else known.tensor * share[:, None, None]
        half = replace(known, E=known.E * share, tensor=tensor)
        whole, rest = (linear_stiffness(self.grid, m).to_scipy() for m in (known, half))
        return _trimmed(2 * (whole - rest))

    def matrices(self, member: Member) -> tuple[np.ndarray, np.ndarray]:
        """Stiffness [1/s^2] and mass [1] of a member on the coordinates, each (dofs, dofs)."""
        K, M = self._stiff_rest.copy(), self._mass_rest.copy()
        for g, (first, second) in enumerate(self._stiff):
            unit = lame_parameters(np.ones(1), member.nu[g : g + 1])
            lam, mu = (1.0, 0.0) if self.grained[g] else (unit.lam[0], unit.mu[0])
            K += member.E[g] * (lam * first + mu * second)
            M += member.rho[g] * self._mass_parts[g]
        return K, M

    def answers(
        self, member: Member
    ) -> tuple[Float[np.ndarray, "points 3"], Float[np.ndarray, "modes"]]:
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

        K, M = self.matrices(member)
        rest = solve(K, np.array([1.0, *member.rho, 1.0]) @ self._loads, assume_a="pos")
        count = len(self.shapes)
        if not count:
            return rest, np.zeros(0)
        square = eigh(K, M, eigvals_only=True, subset_by_index=[0, count - 1])
        return rest, np.sqrt(np.maximum(square, 0.0)) / (2 * np.pi)


def _trimmed(matrix: Any) -> Any:
    """``matrix`` (BSR) without the blocks that are zero."""
    from scipy.sparse import bsr_array

    some = matrix.data.any(axis=(1, 2))
    before = np.concatenate([[0], np.cumsum(some)])
    arrays = (matrix.data[some], matrix.indices[some], before[matrix.indptr])
    return bsr_array(arrays, shape=matrix.shape)


def _mass_of(mesh: TetMesh, tets: np.ndarray) -> Float[np.ndarray, "points"]:
    """Lumped mass [kg] of some tets."""
    known = material_of(mesh)
    each = np.where(tets, known.rho * mesh.volumes / 4, 0.0)
    return np.bincount(mesh.tets.ravel(), each.repeat(4), len(mesh.points))
