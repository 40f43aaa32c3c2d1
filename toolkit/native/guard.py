"""A process behind a guard: it dies with its parent and takes no more memory than it was given.

``python -m autophyx_tet.toolkit.native.guard PARENT BYTES MODULE ...`` runs a module in that way.
"""

from __future__ import annotations

import ctypes
import os
import resource
import runpy
import signal
import sys

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


if __name__ == "__main__":
    main(sys.argv[1:])
