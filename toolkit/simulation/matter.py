"""Options of the material point method: classes of parts, the method, and bodies of voxels."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, fields, replace
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...converters.registry import POINT_FORMATS
from ...fem.errors import ConvergenceError, UsageError
from ...fem.mesh import TetMesh
from ...fem.mpm.materials import MaterialClass, Substance, class_of, triaxial_friction
from ...fem.mpm.time_step import MpmError
from ...fem.table import Span, key, load_contents, load_flows, load_strengths, load_table
from ...predictors.field import MaterialField
from ..options import SimulateOptions

if TYPE_CHECKING:
    from ...fem.mpm.method import MpmMethod


# Classes that a part is of by its material, without a word: what flows. Metals are too stiff to
# yield here, all else springs back.
FLOWING = (MaterialClass.SAND, MaterialClass.VISPLAS, MaterialClass.FLUID, MaterialClass.SNOW)
# Whose numbers a class takes where the tables have none of a material.
LIKE = {"sand": "sand (uniform)"}
# A jelly that tears, and what a class cannot do without.
BRITTLE = "brittle"
WANTED = {
    "metal": ("yield_stress",),
    "sand": ("friction",),
    "visplas": ("yield_stress", "viscosity"),
    BRITTLE: ("tension", "fracture_energy"),
}


def particle_method(
    options: SimulateOptions,
    materials: Mapping[str, str],
    announce: Callable[[str], None] | None = None,
    *,
    classes: Mapping[str, str] | None = None,
) -> MpmMethod:
    """The method that the options ask for; ``announce`` hears what it will cost.

    ``materials`` are the rows of the table that parts are of: numbers that are not said are theirs.
    ``classes`` are those that a predictor found, by part; else a part that flows has its row's.
    """
    from ...fem.mpm.method import PRESETS, MpmMethod
    from ...fem.mpm.rigid import Stiff

    if options.grid < 4:
        raise UsageError(f"--grid {options.grid}: wanted at least 4 cells along the longest side")
    if options.preset:
        # Say which number a preset would leave out in silence
        for name in ("grid", "stiff", "damping"):
            if getattr(options, name) != getattr(SimulateOptions, name):
                raise UsageError(
                    f"--preset {options.preset} has its own --{name}: leave one of them out"
                )
    if not (np.isfinite(options.damping) and options.damping >= 0):
        raise UsageError(f"--damping {options.damping:g}: wanted a rate >= 0 [1/s]")
    own = MpmMethod(grid=options.grid, stiff=Stiff(options.stiff), damping=options.damping)
    said = substances(options.matter, materials)
    left = {part: row for part, row in materials.items() if part not in said}
    flowing, notes = flowing_substances(left, classes or {})
    return replace(
        PRESETS[options.preset] if options.preset else own,
        substances=flowing | said,
        notes=notes,
        threads=options.threads,
        announce=announce,
    )


def cells_wanted(options: SimulateOptions) -> int:
    """Cells along the longest side, by the preset or as said."""
    if not options.preset:
        return options.grid
    from ...fem.mpm.method import PRESETS

    return PRESETS[options.preset].grid


def substances(
    entries: Sequence[str], materials: Mapping[str, str] | None = None
) -> dict[str, Substance]:
    """Matter by name of part, of entries such as 'bread=brittle,tension=5e3,fracture_energy=20'.

    What is not said is taken from the tables of strength and flow, for the row in ``materials``:
    the middle of its range. ``brittle`` is jelly that tears.
    """
    known = {field.name for field in fields(Substance)} - {"kind", "corotated"}
    names = ", ".join(sorted(known))
    found = {}
    for entry in entries:
        part, equals, said = entry.partition("=")
        name, *numbers = [word.strip() for word in said.split(",")]
        if not equals or name.upper() not in (*MaterialClass.__members__, BRITTLE.upper()):
            classes = ", ".join([*(kind.name.lower() for kind in MaterialClass), BRITTLE])
            raise UsageError(f"--matter {entry!r}: wanted PART=CLASS[,name=value] of {classes}")
        values: dict[str, Any] = {}
        for pair in numbers:
            number, _, text = pair.partition("=")
            number = number.strip()
            if number not in known:
                near = get_close_matches(number, known, n=1)
                hint = f"; did you mean {near[0]!r}?" if near else f": known are {names}"
                raise UsageError(f"--matter {entry!r}: no number {number!r}{hint}")
            try:
                values[number] = float(text)
            except ValueError as error:
                raise UsageError(f"--matter {entry!r}: {text!r} is no number") from error
        row = (materials or {}).get(part.strip(), "")
        values = _from_tables(name, row) | values
        missing = [number for number in WANTED.get(name, ()) if number not in values]
        if missing:
            where = f"the tables know none of {row!r}" if row else "its material is not known"
            raise UsageError(f"--matter {entry!r}: give {missing[0]}=...: {where}")
        kind = MaterialClass.JELLY if name == BRITTLE else MaterialClass[name.upper()]
        values["seed"] = int(values.get("seed", 0))
        found[part.strip()] = Substance(kind=kind, **values)
    return found


def flowing_substances(
    materials: Mapping[str, str], classes: Mapping[str, str]
) -> tuple[dict[str, Substance], tuple[str, ...]]:
    """Matter by name of the parts that flow, and what to say of it: by ``classes``, else by row."""
    found: dict[str, Substance] = {}
    notes: list[str] = []
    for part, row in materials.items():
        own = row.removeprefix("like ")
        name = classes.get(part)
        if not name:
            tables = load_table().phrases, load_contents().phrases
            known = next((rows[key(own)] for rows in tables if key(own) in rows), None)
            name = (MaterialClass.JELLY if known is None else class_of(known)).name.lower()
        if MaterialClass[name.upper()] not in FLOWING:
            continue
        values: dict[str, Any] = _from_tables(name, LIKE.get(name, own)) | _from_tables(name, own)
        missing = [number for number in WANTED.get(name, ()) if number not in values]
        if missing:
            notes.append(
                f"{part}: {row} is {name}, but the tables know no {missing[0]} of it: elastic; "
                f"--matter {part}={name},{missing[0]}=... makes it flow"
            )
            continue
        numbers = "".join(f", {number} {value:.3g}" for number, value in values.items())
        notes.append(f"{part}: {name} as {row} is{numbers}; --matter {part}=jelly keeps it elastic")
        found[part] = Substance(kind=MaterialClass[name.upper()], **values)
    return found, tuple(notes)


def _from_tables(name: str, row: str) -> dict[str, float]:
    """Numbers of a class from the rows of strength and flow: the middle of what is sourced."""
    flow, strength = load_flows().get(row), load_strengths().get(row)
    found: dict[str, Span | None] = {}
    if name == "metal" and strength is not None and strength.kind == "yield":
        found["yield_stress"] = strength.tension
    if name == BRITTLE and strength is not None:
        found["tension"] = strength.tension
    if flow is not None:
        if name == BRITTLE:
            found["fracture_energy"] = flow.fracture
        if name in ("visplas", "fluid"):
            found["viscosity"] = flow.viscosity
        if name == "visplas":
            found["yield_stress"] = flow.yield_stress
    values = {number: (span.min + span.max) / 2 for number, span in found.items() if span}
    if name == "sand" and flow is not None and flow.friction is not None:
        angle = np.deg2rad((flow.friction.min + flow.friction.max) / 2)
        values["friction"] = triaxial_friction(angle)
    return values


@contextmanager
def logged(output: Path | None) -> Iterator[None]:
    """Where a run of particles fails, write what is known of it beside ``output``, as JSON.

    Raises
    ------
    ConvergenceError
        The failure, with the name of the log.
    """
    try:
        yield
    except MpmError as error:
        if output is None:
            raise
        log = output.with_suffix(".log")
        log.parent.mkdir(parents=True, exist_ok=True)
        known = {"plan": error.plan, "notes": error.notes, "failure": asdict(error.failure)}
        log.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
        raise ConvergenceError(f"{error}; log: {log}") from error


class VoxelBody(NamedTuple):
    """Tets of voxels, how they came about, and the splats or points that can follow, if any.

    ``materials`` are the rows of the table by part, where a field has them.
    """

    mesh: TetMesh
    notes: tuple[str, ...]
    carrier: Path | None
    materials: dict[str, str]


def voxel_body(path: Path, *, cells: int, scale: float = 1.0) -> VoxelBody | None:
    """Body of a field (.npz), or of splats or points with E, nu, rho; None for other files.

    Splats and points are filled on a grid of ``cells`` along their longest side; their unit is
    ``scale`` metres.
    """
    from ...converters import files as npz
    from ...converters.points.table import read_points
    from ...converters.transfer import field_from_points, tets_of_field

    suffix = path.suffix.lower()
    if suffix == ".npz" and path.is_file() and "meta" in npz.load_npz(path):
        found = npz.load(path)
        is_field = isinstance(found, MaterialField)
        return VoxelBody(tets_of_field(found), (), None, rows_of_field(found)) if is_field else None
    if suffix not in POINT_FORMATS or not path.is_file():
        return None
    table = read_points(path)
    if not all(name in table.columns for name in ("E", "nu", "rho")):
        return None
    places = {name: scale * np.asarray(table.columns[name], dtype=np.float64) for name in "xyz"}
    names: tuple[str, ...] = ()
    for comment in reversed(table.comments):  # the first in which `transfer` names the parts
        with suppress(ValueError):
            remark = json.loads(comment)
            if isinstance(remark, dict) and "part" in remark:
                names = tuple(map(str, remark["part"]))
    field = field_from_points(table.with_columns(places), cells=cells, part_names=names)
    from scipy.ndimage import binary_erosion

    solid = np.asarray(field.occupied)
    outer = 1 - binary_erosion(solid).sum() / solid.sum()
    return VoxelBody(
        tets_of_field(field),
        (
            f"filled: {solid.sum():,} voxels of {field.grid.h:.3g} m; the {outer:.0%} at the "
            "surface are taken as full: mass and thickness may be half of that too large",
        ),
        path,
        {},
    )


def rows_of_field(field: MaterialField) -> dict[str, str]:
    """The material that most cells of a part are of, by name of part."""
    if field.part is None or field.material is None:
        return {}
    rows = {}
    for part in np.unique(field.part[field.occupied]):
        own = field.material[field.occupied & (field.part == part)]
        rows[field.part_names[part]] = field.material_names[np.bincount(own).argmax()]
    return rows
