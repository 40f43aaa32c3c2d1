"""The sidecar of a mesh, ``chair.msh.json``: what the mesh format has no room for."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, get_args

from ...fem.errors import InputError
from ...fem.scene.mesh import TetMesh
from ...predictors.asset import Asset, UpAxis
from ...predictors.voxels import PartVoxels
from .document import SCHEMA, versions, write_json

UNITS = {"points": "m", "E": "Pa", "nu": "1", "rho": "kg/m^3"}


@dataclass(frozen=True)
class Sidecar:
    """Where a mesh came from and what its regions are called.

    ``labels`` maps a region to the words the asset has for it; ``source`` is the asset file, its
    SHA-256, the metres per unit that were applied, so that ``assign --asset`` can replay them, and
    whether the user stated them.
    """

    up: UpAxis
    labels: dict[str, tuple[str, ...]] = field(default_factory=dict)
    source: dict[str, Any] = field(default_factory=dict)
    record: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def of_asset(cls, asset: Asset) -> Sidecar:
        """Describe a mesh that was made of ``asset``."""
        return cls(
            up=asset.up,
            labels={part.name: part.labels for part in asset.parts},
            source={
                "name": asset.name,
                "path": asset.source,
                "sha256": asset.source_hash,
                "metres_per_unit": asset.metres_per_unit,
                "size_stated": asset.size_stated,
            },
        )

    def labels_of(self, regions: Sequence[str]) -> tuple[tuple[str, ...], ...]:
        """For each region its name, then all other words that the asset has for it."""
        return tuple((name, *self.labels.get(name, ())) for name in regions)

    def divided(self, parts: PartVoxels) -> Sidecar:
        """Return the sidecar of a mesh whose regions are the parts."""
        return replace(self, labels=dict(zip(parts.part_names, parts.labels, strict=True)))

    @staticmethod
    def path(mesh: Path) -> Path:
        """Return the sidecar's path of a mesh file."""
        return mesh.with_name(f"{mesh.name}.json")

    @classmethod
    def read(cls, mesh: Path) -> Sidecar | None:
        """Read the sidecar of a mesh file, or None where it has none.

        Raises
        ------
        InputError
            Where the file is there but is not a sidecar.
        """
        path = cls.path(mesh)
        if not path.exists():
            return None
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
            labels = {name: tuple(words) for name, words in found["labels"].items()}
            sidecar = cls(found["up"], labels, dict(found["source"]), dict(found["record"]))
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise InputError(
                f"{path} is not a sidecar of ours ({error}): move it away, or run convert again"
            ) from error
        if sidecar.up not in get_args(UpAxis):
            known = ", ".join(get_args(UpAxis))
            raise InputError(f"{path}: up is {sidecar.up!r}, wanted one of {known}")
        return sidecar

    def with_record(self, **record: Any) -> Sidecar:
        """Add the documents of further stages to the record."""
        return replace(self, record={**self.record, **record})

    def write(self, mesh: Path) -> Path:
        """Write beside a mesh file and return the sidecar's path."""
        path = self.path(mesh)
        document = {
            "schema": SCHEMA,
            "units": UNITS,
            "up": self.up,
            "labels": self.labels,
            "source": self.source,
            "record": self.record,
            "versions": versions(),
        }
        write_json(path, document)
        return path


def load_again(path: str | Path, known: Sidecar | None) -> Asset:
    """Load an asset, scaled and turned as it was for the mesh if that was made of this file."""
    from .load import load_asset

    asset = load_asset(path)
    if known is None or known.source.get("sha256") != asset.source_hash:
        return asset
    factor = known.source["metres_per_unit"] / asset.metres_per_unit
    again = load_asset(path, size=float(asset.size.max()) * factor, up=known.up)
    return replace(again, size_stated=known.source.get("size_stated", False))


def _check_no_asset(path: Path) -> None:
    from ...converters.registry import MESH_FORMATS
    from .readers.asset_formats import ASSET_FORMATS

    suffix = path.suffix.lower()
    if suffix in ASSET_FORMATS and suffix not in MESH_FORMATS:
        raise InputError(
            f"{path} is an asset, wanted a mesh of tets: `autophyx-tet run` takes the asset and "
            "does it all, `autophyx-tet convert` makes the mesh"
        )


def read_known(mesh: str | Path | TetMesh, asset: str | Path | Asset | None):
    """Return the mesh, what is known of its regions, the asset, and what the user should know."""
    from ...converters.mesh.mesh_file import read_mesh

    found = None
    if not isinstance(mesh, TetMesh):
        _check_no_asset(Path(mesh))
        mesh, found = read_mesh(mesh), Sidecar.read(Path(mesh))
    if asset is not None:
        asset = asset if isinstance(asset, Asset) else load_again(asset, found)
        found = replace(Sidecar.of_asset(asset), record=found.record if found else {})
    if found is None:
        found = Sidecar(up="z")
        return (
            mesh,
            found,
            None,
            ["no asset and no sidecar: regions have only their names, up is z"],
        )
    lost = [name for name in mesh.region_names if name not in found.labels]
    warnings = [f"regions {lost} are not parts of the asset: they have only their names"]
    return mesh, found, asset, warnings if lost else []
