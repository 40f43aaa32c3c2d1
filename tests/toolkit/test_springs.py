"""Simulate --solver spring: options, files, page, warnings, and what springs cannot do."""

import json

import pytest
from autophyx_tet.converters.mesh.mesh_file import write_mesh
from autophyx_tet.fem.errors import UsageError
from autophyx_tet.fem.scene.box import box_mesh
from autophyx_tet.fem.scene.material import ElementMaterial
from autophyx_tet.toolkit.cli.main import main
from autophyx_tet.toolkit.options import SimulateOptions
from autophyx_tet.toolkit.pipeline import simulate


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
    assert "springs take nu" in page
    assert "anchors, " in page


def test_what_springs_cannot_do_is_refused(bar):
    for scenario, why in (("modal", "followed in time"), ("tear", "do not tear")):
        with pytest.raises(UsageError, match=why):
            simulate(bar, options=SimulateOptions(scenario=scenario, solver="spring"))
    with pytest.raises(UsageError, match="--move is for bodies at rest: --solver spring"):
        simulate(bar, solver="spring", move={"plane:x<0.01": (0, 0, 0.01)})
