"""Boundary conditions: a scenario's scene with the supports and loads that a user states."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError, UsageError
from ..note import Note
from .loads import WHOLE, pressure, resultant, spread_force, spread_torque
from .obstacles import Box, Capsule, Obstacle, Plane, Sphere, obstacle_size
from .scene import Hold, Scene
from .selection import Selection, half_space, numbers, select
from .supports import Supports

# Numbers that stand behind the '=' of an entry.
COUNTS = {"load": 3, "pressure": 1, "torque": 3, "move": 3, "obstacle": 3}
KINDS = ("fix", *COUNTS)
LOADS = ("load", "pressure", "torque")


@dataclass(frozen=True)
class BoundaryConditions:
    """What is held, loaded and moved, each entry 'SELECTION' or 'SELECTION=NUMBERS'.

    Parameters
    ----------
    fix
        Places that are held, in all directions or those of a suffix: 'part:handle', 'plane:z<0:z'.
        They replace what the scenario holds.
    load
        Forces [N], in total, spread over the surface of the place: 'part:head=0,0,-10'.
    pressure
        Pressures [Pa] against the surface: 'part:seat=2000'; negative ones pull. 'inside:all=2e5'
        is in the cavities of a hollow body, without 'inside:' all loads act on its outer surface.
    torque
        Torques [N m], in total: 'part:knob=0,0,0.5'.
    move
        Prescribed displacements [m]: 'part:jaw=0,0,-0.002'; a suffix leaves the others free.
    obstacle
        Rigid obstacles [m], with a velocity [m/s] after '=' where they move: 'plane:z<0',
        'sphere:0,0,1,0.1=0,0,-2', 'box:x0,y0,z0,x1,y1,z1', 'capsule:x0,y0,z0,x1,y1,z1,r'.
    gravity_dir
        Where gravity pulls to, any length, shape (3,); by default against the up axis.

    Examples
    --------
    >>> from autophyx_tet.fem import BoundaryConditions, ElementMaterial, Scene, box_mesh
    >>> block = box_mesh((1, 1, 1), (1, 1, 1))
    >>> block = block.with_material(ElementMaterial.uniform(6, E=1e6, nu=0.0, rho=1e3))
    >>> stated = BoundaryConditions(fix=("plane:z<0.01",), load=("plane:z>1=0,0,-100",))
    >>> scene = stated.applied(Scene(mesh=block))
    >>> int(scene.held.fixed.all(axis=1).sum()), scene.tractions[0].value[0].tolist()  # Pa on 1 m^2
    (4, [0.0, 0.0, -100.0])
    """

    fix: tuple[str, ...] = ()
    load: tuple[str, ...] = ()
    pressure: tuple[str, ...] = ()
    torque: tuple[str, ...] = ()
    move: tuple[str, ...] = ()
    obstacle: tuple[str, ...] = ()
    gravity_dir: tuple[float, ...] | None = None

    def __bool__(self) -> bool:
        return any(getattr(self, kind) for kind in KINDS) or self.gravity_dir is not None

    def applied(self, scene: Scene) -> Scene:
        """Return ``scene`` with these conditions.

        Raises
        ------
        UsageError
            Where an entry is not understood or hits nothing.
        """
        if not self:
            return scene
        warnings = [*(() if self.fix else scene.warnings)]
        mesh = scene.mesh
        held = Supports.none(len(mesh.points)) if self.fix else scene.held
        holds = [*(() if self.fix else scene.holds)]
        for words in self.fix:
            place = _selected(scene, "fix", words)
            held = held.with_fixed(place.points, place.axes)
            holds.append(Hold(place.words, place.points, place.axes, beyond=place.beyond))
        for place, value in self._placed(scene, "move"):
            rows = np.ix_(place.points, np.array(place.axes))
            by, taken = value[list(place.axes)], held.fixed[rows]
            fights = (taken & (held.values[rows] != by)).any(axis=1)
            if taken.all() and fights.any():
                raise UsageError("conditions.move_held", words=place.words)
            if count := int(fights.sum()):
                there = place.points[fights]
                moved = [h.name for h in holds if any(h.by) and np.isin(there, h.points).any()]
                warnings.append(
                    Note("conditions.moves_fight", words=place.words, count=count, other=moved[0])
                    if moved
                    else Note("conditions.move_points", words=place.words, count=count)
                )
            values = np.where(taken, held.values[rows], by)
            held = held.with_fixed(place.points, place.axes, values)
            way = tuple(value.tolist())
            holds.append(Hold(place.words, place.points, place.axes, way, place.beyond))
        tractions = [*scene.tractions]
        make = {"load": spread_force, "pressure": pressure, "torque": spread_torque}
        for kind, spread in make.items():
            for place, value in self._placed(scene, kind):
                entry, parts = {"kind": kind, "words": place.words}, place.parts
                if not value.any():
                    warnings.append(Note("conditions.load_zero", **entry))
                    continue
                if not parts.any():  # of a line a force has the faces beside it, a pressure none
                    if kind == "pressure" or not len(parts):
                        raise UsageError("conditions.face_surface", **entry)
                    warnings.append(Note("conditions.on_a_line", count=len(parts), **entry))
                    parts = np.tile(WHOLE, (len(parts), 1))
                number: Any = value if len(value) > 1 else float(value[0])
                try:
                    load = spread(mesh, place.faces, number, parts=parts)
                except InputError as error:
                    raise UsageError("conditions.wrong_load", error=error, **entry) from error
                load = load._replace(name=place.words)
                if not resultant(mesh, load, held).on_fixed < 1:
                    warnings.append(Note("conditions.load_fixed", **entry))
                tractions.append(load)
        gravity = np.asarray(scene.gravity_vector, dtype=float)
        if self.gravity_dir is not None:
            way = np.asarray(self.gravity_dir, dtype=float)
            if way.shape != (3,) or not np.isfinite(way).all() or not way.any():
                raise UsageError("conditions.gravity_dir_wanted", gravity_dir=self.gravity_dir)
            if not gravity.any():
                raise UsageError("conditions.gravity_dir_scene")
            gravity = np.linalg.norm(gravity) * way / np.linalg.norm(way)
        return replace(
            scene,
            supports=held,
            holds=tuple(holds),
            ground=None if self.fix else scene.ground,
            tractions=tuple(tractions),
            obstacles=(*scene.obstacles, *map(parsed_obstacle, self.obstacle)),
            gravity_vector=gravity,
            warnings=tuple(warnings),
        )

    def _placed(self, scene: Scene, kind: str) -> Iterator[tuple[Selection, np.ndarray]]:
        for words in getattr(self, kind):
            place, equals, value = words.rpartition("=")
            if not equals:
                form = "NUMBER" if COUNTS[kind] == 1 else "X,Y,Z"
                raise UsageError("conditions.wanted_value", kind=kind, words=words, form=form)
            row = numbers(value, COUNTS[kind], Note("conditions.entry", kind=kind, words=words))
            yield _selected(scene, kind, place), row


def entries(given: str | Iterable[str] | Mapping[str, Any]) -> tuple[str, ...]:
    """Entries of one kind: a string, strings, or numbers by selection."""
    if isinstance(given, str):
        return (given,)
    if not isinstance(given, Mapping):
        return tuple(given)
    rows = {place: map(float, np.atleast_1d(value)) for place, value in given.items()}
    return tuple(f"{place}={','.join(map(repr, row))}" for place, row in rows.items())


def _selected(scene: Scene, kind: str, words: str) -> Selection:
    try:
        return select(scene.mesh, words.strip(), surface=kind in LOADS)
    except UsageError as error:
        raise UsageError("conditions.wrong_place", kind=kind, error=error) from error


def parsed_obstacle(words: str) -> Obstacle:
    """Find the obstacle that ``words`` mean [m], with its velocity [m/s] after '=', if it moves.

    'sphere:0,0,1,0.1=0,0,-2' is a ball that comes down at 2 m/s. A plane is solid where its words
    hold: 'plane:z<0' is the ground.

    Raises UsageError: Where the words are not understood.
    """
    option = Note("conditions.obstacle", words=words)
    shape, equals, way = words.partition("=") if "<=" not in words else (words, "", "")
    velocity = tuple(numbers(way, 3, option).tolist()) if equals else (0.0, 0.0, 0.0)
    kind, _, rest = shape.strip().partition(":")
    if kind == "plane":
        axis, sign, level = half_space(rest, option)
        normal = sign * np.eye(3)[axis]
        return Plane(tuple(sign * level * normal), tuple(normal), velocity)
    if kind == "sphere":
        *centre, radius = numbers(rest, 4, option).tolist()
        made = Sphere(tuple(centre), radius, velocity)
    elif kind == "capsule":
        *ends, radius = numbers(rest, 7, option).tolist()
        made = Capsule(tuple(ends[:3]), tuple(ends[3:]), radius, velocity)
    elif kind == "box":
        corners = numbers(rest, 6, option).reshape(2, 3)
        half = np.abs(corners[1] - corners[0]) / 2
        made = Box(tuple(corners.mean(axis=0).tolist()), tuple(half.tolist()), velocity)
    else:
        known = Note("conditions.plane_sphere")
        raise UsageError("conditions.obstacle_called", option=option, kind=kind, obstacles=known)
    if not (size := obstacle_size(made)) > 0:
        raise UsageError("conditions.size_wanted", option=option, size=size)
    return made


class ConditionsFile(NamedTuple):
    """``conditions`` of a file, ``gravity`` [m/s^2] where it says it, and further ``bodies``.

    A body is a mesh file, 'FILE' or 'FILE=x,y,z' with how far it is moved [m].
    """

    conditions: BoundaryConditions
    gravity: float | None
    bodies: tuple[str, ...] = ()


def read_conditions(path: Path) -> ConditionsFile:
    """Read boundary conditions from TOML.

    For example ::

        fix = ["part:handle"]
        obstacle = ["sphere:0,0,1,0.1=0,0,-2"]
        gravity = 1.62
        gravity_dir = [0, 0, -1]
        [load]
        "part:head" = [0, 0, -10]
        [body]
        "anvil.msh" = [0, 0, -0.2]

    Files of bodies are beside this one, or given by their whole path. Every kind is a list of
    entries as on the command line, or a table of numbers by selection.

    Raises InputError: Where the file cannot be read or is no TOML.
    Raises UsageError: For a key or a value that is none of ours.
    """
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError("conditions.cannot_read", path=path, error=error) from error
    keys = (*KINDS, "body", "gravity", "gravity_dir")
    for key in document:
        if key not in keys:
            near = difflib.get_close_matches(key, keys, n=1)
            hint = Note("conditions.you_mean_2", near=near[0]) if near else ""
            known = ", ".join(keys)
            raise UsageError("conditions.unknown_key", path=path, key=key, keys=known, hint=hint)
    options: dict[str, Any] = {kind: _entries(path, kind, document) for kind in KINDS}
    gravity, way = document.get("gravity"), document.get("gravity_dir")
    if gravity is not None and not _is_number(gravity):
        raise UsageError("conditions.gravity_wanted", path=path, gravity=gravity)
    if way is not None:
        if not (isinstance(way, list) and len(way) == 3 and all(map(_is_number, way))):
            raise UsageError("conditions.gravity_dir", path=path, way=way)
        options["gravity_dir"] = tuple(map(float, way))
    bodies = tuple(str(path.parent / body) for body in _entries(path, "body", document))
    return ConditionsFile(BoundaryConditions(**options), gravity, bodies)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _entries(path: Path, kind: str, document: dict[str, Any]) -> tuple[str, ...]:
    value = document.get(kind, ())
    words = [value] if isinstance(value, str) else value
    try:
        if isinstance(value, dict) and kind in (*COUNTS, "body"):
            return entries(value)
        if isinstance(words, list | tuple) and all(isinstance(item, str) for item in words):
            return entries(words)
    except (TypeError, ValueError):  # of a table whose values are no numbers
        pass
    wanted = Note("conditions.table_selection") if kind in COUNTS else "selections"
    raise UsageError("conditions.wanted_list", path=path, kind=kind, value_2=value, wanted=wanted)
