"""Shape and type checks on every annotated call of ours, for the whole test run."""

import os
import sys
from pathlib import Path
from types import ModuleType

import pytest
from beartype import BeartypeConf, beartype
from hypothesis import HealthCheck, settings
from jaxtyping import install_import_hook

ROOT = Path(__file__).resolve().parent.parent

# Kernel modules and laws are warp code, compiled from their own source text: not wrapped. The CLI's
# option classes are read by tyro, which resolves annotations itself.
_MODULES = [
    "autophyx_tet." + path.relative_to(ROOT).with_suffix("").as_posix().replace("/", ".")
    for room in ("fem", "predictors", "converters", "toolkit")
    for path in sorted((ROOT / room).rglob("*.py"))
    if not path.stem.startswith(("__", "kernels")) and path.parent.name not in ("cli", "laws")
]
# An int is a float here (PEP 484's numeric tower), as for every other type checker.
_checker = ModuleType("numeric_tower")
_checker.check = beartype(conf=BeartypeConf(is_pep484_tower=True))
sys.modules["numeric_tower"] = _checker
install_import_hook(_MODULES, "numeric_tower.check")
# A busy machine is no error: no example has a deadline. Every run meets the same examples, so that
# what passed passes; AUTOPHYX_EXPLORE=1 draws new ones.
settings.register_profile(
    "house",
    deadline=None,
    derandomize="AUTOPHYX_EXPLORE" not in os.environ,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("house")
# Caches inside the checkout, so that a clean clone tests from nothing.
os.environ["XDG_CACHE_HOME"] = str(ROOT / ".cache")
os.environ.setdefault("WARP_CACHE_PATH", str(ROOT / ".cache" / "warp"))


@pytest.fixture(scope="session")
def root() -> Path:
    return ROOT


GROUPS = ("real", "browser", "external")
_ran: dict[str, int] = dict.fromkeys(GROUPS, 0)
_skipped: list[str] = []


def pytest_runtest_logreport(report):
    """Count the tests of every group that ran, and the skipped ones."""
    if report.skipped:
        _skipped.append(report.nodeid)
    elif report.when == "call" and report.passed:
        for group in GROUPS:
            _ran[group] += group in report.keywords


def pytest_sessionfinish(session):
    """Under AUTOPHYX_REQUIRE_ALL a skipped test or an empty group is a failure.

    Groups that ``-m`` leaves out by name ("not real") are not asked for.
    """
    if not os.environ.get("AUTOPHYX_REQUIRE_ALL") or hasattr(session.config, "workerinput"):
        return
    asked = [group for group in GROUPS if f"not {group}" not in session.config.option.markexpr]
    empty = [group for group in asked if not _ran[group]]
    if _skipped or empty:
        sys.stderr.write(f"\nskipped: {_skipped}\ngroups that ran no test: {empty}\n")
        session.exitstatus = pytest.ExitCode.TESTS_FAILED
