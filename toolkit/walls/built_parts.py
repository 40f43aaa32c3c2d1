"""Walls that no element shows: parts of a mesh that are hollow get the apparent material for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...fem.errors import UsageError
from ...fem.scene.apparent import WallShare, apparent_material
from ...fem.scene.boundary import boundary_faces, face_areas
from ...fem.scene.materials import Material, MaterialValue, key, load_contents, load_table
from ...fem.scene.mesh import TetMesh
from ...predictors.construction.construction import (
    Construction,
    construction_of,
    usual_material,
)
from ...predictors.construction.kinds import contents_of, middle
from ...predictors.construction.masses import MassInterval, densities_of, mass_interval
from ...predictors.field import MaterialField
from ...predictors.prediction import GUESS, PartChoice
from ..io.sidecar import Sidecar
from ..surfaces.layer import hull_share, wall_share
from .wall_options import EVERY, WallOptions

MAIN_SHARE = 0.5  # of the volume: the part that a file's name and "this is a ..." speak of
FAR_APART = 2.0  # high / low: below it a mass is known well enough to say nothing


@dataclass(frozen=True, eq=False)
class Body:
    """One region of a mesh [m], and what can be measured of its outside."""

    points: np.ndarray
    faces: np.ndarray
    volume: float

    @classmethod
    def of(cls, mesh: TetMesh, region: int) -> Body:
        """Return the region with its outward boundary."""
        mine = mesh.region == region
        faces = boundary_faces(mesh.tets[mine]).faces
        return cls(mesh.points, faces, float(mesh.volumes[mine].sum()))

    @cached_property
    def smallest_side(self) -> float:
        """Smallest side [m] of its box, along its axes."""
        return float(np.ptp(self.points[np.unique(self.faces)], axis=0).min())

    @cached_property
    def area(self) -> float:
        """Area [m^2] of its outside."""
        return float(face_areas(self.points, self.faces).sum())

    def share(self, wall: float) -> WallShare:
        """Share of a wall [m] in its volume and in its bending."""
        return wall_share(self.points, self.faces, wall)

    def hull_share(self) -> float:
        """Its volume by that of its convex hull [1]."""
        return hull_share(self.points, self.faces)


@dataclass(frozen=True)
class BuiltPart:
    """How a part is built, the material that stands for it, and its mass.

    ``apparent`` E [Pa], nu [1], rho [kg/m^3] where its walls are smeared over its elements.
    """

    construction: Construction
    mass: MassInterval
    apparent: MaterialValue | None = None
    share: WallShare | None = None
    inside_E: float = 0.0
    solid_mass: float = 0.0

    @property
    def warning(self) -> str:
        """What a user must know: that the material is apparent, or that the mass is anyone's."""
        built, part = self.construction, self.construction.part
        between = f"{self.mass.low:.2g} to {self.mass.high:.2g} kg"
        if self.apparent is not None:
            return (
                f"{part!r} is {built.sentence} (mass {between}, solid {self.solid_mass:.2g} kg); "
                f"the mesh has no such wall, so E {self.apparent.E:.2g} Pa and rho "
                f"{self.apparent.rho:.3g} kg/m3 are apparent: mass and bending are "
                f"kept, dents are not; --part-wall '{part}=solid' keeps it solid"
            )
        return ""

    def row(self) -> dict[str, Any]:
        """What a part's row says of it."""
        built = self.construction
        return {
            "form": built.form,
            "wall": None if built.wall is None else list(built.wall),
            "inside": list(built.inside),
            "filling": built.filling,
            "why": built.why,
            "source": built.source,
            "apparent": None if self.apparent is None else self.apparent._asdict(),
            "share": self.share,
        }


