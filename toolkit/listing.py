"""Commands that only look: the material table, a mesh file, what is installed, and dry runs."""

from __future__ import annotations

import os
import platform
import re
import shutil
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..fem.device import start_warp
from ..fem.solve.method import SCENARIOS
from ..fem.table import (
    load_colours,
    load_contents,
    load_flows,
    load_grains,
    load_strengths,
    load_table,
)
from ..predictors.asset import Asset
from .asset.document import check_mesh, check_run, mesh_document, read_tets
from .meshing import PARTICLES, STUFFING, chosen_mesher
from .options import ConvertOptions, SimulateOptions

PACKAGE = "autophyx-tet"
# Programs that exports are made for, or that the tests marked `external` and `browser` call.
PROGRAMS = ("gmsh", "ccx", "chromium")
OF_DEVELOPERS = ("dev", "docs", "external")  # extras that no user misses
_REQUIREMENT = re.compile(
    r"(?P<name>[\w.-]+)(?P<extras>\[[^\]]*\])?(?P<range>[^;]*);?(?P<marker>.*)"
)
_EXTRA = re.compile(r"extra\s*==\s*[\"']([\w-]+)[\"']")


def materials(query: str = "", *, contents: bool = False) -> dict[str, Any]:
    """Rows of the material table that match a query.

    Parameters
    ----------
    query
        Words to look for in names, aliases and categories; all rows without one.
    contents
        Whether what fills things (water, books) is asked for, not what they are made of.

    Returns
    -------
    dict
        ``materials``: rows with lowest and highest E [Pa], nu [1], rho [kg/m^3], and their source.

    Raises
    ------
    UsageError
        Where nothing matches, with the nearest words.

    Examples
    --------
    >>> import autophyx_tet as apx
    >>> oak = apx.materials("oak")["materials"][0]
    >>> oak["category"], oak["rho"][0] < oak["rho"][1] < 1000  # kg/m^3: it swims
    ('wood', True)
    """
    table = load_contents() if contents else load_table()
    rows = table.search(query) if query else list(table.rows)
    if not rows:
        table.exact(query)  # knows what was meant, and refuses
    own = ("name", "category", "E", "nu", "rho", "aliases", "source", "note", "estimated", "grade")
    beside = {
        "strength": load_strengths(),
        "flow": load_flows(),
        "grain": load_grains(),
        "colour": load_colours(),
    }
    found = [
        {name: getattr(row, name) for name in own}
        | {name: known.get(row.name) for name, known in beside.items()}
        for row in rows
    ]
    return {"query": query, "materials": found}


def info(file: str | Path) -> dict[str, Any]:
    """Size, regions with lowest and highest E, nu, rho, volume, mass and quality of a mesh file.

    Parameters
    ----------
    file
        Mesh to look at: .msh, .vtu or .vtk.

    Returns
    -------
    dict
        ``volume`` [m^3], ``mass`` [kg], ``bounds`` [m], ``regions`` and ``quality``.

    Raises
    ------
    InputError
        Where the file cannot be read.

    Examples
    --------
    >>> import autophyx_tet as apx
    >>> from autophyx_tet.converters import write_mesh
    >>> from autophyx_tet.fem import box_mesh
    >>> kept = write_mesh("box.msh", box_mesh((0.2, 0.1, 0.1), (1, 1, 1)))
    >>> round(apx.info("box.msh")["volume"], 9)  # m^3
    0.002
    """
    from .meshing.quality import quality

    mesh = read_tets(Path(file))
    document = mesh_document(mesh)
    if mesh.material is not None:
        for number, row in enumerate(document["regions"]):
            for name in ("E", "nu", "rho"):  # lowest and highest, of no tets nothing
                values = getattr(mesh.material, name)[mesh.region == number]
                row[name] = (float(values.min()), float(values.max())) if len(values) else None
    return {"file": Path(file), **document, "quality": quality(mesh)}


