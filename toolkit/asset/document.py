"""JSON documents: what `--json` prints, the sidecar of a mesh, the record of a run."""

from __future__ import annotations

import dataclasses
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, get_args

import numpy as np

from ...converters.files import writing
from ...fem.errors import InputError
from ...fem.mesh import TetMesh
from ...fem.table import MaterialValue
from ...fem.uncertainty import Draws, Exact
from ...predictors.asset import Asset, UpAxis
from ...predictors.grid import PartVoxels
from ...predictors.prediction import GUESS

SCHEMA = 1
_VERSIONED = ("autophyx-tet", "numpy", "scipy", "trimesh", "pytetwild", "libigl", "warp-lang")


def plain(value: Any) -> Any:
    """Turn dataclasses, numpy values and paths into what JSON knows; not-a-number becomes null."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        value = dict(zip(value._fields, value, strict=True))
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    if isinstance(value, str | int | float) or value is None:
        return value
    return str(value)


def mesh_document(mesh: TetMesh) -> dict[str, Any]:
    """Size, volume [m^3], mass [kg] and regions of a mesh."""
    return {
        "points": len(mesh.points),
        "tets": len(mesh.tets),
        "volume": mesh.volume,
        "mass": mesh.mass if mesh.material else None,
        "bounds": mesh.bounds,
        "regions": [
            {"name": name, "volume": volume, "tets": int((mesh.region == i).sum())}
            for i, (name, volume) in enumerate(
                zip(mesh.region_names, mesh.region_volumes(), strict=True)
            )
        ],
    }


def dumps(document: Any) -> str:
    """Serialise to one JSON document with two spaces of indent."""
    return json.dumps(plain(document), indent=2, ensure_ascii=False, allow_nan=False)


def write_json(path: Path, document: Any) -> None:
    """Write a document so that a reader sees all of it or none."""
    with writing(path) as temporary:
        temporary.write_text(dumps(document) + "\n", encoding="utf-8")


def now() -> str:
    """Date and time of this moment, with its zone."""
    return datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %Z")


def versions() -> dict[str, str]:
    """Versions of this package and of the libraries that shape its results."""
    found = {}
    for name in _VERSIONED:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


# The sidecar of a mesh, ``chair.msh.json``: what the mesh format has no room for.

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

        Raises InputError: Where the file is there but is not a sidecar.
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


def read_tets(path: Path) -> TetMesh:
    """Read a file that holds a mesh of tets; InputError that says what to do with an asset."""
    from ...converters.mesh.meshdata import read_mesh
    from ...converters.registry import MESH_FORMATS
    from .formats import ASSET_FORMATS

    suffix = path.suffix.lower()
    if suffix in ASSET_FORMATS and suffix not in MESH_FORMATS:
        raise InputError(
            f"{path} is an asset, wanted a mesh of tets: `autophyx-tet run` takes the asset "
            "and does it all, `autophyx-tet convert` makes the mesh"
        )
    return read_mesh(path)


def read_known(mesh: str | Path | TetMesh, asset: str | Path | Asset | None):
    """Return the mesh, what is known of its regions, the asset, and what the user should know."""
    found = None
    if not isinstance(mesh, TetMesh):
        path = Path(mesh)
        mesh, found = read_tets(path), Sidecar.read(path)
    if asset is not None:
        asset = asset if isinstance(asset, Asset) else load_again(asset, found)
        found = replace(Sidecar.of_asset(asset), record=found.record if found else {})
    if found is None:
        guess = "no asset and no sidecar: regions have only their names, up is z"
        return mesh, Sidecar(up="z"), None, [guess]
    lost = [name for name in mesh.region_names if name not in found.labels]
    warnings = [f"regions {lost} are not parts of the asset: they have only their names"]
    return mesh, found, asset, warnings if lost else []


# What is known of a body beside its tets: how its mesh was made, and of what its parts are.


@dataclass(frozen=True, kw_only=True)
class BodyRecord:
    """What ``convert`` and ``assign`` found, for those that solve the body.

    materials, classes: Row of the material table, and class of matter, of every part.
    draws: Matters that a predictor drew of parts.
    exact: Which of E, nu and rho of parts were stated in numbers.
    differences: What the mesh has otherwise than its file.
    size_stated: Whether the user gave the size or the unit of the file.
    guesses: Parts whose material is a guess.
    particles: Whether it is cubes, since no mesh of its surface was to be had.
    """

    materials: Mapping[str, str] = field(default_factory=dict)
    classes: Mapping[str, str] = field(default_factory=dict)
    draws: Draws = field(default_factory=dict)
    exact: Exact = field(default_factory=dict)
    differences: tuple[str, ...] = ()
    size_stated: bool = False
    guesses: tuple[str, ...] = ()
    particles: bool = False

    @classmethod
    def of(cls, sidecar: Sidecar | None) -> BodyRecord:
        """Return what is on record beside a mesh; nothing of what was not written down."""
        if sidecar is None:
            return cls()
        parts: list[dict[str, Any]] = sidecar.record.get("assign", {}).get("parts", [])
        draws = {
            part["name"]: tuple(MaterialValue(**one) for one in part["draws"])
            for part in parts
            if part.get("draws")
        }
        report = sidecar.record.get("convert", {}).get("report", {})
        return cls(
            materials={part["name"]: part["material"] for part in parts},
            classes={part["name"]: part["class"] for part in parts if part.get("class")},
            draws=draws,
            exact={part["name"]: tuple(part["exact"]) for part in parts if part.get("exact")},
            differences=tuple(report.get("differences", ())),
            size_stated=sidecar.source.get("size_stated", False),
            guesses=tuple(part["name"] for part in parts if is_guess(part)),
            particles=report.get("mesher") == "particles",
        )

    def of_other_materials(self, materials: Mapping[str, str]) -> BodyRecord:
        """Return the record with other rows: what was found of the parts' own goes."""
        kept = {name: getattr(self, name) for name in ("differences", "size_stated", "particles")}
        return BodyRecord(materials=materials, **kept)


