"""Krylov methods: vectors of a device, conjugate gradients on it, eigenvalues by Lanczos."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ..device import Recent, Recorder, Replay, start_warp
from ..elements.assembly import BlockMatrix

# Threads of a block: inner products are summed within one before they meet in memory.
BLOCK = 256


# Where slices begin and their columns, of the last patterns.
_RECENT_SLICES: Recent[tuple[Any, Any]] = Recent(4)


class SlicedMatrix:
    """Copy of a ``matrix`` as a GPU reads it best: sliced ELLPACK (Monakov et al. 2010) of scalars.

    ``arrays`` (where slices begin, columns, numbers of ``dtype``) are what kernels take;
    ``refresh`` copies the numbers, at first and when those of the matrix have changed.
    """

    def __init__(self, matrix: BlockMatrix, dtype: Any) -> None:
        from . import kernels_krylov as k

        wp, device, size = start_warp(), matrix.values.device, int(k.SLICE)
        pattern = _RECENT_SLICES.get(matrix.columns)
        if pattern is None:
            lengths = np.diff(matrix.rows.numpy())
            widths = np.maximum.reduceat(lengths, np.arange(0, len(lengths), size))
            starts = np.concatenate([[0], np.cumsum(widths)])
            base = wp.array(starts, dtype=wp.int32, device=device)
            columns = wp.zeros(size * int(starts[-1]), dtype=wp.int32, device=device)
            inputs = [matrix.rows, matrix.columns, base, columns]
            Recorder(matrix.nodes, device)(k.slice_columns, inputs).launch()
            pattern = _RECENT_SLICES.keep((base, columns), matrix.columns)
        base, columns = pattern
        values = wp.empty(9 * len(columns), dtype=dtype, device=device)
        self.arrays = (base, columns, values)
        inputs = [matrix.rows, base, matrix.values.view(wp.float64).flatten(), values]
        self.command = Recorder(3 * matrix.nodes, device)(k.slice_values, inputs)

    def refresh(self) -> None:
        """Take the numbers that the matrix has now."""
        self.command.launch()


def whole_blocks(size: int) -> int:
    """Number of threads of the blocks that ``size`` of them fill."""
    return -(-size // BLOCK) * BLOCK


class Inner:
    """Inner product of two arrays of vec3d, added to a scalar that stays on the device.

    On the CPU numpy's is several times faster than a kernel's.
    """

    def __init__(self, a: Any, b: Any, out: Any, slot: int) -> None:
        from . import kernels_krylov as k

        wp = start_warp()
        x, y = (v.view(wp.float64).flatten() for v in (a, b))
        self.slot, self.on_device = slot, a.device.is_cuda
        if self.on_device:
            size = whole_blocks(x.shape[0])
            self.command = Recorder(size, a.device)(k.inner, [x, y, slot, out])
        else:
            self.left, self.right, self.total = x.numpy(), y.numpy(), out.numpy()

    def launch(self, slot: int | None = None) -> None:
        """Add the product to the scalar ``slot``, by default the one given at construction."""
        where = self.slot if slot is None else slot
        if not self.on_device:
            self.total[where] += self.left @ self.right
            return
        if slot is not None:
            self.command.set_param_at_index(2, slot)
        self.command.launch()


def norm(v: Any) -> float:
    """Euclidean length of an array of vec3d, without BLAS on the CPU, whose threads wait long."""
    if not v.device.is_cuda:
        return float(np.sqrt(np.square(v.numpy()).sum()))
    square = start_warp().zeros(1, dtype=start_warp().float64, device=v.device)
    Inner(v, v, square, 0).launch()
    return float(np.sqrt(square.numpy()[0]))


class DeviceVector:
    """Vectors (nodes, 3) that stay on a device, with the arithmetic that Newton's method needs.

    It is a ``factor`` times the numbers of the array ``raw``, whose length may be known as
    ``size``. No operation changes one in place; numbers alone come back.
    """

    __array_ufunc__ = None  # a number of numpy leaves its product to the vector

    def __init__(self, raw: Any, factor: float = 1.0, size: float | None = None) -> None:
        self.raw, self.factor, self._size = raw, float(factor), size

    @classmethod
    def of(cls, values: np.ndarray, device: str) -> DeviceVector:
        """Copy of ``values`` (nodes, 3) on ``device``."""
        wp = start_warp()
        return cls(wp.array(values, dtype=wp.vec3d, device=device))

    @property
    def array(self) -> Any:
        """Array of vec3d with the numbers, not to be written to."""
        if self.factor == 1.0:
            return self.raw
        out = start_warp().empty_like(self.raw)
        self.write(out)
        return out

    def write(self, out: Any, factor: float = 1.0) -> None:
        """Write ``factor`` times the numbers to an array."""
        self._combine(factor * self.factor, self, 0.0, out)

    def _combine(self, own: float, other: DeviceVector, factor: float, out: Any) -> None:
        from . import kernels_krylov as k

        wp = start_warp()
        inputs = [self.raw, wp.float64(own), other.raw, wp.float64(factor), out]
        wp.launch(k.combine, len(out), inputs=inputs, device=out.device)

    def numpy(self) -> np.ndarray:
        """Copy of the numbers (nodes, 3)."""
        return self.array.numpy()

    def __add__(self, other: DeviceVector) -> DeviceVector:
        out = start_warp().empty_like(self.raw)
        self._combine(self.factor, other, other.factor, out)
        return DeviceVector(out)

    def __rmul__(self, factor: float) -> DeviceVector:
        return DeviceVector(self.raw, factor * self.factor, self._size)

    def __truediv__(self, divisor: float) -> DeviceVector:
        return (1 / divisor) * self

    def __neg__(self) -> DeviceVector:
        return -1.0 * self

    def __sub__(self, other: DeviceVector) -> DeviceVector:
        return self + -other

    def dot(self, other: DeviceVector) -> float:
        """Inner product of all components."""
        wp, device = start_warp(), self.raw.device
        total = wp.zeros(1, dtype=wp.float64, device=device)
        Inner(self.raw, other.raw, total, 0).launch()
        return self.factor * other.factor * float(total.numpy()[0])

    def length(self) -> float:
        """Euclidean length, measured once."""
        if self._size is None:
            self._size = norm(self.raw)
        return abs(self.factor) * self._size


def inner_product(a: np.ndarray | DeviceVector, b: np.ndarray | DeviceVector) -> float:
    """Inner product of two vectors (nodes, 3) that live in the same place."""
    if isinstance(a, DeviceVector) and isinstance(b, DeviceVector):
        return a.dot(b)
    return float((np.asarray(a) * np.asarray(b)).sum())


def length(a: np.ndarray | DeviceVector) -> float:
    """Euclidean length of a vector, wherever it lives."""
    if isinstance(a, DeviceVector):
        return a.length()
    flat = a.ravel(order="K")  # numpy.linalg.norm does the same, and asks much first
    return math.sqrt(flat.dot(flat))


class ConjugateGradients:
    """Preconditioned CG for ``matrix``; vectors and scalars live on the device.

    ``preconditioner.apply()`` computes z from r. ``run`` starts at x = 0 with the right-hand side
    in ``r``, and may be called again after these, or the values of the matrix, have changed: on a
    GPU the whole loop is one graph. ``lower`` holds the blocks that scale a residual back.
    """

    def __init__(
        self, matrix: BlockMatrix, lower: Any, preconditioner: Any, r: Any, z: Any
    ) -> None:
        from . import kernels_krylov as k

        wp = start_warp()
        self.matrix, self.preconditioner = matrix, preconditioner
        self.scalars = wp.zeros(8, dtype=wp.float64, device=r.device)
        self.state = wp.zeros(3, dtype=wp.int32, device=r.device)
        self.x, self.p, q = (wp.zeros_like(r) for _ in range(3))
        self.replay, self.sliced, self.target = Replay(self._loop, r.device), None, 0.0
        launch = Recorder(matrix.nodes, r.device)
        self.direction = launch(k.cg_direction, [z, self.scalars, self.p])
        self.open = launch(k.cg_open, [0.0, 0, self.scalars, self.state], size=1)
        self.close = launch(k.cg_close, [self.scalars, self.state], size=1)
        self.along = Inner(r, z, self.scalars, 2)
        if r.device.is_cuda:  # along p: q = A p, curvature, new x and r, size of r unscaled
            self.sliced = SlicedMatrix(matrix, wp.float64)
            flat = [v.view(wp.float64).flatten() for v in (self.p, q)]
            product = [*self.sliced.arrays, *flat, self.scalars]
            advance = [self.p, q, lower, self.scalars, self.x, r]
            self.forward = [
                launch(k.multiply_and_measure, product, size=whole_blocks(3 * matrix.nodes)),
                launch(k.advance_and_measure, advance, size=whole_blocks(matrix.nodes)),
            ]
        else:
            unscaled = wp.zeros_like(r)
            self.forward = [
                matrix.product(self.p, q),
                Inner(self.p, q, self.scalars, 1),
                launch(k.cg_advance, [self.p, q, lower, self.scalars, self.x, r, unscaled]),
                Inner(unscaled, unscaled, self.scalars, 3),
            ]

    def step(self) -> None:
        """One iteration: a new direction p, and as far along it as is best."""
        self.preconditioner.apply()
        self.along.launch()
        self.direction.launch()
        for command in self.forward:
            command.launch()
        self.close.launch()

    def _loop(self) -> None:
        if self.sliced is not None:
            self.sliced.refresh()
        self.x.zero_()
        self.p.zero_()
        start_warp().capture_while(self.state[:1], self.step)

    def run(self, target: float, limit: int) -> int:
        """Iterate until the unscaled residual is below ``target``; return the iterations."""
        self.start(target, limit)
        return self.finish()

    def start(self, target: float, limit: int) -> None:
        """The same without a wait for the device: what needs ``x`` may be launched at once."""
        self.target = target
        self.open.set_param_at_index(0, target**2)
        self.open.set_param_at_index(1, limit)
        self.open.launch()
        self.replay()

    def finish(self) -> int:
        """Wait for what was started; return the iterations."""
        ended, iterations, indefinite = self.scalars.numpy()[5:]
        self.indefinite = bool(indefinite)
        self.reached = not indefinite and bool(ended <= self.target**2)
        return int(iterations)


Operator = Callable[[np.ndarray], np.ndarray]

# Directions that a step adds count while they are longer than this share of what made them: less is
# round-off of those already there.
DEPENDENT = 1e-12
# The largest eigenvalue comes from a few Lanczos steps, which stay a little below it.
LANCZOS_STEPS = 12
LANCZOS_MARGIN = 1.08


class RitzPairs(NamedTuple):
    """Approximate eigenpairs of A, the largest value first.

    ``errors`` are the lengths of A x - value x; ``vectors(first)`` (n, first) have been through A
    once more than the space that ``values`` were found in.
    """

    values: Float[np.ndarray, "pairs"]
    errors: Float[np.ndarray, "pairs"]
    vectors: Callable[[int], Float[np.ndarray, "n first"]]


def lanczos(
    operator: Operator,
    mass: Operator,
    start: Float[np.ndarray, "n width"],
    *,
    enough: Callable[[RitzPairs], bool],
    steps: int,
) -> RitzPairs:
    """Eigenpairs of ``operator``, which is symmetric in the inner product of ``mass``.

    Block Lanczos with full reorthogonalisation (Golub & Underwood 1977) from the block ``start``,
    until ``enough`` or ``steps`` blocks; the pairs say which it was. What ``operator`` returns is
    written to.
    """
    basis, projected = _Columns(), np.zeros((0, 0))
    rest = operator(mass(start))
    weighed = mass(rest)
    scale = np.sqrt(max((rest * weighed).sum(axis=0).max(), 1e-300))
    block, weighed = _orthonormal(rest, weighed, basis, mass, scale)
    while True:
        basis.append(block)
        rest = operator(weighed)
        column = basis.along(mass(rest))
        size, width = column.shape
        grown = np.zeros((size, size))
        grown[: size - width, : size - width] = projected
        grown[:, size - width :] = column
        grown[size - width :, :] = column.T
        projected = grown
        basis.take_off(column, rest)
        weighed = mass(rest)
        values, y = np.linalg.eigh((projected + projected.T) / 2)
        values, y = values[::-1], y[:, ::-1]
        last, gram = y[-width:], rest.T @ weighed
        errors = np.sqrt(np.maximum(np.einsum("ip,ij,jp->p", last, gram, last), 0.0))
        pairs = RitzPairs(values, errors, partial(_ritz_vectors, values, y, basis, rest))
        steps -= 1
        if not steps or enough(pairs):
            return pairs
        scale = np.abs(pairs.values).max()
        block, weighed = _orthonormal(rest, weighed, basis, mass, scale)
        if not block.shape[1]:  # the space is invariant: there is nothing more to find
            return pairs


class _Columns(list):
    """Columns of vectors (n, width) in blocks: one more block moves none of those before it."""

    def along(self, x: Float[np.ndarray, "n width"]) -> Float[np.ndarray, "columns width"]:
        """Products of all columns with those of ``x``; with their mass: what lies along them."""
        return np.concatenate([np.zeros((0, x.shape[1])), *(block.T @ x for block in self)])

    def take_off(self, weights: Float[np.ndarray, "columns width"], x: np.ndarray) -> None:
        """Subtract from ``x`` (n, width) the sum of all columns by ``weights``, in place."""
        first = 0
        for block in self:
            x -= block @ weights[first : first + block.shape[1]]
            first += block.shape[1]


def _ritz_vectors(
    values: np.ndarray, y: np.ndarray, basis: _Columns, rest: np.ndarray, first: int
) -> np.ndarray:
    out = rest @ (y[-rest.shape[1] :, :first] / values[:first])
    basis.take_off(-y[:, :first], out)
    return out


def _orthonormal(
    block: np.ndarray, weighed: np.ndarray, basis: _Columns, mass: Operator, scale: float
) -> tuple[np.ndarray, np.ndarray]:
    """Orthonormal directions of ``block`` away from ``basis``, and their mass times them.

    ``weighed`` is the mass times ``block``, from which ``basis`` was taken off once: once more,
    for short directions keep of it what round-off left.
    """
    turn = _normalising(block, weighed, DEPENDENT * scale)
    block, weighed = block @ turn, weighed @ turn
    basis.take_off(basis.along(weighed), block)
    weighed = mass(block)
    turn = _normalising(block, weighed, 0.5)
    return block @ turn, weighed @ turn


def _normalising(block: np.ndarray, weighed: np.ndarray, least: float) -> np.ndarray:
    """What makes orthonormal columns of those of ``block`` that are longer than ``least``."""
    square, turn = np.linalg.eigh(block.T @ weighed)
    keep = square > least**2
    return turn[:, keep] / np.sqrt(square[keep])


class LargestEigenvalue:
    """Largest eigenvalue of a symmetric ``matrix`` by Lanczos, with a margin; NaN if it has one.

    Asked again it answers for the values that the matrix has then: on a GPU by one graph.
    """

    def __init__(self, matrix: BlockMatrix) -> None:
        from . import kernels_krylov as k

        wp, device = start_warp(), matrix.values.device
        self.steps = min(LANCZOS_STEPS, 3 * matrix.nodes)
        v, old, w = (wp.zeros(matrix.nodes, dtype=wp.vec3d, device=device) for _ in range(3))
        # Entry k of `along` is v A v of step k, of `square` the squared length of w before it.
        count = self.steps + 1
        self.sums = wp.zeros(2 * count, dtype=wp.float64, device=device)
        self.along, self.square = self.sums[:count], self.sums[count:]
        launch = Recorder(matrix.nodes, device)
        self.start = launch(k.lanczos_start, [w])
        self.direction = launch(k.lanczos_direction, [w, self.square, 0, v, old])
        self.multiply = matrix.product(v, w)
        self.residual = launch(k.lanczos_residual, [v, old, self.along, self.square, 0, w])
        self.length, self.curvature = Inner(w, w, self.square, 0), Inner(w, v, self.along, 0)
        self.vectors, self.replay = (v, old, w), Replay(self._iterate, device)

    def __call__(self) -> float:
        """Return the eigenvalue."""
        self.replay()
        along, square = self.sums.numpy().reshape(2, -1)
        off = np.sqrt(square[1 : self.steps])
        # A vector that vanished ended the search: what came after it is no number.
        good = int(np.argmin(off > 1e-12)) if (off <= 1e-12).any() else len(off)
        T = np.diag(along[: good + 1]) + np.diag(off[:good], 1) + np.diag(off[:good], -1)
        return LANCZOS_MARGIN * float(np.linalg.eigvalsh(T)[-1]) if np.isfinite(T).all() else np.nan

    def _iterate(self) -> None:
        for cleared in (self.sums, *self.vectors):
            cleared.zero_()
        self.start.launch()
        for step in range(self.steps):
            self.direction.set_param_at_index(2, step)
            self.residual.set_param_at_index(4, step)
            self.length.launch(step)
            self.direction.launch()
            self.multiply.launch()
            self.curvature.launch(step)
            self.residual.launch()
