"""Walls that no element shows: parts of a mesh that are hollow get the apparent material for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from ...fem.errors import UsageError
from ...fem.scene.apparent import WallShare, apparent_material
from ...fem.scene.boundary import boundary_faces, face_areas
from ...fem.scene.materials import Material, MaterialValue, load_contents, load_table
from ...fem.scene.mesh import TetMesh
from ...predictors.construction.construction import Construction, ThingWords, construction_of
from ...predictors.construction.kinds import middle
from ...predictors.construction.masses import MassInterval, densities_of, mass_interval
from ...predictors.field import MaterialField
from ...predictors.prediction import GUESS, PartChoice, Prediction
from ...predictors.quantities.quantity import Quantity
from ..io.sidecar import Sidecar
from ..options import pairs
from ..surfaces.layer import SAMPLES, hull_share, wall_share
from .contents import with_fillings
from .part_words import Called, material_inside
from .wall_options import EVERY, WallOptions

FEW_SAMPLES = 2_000  # of the ends of an interval: to 2 %, which its drawn sizes are not known to
FAR_APART = 2.0  # high / low: below it a mass is known well enough to say nothing


@dataclass(frozen=True, eq=False)
class Body:
    """One region of a mesh [m], and what can be measured of its outside."""

    points: np.ndarray
    faces: np.ndarray
    volume: float

    @cached_property
    def smallest_side(self) -> float:
        """Smallest side [m] of its box, along its axes."""
        return float(np.ptp(self.points, axis=0).min())

    @cached_property
    def area(self) -> float:
        """Area [m^2] of its outside."""
        return float(face_areas(self.points, self.faces).sum())

    def share(self, wall: float, *, samples: int = SAMPLES) -> WallShare:
        """Share of a wall [m] in its volume and in its bending."""
        return wall_share(self.points, self.faces, wall, samples=samples)

    def hull_share(self) -> float:
        """Its volume by that of its convex hull [1]."""
        return hull_share(self.points, self.faces)


def bodies_of(mesh: TetMesh) -> list[Body]:
    """Return every region with its outward boundary, and without the others' points."""
    order = np.argsort(mesh.region, kind="stable")
    ends = np.searchsorted(mesh.region[order], np.arange(len(mesh.region_names) + 1))
    volumes, bodies = mesh.region_volumes(), []
    for region, (start, end) in enumerate(pairwise(ends)):
        used, tets = np.unique(mesh.tets[order[start:end]], return_inverse=True)
        faces = boundary_faces(tets.reshape(-1, 4)).faces
        bodies.append(Body(mesh.points[used], faces, float(volumes[region])))
    return bodies


