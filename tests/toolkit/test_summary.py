"""At a prompt and in a notebook: options by name; results as a line and a table, no arrays."""

import html
import subprocess
import sys
import time

import autophyx_tet as apx
import numpy as np
import pytest
from autophyx_tet.converters.mesh.meshdata import write_mesh
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.toolkit.cli.main import main
from autophyx_tet.toolkit.report.html import show_in_window
from autophyx_tet.toolkit.verdict.run import Stopwatch
from PIL import Image


@pytest.fixture(scope="module")
def assigned():
    mesh = box_mesh((0.1, 0.1, 0.2), (1, 1, 2))
    names = ("<seat>", "legs")
    region = (mesh.centroids[:, 2] < 0.1).astype(np.int32)
    return apx.assign(TetMesh(mesh.points, mesh.tets, region, names), "steel")


def test_options_are_given_by_name(assigned):
    """As keywords of the verbs; what is no option names the nearest one."""
    soft, stiff = (apx.assign(assigned.mesh, "steel", alpha=a) for a in (0.0, 1.0))
    assert (soft.mesh.material.E < stiff.mesh.material.E).all()
    with pytest.raises(apx.AutophyxError, match="assign has no option 'alpa'; did you mean 'al"):
        apx.assign(assigned.mesh, "steel", alpa=0.1)
    with pytest.raises(apx.AutophyxError, match="convert has no option 'sizes'"):
        apx.convert("nowhere.glb", sizes=3)


def test_a_mesh_is_a_line(assigned):
    line = repr(assigned.mesh)
    assert line == "<TetMesh: 12 tets, 12 points, <seat>, legs, with E, nu and rho>"


def test_a_result_is_a_line_and_a_table(assigned):
    """Two parts of 1e-3 m^3 of steel weigh 15.7 kg; names cannot write HTML."""
    line, table = repr(assigned), assigned._repr_html_()
    assert line.startswith("<Assignment: 2 parts, 12 tets, 15.")
    assert "\n" not in line
    assert table.count("<tr>") == 3
    assert "&lt;seat&gt;" in table
    assert "<seat>" not in table


def test_a_simulation_tells_its_verdicts(assigned):
    found = apx.simulate(assigned.mesh)
    assert repr(found).startswith("<StaticSimulation: 2 parts, 12 tets, 15.")
    assert "It holds its shape" in found._repr_html_()


def test_a_report_is_a_frame_in_a_notebook(assigned):
    """The page is an attribute of the frame, which keeps it to itself; its words are in it once."""
    framed = apx.show_report(apx.simulate(assigned.mesh), height=300)
    page = framed._repr_html_()
    assert repr(framed).startswith("<Framed: a report of")
    assert page.count("<") == 2  # the frame and its end
    assert html.unescape(page.split('srcdoc="')[1].rpartition('"')[0]) == framed.page
    assert "Sag under its own weight" in framed.page


def test_without_a_display_it_is_said(assigned, monkeypatch, tmp_path):
    """On Linux no window opens where neither X nor Wayland is named: an error, not a silent end."""
    pytest.importorskip("pyvista")
    monkeypatch.setattr("sys.platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    write_mesh(tmp_path / "mesh.vtu", assigned.mesh)
    with pytest.raises(InputError, match="no display to open a window on; --picture"):
        show_in_window(tmp_path)


@pytest.mark.slow
def test_a_result_is_looked_at(assigned, tmp_path):
    """Without a window the view is a picture: a steel column, coloured by its stress."""
    pytest.importorskip("pyvista")
    apx.simulate(assigned.mesh, output=tmp_path / "sag.pvd")
    for source in ("sag.pvd", "sag_00005.vtu"):
        picture = tmp_path / f"{source}.png"
        assert main(["view", str(tmp_path / source), "--picture", str(picture), "-q"]) == 0
        with Image.open(picture) as image:
            assert np.asarray(image.convert("L")).std() > 5
    assert main(["view", str(tmp_path), "--picture", "no.png", "-q"]) == 3
    call = ["view", str(tmp_path / "sag.pvd"), "--colour", "taste", "--picture", "no.png"]
    assert main(call) == 3


def test_a_stopwatch_tells_work_from_waiting():
    """Sleep is time on the wall alone; what a child has worked counts when it has ended."""
    clock = Stopwatch()
    time.sleep(0.3)
    clock.lap("sleep")
    busy = "import time\nwhile time.process_time() < 0.1: pass"
    subprocess.run([sys.executable, "-S", "-c", busy], check=True)
    clock.lap("work")
    assert clock.seconds["sleep"] >= 0.3
    assert clock.cpu_seconds["sleep"] < 0.15  # threads of other tests may still tick
    # The clock of processes ticks every 10 ms, and differences of its sums are rounded
    assert clock.cpu_seconds["work"] >= 0.09 - 1e-9
