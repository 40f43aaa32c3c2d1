"""Many assets: every row of a manifest in a process of its own, on this machine or on a cluster.

Resumable: rows that have their result are not run again, rows that were cut off leave nothing.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager, redirect_stdout
from functools import partial
from pathlib import Path
from typing import Any

from ...fem.errors import InputError, UsageError
from ..config import read_config
from ..io.outputs import BATCH, check_document, check_folder
from .manifest import read_manifest
from .options import BatchOptions
from .table import BatchResult, write_tables
from .task import HOME, RECORD, Job, Limits, Outcome, Stopped, perform, stored

GIGABYTE = 1e9
CRASHED = 137  # what a shell returns for a process that was killed
RAY_RETRIES = 2  # times that a cluster gives a row to another worker when one is lost

RowProgress = Callable[[Outcome, int, int], None]


def batch(
    manifest: str | os.PathLike[str],
    *,
    output: Path,
    options: BatchOptions | None = None,
    run_config: Path | None = None,
    progress: RowProgress | None = None,
) -> BatchResult:
    """Run every row of a manifest and write results.csv, results.json and index.html.

    A row that fails is listed with its exit code and its reason, and stops nothing.

    Parameters
    ----------
    manifest
        CSV file; see ``manifest.py`` for its columns.
    output
        Folder of the results, one folder a row; the same again continues where it ended.
    run_config
        TOML file of options for all rows, as ``run --print-config`` writes it.
    progress
        Called with (outcome, rows done, rows in all) whenever a row ends.

    Raises
    ------
    InputError
        Where the manifest cannot be read, the folder not be written, or another batch works in it.
    """
    options = (options or BatchOptions()).checked()
    common = () if run_config is None else read_config(run_config)
    jobs = read_manifest(Path(manifest), common=common)
    check_folder(output)
    output = output.resolve()
    _check_theirs(jobs, output)
    with _alone(output):
        ended = {job.id: past for job in jobs if (past := stored(job, output))}
        todo = [job for job in jobs if job.id not in ended]
        for outcome in ENGINES[options.engine](todo, output, options):
            ended[outcome.id] = outcome
            if progress is not None:
                progress(outcome, len(ended), len(jobs))
        return write_tables(output, BatchResult(tuple(jobs), ended, new=len(todo)))


def _check_theirs(jobs: Sequence[Job], output: Path) -> None:
    """Refuse to replace a folder or a document that no batch has made."""
    check_document(output / "results.json", BATCH)
    for job in jobs:
        folder = output / job.id
        if folder.exists() and not (folder / RECORD).is_file():
            raise InputError(
                f"{folder} is not the result of a batch and would be replaced: move it away, give "
                "the row another id, or give another -o"
            )


def _local(jobs: Sequence[Job], output: Path, options: BatchOptions) -> Iterator[Outcome]:
    """Every worker is a thread that waits for one process after the other."""
    workers, stop = options.workers or _cores(), threading.Event()
    limits = _limits(options, threads=max(1, _cores() // workers))
    act = partial(perform, output=str(output), limits=limits, stopped=stop.is_set)
    with ThreadPoolExecutor(workers) as pool:
        waiting = [pool.submit(act, job) for job in jobs]
        try:
            for done in as_completed(waiting):
                yield done.result()
        except Stopped:
            raise KeyboardInterrupt from None
        finally:  # also on Ctrl-C: the threads end their processes and come back
            stop.set()
            pool.shutdown(cancel_futures=True)


def _ray(jobs: Sequence[Job], output: Path, options: BatchOptions) -> Iterator[Outcome]:
    """Every row is a task of a Ray cluster; all its machines see ``output`` under one path."""
    with redirect_stdout(sys.stderr):  # Ray tells of lost workers there; ours is the document's
        yield from _ray_tasks(_cluster(options), jobs, output, options)


def _ray_tasks(
    ray: Any, jobs: Sequence[Job], output: Path, options: BatchOptions
) -> Iterator[Outcome]:
    """A worker that is lost is replaced; a row that loses too many is named with it."""
    try:
        task = ray.remote(num_cpus=1, max_retries=RAY_RETRIES)(perform)
        limits = _limits(options, threads=1)
        waiting = {task.remote(job, str(output), limits): job for job in jobs}
        while waiting:
            (done, *_), _ = ray.wait(list(waiting))
            job = waiting.pop(done)
            try:
                yield ray.get(done)
            except ray.exceptions.RayError as error:
                reason = " ".join(f"the worker was lost: {error}".split())[:300]
                yield Outcome(job.id, CRASHED, reason, RAY_RETRIES + 1, 0.0, "")
    finally:
        ray.shutdown()


def _cluster(options: BatchOptions) -> Any:
    """Ray, connected to the cluster that was named, or to one started on this machine."""
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    try:
        import ray  # pyright: ignore[reportMissingImports]  (the extra `batch`)
        import ray.exceptions  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise InputError("--engine ray needs the extra: pip install autophyx-tet[batch]") from error
    try:
        if options.address:
            ray.init(address=options.address, log_to_driver=False)
        else:
            ray.init(
                "local", num_cpus=options.workers, include_dashboard=False, log_to_driver=False
            )
    except (ConnectionError, RuntimeError, ValueError) as error:
        raise InputError(
            f"no Ray cluster at {options.address or 'this machine'}: {error}"
        ) from error
    return ray


ENGINES = {"local": _local, "ray": _ray}


def _limits(options: BatchOptions, *, threads: int) -> Limits:
    return Limits(options.time_limit, int(options.memory_limit * GIGABYTE), threads)


def _cores() -> int:
    return len(os.sched_getaffinity(0))


@contextmanager
def _alone(output: Path) -> Iterator[None]:
    """Hold the folder for this batch, and clear what a killed one left half-made."""
    try:
        (output / HOME).mkdir(parents=True, exist_ok=True)
        lock = (output / HOME / "lock").open("w")
    except OSError as error:
        raise InputError(f"cannot write into {output}: {error}; give another -o") from error
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise UsageError(f"another batch is at work in {output}: wait for its end") from error
        shutil.rmtree(output / HOME / "work", ignore_errors=True)
        yield
