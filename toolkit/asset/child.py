"""The guarded child process: native code that may hang or crash runs in here, never in ours.

``run_guarded`` writes the arrays to a temporary folder, starts ``python -m ...asset.child`` on it
in a process group of its own, and reads the arrays that it leaves. On a time-out, on Ctrl-C or on
any other way out the whole group is killed and the folder removed. Where it can be done safely the
child is a copy of this process: to start another Python and load its libraries again takes as long
as to fill a small body.
"""

from __future__ import annotations

import ctypes
import faulthandler
import json
import logging
import os
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import time
import traceback
import warnings
from collections.abc import Callable, Mapping
from contextlib import suppress
from math import ceil
from pathlib import Path
from typing import Any, Literal

import numpy as np

from .engines import TASKS, Arrays
from .guard import guard

log = logging.getLogger(__name__)

Progress = Callable[[str, float], None]
Kind = Literal["time", "memory", "crash", "error"]

# Times its limit of CPU that a child may take by the wall clock: by then it waits for nothing.
WAITING = 20.0
MOST_SAID = 2**20  # bytes of what a child printed that are read again and again
POLL = 0.05  # s between two looks at the child: unnoticeable beside a process start of 0.3 s
SOON = 5.0  # CPU s after which a crash is no accident of a start
MEMORY_SHARE = 0.75  # of the machine's memory: the child fails before the machine swaps
_KINDS: dict[str, Kind] = {"MemoryError": "memory"}
_JOB, _RESULT, _FAILURE, _LOG = "job.npz", "result.npz", "failure.txt", "log.txt"


class ChildFailure(RuntimeError):
    """A child that left no result, with the kind of its end and the CPU seconds that it took."""

    def __init__(self, kind: Kind, reason: str, seconds: float) -> None:
        super().__init__(reason)
        self.kind = kind
        self.seconds = seconds


class Clock:
    """CPU [s] that children have taken together."""

    seconds: float = 0.0


def run_guarded(
    task: str,
    arrays: Mapping[str, np.ndarray],
    options: Mapping[str, Any] | None = None,
    *,
    time_limit: float,
    memory_limit: int | None = None,
    progress: Progress | None = None,
    clock: Clock | None = None,
    hopeless: Callable[[str, float], bool] | None = None,
) -> Arrays:
    """Run a task of ``engines.TASKS`` in a child process and return its arrays.

    task: Name in ``engines.TASKS``.
    arrays, options: What the task gets: arrays by name, and values that JSON can carry.
    time_limit: Seconds of CPU after which the child is killed: no other work on the machine counts.
    memory_limit: Bytes of address space; by default three quarters of the machine's memory.
    progress: Called with (stage, seconds so far) while the child works.
    clock: Goes on by the CPU seconds that the child takes.
    hopeless: Called with all that the child has printed and its CPU seconds so far; whether to end
        it.
    Raises ChildFailure: Where the child ran out of time or memory, crashed, or reported an error.

    A child with a segmentation fault within ``SOON`` is started once more: threads of native
    libraries, open3d's among them, trip over each other once in a few hundred starts.
    """
    asked = task, arrays, options, time_limit, memory_limit, progress, clock, hopeless
    try:
        return _run(*asked)
    except ChildFailure as failure:
        if "SIGSEGV" not in str(failure) or failure.seconds > SOON:
            raise
        log.debug("%s, and is started once more", failure)
        return _run(*asked)


def _run(
    task: str,
    arrays: Mapping[str, np.ndarray],
    options: Mapping[str, Any] | None,
    time_limit: float,
    memory_limit: int | None,
    progress: Progress | None,
    clock: Clock | None,
    hopeless: Callable[[str, float], bool] | None,
) -> Arrays:
    """One child, from its start to its end."""
    started = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="autophyx-tet-") as name:
        folder = Path(name)
        if not memory_limit:
            share = MEMORY_SHARE * os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
            ours, _ = resource.getrlimit(resource.RLIMIT_AS)
            memory_limit = int(share if ours == resource.RLIM_INFINITY else min(share, ours))
        job = {"task": task, "options": dict(options or {}), "memory": memory_limit}
        job["seconds"] = ceil(time_limit)  # the kernel counts whole ones
        np.savez(folder / _JOB, **arrays, __job__=np.array(json.dumps(job)))  # type: ignore
        (folder / _LOG).touch()
        child = _copy(folder) if task in COPIED and _can_be_copied(memory_limit) else _new(folder)
        ended = used = None
        try:
            while not (ended := os.wait4(child, os.WNOHANG))[0]:
                seconds = time.monotonic() - started
                if seconds > WAITING * max(time_limit, 1.0):
                    raise ChildFailure("time", f"no result within {seconds:.0f} s", time_limit)
                said = (folder / _LOG).read_bytes()[-MOST_SAID:].decode(errors="replace")
                if progress is not None:
                    # What the child said it is doing: its last line of the form `stage: WORD`
                    stages = [line for line in said.splitlines() if line.startswith("stage: ")]
                    progress(stages[-1].partition(" ")[2] if stages else "working", seconds)
                if hopeless is not None and hopeless(said, taken := cpu_seconds(child)):
                    raise ChildFailure("time", f"given up after {taken:.0f} s of CPU", taken)
                time.sleep(POLL)
        finally:
            # Kill the child and whatever it started; nothing is left behind
            try:
                os.killpg(child, signal.SIGKILL)
            except ProcessLookupError:
                log.debug("the child process group had already ended")
            if ended is None or not ended[0]:
                ended = os.wait4(child, 0)
            _, status, usage = ended
            code = os.waitstatus_to_exitcode(status)
            used = usage.ru_utime + usage.ru_stime
            if clock is not None:
                clock.seconds += used
        if code == -signal.SIGXCPU:
            raise ChildFailure("time", f"no result within {time_limit:.3g} s of CPU", used)
        return _result(code, folder, used)


