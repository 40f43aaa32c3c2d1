"""Many assets: every row of a manifest in a process of its own, on this machine or on a cluster.

Resumable: rows that have their result are not run again, rows that were cut off leave nothing. The
process of a row dies with whoever started it; a result appears under its name by one rename, or
not at all. The same function, ``perform``, works for a thread of this machine and for a worker of
a cluster.
"""

from __future__ import annotations

import base64
import csv
import fcntl
import hashlib
import io
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager, redirect_stdout
from dataclasses import asdict, dataclass, fields
from difflib import get_close_matches
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import quote

from ..converters.files import writing
from ..fem.errors import BandError, ConvergenceError, InputError, NoVolumeError, UsageError
from .asset.document import BATCH, SCHEMA, check_document, check_folder, versions, write_json
from .asset.guard import guarded
from .options import (
    AssignOptions,
    BatchOptions,
    ConvertOptions,
    SimulateOptions,
    WallOptions,
    arguments,
    read_config,
)

HOME = ".batch"  # inside the output folder: lock, work in progress, records of failures
RECORD = "batch.json"  # inside a result: what was asked, and what it took
ATTEMPTS = 2  # a worker that was killed is replaced once; a second kill is the asset's own doing
# What a row runs, as anyone would call it: a process, so that nothing here imports it.
COMMAND_LINE = "autophyx_tet"
POLL = 0.1  # s between two looks at a process that takes seconds
TIMED_OUT = 124  # what timeout(1) returns
BY_SIGNAL = 128  # what shells add to the number of the signal
CRASHED = BY_SIGNAL + signal.SIGKILL  # a worker of a cluster that was lost
RAY_RETRIES = 2  # times that a cluster gives a row to another worker when one is lost
# Failures that the same asset and options meet on every machine: a restart keeps them.
FINAL = {kind.exit_code for kind in (UsageError, NoVolumeError, BandError, ConvergenceError)}
THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
# Options of `run`, which a manifest may have as columns, and their types.
OPTIONS = {
    item.name: str(item.type)
    for options in (ConvertOptions, WallOptions, AssignOptions, SimulateOptions)
    for item in fields(options)
}
COLUMNS = ("id", "asset", "text", *OPTIONS)
ID = re.compile(r"[\w][\w.+@ -]{0,99}")  # a folder's name on every system, and never hidden
PICTURE_WIDTH, PICTURE_QUALITY = 480, 60  # pixels; about 8 kB a picture, 8 MB a thousand
TABLE_COLUMNS: tuple[str, ...] = (
    "id", "asset", "text", "status", "code", "reason", "attempts", "seconds", "tets", "volume",
    "mass", "materials", "warnings", "folder",
)  # fmt: skip


class Job(NamedTuple):
    """A row of the manifest: its name, its asset, and the arguments of ``run`` for it."""

    id: str
    asset: str
    text: str
    path: str
    arguments: tuple[str, ...]

    def fingerprint(self) -> str:
        """SHA-256 of the arguments and of the asset's bytes."""
        sha = hashlib.sha256(json.dumps([self.text, *self.arguments]).encode())
        path = Path(self.path)
        if path.is_file():
            with path.open("rb") as asset:
                sha.update(hashlib.file_digest(asset, "sha256").digest())
        return sha.hexdigest()


@dataclass(frozen=True)
class Limits:
    """What one asset may use: seconds, bytes of address space a process, threads."""

    seconds: float
    memory: int
    threads: int

    @classmethod
    def of(cls, options: BatchOptions, *, threads: int) -> Limits:
        """Limits as options state them, memory in GB."""
        return cls(options.time_limit, int(options.memory_limit * 1e9), threads)


@dataclass(frozen=True)
class Outcome:
    """The end of one row: exit code 0 with a result, or another one with its reason."""

    id: str
    code: int
    reason: str
    attempts: int
    seconds: float
    fingerprint: str


@dataclass(frozen=True, eq=False)
class BatchResult:
    """The rows of a manifest and how each ended; ``new`` of them were run this time."""

    jobs: tuple[Job, ...]
    ended: Mapping[str, Outcome]
    new: int = 0
    rows: tuple[dict[str, Any], ...] = ()
    files: tuple[Path, ...] = ()

    def document(self) -> dict[str, Any]:
        """Return what ``batch --json`` prints, and results.json holds."""
        failed = [row for row in self.rows if row["code"]]
        return {
            "files": self.files,
            "assets": len(self.jobs),
            "done": len(self.rows) - len(failed),
            "failed": len(failed),
            "new": self.new,
            "codes": Counter(str(row["code"]) for row in self.rows),
            "rows": self.rows,
            "versions": versions(),
            "warnings": [f"{row['id']}: exit {row['code']}: {row['reason']}" for row in failed],
        }


