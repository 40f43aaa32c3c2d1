"""A hammer held by its handle: from the command line, a file and Python, into page and record."""

import json

import numpy as np
import pytest
from autophyx_tet.converters.mesh.meshdata import write_mesh
from autophyx_tet.fem.errors import UsageError
from autophyx_tet.toolkit.cli.main import main
from autophyx_tet.toolkit.simulation.simulate import simulate

from ..fem.bodies import hammer

SAID = ("--fix", "part:handle", "--load", "part:head=0,0,-10")


@pytest.fixture(scope="module")
def hammer_msh(tmp_path_factory):
    path = tmp_path_factory.mktemp("hammer") / "hammer.msh"
    write_mesh(path, hammer(0.02))
    return path


def test_push_a_hammer_from_the_command_line(hammer_msh, tmp_path, capsys):
    """The supports carry the push and the weight; page and document say both in words."""
    call = ["simulate", str(hammer_msh), *SAID, "-o", str(tmp_path / "push.vtu"), "--order", "1"]
    assert main([*call, "--report", str(tmp_path / "push.html"), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    weight = 9.81 * hammer(0.02).mass
    np.testing.assert_allclose(document["sag"]["reaction"], [0, 0, 10 + weight], atol=1e-5)
    words = [acting["words"] for acting in document["scene"]]
    assert words[0].startswith("part:handle is held in all directions")
    assert words[1].startswith("10.0\u00a0N along -z on part:head")
    page = (tmp_path / "push.html").read_text(encoding="utf-8")
    assert all(said in page for said in words)
    assert "Under the stated loads" in page


def test_a_place_that_is_not_there_is_exit_2_and_one_line(hammer_msh, tmp_path, capsys):
    call = ["simulate", str(hammer_msh), "-o", str(tmp_path / "x.vtu")]
    assert main([*call, "--fix", "part:handl"]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "did you mean 'handle'" in said
    for wrong in (
        ["--gravity", "-9.81"],
        ["--scenario", "poke", "--gravity", "1"],
        ["--scenario", "drop", "--move", "part:head=0,0,1"],
        ["--scenario", "modal", "--load", "part:head=0,0,1"],
        ["--scenario", "poke", "--gravity-dir", "0,0,1"],
    ):
        assert main([*call, *wrong]) == 2, wrong
        assert capsys.readouterr().err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_command_line_file_and_python_are_one(hammer_msh, tmp_path):
    """The same scene three ways: the same displacement, to the last digit."""
    (tmp_path / "push.toml").write_text(
        'fix = ["part:handle"]\ngravity = 0\n[load]\n"part:head" = [0, 0, -10]\n'
    )
    common = {"order": 1}
    by_file = simulate(hammer_msh, scene=tmp_path / "push.toml", **common)
    by_name = simulate(
        hammer_msh, fix="part:handle", load={"part:head": (0, 0, -10)}, gravity=0.0, **common
    )
    np.testing.assert_array_equal(by_file.displacement, by_name.displacement)
    assert by_file.displacement.any()
    with pytest.raises(UsageError, match="no option 'lod'; did you mean 'load'"):
        simulate(hammer_msh, lod=["part:head=0,0,1"])


def test_held_vibrations_are_those_of_the_stated_supports(hammer_msh):
    """Held at one end the first frequency is far below that of a held handle."""
    end = simulate(hammer_msh, scenario="modal", modes=1, fix="plane:x<0", order=1)
    handle = simulate(hammer_msh, scenario="modal", modes=1, fix="part:handle", order=1)
    both = simulate(hammer_msh, fix="plane:x<0", order=1)
    assert end.frequencies[0] < 0.5 * handle.frequencies[0]
    assert both.frequencies  # of the same supports, whatever order they are found with
    assert both.frequencies[0] < 0.5 * handle.frequencies[0]


def test_wood_bends_more_across_its_grain():
    """The handle by its longest axis, as stated along it, and across: softer, and all is said."""
    mesh, rows = hammer(0.02), {"handle": "white oak (along grain)", "head": "steel"}
    scene = {"fix": ["part:head"], "load": {"part:handle": (0, 0, -10)}, "gravity": 0.0}
    known, along, across = (
        simulate(mesh, materials=rows, grain=grain, **scene)
        for grain in ([], ["part:handle=-2,0,0"], ["part:handle=0,1,0"])
    )
    largest = [s.solved.max_displacement for s in (known, along, across)]
    assert largest[0] == pytest.approx(largest[1], rel=1e-3)
    assert largest[2] > 5 * largest[1]  # E across is .07 to .16 of E along
    assert any("the grain is taken along handle (1, " in said for said in known.warnings)
    with pytest.raises(UsageError, match="part:head: 'steel' has no grain"):
        simulate(mesh, materials=rows, grain=["part:head=1,0,0"], **scene)
    with pytest.raises(UsageError, match="wanted part:NAME=x,y,z; parts are handle, head"):
        simulate(mesh, materials=rows, grain=["handle=1,0,0"], **scene)
    with pytest.raises(UsageError, match="springs, particles and reduced bodies know none"):
        simulate(mesh, materials=rows, grain=["part:handle=1,0,0"], scenario="drop", solver="mpm")


def test_a_body_that_is_held_everywhere_is_refused(hammer_msh, tmp_path, capsys):
    """Nothing of it can move: no answer, not one that says that it holds."""
    call = ["simulate", str(hammer_msh), "-o", str(tmp_path / "x.vtu"), "--fix", "all"]
    assert main([*call, "--load", "part:head=0,0,-10"]) == 2
    assert "every point of the body is held" in capsys.readouterr().err


@pytest.mark.slow
def test_a_held_body_does_not_fall(hammer_msh):
    """It is told; its swing, of few frames, is called no impact where it meets nothing."""
    found = simulate(hammer_msh, scenario="drop", fix=["part:handle"], order=1)
    assert any("does not fall" in line for line in found.warnings)
    names = [check.name for check in found.checks()]
    assert "impact" not in names
