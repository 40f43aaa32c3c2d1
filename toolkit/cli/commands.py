"""The commands: each names its options, the verb that it calls, and what a terminal shows of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Annotated, Any

import tyro

from ...converters.registry import PROGRAMS
from ..asset import Unit
from ..options import (
    AssignOptions,
    BatchOptions,
    Common,
    ConvertOptions,
    ExportOptions,
    FeatureOptions,
    Flat,
    Output,
    Repeated,
    SimulateOptions,
    TransferOptions,
    UpAxis,
    WallOptions,
    choice,
)
from . import terminal

Meshing = Annotated[Flat[ConvertOptions], tyro.conf.arg(name="meshing")]
Materials = Annotated[Flat[AssignOptions], tyro.conf.arg(name="materials")]
Solving = Annotated[Flat[SimulateOptions], tyro.conf.arg(name="solving")]


def given(command: Any, *left: str) -> dict[str, Any]:
    """What a verb is called with: the fields of its command, without those that are ``left``."""
    names = (item.name for item in fields(command))
    return {name: getattr(command, name) for name in names if name not in ("common", *left)}


@dataclass(frozen=True)
class ConvertCommand:
    """Make a watertight tetrahedral mesh of an asset, one region per part.

    Example: autophyx-tet convert chair.glb -o chair.msh --size 0.9
    """

    asset: tyro.conf.Positional[Annotated[Path, tyro.conf.arg(metavar="ASSET")]]
    """Surface (obj, ply, stl, glb ...), Gaussian splats, point cloud or density grid."""
    output: Output
    """Mesh to write: .msh, .vtu or .vtk."""
    dry_run: bool = False
    """Say what would be done and estimate tets, time and memory; write nothing."""
    quality: bool = False
    """Print a table of the tets' angles, ratios, altitudes and explicit time step."""
    options: Meshing = field(default_factory=ConvertOptions)
    walls: Flat[WallOptions] = field(default_factory=WallOptions)
    common: Flat[Common] = field(default_factory=Common)

    @property
    def shown(self) -> Callable[[terminal.Document], terminal.Shown]:
        """What a terminal shows of the document."""
        return terminal.plan if self.dry_run else terminal.conversion

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from ..pipeline import convert

        if self.dry_run:
            from ..listing import plan

            return plan(self.asset, self.options, output=self.output)
        with terminal.progress(quiet=self.common.quiet) as tell:
            made = convert(**given(self, "dry_run", "quality"), progress=tell)
        rows = {"quality_rows": made.report.quality.rows()} if self.quality else {}
        return made.document() | rows


@dataclass(frozen=True)
class AssignCommand:
    """Give every tet E, nu and rho from a sentence.

    Example: autophyx-tet assign chair.msh --text "the legs are oak, the seat is soft foam" -o m.msh
    """

    mesh: tyro.conf.Positional[Annotated[Path, tyro.conf.arg(metavar="MESH")]]
    """Mesh made by `convert`: .msh, .vtu or .vtk; - reads a .msh from stdin."""
    output: Output
    """Mesh to write: .msh, .vtu or .vtk."""
    text: str = ""
    """What the object is made of, in plain words; at most 4,000 characters."""
    asset: Path | None = None
    """The asset the mesh came from: its node and material names are read again."""
    field_output: Annotated[Path | None, tyro.conf.arg(name="field")] = None
    """Also write the voxel field, as .npz."""
    options: Materials = field(default_factory=AssignOptions)
    walls: Flat[WallOptions] = field(default_factory=WallOptions)
    common: Flat[Common] = field(default_factory=Common)

    shown = staticmethod(terminal.assignment)

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from ..pipeline import assign

        return assign(**given(self)).document()


@dataclass(frozen=True)
class SimulateCommand:
    """Load the mesh and solve: displacement, stress, motion, vibrations, verdicts.

    Examples: autophyx-tet simulate chair.msh --scenario sag -o sag.vtu --report sag.html;
    autophyx-tet simulate chair.msh --scenario drop -o drop.pvd;
    autophyx-tet simulate jelly.msh --scenario drop --solver spring -o springs.pvd;
    autophyx-tet simulate bonsai.msh --solver lbs -o reduced.pvd;
    autophyx-tet simulate hammer.msh --fix part:handle --load part:head=0,0,-10 -o push.vtu
    """

    mesh: tyro.conf.Positional[Annotated[Path, tyro.conf.arg(metavar="MESH")]]
    """Mesh with E, nu and rho, made by `assign`; for particles also a field or splats with them."""
    output: Output
    """Result to write: .vtu, .vtk (the last state), .pvd, .glb (the motion); --drive: a folder."""
    drive: Path | None = None
    """Gaussian splats or points that move with the mesh: written a file a frame into -o."""
    drive_scale: float | None = None
    """Metres per unit of the file of --drive; by default the mesh's own where it is its asset."""
    report: Path | None = None
    """Page to write too: .html."""
    picture: Path | None = None
    """Picture to write too: .png (the last state), .gif or .webp (the motion)."""
    up: UpAxis | None = None
    """Axis that points up; by default what the mesh's sidecar says, else z."""
    options: Solving = field(default_factory=SimulateOptions)
    common: Flat[Common] = field(default_factory=Common)

    shown = staticmethod(terminal.simulation)

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from ..simulation.simulate import simulate

        with terminal.progress(quiet=self.common.quiet) as tell:
            return simulate(**given(self), progress=tell).document()


