"""Public names for the pages: griffe finds what a face of the package loads on first use.

Griffe reads sources and runs nothing, so that it knows no name that a module finds when asked.
"""

from importlib import import_module
from typing import Any

import griffe

FACES = ("autophyx_tet", *(f"autophyx_tet.{room}" for room in ("fem", "converters", "predictors")))


class PublicNames(griffe.Extension):
    """Every name of a face is an alias of where it is defined."""

    def on_package(self, *, pkg: griffe.Module, **_: Any) -> None:
        """Add the names of all faces to the package that was read."""
        for path in FACES if pkg.path == FACES[0] else ():
            face = pkg[path.removeprefix(f"{pkg.path}.")] if path != pkg.path else pkg
            for name, home in import_module(path)._HOME.items():
                face.set_member(name, griffe.Alias(name, f"{path}.{home}.{name}"))
