"""Progress on stderr while the engine works; silent where stderr is not a terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..batch.task import Outcome


@contextmanager
def progress(*, quiet: bool = False) -> Iterator[Callable[[str, float], None] | None]:
    """Give a callback for (stage, seconds), or None where nobody would see it."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console

    with Console(stderr=True).status("loading") as status:
        yield lambda stage, seconds: status.update(f"{stage} … {seconds:.0f} s")


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
