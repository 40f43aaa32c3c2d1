"""What is installed here and what is missing: the first thing to look at when something fails."""

from __future__ import annotations

import os
import platform
import re
import shutil
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path
from typing import Any

PACKAGE = "autophyx-tet"
# Programs that exports are made for, or that the tests marked `external` and `browser` call.
PROGRAMS = ("gmsh", "ccx", "chromium")
OF_DEVELOPERS = ("dev", "docs", "external")  # extras that no user misses
_REQUIREMENT = re.compile(
    r"(?P<name>[\w.-]+)(?P<extras>\[[^\]]*\])?(?P<range>[^;]*);?(?P<marker>.*)"
)
_EXTRA = re.compile(r"extra\s*==\s*[\"']([\w-]+)[\"']")


def doctor() -> dict[str, Any]:
    """Versions, extras, devices, weights [bytes], programs and caches [bytes] of this machine."""
    needed = _requirements()
    libraries = needed.pop("")
    missing = [name for name, found in libraries.items() if found is None]
    return {
        "package": _version(PACKAGE),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "cores": len(os.sched_getaffinity(0)),
        "memory": os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"),
        "libraries": libraries,
        "extras": needed,
        "devices": [] if "warp-lang" in missing else _devices(),
        "weights": _weights(),
        "programs": {name: shutil.which(name) for name in PROGRAMS},
        "caches": _caches(),
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


def _weights() -> list[dict[str, Any]]:
    from .. import predictors

    folder = Path(predictors.__file__).parent / "weights"
    return [
        {"name": path.name, "bytes": path.stat().st_size}
        for path in sorted(folder.glob("*.safetensors"))
    ]


def _caches() -> list[dict[str, Any]]:
    """Place, files and size [bytes] of everything remembered between calls."""
    from platformdirs import user_cache_path

    home = user_cache_path(PACKAGE)
    kernels = os.environ.get("WARP_CACHE_PATH") or user_cache_path("warp")
    folders = {path.name: path for path in sorted(home.glob("*")) if path.is_dir()}
    return [
        {"name": name, "path": path, **_size(path)}
        for name, path in {**folders, "kernels": Path(kernels)}.items()
    ]


def _size(folder: Path) -> dict[str, int]:
    sizes = [path.stat().st_size for path in folder.rglob("*") if path.is_file()]
    return {"files": len(sizes), "bytes": sum(sizes)}
