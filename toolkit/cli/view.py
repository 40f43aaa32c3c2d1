"""The command that shows a result in a window."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from ..options import Common, Flat
from ..report.window import show_in_window


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

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        show_in_window(self.result, colour=self.colour, picture=self.picture)
        return {"files": [] if self.picture is None else [self.picture], "warnings": []}


COMMANDS = {"view": ViewCommand}
