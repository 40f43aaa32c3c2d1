"""Scenarios through the pipeline: what they answer, write and say."""

import re
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
from autophyx_tet.converters.mesh.meshdata import read_data, write_mesh
from autophyx_tet.converters.mesh.vtk import read_pvd
from autophyx_tet.fem import METHODS, SCENARIOS, Scene
from autophyx_tet.fem.errors import InputError, UsageError
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.fem.solve.result import Motion, MotionResult
from autophyx_tet.toolkit.asset.document import Sidecar
from autophyx_tet.toolkit.options import SimulateOptions
from autophyx_tet.toolkit.simulation import scenario
from autophyx_tet.toolkit.simulation.simulate import simulate
from autophyx_tet.toolkit.verdict.simulation import (
    ModalSimulation,
    MotionSimulation,
    StaticSimulation,
)

LENGTH, SIDE = 1.0, 0.1


@pytest.fixture(scope="module")
def column():
    """A slim rubber column that stands on its end."""
    mesh = box_mesh((SIDE, SIDE, LENGTH), (2, 2, 10))
    return mesh.with_material(ElementMaterial.uniform(len(mesh.tets), E=1e8, nu=0.3, rho=1000.0))


def test_sag_knows_the_first_frequency(column):
    """A clamped beam: f = 1.8751^2 / (2 pi L^2) sqrt(E I / rho A); 3 %: two cells across."""
    result = simulate(column, options=SimulateOptions())
    assert isinstance(result, StaticSimulation)
    bending = np.sqrt(1e8 * SIDE**2 / 12 / 1000.0)
    exact = 1.8751**2 / (2 * np.pi * LENGTH**2) * bending
    np.testing.assert_allclose(result.frequencies[:2], exact, rtol=0.03)
    assert "first frequency" in {verdict.name for verdict in result.verdicts()}


def test_modal_writes_shapes_and_one_period(column, tmp_path):
    options = SimulateOptions(scenario="modal", modes=3)
    result = simulate(column, output=tmp_path / "ring.vtu", options=options)
    assert isinstance(result, ModalSimulation)
    assert result.document()["modal"]["frequencies"] == result.frequencies
    data = read_data(tmp_path / "ring.vtu")
    assert {"displacement", "mode_1", "mode_2", "mode_3"} <= set(data.point_data)
    drawn = np.linalg.norm(result.animation.displacement, axis=2).max()
    assert drawn == pytest.approx(0.05 * np.linalg.norm([SIDE, SIDE, LENGTH]))
    assert result.animation.times[-1] < 1 / result.frequencies[0]


def test_what_the_mesh_lacks_of_its_file_is_a_verdict(column, tmp_path):
    """Gaps that `convert` closed, on record beside the mesh: warned of first, and nothing is good.

    The same mesh without a record, or with an empty one, has no such verdict.
    """
    path, gaps = tmp_path / "column.msh", "gaps narrower than the lattice's edge are filled"
    shape = ("holds shape", "first frequency")
    for told in ((gaps,), (), None):
        write_mesh(path, column)
        if told is not None:
            Sidecar("z").with_record(convert={"report": {"differences": told}}).write(path)
        first, *others = simulate(path).verdicts()
        assert (gaps in first.sentence and first.mark == "warning") == bool(told)
        marks = {verdict.name: verdict.mark for verdict in (first, *others)}
        assert {marks[name] for name in shape} == {"note" if told else "good"}
        Sidecar.path(path).unlink(missing_ok=True)


@pytest.mark.slow
def test_drop_falls_bounces_and_is_written_whole(tmp_path):
    """Free fall until the ground, which is never passed; every frame is in the .pvd."""
    mesh = box_mesh((0.1, 0.1, 0.1), (1, 1, 1))
    mesh = mesh.with_material(ElementMaterial.uniform(6, E=1e6, nu=0.4, rho=1000.0))
    options = SimulateOptions(scenario="drop", drop_height=0.02)
    result = simulate(mesh, output=tmp_path / "drop.pvd", options=options)
    assert isinstance(result, MotionSimulation)
    answer = result.document()["motion"]
    assert answer["smallest_gap"] > 0
    assert np.max(answer["obstacle_forces"]) > mesh.mass * 9.81
    assert answer["impact"]["unresolved"] == "time"
    assert answer["max_contact_force"] is None
    frames = list(read_pvd(tmp_path / "drop.pvd"))
    assert len(frames) == answer["frames"] == len(result.animation.times)
    marks = ["good", "unmade", "good", "good"]  # one cell lands flat: no force is told
    assert [verdict.mark for verdict in result.verdicts()] == marks


@pytest.mark.slow
def test_squeeze_closes_by_the_share():
    """The plates close by a fifth of the width, across the up axis."""
    mesh = box_mesh((0.1, 0.1, 0.1), (2, 2, 2))
    mesh = mesh.with_material(ElementMaterial.uniform(48, E=1e5, nu=0.3, rho=1000.0))
    options = SimulateOptions(scenario="squeeze", squeeze_share=0.2)
    result = simulate(mesh, up="x", options=options)
    moved = mesh.points + result.displacement
    # A squeeze right to 0.5 %, of a fifth.
    assert np.ptp(moved[:, 1]) == pytest.approx(0.08, rel=1.3e-3)