def batch(
    manifest: str | os.PathLike[str],
    *,
    output: str | Path,
    options: BatchOptions | None = None,
    run_config: str | Path | None = None,
    progress: Callable[[Outcome, int, int], None] | None = None,
) -> BatchResult:
    """Run every row of a manifest and write results.csv, results.json and index.html.

    A row that fails is listed with its exit code and its reason, and stops nothing.

    Parameters
    ----------
    manifest
        CSV file with the columns asset and text, also id and any option of ``run``; or a folder of
        assets.
    output
        Folder of the results, one folder a row; the same again continues where it ended.
    options
        Workers, seconds [s] and memory [GB] of a row.
    run_config
        TOML file of options for all rows, as ``run --print-config`` writes it.
    progress
        Called with (outcome, rows done, rows in all) whenever a row ends.

    Returns
    -------
    BatchResult
        How every row ended, the table, and the files.

    Raises
    ------
    InputError
        Where the manifest cannot be read, the folder not be written, or another batch works in it.
    """
    options = (options or BatchOptions()).checked()
    common = () if run_config is None else read_config(Path(run_config))
    jobs = read_manifest(Path(manifest), common=common)
    output = Path(output).resolve()
    check_folder(output)
    # Refuse to replace a folder or a document that no batch has made
    check_document(output / "results.json", BATCH)
    for job in jobs:
        folder = output / job.id
        if folder.exists() and not (folder / RECORD).is_file():
            raise InputError("batch.would_replace", folder=folder)
    with _alone(output):
        ended = {job.id: past for job in jobs if (past := stored(job, output))}
        todo = [job for job in jobs if job.id not in ended]
        for outcome in (_ray if options.engine == "ray" else _local)(todo, output, options):
            ended[outcome.id] = outcome
            if progress is not None:
                progress(outcome, len(ended), len(jobs))
        rows = tuple(_row(job, ended[job.id], output) for job in jobs)
        files = tuple(output / name for name in ("results.csv", "index.html", "results.json"))
        result = BatchResult(tuple(jobs), ended, len(todo), rows, files)
        with writing(files[0]) as path, path.open("w", newline="", encoding="utf-8") as lines:
            table = csv.DictWriter(lines, TABLE_COLUMNS)
            table.writeheader()
            table.writerows(rows)
        with writing(files[1]) as path:
            path.write_text(index_page(rows, output), encoding="utf-8", newline="\n")
        write_json(files[2], {"schema": SCHEMA, **result.document()})
    return result


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


def read_manifest(path: Path, *, common: Sequence[str] = ()) -> list[Job]:
    """Rows of a manifest, or the assets of a folder; ``common`` are arguments of ``run`` for all.

    Columns: ``asset`` (a path, relative to the manifest) and ``text``; then, as wanted, ``id``
    (name of the result's folder, by default the asset's stem, numbered where it comes again) and
    every option of ``run``: ``size``, ``units``, ``up``, ``scenario``, ``edge_length_rel`` ... An
    empty cell is the default; the items of an option that may be repeated (``part``, ``material``)
    stand between ``;``.

    Raises InputError: Where the file cannot be read, or has no row or no column ``asset``.
    Raises UsageError: Where a column is unknown, or a row's id is doubled or no name of a folder.
    """
    if path.is_dir():
        # A row for every asset of a folder, by name; what they are made of says the configuration
        from .asset.formats import ASSET_FORMATS

        found = [p.name for p in sorted(path.iterdir()) if p.suffix.lower() in ASSET_FORMATS]
        if not found:
            raise InputError(f"the folder {path} has no asset: {', '.join(ASSET_FORMATS)}")
        return list(_jobs(path / "manifest", [{"asset": name} for name in found], list(common)))
    try:
        with path.open(newline="", encoding="utf-8-sig") as lines:
            reader = csv.DictReader(lines, strict=True)
            columns, rows = list(reader.fieldnames or ()), list(reader)
    except (OSError, ValueError, csv.Error) as error:
        raise InputError(f"cannot read the manifest {path}: {error}") from error
    if "asset" not in columns:
        raise InputError("batch.no_columns", path=path, got=", ".join(columns) or "nothing")
    for name in columns:
        if _option(name) not in COLUMNS:
            close = get_close_matches(_option(name), COLUMNS, n=1)
            hint = f"did you mean {close[0]}?" if close else f"known: {', '.join(COLUMNS)}"
            raise UsageError(f"the manifest {path}: unknown column {name!r}; {hint}")
    if not rows:
        raise InputError(f"the manifest {path} has no row: one asset and its text a line")
    return list(_jobs(path, rows, list(common)))


