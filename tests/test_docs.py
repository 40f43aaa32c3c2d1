"""The documentation builds without a warning, and its commands and numbers are the program's."""

import json
import re
import shlex
import subprocess
import sys

import pytest
import tyro
from autophyx_tet.toolkit.cli.main import COMMANDS


@pytest.mark.slow
def test_the_site_builds_without_a_warning(root, tmp_path):
    """Strict: a dead link, a lost name or a docstring that does not parse is an error."""
    words = [sys.executable, "-m", "mkdocs", "build", "-q", "--strict", "-d", str(tmp_path)]
    done = subprocess.run(words, cwd=root, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr[-3000:]
    page = (tmp_path / "cli.html").read_text()
    assert all(f"usage: autophyx-tet {name}" in page for name in COMMANDS)
    assert not list(tmp_path.rglob("*.py"))
    assert "{{" not in page


def _shell_lines(path):
    """Commands of ours in the code blocks of a page, with continued lines joined."""
    blocks = re.findall(r"```bash\n(.*?)```", path.read_text(), re.DOTALL)
    lines = "\n".join(blocks).replace("\\\n", " ").splitlines()
    return [line.split("#")[0] for line in lines if line.startswith("autophyx-tet ")]


@pytest.mark.parametrize(
    "name", ["README.md", "docs/index.md", "docs/tutorial.md", "docs/programs.md"]
)
def test_commands_of_the_page_exist(root, name):
    """Every command line shown parses: its command and options are the program's own."""
    lines = _shell_lines(root / name)
    assert lines
    for line in lines:
        command, *words = shlex.split(line)[1:]
        tyro.cli(COMMANDS[command], args=words)


@pytest.mark.slow
def test_commands_of_the_gallery_exist(root):
    """Each runs as it is shown: its options are the program's own; its picture is there, small."""
    rows = json.loads((root / "docs" / "data" / "gallery.json").read_text())["rows"]
    pictures = [root / "docs/gallery" / f"{row['asset'].partition('/')[2]}.webp" for row in rows]
    for row in rows:
        tyro.cli(COMMANDS["run"], args=shlex.split(row["command"])[2:])
    assert sum(picture.stat().st_size for picture in pictures) < 1.5e6
    assert {*pictures} == {*(root / "docs/gallery").iterdir()}


def test_laws_of_a_page_have_their_tests(root):
    """What a page names as ``file.py::test_name``, or as ``::test_name`` after it, is there."""
    named = 0
    for page in sorted((root / "docs").glob("*.md")):
        path = None
        for file, test in re.findall(r"`([\w/]*\.py)?::(test_\w+)`", page.read_text()):
            path = root / "tests" / file if file else path
            assert f"def {test}(" in path.read_text(), (page.name, file, test)
            named += 1
    assert named > 15


def test_measured_numbers_say_how_and_where(root):
    """Each file of numbers has its command, its machine and at least one row."""
    files = sorted((root / "docs" / "data").glob("*.json"))
    assert files
    for path in files:
        document = json.loads(path.read_text())
        assert document["command"]
        assert document["machine"]
        assert document["rows"]


def test_figures_of_the_readme_are_those_of_the_data(root):
    """`make figures` would change nothing; real objects stand before procedural ones."""
    words = [sys.executable, ".ci/figures", "--check"]
    done = subprocess.run(words, cwd=root, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    readme = (root / "README.md").read_text()
    assert readme.index("real furniture") < readme.index("*procedural*")


def test_recorded_figures_stand_on_their_pages(root):
    """Each number that is not scored again is in the lines of the page that it names."""
    for row in json.loads((root / "docs" / "data" / "recorded.json").read_text())["rows"]:
        page = " ".join((root / row["page"]).read_text().split())
        assert [line for line in row["says"] if line not in page] == []
        said = set(re.findall(r"\d*\.\d+|\d+", " ".join(row["says"])))
        said = {float(number) for number in said}
        for name, value in row.items():
            if isinstance(value, int | float):
                assert {value, round(100 * value, 3)} & said, (row["name"], name)
