"""The command line: parses, calls the pipeline, prints; loads nothing heavy before that."""

from __future__ import annotations

import logging
import sys
import traceback
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any

import tyro

from ..fem.errors import AutophyxError, UsageError
from .cli_batch import Batch
from .cli_learning import COMMANDS as LEARNING
from .cli_look import Doctor, Info, Materials
from .config import config_text, with_config
from .options import (
    AssignOptions,
    Common,
    ConvertOptions,
    ExportOptions,
    FeatureOptions,
    Flat,
    Output,
    Repeated,
    SimulateOptions,
    Target,
    TransferOptions,
    UpAxis,
)

EXIT_BUG = 1
EXIT_INTERRUPTED = 130


@dataclass(frozen=True)
class Convert:
    """Make a watertight tetrahedral mesh of an asset, one region per part.

    Example: autophyx-tet convert chair.glb -o chair.msh --size 0.9
    """

    asset: tyro.conf.Positional[Path]
    """Surface (obj, ply, stl, glb ...), Gaussian splats, point cloud or density grid."""
    output: Output
    """Mesh to write: .msh, .vtu or .vtk."""
    dry_run: bool = False
    """Say what would be done and estimate tets, time and memory; write nothing."""
    options: Flat[ConvertOptions] = field(default_factory=ConvertOptions)
    common: Flat[Common] = field(default_factory=Common)

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from .pipeline import convert
        from .progress import progress

        if self.dry_run:
            from .estimate import plan

            return plan(self.asset, self.options, output=self.output)
        with progress(quiet=self.common.quiet) as tell:
            return convert(
                self.asset, output=self.output, options=self.options, progress=tell
            ).document()


@dataclass(frozen=True)
class Assign:
    """Give every tet E, nu and rho from a sentence.

    Example: autophyx-tet assign chair.msh --text "the legs are oak, the seat is soft foam" -o m.msh
    """

    mesh: tyro.conf.Positional[Path]
    """Mesh made by `convert`: .msh, .vtu or .vtk."""
    output: Output
    """Mesh to write: .msh, .vtu or .vtk."""
    text: str = ""
    """What the object is made of, in plain words; at most 4,000 characters."""
    asset: Path | None = None
    """The asset the mesh came from: its node and material names are read again."""
    field_output: Annotated[Path | None, tyro.conf.arg(name="field")] = None
    """Also write the voxel field, as .npz."""
    options: Flat[AssignOptions] = field(default_factory=AssignOptions)
    common: Flat[Common] = field(default_factory=Common)

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from .pipeline import assign

        result = assign(
            self.mesh,
            self.text,
            asset=self.asset,
            output=self.output,
            field_output=self.field_output,
            options=self.options,
        )
        return result.document()


@dataclass(frozen=True)
class Simulate:
    """Load the mesh and solve: displacement, stress, motion, vibrations, verdicts.

    Examples: autophyx-tet simulate chair.msh --scenario sag -o sag.vtu --report sag.html;
    autophyx-tet simulate chair.msh --scenario drop -o drop.pvd
    """

    mesh: tyro.conf.Positional[Path]
    """Mesh with E, nu and rho, made by `assign`."""
    output: Output
    """Result to write: .vtu or .vtk (the last state), or .pvd (the whole motion)."""
    report: Path | None = None
    """Page to write too: .html."""
    picture: Path | None = None
    """Picture to write too: .png (the last state), .gif or .webp (the motion)."""
    up: UpAxis | None = None
    """Axis that points up; by default what the mesh's sidecar says, else z."""
    options: Flat[SimulateOptions] = field(default_factory=SimulateOptions)
    common: Flat[Common] = field(default_factory=Common)

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from .pipeline import simulate
        from .progress import progress

        with progress(quiet=self.common.quiet) as tell:
            return simulate(
                self.mesh,
                up=self.up,
                output=self.output,
                report=self.report,
                picture=self.picture,
                options=self.options,
                progress=tell,
            ).document()


@dataclass(frozen=True)
class Run:
    """Convert, assign, simulate and report, in one go.

    Example: autophyx-tet run bonsai.glb --text "the pot is ceramic, the trunk is oak" -o out/bonsai
    """

    asset: tyro.conf.Positional[Path]
    """Surface (obj, ply, stl, glb ...), Gaussian splats, point cloud or density grid."""
    output: Output
    """Folder for mesh.msh, mesh.vtu, field.npz, motion.pvd, report.html and run.json."""
    text: Annotated[tuple[str, ...], Repeated] = ()
    """What the object is made of; repeat it to compare two sentences under the same loads."""
    picture: Path | None = None
    """One more picture, outside the folder: .png, or the motion as .gif or .webp."""
    dry_run: bool = False
    """Say what would be done and estimate tets, time and memory; write nothing."""
    convert: Flat[ConvertOptions] = field(default_factory=ConvertOptions)
    assign: Flat[AssignOptions] = field(default_factory=AssignOptions)
    simulate: Flat[SimulateOptions] = field(default_factory=SimulateOptions)
    common: Flat[Common] = field(default_factory=Common)

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from .pipeline import run
        from .progress import progress

        if self.dry_run:
            from .estimate import plan

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
                assign_options=self.assign,
                simulate_options=self.simulate,
                progress=tell,
            )
        return result.document()


