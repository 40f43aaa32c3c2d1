"""Motion onto carriers: splats and points that follow a simulated mesh, a file a frame."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..fem.errors import InputError, UsageError
from ..fem.mesh import TetMesh
from ..fem.note import Note
from ..fem.solve.result import ParticleRun
from ..predictors.asset import UpAxis
from .asset.document import Sidecar, check_folder, mesh_suffixes
from .asset.formats import References

if TYPE_CHECKING:
    from ..converters.points.table import PointTable

# A carrier of which more than this fraction lies so far outside, as a fraction of the diagonal, is
# likely in other axes or units. Splats of the body itself lie on its surface, half of them outside.
STRAY, FAR = 0.2, 0.05
SAME = 1e-6  # of the size: a motion is of the mesh where no point at rest differs by more


@dataclass(frozen=True)
class DriveRecord:
    """What was driven: ``moved`` points or splats over ``frames`` files.

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
    warnings: tuple[str, ...] = ()

    def document(self) -> dict[str, Any]:
        """Return what ``transfer --motion --json`` prints."""
        return dict(self.__dict__)


def drive(
    mesh: TetMesh,
    displacements: Sequence[Any] | Iterable[Any],
    carrier: Path,
    *,
    folder: Path,
    scale: float = 1.0,
    run: ParticleRun | None = None,
    up: UpAxis = "z",
) -> DriveRecord:
    """Write ``carrier`` into ``folder`` once a frame, moved with ``mesh``.

    mesh: The mesh at rest.
    displacements: Displacement (points, 3) [m] of its points in every frame.
    carrier: Gaussian splats or points. A format that is only read is written as .ply.
    scale: Metres per unit of the carrier.
    run: Particles that moved the mesh: the carrier follows them, where the mesh tears too.
    up: Axis that points up in the GIF of splats.
    Raises InputError: Where the carrier cannot be read, or has no points.
    """
    from ..converters.embedding import Driven
    from ..converters.files import writing_folder
    from ..converters.points.table import read_points, write_points
    from ..converters.points.views import SplatFilm, chosen_camera, stride, thinned
    from ..converters.registry import POINT_FORMATS, format_of

    def embedded(table: PointTable) -> Driven:
        if run is None:
            return Driven.of(table, mesh, scale=scale)
        return Driven.by_particles(table, run, scale=scale)

    form, suffix, warnings = format_of(carrier, POINT_FORMATS), carrier.suffix, []
    if form.write is None:
        warnings.append(f"{form.title} ({suffix}) are read only here: the frames are .ply")
        suffix = ".ply"
    table = read_points(carrier)
    states = displacements if run is None else range(len(run.positions))
    driven, film = embedded(table), None
    if table.is_splat and isinstance(states, Sequence | np.ndarray):
        # its camera is chosen by a few of them over the motion, where that is known
        some = list(embedded(thinned(table)).frames(states[:: stride(len(states))]))
        film = SplatFilm(chosen_camera(some, up), len(states))
    with writing_folder(folder) as scratch:
        names = []
        for i, moved in enumerate(driven.frames(states)):
            names.append(f"{carrier.stem}_{i:05d}{suffix}")
            write_points(scratch / names[-1], moved)
            if film is not None:
                film.show(i, moved)
        picture = film.save(scratch / f"{carrier.stem}.gif") if film is not None else None
    rest = mesh.points if run is None else run.positions[0]
    room = FAR * float(np.linalg.norm(np.ptp(rest, axis=0)))
    count, far = int(driven.valid.sum()), int((driven.embedding.away > room).sum())
    if far > STRAY * count:
        known = {"far": far, "count": count, "room": room, "farthest": driven.farthest}
        warnings.append(Note("driving.outside", **known))
    return DriveRecord(
        files=tuple(folder / name for name in names),
        frames=len(names),
        moved=len(driven.table),
        outside=driven.outside,
        farthest=driven.farthest,
        invalid=int((~driven.valid).sum()),
        metres_per_unit=scale,
        picture=None if picture is None else folder / picture.name,
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
