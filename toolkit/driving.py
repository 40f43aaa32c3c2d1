"""Motion onto carriers: splats and points that follow a simulated mesh, a file a frame."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..converters.files import writing_folder
from ..converters.registry import POINT_FORMATS, format_of
from ..fem.errors import InputError, UsageError
from ..fem.mesh import TetMesh
from ..fem.note import Note
from ..fem.solve.result import ParticleRun
from ..predictors.asset import UpAxis
from .asset.document import Sidecar, check_folder, mesh_suffixes
from .asset.formats import References

if TYPE_CHECKING:
    from ..converters.embedding import Driven
    from ..converters.points.film import Moved

# A carrier of which more than this fraction lies so far outside, as a fraction of the diagonal, is
# likely in other axes or units. Splats of the body itself lie on its surface, half of them outside.
STRAY, FAR = 0.2, 0.05
# Splats of a film lie within this fraction of the diagonal of the body; others float.
BODY = 0.03
# Frames that a camera is chosen by, and the step from one that is searched for needles to the next.
LOOKS, WATCHED = 24, 10
SAME = 1e-6  # of the size: a motion is of the mesh where no point at rest differs by more


@dataclass(frozen=True)
class DriveRecord:
    """What was driven: ``moved`` points or splats over ``frames``, each a file where there are any.

    ``outside`` of them lie in no tet and follow the nearest one, at most ``farthest`` [m] away;
    ``invalid`` have no finite position and stay as they are; ``picture`` shows moving splats.
    """

    files: tuple[Path, ...]
    frames: int
    moved: int
    outside: int
    farthest: float
    invalid: int
    metres_per_unit: float
    picture: Path | None = None
    film: FilmRecord | None = None
    warnings: tuple[str, ...] = ()

    def document(self) -> dict[str, Any]:
        """Return what ``transfer --motion --json`` prints."""
        film = self.film and {**self.film._asdict(), "files": [*map(str, self.film.files)]}
        return {**self.__dict__, "film": film}


class FilmRecord(NamedTuple):
    """A film of ``frames`` frames, and what became of the splats in it.

    ``drawn`` of them are seen; ``floating`` lie off the body and are not, ``left`` went with
    particles that left the grid. ``clamped`` were bounded in their stretch in some frame;
    ``needles`` are longer than three times their length beside their neighbours in one.
    """

    files: tuple[Path, ...]
    frames: int
    drawn: int
    floating: int
    left: int
    clamped: int
    needles: int


class Actor:
    """Splats of a film and the ``states`` that carry them, those that belong to the body alone."""

    def __init__(self, driven: Driven, states: Sequence[Any] | np.ndarray) -> None:
        from ..converters.points.film import Shown

        body = driven.embedding.away <= BODY * driven.embedding.size
        table = driven.table.only(np.flatnonzero(driven.valid)[body])
        self.driven = driven
        self.table, self.embedding = table, driven.embedding.only(body)
        self.shown, self.states, self.scale = Shown(table), states, driven.scale
        self.floating = len(driven.table) - len(table)
        self.clamped = np.zeros(len(table), dtype=bool)
        self.gone = np.zeros(len(table), dtype=bool)

    def frame(self, number: int) -> Moved:
        """The splats in a frame, in the unit of their file."""
        from ..converters.points.film import Moved

        now, shown = self.embedding.carried(self.states[number]), self.shown
        if now.clamped.any():
            self.clamped |= now.mixing @ now.clamped.astype(float) > 0
        self.gone |= now.gone
        return Moved(
            now.positions / self.scale,
            now.gradients @ shown.roots,
            np.where(now.gone, 0.0, shown.found.opacity),
            None if shown.look.rest is None else now.rotations,
        )


def record(
    path: Path,
    actors: Sequence[Actor],
    *,
    up: UpAxis,
    ground: float | None = None,
    titles: Sequence[str] = (),
    key: str = "",
    progress: Callable[[int, int], None] | None = None,
) -> FilmRecord:
    """Write a film (.webp) of actors side by side, seen alike, and an .mp4 where that can be made.

    Frames that a film of the same ``key`` has already stay: it goes on after them. ``ground`` [m]
    is the height of what they stand on.
    """
    from ..converters.points import film

    beside = path.with_suffix(".key")
    if not (key and beside.is_file() and beside.read_text() == key):
        path.unlink(missing_ok=True)
        if key:
            beside.write_text(key)

    first, frames = actors[0], len(actors[0].states)
    scale, some = first.scale, slice(None, None, max(1, len(first.table) // film.FEW))
    seen = range(0, frames, max(1, frames // LOOKS))
    few = [(actor.embedding.only(some), actor.states) for actor in actors]
    places = np.concatenate([
        [carrier.carried(states[i]).positions / scale for i in seen] for carrier, states in few
    ], axis=1)  # fmt: skip
    cameras = film.tracked(places, first.table.only(some), up, frames)
    low, high = np.nanquantile(places[0], film.EDGES, axis=0)
    floor = None if ground is None else ground / scale
    stage = film.Stage((low + high) / 2, float(np.linalg.norm(high - low)), up, floor)
    height, width = cameras[0].size
    out, needles = film.WebP(path, (width * len(actors), height)), 0
    for i in range(out.frames, frames):
        moved = [actor.frame(i) for actor in actors]
        out.add(film.picture([a.shown for a in actors], moved, cameras[i], stage, titles))
        if i % WATCHED == 0 or i == frames - 1:
            pairs = zip(actors, moved, strict=True)
            needles = max(needles, sum(int(film.needles(a.shown, m).sum()) for a, m in pairs))
        if progress is not None:
            progress(i + 1, frames)
    more = film.write_mp4(path.with_suffix(".mp4"), path)
    return FilmRecord(
        files=(path, *([more] if more else [])),
        frames=frames,
        drawn=sum(len(actor.table) for actor in actors),
        floating=sum(actor.floating for actor in actors),
        left=sum(int(actor.gone.sum()) for actor in actors),
        clamped=sum(int(actor.clamped.sum()) for actor in actors),
        needles=needles,
    )


def drive(
    mesh: TetMesh,
    displacements: Sequence[Any] | Iterable[Any],
    carrier: Path,
    *,
    folder: Path,
    scale: float = 1.0,
    run: ParticleRun | None = None,
    up: UpAxis = "z",
    ground: float | None = None,
) -> DriveRecord:
    """Write ``carrier`` into ``folder`` once a frame, moved with ``mesh``.

    mesh: The mesh at rest.
    displacements: Displacement (points, 3) [m] of its points in every frame.
    carrier: Gaussian splats or points. A format that is only read is written as .ply.
    scale: Metres per unit of the carrier.
    run: Particles that moved the mesh: the carrier follows them, where the mesh tears too.
    up, ground: Axis that points up in the film of splats, and the height [m] they stand on.
    Raises InputError: Where the carrier cannot be read, or has no points.
    """
    from ..converters.embedding import Driven
    from ..converters.points.table import read_points, write_points

    form, suffix, warnings = format_of(carrier, POINT_FORMATS), carrier.suffix, []
    if form.write is None:
        warnings.append(f"{form.title} ({suffix}) are read only here: the frames are .ply")
        suffix = ".ply"
    table, states, film = read_points(carrier), displacements, None
    driven = Driven.of(table, mesh, scale=scale)
    if run is not None:
        states = range(len(run.positions))
        driven = Driven.by_particles(table, run, scale=scale)
    with writing_folder(folder) as scratch:
        names = []
        for i, moved in enumerate(driven.frames(states)):
            names.append(f"{carrier.stem}_{i:05d}{suffix}")
            write_points(scratch / names[-1], moved)
        if driven.table.is_splat and isinstance(states, Sequence | np.ndarray):
            actor = Actor(driven, states)
            if len(actor.table):
                film = record(scratch / f"{carrier.stem}.webp", [actor], up=up, ground=ground)
                film = film._replace(files=tuple(folder / file.name for file in film.files))
    known = driven_record(driven)
    return replace(
        known,
        files=tuple(folder / name for name in names),
        frames=len(names),
        picture=None if film is None else film.files[0],
        film=film,
        warnings=(*warnings, *known.warnings),
    )


def driven_record(driven: Driven) -> DriveRecord:
    """How a carrier lies in what carries it; a warning where much of it lies far outside."""
    warnings, room = [], FAR * driven.embedding.size
    count, far = int(driven.valid.sum()), int((driven.embedding.away > room).sum())
    if far > STRAY * count:
        known = {"far": far, "count": count, "room": room, "farthest": driven.farthest}
        warnings.append(Note("driving.outside", **known))
    return DriveRecord(
        files=(),
        frames=0,
        moved=len(driven.table),
        outside=driven.outside,
        farthest=driven.farthest,
        invalid=int((~driven.valid).sum()),
        metres_per_unit=driven.scale,
        warnings=tuple(warnings),
    )


def transfer_motion(
    source: str | Path | TetMesh,
    target: str | Path,
    *,
    motion: Path,
    output: Path,
    scale: float | None = None,
) -> DriveRecord:
    """Write splats or points once a frame of ``motion`` (.pvd), moved with the mesh ``source``.

    ``scale`` is metres per unit of ``target``; by default the mesh's own where it is its asset.

    Raises InputError: Where a file cannot be read or the motion is not of the mesh.
    """
    from ..converters.mesh.meshdata import read_mesh

    check_folder(output)
    mesh = source if isinstance(source, TetMesh) else read_mesh(source)
    target = Path(target)
    found = checked_scale(scale, source, target)
    return drive(mesh, _displacements(motion, mesh), target, folder=output, scale=found)


def checked_scale(scale: float | None, source: object, target: Path) -> float:
    """Metres per unit of a target as given, or as known; ``UsageError`` where it is no size.

    Known are those of the asset that the mesh was made of; else it is 1.
    """
    if scale is None:
        scale, sidecar = 1.0, None
        if isinstance(source, str | Path) and Path(source).suffix.lower() in mesh_suffixes():
            sidecar = Sidecar.read(Path(source))
        if sidecar is not None and target.is_file():
            digest = References(target.parent).digest(target.read_bytes())
            if digest == sidecar.source.get("sha256"):
                scale = float(sidecar.source.get("metres_per_unit", 1.0))
    if not (np.isfinite(scale) and scale > 0):
        raise UsageError(f"--scale must be a number > 0 of metres per unit, got {scale:g}")
    return scale


def _displacements(motion: Path, mesh: TetMesh) -> Iterator[np.ndarray]:
    """Displacement [m] of every frame of a .pvd of this very mesh."""
    from ..converters.mesh.vtk import read_pvd

    room = SAME * float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
    for time, frame in read_pvd(motion):
        shape = frame.mesh.points.shape
        if shape != mesh.points.shape or np.abs(frame.mesh.points - mesh.points).max() > room:
            raise InputError(f"{motion}: its mesh of {shape[0]} points at rest is not the source")
        if "displacement" not in frame.point_data:
            raise InputError(f"{motion}: the frame at {time:g} s has no array 'displacement'")
        yield np.asarray(frame.point_data["displacement"], dtype=np.float64)
