"""Commands that only look: the material table and what a mesh file holds."""

from __future__ import annotations

import os
import platform
import re
import shutil
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .asset.document import mesh_document

if TYPE_CHECKING:
    from ..fem.table import Material


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
    from ..fem.table import load_contents, load_table

    table = load_contents() if contents else load_table()
    rows = table.search(query) if query else list(table.rows)
    if not rows:
        table.exact(query)  # knows what was meant, and refuses
    return {"query": query, "materials": [_row(row) for row in rows]}


def _row(row: Material) -> dict[str, Any]:
    """All that is known of a material; what is not known is null."""
    from ..fem.table import load_colours, load_flows, load_grains, load_strengths

    return {
        "name": row.name,
        "category": row.category,
        "E": row.E,
        "nu": row.nu,
        "rho": row.rho,
        "aliases": row.aliases,
        "source": row.source,
        "note": row.note,
        "estimated": row.estimated,
        "grade": row.grade,
        "strength": load_strengths().get(row.name),
        "flow": load_flows().get(row.name),
        "grain": load_grains().get(row.name),
        "colour": load_colours().get(row.name),
    }


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
    from ..converters.mesh.meshdata import read_mesh
    from .meshing.quality import quality

    mesh = read_mesh(file)
    document = mesh_document(mesh)
    if mesh.material is not None:
        for number, row in enumerate(document["regions"]):
            mine = mesh.region == number
            row |= {name: _ends(getattr(mesh.material, name)[mine]) for name in ("E", "nu", "rho")}
    return {"file": Path(file), **document, "quality": quality(mesh)}


def _ends(values: np.ndarray) -> tuple[float, float] | None:
    """Lowest and highest, of no tets nothing."""
    return (float(values.min()), float(values.max())) if len(values) else None


# What is installed here and what is missing: the first thing to look at when something fails.

PACKAGE = "autophyx-tet"
# Programs that exports are made for, or that the tests marked `external` and `browser` call.
PROGRAMS = ("gmsh", "ccx", "chromium")
OF_DEVELOPERS = ("dev", "docs", "external")  # extras that no user misses
_REQUIREMENT = re.compile(
    r"(?P<name>[\w.-]+)(?P<extras>\[[^\]]*\])?(?P<range>[^;]*);?(?P<marker>.*)"
)
_EXTRA = re.compile(r"extra\s*==\s*[\"']([\w-]+)[\"']")


def doctor() -> dict[str, Any]:
    """Versions, extras, devices, weights, programs and caches of this machine.

    Returns
    -------
    dict
        ``memory`` [bytes], ``cores``, ``libraries``, ``extras``, ``devices``, ``programs``,
        ``weights`` and ``caches`` with their sizes [bytes].
    """
    needed = _requirements()
    libraries = needed.pop("")
    missing = [name for name, found in libraries.items() if found is None]
    from .. import predictors

    folder = Path(predictors.__file__).parent / "weights"
    # Place, files and size [bytes] of everything remembered between calls
    from platformdirs import user_cache_path

    home = user_cache_path(PACKAGE)
    kernels = os.environ.get("WARP_CACHE_PATH") or user_cache_path("warp")
    folders = {path.name: path for path in sorted(home.glob("*")) if path.is_dir()}
    return {
        "package": _version(PACKAGE),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "cores": len(os.sched_getaffinity(0)),
        "memory": os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"),
        "libraries": libraries,
        "extras": needed,
        "devices": [] if "warp-lang" in missing else _devices(),
        "weights": [
            {"name": path.name, "bytes": path.stat().st_size}
            for path in sorted(folder.glob("*.safetensors"))
        ],
        "programs": {name: shutil.which(name) for name in PROGRAMS},
        "caches": [
            {"name": name, "path": path, **_size(path)}
            for name, path in {**folders, "kernels": Path(kernels)}.items()
        ],
        "warnings": [f"{name} is missing: pip install {name}" for name in missing],
    }


def _requirements() -> dict[str, dict[str, str | None]]:
    """Installed version of every requirement, by extra; the empty name is what is always needed."""
    found: dict[str, dict[str, str | None]] = {"": {}}
    for line in requires(PACKAGE) or ():
        part = _REQUIREMENT.match(line)
        if part is None or part["name"].lower() == PACKAGE:
            continue
        extra = _EXTRA.search(part["marker"])
        name = extra[1] if extra else ""
        if name not in OF_DEVELOPERS:
            found.setdefault(name, {})[part["name"]] = _version(part["name"])
    return found


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _devices() -> list[dict[str, Any]]:
    """Devices that a solver can use, as Warp sees them."""
    from ..fem.device import start_warp

    return [
        {"name": str(device), "what": device.name, "memory": getattr(device, "total_memory", None)}
        for device in start_warp().get_devices()
    ]


def _size(folder: Path) -> dict[str, int]:
    sizes = [path.stat().st_size for path in folder.rglob("*") if path.is_file()]
    return {"files": len(sizes), "bytes": sum(sizes)}
