"""The four faces of the package: every public name stands on its page, and says what it takes."""

import re
from importlib import import_module

FACES = ("autophyx_tet", *(f"autophyx_tet.{room}" for room in ("fem", "converters", "predictors")))
NAMES = [(face, name) for face in FACES for name in import_module(face).__all__ if name[0] != "_"]
DEFINED = {f"{face}.{name}": getattr(import_module(face), name) for face, name in NAMES}


def test_the_page_of_python_has_every_public_name_and_no_other(root):
    """By the names that a user types; what two faces share stands there once."""
    page = (root / "docs" / "python.md").read_text()
    shown = re.findall(r"^::: (\S+)$", page, re.MULTILINE)
    assert [name for name in shown if name not in DEFINED] == []
    assert len(shown) == len({*shown})
    there = {id(DEFINED[name]) for name in shown}
    assert [name for name, what in DEFINED.items() if id(what) not in there] == []
