"""Old names of options and attributes: they keep working, and say once what they are now."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable
from typing import ParamSpec, TypeVar

Parameters = ParamSpec("Parameters")
Answer = TypeVar("Answer")

_said: set[tuple[str, str]] = set()


def say_renamed(where: str, old: str, new: str) -> None:
    """Warn once a process that ``old`` of ``where`` is now called ``new``."""
    if (where, old) in _said:
        return
    _said.add((where, old))
    warnings.warn(f"{where}: {old!r} is now called {new!r}", DeprecationWarning, stacklevel=3)


def renamed_options(
    **names: str,
) -> Callable[[Callable[Parameters, Answer]], Callable[Parameters, Answer]]:
    """Let a function take options by their old names too: ``renamed_options(old="new")``."""

    def decorated(function: Callable[Parameters, Answer]) -> Callable[Parameters, Answer]:
        @functools.wraps(function)
        def wrapped(*args: Parameters.args, **options: Parameters.kwargs) -> Answer:
            for old in names.keys() & options.keys():
                say_renamed(function.__qualname__, old, names[old])
                options[names[old]] = options.pop(old)
            return function(*args, **options)

        return wrapped

    return decorated