def _jobs(path: Path, rows: list[dict[str, str]], common: list[str]) -> Iterator[Job]:
    taken = {row["id"].strip() for row in rows if row.get("id")}
    given: set[str] = set()
    for line, row in enumerate(rows, 2):
        if None in row or not (row["asset"] or "").strip():
            what = "more cells than columns" if None in row else "no asset"
            raise InputError(f"the manifest {path}, row {line}: {what}")
        asset = row["asset"].strip()
        name = (row.get("id") or "").strip()
        if not name:  # the asset's stem, numbered until it is free
            stem = re.sub(r"[^\w.+@ -]", "_", Path(asset).stem).lstrip(".+@ -")[:90] or "asset"
            names = (stem, *(f"{stem}-{i}" for i in range(2, len(taken | given) + 2)))
            name = next(name for name in names if name not in taken | given)
        if name in given or not ID.fullmatch(name):
            why = "comes twice" if name in given else "is no name of a folder"
            raise UsageError(f"the manifest {path}, row {line}: the id {name!r} {why}")
        given.add(name)
        options: dict[str, str | bool | list[str]] = {}
        for column, cell in row.items():
            option, cell = _option(column), (cell or "").strip()
            if not cell or option not in OPTIONS:
                continue
            if "bool" in OPTIONS[option] and cell.lower() in ("true", "yes", "1"):
                options[option] = True
            elif "bool" in OPTIONS[option] and cell.lower() in ("false", "no", "0"):
                options[option] = False
            elif "tuple" in OPTIONS[option]:
                options[option] = [item.strip() for item in cell.split(";") if item.strip()]
            else:
                options[option] = cell
        text, place = (row.get("text") or "").strip(), str((path.parent / asset).resolve())
        yield Job(name, asset, text, place, (*common, *arguments(options)))


def _option(column: str) -> str:
    return column.strip().replace("-", "_")


