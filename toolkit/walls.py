"""Walls that texts state: known before there is a mesh, so that it can have them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ..fem.errors import UsageError
from ..fem.mesh import TetMesh, boundary_faces
from ..fem.note import Note
from ..fem.table import (
    Material,
    MaterialTable,
    MaterialValue,
    WallShare,
    apparent_material,
    key,
    load_contents,
    load_table,
)
from ..predictors.asset import Asset, Part, PlainMesh
from ..predictors.construction import (
    Construction,
    MassInterval,
    ThingWords,
    construction_of,
    densities_of,
    mass_interval,
    middle,
)
from ..predictors.field import MaterialField
from ..predictors.prediction import GUESS, PartChoice, Prediction
from ..predictors.text.clauses import GENERAL, Bound
from ..predictors.text.numerals import Quantity, wall_named
from .asset.document import Sidecar
from .asset.repair import repair
from .asset.solids import Shell, hull_fraction, inner_surface, wall_fraction
from .options import EVERY, ConvertOptions, WallOptions, pairs


def with_named_walls(
    asset: str | Path | Asset,
    texts: Sequence[str],
    walls: WallOptions | None,
    options: ConvertOptions | None,
) -> tuple[str | Path | Asset, WallOptions | None]:
    """Return an asset, and the walls that options and texts say for its conversion.

    It is loaded where every text speaks of walls. Options go first; a wall on which texts do not
    agree, and one that holds something, are left to the material, as are those of a tet mesh.
    """
    from ..predictors.text.reader import read_sentence
    from .asset.load import load_asset
    from .meshing.convert import SUFFIXES

    given, options = walls or WallOptions(), options or ConvertOptions()
    spoken = bool(texts) and all("wall" in text.lower() for text in texts)
    if not spoken or given.wall is not None or given.solid or given.fill:
        return asset, walls
    if not isinstance(asset, Asset):
        if Path(asset).suffix.lower() in SUFFIXES:
            return asset, walls
        asset = load_asset(asset, **options.loading())
    # Walls [m] of empty parts, as the built-in reader reads each text
    labels, names = [(part.name, *part.labels) for part in asset.parts], asset.part_names
    main = main_parts(np.array([abs(part.mesh.volume) for part in asset.parts]))
    said = []
    for text in texts:
        bound = read_sentence(text, labels, load_table())
        clauses, found = bound.sentence.clauses, walls_named(names, main, bound)
        said.append(
            {
                name: wall.value
                for name, wall, part in zip(names, found, bound.parts, strict=True)
                if wall and not any(clauses[k].filling for k in part.clauses)
            }
        )
    stated = tuple(
        f"{name}={wall!r}"
        for name, wall in said[0].items()
        if name not in given.by_part() and all(other.get(name) == wall for other in said)
    )
    return asset, replace(given, part_wall=(*given.part_wall, *stated))


SAMPLES = 20_000  # points in a region: a share is known to within .004


def share_within(mesh: TetMesh, region: int, depth: float) -> float:
    """Share of a region's volume that lies at most ``depth`` [m] below its surface."""
    import igl

    tets = mesh.tets[mesh.region == region]
    rng = np.random.default_rng(0)
    weights = mesh.volumes[mesh.region == region]
    drawn = tets[rng.choice(len(tets), SAMPLES, p=weights / weights.sum())]
    points = np.einsum("nk,nkd->nd", rng.dirichlet(np.ones(4), SAMPLES), mesh.points[drawn])
    faces = np.ascontiguousarray(boundary_faces(tets).faces, dtype=np.int64)
    squared, *_ = igl.point_mesh_squared_distance(points, mesh.points, faces)
    return float(np.mean(np.asarray(squared) <= depth**2))


