"""Selections: places of a mesh in words, as points to hold and faces to load."""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ..errors import UsageError
from ..scene.mesh import TetMesh

AXES = "xyz"
FORMS = "part:NAME, box:x0,y0,z0,x1,y1,z1, plane:z<0.01 (or x>1), near:x,y,z,r or all"
# Places reach this share of the diagonal further: `plane:z<0` means the face at z = 0 too, and
# coordinates written as text lose their last digits.
TOUCH = 1e-6

Distance = Callable[[Float[np.ndarray, "n 3"]], Float[np.ndarray, "n"]]


class Selection(NamedTuple):
    """A place of a mesh.

    ``words`` are those of the user, ``axes`` the directions that a support there holds, a subset of
    (0, 1, 2); ``points`` are the ids of the mesh points in it, ``faces`` (faces, 3) its share of
    the surface, ``whole`` false where no face lies in it wholly and those that touch it were taken.
    """

    words: str
    axes: tuple[int, ...]
    points: Int[np.ndarray, "points"]
    faces: Int[np.ndarray, "faces 3"]
    whole: bool


def select(mesh: TetMesh, words: str) -> Selection:
    """Find the place that ``words`` mean; positions are in metres.

    Raises
    ------
    UsageError
        Where the words are not understood or nothing of the mesh lies there: it names the nearest
        part and the box of the mesh.
    """
    place, axes = _split_axes(mesh, words)
    kind, _, rest = place.partition(":")
    if kind == "part":
        return _part(mesh, words, rest, axes)
    if kind not in _PLACES:
        raise UsageError(f"{words!r}: no place is called {kind!r}; wanted {FORMS}")
    distance = _PLACES[kind](rest, words)
    touch = TOUCH * float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
    used = np.unique(mesh.tets)
    away = distance(mesh.points)
    ids = used[away[used] <= touch]
    if not ids.size:
        raise UsageError(_missed(mesh, words, used, away))
    return _with_faces(mesh, words, axes, ids)


def numbers(text: str, count: int, words: str) -> np.ndarray:
    """``count`` finite numbers with commas between them; ``UsageError`` naming ``words`` else."""
    try:
        found = np.array([float(part) for part in text.split(",")])
    except ValueError:
        found = np.zeros(0)
    if found.shape != (count,) or not np.isfinite(found).all():
        wanted = "a number" if count == 1 else f"{count} numbers with commas between them"
        raise UsageError(f"{words!r}: {text!r} is not {wanted}")
    return found


def described_bounds(mesh: TetMesh) -> str:
    """The box of a mesh in words: 'x 0 to 1, y 0 to 0.1, z 0 to 0.1 m'."""
    spans = zip(AXES, *mesh.bounds, strict=True)
    return ", ".join(f"{axis} {lo:.4g} to {hi:.4g}" for axis, lo, hi in spans) + " m"


def _split_axes(mesh: TetMesh, words: str) -> tuple[str, tuple[int, ...]]:
    """The place, and the directions after the last colon; a part may be called 'lid:x'."""
    place, colon, last = words.rpartition(":")
    is_part = words.startswith("part:") and words[len("part:") :] in mesh.region_names
    if not is_part and colon and place and re.fullmatch("x?y?z?", last) and last:
        if ":" in place or place == "all":
            return place, tuple(AXES.index(axis) for axis in last)
    return words, (0, 1, 2)


def _part(mesh: TetMesh, words: str, name: str, axes: tuple[int, ...]) -> Selection:
    folded = {known.casefold(): i for i, known in enumerate(mesh.region_names)}
    exact = mesh.region_names.index(name) if name in mesh.region_names else None
    region = folded.get(name.casefold()) if exact is None else exact
    if region is None:
        near = difflib.get_close_matches(name.casefold(), folded, n=1, cutoff=0.5)
        hint = f"did you mean {mesh.region_names[folded[near[0]]]!r}? " if near else ""
        raise UsageError(f"{words!r}: there is no such part; {hint}{_around(mesh)}")
    inside = mesh.region == region
    if not inside.any():
        raise UsageError(f"{words!r}: the part has no tets; {_around(mesh)}")
    boundary = mesh.boundary
    faces = boundary.faces[inside[boundary.tet]]
    return Selection(words, axes, np.unique(mesh.tets[inside]), faces, whole=True)


def _with_faces(mesh: TetMesh, words: str, axes: tuple[int, ...], ids: np.ndarray) -> Selection:
    faces = mesh.boundary.faces
    inside = np.isin(faces, ids)
    whole = bool(inside.all(axis=1).any())
    chosen = faces[inside.all(axis=1) if whole else inside.any(axis=1)]
    return Selection(words, axes, ids, chosen, whole)


def _box(text: str, words: str) -> Distance:
    corners = numbers(text, 6, words).reshape(2, 3)
    lo, hi = corners.min(axis=0), corners.max(axis=0)
    return lambda x: np.linalg.norm(np.maximum(np.maximum(lo - x, x - hi), 0.0), axis=1)


class HalfSpace(NamedTuple):
    """Where sign * x[axis] is below sign * ``level`` [m]."""

    axis: int
    sign: float
    level: float


def half_space(text: str, words: str) -> HalfSpace:
    """Half of space in words such as 'z<0.01'; ``UsageError`` naming ``words`` else."""
    found = re.fullmatch(r"\s*([xyz])\s*([<>])=?(.+)", text)
    if found is None:
        raise UsageError(f"{words!r}: wanted plane:z<0.01 or plane:x>1 [m]")
    sign = 1.0 if found[2] == "<" else -1.0
    return HalfSpace(AXES.index(found[1]), sign, float(numbers(found[3], 1, words)[0]))


def _plane(text: str, words: str) -> Distance:
    axis, sign, level = half_space(text, words)
    return lambda x: np.maximum(sign * (x[:, axis] - level), 0.0)


def _near(text: str, words: str) -> Distance:
    *centre, radius = numbers(text, 4, words)
    if not radius > 0:
        raise UsageError(f"{words!r}: radius {radius:g} m, wanted > 0")
    return lambda x: np.maximum(np.linalg.norm(x - np.array(centre), axis=1) - radius, 0.0)


def _all(text: str, words: str) -> Distance:
    if text:
        raise UsageError(f"{words!r}: wanted all, or all:xy")
    return lambda x: np.zeros(len(x))


_PLACES: dict[str, Callable[[str, str], Distance]] = {
    "box": _box,
    "plane": _plane,
    "near": _near,
    "all": _all,
}


def _missed(mesh: TetMesh, words: str, used: np.ndarray, away: np.ndarray) -> str:
    nearest = used[np.argmin(away[used])]
    owner = mesh.region[np.flatnonzero((mesh.tets == nearest).any(axis=1))[0]]
    place = ", ".join(f"{x:.4g}" for x in mesh.points[nearest])
    return (
        f"{words!r}: no point of the mesh lies there; the nearest is ({place}) of part "
        f"{mesh.region_names[owner]!r}, {away[nearest]:.3g} m away; {_around(mesh)}"
    )


def _around(mesh: TetMesh, most: int = 8) -> str:
    names = ", ".join(mesh.region_names[:most])
    more = f" and {len(mesh.region_names) - most} more" if len(mesh.region_names) > most else ""
    return f"parts are {names}{more}; the mesh spans {described_bounds(mesh)}"
