"""Options of the commands: the single source for the CLI, for TOML and for what a result records.

Defaults are stated here and nowhere else.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal

import tyro

UpAxis = Literal["x", "y", "z"]
Unit = Literal["mm", "cm", "m", "in"]
METRES = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}

Repeated = tyro.conf.UseAppendAction


@dataclass(frozen=True)
class ConvertOptions:
    """How the asset becomes tetrahedra."""

    size: float | None = None
    """Longest side of the asset's bounding box [m]."""
    units: Unit | None = None
    """Unit of the file's numbers; glTF is metres, others are taken as metres with a warning."""
    up: UpAxis | None = None
    """Axis that points up; by default what the format says (glTF and OBJ: y, others: z)."""
    edge_length_rel: float = 0.05
    """Wanted edge of a tet, as a share of the bounding box diagonal."""
    edge_length: float | None = None
    """Wanted edge of a tet [m]; replaces --edge-length-rel."""
    epsilon_rel: float = 1e-3
    """Largest distance between the result and the input surface, as a share of the diagonal."""
    time_limit: float = 300.0
    """Seconds one attempt of the tetrahedraliser may take."""
    seed: int = 0
    """Seed of everything random of ours; the tetrahedraliser itself varies by 2-3 % in tets."""

    def engine(self) -> dict[str, Any]:
        """Return the options of the tetrahedraliser; size, units and up belong to loading."""
        names = ("edge_length_rel", "edge_length", "epsilon_rel", "time_limit", "seed")
        return {name: getattr(self, name) for name in names}


@dataclass(frozen=True)
class AssignOptions:
    """How words become materials."""

    part: Annotated[tuple[str, ...], Repeated] = ()
    """Text for one part alone, NAME="TEXT"; may be repeated."""
    material: Annotated[tuple[str, ...], Repeated] = ()
    """Exact table material of one part, NAME=MATERIAL; may be repeated."""
    alpha: float | None = None
    """Where in the material's range of E: 0 soft, 0.5 the default, 1 stiff."""
    cells: int = 64
    """Voxels along the longest side of the material field."""
    strict: bool = False
    """Fail (exit 5) where E, nu or rho leave the band of the material's category."""


@dataclass(frozen=True)
class SimulateOptions:
    """How the result is loaded and solved."""

    scenario: Literal["sag"] = "sag"
    """What happens to the body: sag = it stands under its own weight."""
    order: Literal[1, 2] | None = None
    """Order of the elements, 1 or 2; by default 2 while that has at most 150,000 unknowns."""
    supports: Literal["base", "three-point"] = "base"
    """Clamp the base, or rest on three points so that nothing is restrained but rigid motion."""
    gravity: float = 9.81
    """Acceleration of gravity [m/s^2], against the up axis."""


@dataclass(frozen=True)
class Common:
    """What every command has."""

    json: bool = False
    """Print one JSON document on stdout; everything else goes to stderr."""
    verbose: Annotated[bool, tyro.conf.arg(aliases=("-v",))] = False
    """Say more."""
    quiet: Annotated[bool, tyro.conf.arg(aliases=("-q",))] = False
    """Say only errors."""
    traceback: bool = False
    """Show the Python traceback of an error."""
