"""The verbs reduce and match, and simulate --solver lbs: files, documents, refusals."""

import inspect
import json
import re
from dataclasses import fields

import autophyx_tet as apx
import numpy as np
import pytest
from autophyx_tet.converters.archives import load_fits, load_reduced, save_fits
from autophyx_tet.converters.mesh.meshdata import write_mesh
from autophyx_tet.converters.mesh.vtk import read_pvd, write_pvd
from autophyx_tet.fem.errors import InputError, UsageError
from autophyx_tet.fem.identify import MotionFit
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.fem.solve.schemes import Scheme
from autophyx_tet.toolkit.cli.commands import MatchCommand, ReduceCommand
from autophyx_tet.toolkit.cli.main import main
from autophyx_tet.toolkit.simulation.reducing import match, reduce
from autophyx_tet.toolkit.simulation.scenario import moduli_between
from autophyx_tet.toolkit.simulation.simulate import simulate

from .command import run_here


@pytest.fixture(scope="module")
def bar(tmp_path_factory):
    """A standing bar of jelly on disk, 0.4 m high."""
    mesh = box_mesh((0.1, 0.1, 0.4), (2, 2, 6))
    mesh = mesh.with_material(ElementMaterial.uniform(len(mesh.tets), E=1e5, nu=0.3, rho=500.0))
    path = tmp_path_factory.mktemp("bar") / "bar.msh"
    write_mesh(path, mesh)
    return path