# What the parts of a mesh are called, and what a text says that they are and hold.

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

    labels: For each part its name, then all other words that the asset has for it.
    main: Whether each is the main part: what is said of the whole speaks of it.
    object_name, thing: What the asset is called, and what the text says that it is.
    held: What each part is said to be full of, by itself or with the whole; None for nothing.
    walls: The thickness of the wall [m] that each part is said to have, None where nothing is said.
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
        held = []  # what the first clause that fills a part says is in it
        for part in bound.parts:
            found = (
                Held(material_inside(name, table), how not in GENERAL)
                for k, how in zip(part.clauses, part.how, strict=True)
                if (name := bound.sentence.clauses[k].filling)
            )
            held.append(next(found, None))
        return cls(
            labels=sidecar.labels_of(mesh.region_names),
            main=main,
            object_name=sidecar.source.get("name") or "",
            thing=bound.sentence.thing,
            held=tuple(held),
            walls=walls_named(mesh.region_names, main, bound),
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


def walls_named(
    names: Sequence[str], main: Sequence[bool], bound: Bound
) -> tuple[Quantity | None, ...]:
    """The wall that a text gives each part; that of the whole is of its main part, or of all."""

    def of(part: int) -> Quantity | None:
        general = main[part] or not any(main)
        spoken = zip(bound.parts[part].clauses, bound.parts[part].how, strict=True)
        clauses = [bound.sentence.clauses[k] for k, how in spoken if general or how not in GENERAL]
        return next(filter(None, (wall_named(names[part], one.numbers) for one in clauses)), None)

    return tuple(of(part) for part in range(len(names)))


def main_parts(volumes: Float[np.ndarray, "parts"]) -> tuple[bool, ...]:
    """Return which parts are the main one, by their volumes [m^3]."""
    return tuple((volumes >= MAIN_SHARE * volumes.sum()).tolist())


# What walls hold as tets of its own: a part for the room inside a wall, and its material.

SUFFIX = " contents"


class FilledAsset(NamedTuple):
    """An asset with a part for the room in each wall; the material of each, by its name."""

    asset: Asset
    contents: Mapping[str, str]

    @property
    def walls(self) -> tuple[str, ...]:
        """Names of the parts around them."""
        return tuple(name.removesuffix(SUFFIX) for name in self.contents)


def with_rooms(asset: Asset, options: WallOptions, *, thinnest: float) -> FilledAsset:
    """Add a part for what is inside each part with a wall and a filling by options.

    A wall below ``thinnest`` [m], and one that leaves no room, is left to the material.
    ``UsageError`` where the asset has a part of that name.
    """
    rooms, contents = [], {}
    for part in asset.parts:
        wall, filling = options.wall_of(part.name), options.filling_of(part.name)
        if filling is None or wall is None or not thinnest <= wall < np.inf:
            continue
        # Closed surface a `wall` [m] inside that of a part; None where nothing is that deep
        surface, _ = repair((part,))
        shell = Shell(surface.points, surface.faces, surface.part)
        (points, faces), kept = inner_surface(shell, wall)
        if not kept.any():
            continue
        if part.name + SUFFIX in asset.part_names:
            raise UsageError(
                f"what {part.name!r} is filled with would be a part {part.name + SUFFIX!r}, which "
                f"the asset has: --fill only the others, NAME=MATERIAL, or rename that part"
            )
        room = PlainMesh(points, faces[kept])
        rooms.append(Part(part.name + SUFFIX, room))
        contents[part.name + SUFFIX] = filling
    return FilledAsset(replace(asset, parts=(*asset.parts, *rooms)), contents)


# Walls that no element shows: parts of a mesh that are hollow get the apparent material for it.

FEW_SAMPLES = 2_000  # of the ends of an interval: to 2 %, which its drawn sizes are not known to


class Body(NamedTuple):
    """One region of a mesh: its points [m], outward faces, volume [m^3], smallest side [m]."""

    points: np.ndarray
    faces: np.ndarray
    volume: float
    smallest_side: float


def bodies_of(mesh: TetMesh) -> list[Body]:
    """Return every region with its outward boundary, and without the others' points."""
    order = np.argsort(mesh.region, kind="stable")
    ends = np.searchsorted(mesh.region[order], np.arange(len(mesh.region_names) + 1))
    volumes, bodies = mesh.region_volumes(), []
    for region, (start, end) in enumerate(pairwise(ends)):
        used, tets = np.unique(mesh.tets[order[start:end]], return_inverse=True)
        faces = boundary_faces(tets.reshape(-1, 4)).faces
        points = mesh.points[used]
        side = float(np.ptp(points, axis=0).min())
        bodies.append(Body(points, faces, float(volumes[region]), side))
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
        if self.apparent is None:
            return ""
        return Note(
            "walls.apparent", part=self.construction.part, built=self.construction.sentence,
            low=self.mass.low, high=self.mass.high, solid=self.solid_mass, E=self.apparent.E,
            rho=self.apparent.rho,
        )  # fmt: skip

    @property
    def doubt(self) -> str:
        """What was said of its wall, or to be in it, and is not counted."""
        part, built = self.construction.part, self.construction.sentence
        if self.unused_wall:
            return Note("walls.unused", part=part, wall=self.unused_wall, built=built)
        if not self.said_filling or self.construction.filling:
            return ""
        return Note("walls.no_room", part=part, held=self.said_filling, built=built)

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

        Raises UsageError: Where a part or a material is unknown, or a wall is no length.
        """
        record: dict[str, Any] = sidecar.record.get("walls", {})
        lists = ("part_wall", "fill", "held", "contents")
        known = WallOptions(**record | {name: tuple(record.get(name, ())) for name in lists})  # type: ignore
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
        """Give the parts that are contents their materials, whatever words say of them."""
        alpha, inside = 0.5 if found.field.alpha is None else found.field.alpha, self.contents
        chosen = {
            number: PartChoice(name, inside[name], inside[name].value(alpha), 1.0, alpha, "--fill")
            for number, name in enumerate(found.parts.part_names)
            if name in inside
        }
        return found.with_choices(chosen) if chosen else found

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
    built = []
    table, contents = load_table(), load_contents()
    for region, (body, choice) in enumerate(zip(bodies_of(mesh), choices, strict=True)):
        facts: dict[str, Any] = {"filling": called.filling(region), **said.of(choice.part)}
        wall = called.walls[region]
        if wall and facts["wall"] is None and not (facts["solid"] or facts["in_mesh"]):
            facts["wall"] = wall.value
        construction = construction_of(
            choice.part,
            called.words(region),
            choice.row,
            contents=contents,
            hull_fraction=hull_fraction(body.points, body.faces),
            smallest_side=body.smallest_side,
            **facts,
        )
        shares = {
            end: wall_fraction(body.points, body.faces, end, samples=FEW_SAMPLES)
            for end in dict.fromkeys(construction.wall or ())
        }
        rho, volume = choice.value.rho, body.volume
        interval = mass_interval(
            construction,
            densities_of(choice.row, rho, guessed=choice.weight < GUESS, table=table),
            volume=volume,
            wall_volume=lambda end, shares=shares, volume=volume: shares[end].volume * volume,
        )
        shell, filling = construction.form == "shell", facts["filling"]
        one = BuiltPart(
            construction,
            interval,
            share=wall_fraction(body.points, body.faces, construction.thickness) if shell else None,
            inside_E=filling.value().E if shell and filling else 0.0,
            solid_mass=rho * volume,
            said_filling=called.said_filling(region),
            unused_wall=wall.text if wall and facts["wall"] != wall.value else "",
        )
        built.append(replace(one, apparent=one.as_built(choice.value)) if shell else one)
    return tuple(built)


def with_walls(field: MaterialField, built: Sequence[BuiltPart]) -> MaterialField:
    """Give the cells of hollow parts the apparent E [Pa] and rho [kg/m^3], cell by cell."""
    E, rho = field.E.copy(), field.rho.copy()
    for part, one in enumerate(built):
        if one.share is not None and field.part is not None:
            mine = field.part == part
            E[mine] = one.share.stiffness(E[mine], one.inside_E)
            rho[mine] = one.share.density(rho[mine], middle(one.construction.inside))
    return replace(field, E=E, rho=rho)
