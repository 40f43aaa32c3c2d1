"""Supports of a body: fixed displacement components, rollers and springs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from ..errors import InputError
from ..mesh import TetMesh, face_components, spans_plane
from ..note import Note
from .obstacles import Plane
from .up import UpAxis, up_index, up_vector


@dataclass(frozen=True, eq=False)
class Supports:
    """What holds a body, one row a mesh point (or a node of the P2 space), in x, y, z.

    Parameters
    ----------
    fixed
        True where the displacement component is prescribed, shape (points, 3).
    values
        Prescribed displacement [m] where ``fixed``, shape (points, 3).
    springs
        Stiffness [N/m] of springs to the ground, shape (points, 3).
    assumed
        Share of the body's volume in pieces that touch nothing held, which are held where they
        are because nobody said by what.
    places
        What was fixed at a time, one mask (points, 3) a place: nothing between two places is held.

    Examples
    --------
    >>> from autophyx_tet.fem import Supports
    >>> held = Supports.none(4).with_fixed([0, 1], 2, -0.01)  # two points, down by 1 cm
    >>> int(held.fixed.sum()), float(held.values.min())
    (2, -0.01)
    """

    fixed: Bool[np.ndarray, "points 3"]
    values: Float[np.ndarray, "points 3"]
    springs: Float[np.ndarray, "points 3"]
    assumed: float = 0.0
    places: tuple[Bool[np.ndarray, "points 3"], ...] = ()

    def __post_init__(self) -> None:
        if not self.places and self.fixed.any():
            object.__setattr__(self, "places", (self.fixed,))
        if not (np.isfinite(self.values).all() and np.isfinite(self.springs).all()):
            raise InputError("supports.support_values")
        if (self.springs < 0).any():
            raise InputError("supports.spring_stiffness", min=self.springs.min())

    @classmethod
    def none(cls, points: int) -> Supports:
        """Return no support at all."""
        return cls(np.zeros((points, 3), dtype=bool), np.zeros((points, 3)), np.zeros((points, 3)))

    @classmethod
    def clamp(cls, points: int, ids, values=0.0) -> Supports:
        """All three components of the points ``ids`` (ids or mask) prescribed to ``values`` [m]."""
        return cls.none(points).with_fixed(ids, (0, 1, 2), values)

    def with_fixed(self, ids, axes, values: float | np.ndarray = 0.0) -> Supports:
        """Prescribe components ``axes`` (0, 1, 2 or a tuple) to ``values`` [m] at ``ids``.

        ``values`` are one for all, or of shape (ids, axes).
        """
        fixed, prescribed = self.fixed.copy(), self.values.copy()
        index = np.arange(len(fixed))[ids]
        grid = np.ix_(index, np.atleast_1d(axes))
        place = np.zeros_like(fixed)
        fixed[grid] = place[grid] = True
        prescribed[grid] = values
        return replace(self, fixed=fixed, values=prescribed, places=(*self.places, place))

    def with_springs(self, ids, stiffness) -> Supports:
        """Add springs of ``stiffness`` [N/m] (scalar, or a value for each axis) at ``ids``."""
        springs = self.springs.copy()
        springs[ids] += stiffness
        return replace(self, springs=springs)


# Supports found from the geometry of a body: nodes within this fraction of its height above the
# lowest one stand on the ground. Feet are rarely meshed perfectly flat, and fTetWild moves a
# surface by 1e-3 of the diagonal.
BASE_SHARE = 0.02


def ground_under(mesh: TetMesh, up: UpAxis, *, gap: float = 0.0) -> Plane:
    """Level ground ``gap`` [m] under the lowest point of ``mesh``: nothing sinks below it."""
    normal, (low, high) = up_vector(up), mesh.bounds
    return Plane(tuple(np.where(normal < 0, high, low) - gap * normal), tuple(normal))


class FoundSupports(NamedTuple):
    """What holds a body, and the ``warnings`` of what had to be assumed."""

    supports: Supports
    warnings: tuple[str, ...]


def find_supports(
    mesh: TetMesh, up: UpAxis, *, three_point: bool = False, from_top: bool = False
) -> FoundSupports:
    """Supports on which every component of ``mesh`` stands.

    ``three_point``: on three points, free to expand; ``from_top``: it hangs instead.

    A component (tets joined through faces) that neither stands on the base nor shares three points
    that span a plane with a held piece could move freely: it is held at its own lowest points, and
    counts as ``assumed``.
    """
    labels = face_components(mesh)
    used = np.unique(mesh.tets)
    fixed = np.zeros((len(mesh.points), 3), dtype=bool)
    loose, assumed = 0, 0.0
    axis, points = up_index(up), mesh.points
    if (up[0] == "-") != from_top:
        points = points * np.where(np.arange(3) == axis, -1.0, 1.0)
    if three_point:
        _hold_three(points, used, axis, fixed)
    else:
        fixed[_lowest(points, used, axis)] = True
    members = [np.unique(mesh.tets[labels == k]) for k in range(labels.max() + 1)]
    held = np.any(fixed, axis=1)
    waiting = set(range(len(members)))
    while waiting:
        done = {k for k in waiting if spans_plane(mesh.points[members[k][held[members[k]]]])}
        if not done:  # the biggest loose component gets a support of its own
            k = max(waiting, key=lambda k: len(members[k]))
            fixed[_lowest(points, members[k], axis)] = True
            assumed += mesh.volumes[labels == k].sum() / mesh.volume
            loose += 1
            done = {k}
        for k in done:
            held[members[k]] = True
        waiting -= done
    supports = Supports(fixed, np.zeros(fixed.shape), np.zeros(fixed.shape), float(assumed))
    if not loose:
        return FoundSupports(supports, ())
    does, whose = ("are", "their") if loose > 1 else ("is", "its")
    warning = Note(
        "supports.pieces_volume",
        loose=loose,
        count=len(members),
        assumed=assumed,
        does=does,
        whose=whose,
        where="highest" if from_top else "lowest",
    )
    return FoundSupports(supports, (warning,))


def _lowest(points: np.ndarray, ids: np.ndarray, axis: int) -> np.ndarray:
    """Ids near the lowest point that span a plane: the share of the height grows until they do."""
    z = points[ids, axis] - points[ids, axis].min()
    fraction = BASE_SHARE
    while fraction < 1 and not spans_plane(points[ids[z <= fraction * z.max()]]):
        fraction *= 1.5
    return ids[z <= fraction * z.max()]


def _hold_three(points, ids, axis, fixed) -> None:
    """Fix six components at three points far apart: no stress from the support but its reaction."""
    base = _lowest(points, ids, axis)
    side = [a for a in range(3) if a != axis]
    flat = points[base][:, side]
    a = int(np.argmax(np.linalg.norm(flat - flat.mean(axis=0), axis=1)))
    # The second along an axis from it, as far as can be, and held across: what swells does not turn
    far = flat - flat[a]
    size = np.maximum(np.linalg.norm(far, axis=1), np.finfo(float).tiny)[:, None]
    b, along = divmod(int(np.argmax(np.square(far) / size)), 2)
    line = far[b]
    c = int(np.argmax(np.abs(far @ [-line[1], line[0]])))
    fixed[base[[a, b, c]], axis] = True
    fixed[base[a]] = True
    fixed[base[b], side[1 - along]] = True
