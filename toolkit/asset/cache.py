"""Results on disk, keyed by all that they depend on: one folder, any number of processes."""

from __future__ import annotations

import hashlib
import json
import logging
import os
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from ...converters.files import UNFINISHED
from ...converters.npz import load_npz, save_npz
from ...fem.errors import AutophyxError, InputError, UsageError
from .child import ChildFailure, Clock, Progress, run_guarded
from .engines import Arrays

log = logging.getLogger(__name__)

MOST_BYTES = 2 * 2**30  # of all results of a folder together
ABANDONED = 86_400.0  # s after which an unfinished file has no writer any more
# The packages that compute the results: another version of one of them is another result.
ENGINE_PACKAGES = ("autophyx-tet", "pytetwild", "numpy")


@dataclass(frozen=True)
class Runner:
    """Runs engine tasks in guarded children and remembers their results.

    time_limit, memory_limit: Seconds of CPU for all runs together, and bytes for one.
    progress: Called with (stage, seconds) while a child works.
    cache: Folder of the results, or None to remember nothing.
    clock: What the runs so far took.
    meanwhile: Called with the CPU seconds of a child again and again while it works.
    """

    time_limit: float
    memory_limit: int | None = None
    progress: Progress | None = None
    cache: Path | None = None
    clock: Clock = field(default_factory=Clock)
    meanwhile: Callable[[float], None] | None = None

    def checked(self) -> Runner:
        """Return itself, or say what is out of range."""
        if not self.time_limit > 0:
            raise UsageError(f"--time-limit must be > 0 s, got {self.time_limit:g}")
        return self

    @property
    def left(self) -> float:
        """Seconds of CPU that runs may still take."""
        return max(self.time_limit - self.clock.seconds, 0.0)

    def run(
        self,
        task: str,
        arrays: Mapping[str, np.ndarray],
        options: Mapping[str, Any],
        *,
        most: float = np.inf,
        hopeless: Callable[[str, float], bool] | None = None,
    ) -> Arrays:
        """Return what the task gives within ``most`` s, from the cache if it has been run before.

        It is given up where it is ``hopeless`` by what it prints, and its seconds so far.
        Raises ChildFailure: As ``run_guarded``, and where no time is left.
        """
        path = None if self.cache is None else self.cache / f"{digest(task, arrays, options)}.npz"
        if path is not None and (known := recalled(path)) is not None:
            return known

        def watched(said: str, seconds: float) -> bool:
            if self.meanwhile is not None:
                self.meanwhile(seconds)
            return hopeless is not None and hopeless(said, seconds)

        if not self.left:
            raise ChildFailure("time", f"nothing is left of {self.time_limit:g} s of CPU", 0.0)
        result = run_guarded(
            task,
            arrays,
            options,
            time_limit=min(self.left, most),
            memory_limit=self.memory_limit,
            progress=self.progress,
            clock=self.clock,
            hopeless=None if hopeless is None else watched,
        )
        if path is not None:
            remember(path, result)
        return result


def digest(
    task: str,
    arrays: Mapping[str, np.ndarray],
    options: Mapping[str, Any],
    *,
    packages: Sequence[str] = ENGINE_PACKAGES,
) -> str:
    """SHA-256 of a task, its options, the bytes of its arrays and the versions of ``packages``."""
    head = [task, dict(options), {name: version(name) for name in packages}]
    sha = hashlib.sha256(json.dumps(head, sort_keys=True).encode())
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        sha.update(f"{name} {array.dtype.str} {array.shape}".encode())
        sha.update(array.tobytes())
    return sha.hexdigest()


def recalled(path: Path) -> Arrays | None:
    """Arrays remembered in a file; one that cannot be read is forgotten."""
    if not path.exists():
        return None
    try:
        arrays = load_npz(path)
    except AutophyxError as error:
        log.warning("%s is damaged and is made again: %s", path, error)
        path.unlink(missing_ok=True)
        return None
    with suppress(OSError):  # forgotten by another process since, or not ours to touch
        os.utime(path)
    log.info("from the cache: %s", path.name)
    return arrays


def remember(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Keep arrays in a file of a folder that others may use too, at most ``MOST_BYTES`` in all.

    What has not been used for longest goes first. Where nothing can be written nothing is kept.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        save_npz(path, **arrays)
    except (OSError, InputError) as error:
        log.warning("%s is not remembered: %s", path, error)
        return
    # Delete results beyond the bound, and what writers that were killed left unfinished
    total, files = 0, []
    for file in path.parent.glob("*.npz"):
        with suppress(FileNotFoundError):  # another process forgot it meanwhile
            files.append((file, file.stat()))
    for file, known in sorted(files, key=lambda one: one[1].st_mtime, reverse=True):
        if file.name.startswith(UNFINISHED):
            old = time.time() - known.st_mtime > ABANDONED
        else:
            total += known.st_size
            old = total > MOST_BYTES
        if old:
            file.unlink(missing_ok=True)
