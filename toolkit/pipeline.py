"""The verbs convert, assign and run, which the command line and Python users call."""

from __future__ import annotations

import csv
import tomllib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..converters import npz
from ..converters.files import alone
from ..fem.errors import InputError
from ..fem.mesh import TetMesh
from ..fem.note import Note, severity_of
from ..fem.table import FIELDS, Material, MaterialTable, key, load_table, row_of_record
from ..predictors.asset import Asset
from .asset import path_of
from .asset.document import (
    Sidecar,
    check_file,
    check_mesh,
    check_outputs,
    check_run,
    now,
    read_known,
)
from .meshing import AUTO, OR_PARTICLES
from .options import (
    EXPECTED,
    AssignOptions,
    ConvertOptions,
    SimulateOptions,
    WallOptions,
    command_line,
    pairs,
    region_texts,
    with_given,
)
from .verdict.assignment import Assignment
from .verdict.run import Conversion, RunCase, RunResult, Stopwatch, dialled

if TYPE_CHECKING:
    from ..predictors.text.clauses import Bound


def convert(
    asset: str | Path | Asset,
    *,
    output: str | Path | None = None,
    options: ConvertOptions | None = None,
    walls: WallOptions | None = None,
    progress: Callable[[str, float], None] | None = None,
    **given: Any,
) -> Conversion:
    """Make a watertight tetrahedral mesh [m] of an asset, one region per part.

    Parameters
    ----------
    asset
        File to load, or an asset already loaded.
    output
        Mesh to write (.msh, .vtu, .vtk), with its sidecar beside it, chair.msh.json.
    options
        Size, units and mesher; each may be ``given`` by name: ``convert("chair.glb", size=0.9)``.
    walls
        What closed parts are inside; a wall that the mesh can hold becomes its own.
    progress
        Called with (stage, seconds) while the engine works.

    Returns
    -------
    Conversion
        ``mesh`` [m], the ``asset`` it was made of, and a ``report`` of what was proven of it.

    Raises
    ------
    InputError
        Where the file cannot be read or the output not be written.
    NoVolumeError
        Where the asset encloses no volume.

    Examples
    --------
    >>> import autophyx_tet as apx, trimesh
    >>> written = trimesh.creation.box((0.2, 0.1, 0.1)).export("box.stl")
    >>> made = apx.convert("box.stl", units="m", mesher="stuffing", edge_length=0.05, no_cache=True)
    >>> bool(abs(made.mesh.volume / 0.002 - 1) < 0.01)  # m^3
    True
    """
    from ..converters.mesh.meshdata import write_mesh
    from .asset.load import load_asset
    from .meshing.convert import SUFFIXES, import_tets, tetrahedralize
    from .segment import divided_again, in_one

    options = with_given(options or ConvertOptions(), given, verb="convert")
    walls, output = walls or WallOptions(), path_of(output)
    if output is not None:
        check_mesh(output)
    scale = {"size": options.size, "units": options.units, "up": options.up}
    if not isinstance(asset, Asset) and Path(asset).suffix.lower() in SUFFIXES:
        asset, mesh, report = import_tets(asset, **scale)  # it is a tet mesh already
    else:
        if not isinstance(asset, Asset):
            asset = load_asset(asset, **options.loading())
        cut, asset = asset, in_one(asset)
        cut_before = cut is not asset
        asset, walls = _with_rooms(asset, walls, options)

        def first(mesh: TetMesh) -> None:
            """Write and tell a body that is there before fTetWild has ended."""
            mesh = divided_again(mesh, cut) if cut_before else mesh
            if output is not None:
                write_mesh(output, mesh)
            if progress is not None:
                told = Note("pipeline.first", tets=len(mesh.tets), volume=mesh.volume)
                progress(f"{EXPECTED}{told}", 0.0)

        mesh, report = tetrahedralize(
            asset, **options.engine(), **walls.geometry(), first=first, progress=progress
        )
        if cut_before:
            rooms = asset.parts[1:]
            asset, mesh = replace(cut, parts=(*cut.parts, *rooms)), divided_again(mesh, cut)
    result = Conversion(asset=asset, mesh=mesh, report=report, walls=walls)
    if output is not None:
        write_mesh(output, mesh)
        result.described().write(output)
        result = replace(result, files=(output, Sidecar.path(output)))
    return result


