"""Where the kernels run: warp, started once and silently."""

from __future__ import annotations

import contextlib
import ctypes
import functools
import os
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any, Generic, ParamSpec, TypeVar

from .errors import InputError

Parameters = ParamSpec("Parameters")
Answer = TypeVar("Answer")
Value = TypeVar("Value")

# Linux: what a process has mapped, the libraries of warp there that nobody writes to (address
# first and last, offset in the file), and the advice that its pages are not needed.
MAPPED = Path("/proc/self/maps")
_UNWRITTEN = re.compile(r"([0-9a-f]+)-([0-9a-f]+) r-(x|-)p ([0-9a-f]+) .*/warp(?:-clang)?\.so\n")
MADV_DONTNEED = 4


@functools.cache
def start_warp() -> ModuleType:
    """Return warp, initialised without a word; kernels are compiled once and cached on disk."""
    import warp as wp

    if hasattr(wp, "LOG_ERROR"):
        wp.config.log_level = wp.LOG_ERROR
    else:  # older warp
        wp.config.quiet = True
    # Without the process's stderr for a moment: warp's native start-up writes there unasked.
    sys.stderr.flush()
    saved, null = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 2)
        wp.init()
    finally:
        os.dup2(saved, 2)
        os.close(saved)
        os.close(null)
    # Give back some 90 MB of warp's libraries that their start-up alone read: clean pages of code,
    # and of the head of a file. What is needed again comes back from it by itself; other pages that
    # are not written to may have been, while the library was linked.
    if MAPPED.exists():
        advise = ctypes.CDLL(None).madvise
        advise.argtypes = (ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int)
        for low, high, code, offset in _UNWRITTEN.findall(MAPPED.read_text()):
            if code == "x" or int(offset, 16) == 0:
                advise(int(low, 16), int(high, 16) - int(low, 16), MADV_DONTNEED)
    return wp


class Recorder:
    """Records launches of ``size`` threads, so that a replay costs little."""

    def __init__(self, size: int, device: Any) -> None:
        self.size, self.device = size, device

    def __call__(self, kernel: Any, inputs: list, size: int | tuple | None = None) -> Any:
        """Return a launch command of ``kernel``."""
        dim = self.size if size is None else size
        return start_warp().launch(kernel, dim, inputs=inputs, device=self.device, record_cmd=True)


class Replay:
    """Does the same launches of ``work`` again and again: on a GPU as one graph, made at first."""

    def __init__(self, work: Callable[[], None], device: Any) -> None:
        self.work, self.device, self._graph = work, device, None

    def __call__(self) -> None:
        """Do the work once, on the numbers that its arrays have now."""
        if not self.device.is_cuda:
            return self.work()
        if self._graph is None:
            with start_warp().ScopedCapture(device=self.device) as capture:
                self.work()
            self._graph = capture.graph
        start_warp().capture_launch(self._graph)


class Recent(Generic[Value]):
    """The last ``most`` values that were made of the same arrays, told by identity."""

    def __init__(self, most: int) -> None:
        self.most, self.items = most, []

    def get(self, *key: Any) -> Value | None:
        """Value of ``key``, if it was kept: names in it are compared, all else is the same."""
        for kept, value in self.items:
            pairs = zip(kept, key, strict=True)
            if all(a is b or (isinstance(a, str | int) and a == b) for a, b in pairs):
                return value
        return None

    def keep(self, value: Value, *key: Any) -> Value:
        """Keep ``value`` for ``key``, forget the oldest, and return it."""
        self.items.insert(0, (key, value))
        del self.items[self.most :]
        return value


def checked_device(device: str) -> str:
    """Return ``device`` ('cpu', 'cuda' or 'cuda:N') if this machine has it."""
    wp = start_warp()
    known = [d.alias for d in wp.get_devices()]
    if device not in (*known, *(["cuda"] if wp.is_cuda_available() else [])):
        raise InputError("device.device_use", device=device, known=known)
    return device


@functools.cache
def _blas() -> Any:
    import scipy.linalg  # noqa: F401 (brings a BLAS of its own beside numpy's)
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """Context in which BLAS has one thread.

    Vectors this small take longer with more: threads wait for each other, on a busy machine most
    of the time.
    """
    with _blas().limit(limits=1, user_api="blas"):
        yield


def single_threaded(function: Callable[Parameters, Answer]) -> Callable[Parameters, Answer]:
    """Make ``function`` run with ``one_thread``."""
    return one_thread()(function)
