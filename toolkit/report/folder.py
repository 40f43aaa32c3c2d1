"""The folder that `run` leaves: mesh, field, motion, report, and run.json written last."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

from ...converters import npz
from ...converters.files import writing_folder
from ...converters.mesh.mesh_file import write_mesh
from ..io.document import SCHEMA, write_json
from ..results.run import RunCase, RunResult, Stopwatch
from .pages import run_page
from .picture.panels import render_png, story
from .report import write_report

PICTURE, SAMPLES = 320, 4  # pixels of a panel and rays a pixel: one or two seconds of a core


def write_folder(folder: Path, result: RunResult, *, touch: bool = False) -> RunResult:
    """Write everything or nothing; the result with its files. Further texts go to ``text2/`` ...

    With ``touch`` the report has bodies to pull.
    """
    with writing_folder(folder) as home:
        clock = Stopwatch()
        made = [*_write_files(home, result, touch), home / "run.json"]
        clock.lap("write")
        spent = {"seconds": {**result.seconds, **clock.seconds}}
        spent["cpu_seconds"] = {**result.cpu_seconds, **clock.cpu_seconds}
        files = (*result.files, *(folder / file.relative_to(home) for file in made))
        result = replace(result, files=files, **spent)
        write_json(made[-1], {"schema": SCHEMA, **result.document()})
    return result


def _write_files(folder: Path, result: RunResult, touch: bool) -> list[Path]:
    """Write all but run.json; data and picture on another core than the report is made on."""
    with ThreadPoolExecutor(1) as beside:
        picture = beside.submit(_write_picture, folder / "picture.png", result)
        data = beside.submit(_write_data, folder, result)
        files, pictures = [], {}
        if result.features is not None:
            from .picture.feature_picture import CAPTION, feature_png

            asset = result.conversion.asset
            files.append(feature_png(folder / "features.png", result.features, asset))
            pictures[CAPTION] = files[-1].read_bytes()
        page = run_page(result, pictures=pictures, touch=touch)
        report = write_report(folder / "report.html", page)
    return [*data.result(), *files, picture.result(), report]


def _write_data(folder: Path, result: RunResult) -> list[Path]:
    files: list[Path] = []
    for number, case in enumerate(result.cases, 1):
        home = folder if number == 1 else folder / f"text{number}"
        home.mkdir(exist_ok=True)
        files += _write_case(home, case, bare_mesh=number == 1)
    return files


def _write_case(home: Path, case: RunCase, *, bare_mesh: bool) -> list[Path]:
    mesh, solved = case.assignment.mesh, case.simulation
    files = []
    if bare_mesh:
        write_mesh(home / "mesh.msh", mesh)
        files += [home / "mesh.msh", case.assignment.described().write(home / "mesh.msh")]
    if len(solved.mesh.tets) == len(mesh.tets):  # with its grain
        mesh = solved.mesh
    write_mesh(home / "mesh.vtu", mesh, point_data=solved.point_data, cell_data=solved.cell_data)
    npz.save(home / "field.npz", case.assignment.field)
    return [*files, home / "mesh.vtu", home / "field.npz", *solved.write(home / "motion.pvd")]


def _write_picture(path: Path, result: RunResult) -> Path:
    """Asset, stiffness and sag of the first sentence, side by side."""
    case, asset = result.cases[0], result.conversion.asset
    simulation = case.simulation
    panels = story(asset, simulation.mesh, simulation.displacement, title=simulation.title)
    render_png(path, panels, up=asset.up, pixels=PICTURE, samples=SAMPLES)
    return path
