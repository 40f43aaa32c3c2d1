"""Natural frequencies and shapes of a body, free or held."""

from __future__ import annotations

import warnings

import numpy as np

from ..device import checked_device, single_threaded
from ..discrete.assembly import discretise, stiffness
from ..discrete.block_matrix import BlockMatrix, add_diagonal
from ..discrete.constraints import apply_supports, node_supports
from ..discrete.mass import consistent_mass, lumped_mass
from ..discrete.space import Space
from ..errors import ConvergenceError, InputError
from ..laws.law import Law
from ..linalg.krylov import Recorder
from ..linalg.two_level import TwoLevel, scale
from ..result import Modes
from ..scene.components import rigid_motions
from ..scene.mesh import TetMesh, material_of
from ..scene.scene import Scene
from ..scene.supports import Supports
from ..validation import checked_count
from .discretisation_error import affordable_order
from .method import FrameProgress

# Unknowns up to which a direct factor of the shifted stiffness is cheap; LOBPCG beyond. A thin body
# fills in little: 46,000 unknowns of a bonsai took 4 s, and 89 s (without an end) by LOBPCG.
DIRECT = 45_000
DIRECT_THIN = 150_000
THIN = 0.6  # share of the mesh points that lie on the surface; a cube of 10^3 cells has 0.45
# Relative residual of a mode: its frequency is then good to the square of it.
TOLERANCE = 1e-3
MAX_ITERATIONS = 200
# The shift of a free body, as a share of the square of its slowest wave's frequency.
SHIFT = 0.05


@single_threaded
def natural_modes(
    mesh: TetMesh,
    count: int = 6,
    *,
    supports: Supports | None = None,
    order: int = 2,
    device: str = "cpu",
) -> Modes:
    """First ``count`` natural vibrations of ``mesh``, free in space without ``supports``.

    Raises
    ------
    InputError
        If the space has too few unknowns for so many modes.
    ConvergenceError
        If the eigensolver does not reach its tolerance.
    """
    from scipy.sparse import kron

    checked_count("modes", count)
    grid = discretise(mesh, order, checked_device(device))
    space = grid.space
    held = node_supports(supports or Supports.none(len(mesh.points)), space)
    used = np.ones(len(space.nodes), dtype=bool)
    used[space.unused] = False
    free = (~held.fixed & used[:, None]).reshape(-1)
    rigid = 0 if held.fixed.any() or held.springs.any() else 6
    if count + rigid >= free.sum() // 2:
        raise InputError(f"{count} modes of a body with {free.sum()} unknowns: wanted fewer modes")
    K = stiffness(grid, *material_of(mesh).lame).to_scipy().tocsr()
    K = K + _diagonal(held.springs.reshape(-1))
    M = kron(consistent_mass(mesh, space), np.eye(3), format="csr")
    K, M = K[free][:, free].tocsc(), M[free][:, free].tocsc()
    slow = _slowest(mesh)
    if is_factored(mesh, K.shape[0]):
        square, x = _shift_invert(K, M, count + rigid, -SHIFT * slow)
    else:
        motions = rigid_motions(space.nodes - space.nodes.mean(axis=0)).reshape(-1, 6)[free]
        matrix, mass = stiffness(grid, *material_of(mesh).lame), slow * lumped_mass(mesh, space)
        cycle = _v_cycle(matrix, space, held, mass, free)
        square, x = _lobpcg(K, M, motions if rigid else None, cycle, count)
    keep = np.argsort(square)[-count:] if rigid and len(square) > count else np.argsort(square)
    square, x = square[keep], x[:, keep]
    wrong = K @ x - (M @ x) * square
    size = np.linalg.norm((M @ x) * np.maximum(square, slow), axis=0)
    residual = float((np.linalg.norm(wrong, axis=0) / size).max())
    if not residual < TOLERANCE:
        raise ConvergenceError(
            f"modes with residual {residual:.3g}: wanted < {TOLERANCE:g}; ask for fewer modes"
        )
    shapes = np.zeros((count, free.size))
    shapes[:, free] = x.T
    return Modes(
        np.sqrt(np.maximum(square, 0.0)) / (2 * np.pi), shapes.reshape(count, -1, 3), residual
    )