def doctor() -> dict[str, Any]:
    """Versions, extras, devices, weights, programs and caches of this machine.

    Returns
    -------
    dict
        ``memory`` [bytes], ``cores``, ``libraries``, ``extras``, ``devices``, ``programs``,
        ``weights`` and ``caches`` with their sizes [bytes].
    """
    from platformdirs import user_cache_path

    from .. import predictors

    # Installed version of every requirement, by extra; the empty name is what is always needed
    extras: dict[str, dict[str, str | None]] = {"": {}}
    for line in requires(PACKAGE) or ():
        part = _REQUIREMENT.match(line)
        if part is None or part["name"].lower() == PACKAGE:
            continue
        extra = _EXTRA.search(part["marker"])
        name = extra[1] if extra else ""
        if name not in OF_DEVELOPERS:
            extras.setdefault(name, {})[part["name"]] = _version(part["name"])
    libraries = extras.pop("")
    missing = [name for name, found in libraries.items() if found is None]
    devices = []
    if "warp-lang" not in missing:
        devices = [
            {"name": str(one), "what": one.name, "memory": getattr(one, "total_memory", None)}
            for one in start_warp().get_devices()
        ]
    home = user_cache_path(PACKAGE)
    folders = {path.name: path for path in sorted(home.glob("*")) if path.is_dir()}
    folders["kernels"] = Path(os.environ.get("WARP_CACHE_PATH") or user_cache_path("warp"))
    caches = []
    for name, folder in folders.items():
        sizes = [path.stat().st_size for path in folder.rglob("*") if path.is_file()]
        caches.append({"name": name, "path": folder, "files": len(sizes), "bytes": sum(sizes)})
    weights = sorted((Path(predictors.__file__).parent / "weights").glob("*.safetensors"))
    return {
        "package": _version(PACKAGE),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "cores": len(os.sched_getaffinity(0)),
        "memory": os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"),
        "libraries": libraries,
        "extras": extras,
        "devices": devices,
        "weights": [{"name": path.name, "bytes": path.stat().st_size} for path in weights],
        "programs": {name: shutil.which(name) for name in PROGRAMS},
        "caches": caches,
        "warnings": [f"{name} is missing: pip install {name}" for name in missing],
    }


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


# A dry run: what a command would do and cost. The numbers are power laws fitted to 104 real
# surfaces that were converted with the default options; four in five lie within the given range.


class PowerLaw(NamedTuple):
    """``factor * (area / edge^2)^area * faces^faces``, and its 10 and 90 % quantiles as ratios."""

    factor: float
    area: float
    faces: float
    low: float
    high: float

    def at(self, area: float, faces: int) -> dict[str, float]:
        """Estimate with its range, to two digits."""
        value = self.factor * area**self.area * faces**self.faces
        ratios = {"low": self.low, "likely": 1.0, "high": self.high}
        return {name: float(f"{ratio * value:.2g}") for name, ratio in ratios.items()}


TETS = PowerLaw(factor=12.6, area=0.825, faces=0.153, low=0.51, high=1.65)
CONVERT_SECONDS = PowerLaw(factor=0.0477, area=0.468, faces=0.311, low=0.46, high=2.43)
# Tets of a lattice by those wanted, and seconds of a core for start, tet and triangle, with their
# range: thin parts get more tets, for their volume is matched.
LATTICE_RATIOS = {"low": 0.85, "likely": 1.2, "high": 2.0}
LATTICE_SECONDS, LATTICE_TET_SECONDS, LATTICE_FACE_SECONDS = 2.5, 4e-5, 5e-5
LATTICE_SPREAD = {"low": 0.5, "likely": 1.0, "high": 2.5}
# Of a core, for materials, sag, pictures and report of one sentence: start, and for each tet.
SENTENCE_SECONDS, TET_SECONDS = 4.0, 1e-3
# Of our process, which holds the solver and the report; the engine's own child takes .13 to .4 GB.
BASE_MEMORY, TET_MEMORY = 5e8, 8e3  # bytes