@pytest.mark.slow
def test_a_drop_falls_freely_and_meets_the_ground(bar, tmp_path, capsys):
    """Every point falls by g t^2 / 2, but for BDF2's first step, touches and does not go through.

    What is left out is a warning.
    """
    call = ["simulate", str(bar), "--scenario", "drop", "--solver", "lbs", "--drop-height", "0.05"]
    assert main([*call, "-o", str(tmp_path / "drop.pvd"), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    found = document["motion"]
    assert 0 < found["smallest_gap"] < 0.01
    assert np.max(found["obstacle_forces"]) > 0
    assert found["impact"]["unresolved"] in ("time", "")
    assert any("dents" in warning for warning in document["warnings"])
    frames = [(t, mesh.point_data["displacement"]) for t, mesh in read_pvd(tmp_path / "drop.pvd")]
    (dt, _), (t, fallen) = frames[1], frames[10]
    assert fallen[:, 2] == pytest.approx(-9.81 * t**2 / 2, abs=9.81 * dt * t)
    assert np.ptp(fallen[:, 2]) < 1e-9


@pytest.mark.slow
def test_reduce_writes_a_model_and_match_its_moduli(bar, tmp_path, capsys):
    """The motion of a body 1.5 times as stiff gives that scale, by way of files and commands."""
    wind = ["--scenario", "poke", "--poke-force", "0.2"]
    assert main(["reduce", str(bar), *wind, "-o", str(tmp_path / "r.npz"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["reduced"]
    model = load_reduced(tmp_path / "r.npz")
    assert (told["dofs"], told["cells"]) == (model.dofs, len(model.cells))
    stiff = box_mesh((0.1, 0.1, 0.4), (2, 2, 6))
    stiff = stiff.with_material(
        ElementMaterial.uniform(len(stiff.tets), E=1.5e5, nu=0.3, rho=500.0)
    )
    moved = simulate(stiff, scenario="poke", poke_force=0.2, solver="lbs")
    frames = [(t, {"displacement": u}) for t, u in zip(*moved.animation, strict=True)][:20]
    write_pvd(tmp_path / "m.pvd", stiff, frames)
    fitted = tmp_path / "p.npz"
    call = ["match", str(bar), *wind, "--solver", "lbs", "--to", str(tmp_path / "m.pvd")]
    assert main([*call, "-o", str(fitted)]) == 0
    assert "first frequency" in capsys.readouterr().out
    (fit,) = load_fits(fitted)
    assert fit.scale == pytest.approx(1.5, rel=0.01)
    again = simulate(bar, scenario="poke", poke_force=0.2, solver="lbs", parameters=fitted)
    last = np.abs(moved.displacement).max()
    assert again.displacement == pytest.approx(moved.displacement, abs=0.05 * last)


def _fit(scale, nu=None):
    known = {"error": 0.0, "unfitted_error": 0.1, "outside": 0.0, "frequency_ratio": 1.0}
    size = 1 if nu is None else 2
    return MotionFit(
        scale=scale, nu=nu, **known, covariance=np.eye(size), scheme=Scheme.BDF2, runs=3
    )


def test_moduli_between_two_ends_are_even_in_log_E(tmp_path):
    """E of .5 and 8: 2 in the middle, by files; of one end there is no alpha."""
    save_fits(tmp_path / "two.npz", [_fit(0.5, 0.2), _fit(8.0, 0.4)])
    ends = load_fits(tmp_path / "two.npz")
    assert moduli_between(ends) == (pytest.approx(2.0), pytest.approx(0.3))
    assert moduli_between(ends, 0.25) == (pytest.approx(1.0), pytest.approx(0.25))
    assert moduli_between(ends, 1.0) == (8.0, 0.4)
    save_fits(tmp_path / "one.npz", [_fit(3.0)])
    assert moduli_between(load_fits(tmp_path / "one.npz")) == (3.0, None)
    for alpha, file in ((0.5, "one.npz"), (1.5, "two.npz")):
        with pytest.raises(UsageError, match="wanted 0 to 1"):
            moduli_between(load_fits(tmp_path / file), alpha)


@pytest.mark.slow
def test_a_soft_and_a_stiff_motion_give_what_lies_between(bar, tmp_path, capsys):
    """Bodies half and twice as stiff: at alpha 0 and 1 their motions, in the middle the mesh's."""
    poke = {"scenario": "poke", "poke_force": 0.1, "solver": "lbs"}
    ends = {}
    for name, E in (("soft", 5e4), ("stiff", 2e5)):
        body = box_mesh((0.1, 0.1, 0.4), (2, 2, 6))
        body = body.with_material(ElementMaterial.uniform(len(body.tets), E=E, nu=0.3, rho=500.0))
        ends[name] = simulate(body, **poke)
        times, u = ends[name].animation
        frames = [(t, {"displacement": x}) for t, x in zip(times, u, strict=True)]
        write_pvd(tmp_path / f"{name}.pvd", body, frames[:20])
    to = ["--to", str(tmp_path / "soft.pvd"), "--to-stiff", str(tmp_path / "stiff.pvd")]
    call = ["match", str(bar), "--scenario", "poke", "--poke-force", "0.1", "--solver", "lbs"]
    assert main([*call, *to, "-o", str(tmp_path / "p.npz")]) == 0
    (scale,) = re.findall(r"stiff: E x ([0-9.]+)", capsys.readouterr().out)
    assert float(scale) == pytest.approx(2, rel=2e-3)  # what the cells that are drawn leave
    fits = load_fits(tmp_path / "p.npz")
    assert [fit.scale for fit in fits] == pytest.approx([0.5, 2.0], rel=0.01)
    assert moduli_between(fits).scale == pytest.approx(1.0, rel=0.01)
    found = simulate(bar, **poke, parameters=tmp_path / "p.npz", parameters_alpha=1.0)
    last = np.abs(ends["stiff"].displacement).max()
    assert found.displacement == pytest.approx(ends["stiff"].displacement, abs=0.05 * last)
    swapped = {"to": tmp_path / "stiff.pvd", "to_stiff": tmp_path / "soft.pvd"}
    with pytest.raises(InputError, match="wanted the softer one first"):
        match(bar, **swapped, **poke)


@pytest.mark.slow
def test_a_table_of_runs_is_answered(bar, tmp_path, capsys):
    """Twice as stiff under twice the load rests alike; frequencies go by the root."""
    table, model = tmp_path / "runs.csv", tmp_path / "r.npz"
    table.write_text("body,load\n1,1\n2,2\n4,1\n")
    assert main(["reduce", str(bar), "-o", str(model), "--what-if", str(table), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    told = document["reduced"]
    assert told["what_if"]["runs"] == 3
    assert max(told["what_if"]["rest_error"]) < 0.01  # these lock: the model has quadratic ones
    assert not any("too coarse" in said for said in document["warnings"])
    assert told["accuracy"]["motion"] < 0.05
    answers = np.genfromtxt(tmp_path / "r.what_if.csv", delimiter=",", names=True)
    u, f = answers["max_displacement_m"], answers["first_frequency_Hz"]
    assert u[1] == pytest.approx(u[0], rel=1e-4)
    assert u[2] < 0.3 * u[0]
    assert f / f[0] == pytest.approx(np.sqrt([1, 2, 4]), rel=1e-6)
    table.write_text("leg\n1\n")
    with pytest.raises(InputError, match="columns leg: wanted each once of body, load, gx"):
        reduce(bar, what_if=table)


@pytest.mark.truth("crash: an extreme run")
def test_an_extreme_run_keeps_the_table(bar, tmp_path):
    """A load a million times too large has no rest, reduced or full; told, and the others stand."""
    table, model = tmp_path / "runs.csv", tmp_path / "r.npz"
    table.write_text("body,load\n1,1\n2,2\n1,1e6\n")
    done = run_here("reduce", bar, "-o", model, "--what-if", table, "--json")
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    told = document["reduced"]["what_if"]
    assert (told["runs"], told["compared"]) == (3, [0, 1])
    assert told["without_rest"] + told["unsolved"] == 1
    assert max(told["rest_error"]) < 0.01
    assert any("found no rest" in said for said in document["warnings"])
    answers = np.genfromtxt(tmp_path / "r.what_if.csv", delimiter=",", names=True)
    u, f = answers["max_displacement_m"], answers["first_frequency_Hz"]
    assert u[1] == pytest.approx(u[0], rel=1e-4)  # twice as stiff under twice the load
    assert f / f[0] == pytest.approx(np.sqrt([1, 2, 1]), rel=1e-6)


def test_python_has_the_names_of_the_command_line():
    """What a command takes is a parameter of its function; progress is Python's own."""
    for command, verb in ((ReduceCommand, apx.reduce), (MatchCommand, apx.match)):
        taken = {item.name for item in fields(command)} - {"common"}
        assert taken == {*inspect.signature(verb).parameters} - {"progress", "given"}


def test_what_cannot_be_done_is_said(bar, tmp_path):
    with pytest.raises(UsageError, match="followed in time"):
        simulate(bar, scenario="modal", solver="lbs")
    with pytest.raises(UsageError, match="--parameters: wanted --solver lbs or spring, not fem"):
        simulate(bar, parameters=tmp_path / "p.npz")
    with pytest.raises(UsageError, match="--handles: wanted --solver lbs, not spring"):
        simulate(bar, solver="spring", handles=4)
    with pytest.raises(UsageError, match="have no handles"):
        reduce(bar, handles=16)
    with pytest.raises(UsageError, match="--order: wanted --solver fem or lbs, not spring"):
        simulate(bar, scenario="drop", solver="spring", order=2)
    for solver in ("fem", "mpm"):  # none is chosen in silence, not even by default
        with pytest.raises(UsageError, match=f"of --solver {solver}: wanted --solver lbs or"):
            match(bar, tmp_path / "m.pvd", solver=solver)
    with pytest.raises(UsageError, match="what a match writes"):
        match(bar, tmp_path / "m.pvd", solver="lbs", parameters=tmp_path / "p.npz")
    with pytest.raises(UsageError, match="reduce --solver spring"):
        reduce(bar, solver="spring")
    with pytest.raises(InputError, match=r"\.npz"):
        reduce(bar, output=tmp_path / "model.json")
