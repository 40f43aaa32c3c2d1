"""The documentation builds without a warning, and its commands and numbers are the program's."""

import json
import os
import re
import shlex
import subprocess
import sys
from itertools import product

import pytest
import tyro
from _pytest.mark.expression import Expression
from autophyx_tet.toolkit.cli.main import COMMANDS

GROUPS = ("long", "real", "browser", "external")  # that `make test` leaves out, as in conftest.py


@pytest.mark.long
def test_the_site_builds_without_a_warning(site):
    """With every command's help, and none of what fills the pages."""
    page = (site / "cli.html").read_text()
    assert all(f"usage: autophyx-tet {name}" in page for name in COMMANDS)
    assert not list(site.rglob("*.py"))
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


@pytest.mark.blockers
def test_ci_runs_the_commands_of_the_readme_in_their_order(root):
    """`make demo`, then `make test`, as a reader who has just cloned it."""
    block = re.findall(r"```bash\n(.*?)```", (root / "README.md").read_text(), re.DOTALL)[0]
    named = re.findall(r"^make \w+", block, re.MULTILINE)
    called = re.findall(r"\bmake [\w-]+", (root / ".ci" / "run").read_text())
    assert named == ["make demo", "make test"]
    assert called[:2] == named
    assert "make test-all" not in called  # it runs `make test` again


@pytest.mark.blockers
def test_every_test_runs_once_in_ci(root):
    """Of any groups, a test is selected by one of `make test`, `make long` and `make outside`."""
    said = re.findall(r'^(\w+):.*\n(?:\t.*\n)*?\t.*WORKERS\) -m "(.*)"', _makefile(root), re.M)
    parts = [Expression.compile(dict(said)[name]) for name in ("inside", "long", "outside")]
    for marks in product((False, True), repeat=len(GROUPS)):
        wears = dict(zip(GROUPS, marks, strict=True))
        matches = [one.evaluate(lambda name, w=wears: w[name]) for one in parts]
        assert sum(matches) == 1, wears


def _makefile(root):
    return (root / "Makefile").read_text()


@pytest.mark.blockers
@pytest.mark.slow
@pytest.mark.parametrize(
    ("chosen", "code", "said"),
    [
        ("not long and not real and not browser and not external", 0, ""),
        ("not real", 1, "groups that ran no test: ['long', 'browser', 'external']"),
        ("not blockers", 1, "groups that ran no test: ['long', 'real', 'browser', 'external']"),
    ],
)
def test_an_empty_group_fails_where_all_are_required(root, chosen, code, said):
    """Where ``-m`` leaves a group out by name it is not asked for."""
    words = [sys.executable, "-m", "pytest", "-m", chosen]
    words += ["tests/test_docs.py::test_measured_numbers_say_how_and_where"]
    env = {**os.environ, "AUTOPHYX_REQUIRE_ALL": "1"}
    done = subprocess.run(words, cwd=root, env=env, capture_output=True, text=True, timeout=300)
    assert done.returncode == code, done.stderr
    assert said in done.stderr


@pytest.mark.blockers
def test_no_limit_denies_what_a_registry_offers(root):
    """A line "no A, B or C" of `limits.md` names nothing that a method, scenario or class does."""
    from autophyx_tet.fem.mpm.materials import MaterialClass
    from autophyx_tet.fem.solve.method import METHODS, SCENARIOS
    from autophyx_tet.toolkit.options import SimulateOptions

    offered = {*SCENARIOS.names, *METHODS.names, *(one.name.lower() for one in MaterialClass)}
    offered |= vars(SimulateOptions()).keys()
    words = {  # of engineers, for what the registries call otherwise
        "plasticity": "metal", "viscosity": "visplas", "fracture": "tear", "fluids": "fluid",
        "vibrations": "modal", "motions": "dynamics", "damping": "damping",
        "contact of a body with itself": "self_contact",
    }  # fmt: skip
    assert {*words.values()} <= offered
    text = " ".join((root / "docs" / "limits.md").read_text().split())
    denied = " ".join(re.findall(r"\bno \w[\w ,]*", text, re.IGNORECASE)).lower()
    assert [word for word in words if word in denied] == []


@pytest.mark.blockers
def test_the_limit_of_units_names_the_formats_that_state_theirs(root):
    """All suffixes that keep the unit of length, and no other."""
    from autophyx_tet.converters.registry import Keeps
    from autophyx_tet.toolkit.asset.formats import ASSET_FORMATS

    text = (root / "docs" / "limits.md").read_text()
    (said,) = re.findall(r"\* \*\*Units\.\*\*([^;]*) state theirs", text)
    stated = {suffix for suffix in ASSET_FORMATS if Keeps.UNIT in ASSET_FORMATS[suffix].keeps}
    assert {*re.findall(r"`(\.\w+)`", said)} == stated


@pytest.mark.blockers
def test_the_page_of_the_architecture_names_every_method(root):
    """The row of the registry lists all its members."""
    from autophyx_tet.fem.solve.method import METHODS

    lines = (root / "docs" / "architecture.md").read_text().splitlines()
    (row,) = [line for line in lines if "`METHODS`" in line]
    assert {*re.findall(r"`(\w+)`", row)} == {"METHODS", "Scene", *METHODS.names}