@dataclass(frozen=True)
class Transfer:
    """Carry E, nu and rho over to Gaussian splats, a point cloud or a NeRF density grid.

    Example: autophyx-tet transfer chair.msh chair_splats.ply -o chair_physics.ply
    """

    source: tyro.conf.Positional[Path]
    """Field (.npz), mesh with E, nu and rho (.msh, .vtu, .vtk), or points that have them."""
    target: tyro.conf.Positional[Path]
    """Carrier to write again: ply, splat, spz, ksplat, pcd, las, xyz, npz, nvdb ..."""
    output: Output
    """File to write, every property of TARGET kept; STEM.npz beside it where it has no room."""
    options: Flat[TransferOptions] = field(default_factory=TransferOptions)
    common: Flat[Common] = field(default_factory=Common)

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from .carry import transfer

        result = transfer(self.source, self.target, output=self.output, options=self.options)
        return result.document()


@dataclass(frozen=True)
class Export:
    """Write a mesh with E, nu and rho as the files of another program.

    Example: autophyx-tet export chair.msh --for calculix -o chair.inp
    """

    mesh: tyro.conf.Positional[Path]
    """Mesh with E, nu and rho, made by `assign`."""
    target: Annotated[Target, tyro.conf.arg(name="for")]
    """Program that shall read it."""
    output: Output
    """Main file to write; without a suffix it is a stem."""
    options: Flat[ExportOptions] = field(default_factory=ExportOptions)
    common: Flat[Common] = field(default_factory=Common)

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from .carry import export

        result = export(self.mesh, self.target, output=self.output, options=self.options)
        return result.document()


@dataclass(frozen=True)
class Features:
    """See an asset from all sides and lift what an encoder sees onto its voxels.

    Example: autophyx-tet features chair.glb -o chair.npz
    """

    asset: tyro.conf.Positional[Path]
    """Surface to look at: obj, ply, stl, off, glb, gltf ..."""
    output: Output
    """File to write: .npz with cells, values, part and grid."""
    options: Flat[FeatureOptions] = field(default_factory=FeatureOptions)
    common: Flat[Common] = field(default_factory=Common)

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from .features import features

        return features(self.asset, output=self.output, options=self.options).document()


COMMANDS = {
    "convert": Convert,
    "assign": Assign,
    "simulate": Simulate,
    "run": Run,
    "transfer": Transfer,
    "export": Export,
    "features": Features,
    "materials": Materials,
    "info": Info,
    "doctor": Doctor,
    "batch": Batch,
    **LEARNING,
}


DESCRIPTION = """From a 3D asset and a sentence to a simulation-ready tetrahedral mesh.

Exit codes: 0 done (a missing texture or a failed verdict is a warning); 1 a bug; 2 a wrong option,
part name or text; 3 input that cannot be read, an output that cannot be written, a missing extra;
4 no volume or no tet mesh possible; 5 E, nu or rho outside their band, under --strict; 6 a solver
did not converge; 130 interrupted.

Completion: autophyx-tet --tyro-print-completion bash|zsh|tcsh prints the shell's script."""


def main(arguments: list[str] | None = None) -> int:
    """Run one command; the exit code is 0, or the one of the error (see ``DESCRIPTION``)."""
    given = sys.argv[1:] if arguments is None else arguments
    try:
        command = _parse(given)
    except AutophyxError as error:
        _say(f"autophyx-tet: {_one_line(error)}")
        return error.exit_code
    common: Common = command.common
    if common.print_config:
        sys.stdout.write(config_text(command))
        return 0
    _configure_logging(common)
    return _call(command, common)


def _parse(given: list[str]) -> Any:
    """The command with its options; exits with 2 where tyro cannot read them."""
    verb = next(iter(given), "")
    if verb and not verb.startswith("-") and verb not in COMMANDS:
        close = get_close_matches(verb, COMMANDS, n=1)
        hint = f"did you mean {close[0]}?" if close else f"there are {', '.join(COMMANDS)}"
        raise UsageError(f"there is no command {verb!r}: {hint}")
    return tyro.extras.subcommand_cli_from_dict(
        COMMANDS, prog="autophyx-tet", description=DESCRIPTION, args=with_config(given)
    )


def _call(command: Any, common: Common) -> int:
    """Run the command, show its document, and turn errors into one line and an exit code."""
    try:
        document = command()
    except AutophyxError as error:
        _trace(common)
        _say(f"autophyx-tet: {_one_line(error)}")
        return error.exit_code
    except KeyboardInterrupt:
        _say("autophyx-tet: interrupted; nothing half-written was left")
        return EXIT_INTERRUPTED
    except MemoryError as error:
        _trace(common)
        _say(f"autophyx-tet: out of memory: {_one_line(error) or 'no more could be had'}")
        return EXIT_BUG
    except Exception as error:
        _trace(common)
        _say(
            f"autophyx-tet: a bug: {type(error).__name__}: {_one_line(error)} "
            "(run again with --traceback and report it)"
        )
        return EXIT_BUG
    _show(document, common)
    return 0


def _trace(common: Common) -> None:
    if common.traceback:
        traceback.print_exc()


def _configure_logging(common: Common) -> None:
    level = logging.INFO if common.verbose else logging.ERROR
    logging.basicConfig(level=level, format="%(name)s: %(message)s", stream=sys.stderr)


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split())


def _say(line: str) -> None:
    sys.stderr.write(line + "\n")


def _show(document: dict[str, Any], common: Common) -> None:
    from .document import SCHEMA, dumps

    if common.json:
        sys.stdout.write(dumps({"schema": SCHEMA, **document}) + "\n")
    elif not common.quiet:
        from .terminal import show

        show(document)


if __name__ == "__main__":
    sys.exit(main())