# Tasks whose libraries have no threads that another process would miss.
COPIED = {"tetwild"}
COPIED_SHARE = 0.25  # of the memory limit: what a process may hold that is copied


def _can_be_copied(memory_limit: int) -> bool:
    """Whether this process is small, and no other thread of it can hold a lock at the moment."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[0])
    except OSError:  # not Linux: native libraries of other systems do not bear it
        return False
    small = pages * os.sysconf("SC_PAGE_SIZE") <= COPIED_SHARE * memory_limit
    return small and threading.active_count() == 1


def _copy(folder: Path) -> int:
    """Copy this process, and let the copy do the job; its number."""
    parent = os.getpid()
    sys.stdout.flush()
    sys.stderr.flush()
    ctypes.CDLL(None).fflush(None)
    with warnings.catch_warnings():
        # Of Python 3.12, where there is any thread: those of the BLAS end and start themselves
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    with suppress(ProcessLookupError, PermissionError):  # it has done so itself, or has ended
        os.setpgid(child, child)
    if child == 0:
        code = 1
        try:
            with (folder / _LOG).open("wb", buffering=0) as output, open(os.devnull, "rb") as none:
                for number, file in enumerate((none, output, output)):
                    os.dup2(file.fileno(), number)
            faulthandler.disable()  # a crash is told by the signal
            for number in (signal.SIGINT, signal.SIGTERM, signal.SIGALRM):
                signal.signal(number, signal.SIG_DFL)
            sys.stdout = sys.stderr = open(1, "w", closefd=False)
            code = main(folder, parent)
            sys.stdout.flush()
        finally:
            os._exit(code)  # what is to happen at our own end is not for the copy to do
    return child


def _new(folder: Path) -> int:
    """Start another Python for the job; its number."""
    with (folder / _LOG).open("wb") as output:
        child = subprocess.Popen(
            [sys.executable, "-P", "-m", f"{__package__}.child", str(folder), str(os.getpid())],
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
    child.returncode = 0  # we wait for it ourselves
    return child.pid


def cpu_seconds(process: int) -> float:
    """CPU [s] that a running process has taken; 0 where the system does not tell."""
    try:
        after_name = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    user, system = after_name[11:13]  # of proc(5), in ticks
    return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")


def _result(code: int, folder: Path, seconds: float) -> Arrays:
    from ...converters.npz import load_npz

    if code == 0 and (folder / _RESULT).exists():
        return load_npz(folder / _RESULT)
    if (folder / _FAILURE).exists():
        kind, _, reason = (folder / _FAILURE).read_text().partition(": ")
        raise ChildFailure(_KINDS.get(kind, "error"), reason or kind, seconds)
    words = (folder / _LOG).read_bytes()[-2000:].decode(errors="replace")
    if "bad_alloc" in words:
        raise ChildFailure("memory", "the engine ran out of its memory limit", seconds)
    end = signal.Signals(-code).name if code < 0 else f"exit code {code}"
    raise ChildFailure("crash", f"the engine crashed ({end})", seconds)


def main(folder: Path, parent: int) -> int:
    """Do the job that lies in ``folder``: the child's side."""
    from ...converters.npz import load_npz

    arrays = load_npz(folder / _JOB)
    job = json.loads(str(arrays.pop("__job__")))
    guard(parent, job["memory"])
    resource.setrlimit(resource.RLIMIT_CPU, (job["seconds"], job["seconds"] + 1))
    try:
        result = TASKS[job["task"]](arrays, **job["options"])
        np.savez(folder / "partial.npz", **result)  # type: ignore
    except Exception as error:  # told to the parent, who decides
        traceback.print_exc()
        (folder / _FAILURE).write_text(f"{type(error).__name__}: {error}")
        return 1
    os.replace(folder / "partial.npz", folder / _RESULT)
    return 0


if __name__ == "__main__":
    code = main(Path(sys.argv[1]), int(sys.argv[2]))
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)  # engines and their arrays need not be taken apart