@dataclass(frozen=True)
class BuiltPart:
    """How a part is built, the material that stands for it, and its mass.

    ``apparent`` E [Pa], nu [1], rho [kg/m^3] where its walls are smeared over its elements;
    ``said_filling`` is the row of what it is said to be full of, ``unused_wall`` the words for a
    wall that options overrule.
    """

    construction: Construction
    mass: MassInterval
    apparent: MaterialValue | None = None
    share: WallShare | None = None
    inside_E: float = 0.0
    solid_mass: float = 0.0
    said_filling: str = ""
    unused_wall: str = ""

    def as_built(self, value: MaterialValue) -> MaterialValue:
        """The material that stands for the part if what it is made of is ``value``."""
        if self.share is None:
            return value
        inside = {"inside_rho": middle(self.construction.inside), "inside_E": self.inside_E}
        return apparent_material(value, self.share, **inside)

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

    @property
    def doubt(self) -> str:
        """What was said of its wall, or to be in it, and is not counted."""
        built = self.construction
        if self.unused_wall:
            return f"part {built.part!r}: {self.unused_wall!r} is not used: {built.sentence}"
        if not self.said_filling or built.filling:
            return ""
        return (
            f"part {built.part!r} is said to hold {self.said_filling}: its mass does not count it, "
            f"for it is {built.sentence}; --part-wall '{built.part}=METRES' makes room"
        )

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
    contents: Mapping[str, Material]

    @classmethod
    def said(cls, options: WallOptions | None, sidecar: Sidecar, parts: Sequence[str]) -> Walls:
        """Return what options say, by default those of the conversion; what it made stays made.

        Raises
        ------
        UsageError
            Where a part or a material is unknown, or a wall is no length.
        """
        record = sidecar.record.get("walls", {})
        lists = ("part_wall", "fill", "held", "contents")
        known = WallOptions(**{**record, **{name: tuple(record.get(name, ())) for name in lists}})
        if options in (None, WallOptions()):
            options = known
        else:
            held, contents = options.held or known.held, options.contents or known.contents
            options = replace(options, held=held, contents=contents)
        walls, fillings = options.by_part(), options.fillings()
        for name in (*walls, *fillings):
            if name not in (*parts, EVERY):
                raise UsageError(f"the mesh has no part {name!r}: its parts are {', '.join(parts)}")
        for wall in filter(None, (options.wall, *walls.values())):
            if not 0 < wall < np.inf:
                raise UsageError(f"--wall and --part-wall must be lengths > 0 m, got {wall:g}")
        table = load_table()
        inside = (
            {name: material_inside(said, table) for name, said in some.items()}
            for some in (fillings, pairs(options.contents))
        )
        return cls(options, *inside)

    def filled(self, found: Prediction) -> Prediction:
        """Return the same with the materials of the parts that are what walls hold."""
        return with_fillings(found, self.contents)

    def of(self, part: str) -> dict[str, Any]:
        """Return what is said of one part, as ``construction_of`` takes it."""
        own, inside = self.options.by_part(), part in self.contents
        told = {
            "wall": own.get(part, self.options.wall),
            "solid": own[part] is None if part in own else self.options.solid or inside,
            "in_mesh": part in self.options.held,
        }
        filling = self.fillings.get(part, self.fillings.get(EVERY))
        return told | ({"filling": filling} if filling else {})


def build_parts(
    mesh: TetMesh, choices: Sequence[PartChoice], called: Called, said: Walls
) -> tuple[BuiltPart, ...]:
    """Return how every region of a mesh [m] is built, in the order of the regions."""
    return tuple(
        _built(
            body,
            choice,
            called.words(region),
            {"filling": called.filling(region), **said.of(choice.part)},
            called.said_filling(region),
            called.walls[region],
        )
        for region, (body, choice) in enumerate(zip(bodies_of(mesh), choices, strict=True))
    )


def _built(
    body: Body,
    choice: PartChoice,
    words: ThingWords,
    said: dict[str, Any],
    said_filling: str,
    wall: Quantity | None,
) -> BuiltPart:
    given, free = said["wall"], not (said["solid"] or said["in_mesh"])
    if wall and given is None and free:
        said = {**said, "wall": wall.value}
    unused = wall.text if wall and said["wall"] != wall.value else ""
    shape = {"hull_share": body.hull_share(), "smallest_side": body.smallest_side}
    table, contents = load_table(), load_contents()
    construction = construction_of(
        choice.part, words, choice.row, contents=contents, **shape, **said
    )
    ends = dict.fromkeys(construction.wall or ())
    shares = {wall: body.share(wall, samples=FEW_SAMPLES) for wall in ends}
    rho, volume = choice.value.rho, body.volume
    interval = mass_interval(
        construction,
        densities_of(choice.row, rho, guessed=choice.weight < GUESS, table=table),
        volume=volume,
        wall_volume=lambda wall: shares[wall].volume * volume,
    )
    filling = said["filling"]
    built = BuiltPart(construction, interval, solid_mass=rho * volume, said_filling=said_filling)
    built = replace(built, unused_wall=unused)
    if construction.form != "shell":
        return built
    share = body.share(construction.thickness)
    built = replace(built, share=share, inside_E=filling.value().E if filling else 0.0)
    return replace(built, apparent=built.as_built(choice.value))


def with_walls(field: MaterialField, built: Sequence[BuiltPart]) -> MaterialField:
    """Give the cells of hollow parts the apparent E [Pa] and rho [kg/m^3], cell by cell."""
    E, rho = field.E.copy(), field.rho.copy()
    for part, one in enumerate(built):
        if one.share is not None and field.part is not None:
            mine = field.part == part
            E[mine] = one.share.stiffness(E[mine], one.inside_E)
            rho[mine] = one.share.density(rho[mine], middle(one.construction.inside))
    return replace(field, E=E, rho=rho)
