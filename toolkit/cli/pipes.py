"""A dash in place of a mesh: read it from stdin, write it to stdout, as .msh."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from ...fem.errors import UsageError

DASH = Path("-")
_INPUTS = ("mesh", "file")  # what commands call a mesh that they read
_WRITERS = ("ConvertCommand", "AssignCommand")


def writes_to_stdout(command: Any) -> bool:
    """Whether the result goes to stdout, where nothing else may be told then."""
    return getattr(command, "output", None) == DASH


@contextmanager
def piped(command: Any) -> Iterator[Any]:
    """Give the command with files in the places of dashes; what it wrote goes to stdout at its end.

    Raises
    ------
    UsageError
        Where stdout has two things to hold, or what goes there is no mesh.
    """
    reads = [name for name in _INPUTS if getattr(command, name, None) == DASH]
    writes = writes_to_stdout(command)
    if not reads and not writes:
        yield command
        return
    if writes and (command.common.json or type(command).__name__ not in _WRITERS):
        raise UsageError("-o -: stdout takes a mesh of `convert` or `assign`, without --json")
    with TemporaryDirectory() as folder:
        files = {"output": Path(folder) / "stdout.msh"} if writes else {}
        for name in reads:
            files[name] = Path(folder) / "stdin.msh"
            files[name].write_bytes(sys.stdin.buffer.read())
        yield replace(command, **files)
        if writes:
            sys.stdout.buffer.write(files["output"].read_bytes())
            sys.stdout.flush()