@dataclass(frozen=True)
class RunCommand:
    """Convert, assign, simulate and report, in one go.

    Example: autophyx-tet run bonsai.glb --text "the pot is ceramic, the trunk is oak" -o out/bonsai
    """

    asset: tyro.conf.Positional[Annotated[Path, tyro.conf.arg(metavar="ASSET")]]
    """Surface (obj, ply, stl, glb ...), Gaussian splats, point cloud or density grid."""
    output: Output
    """Folder for mesh.msh, mesh.vtu, field.npz, motion.pvd, report.html and run.json."""
    text: Annotated[tuple[str, ...], Repeated] = ()
    """What the object is made of; repeat it to compare two sentences under the same loads."""
    picture: Path | None = None
    """One more picture, outside the folder: .png, or the motion as .gif or .webp."""
    features: bool = False
    """Show in the report what the image encoder sees, as colours; some seconds more."""
    dial: tyro.conf.FlagCreatePairsOff[bool] = False
    """Every text from soft to stiff: the report has a dial (--alpha 0, .5, 1)."""
    dry_run: bool = False
    """Say what would be done and estimate tets, time and memory; write nothing."""
    convert: Meshing = field(default_factory=ConvertOptions)
    walls: Flat[WallOptions] = field(default_factory=WallOptions)
    assign: Materials = field(default_factory=AssignOptions)
    simulate: Solving = field(default_factory=SimulateOptions)
    common: Flat[Common] = field(default_factory=Common)

    @property
    def shown(self) -> Callable[[terminal.Document], terminal.Shown]:
        """What a terminal shows of the document."""
        return terminal.plan if self.dry_run else terminal.run

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from ..pipeline import run

        if self.dry_run:
            from ..listing import plan

            return plan(
                self.asset,
                self.convert,
                output=self.output,
                texts=self.text or ("",),
                simulate=self.simulate,
            )
        with terminal.progress(quiet=self.common.quiet) as tell:
            result = run(
                self.asset,
                self.text or ("",),
                output=self.output,
                picture=self.picture,
                convert_options=self.convert,
                walls=self.walls,
                assign_options=self.assign,
                simulate_options=self.simulate,
                features=self.features,
                dial=self.dial,
                progress=tell,
            )
        return result.document()


@dataclass(frozen=True)
class FilmCommand:
    """Make a film of Gaussian splats that move as what a sentence says they are made of.

    Example: autophyx-tet film plant.ply --text "rubber" --text "oak" --scenario wind -o out/film
    """

    asset: tyro.conf.Positional[Annotated[Path, tyro.conf.arg(metavar="SPLATS")]]
    """Gaussian splats: .ply, .splat, .spz."""
    output: Output
    """Folder for film.webp, film.mp4 and film.json; the same command goes on where it stopped."""
    text: Annotated[tuple[str, ...], Repeated] = ()
    """What it is made of; repeat it to see two sentences side by side."""
    convert: Meshing = field(default_factory=ConvertOptions)
    assign: Materials = field(default_factory=AssignOptions)
    simulate: Solving = field(default_factory=SimulateOptions)
    common: Flat[Common] = field(default_factory=Common)

    shown = staticmethod(terminal.film)

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from ..film import film

        with terminal.progress(quiet=self.common.quiet) as tell:
            return film(
                self.asset,
                self.text or ("",),
                output=self.output,
                convert_options=self.convert,
                assign_options=self.assign,
                simulate_options=self.simulate,
                progress=tell,
            ).document()


@dataclass(frozen=True)
class ReduceCommand:
    """Reduce a body to a few coordinates, as the scenario holds and loads it, and measure that.

    Examples: autophyx-tet reduce bonsai.msh -o bonsai.npz;
    autophyx-tet reduce bonsai.msh -o bonsai.npz --what-if runs.csv
    """

    mesh: tyro.conf.Positional[Annotated[Path, tyro.conf.arg(metavar="MESH")]]
    """Mesh with E, nu and rho, made by `assign`."""
    output: Output
    """Reduced model to write: .npz."""
    what_if: Path | None = None
    """Runs to answer, .csv, a row each: factors to E by part, `load`; gravity `gx`, `gy`, `gz`."""
    up: UpAxis | None = None
    """Axis that points up; by default what the mesh's sidecar says, else z."""
    options: Solving = field(default_factory=SimulateOptions)
    common: Flat[Common] = field(default_factory=Common)

    shown = staticmethod(terminal.reduction)

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from ..simulation.reducing import reduce

        return reduce(**given(self)).document()


