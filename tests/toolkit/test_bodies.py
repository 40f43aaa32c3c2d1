"""Two bodies and obstacles in one scene: from the command line, a file and Python."""

import json
import sys
from dataclasses import replace

import numpy as np
import pytest
from autophyx_tet.converters.mesh.meshdata import write_mesh
from autophyx_tet.fem.errors import InputError, UsageError
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.fem.solve.self_contact import ipc_toolkit
from autophyx_tet.toolkit.cli.main import main
from autophyx_tet.toolkit.options import SimulateOptions
from autophyx_tet.toolkit.simulation.scenario import changed_options, conditions_of_options
from autophyx_tet.toolkit.simulation.simulate import simulate
from autophyx_tet.toolkit.verdict.checks import contact_forces
from autophyx_tet.toolkit.verdict.description import marks

from ..fem.bodies import with_uniform

RUBBER = {"E": 3e4, "nu": 0.3, "rho": 1000.0}


@pytest.fixture(scope="module")
def cube_msh(tmp_path_factory):
    path = tmp_path_factory.mktemp("bodies") / "cube.msh"
    write_mesh(path, with_uniform(box_mesh((0.1, 0.1, 0.1), (1, 1, 1)), **RUBBER))
    return path


def conditions(given):
    """What a scene is made of, as the options state it or a file does."""
    return conditions_of_options(changed_options(SimulateOptions(), given))


@pytest.mark.slow
def test_a_body_falls_on_another(cube_msh, tmp_path, capsys):
    """Command line, file and Python are one; forces of pieces are told by name, and opposite."""
    call = ["simulate", str(cube_msh), "--scenario", "drop", "--drop-height", "0.001"]
    call += ["--body", f"{cube_msh}=0.01,0,0.101", "--order", "1"]
    out = ["-o", str(tmp_path / "x.vtu"), "--report", str(tmp_path / "x.html"), "--json"]
    assert main([*call, *out]) == 0
    document = json.loads(capsys.readouterr().out)
    assert [part["name"] for part in document["regions"]] == ["body", "body 2"]
    first, second = document["motion"]["piece_forces"]
    assert (first["on"], first["by"]) == ("body", "body 2")
    assert (second["on"], second["by"]) == ("body 2", "body")
    assert np.linalg.norm(first["last"]) == pytest.approx(np.linalg.norm(second["last"]))
    verdicts = document["motion"]["verdicts"]
    assert any("an obstacle or itself" in verdict["sentence"] for verdict in verdicts)
    # Its steps do not resolve how they land: no force of the ground is vouched for
    (contact,) = (verdict for verdict in verdicts if verdict["detail"] == "contact")
    assert document["motion"]["impact"]["unresolved"]
    assert document["motion"]["max_contact_force"] is None
    assert first["largest"] is second["largest"] is document["motion"]["max_own_pressure"] is None
    assert contact["outcome"] == "not made"
    (tmp_path / "two.toml").write_text(f'[body]\n"{cube_msh}" = [0.01, 0, 0.101]\n')
    known = {"scenario": "drop", "drop_height": 0.001, "order": 1}
    in_words = {"body": {str(cube_msh): (0.01, 0, 0.101)}}
    stated = (conditions({"scene": tmp_path / "two.toml"}), conditions(in_words))
    assert stated[0] == stated[1]
    by_name = simulate(cube_msh, **in_words, **known)
    assert len(by_name.mesh.points) == 16
    # Where it was resolved they are told
    followed = by_name.motion.impact._replace(lost=0.0, barrier=0.0, rough=0.0)
    resolved = replace(by_name, motion=replace(by_name.motion, impact=followed))
    largest = resolved.numbers["piece_forces"][0]["largest"]
    assert largest > 9.81
    assert resolved.numbers["max_own_pressure"] > 9.81 / 0.01  # of the area where they meet
    said = contact_forces(resolved.motion, ("body", "body 2")).sentence
    assert f"body 2 on body with {largest:.3g} N" in said


@pytest.mark.slow
def test_an_obstacle_stops_a_fall(cube_msh, tmp_path, capsys):
    """A ball under the cube's middle, in words: the cube meets it before the ground."""
    ball = "sphere:0.05,0.05,-0.022,0.02"
    (tmp_path / "ball.toml").write_text(f'obstacle = ["{ball}"]\n')
    known = {"scenario": "drop", "drop_height": 0.01, "order": 1, "self_contact": False}
    stated = (conditions({"scene": tmp_path / "ball.toml"}), conditions({"obstacle": [ball]}))
    assert stated[0] == stated[1]
    by_name = simulate(cube_msh, obstacle=[ball], **known)
    assert not any("itself" in verdict.sentence for verdict in by_name.verdicts())  # not looked at
    # Its steps do not resolve the impact: forces of frames are told as found, the largest is not
    ground, force = np.max(by_name.numbers["obstacle_forces"], axis=0)
    assert force > 9.81 > ground
    assert by_name.numbers["impact"]["unresolved"]
    assert by_name.numbers["max_obstacle_forces"] is None
    (contact,) = (verdict for verdict in by_name.verdicts() if verdict.detail == "contact")
    assert contact.outcome == "not made"
    assert by_name.numbers["max_obstacle_pressures"] is None
    outlines = marks(by_name.scene).outlines.reshape(-1, 2, 3)
    ball = outlines[4:].reshape(-1, 3)  # behind the square of the ground
    np.testing.assert_allclose(np.linalg.norm(ball - [0.05, 0.05, -0.022], axis=1), 0.02)
    np.testing.assert_allclose(outlines[:4, :, 2], -0.01)
    assert any(line["words"].startswith("a ball of radius") for line in by_name.document()["scene"])


def test_wrong_bodies_and_obstacles_are_one_line(cube_msh, tmp_path, capsys):
    call = ["simulate", str(cube_msh), "-o", str(tmp_path / "x.vtu")]
    drop = ["--scenario", "drop"]
    for status, wrong in (
        (2, [*drop, "--obstacle", "ball:0,0,0,1"]),
        (2, [*drop, "--obstacle", "sphere:0,0,0,-1"]),
        (2, [*drop, "--obstacle", "box:0,0,0,1,1"]),
        (2, ["--obstacle", "plane:z<-1"]),
        (2, ["--body", f"{cube_msh}=0,0,1"]),
        (3, [*drop, "--body", "nowhere.msh=0,0,1"]),
        (2, [*drop, "--body", f"{cube_msh}=0,1"]),
    ):
        assert main([*call, *wrong]) == status, wrong
        assert capsys.readouterr().err.count("\n") == 1
    with pytest.raises(UsageError, match="no obstacle is called 'ball'; wanted plane:z<0"):
        simulate(cube_msh, scenario="drop", obstacle=["ball:0,0,0,1"])
    with pytest.raises(InputError, match="inside an obstacle"):
        simulate(cube_msh, scenario="drop", obstacle=["sphere:0.05,0.05,0,0.02"])


def test_a_missing_toolkit_of_contacts_is_one_line(cube_msh, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "ipctk", None)
    ipc_toolkit.cache_clear()
    call = ["simulate", str(cube_msh), "--scenario", "drop", "-o", str(tmp_path / "x.vtu")]
    assert main(call) == 3
    (line,) = [x for x in capsys.readouterr().err.splitlines() if "ipctk" in x]
    assert "pip install ipctk" in line
    assert "--no-self-contact" in line
    assert not (tmp_path / "x.vtu").exists()
