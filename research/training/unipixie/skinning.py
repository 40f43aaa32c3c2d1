"""What the head of skinning is trained on: free bodies of cells, and how well handles move them.

Many thetas make the same motions (handles may be mixed), so no theta is a target. What is wanted is
that the body can move: the share of its compliance under loads that are quadratic in place, which a
reduced body can only lose (Ritz), and which is 1 where it moves as the full one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from ...datasets.objects import Objects
from ...datasets.shapes import EMPTY, rasterise
from .simplicits import FEATURES, HANDLES, frozen_body

CELLS = 16  # along a side, of which a margin is empty
SOFTEST = 1e-4  # of the largest E: softer parts are taken as this soft
NU = 0.3
LOADS = 30  # three directions of ten monomials
# Of the mean of the diagonals: rigid motions, which no load drives, and handles that depend.
SHIFT, DEPENDENT = 1e-9, 1e-9
_CORNERS = np.stack(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij"), -1).reshape(-1, 3)


class CellBodies(NamedTuple):
    """Bodies (n) of at most C cells and N nodes; what is behind the last is zero.

    ``corner`` (n, C, 8) nodes of each cell, ``stiff`` (n, C) its E over the largest; ``place``
    (n, N, 3) of the nodes in shares of the box, ``x`` (n, N, 3) about the middle in shares of the
    longest side, ``mass`` (n, N), ``load`` (n, N, 3, L) and ``full`` (n,) the compliance of all.
    """

    corner: Tensor
    stiff: Tensor
    place: Tensor
    x: Tensor
    mass: Tensor
    load: Tensor
    full: Tensor


def cell_stiffness() -> np.ndarray:
    """Stiffness (8, 3, 8, 3) of a unit cube of E 1, with Wilson's modes: it bends without locking.

    Wilson, Taylor, Doherty & Ghaboussi 1973, condensed; of a cube the patch test holds as it is.
    """
    lam, mu = NU / ((1 + NU) * (1 - 2 * NU)), 1 / (2 * (1 + NU))
    D = np.diag([2 * mu] * 3 + [mu] * 3)
    D[:3, :3] += lam
    K = np.zeros((33, 33))
    for point in (2 * _CORNERS - 1) / 3**0.5:
        sign = 2 * _CORNERS - 1
        shape = [np.delete(1 + sign * point, i, axis=1).prod(1) * sign[:, i] / 4 for i in range(3)]
        slopes = np.concatenate([np.stack(shape, 1), -4 * np.diag(point)])  # 11 functions, by axis
        B = np.zeros((6, 11, 3))
        for i in range(3):
            B[i, :, i] = slopes[:, i]
            j, k = (i + 1) % 3, (i + 2) % 3
            B[3 + i, :, j], B[3 + i, :, k] = slopes[:, k], slopes[:, j]
        B = B.reshape(6, 33)
        K += B.T @ D @ B / 8
    inner = K[:24, 24:] @ np.linalg.solve(K[24:, 24:], K[24:, :24])
    return (K[:24, :24] - inner).reshape(8, 3, 8, 3)


def cell_bodies(
    objects: Objects, stiffness: np.ndarray, device: str, *, cells: int = CELLS
) -> CellBodies:
    """Bodies of the largest connected piece of each object; ``stiffness`` (n, 6) is E by part."""
    labels = rasterise(torch.tensor(objects.rows, device=device), cells=cells).cpu().numpy()
    each = [_body(label, E) for label, E in zip(labels, stiffness, strict=True)]
    columns = []
    for column in zip(*each, strict=True):
        most = max(len(array) for array in column)
        wide = [np.pad(a, [(0, most - len(a))] + [(0, 0)] * (a.ndim - 1)) for a in column]
        columns.append(torch.tensor(np.stack(wide), device=device))
    corner, stiff, place, x, mass = columns
    load = _loads(x, mass)
    full = torch.stack([_compliance(*one) for one in zip(corner, stiff, mass, load, strict=True)])
    return CellBodies(corner, stiff, place, x, mass, load, full)


def largest_piece(label: np.ndarray) -> np.ndarray:
    """Whether a cell (x, y, z) of a labelled cube is of its largest connected piece."""
    from scipy.ndimage import label as pieces_of

    piece, _ = pieces_of(label != EMPTY)
    return piece == np.bincount(piece.ravel())[1:].argmax() + 1


def _body(label: np.ndarray, E: np.ndarray) -> tuple[np.ndarray, ...]:
    cells = np.argwhere(largest_piece(label))
    own = E[label[tuple(cells.T)]]
    nodes, corner = np.unique(
        (cells[:, None] + _CORNERS).reshape(-1, 3), axis=0, return_inverse=True
    )
    corner = corner.reshape(-1, 8)
    low, side = nodes.min(axis=0), np.ptp(nodes, axis=0)
    mass = np.bincount(corner.ravel(), minlength=len(nodes)) / corner.size
    return (
        corner, np.maximum(own / own.max(), SOFTEST), (nodes - low) / side,
        (nodes - low - side / 2) / side.max(), mass,
    )  # fmt: skip


def _loads(x: Tensor, mass: Tensor) -> Tensor:
    """Forces (n, N, 3, L): mass times monomials of place, without what moves the body rigidly."""
    one = torch.ones_like(x[..., :1])
    pairs = torch.stack([x[..., i] * x[..., j] for i in range(3) for j in range(i, 3)], -1)
    terms = torch.cat([one, x, pairs], -1)
    load = torch.einsum("bnt,ij->bnijt", terms, torch.eye(3, dtype=x.dtype, device=x.device))
    load = mass[..., None, None] * load.flatten(3)
    rigid = _rigid(x).flatten(1, 2)
    weighted = rigid * mass.repeat_interleave(3, 1)[..., None]
    inner = torch.linalg.solve(rigid.mT @ weighted, rigid.mT @ load.flatten(1, 2))
    return load - (weighted @ inner).unflatten(1, (-1, 3))


def _rigid(x: Tensor) -> Tensor:
    """Rigid motions (n, N, 3, 6)."""
    turns = [torch.linalg.cross(x, axis.expand_as(x)) for axis in torch.eye(3).to(x)]
    shifts = [axis.expand_as(x) for axis in torch.eye(3).to(x)]
    return torch.stack([*turns, *shifts], -1)


def _compliance(corner: Tensor, stiff: Tensor, mass: Tensor, load: Tensor) -> Tensor:
    """Sum over the loads of the work that they do on the full body."""
    used = int((mass > 0).sum())
    K = torch.zeros(3 * used, 3 * used, dtype=mass.dtype, device=mass.device)
    at = (3 * corner[..., None] + torch.arange(3, device=mass.device)).flatten(1)[stiff > 0]
    cell = torch.tensor(cell_stiffness(), device=mass.device).reshape(24, 24)
    values = stiff[stiff > 0][:, None, None] * cell
    K.index_put_((at[:, :, None], at[:, None, :]), values, accumulate=True)
    diagonal = K.diagonal()
    diagonal += SHIFT * diagonal.mean() * mass[:used].repeat_interleave(3) / mass[:used].mean()
    F = load[:used].flatten(0, 1)
    return (F * torch.linalg.solve(K, F)).sum()


def compliance_share(theta: Tensor, bodies: CellBodies) -> Tensor:
    """Share (n,) of the compliance that handles of ``theta`` (n, 650) and an affine motion have."""
    weights = skinning_weights(theta.to(bodies.x.dtype), bodies.place)
    used = (bodies.mass > 0)[..., None]
    affine = torch.cat([bodies.x, torch.ones_like(bodies.x[..., :1])], -1) * used
    fields = torch.cat([affine, (weights[..., None] * affine[..., None, :]).flatten(2)], -1)
    gram = fields.mT @ (bodies.mass[..., None] * fields)
    factor = torch.linalg.cholesky(_shifted(gram))
    fields = torch.linalg.solve_triangular(factor, fields.mT, upper=False).mT
    count = fields.shape[-1]
    index = bodies.corner.flatten(1)[..., None].expand(-1, -1, count)
    at = fields.gather(1, index).unflatten(1, (-1, 8))
    cell = torch.tensor(cell_stiffness()).to(at)
    A = at.new_zeros(len(at), count, 3, count, 3)
    for i in range(3):
        for j in range(3):
            pushed = torch.einsum("ncak,ab,nc->ncbk", at, cell[:, i, :, j], bodies.stiff)
            A[:, :, i, :, j] = pushed.flatten(1, 2).mT @ at.flatten(1, 2)
    A = _shifted(A.reshape(len(at), 3 * count, 3 * count))
    F = torch.einsum("bnk,bnil->bkil", fields, bodies.load).flatten(1, 2)
    return (F * torch.linalg.solve(A, F)).sum((1, 2)) / bodies.full


def _shifted(A: Tensor) -> Tensor:
    """Matrices (n, k, k) with a small share of the mean of their diagonal added to it."""
    mean = A.diagonal(dim1=1, dim2=2).mean(1)
    eye = torch.eye(A.shape[1], dtype=A.dtype, device=A.device)
    return A + DEPENDENT * mean[:, None, None] * eye


def skinning_weights(theta: Tensor, place: Tensor) -> Tensor:
    """Weights (n, N, 10) that ``theta`` (n, 650) gives at places (n, N, 3) of the box."""
    x = place
    for W, b in frozen_body():
        x = torch.nn.functional.elu(x @ torch.tensor(W).to(x) + torch.tensor(b).to(x))
    head = theta[:, : FEATURES * HANDLES].unflatten(1, (FEATURES, HANDLES))
    return x @ head + theta[:, None, FEATURES * HANDLES :]
