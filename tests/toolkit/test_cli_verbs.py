"""The verbs at work: options from files, estimates, values on tets, pictures."""

import json
import tomllib

import numpy as np
import pytest
from autophyx_tet.toolkit.cli.main import main

from .command import run_cli, run_here


def printed(capsys, *arguments):
    assert main([*arguments, "--print-config"]) == 0
    return capsys.readouterr().out


def test_a_printed_configuration_is_read_again(tmp_path, capsys):
    """--config of what --print-config printed gives the same options; the command line wins."""
    given = ["--size", "0.5", "--part", 'a="oak, \\dark"', "--strict", "--scenario", "hang"]
    given += ["--text", "steel", "--text", "a 'soft' foam\ttoo"]
    text = printed(capsys, "run", "a.glb", "-o", "out", *given)
    options = tomllib.loads(text)
    assert (options["size"], options["strict"], options["scenario"]) == (0.5, True, "hang")
    assert options["text"] == ["steel", "a 'soft' foam\ttoo"]
    (tmp_path / "run.toml").write_text(text)
    config = ["--config", str(tmp_path / "run.toml")]
    assert printed(capsys, "run", "b.glb", "-o", "out", *config) == text
    wins = printed(capsys, "run", "b.glb", "-o", "out", *config, "--size", "2")
    assert tomllib.loads(wins) == options | {"size": 2.0}


def test_a_configuration_that_is_none_or_wrong_is_refused(tmp_path):
    (tmp_path / "no.toml").write_text("size = = 3")
    (tmp_path / "unknown.toml").write_text("sizes = 3")
    call = ("convert", "a.obj", "-o", "a.msh", "--config")
    broken = run_here(*call, tmp_path / "no.toml")
    assert broken.returncode == 3
    assert len(broken.stderr.strip().splitlines()) == 1
    unknown = run_here(*call, tmp_path / "unknown.toml")
    assert unknown.returncode == 2
    assert "no option 'sizes': did you mean 'size'?" in unknown.stderr


@pytest.mark.slow
def test_assign_and_simulate_from_files(cube_msh, tmp_path):
    """oak cube: table values on every tet; then a sag that scales with 1/E."""
    from autophyx_tet.converters.mesh.meshdata import read_mesh
    from autophyx_tet.fem.table import load_table

    target = tmp_path / "m.msh"
    done = run_cli("assign", cube_msh, "--text", "oak cube", "-o", target, "--json")
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    assert document["schema"] == 1
    oak = load_table().exact("oak").value()
    mesh = read_mesh(target)
    np.testing.assert_allclose(mesh.material.E, oak.E, rtol=1e-6)  # the promise of the design
    np.testing.assert_allclose(mesh.material.nu, oak.nu, rtol=1e-6)
    np.testing.assert_allclose(mesh.material.rho, oak.rho, rtol=1e-6)
    assert document["mass"] == pytest.approx(oak.rho * 1e-3, rel=1e-3)  # cube of 1e-3 m^3
    solved = run_cli("simulate", target, "-o", tmp_path / "s.vtu", "--json")
    assert solved.returncode == 0, solved.stderr
    assert 0 < json.loads(solved.stdout)["sag"]["sag_ratio"] < 1e-4  # rho g l / E is 1e-8


def test_dry_run_writes_nothing_and_estimates_within_its_range(cube, tmp_path, capsys):
    """The cube at the default edge has 4,943 tets (measured once): inside the range given."""
    before = sorted(tmp_path.rglob("*"))
    call = ["run", str(cube), "--text", "oak", "-o", str(tmp_path / "out"), "--dry-run", "--json"]
    assert main(call) == 0
    document = json.loads(capsys.readouterr().out)
    tets = document["estimates"]["tets"]
    assert tets["low"] < 4943 < tets["high"]
    assert any("oak" in step for step in document["steps"])
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.slow
@pytest.mark.parametrize("option", [(), ("--edge-length", "0.01"), ("--max-tets", "30000")])
def test_dry_run_of_a_lattice_is_within_its_range(option, tmp_path, capsys):
    """The demo, by the tets wanted, by an edge and by a budget: as many as were estimated."""
    from autophyx_tet.converters.mesh.meshdata import read_mesh
    from autophyx_tet.toolkit.asset.bonsai import write_bonsai

    asset, target = write_bonsai(tmp_path / "bonsai.glb"), tmp_path / "b.msh"
    call = ["convert", str(asset), "--mesher", "stuffing", *option, "-o", str(target), "--json"]
    assert main([*call, "--dry-run"]) == 0
    tets = json.loads(capsys.readouterr().out)["estimates"]["tets"]
    assert main(call) == 0
    assert tets["low"] <= len(read_mesh(target).tets) <= tets["high"]


@pytest.mark.long
def test_a_budget_too_small_for_one_piece_is_refused(tmp_path, capsys):
    """With 4,000 tets a tenth of the demo would come off; with 8,000 leaves hang on by beads."""
    from autophyx_tet.converters.mesh.meshdata import read_mesh
    from autophyx_tet.toolkit.asset.bonsai import write_bonsai

    asset, target = write_bonsai(tmp_path / "bonsai.glb"), tmp_path / "b.msh"
    call = ["convert", str(asset), "--mesher", "stuffing", "--max-tets", "4000", "-o", str(target)]
    assert main(call) == 4
    assert "more --max-tets" in capsys.readouterr().err
    assert not target.exists()
    assert main([*call, "--accept-broken"]) == 0
    assert "fell off" in capsys.readouterr().err
    assert main([*call, "--max-tets", "8000"]) == 0
    told = capsys.readouterr().err
    assert "beads of" in told
    assert ("more than --max-tets 8,000" in told) == (len(read_mesh(target).tets) > 8000)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["png", "gif"])
def test_simulate_draws_a_picture(suffix, cube_msh, tmp_path, capsys):
    """A picture that is not blank; the GIF moves: its frames differ."""
    from PIL import Image

    mesh, picture = str(tmp_path / "m.msh"), tmp_path / f"p.{suffix}"
    assert main(["assign", str(cube_msh), "--text", "rubber", "-o", mesh, "-q"]) == 0
    call = ["simulate", mesh, "-o", str(tmp_path / "s.vtu"), "--order", "1", "-q"]
    assert main([*call, "--picture", str(picture)]) == 0
    with Image.open(picture) as image:
        first = np.asarray(image.convert("RGB"), dtype=float)
        image.seek(getattr(image, "n_frames", 1) - 1)
        last = np.asarray(image.convert("RGB"), dtype=float)
    assert first.std() > 10
    assert (abs(first - last).max() > 10) == (suffix == "gif")