def _with_rooms(
    asset: Asset, walls: WallOptions, options: ConvertOptions
) -> tuple[Asset, WallOptions]:
    """An asset with a part for what each wall holds, where the mesh can hold the wall."""
    from .walls import with_rooms

    if (walls.wall is None and not walls.part_wall) or not walls.fill:
        return asset, walls
    thinnest = options.epsilon_rel * float(np.linalg.norm(asset.size))
    filled = with_rooms(asset, walls, thinnest=thinnest)
    contents = tuple(f"{name}={material}" for name, material in filled.contents.items())
    return filled.asset, replace(walls, held=filled.walls, contents=contents)


def assign(
    mesh: str | Path | TetMesh,
    text: str,
    *,
    asset: str | Path | Asset | None = None,
    output: str | Path | None = None,
    field_output: str | Path | None = None,
    options: AssignOptions | None = None,
    walls: WallOptions | None = None,
    **given: Any,
) -> Assignment:
    """Give every tet E [Pa], nu [1], rho [kg/m^3] from a sentence.

    Parts that are hollow, by ``walls``, by the text or by what they are, get the apparent material
    that weighs and bends as their wall and what it holds.

    Parameters
    ----------
    mesh
        Mesh [m], or a file of one.
    text
        What the parts are made of, in plain words.
    asset
        The asset that the mesh came from: the names and looks of its parts.
    output
        Mesh to write (.msh, .vtu, .vtk), with its sidecar beside it.
    field_output
        Voxel field to write (.npz).
    options
        Predictor, overrides and strictness; each may be ``given`` by name.
    walls
        What closed parts are inside.

    Returns
    -------
    Assignment
        ``mesh`` with its material, ``part_rows()`` of what each part got and why, ``warnings``.

    Raises
    ------
    UsageError
        Where a part or a material is unknown or the text is too long; under ``options.strict``,
        where anything was not understood or is a guess.
    BandError
        Under ``options.strict``, where a value leaves the band of its category.

    Examples
    --------
    >>> import autophyx_tet as apx
    >>> from autophyx_tet.fem import box_mesh
    >>> body = apx.assign(box_mesh((0.1, 0.1, 0.1), (1, 1, 1)), "oak", predictor="retrieval")
    >>> oak = apx.load_table().exact("oak").value()
    >>> round(body.mesh.mass / (0.1**3 * oak.rho), 9)  # rho V
    1.0
    """
    from ..converters.transfer import divided_by_voxels, sample_material, voxelize
    from ..predictors.assign import predict_materials
    from ..predictors.resolve.numbers import numbers_of_parts
    from .features import appearance_of
    from .segment import cut_voxels
    from .walls import Called, Walls, build_parts, share_within, with_walls

    options = with_given(options or AssignOptions(), given, verb="assign").checked()
    output, field_output = path_of(output), path_of(field_output)
    check_outputs(output, field_output)
    mesh, sidecar, seen, warnings = read_known(mesh, asset)
    said = Walls.said(walls, sidecar, mesh.region_names)
    bound, table = _read(text, mesh, sidecar, options)
    called = Called.of(mesh, sidecar, bound, table)
    # What words and the predictor make of the regions
    labels = tuple(tuple(sidecar.labels.get(name, ())) for name in mesh.region_names)
    voxels = replace(voxelize(mesh, cells=options.cells), labels=labels)
    found = predict_materials(
        voxels,
        bound,
        predictor=options.predictor,
        overrides=pairs(options.part),
        materials=pairs(options.material),
        values=numbers_of_parts(options.set),
        table=table if options.table else None,
        alpha=options.alpha,
        samples=options.samples,
        volumes=mesh.region_volumes().tolist(),
        within=partial(share_within, mesh),
        usual=called.usual_materials(),
        up=sidecar.up,
        appearance=seen and partial(appearance_of, seen, voxels, encoder=options.encoder),
        regions_of=seen and partial(cut_voxels, seen, voxels, up=sidecar.up),
        regions=region_texts(options),
    )
    found = said.filled(found)
    if len(found.choices) > len(mesh.region_names):
        mesh = divided_by_voxels(mesh, found.parts, found.parents)
        sidecar = sidecar.divided(found.parts)
        called = called.divided(mesh, sidecar, found.parents)
    built = build_parts(mesh, found.choices, called, said)
    field = with_walls(found.field, built)
    sampled = sample_material(mesh, field)
    doubts = (*found.doubts(), *filter(None, (one.doubt for one in built)))
    apparent = (one.warning for one in built)
    regions = list(sampled.unmatched)
    unmatched = (Note("assign.no_voxel", regions=regions),) if regions else ()
    result = Assignment(
        mesh=sampled.mesh,
        text=text,
        field=field,
        choices=found.choices,
        built=built,
        sampling=sampled,
        sidecar=sidecar,
        regions=found.regions,
        warnings=(*warnings, *doubts, *filter(None, apparent), *unmatched),
        doubts=tuple(line for line in doubts if severity_of(line) != "note"),
    )
    if options.strict:
        result.check_bands()
        result.check_doubts()
    return _written(result, output, field_output)


