"""What the parts of a mesh are called, and what a text says that they are and hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ...fem.scene.materials import Material, MaterialTable, key, load_contents
from ...fem.scene.mesh import TetMesh
from ...predictors.construction.construction import ThingWords
from ...predictors.language.binding import GENERAL, Bound, BoundPart
from ...predictors.language.clauses import Clause
from ...predictors.quantities.quantity import Quantity, wall_said
from ..io.sidecar import Sidecar

MAIN_SHARE = 0.5  # of the volume: the part that a file's name and "this is a ..." speak of


def material_inside(name: str, table: MaterialTable) -> Material:
    """Return what is called so: contents first ("coffee" is ground, no wood), then materials."""
    contents = load_contents()
    return contents.exact(name) if key(name) in contents.phrases else table.exact(name)


class Held(NamedTuple):
    """What a part is full of, and whether that is said of it or of the whole."""

    material: Material
    own: bool


@dataclass(frozen=True)
class Called:
    """What the parts of a mesh and the whole of it are called, and what a text says of them.

    Parameters
    ----------
    labels
        For each part its name, then all other words that the asset has for it.
    main
        Whether each is the main part: what is said of the whole speaks of it.
    object_name, thing
        What the asset is called, and what the text says that it is.
    held
        What each part is said to be full of, by itself or with the whole; None for nothing.
    walls
        The thickness of the wall [m] that each part is said to have, None where nothing is said.
    """

    labels: tuple[tuple[str, ...], ...]
    main: tuple[bool, ...]
    object_name: str
    thing: tuple[str, ...]
    held: tuple[Held | None, ...]
    walls: tuple[Quantity | None, ...]

    @classmethod
    def of(cls, mesh: TetMesh, sidecar: Sidecar, bound: Bound, table: MaterialTable) -> Called:
        """Gather the words for the regions of a mesh, of which so much is said."""
        main = main_parts(mesh.region_volumes())
        return cls(
            labels=sidecar.labels_of(mesh.region_names),
            main=main,
            object_name=sidecar.source.get("name") or "",
            thing=bound.sentence.thing,
            held=tuple(_held(part, bound.sentence.clauses, table) for part in bound.parts),
            walls=walls_said(mesh.region_names, main, bound),
        )

    def divided(self, mesh: TetMesh, sidecar: Sidecar, parents: Sequence[int]) -> Called:
        """Return the same of a mesh whose regions are pieces of these parts."""
        return replace(
            self,
            labels=sidecar.labels_of(mesh.region_names),
            main=main_parts(mesh.region_volumes()),
            held=tuple(self.held[part] for part in parents),
            walls=tuple(self.walls[part] for part in parents),
        )

    def usual_materials(self) -> dict[str, tuple[str, str]]:
        """Return, by part, the kind of hollow thing that it is called and its usual material."""
        found = ((own[0], self.words(i).usual_material()) for i, own in enumerate(self.labels))
        return {part: usual for part, usual in found if usual}

    def words(self, part: int) -> ThingWords:
        """Return the words for a part; what the whole is called only for its main part."""
        if not self.main[part]:
            return ThingWords.of(self.labels[part])
        return ThingWords.of(self.labels[part], thing=self.thing, object_name=self.object_name)

    def filling(self, part: int) -> Material | None:
        """Return what is in a part; what the whole is full of, is in its main part."""
        held = self.held[part]
        return held.material if held and (held.own or self.main[part]) else None

    def said_filling(self, part: int) -> str:
        """Return the row of what a part is said to be full of, "" where another part has it."""
        held = self.held[part]
        says = held and (held.own or self.main[part] or not any(self.main))
        return held.material.name if held and says else ""


def _held(part: BoundPart, clauses: Sequence[Clause], table: MaterialTable) -> Held | None:
    """What the first clause that fills a part says is in it."""
    found = (
        Held(material_inside(name, table), how not in GENERAL)
        for k, how in zip(part.clauses, part.how, strict=True)
        if (name := clauses[k].filling)
    )
    return next(found, None)


def walls_said(
    names: Sequence[str], main: Sequence[bool], bound: Bound
) -> tuple[Quantity | None, ...]:
    """The wall that a text gives each part; that of the whole is of its main part, or of all."""

    def of(part: int) -> Quantity | None:
        general = main[part] or not any(main)
        spoken = zip(bound.parts[part].clauses, bound.parts[part].how, strict=True)
        clauses = [bound.sentence.clauses[k] for k, how in spoken if general or how not in GENERAL]
        return next(filter(None, (wall_said(names[part], one.numbers) for one in clauses)), None)

    return tuple(of(part) for part in range(len(names)))


def main_parts(volumes: Float[np.ndarray, "parts"]) -> tuple[bool, ...]:
    """Return which parts are the main one, by their volumes [m^3]."""
    return tuple((volumes >= MAIN_SHARE * volumes.sum()).tolist())
