"""Commands that only look: the material table, a mesh file, and what is installed here."""

from __future__ import annotations

import os
import platform
import re
import shutil
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path
from typing import Any

from .asset.document import mesh_document

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
    from ..fem.table import (
        load_colours,
        load_contents,
        load_flows,
        load_grains,
        load_strengths,
        load_table,
    )

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
    from ..converters.mesh.meshdata import read_mesh
    from .meshing.quality import quality

    mesh = read_mesh(file)
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
        from ..fem.device import start_warp

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