def _read(
    text: str, mesh: TetMesh, sidecar: Sidecar, options: AssignOptions
) -> tuple[Bound, MaterialTable]:
    """What a text says of the regions of a mesh, read here, once; and the materials it may name."""
    from ..predictors.regions.division import region_numbers
    from ..predictors.text.clauses import CORRECTION, bind, corrected
    from ..predictors.text.one_piece import of_one_piece
    from ..predictors.text.reader import read_sentence
    from ..predictors.text.tagger import with_second_opinion

    table = with_own_rows(options.table) if options.table else load_table()
    labels = sidecar.labels_of(mesh.region_names)
    if not options.interpreter:
        # The regions of one thing are called by numbers, and told apart by a network of their own
        if region_numbers([own[0] for own in labels]):
            return read_sentence(text, labels, table), table
        second = with_second_opinion if len(labels) > 1 else of_one_piece

        def read(said: str) -> Bound:
            return second(read_sentence(said, labels, table), labels, table)

        return corrected(text, read) if CORRECTION.search(text) else read(text), table
    from ..predictors.text.interpreter import ChatEndpoint, interpret

    names = [own[0] for own in labels]
    endpoint = ChatEndpoint.at(options.interpreter)
    return bind(interpret(endpoint, text, table, names), labels), table


def _written(result: Assignment, output: Path | None, field_output: Path | None) -> Assignment:
    """Write the mesh with its sidecar, and the field; the files are on record."""
    from ..converters.mesh.meshdata import write_mesh

    files: tuple[Path, ...] = ()
    if output is not None:
        write_mesh(output, result.mesh)
        result.described().write(output)
        files = (output, Sidecar.path(output))
    if field_output is not None:
        npz.save(field_output, result.field)
        files = (*files, field_output)
    return replace(result, files=files)


