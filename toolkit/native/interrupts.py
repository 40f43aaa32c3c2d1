"""Interrupts from the keyboard: heard once for each press, and remembered."""

from __future__ import annotations

import signal
import time
from importlib.machinery import ExtensionFileLoader
from types import FrameType

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
