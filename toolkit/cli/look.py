"""Commands that only look: an asset from all sides, the material table, a mesh, this machine."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from ..options import Common, FeatureOptions, Flat, Output


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

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from ..features import features

        return features(self.asset, output=self.output, options=self.options).document()


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

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from ..listing import materials

        return materials(self.query, contents=self.contents)


@dataclass(frozen=True)
class InfoCommand:
    """Say what a mesh file holds: size, regions, volume, mass, quality.

    Example: autophyx-tet info chair.msh
    """

    file: tyro.conf.Positional[Annotated[Path, tyro.conf.arg(metavar="FILE")]]
    """Mesh to look at: .msh, .vtu or .vtk."""
    common: Flat[Common] = field(default_factory=Common)

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

    def __call__(self) -> dict[str, Any]:
        """Run the command and return its document."""
        from ..doctor import doctor

        return doctor()


COMMANDS = {
    "features": FeaturesCommand,
    "materials": MaterialsCommand,
    "info": InfoCommand,
    "doctor": DoctorCommand,
}
