"""Boundary conditions: a scenario's scene with the supports and loads that a user states."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..errors import InputError, UsageError
from ..scene.loads import Traction, pressure, spread_force, spread_torque
from ..scene.scene import Hold, Scene
from ..scene.supports import Supports
from .selection import Selection, numbers, select
from .stated_obstacle import stated_obstacle

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
        Pressures [Pa] against the surface: 'part:seat=2000'; negative ones pull.
    torque
        Torques [N m], in total: 'part:knob=0,0,0.5'.
    move
        Prescribed displacements [m]: 'part:jaw=0,0,-0.002'; a suffix leaves the others free.
    obstacle
        Rigid obstacles [m], with a velocity [m/s] after '=' where they move: 'plane:z<0',
        'sphere:0,0,1,0.1=0,0,-2', 'box:x0,y0,z0,x1,y1,z1', 'capsule:x0,y0,z0,x1,y1,z1,r'.
    gravity_dir
        Where gravity pulls to, any length, shape (3,); by default against the up axis.
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
        return replace(
            self._held(scene, warnings),
            tractions=(*scene.tractions, *self._tractions(scene, warnings)),
            obstacles=(*scene.obstacles, *map(stated_obstacle, self.obstacle)),
            gravity_vector=self._gravity(scene),
            warnings=tuple(warnings),
        )

    def _held(self, scene: Scene, warnings: list[str]) -> Scene:
        mesh = scene.mesh
        held = Supports.none(len(mesh.points)) if self.fix else scene.held
        holds = [*(() if self.fix else scene.holds)]
        for words in self.fix:
            place = _selected(scene, "fix", words)
            held = held.with_fixed(place.points, place.axes)
            holds.append(Hold(place.words, place.points, place.axes))
        for place, value in self._placed(scene, "move"):
            free = ~held.fixed[place.points]
            if not free[:, place.axes].all():
                count = int((~free[:, place.axes]).any(axis=1).sum())
                warnings.append(f"--move {place.words}: {count} of its points are held: they stay")
            values = np.where(free, value, held.values[place.points])[:, place.axes]
            held = held.with_fixed(place.points, place.axes, values)
            holds.append(Hold(place.words, place.points, place.axes, tuple(value.tolist())))
        ground = None if self.fix else scene.ground
        return replace(scene, supports=held, holds=tuple(holds), ground=ground)

    def _tractions(self, scene: Scene, warnings: list[str]) -> Iterator[Traction]:
        make = {"load": spread_force, "torque": spread_torque, "pressure": pressure}
        for kind in LOADS:
            for place, value in self._placed(scene, kind):
                said = f"--{kind} {place.words}"
                if not len(place.faces):
                    raise UsageError(f"{said}: it has no face on the surface, where loads act")
                if not place.whole:
                    warnings.append(
                        f"{said}: no whole face lies there; the {len(place.faces)} faces that "
                        "touch it are loaded"
                    )
                given = float(value[0]) if kind == "pressure" else value
                try:
                    load = make[kind](scene.mesh, place.faces, given)
                except InputError as error:
                    raise UsageError(f"{said}: {error}") from error
                yield load._replace(name=place.words)

    def _placed(self, scene: Scene, kind: str) -> Iterator[tuple[Selection, np.ndarray]]:
        for words in getattr(self, kind):
            place, equals, value = words.rpartition("=")
            if not equals:
                wanted = "NUMBER" if COUNTS[kind] == 1 else "X,Y,Z"
                raise UsageError(f"--{kind} {words!r}: wanted SELECTION={wanted}")
            found = numbers(value, COUNTS[kind], f"--{kind} {words}")
            yield _selected(scene, kind, place), found

    def _gravity(self, scene: Scene) -> np.ndarray:
        size = float(np.linalg.norm(scene.gravity_vector))
        if self.gravity_dir is None:
            return np.asarray(scene.gravity_vector, dtype=float)
        way = np.asarray(self.gravity_dir, dtype=float)
        if way.shape != (3,) or not np.isfinite(way).all() or not np.linalg.norm(way) > 0:
            raise UsageError(f"--gravity-dir {self.gravity_dir}: wanted three numbers, not all 0")
        if size == 0:
            raise UsageError("--gravity-dir: this scene has no gravity to turn")
        return size * way / np.linalg.norm(way)


def entries(given: str | Iterable[str] | Mapping[str, Any]) -> tuple[str, ...]:
    """Entries of one kind: a string, strings, or numbers by selection."""
    if isinstance(given, str):
        return (given,)
    if not isinstance(given, Mapping):
        return tuple(given)
    return tuple(f"{place}={_joined(value)}" for place, value in given.items())


def _joined(value: float | Sequence[float] | np.ndarray) -> str:
    return ",".join(repr(float(x)) for x in np.atleast_1d(np.asarray(value, dtype=float)))


def _selected(scene: Scene, kind: str, words: str) -> Selection:
    try:
        return select(scene.mesh, words.strip())
    except UsageError as error:
        raise UsageError(f"--{kind} {error}") from error
