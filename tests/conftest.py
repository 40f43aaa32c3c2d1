"""Shape and type checks on every annotated call of ours, for the whole test run."""

import os
import sys
from pathlib import Path
from types import ModuleType

import pytest
from beartype import BeartypeConf, beartype
from jaxtyping import install_import_hook

ROOT = Path(__file__).resolve().parent.parent

# Kernel modules are warp code, compiled from their own source text: not wrapped. The CLI's option
# classes are read by tyro, which resolves annotations itself.
_MODULES = [
    "autophyx_tet." + path.relative_to(ROOT).with_suffix("").as_posix().replace("/", ".")
    for room in ("fem", "predictors", "converters", "toolkit")
    for path in sorted((ROOT / room).rglob("*.py"))
    if not path.stem.startswith(("__", "kernels", "cli"))
]
# An int is a float here (PEP 484's numeric tower), as for every other type checker.
_checker = ModuleType("numeric_tower")
_checker.check = beartype(conf=BeartypeConf(is_pep484_tower=True))
sys.modules["numeric_tower"] = _checker
install_import_hook(_MODULES, "numeric_tower.check")
os.environ.setdefault("WARP_CACHE_PATH", str(ROOT / ".cache" / "warp"))


@pytest.fixture(scope="session")
def root() -> Path:
    return ROOT
