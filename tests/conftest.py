"""Shape and type checks on every annotated call of ours, for the whole test run."""

import atexit
import gc
import hashlib
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import is_dataclass
from functools import wraps
from pathlib import Path
from types import FunctionType, ModuleType
from typing import get_type_hints

import jaxtyping
import pytest
from _pytest.mark.expression import Expression
from beartype import BeartypeConf, beartype
from hypothesis import HealthCheck, settings

ROOT = Path(__file__).resolve().parent.parent

# Kernel modules and laws are warp code, compiled from their own source text: not wrapped. The CLI's
# option classes are read by tyro, which resolves annotations itself.
_MODULES = [
    "autophyx_tet." + path.relative_to(ROOT).with_suffix("").as_posix().replace("/", ".")
    for room in ("fem", "predictors", "converters", "toolkit", "research")
    for path in sorted((ROOT / room).rglob("*.py"))
    if not path.stem.startswith(("__", "kernels", "commands"))
    and path.parent.name not in ("cli", "laws")
]
# An int is a float here (PEP 484's numeric tower), as for every other type checker.
_checker = ModuleType("numeric_tower")
_checker.check = beartype(conf=BeartypeConf(is_pep484_tower=True, violation_type=TypeError))
sys.modules["numeric_tower"] = _checker


def _checked_when_called(fn: FunctionType, shaped: Callable) -> Callable:
    """Return the function that checks its types, and shapes where it names any.

    A process calls one function in three of those that it imports, and half a second in three of
    the quick tests went into checks made for the others.
    """
    checked = None

    @wraps(fn)
    def called(*args, **kwargs):
        nonlocal checked
        if checked is None:
            hints = _hints(fn)
            with_shapes = any("jaxtyping" in str(hint) for hint in hints.values())
            checked = shaped(fn) if with_shapes else _checker.check(_annotated(fn, hints))
        return checked(*args, **kwargs)

    return called


def _hints(fn: FunctionType) -> dict[str, object]:
    """Return the annotations, without those that only a type checker can resolve."""
    hints = {}
    for name, hint in fn.__annotations__.items():
        stub = FunctionType((lambda: None).__code__, fn.__globals__)
        stub.__annotations__ = {name: hint}
        try:
            hints |= get_type_hints(stub, include_extras=True)
        except (NameError, TypeError, ValueError):
            pass
    return hints


def _annotated(fn: FunctionType, hints: dict[str, object]) -> FunctionType:
    """Return a copy with these annotations."""
    out = FunctionType(fn.__code__, fn.__globals__, fn.__name__, fn.__defaults__, fn.__closure__)
    out.__kwdefaults__, out.__annotations__ = fn.__kwdefaults__, hints
    out.__qualname__, out.__module__ = fn.__qualname__, fn.__module__
    return out


def _lazily(jaxtyped: Callable) -> Callable:
    """Return what the import hook puts above functions and classes in the place of `jaxtyped`."""

    def decorator(*, typechecker: Callable) -> Callable:
        def decorate(made):
            shaped = jaxtyped(typechecker=typechecker)
            if not isinstance(made, type):
                return _checked_when_called(made, shaped)
            if is_dataclass(made) and not hasattr(made.__init__, "__wrapped__"):
                made.__init__ = _checked_when_called(made.__init__, shaped)
            return made

        return decorate

    return decorator


jaxtyping.jaxtyped = _lazily(jaxtyping.jaxtyped)
jaxtyping.install_import_hook(_MODULES, "numeric_tower.check")
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
# What is imported stays: no collection of garbage looks through it, neither now nor in the tests.
gc.disable()


def pytest_collection_finish():
    """Collect garbage again, of the tests alone."""
    gc.freeze()
    gc.enable()
    atexit.register(gc.unfreeze)  # or extensions take what Python leaves at its end for leaks


@pytest.fixture(scope="session")
def root() -> Path:
    return ROOT


@pytest.fixture(scope="session")
def site() -> Path:
    """The documentation, built strictly, once for all that its pages are made of.

    A dead link, a lost name or a docstring that does not parse is an error.
    """
    made_of = hashlib.sha256()
    rooms = ("docs", "examples", "notebooks", "fem", "predictors", "converters", "toolkit")
    every = (path for room in (*rooms, "research") for path in (ROOT / room).rglob("*.*"))
    for path in sorted([*every, *ROOT.glob("*.py"), ROOT / "mkdocs.yml"]):
        if path.is_file() and path.suffix not in (".pyc", ".safetensors"):
            made_of.update(str(path).encode() + path.read_bytes())
    folder = ROOT / ".cache" / "site" / made_of.hexdigest()[:16]
    if not folder.exists():
        shutil.rmtree(folder.parent, ignore_errors=True)
        new = folder.with_suffix(f".{os.getpid()}")
        words = [sys.executable, "-m", "mkdocs", "build", "-q", "--strict", "-d", str(new)]
        done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=600)
        assert done.returncode == 0, done.stderr[-3000:]
        new.rename(folder)
    return folder


GROUPS = ("long", "real", "browser", "external")
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

    A group is asked for where ``-m`` selects a test that wears its mark alone.
    """
    if not os.environ.get("AUTOPHYX_REQUIRE_ALL") or hasattr(session.config, "workerinput"):
        return
    chosen = Expression.compile(session.config.option.markexpr or "not nothing")
    asked = [group for group in GROUPS if chosen.evaluate(lambda name, **_: name == group)]
    empty = [group for group in asked if not _ran[group]]
    if _skipped or empty:
        sys.stderr.write(f"\nskipped: {_skipped}\ngroups that ran no test: {empty}\n")
        session.exitstatus = pytest.ExitCode.TESTS_FAILED
