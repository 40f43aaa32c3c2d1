"""Simulate --solver spring: options, files, page, warnings, and what springs cannot do."""

import json
import re

import numpy as np
import pytest
from autophyx_tet.converters.archives import load_springs
from autophyx_tet.converters.mesh.meshdata import write_mesh
from autophyx_tet.converters.mesh.vtk import write_pvd
from autophyx_tet.fem.errors import InputError, UsageError
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.toolkit.cli.main import main
from autophyx_tet.toolkit.options import SimulateOptions
from autophyx_tet.toolkit.simulation.reducing import match
from autophyx_tet.toolkit.simulation.simulate import simulate


@pytest.fixture(scope="module")
def bar(tmp_path_factory):
    """A bar of jelly on disk, 0.4 m long."""
    mesh = box_mesh((0.4, 0.1, 0.1), (8, 2, 2))
    mesh = mesh.with_material(ElementMaterial.uniform(len(mesh.tets), E=1e5, nu=0.4, rho=500.0))
    path = tmp_path_factory.mktemp("bar") / "bar.msh"
    write_mesh(path, mesh)
    return path


@pytest.mark.slow
def test_a_drop_is_written_and_reported(bar, tmp_path, capsys):
    """From the command line: motion and page; what springs do not know is on the terminal."""
    call = ["simulate", str(bar), "--scenario", "drop", "--solver", "spring", "--anchors", "200"]
    files = [tmp_path / name for name in ("drop.pvd", "drop.html")]
    call += ["-o", str(files[0]), "--report", str(files[1]), "--json", "--neighbours", "16"]
    assert main(call) == 0
    out = capsys.readouterr()
    found = json.loads(out.out)
    assert all(path.stat().st_size for path in files)
    assert found["motion"]["frames"] == 91
    assert found["motion"]["order"] == 0
    assert found["motion"]["max_contact_force"] > 2.0 * 9.81  # it weighs 2 kg
    assert "springs take nu = 0.25, its material has 0.4" in out.err
    assert "anchors thick" in out.err
    page = files[1].read_text()
    told = ("springs take nu", "anchors thick")
    assert all(any(words in warning for warning in found["warnings"]) for words in told)
    assert all(words in page for words in told)
    assert "anchors, " in page


@pytest.mark.slow
def test_match_finds_the_stiffness_of_a_motion(bar, tmp_path, capsys):
    """A motion of the network 1.5 times as stiff gives that scale, and again that motion."""
    body = box_mesh((0.4, 0.1, 0.1), (8, 2, 2))
    body = body.with_material(ElementMaterial.uniform(len(body.tets), E=1.5e5, nu=0.4, rho=500.0))
    poke = {"scenario": "poke", "poke_force": 0.2, "solver": "spring"}
    moved = simulate(body, **poke, anchors=120, neighbours=12)
    frames = [(t, {"displacement": u}) for t, u in zip(*moved.animation, strict=True)][:15]
    write_pvd(tmp_path / "m.pvd", body, frames)
    call = ["match", str(bar), "--solver", "spring", "--anchors", "120", "--neighbours", "12"]
    call += ["--scenario", "poke", "--poke-force", "0.2", "--to", str(tmp_path / "m.pvd")]
    assert main([*call, "-o", str(tmp_path / "p.npz")]) == 0
    out = capsys.readouterr()
    assert "first frequency" in out.out
    assert "springs take nu" in out.err
    assert re.search(
        r"expected: [\d,]+ springs, about 12 motions of [\d,]+ steps: some \d", out.err
    )
    fit = load_springs(tmp_path / "p.npz")
    assert fit.scale == pytest.approx(1.5, rel=0.01)
    again = simulate(bar, **poke, parameters=tmp_path / "p.npz")
    with pytest.raises(UsageError, match="were fitted with 120"):
        simulate(bar, **poke, parameters=tmp_path / "p.npz", anchors=300)
    early = (again.animation.displacement - moved.animation.displacement)[:15]
    # The profile takes up what other steps (within 5 %) make of the fastest waves: it had 3.1 %.
    assert np.abs(early).max() < 0.04 * np.abs(moved.animation.displacement[:15]).max()


def test_parameters_of_another_solver_are_refused(bar, tmp_path):
    np.savez(tmp_path / "p.npz", meta=np.array('{"kind": "MotionFit", "version": 1}'))
    with pytest.raises(InputError, match="wanted a SpringFit"):
        simulate(bar, solver="spring", parameters=tmp_path / "p.npz")
    with pytest.raises(UsageError, match="nu = 1/4"):
        match(bar, tmp_path / "m.pvd", solver="spring", with_nu=True)


def test_a_great_contrast_is_refused_before_its_ten_minutes(tmp_path, capsys):
    """Explicit steps go with the root of the stiffest spring: a thousand times as many."""
    mesh = box_mesh((1.0, 0.1, 0.1), (20, 2, 2))
    E, even = np.where(mesh.centroids[:, 0] > 0.5, 1e12, 1e6), np.ones(len(mesh.tets))
    write_mesh(tmp_path / "bar.msh", mesh.with_material(ElementMaterial(E, 0.3 * even, 1e3 * even)))
    call = ["simulate", str(tmp_path / "bar.msh"), "--solver", "spring", "--fix", "plane:x<0"]
    assert main([*call, "-o", str(tmp_path / "bar.pvd")]) == 2
    assert "minutes; --solver lbs or fem" in capsys.readouterr().err


def test_what_springs_cannot_do_is_refused(bar):
    for scenario, why in (("modal", "followed in time"), ("tear", "do not tear")):
        with pytest.raises(UsageError, match=why):
            simulate(bar, options=SimulateOptions(scenario=scenario, solver="spring"))
    with pytest.raises(UsageError, match="--move is for bodies at rest: --solver spring"):
        simulate(bar, solver="spring", move={"plane:x<0.01": (0, 0, 0.01)})
