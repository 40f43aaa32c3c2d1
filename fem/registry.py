"""A family of interchangeable members by name: predictors, laws, methods, formats, encoders.

A seam of this house is a protocol and a registry of it. What there is can be listed (choices of
the command line, tables of the docs, parametrised tests) without importing any of it, and a new
member is one file and one line, or a call of ``register`` from outside.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from typing import Any, TypeVar

from .errors import UsageError
from .note import Note

T = TypeVar("T")


class Registry(Mapping[str, T]):
    """Members of one ``kind`` by name, each imported on first use.

    kind: What a member is called in messages: "predictor".
    package: Package that the modules of ``members`` are relative to.
    members: Name -> "module:attribute".
    """

    def __init__(self, kind: str, package: str, members: Mapping[str, str]) -> None:
        self.kind, self._package = kind, package
        self._homes = dict(members)
        self._loaded: dict[str, T] = {}

    @property
    def names(self) -> tuple[str, ...]:
        """All names, in the order in which they were added."""
        return tuple(dict.fromkeys([*self._homes, *self._loaded]))

    def __contains__(self, name: object) -> bool:
        return name in self._homes or name in self._loaded

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)

    def __getitem__(self, name: str) -> T:
        """Return a member; ``UsageError`` with the known names where there is none."""
        if name not in self._loaded:
            if name not in self._homes:
                raise UsageError(self.unknown(name))
            module, _, attribute = self._homes[name].partition(":")
            home = import_module(f".{module}", self._package)
            self._loaded[name] = getattr(home, attribute)
        return self._loaded[name]

    def register(self, name: str, member: T) -> T:
        """Add a member under a free ``name`` and return it; ``UsageError`` where it is taken."""
        if name in self:
            raise UsageError("registry.already_choose", kind=self.kind, name=name)
        self._loaded[name] = member
        return member

    def unregister(self, name: str) -> None:
        """Take out a member that ``register`` added."""
        if name in self._homes:
            raise UsageError("registry.belongs_package", kind=self.kind, name=name)
        self._loaded.pop(name, None)

    def unknown(self, name: str) -> str:
        """Sentence for a name that is not here: what is, and the nearest."""
        near = difflib.get_close_matches(name, self.names, n=1)
        hint = Note("registry.you_mean", near=near[0]) if near else ""
        names = ", ".join(self.names)
        return Note("registry.unknown_known", kind=self.kind, name=name, names=names, hint=hint)


def on_first_use(
    package: str, homes: Mapping[str, str]
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """``__getattr__`` and ``__dir__`` of a package, of public name -> module relative to it."""

    def load(name: str) -> Any:
        if name not in homes:
            raise AttributeError(Note("registry.module_attribute", package=package, name=name))
        return getattr(import_module(f".{homes[name]}", package), name)

    return load, lambda: sorted(homes)
