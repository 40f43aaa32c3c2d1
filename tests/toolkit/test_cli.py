"""The command line as a user meets it: help, examples, start-up, what is installed."""

import inspect
import json
import re
import shlex
import subprocess
import sys
import time

import autophyx_tet
import numpy as np
import pytest
import tyro
from autophyx_tet.toolkit.cli import terminal as progress
from autophyx_tet.toolkit.cli.main import COMMANDS, main

from .command import run_cli, run_here

HEAVY = {
    "torch", "warp", "open3d", "pymeshlab", "pytetwild", "igl", "trimesh", "meshio", "scipy",
    "numpy", "jinja2",
}  # fmt: skip


@pytest.mark.slow
def test_help_loads_no_heavy_package():
    """Nor does that of any command: one process is asked for all, and has loaded none after it."""
    calls = [[*command, "--help"] for command in ([], *([name] for name in COMMANDS))]
    code = (
        "import sys\nfrom autophyx_tet.toolkit.cli.main import main\n"
        f"for call in {calls}:\n"
        "    try: main(call)\n"
        "    except SystemExit as done: assert done.code == 0\n"
        f"    print('loaded', *sorted({{m.split('.')[0] for m in sys.modules}} & {HEAVY}))"
    )
    call = [sys.executable, "-c", code]
    out = subprocess.run(call, capture_output=True, text=True, check=True).stdout
    assert out.count("usage: ") == len(calls)
    loaded = dict(zip(map(" ".join, calls), re.findall(r"^loaded ?(.*)$", out, re.M), strict=True))
    assert not {call: found for call, found in loaded.items() if found}


# The verbs that the design of the product promises, and no others.
VERBS = (
    "run", "convert", "assign", "segment", "simulate", "transfer", "export", "features", "info",
    "materials", "doctor", "dataset", "train", "evaluate", "batch", "reduce", "match", "view",
    "film",
)  # fmt: skip


def test_help_names_every_verb_and_every_exit_code():
    text = run_cli("--help").stdout
    listed = re.search(r"\{([\w,\s]+)\}", text)[1]
    assert set(re.findall(r"\w+", listed)) == set(VERBS)
    words = " ".join(text.split())
    for code in (0, 1, 2, 3, 4, 5, 6, 130):
        assert re.search(rf"\b{code} [a-zE]", words), code
    assert "--tyro-print-completion" in words


SCREEN = 52  # lines of a terminal on a laptop


@pytest.mark.slow
def test_help_fits_two_screens_and_says_where_the_rest_is():
    """Rare options are left out of --help; --help-all has every one; neither shows a None."""
    for name in COMMANDS:
        brief, whole = (run_here(name, words) for words in ("--help", "--help-all"))
        assert brief.returncode == whole.returncode == 0, name
        assert len(brief.stdout.splitlines()) <= 2 * SCREEN, name
        assert "--help-all" in brief.stdout, name
        shown, every = (set(re.findall(r"--[a-z][\w-]+", h.stdout)) for h in (brief, whole))
        assert shown - {"--help-all"} <= every, name
        assert not re.search(r"\{None|options options|--no-no", whole.stdout), name


def test_a_rare_option_is_an_option():
    """What --help leaves out is read as before."""
    done = run_here(
        "convert", "a.obj", "-o", "a.msh", "--seed", "3", "--no-cache", "--print-config"
    )
    assert "seed = 3" in done.stdout
    assert "no_cache = true" in done.stdout


@pytest.mark.slow
def test_did_you_mean():
    rows = (
        (["converts", "a.obj"], "did you mean convert?"),
        (["frobnicate"], "there are convert"),
        (["convert", "a.obj", "-o", "a.msh", "--sizes", "3"], "--size"),
    )
    for arguments, words in rows:
        done = run_cli(*arguments)
        assert done.returncode == 2, arguments
        assert words in done.stderr + done.stdout, arguments


@pytest.mark.slow
def test_the_examples_of_the_help_parse():
    """Every command shows at least one call of itself, and its words are options of its own."""
    for name, command in COMMANDS.items():
        words = " ".join(inspect.getdoc(command).split())
        calls = re.findall(rf"autophyx-tet {name} [^;]+", words)
        assert calls, name
        for call in calls:
            tyro.cli(command, args=shlex.split(call)[2:])


def test_a_reader_that_goes_away_is_no_error():
    """`--help | head -1`: the rest is not written, and nothing is said about it."""
    command = f'"{sys.executable}" -m autophyx_tet --help | head -n 1'
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, check=True)
    assert (len(done.stdout.splitlines()), done.stderr) == (1, "")


def test_the_version_is_told(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"autophyx-tet {autophyx_tet.__version__}\n"


def test_the_package_is_a_program():
    command = [sys.executable, "-m", "autophyx_tet", "materials", "blarg"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == run_cli("materials", "blarg").returncode != 0


@pytest.mark.slow
def test_completion_knows_the_verbs():
    for shell in ("bash", "zsh"):
        script = run_cli("--tyro-print-completion", shell).stdout
        assert all(verb in script for verb in VERBS), shell


def test_doctor_lists_what_the_package_requires(capsys):
    """Every requirement of the package is told with its version, and a device, weights, caches."""
    assert main(["doctor", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["libraries"]["numpy"] == np.__version__
    assert {"batch", "openclip", "usd"} <= set(document["extras"])
    assert document["devices"][0]["name"] == "cpu"
    # The smallest is a head of 58 kB; what stands for a file that was not fetched is under 1 kB.
    assert all(file["bytes"] > 1e4 for file in document["weights"])
    assert "kernels" in {cache["name"] for cache in document["caches"]}


def test_a_log_hears_of_the_work_now_and_then(monkeypatch, capsys):
    """Where stderr is no terminal the stage is a line now and then; a short call is silent."""
    monkeypatch.setattr(progress, "FIRST", 0.05)
    monkeypatch.setattr(progress, "AGAIN", 60.0)
    with progress.progress() as tell:
        tell("wind: frame 3 of 125, 40 s left", 1.0)
        time.sleep(0.3)
    assert re.fullmatch(r"wind: frame 3 of 125, 40 s left \.\.\. 0 s\n", capsys.readouterr().err)
    with progress.progress(quiet=True) as tell:
        assert tell is None
