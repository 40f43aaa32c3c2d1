"""The reduced model of a body: what it takes to move it in a few coordinates, and nothing else."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ..errors import InputError
from ..material import LameParameters, lame_parameters

# The basis is orthonormal in mass to this: what a pivoted QR leaves is far below.
ORTHONORMAL = 1e-8


class Subspace(StrEnum):
    """What the coordinates move: fields of vectors, or handles that skin the body (LBS)."""

    VECTOR = "vector"
    SKINNING = "skinning"


class Accuracy(NamedTuple):
    """How good a model is, against the full body of the same elements.

    ``frequency`` is its lowest natural frequency [Hz] over that of the full body, ``sag`` the
    relative error [1] of its displacement under its own weight, in the norm of mass; by cubature
    alone, against all tets, ``cell_frequency`` and ``cell_sag``. ``motion`` is the error [1] of a
    motion, estimated. ``stiffening``: how many times as stiff these elements are as quadratic ones,
    1 of these. NaN: not measured.
    """

    frequency: float = np.nan
    sag: float = np.nan
    cell_frequency: float = np.nan
    cell_sag: float = np.nan
    motion: float = np.nan
    stiffening: float = np.nan

    @property
    def best_frequency(self) -> float:
        """Lowest natural frequency over that of quadratic elements [1], or of linear ones."""
        return self.frequency * float(np.sqrt(np.nan_to_num(self.stiffening, nan=1.0)))

    @property
    def cell_error(self) -> float:
        """Larger error of the cubature in frequency and sag, of what was measured [1]."""
        return float(np.nanmax([abs(self.cell_frequency - 1), self.cell_sag, 0.0]))


UNMEASURED = Accuracy()


@dataclass(frozen=True, eq=False, kw_only=True)
class ReducedModel:
    """A body whose displacement is u(x) = sum_a q_a U_a(x), in SI.

    The kinetic energy is |dq/dt|^2 / 2, since the U_a are orthonormal in mass: q has the unit
    m sqrt(kg). The elastic energy is sum_c w_c W(sum_a q_a grad U_a(c)) over the cells c.

    Parameters
    ----------
    points
        Rest positions [m] of the nodes, shape (nodes, 3): the points of the mesh, and of quadratic
        elements the middles of its edges after them.
    edges
        Points at the ends of every middle, shape (nodes - points, 2); of linear elements none.
    faces
        Boundary faces of the mesh, ids of points, outward, shape (faces, 3).
    mass
        Lumped mass of the nodes [kg], shape (nodes,).
    basis
        U_a at the nodes [1/sqrt(kg)], shape (nodes, 3, dofs); zero where the body is held. Of
        ``Subspace.SKINNING``: dofs = 3 m, and coordinate k m + a moves along axis k by the scalar
        function a, so that ``basis[:, k, k * m + a]`` is the same for the three k, and all else 0.
    kind
        What the coordinates move.
    cells, weights
        Where the elastic energy is summed: the tet of every quadrature point, shape (cells,), and
        the volume [m^3] that it stands for, not negative.
    gradients
        d U_a,i / d x_j there [1/(m sqrt(kg))], shape (cells, 3, 3, dofs).
    E, nu
        Young's modulus [Pa] and Poisson's ratio [1] of the cells, shape (cells,).
    region, region_names
        Part of every cell, an index into the names of the parts.
    springs
        Springs of the supports on the coordinates [1/s^2], shape (dofs, dofs).
    accuracy
        What it is worth; see ``Accuracy``.

    Examples
    --------
    >>> import numpy as np
    >>> from autophyx_tet.fem import ElementMaterial, Supports, box_mesh, reduce_body
    >>> bar = box_mesh((0.1, 0.1, 0.4), (1, 1, 4))
    >>> bar = bar.with_material(ElementMaterial.uniform(24, E=1e6, nu=0.3, rho=1e3))
    >>> model = reduce_body(bar, Supports.clamp(len(bar.points), bar.points[:, 2] == 0))
    >>> square = np.einsum("n,nka,nkb->ab", model.mass, model.basis, model.basis)
    >>> bool(np.allclose(square, np.eye(model.dofs)))  # orthonormal in mass
    True
    """

    points: Float[np.ndarray, "nodes 3"]
    edges: Int[np.ndarray, "edges 2"]
    faces: Int[np.ndarray, "faces 3"]
    mass: Float[np.ndarray, "nodes"]
    basis: Float[np.ndarray, "nodes 3 dofs"]
    kind: Subspace
    cells: Int[np.ndarray, "cells"]
    weights: Float[np.ndarray, "cells"]
    gradients: Float[np.ndarray, "cells 3 3 dofs"]
    E: Float[np.ndarray, "cells"]
    nu: Float[np.ndarray, "cells"]
    region: Int[np.ndarray, "cells"]
    region_names: tuple[str, ...]
    springs: Float[np.ndarray, "dofs dofs"]
    accuracy: Accuracy = UNMEASURED

    def __post_init__(self) -> None:
        if not (self.weights >= 0).all():
            raise InputError("model.cubature_weight", min=self.weights.min())

    def checked(self) -> ReducedModel:
        """The model itself; ``InputError`` where its basis is not orthonormal in mass."""
        flat = self.basis.reshape(-1, self.dofs)
        error = np.abs(flat.T @ (np.repeat(self.mass, 3)[:, None] * flat) - np.eye(self.dofs)).max()
        if not error < ORTHONORMAL:
            raise InputError("model.basis_orthonormal", error=error)
        return self

    def __repr__(self) -> str:
        return f"<ReducedModel: {self.kind}, {self.dofs} coordinates, {len(self.cells)} cells>"

    @property
    def dofs(self) -> int:
        """Number of coordinates."""
        return self.basis.shape[2]

    @property
    def order(self) -> int:
        """Order of the elements: 1 or 2."""
        return 2 if len(self.edges) else 1

    @property
    def vertices(self) -> int:
        """Number of points of the mesh, which are the first nodes."""
        return len(self.points) - len(self.edges)

    @property
    def lame(self) -> LameParameters:
        """Lame parameters (lam, mu) [Pa] of the cells, each (cells,)."""
        return lame_parameters(self.E, self.nu)

    def displacement(self, q: Float[np.ndarray, "dofs"]) -> Float[np.ndarray, "nodes 3"]:
        """Displacement [m] of the nodes at the coordinates ``q`` [m sqrt(kg)]."""
        return self.basis @ q

    def coordinates(self, u: Float[np.ndarray, "nodes 3"]) -> Float[np.ndarray, "dofs"]:
        """Coordinates [m sqrt(kg)] of the motion nearest to ``u`` [m], in the norm of mass."""
        return self.pull_back(self.mass[:, None] * u)

    def pull_back(self, forces: Float[np.ndarray, "nodes 3"]) -> Float[np.ndarray, "dofs"]:
        """Forces on the coordinates [N/sqrt(kg)] of ``forces`` [N] at the nodes."""
        return forces.ravel() @ self.basis.reshape(-1, self.dofs)

    def weight(self, gravity_vector: Any) -> Float[np.ndarray, "dofs"]:
        """Forces on the coordinates [N/sqrt(kg)] of ``gravity_vector`` (3,) [m/s^2]."""
        return self.pull_back(self.mass[:, None] * np.asarray(gravity_vector, dtype=float))

    def with_moduli(self, E: np.ndarray, nu: np.ndarray | None = None) -> ReducedModel:
        """Return the model with other moduli ``E`` [Pa] and ``nu`` [1] of its cells, (cells,).

        The basis stays that of the body it was made of.
        """
        return replace(self, E=np.asarray(E, float), nu=self.nu if nu is None else np.asarray(nu))

    def on_cells(
        self, cells: Int[np.ndarray, "n"], weights: Float[np.ndarray, "n"]
    ) -> ReducedModel:
        """The same model, its energy summed over some of its ``cells``, other ``weights`` [m^3]."""
        names = ("cells", "gradients", "E", "nu", "region")
        taken = {name: getattr(self, name)[cells] for name in names}
        return replace(self, weights=weights, **taken)
