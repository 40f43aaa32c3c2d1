"""One row of a batch, in a process of its own: tried, limited, and its folder moved in whole.

The same function works for a thread of this machine and for a worker of a cluster. The process dies
with whoever started it; a result appears under its name by one rename, or not at all.
"""

from __future__ import annotations

import hashlib
import json
import os
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import NamedTuple

from ...fem.errors import BandError, ConvergenceError, InputError, NoVolumeError, UsageError
from ..io.document import write_json
from ..native.guard import guarded

HOME = ".batch"  # inside the output folder: lock, work in progress, records of failures
RECORD = "batch.json"  # inside a result: what was asked, and what it took
ATTEMPTS = 2  # a worker that was killed is replaced once; a second kill is the asset's own doing
# What a row runs, as anyone would call it: a process, so that nothing here imports it.
COMMAND_LINE = "autophyx_tet.toolkit.cli"
POLL = 0.1  # s between two looks at a process that takes seconds
TIMED_OUT = 124  # what timeout(1) returns
BY_SIGNAL = 128  # what shells add to the number of the signal
# Failures that the same asset and options meet on every machine: a restart keeps them.
FINAL = {kind.exit_code for kind in (UsageError, NoVolumeError, BandError, ConvergenceError)}
THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


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


@dataclass(frozen=True)
class Outcome:
    """The end of one row: exit code 0 with a result, or another one with its reason."""

    id: str
    code: int
    reason: str
    attempts: int
    seconds: float
    fingerprint: str


class Stopped(Exception):
    """The batch is ending: the row is neither done nor failed."""


def perform(
    job: Job, output: str, limits: Limits, *, stopped: Callable[[], bool] = lambda: False
) -> Outcome:
    """Run one row and leave ``output/ID`` or the record of its failure.

    Raises
    ------
    Stopped
        Where ``stopped()`` became true on the way; nothing is left then.
    """
    if (past := stored(job, Path(output))) is not None:  # by a worker that was lost afterwards
        return past
    started, code, attempt, reason = time.monotonic(), BY_SIGNAL + 1, 0, ""
    while code > BY_SIGNAL and attempt < ATTEMPTS:
        attempt += 1
        code, reason = _try(job, Path(output), limits, stopped, attempt=attempt)
    seconds = time.monotonic() - started
    ended = Outcome(job.id, code, reason, attempt, seconds, job.fingerprint())
    _note(ended, Path(output))
    return ended


def stored(job: Job, output: Path) -> Outcome | None:
    """The end that this very row had before, unless it is worth another try."""
    done = _read(output / job.id / RECORD) if (output / job.id / "run.json").exists() else None
    ended = done or _read(_failure(job.id, output))
    if ended is None or ended.fingerprint != job.fingerprint():
        return None
    return ended if ended.code == 0 or ended.code in FINAL else None


def _try(
    job: Job, output: Path, limits: Limits, stopped: Callable[[], bool], *, attempt: int
) -> tuple[int, str]:
    """Run the row once beside the results and move its folder in; exit code and reason."""
    started = time.monotonic()
    try:
        with tempfile.TemporaryDirectory(dir=_made(output / HOME / "work")) as work:
            code, reason = _process(job, Path(work), limits, stopped)
            if code == 0:
                seconds = time.monotonic() - started
                done = Outcome(job.id, code, reason, attempt, seconds, job.fingerprint())
                write_json(Path(work, job.id, RECORD), asdict(done))
                _move_in(Path(work, job.id), output / job.id)
    except (OSError, InputError) as error:
        return InputError.exit_code, f"cannot keep the result: {error}"
    return code, reason


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
        if not _wait(child, limits.seconds, stopped):
            return TIMED_OUT, f"no result within {limits.seconds:g} s"
    finally:
        _kill(child)
    if child.returncode < 0:
        return BY_SIGNAL - child.returncode, f"killed by {signal.Signals(-child.returncode).name}"
    return child.returncode, "" if child.returncode == 0 else _last_words(log)


def _wait(child: subprocess.Popen[bytes], seconds: float, stopped: Callable[[], bool]) -> bool:
    """Whether the process ended within its time."""
    deadline = time.monotonic() + seconds
    while child.poll() is None:
        if stopped():
            raise Stopped
        if time.monotonic() > deadline:
            return False
        time.sleep(POLL)
    return True


def _kill(child: subprocess.Popen[bytes]) -> None:
    """End the process if it still runs; its own children die with it."""
    if child.poll() is None:
        child.kill()
    child.wait()


def _last_words(log: Path) -> str:
    """The line of the error, without the program's name; or the box of a refused option."""
    lines = log.read_text(errors="replace").splitlines()
    for line in reversed(lines):
        if line.startswith("autophyx-tet: "):
            return line.removeprefix("autophyx-tet: ")
    words = " ".join(line.strip("╭╮╰╯│─ ") for line in lines)
    return " ".join(words.split()).partition(" Argument helptext")[0][:500] or "it said nothing"


def _move_in(made: Path, target: Path) -> None:
    """Put a whole result where it belongs, in place of one of another request."""
    if target.exists():
        target.rename(made.with_name(".replaced"))
    made.rename(target)


def _note(ended: Outcome, output: Path) -> None:
    """Write down a failure, or forget one that has been overcome."""
    path = _failure(ended.id, output)
    if ended.code == 0:
        path.unlink(missing_ok=True)
        return
    try:
        write_json(_made(path.parent) / path.name, asdict(ended))
    except (OSError, InputError):  # a full disk: the row has no record, a restart does it again
        path.unlink(missing_ok=True)


def _failure(name: str, output: Path) -> Path:
    return output / HOME / "failed" / f"{name}.json"


def _made(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _read(path: Path) -> Outcome | None:
    """A record, if it is one."""
    try:
        return Outcome(**json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):  # none, or not ours: the row is done again
        return None