@dataclass(frozen=True)
class MatchCommand:
    """Fit the moduli of a reduced body, or of springs, to a motion of the same scene.

    Examples: autophyx-tet match bar.msh --solver lbs --to motion.pvd -o fitted.npz;
    autophyx-tet match bar.msh --solver spring --to soft.pvd --to-stiff stiff.pvd -o ends.npz
    """

    mesh: tyro.conf.Positional[Annotated[Path, tyro.conf.arg(metavar="MESH")]]
    """Mesh with E, nu and rho, made by `assign`."""
    to: Path
    """Motion to fit to, .pvd, as `simulate` writes it."""
    output: Output
    """Parameters to write, .npz, for `simulate --parameters` with the same solver."""
    to_stiff: Path | None = None
    """Motion of a stiffer body in the same scene, .pvd: what lies between, --parameters-alpha."""
    with_nu: tyro.conf.FlagCreatePairsOff[bool] = False
    """Fit Poisson's ratio too: it is hard to tell from E, see the correlation."""
    up: UpAxis | None = None
    """Axis that points up; by default what the mesh's sidecar says, else z."""
    options: Solving = field(default_factory=SimulateOptions)
    common: Flat[Common] = field(default_factory=Common)

    shown = staticmethod(terminal.match)

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from ..simulation.reducing import match

        with terminal.progress(quiet=self.common.quiet) as tell:
            return match(**given(self), progress=tell).document()


@dataclass(frozen=True)
class TransferCommand:
    """Carry E, nu and rho, or a motion, over to Gaussian splats, points or a density grid.

    Examples: autophyx-tet transfer chair.msh chair_splats.ply -o chair_physics.ply;
    autophyx-tet transfer chair.msh chair_splats.ply --motion drop.pvd -o frames
    """

    source: tyro.conf.Positional[Annotated[Path, tyro.conf.arg(metavar="SOURCE")]]
    """Field (.npz), mesh with E, nu and rho (.msh, .vtu, .vtk), or points that have them."""
    target: tyro.conf.Positional[Annotated[Path, tyro.conf.arg(metavar="TARGET")]]
    """Carrier to write again: ply, splat, spz, ksplat, pcd, las, xyz, npz, nvdb ..."""
    output: Output
    """File to write, every property of TARGET kept; STEM.npz beside it where it has no room."""
    motion: Path | None = None
    """Motion of the mesh SOURCE (.pvd): TARGET moves with it, a file a frame in the folder -o."""
    options: Annotated[Flat[TransferOptions], tyro.conf.arg(name="field")] = field(
        default_factory=TransferOptions
    )
    common: Flat[Common] = field(default_factory=Common)

    @property
    def shown(self) -> Callable[[terminal.Document], terminal.Shown]:
        """What a terminal shows of the document."""
        return terminal.driven if self.motion else terminal.transfer

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from ..driving import transfer_motion
        from ..transfer import transfer

        if self.motion is not None:
            return transfer_motion(**given(self, "options"), scale=self.options.scale).document()
        return transfer(**given(self, "motion")).document()


@dataclass(frozen=True)
class ExportCommand:
    """Write a mesh with E, nu and rho as the files of another program.

    Example: autophyx-tet export chair.msh --for calculix -o chair.inp
    """

    mesh: tyro.conf.Positional[Annotated[Path, tyro.conf.arg(metavar="MESH")]]
    """Mesh with E, nu and rho, made by `assign`."""
    target: Annotated[str, choice(PROGRAMS), tyro.conf.arg(name="for")]
    """Program that shall read it."""
    output: Output
    """Main file to write; without a suffix it is a stem."""
    options: Annotated[Flat[ExportOptions], tyro.conf.arg(name="program")] = field(
        default_factory=ExportOptions
    )
    common: Flat[Common] = field(default_factory=Common)

    shown = staticmethod(terminal.export)

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from ..transfer import export

        return export(**given(self)).document()


