"""The folder that `run` leaves: mesh, field, motion, report, and run.json written last."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..converters import npz
from ..converters.pvd import write_pvd
from ..converters.table import write_mesh
from .document import SCHEMA, versions, write_json
from .picture import render_png, story
from .quality import dihedral_angles
from .report import Case, PartRow, ReportContent, write_report
from .report_content import Band
from .results import Conversion, RunCase, RunResult

# Share of full gravity in each frame of the motion: the load comes on slowly and linearly.
RAMP = np.linspace(0, 1, 6)

PICTURE, SAMPLES = 320, 4  # pixels of a panel and rays a pixel: one or two seconds of a core


def write_folder(folder: Path, result: RunResult) -> RunResult:
    """Write everything and return the result with its files; further texts go to ``text2/`` ..."""
    files: list[Path] = []
    for number, case in enumerate(result.cases, 1):
        home = folder if number == 1 else folder / f"text{number}"
        home.mkdir(parents=True, exist_ok=True)
        files += _write_case(home, case, bare_mesh=number == 1)
    report = write_report(folder / "report.html", report_content(result))
    files.append(_write_picture(folder / "picture.png", result))
    record = folder / "run.json"
    result = replace(result, files=(*files, report, record))
    write_json(record, {"schema": SCHEMA, **result.document()})
    return result


def _write_case(home: Path, case: RunCase, *, bare_mesh: bool) -> list[Path]:
    mesh, solved = case.assignment.mesh, case.simulation
    files = []
    if bare_mesh:
        write_mesh(home / "mesh.msh", mesh)
        files += [home / "mesh.msh", case.assignment.described().write(home / "mesh.msh")]
    write_mesh(home / "mesh.vtu", mesh, point_data=solved.point_data, cell_data=solved.cell_data)
    npz.save(home / "field.npz", case.assignment.field)
    frames = [(float(t), {"displacement": t * solved.solved.displacement}) for t in RAMP]
    return [
        *files,
        home / "mesh.vtu",
        home / "field.npz",
        *write_pvd(home / "motion.pvd", mesh, frames),
    ]


def _write_picture(path: Path, result: RunResult) -> Path:
    """Asset, stiffness and sag of the first sentence, side by side."""
    case, asset = result.cases[0], result.conversion.asset
    panels = story(asset, case.assignment.mesh, case.simulation.solved.displacement)
    render_png(path, panels, up=asset.up, pixels=PICTURE, samples=SAMPLES)
    return path


def report_content(result: RunResult) -> ReportContent:
    """Gather what the report shows of a run."""
    conversion, document = result.conversion, result.document()
    asset = conversion.asset
    return ReportContent(
        title=asset.name,
        cases=tuple(_report_case(case) for case in result.cases),
        up=asset.up,
        quality=_quality(conversion),
        warnings=tuple(document["warnings"]),
        provenance={
            "asset": asset.source or asset.name,
            "SHA-256": asset.source_hash or "",
            "metres per unit": asset.metres_per_unit,
            "versions": versions(),
            "seconds": {name: round(value, 2) for name, value in result.seconds.items()},
        },
    )


def _quality(conversion: Conversion) -> dict[str, object]:
    mesh, quality = conversion.mesh, conversion.report.quality
    kept = sum(guarantee.ok for guarantee in conversion.report.guarantees)
    return {
        "tets": quality.tets,
        "points": quality.points,
        "volume [m³]": quality.volume,
        "guarantees kept": f"{kept} of {len(conversion.report.guarantees)}",
        "distance to the input [m]": conversion.report.distances.to_input,
        "distance from the input [m]": conversion.report.distances.from_input,
        "smallest altitude [m]": quality.altitude_min,
        "connected components": quality.components,
        "smallest dihedral angle of each tet [°]": dihedral_angles(mesh.points, mesh.tets).min(1),
    }


def _report_case(case: RunCase) -> Case:
    solved = case.simulation.solved
    return Case(
        text=case.assignment.text,
        mesh=case.assignment.mesh,
        parts=tuple(_part_row(row) for row in case.assignment.part_rows()),
        displacement=solved.displacement,
        von_mises=solved.von_mises,
        motion=RAMP[:, None, None] * solved.displacement,
        times=RAMP,
        verdicts=tuple(case.simulation.verdicts()),
    )


def _part_row(row: dict[str, Any]) -> PartRow:
    E, nu, rho = (Band(*row["ranges"][name]) for name in ("E", "nu", "rho"))
    return PartRow(
        name=row["name"],
        material=row["material"],
        words=row["why"],
        E=row["E"],
        nu=row["nu"],
        rho=row["rho"],
        volume=row["volume"],
        mass=row["mass"],
        source=row["source"],
        E_band=E,
        nu_band=nu,
        rho_band=rho,
    )
