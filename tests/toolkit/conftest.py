"""What the tests of several files share: a browser and a folder for its pages, a cube."""

import shutil

import pytest
import trimesh
from autophyx_tet.toolkit.cli.main import main

from .browser import FLAGS


@pytest.fixture(scope="module")
def chromium():
    playwright = pytest.importorskip("playwright.sync_api")
    program = shutil.which("chromium") or shutil.which("google-chrome")
    if program is None:
        pytest.skip("no Chromium on this machine")
    with playwright.sync_playwright() as play:
        browser = play.chromium.launch(executable_path=program, args=list(FLAGS))
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("reports with spaces")


@pytest.fixture
def cube(tmp_path):
    path = tmp_path / "cube.obj"
    trimesh.creation.box((0.1, 0.1, 0.1)).export(path)
    return path


@pytest.fixture(scope="session")
def cube_msh(tmp_path_factory):
    """A converted cube, 10 cm, made once."""
    folder = tmp_path_factory.mktemp("cube")
    trimesh.creation.box((0.1, 0.1, 0.1)).export(folder / "cube.obj")
    target = folder / "cube.msh"
    assert main(["convert", str(folder / "cube.obj"), "-o", str(target), "-q"]) == 0
    return target