@dataclass(frozen=True)
class BatchCommand:
    """Run every row of a manifest in a process of its own; the same again continues.

    The manifest is a CSV file with the columns asset (a path, relative to the manifest) and text;
    also id, and any option of `run` (size, units, up, scenario ...), an empty cell for its default.

    A folder stands for all assets in it.

    Example: autophyx-tet batch chairs.csv -o out/chairs --workers 4 --time-limit 600
    """

    manifest: tyro.conf.Positional[Annotated[Path, tyro.conf.arg(metavar="MANIFEST")]]
    """CSV file, one asset a row; or a folder of assets."""
    output: Output
    """Folder for a folder a row, results.csv, results.json and index.html."""
    run_config: Path | None = None
    """TOML file of options of `run` for all rows, as `run --print-config` prints it."""
    options: Annotated[Flat[BatchOptions], tyro.conf.arg(name="engine")] = field(
        default_factory=BatchOptions
    )
    common: Flat[Common] = field(default_factory=Common)

    shown = staticmethod(terminal.batch)

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from ..batch import batch

        with terminal.counted(quiet=self.common.quiet) as tell:
            return batch(**given(self), progress=tell).document()


@dataclass(frozen=True)
class SegmentCommand:
    """Cut a thing in one piece into regions of like look and shell, as parts with names.

    Example: autophyx-tet segment scan.glb -o parts.glb
    """

    asset: tyro.conf.Positional[Annotated[Path, tyro.conf.arg(metavar="ASSET")]]
    """Surface (obj, ply, stl, glb ...), Gaussian splats, point cloud or density grid."""
    output: Output
    """File to write: .glb with a part a region, which `convert` and `run` take."""
    size: float | None = None
    """Longest side of the asset's bounding box [m]."""
    units: Unit | None = None
    """Unit of the file's numbers; what states none is taken as metres, with a warning."""
    up: UpAxis | None = None
    """Axis that points up, COLMAP's is -y; by default the format's (glTF and OBJ: y, others: z)."""
    common: Flat[Common] = field(default_factory=Common)

    shown = staticmethod(terminal.segmented)

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from ..segment import segment

        return segment(**given(self)).document()


@dataclass(frozen=True)
class FeaturesCommand:
    """See an asset from all sides and lift what an encoder sees onto its voxels.

    Example: autophyx-tet features chair.glb -o chair.npz
    """

    asset: tyro.conf.Positional[Annotated[Path, tyro.conf.arg(metavar="ASSET")]]
    """Surface (obj, glb ...), Gaussian splats, point cloud or density grid to look at."""
    output: Output
    """File to write: .npz with cells, values, part and grid."""
    options: Annotated[Flat[FeatureOptions], tyro.conf.arg(name="looking")] = field(
        default_factory=FeatureOptions
    )
    common: Flat[Common] = field(default_factory=Common)

    shown = staticmethod(terminal.features)

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from ..features import features

        return features(**given(self)).document()


@dataclass(frozen=True)
class MaterialsCommand:
    """List the material table, or the rows that match a query.

    Examples: autophyx-tet materials oak; autophyx-tet materials 304 --json; autophyx-tet materials
    coffee --contents
    """

    query: tyro.conf.Positional[Annotated[str, tyro.conf.arg(metavar="QUERY")]] = ""
    """Words to look for in names, aliases and categories."""
    contents: bool = False
    """List what fills things (water, coffee, books) instead of what they are made of."""
    common: Flat[Common] = field(default_factory=Common)

    shown = staticmethod(terminal.materials)

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from ..listing import materials

        return materials(**given(self))


@dataclass(frozen=True)
class InfoCommand:
    """Say what a mesh file holds: size, regions, volume, mass, quality.

    Example: autophyx-tet info chair.msh
    """

    file: tyro.conf.Positional[Annotated[Path, tyro.conf.arg(metavar="FILE")]]
    """Mesh to look at: .msh, .vtu or .vtk."""
    common: Flat[Common] = field(default_factory=Common)

    shown = staticmethod(terminal.info)

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from ..listing import info

        return info(self.file)


@dataclass(frozen=True)
class DoctorCommand:
    """Say what is installed and what is missing: versions, extras, devices, weights, caches.

    Example: autophyx-tet doctor --json
    """

    common: Flat[Common] = field(default_factory=Common)

    shown = staticmethod(terminal.doctor)

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from ..listing import doctor

        return doctor()


@dataclass(frozen=True)
class ViewCommand:
    """Turn a mesh or a motion in a window: what `run` and `simulate` left (extra: view).

    Example: autophyx-tet view out/bonsai
    """

    result: tyro.conf.Positional[Annotated[Path, tyro.conf.arg(metavar="OUT")]]
    """Folder of `run`, or a .pvd, .vtu, .vtk or .msh file."""
    colour: str | None = None
    """Array to colour by: E, nu, rho, von_mises, displacement; by default the last one there is."""
    picture: Path | None = None
    """Write this .png instead of opening a window."""
    common: Flat[Common] = field(default_factory=Common)

    shown = staticmethod(terminal.nothing)

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from ..report.html import show_in_window

        show_in_window(self.result, colour=self.colour, picture=self.picture)
        return {"files": [] if self.picture is None else [self.picture], "warnings": []}