def plan(
    path: Path,
    options: ConvertOptions,
    *,
    output: Path,
    texts: Sequence[str] = (),
    simulate: SimulateOptions | None = None,
) -> dict[str, Any]:
    """What `convert`, or with ``texts`` `run`, would do: steps, size [m], tets, seconds, bytes.

    Raises InputError: Where the asset cannot be read or the output not be written, as the command
        itself would.
    """
    from .asset.load import load_asset
    from .meshing.convert import SUFFIXES, import_tets

    if texts:
        check_run(output)
    else:
        check_mesh(output)
    scale = {"size": options.size, "units": options.units, "up": options.up}
    if path.suffix.lower() in SUFFIXES:
        asset, mesh, _ = import_tets(path, **scale)
        tets: dict[str, float] = dict.fromkeys(TETS.at(1.0, 1), float(len(mesh.tets)))
        seconds = dict.fromkeys(tets, 0.0)
        steps = [f"take over the {len(mesh.tets):,} tets of {path}"]
    else:
        asset = load_asset(path, **options.loading())
        tets, seconds = _cost(asset, options)
        steps = [f"fill {len(asset.parts)} parts of {path} with tets"]
    scenario = simulate.scenario if simulate else ""
    for text in texts:
        steps.append(
            f"give every tet E, nu and rho from {text!r}" if text else "guess the materials"
        )
        steps.append(f"simulate: {scenario}")
    steps.append(f"write {'the folder ' if texts else ''}{output}")
    memory = {name: BASE_MEMORY + TET_MEMORY * count for name, count in tets.items()}
    if scenario and SCENARIOS[scenario].method != "statics":
        # how long a motion or its Newton steps take is not known
        estimates = {"tets": tets, "convert_cpu_seconds": seconds, "memory": memory}
    else:
        total = {
            name: round(seconds[name] + len(texts) * (SENTENCE_SECONDS + TET_SECONDS * count), 1)
            for name, count in tets.items()
        }
        estimates = {"tets": tets, "cpu_seconds": total, "memory": memory}
    return {
        "dry_run": True,
        "steps": steps,
        "part_names": [part.name for part in asset.parts],
        "faces": _faces(asset),
        "bounds": asset.bounds,
        "up": asset.up,
        "estimates": estimates,
        "warnings": list(asset.warnings),
    }


def _cost(asset: Asset, options: ConvertOptions) -> tuple[dict[str, float], dict[str, float]]:
    """Tets and seconds of a core that converting takes."""
    from .meshing.ftetwild import EDGE_LENGTH_REL, TETS_PER_CUBE, EngineTarget

    diagonal, faces = float(np.linalg.norm(asset.size)), _faces(asset)
    if chosen_mesher(options.mesher, sampled=asset.sampled) in (STUFFING, PARTICLES):
        # tets of a lattice fill the volume, or are as many as wanted
        rel = options.edge_length / diagonal if options.edge_length else options.edge_length_rel
        epsilon, most = options.epsilon_rel, options.max_tets
        target = EngineTarget.of(diagonal, rel, epsilon, max_tets=most)
        count = float(target.tets)
        if rel is not None:
            volume = sum(abs(float(part.mesh.volume)) for part in asset.parts)
            count = max(TETS_PER_CUBE * volume / target.edge_length**3, 1.0)
        total = LATTICE_SECONDS + LATTICE_TET_SECONDS * count + LATTICE_FACE_SECONDS * faces
        return (
            {name: float(f"{ratio * count:.2g}") for name, ratio in LATTICE_RATIOS.items()},
            {name: round(ratio * total, 1) for name, ratio in LATTICE_SPREAD.items()},
        )
    edge = options.edge_length or (options.edge_length_rel or EDGE_LENGTH_REL) * diagonal
    area = sum(float(part.mesh.area) for part in asset.parts) / edge**2
    tets = TETS.at(area, faces)
    if options.max_tets:
        tets = {name: min(count, options.max_tets) for name, count in tets.items()}
    return tets, CONVERT_SECONDS.at(area, faces)


def _faces(asset: Asset) -> int:
    return sum(len(part.mesh.faces) for part in asset.parts)