@dataclass(frozen=True)
class Walls:
    """What is said for certain of walls: for all parts, for parts by name, and their fillings."""

    options: WallOptions
    fillings: Mapping[str, Material]

    @classmethod
    def said(cls, options: WallOptions | None, sidecar: Sidecar, parts: Sequence[str]) -> Walls:
        """Return what options say, by default those of the conversion.

        Raises
        ------
        UsageError
            Where a part or a material is unknown, or a wall is no length.
        """
        if options is None:
            known = sidecar.record.get("walls", {})
            lists = ("part_wall", "fill", "held")
            options = WallOptions(
                **{**known, **{name: tuple(known.get(name, ())) for name in lists}}
            )
        walls, fillings = options.by_part(), options.fillings()
        for name in (*walls, *fillings):
            if name not in (*parts, EVERY):
                raise UsageError(f"the mesh has no part {name!r}: its parts are {', '.join(parts)}")
        for wall in filter(None, (options.wall, *walls.values())):
            if not 0 < wall < np.inf:
                raise UsageError(f"--wall and --part-wall must be lengths > 0 m, got {wall:g}")
        return cls(options, {name: material_inside(said) for name, said in fillings.items()})

    def of(self, part: str) -> dict[str, Any]:
        """Return what is said of one part, as ``construction_of`` takes it."""
        own = self.options.by_part()
        return {
            "wall": own.get(part, self.options.wall),
            "solid": own[part] is None if part in own else self.options.solid,
            "filling": self.fillings.get(part, self.fillings.get(EVERY)),
            "in_mesh": part in self.options.held,
        }


def material_inside(name: str) -> Material:
    """Return what is called so: contents first ("coffee" is ground, no wood), then materials."""
    contents = load_contents()
    return contents.exact(name) if key(name) in contents.phrases else load_table().exact(name)


@dataclass(frozen=True)
class Called:
    """What the parts of a mesh and the whole of it are called, and what a text says that it is."""

    labels: Sequence[Sequence[str]]
    volumes: Sequence[float]
    object_name: str
    text: str

    @classmethod
    def of(cls, mesh: TetMesh, sidecar: Sidecar, text: str) -> Called:
        """Gather the words for the regions of a mesh."""
        names = [(name, *sidecar.labels.get(name, ())) for name in mesh.region_names]
        known = sidecar.source.get("name") or ""
        return cls(names, mesh.region_volumes().tolist(), known, text)

    def usual_materials(self) -> dict[str, tuple[str, str]]:
        """Return, by part, the kind of hollow thing that it is called and its usual material."""
        found = ((own[0], usual_material(**self.names(i))) for i, own in enumerate(self.labels))
        return {part: usual for part, usual in found if usual}

    def names(self, part: int) -> dict[str, Any]:
        """Return the words for a part; what the whole is called only for its main part."""
        main = self.volumes[part] >= MAIN_SHARE * sum(self.volumes)
        return {
            "names": self.labels[part],
            "object_names": (self.object_name,) if main and self.object_name else (),
            "text": self.text if main else "",
        }


def build_parts(
    mesh: TetMesh, choices: Sequence[PartChoice], called: Called, said: Walls
) -> tuple[BuiltPart, ...]:
    """Return how every region of a mesh [m] is built, in the order of the regions."""
    return tuple(
        _built(Body.of(mesh, region), choice, called.names(region), said.of(choice.part))
        for region, choice in enumerate(choices)
    )


def _built(body: Body, choice: PartChoice, names: Mapping[str, Any], said: dict) -> BuiltPart:
    shape = {"hull_share": body.hull_share(), "smallest_side": body.smallest_side}
    table, contents = load_table(), load_contents()
    said = {**said, "filling": said["filling"] or contents_of(names["text"], contents, table)}
    construction = construction_of(material=choice.row, contents=contents, **names, **shape, **said)
    shares = {wall: body.share(wall) for wall in dict.fromkeys(construction.wall or ())}
    rho, volume = choice.value.rho, body.volume
    interval = mass_interval(
        construction,
        densities_of(choice.row, rho, guessed=choice.weight < GUESS, table=table),
        volume=volume,
        wall_volume=lambda wall: shares[wall].volume * volume,
    )
    built = BuiltPart(construction, interval, solid_mass=rho * volume)
    if construction.form != "shell":
        return built
    share, filling = body.share(construction.thickness), said["filling"]
    built = replace(built, share=share, inside_E=filling.value().E if filling else 0.0)
    value = apparent_material(
        choice.value, share, inside_rho=middle(construction.inside), inside_E=built.inside_E
    )
    return replace(built, apparent=value)


def with_walls(field: MaterialField, built: Sequence[BuiltPart]) -> MaterialField:
    """Give the cells of hollow parts the apparent E [Pa] and rho [kg/m^3], cell by cell."""
    E, rho = field.E.copy(), field.rho.copy()
    for part, one in enumerate(built):
        if one.share is not None and field.part is not None:
            mine = field.part == part
            E[mine] = one.share.stiffness(E[mine], one.inside_E)
            rho[mine] = one.share.density(rho[mine], middle(one.construction.inside))
    return replace(field, E=E, rho=rho)
