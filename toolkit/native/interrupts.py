"""Interrupts from the keyboard: heard once for each press, and remembered."""

from __future__ import annotations

import time

ONE_PRESS = 0.4  # s in which interrupts are one: the terminal tells the child as well as we do
_pressed: list[float] = []  # times [s] of interrupts in this process


def on_interrupt(*_: object) -> None:
    """Raise KeyboardInterrupt once for each press of the keys: a handler of signals."""
    _pressed.append(time.monotonic())
    if len(_pressed) == 1 or _pressed[-1] - _pressed[-2] >= ONE_PRESS:
        raise KeyboardInterrupt


def was_interrupted() -> bool:
    """Whether the keys were pressed: what an import makes of the interrupt is no bug of ours."""
    return bool(_pressed)
