"""The seam of every family: lazy, listed without an import, open to members from outside."""

import sys
from dataclasses import dataclass
from typing import Annotated

import pytest
import tyro
from autophyx_tet.fem.errors import UsageError
from autophyx_tet.fem.registry import Registry
from autophyx_tet.toolkit.options import choice

HOME = {"one": "one:MEMBER", "two": "two:MEMBER"}


@pytest.fixture
def family(tmp_path, monkeypatch):
    package = tmp_path / "toy_family"
    package.mkdir()
    (package / "__init__.py").write_text("")
    for name in HOME:
        (package / f"{name}.py").write_text(f"MEMBER = '{name} loaded'\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    yield Registry[str]("toy", "toy_family", HOME)
    for name in [module for module in sys.modules if module.startswith("toy_family")]:
        del sys.modules[name]


def test_names_are_known_before_anything_is_imported(family):
    assert (family.names, len(family), "two" in family) == (("one", "two"), 2, True)
    assert "toy_family.one" not in sys.modules
    assert family["one"] == "one loaded"
    assert "toy_family.two" not in sys.modules


def test_a_member_from_outside_is_one_of_them(family):
    assert family.register("three", "mine") == "mine"
    assert [*family] == ["one", "two", "three"]
    assert family["three"] == "mine"
    family.unregister("three")
    assert "three" not in family


def test_wrong_names_are_one_clear_line(family):
    with pytest.raises(UsageError, match=r"unknown toy 'tow': known are one, two; did you mean"):
        family["tow"]
    with pytest.raises(UsageError, match="already"):
        family.register("one", "other")
    with pytest.raises(UsageError, match="belongs to the package"):
        family.unregister("one")


def test_a_registry_is_the_choices_of_an_option(family, capsys):
    """The command line names the members in its help and refuses others, with exit code 2."""

    @dataclass(frozen=True)
    class Options:
        toy: Annotated[str, choice(family)] | None = None

    assert tyro.cli(Options, args=["--toy", "two"]) == Options("two")
    assert tyro.cli(Options, args=[]) == Options(None)
    with pytest.raises(SystemExit) as refused:
        tyro.cli(Options, args=["--toy", "tow"])
    assert refused.value.code == 2
    assert "'one'" in capsys.readouterr().err
