"""From splats and sentences to a film: a coarse body, its material and motion, and the pictures."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..converters import npz
from ..converters.embedding import Driven, ParticleNeighbours
from ..converters.points.table import read_points
from ..converters.registry import POINT_FORMATS
from ..fem.errors import UsageError
from ..fem.mesh import TetMesh, face_components
from ..fem.note import Note, severity_of
from ..fem.scene.up import up_vector
from ..fem.solve.result import Breakage, ParticleRun
from .asset.document import check_folder
from .asset.load import load_asset
from .driving import Actor, FilmRecord, record
from .options import EXPECTED, AssignOptions, ConvertOptions, SimulateOptions
from .pipeline import assign, convert
from .simulation.budget import MOST_TETS, check_budget, driver_edge, picture_seconds
from .simulation.scenario import film_plan, frames_told
from .simulation.simulate import actor_of, simulate
from .verdict.check import Check
from .verdict.checks import CRUMBS, percent

BUDGET = 60.0  # CPU s
# Tets of the lattice that is tried first: of a potted plant, whose pot is held, 5,772 of them move.
# Its first frequency is 4 % above that of twice as many; of MOST_TETS, which lose a branch, 21 %.
FINE_TETS = 16_000


@dataclass(frozen=True)
class FilmResult:
    """A film of splats; ``cases`` are the parts' materials, the verdicts and the cost of each text.

    ``foretold`` and ``spent`` are CPU seconds [s] of the whole, the former known once the body
    had its material; ``resumed`` says that frames or motions of an earlier call were taken.
    """

    film: FilmRecord
    cases: tuple[dict[str, Any], ...]
    foretold: float
    spent: float
    resumed: bool

    def document(self) -> dict[str, Any]:
        """Return what ``film --json`` prints."""
        files = [str(file) for file in self.film.files]
        warnings = dict.fromkeys(line for case in self.cases for line in case.get("warnings", ()))
        return {
            **asdict(self), "film": {**self.film._asdict(), "files": files}, "files": files,
            "warnings": [*warnings],
        }  # fmt: skip


def film(
    asset: str | Path,
    texts: Sequence[str],
    *,
    output: str | Path,
    convert_options: ConvertOptions | None = None,
    assign_options: AssignOptions | None = None,
    simulate_options: SimulateOptions | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> FilmResult:
    """Make a film of splats under a scenario, once a sentence, side by side.

    Every motion is kept in the folder as it ends, and every frame as it is drawn: the same call
    goes on where one was stopped.

    Parameters
    ----------
    asset
        Gaussian splats.
    texts
        Sentences of what they are made of.
    output
        Folder for film.webp, film.mp4 (extra ``film``), film.json and the motions.
    convert_options, assign_options, simulate_options
        Options of the single verbs; ``budget`` [s] by default ``BUDGET``.
    progress
        Called with the stage and the seconds [s] so far.

    Returns
    -------
    FilmResult
        The film, the verdicts, and the CPU seconds foretold and spent.

    Raises
    ------
    UsageError
        Where the asset has no splats.
    AutophyxError
        What the single verbs raise.
    """
    asset, output, began = Path(asset), Path(output), time.process_time()
    options = simulate_options or SimulateOptions()
    options = replace(options, budget=BUDGET if options.budget is None else options.budget)
    check_budget(options)
    if asset.suffix.lower() not in POINT_FORMATS or not (table := read_points(asset)).is_splat:
        raise UsageError("film.no_splats", path=asset)
    check_folder(output)
    output.mkdir(parents=True, exist_ok=True)
    converting = convert_options or ConvertOptions()
    said = (tuple(texts), converting, assign_options, options)
    key = hashlib.sha256(asset.read_bytes() + repr(said).encode()).hexdigest()
    known = output / "film.json"
    state: dict[str, Any] = json.loads(known.read_text()) if known.is_file() else {}
    if state.get("key") != key:
        state = {"key": key, "cases": []}
    resumed, picture, cut_off, before = bool(state["cases"]), 0.0, 0.0, 0.0
    loaded, solid, edges = None, None, []
    for number, text in enumerate(texts):
        if number < len(state["cases"]):
            continue
        if loaded is None:
            loaded, picture = load_asset(asset, **converting.loading()), picture_seconds(table)
            if converting.edge_length is None and converting.edge_length_rel is None:
                volume = sum(part.mesh.volume for part in loaded.parts)
                edges = [driver_edge(volume, most) for most in (FINE_TETS, MOST_TETS)]
        while True:
            if solid is None:
                edge: Any = {"edge_length": edges[0]} if edges else {}
                edge |= {"mesher": "stuffing", "accept_broken": True}
                solid = convert(loaded, options=replace(converting, **edge), progress=progress)
                whole = solid.mesh.volume
                solid = replace(solid, mesh=largest_piece(solid.mesh))
                cut_off = 1 - solid.mesh.volume / whole
            body = assign(solid.mesh, text, asset=solid.asset, options=assign_options)
            body = replace(body, sidecar=body.sidecar.with_record(**solid.described().record))
            up, rows = solid.asset.up, body.record
            told: Any = {"up": up, "materials": rows.materials, "classes": rows.classes}
            before = before or time.process_time() - began
            plan = film_plan(body.mesh, options, picture=picture, spent=before, **told)
            if plan.fits or plan.options.solver != "lbs" or number or not edges[1:]:
                break
            edges, solid = edges[1:], None
        if number == 0:
            spent = time.process_time() - began
            state["foretold"] = float(spent + len(texts) * (plan.solve + plan.draw))
        if progress is not None:
            progress(EXPECTED + plan.words, 0.0)
        answer = simulate(body.mesh, up=up, record=rows, options=plan.options, progress=progress)
        floor = answer.scene.floor
        if floor is None and answer.scene.held.fixed.any():  # what is held stands
            floor = float((answer.mesh.points @ up_vector(up)).min())
        known_as = {"mesh": body.mesh, "scale": solid.asset.metres_per_unit}
        _keep(output / f"motion_{number}.npz", actor_of(table, answer, plan.options, **known_as),
              floor)  # fmt: skip
        checks = [*answer.verdicts()]
        if cut_off > CRUMBS:
            lost = Note("film.cut_off", share=percent(cut_off))
            checks.append(Check("attached", "failed", lost, cut_off, CRUMBS))
        verdicts = [found.document() for found in checks]
        case = {"text": text, **plan._asdict(), "options": plan.options.solver}
        warnings = [*solid.warnings, *body.warnings, *answer.warnings]
        warnings = [line for line in warnings if severity_of(line) != "detail"]
        case |= {"parts": body.part_rows(), "mass": body.mesh.mass, "warnings": warnings}
        state["cases"].append({**case, "up": up, "verdicts": verdicts})
        known.write_text(json.dumps(state, default=str, indent=1) + "\n")
    takes = [kept_motion(output / f"motion_{i}.npz", table) for i in range(len(texts))]
    titles = texts if len(texts) > 1 else ()
    made = record(
        output / "film.webp", [actor for actor, _ in takes], up=state["cases"][0]["up"],
        ground=takes[0][1], titles=titles, key=key,
        progress=frames_told("film", progress, time.perf_counter()),
    )  # fmt: skip
    spent = time.process_time() - began
    return FilmResult(made, tuple(state["cases"]), state["foretold"], spent, resumed)


def largest_piece(mesh: TetMesh) -> TetMesh:
    """The largest piece of a mesh: what a lattice cut off would fly, and its splats are left out.

    Examples
    --------
    >>> import numpy as np
    >>> from autophyx_tet.fem import TetMesh, box_mesh
    >>> bar = box_mesh((4, 1, 1), (4, 1, 1))  # of six tets a cell; without its third one:
    >>> left = bar.tets[abs(bar.centroids[:, 0] - 2.5) > 0.5]
    >>> len(largest_piece(TetMesh(bar.points, left, np.zeros(18, dtype=int))).tets)
    12
    """
    piece = face_components(mesh)
    kept = piece == np.bincount(piece, mesh.volumes).argmax()
    if kept.all():
        return mesh
    used, tets = np.unique(mesh.tets[kept], return_inverse=True)
    names = mesh.region_names
    return TetMesh(mesh.points[used], tets.reshape(-1, 4), mesh.region[kept], names)


def _keep(path: Path, actor: Actor, floor: float | None) -> None:
    """Write what carries splats: the mesh or the particles, in every frame."""
    states = {"scale": np.array(actor.scale), "floor": np.array(np.nan if floor is None else floor)}
    carrier = actor.embedding
    if isinstance(carrier, ParticleNeighbours):
        run, rows = carrier.run, np.array(actor.states)
        states |= {"positions": run.positions, "gradients": run.gradients, "left": run.left}
        states |= {"part": run.part, "spacing": np.array(run.spacing), "rows": rows}
    else:
        mesh = carrier.mesh
        states |= {"points": mesh.points, "tets": mesh.tets}
        states |= {"displacements": np.asarray(actor.states, dtype=np.float32)}
    npz.save_npz(path, **states)


def kept_motion(path: Path, table: Any) -> tuple[Actor, float | None]:
    """The splats of a table after a motion that was written, and the height of their floor [m]."""
    known = npz.load_npz(path)
    scale, floor = float(known["scale"]), float(known["floor"])
    if "tets" in known:
        points, tets = known["points"], known["tets"]
        mesh = TetMesh(points, tets, np.zeros(len(tets), dtype=np.int64))
        driven = Driven.of(table, mesh, scale=scale)
        actor = Actor(driven, known["displacements"].astype(np.float64))
    else:
        counts = ("substeps", "outside", "stationary", "rigid", "bodies", "capped")
        unknown: Any = dict.fromkeys(counts, 0)
        arrays: Any = {name: known[name] for name in ("part", "positions", "gradients", "left")}
        nothing = Breakage(0.0, 0.0, (), (np.nan, np.nan, np.nan), 1, 1, 1.0)
        run = ParticleRun(
            **unknown, **arrays, spacing=float(known["spacing"]), nodes=(0, 0, 0), plan="",
            lagrangian=False, notes=(), laws=(), breakage=nothing,
        )  # fmt: skip
        actor = Actor(Driven.by_particles(table, run, scale=scale), known["rows"].tolist())
    return actor, None if np.isnan(floor) else floor
