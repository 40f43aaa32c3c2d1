"""Progress on stderr while the engine works: a live line, or now and then one for a log."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Thread
from typing import TYPE_CHECKING

from ..options import EXPECTED

if TYPE_CHECKING:
    from ..batch.task import Outcome


# Seconds before the first line of a log, and between two.
FIRST, AGAIN = 30.0, 30.0


@contextmanager
def progress(*, quiet: bool = False) -> Iterator[Callable[[str, float], None] | None]:
    """Give a callback for (stage, seconds), or None where nobody would see it."""
    if quiet:
        yield None
        return
    if not sys.stderr.isatty():
        with _logged() as tell:
            yield tell
        return
    from rich.console import Console

    console = Console(stderr=True)
    with console.status("loading") as status:

        def show(stage: str, seconds: float, /) -> None:
            if stage.startswith(EXPECTED):
                console.print(stage, markup=False, highlight=False)
            status.update(f"{stage} … {seconds:.0f} s")

        yield show


@contextmanager
def _logged() -> Iterator[Callable[[str, float], None]]:
    """Write the stage that was heard of last, however rarely one is."""
    began, done, stage = time.monotonic(), Event(), "loading"

    def tell(heard: str, _: float) -> None:
        nonlocal stage
        stage = heard
        if heard.startswith(EXPECTED):
            sys.stderr.write(f"{heard}\n")
            sys.stderr.flush()

    def write() -> None:
        pause = FIRST
        while not done.wait(pause):
            sys.stderr.write(f"{stage} ... {time.monotonic() - began:.0f} s\n")
            sys.stderr.flush()
            pause = AGAIN

    writer = Thread(target=write, daemon=True)
    writer.start()
    try:
        yield tell
    finally:
        done.set()
        writer.join()


@contextmanager
def counted(*, quiet: bool = False) -> Iterator[Callable[[Outcome, int, int], None] | None]:
    """Give a callback for (outcome, rows done, rows in all): a bar with the time left."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    with Progress(*columns, TimeRemainingColumn(), console=Console(stderr=True)) as bar:
        row = bar.add_task("assets", total=None)

        def tell(outcome: Outcome, done: int, total: int) -> None:
            if outcome.code:
                bar.console.print(f"{outcome.id}: {outcome.reason}", style="yellow", markup=False)
            bar.update(row, completed=done, total=total)

        yield tell
