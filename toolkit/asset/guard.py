"""A process behind a guard: it dies with its parent, takes no more memory than it was given.

``python -m autophyx_tet.toolkit.asset.guard PARENT BYTES MODULE ...`` runs a module in that way.
Interrupts from the keyboard are heard once for each press, and remembered.
"""

from __future__ import annotations

import ctypes
import os
import resource
import runpy
import signal
import sys
import time
from importlib.machinery import ExtensionFileLoader
from types import FrameType

PR_SET_PDEATHSIG = 1  # linux/prctl.h: the signal this process gets when its parent dies


def guarded(module: str, *arguments: str, memory: int) -> list[str]:
    """Words of the command that runs a module as a guarded child of this process.

    ``memory`` is its limit of address space [bytes]. Nothing is imported from the folder in which
    it runs (``-P``).
    """
    here = [sys.executable, "-P", "-m", __name__, str(os.getpid()), str(memory)]
    return [*here, module, *arguments]


def guard(parent: int, memory: int) -> None:
    """Limit this process's address space to ``memory`` [bytes]; let it die with its parent."""
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    die_with(parent)


def die_with(parent: int) -> None:
    """Let this process be killed when its parent dies, or at once if it did already."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # before the line above took effect
        os._exit(1)


def main(words: list[str]) -> None:
    """The process's own side: limits first, then the module as ``python -m`` would run it."""
    parent, memory, module, *arguments = words
    guard(int(parent), int(memory))
    sys.argv[1:] = arguments
    runpy.run_module(module, run_name="__main__", alter_sys=True)


# Interrupts from the keyboard: heard once for each press, and remembered.

LATER = 0.02  # s after which an interrupt comes again that came too soon
ONE_PRESS = 0.4  # s in which interrupts are one: the terminal tells the child as well as we do
_pressed: list[float] = []  # times [s] of interrupts in this process


def on_interrupt(_: int = signal.SIGINT, frame: FrameType | None = None) -> None:
    """Raise KeyboardInterrupt once for each press of the keys: a handler of signals.

    Not while an extension is being loaded: some end the process where Python raises within.
    """
    if _loads_extension(frame):
        signal.signal(signal.SIGALRM, on_interrupt)
        signal.setitimer(signal.ITIMER_REAL, LATER)
        return
    _pressed.append(time.monotonic())
    if len(_pressed) == 1 or _pressed[-1] - _pressed[-2] >= ONE_PRESS:
        raise KeyboardInterrupt


def was_interrupted() -> bool:
    """Whether the keys were pressed: what an import makes of the interrupt is no bug of ours."""
    return bool(_pressed)


def _loads_extension(frame: FrameType | None) -> bool:
    """Whether a frame runs within the loading of a module of machine code."""
    while frame is not None:
        if isinstance(frame.f_locals.get("self"), ExtensionFileLoader):
            return True
        frame = frame.f_back
    return False


if __name__ == "__main__":
    main(sys.argv[1:])
