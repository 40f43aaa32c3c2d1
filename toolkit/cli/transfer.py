"""Commands that take E, nu and rho elsewhere: to other carriers, to other programs."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from ...converters.registry import PROGRAMS
from ..options import Common, ExportOptions, Flat, Output, TransferOptions, choice


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

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from ..driving import transfer_motion
        from ..transfer import transfer

        if self.motion is not None:
            return transfer_motion(
                self.source,
                self.target,
                motion=self.motion,
                output=self.output,
                scale=self.options.scale,
            ).document()
        result = transfer(self.source, self.target, output=self.output, options=self.options)
        return result.document()


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

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from ..transfer import export

        result = export(self.mesh, self.target, output=self.output, options=self.options)
        return result.document()


COMMANDS = {"transfer": TransferCommand, "export": ExportCommand}
