"""Results on disk, keyed by all that they depend on: the engines', and others' arrays."""

from __future__ import annotations

import hashlib
import json
import logging
import os
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from ...converters.npz import load_npz, save_npz
from ...fem.errors import AutophyxError, UsageError
from .child import Arrays, Progress, run_guarded

log = logging.getLogger(__name__)

MAX_BYTES = 2 * 2**30  # of all results together; the oldest go first
# The packages that compute the results: another version of one of them is another result.
ENGINE_PACKAGES = ("autophyx-tet", "pytetwild", "numpy")


@dataclass(frozen=True)
class Runner:
    """Runs engine tasks in guarded children and remembers their results.

    Parameters
    ----------
    time_limit, memory_limit
        Seconds and bytes for one run.
    progress
        Called with (stage, seconds) while a child works.
    cache
        Folder of the results, or None to remember nothing.
    """

    time_limit: float
    memory_limit: int | None = None
    progress: Progress | None = None
    cache: Path | None = None

    def checked(self) -> Runner:
        """Return itself, or say what is out of range."""
        if not self.time_limit > 0:
            raise UsageError(f"--time-limit must be > 0 s, got {self.time_limit:g}")
        return self

    def run(
        self, task: str, arrays: Mapping[str, np.ndarray], options: Mapping[str, Any]
    ) -> Arrays:
        """Return what the task gives, from the cache if it has been run before."""
        path = None if self.cache is None else self.cache / f"{digest(task, arrays, options)}.npz"
        if path is not None and (known := recalled(path)) is not None:
            return known
        result = run_guarded(
            task,
            arrays,
            options,
            time_limit=self.time_limit,
            memory_limit=self.memory_limit,
            progress=self.progress,
        )
        if path is not None:
            remember(path, result, most_bytes=MAX_BYTES)
        return result


def digest(task: str, arrays: Mapping[str, np.ndarray], options: Mapping[str, Any]) -> str:
    """SHA-256 of a task, its options, the bytes of its arrays and the versions that matter."""
    head = [task, dict(options), {name: version(name) for name in ENGINE_PACKAGES}]
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
    os.utime(path)
    log.info("from the cache: %s", path.name)
    return arrays


def remember(
    path: Path,
    arrays: Mapping[str, np.ndarray],
    *,
    most_files: float = inf,
    most_bytes: float = inf,
) -> None:
    """Write arrays to a file, and forget what its folder holds beyond the bounds.

    What has not been used for longest goes first.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    save_npz(path, **arrays)
    files = sorted(path.parent.glob("*.npz"), key=lambda file: file.stat().st_mtime, reverse=True)
    total = 0
    for count, file in enumerate(files, start=1):
        total += file.stat().st_size
        if count > most_files or total > most_bytes:
            file.unlink(missing_ok=True)