@pytest.mark.blockers
@pytest.mark.slow
def test_the_force_told_of_a_squeeze_is_that_of_the_squeeze():
    """E A times the strain for a cube with nu 0, proportional to the share; its curve is told."""
    mesh = box_mesh((0.1, 0.1, 0.1), (2, 2, 2))
    mesh = mesh.with_material(ElementMaterial.uniform(48, E=1e7, nu=0.0, rho=1000.0))
    for share in (0.003, 0.01, 0.03):
        result = simulate(mesh, options=SimulateOptions(scenario="squeeze", squeeze_share=share))
        told = result.document()["motion"]
        wanted = 1e7 * 0.01 * share
        # 0.5 % of the squeeze; the finite law is a share of the strain off E A eps.
        assert told["max_contact_force"] == pytest.approx(wanted, rel=0.01 + share)
        assert told["obstacle_forces"][-1] == told["max_obstacle_forces"]
        assert told["obstacle_forces"][0] == pytest.approx([0, 0], abs=1e-6 * wanted)


def test_the_report_of_a_simulation_stands_alone(column, tmp_path):
    write_mesh(tmp_path / "column.msh", column)
    page = tmp_path / "column.html"
    result = simulate(
        tmp_path / "column.msh", output=tmp_path / "s.vtu", report=page, options=SimulateOptions()
    )
    assert set(result.files) == {tmp_path / "s.vtu", page}
    text = page.read_text(encoding="utf-8")
    assert "Natural frequencies" in text
    assert "holds its shape" in text


def test_what_a_scenario_cannot_do_is_told(column, tmp_path):
    with pytest.raises(UsageError, match="modal knows only --law linear"):
        simulate(column, options=SimulateOptions(scenario="modal", law="neohookean"))
    with pytest.raises(InputError, match=r"unknown suffix '.txt', wanted .vtu, .vtk, .pvd"):
        simulate(column, output=tmp_path / "x.txt")
    with pytest.raises(InputError, match=r"wanted .html"):
        simulate(column, report=tmp_path / "x.pdf")


@dataclass(frozen=True)
class Lean:
    """A toy: the load comes from the side, and its method has seen it all before."""

    title: ClassVar[str] = "Leaning"
    method: ClassVar[str] = "toy"
    with_modes: ClassVar[bool] = False

    wind_speed: float = 1.0

    def scene(self, mesh, *, up="z"):
        return Scene(mesh=mesh, gravity_vector=(self.wind_speed, 0.0, 0.0))


class Toy:
    """A toy method: every body moves by its gravity, all at once."""

    laws = ("linear",)

    def solve(self, scene, *, law=None, order=None, device="cpu", progress=None):
        u = np.tile(np.asarray(scene.gravity_vector), (len(scene.mesh.points), 1))
        still = dict.fromkeys(("kinetic", "elastic", "potential", "barrier"), 0.0)
        rest = {"v": 0 * u, "a": 0 * u, "contact_force": 0 * u, "obstacle_force": u[:0]}
        rest |= {"gap": 1.0, "iterations": 0}
        frames = tuple(Motion(time=t, u=t * u, **rest, **still) for t in (0.0, 1.0))
        return MotionResult(frames, 1.0, len(scene.mesh.points))


def test_a_scenario_and_a_method_of_somebody_else(column, tmp_path):
    """Registered, they are simulated, judged, written and reported like ours."""
    SCENARIOS.register("lean", Lean)
    METHODS.register("toy", Toy())
    try:
        options = SimulateOptions(scenario="lean", wind_speed=0.25)
        page = tmp_path / "lean.html"
        result = simulate(column, output=tmp_path / "lean.pvd", report=page, options=options)
        assert result.displacement[:, 0] == pytest.approx(np.full(len(column.points), 0.25))
        assert [verdict.mark for verdict in result.verdicts()] == ["good"] * 4
        assert len(list(read_pvd(tmp_path / "lean.pvd"))) == 2
        assert result.title == "Leaning"
        assert "lean" in page.read_text(encoding="utf-8")
        with pytest.raises(UsageError, match="lean knows only --law linear"):
            simulate(column, options=SimulateOptions(scenario="lean", law="corotated"))
    finally:
        SCENARIOS.unregister("lean")
        METHODS.unregister("toy")


def test_a_structured_mesh_has_a_report(tmp_path):
    """Tets that are all alike: their qualities differ by round-off, and still have a histogram."""
    mesh = box_mesh((0.1, 0.1, 0.3), (2, 2, 6)).with_material(
        ElementMaterial(np.full(144, 1e8), np.full(144, 0.3), np.full(144, 1e3))
    )
    simulate(mesh, report=tmp_path / "r.html")
    assert "<svg" in (tmp_path / "r.html").read_text()


def test_the_time_left_is_of_the_slower_of_two_paces(monkeypatch):
    """Frames of 1 s, then of 10 s in contact: three of these and the rest is told to the second."""
    clock = [0.0]
    monkeypatch.setattr(scenario.time, "perf_counter", lambda: clock[0])
    said = []
    done = scenario.frames_told("drop", lambda stage, _: said.append(stage), 0.0)
    for frame, seconds in enumerate((*[1.0] * 10, *[10.0] * 4, *[1.0] * 3), 1):
        clock[0] += seconds
        done(frame, 100)
    left = [float(re.search(r", (\d+) s left at this pace", stage)[1]) for stage in said]
    assert left[9] == 90  # nothing has touched yet, and nobody knows
    assert left[10] == 4 * 89  # two frames of 1 s and one of 10 s
    assert left[12] == 10 * 87
    assert left[16] == round(53 / 17 * 83)  # quick ones again: by the mean of all