def is_guess(part: Mapping[str, Any]) -> bool:
    """Whether the material of a row of ``part_rows`` is a guess.

    That is where nothing near is known of it, or no clause of the text speaks of it.
    """
    binding = plain(part.get("binding"))
    unsaid = binding is not None and binding["clause"] is None
    sure = part.get("understood", True) and part.get("weight", 1.0) >= GUESS
    return part.get("guessed", False) or not sure or unsaid


# Outputs of the verbs: checked before the work starts, written whole after it is done.

# What tells our documents from those of others.
SIDECAR = frozenset({"schema", "up", "labels", "source", "record"})
RUN = frozenset({"schema", "files", "cases"})
BATCH = frozenset({"schema", "files", "rows"})


def check_file(path: Path, suffixes: tuple[str, ...]) -> None:
    """Refuse an output that could not be written at the end: unknown suffix, no such folder.

    Raises InputError: With the suffixes that are known, or the folder that is missing or not
        writable.
    """
    if path.suffix.lower() not in suffixes:
        raise InputError(
            f"output {path}: unknown suffix {path.suffix!r}, wanted {', '.join(suffixes)}"
        )
    folder = path.parent
    if path.is_dir() or not folder.is_dir():
        what = "is a folder" if path.is_dir() else f"the folder {folder} does not exist"
        raise InputError(f"cannot write {path}: {what}; give a file in an existing folder")
    _check_writable(folder)


def check_folder(folder: Path) -> None:
    """Refuse an output folder that is a file or cannot be made or written."""
    existing = folder
    while not existing.exists():
        existing = existing.parent
    if not existing.is_dir():
        raise InputError(f"cannot write into {folder}: {existing} is a file; give another -o")
    _check_writable(existing)


def check_mesh(path: Path) -> None:
    """Refuse a mesh file that could not be written, or whose sidecar would replace a foreign file.

    Raises InputError: As ``check_file`` and ``check_document``.
    """
    check_file(path, mesh_suffixes())
    check_document(Sidecar.path(path), SIDECAR)


def check_outputs(mesh: Path | None, field: Path | None) -> None:
    """Refuse a mesh as ``check_mesh`` does, and a field that is no .npz; None is not written."""
    if mesh is not None:
        check_mesh(mesh)
    if field is not None:
        check_file(field, (".npz",))


def check_run(folder: Path) -> None:
    """Refuse a folder of a run that could not be written, or where documents are not of a run."""
    check_folder(folder)
    check_document(Sidecar.path(folder / "mesh.msh"), SIDECAR)
    check_document(folder / "run.json", RUN)


def check_document(path: Path, keys: frozenset[str]) -> None:
    """Refuse to replace a JSON file that has not all ``keys``: somebody else's.

    Raises InputError: With the file and the way out.
    """
    if not path.exists():
        return
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        found = None
    if not isinstance(found, dict) or not keys <= found.keys():
        raise InputError(
            f"{path} is not ours and would be overwritten: move it away, or give another -o"
        )


def _check_writable(folder: Path) -> None:
    if not os.access(folder, os.W_OK | os.X_OK):
        raise InputError(f"cannot write into {folder}: no permission; give another -o")


def mesh_suffixes() -> tuple[str, ...]:
    """Suffixes of the mesh formats that can be written."""
    from ...converters.registry import MESH_FORMATS, written

    return written(MESH_FORMATS)
