"""Every code block and every command of README and docs is run, or named here with the reason."""

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

from .assets import write_all

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
PAGES += sorted((ROOT / "predictors/weights").glob("*.md"))
ITSELF = "is what .ci/run does"
HOURS = "takes from half an hour to hours; docs/data or weights/ keep what it wrote"
GPU = "wants a GPU; the card has the same line shortened for a CPU"
SHORTER = "takes minutes; the card has the same line with two objects"
TRAINS = "trains a network a row: minutes, and the rows above it go the same way"
FURNITURE = "wants Debian's furniture, which is a download of 120 MB, and minutes"
# What no test runs: a line as it stands on the page, and why.
ELSEWHERE = {
    "make demo": ITSELF,
    "make check": ITSELF,
    "make test": ITSELF,
    "make long": ITSELF,
    "make test-all": ITSELF,
    "make newest": ITSELF,
    "make notebooks": "is what tests/test_notebooks.py does, source by source",
    "make docs": "is what tests/test_docs.py does",
    "source .venv/bin/activate": "the runner has its own path to the program",
    "autophyx-tet dataset audit -o audit --objects 100": HOURS,
    "autophyx-tet dataset audit -o audit": HOURS,
    "autophyx-tet dataset audit -o audit --resume": HOURS,
    "autophyx-tet train ablation-concat --data data -o run": HOURS,
    "autophyx-tet train shipped-told --start ...": HOURS,
    "autophyx-tet evaluate --split validation --objects 80 --texts 5 --predictors film-assigned "
    "table-mean": HOURS,
    "autophyx-tet evaluate --split validation --objects 80 --renders 80 --swing --predictors "
    "film-assigned table-first": HOURS,
    "autophyx-tet evaluate --split validation --objects 80 --renders 80 --swing --texts 5    "
    "--predictors film film-assigned table-mean table-first retrieval constant": HOURS,
    "autophyx-tet evaluate --split merged --objects 90 --texts 2 --predictors film-voxels": HOURS,
    "autophyx-tet evaluate --split merged --objects 90 --texts 2 --predictors film-assigned": HOURS,
    "autophyx-tet evaluate --split procedural --predictors film-voxels --objects 96": HOURS,
    "autophyx-tet evaluate --split validation --objects 80 --encoder embedded --renders 80 "
    "--predictors film film-names table-mean": HOURS,
    "autophyx-tet train tagger": HOURS,
    "autophyx-tet train phrases -o run": "takes minutes; tests/predictors/language/test_phrases.py "
    "has a shorter run",
    "autophyx-tet train tagger -o run": HOURS,
    "autophyx-tet train one-piece -o run": "takes minutes; tests/predictors/test_owners.py has a "
    "shorter run",
    "autophyx-tet dataset regions -o data && autophyx-tet train regions --data data -o run": HOURS,
    "autophyx-tet evaluate --split natural": FURNITURE,
    "autophyx-tet dataset build -o data": FURNITURE,
    "autophyx-tet train kinds --data data -o run": FURNITURE,
    "autophyx-tet evaluate --split validation --objects 80 --predictors unipixie unipixie-names "
    "constant table-mean": FURNITURE,
    "autophyx-tet evaluate --split validation --objects 10 --renders 10 --swing    --predictors "
    "film-names unipixie-names constant table-mean table-first retrieval": FURNITURE,
    "autophyx-tet evaluate --table S7 --data data --device cuda --minutes 2.8": GPU,
    "autophyx-tet evaluate --table S3 --data data --device cuda --minutes .45": GPU,
    "autophyx-tet evaluate --table theta --data data --device cuda --minutes 2.2": GPU,
    "autophyx-tet evaluate --table S5 --data data --objects 32": SHORTER,
    "autophyx-tet evaluate --table springs --data data --objects 40": SHORTER,
    "autophyx-tet evaluate --table S7 --data data --objects 2": TRAINS,
    "autophyx-tet evaluate --table theta --data data --objects 2": TRAINS,
    "autophyx-tet dataset ranges": "takes a name of a table to write",
    "autophyx-tet materials QUERY": "QUERY is for a word of the reader's",
    "autophyx-tet transfer": "a verb's name",
}
SECONDS = 1200  # of one block, where much else runs beside it
SHELL, PROGRAM, FILES = ("bash",), ("python",), ("toml", "csv")


class Block(NamedTuple):
    """A fenced block: its language, its title and its text."""

    language: str
    title: str
    text: str


def blocks_of(page):
    """Fenced blocks, in order, and commands of ours inside sentences as blocks of one line."""
    fence = r'^ *```(\w*)(?: title="([^"]*)")?\n(.*?)^ *```|`(autophyx-tet [^`]+)`'
    found = re.finditer(fence, page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    return [Block("bash", "", m[4]) if m[4] else Block(m[1], m[2] or "", m[3]) for m in found]


def lines_of(block):
    """Commands of a shell block without their comments, continued lines joined."""
    lines = block.text.replace("\\\n", " ").splitlines()
    return [line.split(" #")[0].strip() for line in lines if line.strip()]


BLOCKS = {page: blocks for page in PAGES if (blocks := blocks_of(page))}


def test_every_block_can_be_run():
    """Each has a language that the runner knows, files have a name; nothing is excused in vain."""
    excused = set()
    for page, blocks in BLOCKS.items():
        for block in blocks:
            assert block.language in (*SHELL, *PROGRAM, *FILES), f"{page}: {block}"
            assert (block.language in FILES) == bool(block.title), f"{page}: {block}"
            excused |= {*lines_of(block)} & {*ELSEWHERE} if block.language in SHELL else set()
    assert excused == {*ELSEWHERE}


@pytest.fixture(scope="module")
def shell(tmp_path_factory):
    """A reader's environment: ``autophyx-tet`` on the path, a home of their own."""
    home = tmp_path_factory.mktemp("home")
    command = home / "autophyx-tet"
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m autophyx_tet "$@"\n')
    command.chmod(0o755)
    path = f"{home}:{Path(sys.executable).parent}:{os.environ['PATH']}"
    return {**os.environ, "HOME": str(home), "PATH": path}


def with_marks(page):
    """A page whose blocks want Debian's furniture or another program goes with their tests."""
    words = page.read_text(encoding="utf-8")
    wanted = {"apx.catalog(": pytest.mark.real, "import newton": pytest.mark.external}
    marks = [mark for text, mark in wanted.items() if text in words]
    return pytest.param(page, id=page.relative_to(ROOT).as_posix(), marks=marks)


@pytest.mark.long
@pytest.mark.parametrize("page", [*map(with_marks, BLOCKS)])
def test_what_the_page_says_runs(page, shell, tmp_path):
    """From top to bottom in one folder, as a reader would who has the assets that it names."""
    write_all(tmp_path)
    for block in BLOCKS[page]:
        if block.language in FILES:
            (tmp_path / block.title).write_text(block.text)
            continue
        words = [sys.executable, "-c", block.text]
        if block.language in SHELL:
            todo = [line for line in lines_of(block) if line not in ELSEWHERE]
            words = ["bash", "-euxc", "\n".join(todo)]
        done = subprocess.run(
            words, cwd=tmp_path, env=shell, capture_output=True, text=True, timeout=SECONDS
        )
        assert done.returncode == 0, f"{block.text}\n{done.stderr[-3000:]}"
