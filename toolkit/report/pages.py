"""Pages: what the report shows of a run, and of a single simulation."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import replace
from html import escape
from typing import Any, NamedTuple

from ... import __version__
from ...fem.errors import UsageError
from ...fem.reduced.reduction import accuracy_warnings
from ...fem.scene.materials import Span
from ...predictors.asset import UpAxis
from ..io.document import now, plain, versions
from ..io.sidecar import Sidecar
from ..meshing.quality import dihedral_angles, quality
from ..results.conversion import Conversion
from ..results.description import describe, marks
from ..results.quantities import si
from ..results.ringing import Ringing
from ..results.run import RunResult
from ..results.settled import Settled
from ..results.simulation import Simulation
from ..results.verdict import Verdict
from .answers import found, loaded, loaded_mesh, unheard
from .content import Case, PartRow, ReportContent
from .look import look_of
from .picture.snapshot import PARTICLES, particle_film
from .report import report_page
from .touch import touch_of

log = logging.getLogger(__name__)


def run_page(
    result: RunResult, *, pictures: Mapping[str, bytes] | None = None, touch: bool = False
) -> ReportContent:
    """Gather what the report shows of a run, one case a sentence; pictures by their captions.

    With ``touch`` there are bodies to pull, where they can be.
    """
    conversion, document = result.conversion, result.document()
    asset = conversion.asset
    cases = [
        _case(c.assignment.text, c.simulation, c.assignment.document(), verdicts)
        for c, verdicts in zip(result.cases, result.verdicts(), strict=True)
    ]
    looks = [look_of(asset, case.mesh) for case in cases]
    cases = [replace(case, look=look) for case, look in zip(cases, looks, strict=True)]
    if result.turned:
        places = [c.assignment.field.alpha for c in result.cases]
        cases = [replace(case, alpha=alpha) for case, alpha in zip(cases, places, strict=True)]
    if touch:
        cases = [_touched(case, c.simulation) for case, c in zip(cases, result.cases, strict=True)]
    return ReportContent(
        title=asset.name,
        cases=tuple(cases),
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
        pictures={**(pictures or {}), **_films(result.cases[0].simulation, asset.up)},
        made=_made(result.date, sum(result.seconds.values())),
        command=result.command,
        loaded=tuple(loaded(conversion)),
    )


def simulation_page(
    name: str, simulation: Simulation, sidecar: Sidecar, *, touch: bool = False, command: str = ""
) -> ReportContent:
    """Gather what the report shows of one simulation, headed by its asset or the mesh's ``name``.

    ``command`` makes it again. With ``touch`` there is a body to pull, where it can be.
    """
    mesh, chosen = simulation.mesh, sidecar.record.get("assign", {})
    found = quality(mesh)
    case = _case(chosen.get("text", ""), simulation, chosen)
    return ReportContent(
        title=sidecar.source.get("name") or name,
        cases=(_touched(case, simulation) if touch else case,),
        up=sidecar.up,
        quality={
            "tets": found.tets,
            "points": found.points,
            "volume [m³]": found.volume,
            "smallest altitude [m]": found.altitude_min,
            "connected components": found.components,
            "smallest dihedral angle of each tet [°]": dihedral_angles(mesh.points, mesh.tets).min(
                1
            ),
        },
        warnings=_warnings(simulation, sidecar),
        provenance={
            **{key: value for key, value in sidecar.source.items() if value},
            "scenario": simulation.scenario,
            "versions": versions(),
            "seconds": {"simulate": round(simulation.seconds, 2)},
        },
        pictures=_films(simulation, sidecar.up),
        made=_made(now(), simulation.seconds),
        command=command,
        loaded=tuple(loaded_mesh(name, mesh, sidecar)),
    )


def _warnings(simulation: Simulation, sidecar: Sidecar) -> tuple[str, ...]:
    """Those of the simulation, after those of what made its mesh."""
    before = (w for stage in sidecar.record.values() for w in stage.get("warnings", ()))
    return tuple(dict.fromkeys((*before, *simulation.warnings)))


class Framed(NamedTuple):
    """A report as a notebook shows it: the page in a frame of its own."""

    page: str
    height: int

    def __repr__(self) -> str:
        return f"<Framed: a report of {len(self.page) / 1e6:.1f} MB>"

    def _repr_html_(self) -> str:
        allowed = 'sandbox="allow-scripts allow-downloads" style="border:0"'
        sized = f'width="100%" height="{self.height}"'
        return f'<iframe {allowed} {sized} srcdoc="{escape(self.page)}"></iframe>'


def show_report(result: RunResult | Simulation, *, height: int = 820) -> Framed:
    """Return the report of a run or of a simulation, for a notebook; ``height`` in pixels."""
    if isinstance(result, RunResult):
        return Framed(report_page(run_page(result)), height)
    page = simulation_page("mesh", result, Sidecar(up=result.scene.up))
    return Framed(report_page(page), height)


def _made(date: str, seconds: float) -> str:
    """When, by what and in how long."""
    return " · ".join([date, f"autophyx-tet {__version__}", si(seconds, "s")])


def _films(simulation: Simulation, up: UpAxis) -> dict[str, bytes]:
    """Moving particles by caption, where particles moved the body."""
    if simulation.particles is None:
        return {}
    return {PARTICLES: particle_film(simulation.particles, up=up)}


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


def _case(
    text: str,
    simulation: Simulation,
    chosen: Mapping[str, Any],
    verdicts: list[Verdict] | None = None,
) -> Case:
    animation, modes = simulation.animation, simulation.vibrations
    parts, doubts = chosen.get("parts", []), chosen.get("doubts")
    rings = isinstance(simulation, Ringing)
    rests = simulation if isinstance(simulation, Settled) else None
    judged = simulation.verdicts()
    return Case(
        text=text,
        mesh=simulation.mesh,
        parts=tuple(map(_part_row, parts)),
        displacement=None if rings else simulation.displacement,
        von_mises=rests and rests.solved.von_mises,
        max_von_mises=rests and rests.max_von_mises,
        motion=None if rings else animation.displacement,
        times=None if rings else animation.times,
        vibrations=None if modes is None else modes.shapes[:, : len(simulation.mesh.points)],
        state="Under load" if rests else "At the end",
        clock="load" if rests else "time",
        frequencies=simulation.frequencies,
        verdicts=(*judged, *(verdicts or ())),
        title=simulation.title,
        acting=describe(simulation.scene),
        marks=marks(simulation.scene),
        solved=simulation.solution,
        answers=(*found(simulation, parts), *([] if doubts is None else [unheard(doubts)])),
    )


def _touched(case: Case, simulation: Simulation) -> Case:
    """The case with its body to pull; on the terminal why there is none, or what it is not."""
    try:
        touch = touch_of(simulation.scene)
    except UsageError as error:
        log.warning("--touch: the page has no body to pull: %s", error)
        return case
    for warning in accuracy_warnings(touch.model):
        log.warning("--touch: of the body to pull, %s", warning)
    return replace(case, touch=touch)


def _part_row(row: dict[str, Any]) -> PartRow:
    ranges = plain(row["ranges"])
    E, nu, rho = (Span(ranges[name]["min"], ranges[name]["max"]) for name in ("E", "nu", "rho"))
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
        E_span=E,
        nu_span=nu,
        rho_span=rho,
    )
