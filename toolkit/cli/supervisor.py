"""The command under a supervisor: a small process that ends it within two seconds of Ctrl-C.

Native code may keep the interpreter for many seconds, and some of it swallows an interrupt. So the
command runs in a forked child. The parent only waits for signals: it passes an interrupt on, kills
a child that does not end in time, and removes what it left. All that is temporary lies in one
folder, locked while the command lives; folders of commands that were killed together with their
supervisor are removed by the next one.
"""

from __future__ import annotations

import atexit
import gc
import os
import signal
import sys
from contextlib import suppress
from typing import NoReturn

# What a child gets, so many seconds after we were told to stop: native code may swallow the first.
MEANS = ((0.0, signal.SIGINT), (0.6, signal.SIGINT), (1.2, signal.SIGKILL))
POLL, PATIENCE = 0.02, 3600.0  # s between two looks at a child: one that shall end, one at work
ABANDONED = 60.0  # s after which a folder without a lock has no owner; a new one is locked at once
GARBAGE = 50_000  # new objects between two searches for cycles: imports alone make 170,000
BY_SIGNAL = 128  # what shells add to the number of a signal
UNWRITTEN = 3  # the exit code of an output that cannot be written
STOPPING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
PREFIX, LIST = "autophyx-tet-command-", "unfinished.txt"


def main() -> int:
    """Run the command of this process's arguments and return its exit code."""
    # What a shell or nohup told us to ignore stays ignored.
    watched = {s for s in STOPPING if signal.getsignal(s) is not signal.SIG_IGN} | {signal.SIGCHLD}
    signal.pthread_sigmask(signal.SIG_BLOCK, watched)
    folder, parent = _scratch(), os.getpid()
    child = os.fork()
    if not child:
        _command(parent, folder, watched)
    try:
        return _watch(child, watched)
    finally:
        _clear(folder)


def _command(parent: int, folder: str, watched: set[signal.Signals]) -> NoReturn:
    """The child's side: the command, with its temporary files in ``folder``; dies with the parent.

    It ends at once: to take its memory apart first takes half a second.
    """
    interrupted = BY_SIGNAL + signal.SIGINT
    try:
        import tempfile

        from ...converters.files import UNFINISHED_LIST
        from ..asset.guard import die_with, on_interrupt

        if signal.SIGINT in watched:
            signal.signal(signal.SIGINT, on_interrupt)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, watched)
        die_with(parent)
        if folder:
            os.environ["TMPDIR"] = tempfile.tempdir = folder
            os.environ[UNFINISHED_LIST] = os.path.join(folder, LIST)
        gc.set_threshold(GARBAGE)
        # Matrices of numpy are small here: a second thread only waits for them, in a busy loop
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        from .main import main as command

        code = command()
    except KeyboardInterrupt:  # before the command could answer it
        _say("interrupted; nothing half-written was left")
        code = interrupted
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        if code != interrupted:  # whose time is short
            atexit._run_exitfuncs()
        sys.stdout.flush()
        sys.stderr.flush()
    except BrokenPipeError:
        code = code or BY_SIGNAL + signal.SIGPIPE
    except OSError as error:
        _say(f"the output could not be written: {error}")
        code = code or UNWRITTEN
    os._exit(code)


def _watch(child: int, watched: set[signal.Signals]) -> int:
    """Wait for the end of the child, which comes soon after the first signal to stop.

    Returns the exit code for the shell; a child that was killed could not say so itself.
    """
    from time import monotonic

    stop, since, left = None, 0.0, list(MEANS)
    while not (end := os.waitpid(child, os.WNOHANG))[0]:
        heard = signal.sigtimedwait(watched, PATIENCE if stop is None else POLL)
        if stop is None and heard is not None and heard.si_signo in STOPPING:
            stop, since = signal.Signals(heard.si_signo), monotonic()
        while stop is not None and left and monotonic() - since >= left[0][0]:
            os.kill(child, left.pop(0)[1])
    code = os.waitstatus_to_exitcode(end[1])
    if stop is None and code < 0:
        killed = signal.Signals(-code)
        why = ", perhaps for want of memory" if killed == signal.SIGKILL else ": a bug, report it"
        _say(f"killed by {killed.name}{why}; nothing half-written was left")
        return BY_SIGNAL + killed
    if stop is None or code == 0:  # it had finished
        return code
    if code < 0:
        _say("interrupted; nothing half-written was left")
    return BY_SIGNAL + stop


def _say(words: str) -> None:
    sys.stderr.write(f"autophyx-tet: {words}\n")


def _scratch() -> str:
    """Return a new folder, locked until the last of our processes ends; "" for want of room."""
    import tempfile
    import time

    with suppress(OSError):
        folder = tempfile.mkdtemp(prefix=PREFIX)
        _lock(folder)
        for other in os.scandir(tempfile.gettempdir()):
            if not other.name.startswith(PREFIX):
                continue
            with suppress(OSError):  # another one's, or removed meanwhile
                known = other.stat(follow_symlinks=False)
                old = time.time() - known.st_mtime > ABANDONED
                if old and known.st_uid == os.getuid() and other.is_dir() and _lock(other.path):
                    _clear(other.path)
        return folder
    return ""


def _lock(folder: str) -> bool:
    """Hold a folder as long as this process and its child live, unless others hold it."""
    import fcntl

    handle = os.open(folder, os.O_RDONLY | os.O_CLOEXEC)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(handle)
        return False
    return True


def _clear(folder: str) -> None:
    """Remove the folder, and the unfinished outputs that its list names."""
    import shutil

    from ...converters.files import discard

    with suppress(OSError), open(os.path.join(folder, LIST), encoding="utf-8") as names:
        for name in reversed(names.read().splitlines()):
            discard(name)
    if folder:
        shutil.rmtree(folder, ignore_errors=True)