def _local(jobs: Sequence[Job], output: Path, options: BatchOptions) -> Iterator[Outcome]:
    """Every worker is a thread that waits for one process after the other."""
    cores, stop = len(os.sched_getaffinity(0)), threading.Event()
    workers = options.workers or cores
    limits = Limits.of(options, threads=max(1, cores // workers))
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
    """Every row is a task of a Ray cluster; all its machines see ``output`` under one path.

    A worker that is lost is replaced; a row that loses too many is named with it.
    """
    with redirect_stdout(sys.stderr):  # Ray tells of lost workers there; ours is the document's
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        try:
            import ray  # (the extra `batch`)
            import ray.exceptions
        except ImportError as error:
            raise InputError("batch.needs_ray") from error
        try:
            if options.address:
                ray.init(address=options.address, log_to_driver=False)
            else:
                ray.init(
                    "local", num_cpus=options.workers, include_dashboard=False, log_to_driver=False
                )
        except (ConnectionError, RuntimeError, ValueError) as error:
            place = options.address or "this machine"
            raise InputError("batch.no_cluster", place=place, error=error) from error
        try:
            task = ray.remote(num_cpus=1, max_retries=RAY_RETRIES)(perform)
            limits = Limits.of(options, threads=1)
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


class Stopped(Exception):
    """The batch is ending: the row is neither done nor failed."""


def perform(
    job: Job, output: str, limits: Limits, *, stopped: Callable[[], bool] = lambda: False
) -> Outcome:
    """Run one row and leave ``output/ID`` or the record of its failure.

    Raises Stopped: Where ``stopped()`` became true on the way; nothing is left then.
    """
    home = Path(output)
    if (past := stored(job, home)) is not None:  # by a worker that was lost afterwards
        return past
    began, code, attempt, reason = time.monotonic(), BY_SIGNAL + 1, 0, ""
    while code > BY_SIGNAL and attempt < ATTEMPTS:
        attempt, started = attempt + 1, time.monotonic()
        try:
            # beside the results; the folder is moved in whole
            with tempfile.TemporaryDirectory(dir=_made(home / HOME / "work")) as work:
                code, reason = _process(job, Path(work), limits, stopped)
                if code == 0:
                    seconds = time.monotonic() - started
                    done = Outcome(job.id, code, reason, attempt, seconds, job.fingerprint())
                    made, target = Path(work, job.id), home / job.id
                    write_json(made / RECORD, asdict(done))
                    if target.exists():
                        target.rename(made.with_name(".replaced"))
                    made.rename(target)
        except (OSError, InputError) as error:
            code, reason = InputError.exit_code, f"cannot keep the result: {error}"
    ended = Outcome(job.id, code, reason, attempt, time.monotonic() - began, job.fingerprint())
    # Write down a failure, or forget one that has been overcome
    record = home / HOME / "failed" / f"{job.id}.json"
    try:
        if code != 0:
            write_json(_made(record.parent) / record.name, asdict(ended))
    except (OSError, InputError):  # a full disk: the row has no record, a restart does it again
        record.unlink(missing_ok=True)
    if code == 0:
        record.unlink(missing_ok=True)
    return ended


def stored(job: Job, output: Path) -> Outcome | None:
    """The end that this very row had before, unless it is worth another try."""
    places = [output / HOME / "failed" / f"{job.id}.json"]
    if (output / job.id / "run.json").exists():
        places.insert(0, output / job.id / RECORD)
    for place in places:
        try:
            ended = Outcome(**json.loads(place.read_text(encoding="utf-8")))
        except (OSError, ValueError, TypeError):  # none, or not ours: the row is done again
            continue
        same = ended.fingerprint == job.fingerprint()
        return ended if same and (ended.code == 0 or ended.code in FINAL) else None
    return None


def _made(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _process(job: Job, work: Path, limits: Limits, stopped: Callable[[], bool]) -> tuple[int, str]:
    """Run the command line in ``work``; return its exit code and its last words."""
    call = ("run", job.path, f"--text={job.text}", f"--output={job.id}", "--quiet")
    log = work / "log.txt"
    with log.open("wb") as words:
        child = subprocess.Popen(
            guarded(COMMAND_LINE, *call, *job.arguments, memory=limits.memory),
            cwd=work,
            env=os.environ | dict.fromkeys(THREAD_VARIABLES, str(limits.threads)),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=words,
            start_new_session=True,
        )
    try:
        deadline = time.monotonic() + limits.seconds
        while child.poll() is None:
            if stopped():
                raise Stopped
            if time.monotonic() > deadline:
                return TIMED_OUT, f"no result within {limits.seconds:g} s"
            time.sleep(POLL)
    finally:
        if child.poll() is None:
            child.kill()
        child.wait()
    if child.returncode < 0:
        return BY_SIGNAL - child.returncode, f"killed by {signal.Signals(-child.returncode).name}"
    if child.returncode == 0:
        return 0, ""
    # The line of the error, without the program's name; or the box of a refused option
    lines = log.read_text(errors="replace").splitlines()
    for line in reversed(lines):
        if line.startswith("autophyx-tet: "):
            return child.returncode, line.removeprefix("autophyx-tet: ")
    box = " ".join(" ".join(line.strip("╭╮╰╯│─ ") for line in lines).split())
    return child.returncode, box.partition(" Argument helptext")[0][:500] or "it said nothing"


def _row(job: Job, ended: Outcome, output: Path) -> dict[str, Any]:
    """One line of the table; what only a result knows stays empty for a failure."""
    row: dict[str, Any] = dict.fromkeys(TABLE_COLUMNS, "") | {
        "id": job.id,
        "asset": job.asset,
        "text": job.text,
        "status": "failed" if ended.code else "done",
        "code": ended.code,
        "reason": ended.reason,
        "attempts": ended.attempts,
        "seconds": round(ended.seconds, 2),
    }
    if ended.code:
        return row
    run = json.loads((output / job.id / "run.json").read_text(encoding="utf-8"))
    return row | {
        **{name: run[name] for name in ("tets", "volume", "mass")},
        "materials": "; ".join(f"{part['name']}: {part['material']}" for part in run["parts"]),
        "warnings": len(run["warnings"]),
        "folder": job.id,
    }


def index_page(rows: tuple[dict[str, Any], ...], output: Path) -> str:
    """The page as text: a card for every row, failures first; it asks for nothing from outside."""
    from PIL import Image

    from .report.html import render

    cards = []
    for row in rows:
        if row["code"]:
            continue
        # A picture as a data address, small enough for a page of a thousand
        with Image.open(output / row["folder"] / "picture.png") as image:
            image.thumbnail((PICTURE_WIDTH, PICTURE_WIDTH))
            data = io.BytesIO()
            image.convert("RGB").save(data, "WEBP", quality=PICTURE_QUALITY)
        numbers = f"{row['tets']:,} tets, {row['mass']:.3g} kg, {row['seconds']:.0f} s"
        cards.append(
            {name: row[name] for name in ("id", "text", "materials")}
            | {
                "numbers": f"{numbers}, {row['warnings']} warnings",
                "report": f"{quote(row['folder'])}/report.html",
                "picture": f"data:image/webp;base64,{base64.b64encode(data.getvalue()).decode()}",
            }
        )
    failed = [row for row in rows if row["code"]]
    return render("index.html", count=len(rows), failures=failed, cards=cards)