def run(
    asset: str | Path | Asset,
    texts: Sequence[str],
    *,
    output: str | Path,
    picture: str | Path | None = None,
    convert_options: ConvertOptions | None = None,
    walls: WallOptions | None = None,
    assign_options: AssignOptions | None = None,
    simulate_options: SimulateOptions | None = None,
    features: bool = False,
    dial: bool = False,
    progress: Callable[[str, float], None] | None = None,
) -> RunResult:
    """Convert once, assign and simulate every sentence under the same loads, write a folder.

    Nothing is written before everything is computed.

    Parameters
    ----------
    asset
        File to load, or an asset already loaded.
    texts
        Sentences, each of what the parts are made of.
    output
        Folder for mesh.msh, mesh.vtu, field.npz, motion.pvd, report.html and run.json.
    picture
        One more picture (.png, .gif, .webp), of the first sentence.
    convert_options, walls, assign_options, simulate_options
        Options of the single verbs.
    features
        Whether the report shows what the image encoder sees.
    dial
        Whether every sentence is solved at alpha 0, .5 and 1.
    progress
        Called with the stage and the seconds [s] so far.

    Returns
    -------
    RunResult
        The conversion, and a case a sentence with its material and its simulation.

    Raises
    ------
    AutophyxError
        What the single verbs raise.
    """
    from .report.pages import write_folder
    from .report.picture import SUFFIXES, write_picture
    from .simulation.simulate import simulate, takes_particles
    from .walls import with_named_walls

    output, picture = path_of(output), path_of(picture)
    check_run(output)
    ways = dialled((assign_options or AssignOptions()).checked(), dial=dial)
    if picture is not None:
        check_file(picture, SUFFIXES)
    with alone(output):
        clock = Stopwatch()
        options = convert_options or ConvertOptions()
        if options.mesher == AUTO and takes_particles(simulate_options or SimulateOptions()):
            options = replace(options, mesher=OR_PARTICLES)
        asset, walls = with_named_walls(asset, texts, walls, convert_options)
        solid = convert(asset, options=options, walls=walls, progress=progress)
        clock.lap("convert")
        known: dict[str, Any] = {
            "up": solid.asset.up,
            "options": simulate_options,
            "progress": progress,
        }
        cases = []
        for text, way in product(texts, ways):
            body = assign(solid.mesh, text, asset=solid.asset, options=way, walls=solid.known_walls)
            body = replace(body, sidecar=body.sidecar.with_record(**solid.described().record))
            clock.lap("assign")
            cases.append(RunCase(body, simulate(body.mesh, record=body.record, **known)))
            clock.lap("simulate")
        options = (convert_options, walls, assign_options, simulate_options)
        said = {"text": [*filter(None, texts)], "output": output, "dial": dial}
        again = command_line("run", solid.asset.source or "ASSET", options=options, **said)
        spent = clock.seconds, clock.cpu_seconds
        result = RunResult(solid, tuple(cases), *spent, command=again, date=now())
        if features:
            from .features import features as features_of

            result = replace(result, features=features_of(solid.asset).voxels)
            clock.lap("features")
        if picture is not None:
            files = (write_picture(picture, cases[0].simulation, up=solid.asset.up),)
            result = replace(result, files=files)
        return write_folder(output, result, touch=bool(simulate_options and simulate_options.touch))


_UNITS = {"E": "_Pa", "nu": "", "rho": ""}  # as the columns of a CSV name them


def with_own_rows(path: Path) -> MaterialTable:
    """Return the packaged table with the rows of a file; these win where names are the same.

    A CSV has the columns of the packaged table; a TOML file has tables ``[[material]]`` with
    ``name``, ``category``, ``source``, ``E`` [Pa], ``nu`` [1], ``rho`` [kg/m^3], each a number or
    [min, max], and ``aliases``.

    Raises InputError: Where the file cannot be read, a column is missing, or a value leaves its
        category's band.
    """
    table = load_table()
    own = tuple(_rows(path))
    taken = {key(name) for row in own for name in (row.name, *row.aliases)}
    kept = (
        replace(row, aliases=tuple(alias for alias in row.aliases if key(alias) not in taken))
        for row in table
        if key(row.name) not in taken
    )
    return MaterialTable((*own, *kept))


def _rows(path: Path) -> Iterator[Material]:
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot read the materials {path}: {error}") from error
    if path.suffix.lower() == ".toml":
        try:
            given = tomllib.loads(text).get("material", [])
        except tomllib.TOMLDecodeError as error:
            raise InputError(f"{path} is no TOML: {error}") from error
        if not isinstance(given, list) or not all(isinstance(item, dict) for item in given):
            raise InputError(f"{path}: wanted tables [[material]]")
        records = []  # as lines of a CSV
        for item in given:
            record = {n: str(value) for n, value in item.items() if n not in (*FIELDS, "aliases")}
            for name in FIELDS:
                span = item.get(name)
                low, high = span if isinstance(span, list) and len(span) == 2 else (span, span)
                record[f"{name}_min{_UNITS[name]}"] = str(low)
                record[f"{name}_max{_UNITS[name]}"] = str(high)
            aliases = item.get("aliases", [])
            record["aliases"] = ";".join(aliases if isinstance(aliases, list) else [str(aliases)])
            records.append(record)
    else:
        records = list(csv.DictReader(text.splitlines()))
    if not records:
        raise InputError(f"{path} has no material: wanted a CSV with a header, or [[material]]")
    for number, record in enumerate(records, 1):
        missing = [name for name in ("name", "category", "source") if not record.get(name)]
        if missing:
            raise InputError(f"{path}, material {number}: no {', '.join(missing)}")
        yield row_of_record(record, f"{path}, material {number}")