class ModalMethod:
    """Natural vibrations of a body as it is held; loads do not change them."""

    laws: tuple[str, ...] = (Law.LINEAR,)

    def solve(
        self,
        scene: Scene,
        *,
        law: str | None = None,
        order: int | None = None,
        device: str = "cpu",
        progress: FrameProgress | None = None,
    ) -> Modes:
        """First ``scene.modes`` vibrations; see ``natural_modes`` for what may fail."""
        order = order or affordable_order(scene.mesh)
        options = {"supports": scene.held, "order": order, "device": device}
        return natural_modes(scene.mesh, scene.modes, **options)


METHOD = ModalMethod()


def is_factored(mesh: TetMesh, unknowns: int) -> bool:
    """Whether modes come from a direct factor, in seconds; LOBPCG may take minutes."""
    surface = len(np.unique(mesh.boundary.faces))
    thin = surface > THIN * len(np.unique(mesh.tets))
    return unknowns <= (DIRECT_THIN if thin else DIRECT)


def _diagonal(values: np.ndarray):
    from scipy.sparse import diags_array

    return diags_array(values, format="csr")


def _slowest(mesh: TetMesh) -> float:
    """Square [1/s^2] of a low frequency of the body: softest shear wave across its diagonal."""
    material = material_of(mesh)
    speed2 = float((material.lame.mu / material.rho).min())
    return speed2 / float((np.ptp(mesh.bounds, axis=0) ** 2).sum())


def _shift_invert(K, M, count: int, shift: float):
    from scipy.sparse.linalg import LinearOperator, eigsh, splu

    options = {"SymmetricMode": True}
    lu = splu(K - shift * M, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    inverse = LinearOperator(K.shape, matvec=lu.solve, dtype=float)  # type: ignore
    start = np.random.default_rng(0).normal(size=K.shape[0])
    return eigsh(K, k=count, M=M, sigma=shift, OPinv=inverse, v0=start)


def _lobpcg(K, M, motions: np.ndarray | None, preconditioner, count: int):
    """Iterate on a block of vectors, away from the rigid ``motions``."""
    from scipy.sparse.linalg import lobpcg

    start = np.random.default_rng(0).normal(size=(K.shape[0], count + 4))
    options = {"B": M, "M": preconditioner, "Y": motions, "largest": False, "tol": None}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # it warns of residuals: ours are checked
        square, x = lobpcg(K, start, maxiter=MAX_ITERATIONS, **options)
    order = np.argsort(square)[:count]
    return square[order], x[:, order]


def _v_cycle(matrix: BlockMatrix, space: Space, held: Supports, mass: np.ndarray, free: np.ndarray):
    """One V-cycle on K + ``mass`` (nodes,) [N/m] as an operator on the ``free`` unknowns."""
    from scipy.sparse.linalg import LinearOperator

    from ..linalg import kernels_solver as k

    add_diagonal(matrix, mass[:, None, None] * np.eye(3))
    apply_supports(matrix, held.fixed, held.springs)
    system = scale(matrix)
    cycle = TwoLevel(system, space.nodes, held.fixed)
    r, z = cycle.r, cycle.z
    launch = Recorder(matrix.nodes, r.device)
    scaled = launch(k.block_multiply, [system.inverse, r, False, r])
    unscaled = launch(k.block_multiply, [system.inverse, z, True, z])

    def apply(vector: np.ndarray) -> np.ndarray:
        full = np.zeros(free.size)
        full[free] = vector.reshape(-1)
        r.assign(full.reshape(-1, 3))
        scaled.launch()
        cycle.apply()
        unscaled.launch()
        return z.numpy().reshape(-1)[free].copy()

    size = int(free.sum())
    return LinearOperator((size, size), matvec=apply, dtype=float)  # type: ignore
