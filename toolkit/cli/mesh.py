"""Commands that make a mesh with E, nu and rho and load it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from ..options import (
    AssignOptions,
    Common,
    ConvertOptions,
    Flat,
    Output,
    Repeated,
    SimulateOptions,
    UpAxis,
)
from ..walls.wall_options import WallOptions


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
    options: Annotated[Flat[ConvertOptions], tyro.conf.arg(name="meshing")] = field(
        default_factory=ConvertOptions
    )
    walls: Flat[WallOptions] = field(default_factory=WallOptions)
    common: Flat[Common] = field(default_factory=Common)

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from ..pipeline import convert
        from .progress import progress

        if self.dry_run:
            from ..estimate import plan

            return plan(self.asset, self.options, output=self.output)
        with progress(quiet=self.common.quiet) as tell:
            made = convert(
                self.asset,
                output=self.output,
                options=self.options,
                walls=self.walls,
                progress=tell,
            )
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
    options: Annotated[Flat[AssignOptions], tyro.conf.arg(name="materials")] = field(
        default_factory=AssignOptions
    )
    walls: Flat[WallOptions] = field(default_factory=WallOptions)
    common: Flat[Common] = field(default_factory=Common)

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from ..pipeline import assign

        result = assign(
            self.mesh,
            self.text,
            asset=self.asset,
            output=self.output,
            field_output=self.field_output,
            options=self.options,
            walls=self.walls,
        )
        return result.document()


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
    options: Annotated[Flat[SimulateOptions], tyro.conf.arg(name="solving")] = field(
        default_factory=SimulateOptions
    )
    common: Flat[Common] = field(default_factory=Common)

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from ..pipeline import simulate
        from .progress import progress

        with progress(quiet=self.common.quiet) as tell:
            return simulate(
                self.mesh,
                up=self.up,
                output=self.output,
                report=self.report,
                picture=self.picture,
                drive=self.drive,
                drive_scale=self.drive_scale,
                options=self.options,
                progress=tell,
            ).document()


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
    convert: Annotated[Flat[ConvertOptions], tyro.conf.arg(name="meshing")] = field(
        default_factory=ConvertOptions
    )
    walls: Flat[WallOptions] = field(default_factory=WallOptions)
    assign: Annotated[Flat[AssignOptions], tyro.conf.arg(name="materials")] = field(
        default_factory=AssignOptions
    )
    simulate: Annotated[Flat[SimulateOptions], tyro.conf.arg(name="solving")] = field(
        default_factory=SimulateOptions
    )
    common: Flat[Common] = field(default_factory=Common)

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from ..pipeline import run
        from .progress import progress

        if self.dry_run:
            from ..estimate import plan

            return plan(
                self.asset,
                self.convert,
                output=self.output,
                texts=self.text or ("",),
                simulate=self.simulate,
            )
        with progress(quiet=self.common.quiet) as tell:
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
    options: Annotated[Flat[SimulateOptions], tyro.conf.arg(name="solving")] = field(
        default_factory=SimulateOptions
    )
    common: Flat[Common] = field(default_factory=Common)

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from ..simulation.reducing import reduce

        known = {"up": self.up, "options": self.options, "runs": self.what_if}
        return reduce(self.mesh, output=self.output, **known).document()


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
    options: Annotated[Flat[SimulateOptions], tyro.conf.arg(name="solving")] = field(
        default_factory=SimulateOptions
    )
    common: Flat[Common] = field(default_factory=Common)

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from ..simulation.reducing import match
        from .progress import progress

        known = {"up": self.up, "options": self.options, "with_nu": self.with_nu}
        ends = {"stiff": self.to_stiff, "output": self.output}
        with progress(quiet=self.common.quiet) as tell:
            return match(self.mesh, self.to, progress=tell, **ends, **known).document()


COMMANDS = {
    "convert": ConvertCommand,
    "assign": AssignCommand,
    "simulate": SimulateCommand,
    "reduce": ReduceCommand,
    "match": MatchCommand,
    "run": RunCommand,
}
