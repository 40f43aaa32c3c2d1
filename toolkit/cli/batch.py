"""The command that runs many assets."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from ..batch.options import BatchOptions
from ..options import Common, Flat, Output


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

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from ..batch.batch import batch
        from .progress import counted

        with counted(quiet=self.common.quiet) as tell:
            return batch(
                self.manifest,
                output=self.output,
                options=self.options,
                run_config=self.run_config,
                progress=tell,
            ).document()


COMMANDS = {"batch": BatchCommand}
