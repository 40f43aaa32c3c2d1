"""Every walkthrough runs from start to end and keeps what it asserts."""

import runpy
from pathlib import Path

import pytest

SOURCES = sorted((Path(__file__).resolve().parent.parent / "notebooks").glob("*.py"))


def test_there_are_notebooks():
    assert SOURCES


@pytest.mark.slow
@pytest.mark.parametrize("source", SOURCES, ids=lambda path: path.stem)
def test_a_notebook_keeps_its_promises(source, tmp_path, monkeypatch):
    """It needs no file but those it makes, and each asserts at least one number."""
    assert "\nassert " in source.read_text()
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(source))
