"""Attempts of the engine: remembered, repeated coarser, judged; what failed is on record."""

import re
import time
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from autophyx_tet.fem.errors import NoVolumeError
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.toolkit.asset import cache
from autophyx_tet.toolkit.asset.cache import Runner
from autophyx_tet.toolkit.asset.child import ChildFailure
from autophyx_tet.toolkit.meshing import convert as attempts
from autophyx_tet.toolkit.meshing import ftetwild
from autophyx_tet.toolkit.meshing.convert import tetrahedralize
from autophyx_tet.toolkit.meshing.ftetwild import (
    FORESEEN,
    HURRIED,
    PASSES,
    EngineTarget,
    hopeless,
    run_engine,
)
from autophyx_tet.toolkit.meshing.stuffing.mesher import stuffed

from .test_stuffing import solids_of
from .test_tetrahedralize import QUICK, asset_of, converted


@pytest.mark.slow
def test_cache_remembers_the_engine(tmp_path, monkeypatch):
    """The second conversion runs no child and gives the same mesh; another option runs one."""
    cube = trimesh.creation.box((1, 1, 1))
    first, _ = converted({**QUICK, "cache": tmp_path}, cube=cube)

    def no_child(*_, **__):
        raise ChildFailure("crash", "a child was started", 0.0)

    monkeypatch.setattr(cache, "run_guarded", no_child)
    again, _ = converted({**QUICK, "cache": tmp_path}, cube=cube)
    assert (again.points == first.points).all()
    with pytest.raises(NoVolumeError, match="child was started"):
        converted({**QUICK, "stop_energy": 21.0, "cache": tmp_path}, cube=cube)


@pytest.mark.slow
def test_damaged_cache_is_made_again(tmp_path):
    cube = trimesh.creation.box((1, 1, 1))
    converted({**QUICK, "cache": tmp_path}, cube=cube)
    for path in tmp_path.glob("*.npz"):
        path.write_bytes(b"broken")
    mesh, _ = converted({**QUICK, "cache": tmp_path}, cube=cube)
    assert mesh.volume == pytest.approx(1, rel=1e-2)


@pytest.mark.slow
def test_a_time_out_is_followed_by_a_coarser_attempt_and_recorded(monkeypatch):
    """The first attempt runs out of time: the next one doubles edge and epsilon, and says so."""
    _slow_at_first(monkeypatch)
    cube = asset_of(cube=trimesh.creation.box((1, 1, 1)))
    _, report = tetrahedralize(cube, **QUICK, mesher="ftetwild")
    first, second = report.attempts
    assert first.outcome.startswith("time")
    assert second.epsilon == pytest.approx(2 * first.epsilon)
    assert report.epsilon == second.epsilon
    assert any("1 of 2 attempts failed" in w for w in report.warnings)


@pytest.mark.slow
def test_a_time_out_is_followed_by_a_lattice_and_said(monkeypatch):
    """With the default mesher a lattice takes over: it keeps the volume, no epsilon; it is said.

    Its edge is the one that was given, where that keeps the guarantees.
    """
    _slow_at_first(monkeypatch)
    cube = asset_of(cube=trimesh.creation.box((1, 1, 1)))
    mesh, report = tetrahedralize(cube, **QUICK, max_tets=5000)
    assert len(mesh.tets) <= 5000
    assert report.edge_length == pytest.approx(QUICK["edge_length_rel"] * 3**0.5)  # of a unit cube
    assert [attempt.engine for attempt in report.attempts] == ["tetwild", "stuffing"]
    assert (report.mesher, report.ok) == ("stuffing", True)
    assert mesh.volume == pytest.approx(1, rel=0.01)  # of which more would be told
    assert any("takes too long" in w and "--mesher ftetwild" in w for w in report.warnings)


def _slow_at_first(monkeypatch):
    """The engine's first run is out of time, the others are real."""
    real, calls = cache.run_guarded, []

    def slow_at_first(task, arrays, options, **limits):
        calls.append(options)
        if len(calls) == 1:
            raise ChildFailure("time", "no result within 1 s", 1.0)
        return real(task, arrays, options, **limits)

    monkeypatch.setattr(cache, "run_guarded", slow_at_first)


def test_when_nothing_works_the_reasons_are_listed(monkeypatch):
    def crash(*_, **__):
        raise ChildFailure("crash", "the engine crashed (SIGSEGV)", 0.1)

    monkeypatch.setattr(cache, "run_guarded", crash)
    with pytest.raises(NoVolumeError, match=r"5 attempts.*SIGSEGV.*--time-limit"):
        tetrahedralize(asset_of(cube=trimesh.creation.box((1, 1, 1))), **QUICK)


def _engine(height, *, right_from=np.inf):
    """In place of the engine: a cube of the given share of its height, whole from an envelope on.

    The cube that it gets has a unit diagonal.
    """
    side = 3**-0.5

    def run(task, arrays, options, **_):
        if task == "alpha_wrap":
            return {"points": arrays["points"], "faces": arrays["faces"]}
        share = 1.0 if options["epsilon_rel"] >= right_from else height
        box = box_mesh((side, side, side * share), (3, 3, 3))
        return {"points": box.points - side / 2, "tets": box.tets}

    return run


def test_a_broken_guarantee_goes_on_to_a_coarser_epsilon_and_says_so(monkeypatch):
    """The engine cuts 2 % off until its envelope doubles: what is stated is what was kept."""
    right = 2 * QUICK["epsilon_rel"] / 2
    monkeypatch.setattr(cache, "run_guarded", _engine(0.98, right_from=0.99 * right))
    mesh, report = tetrahedralize(asset_of(cube=trimesh.creation.box((1, 1, 1))), **QUICK)
    assert report.ok
    assert mesh.volume == pytest.approx(1)
    assert report.epsilon == pytest.approx(2 * QUICK["epsilon_rel"] * 3**0.5)
    assert report.asked_epsilon == pytest.approx(report.epsilon / 2)
    assert report.attempts[0].outcome.startswith("broken: distance")
    assert {g.threshold for g in report.guarantees if g.unit == "m"} == {report.epsilon}
    assert any("not the" in w and "asked for" in w for w in report.warnings)


@pytest.mark.slow
def test_no_mesh_is_handed_out_that_breaks_its_guarantees(monkeypatch):
    """Every attempt lacks a fifth of the cube: exit 4 with the distance, unless it is accepted."""
    cube = asset_of(cube=trimesh.creation.box((1, 1, 1)))
    monkeypatch.setattr(cache, "run_guarded", _engine(0.8))
    with pytest.raises(
        NoVolumeError, match=r"distance.*at 'cube', wanted.*--accept-broken"
    ) as error:
        tetrahedralize(cube, **QUICK)
    assert error.value.exit_code == 4
    mesh, report = tetrahedralize(cube, **QUICK, accept_broken=True)
    assert mesh.volume == pytest.approx(0.8)
    assert not report.ok
    assert set(report.failed) <= set(report.warnings)


@pytest.mark.slow
def test_beads_follow_where_no_lattice_that_fits_keeps_a_part_whole(monkeypatch):
    """Two lattices cut a part, a third would be too large: the second again, with beads."""
    asked = []

    def cutting(solids, target, runner):
        asked.append((target.tets, target.beads))
        filling = stuffed(solids, replace(target, tets=2000), runner)
        parted = {} if target.beads else {0: 0.01}  # of its volume: told, no guarantee broken
        return filling._replace(lattice=filling.lattice._replace(parted_shares=parted))

    monkeypatch.setattr(attempts, "MESHERS", {"stuffing": cutting})
    cube = asset_of(cube=trimesh.creation.box((1, 1, 1)))
    _, report = tetrahedralize(cube, mesher="stuffing")
    assert asked == [(50_000, False), (200_000, False), (200_000, True)]
    assert [a.outcome[:9] for a in report.attempts] == ["in pieces", "in pieces", "ok"]


@pytest.mark.slow
def test_a_finer_lattice_that_would_outlast_the_limit_is_told_not_tried(monkeypatch):
    """Four times the tets take four times as long, which is more than is left: the first stays."""
    asked = []

    def cutting(solids, target, runner):
        asked.append(target.beads)
        ends = time.process_time() + 10  # of 40 s
        filling = stuffed(solids, replace(target, tets=2000), runner)
        runner.clock.seconds += ends - time.process_time()
        return filling._replace(lattice=filling.lattice._replace(parted_shares={0: 0.01}))

    monkeypatch.setattr(attempts, "MESHERS", {"stuffing": cutting})
    cube = asset_of(cube=trimesh.creation.box((1, 1, 1)))
    _, report = tetrahedralize(cube, mesher="stuffing", time_limit=40)
    assert asked == [False]
    assert {a.outcome[:21] for a in report.attempts[1:]} == {"time: a finer lattice"}


@pytest.mark.slow
def test_an_engine_that_would_take_too_long_is_given_up_by_what_it_says(monkeypatch):
    """Passes it has not begun count by those that it made; other work on the machine does not."""
    assert not hopeless("stage: tetrahedralizing", FORESEEN)  # who knows
    assert hopeless("collapsing 4.7", HURRIED / PASSES + 1)  # nothing but simplifying so far
    two = "//// pass 0 ////\n//// pass 1 ////"
    assert not hopeless(two, 3 / PASSES * HURRIED - 1)
    assert hopeless(two, 3 / PASSES * HURRIED + 1)
    monkeypatch.setattr(ftetwild, "FORESEEN", 0.0)
    monkeypatch.setattr(ftetwild, "HURRIED", 1.0)
    ball = trimesh.creation.icosphere(4)
    ball.vertices *= 1 + 0.03 * np.sin(20 * ball.vertices).prod(axis=1, keepdims=True)
    _, report = tetrahedralize(asset_of(ball=ball), epsilon_rel=1e-4, max_tets=5000)
    assert [attempt.engine for attempt in report.attempts] == ["tetwild", "stuffing"]
    assert re.search(r"time: given up after \d+ s of CPU", report.attempts[0].outcome)
    assert any("takes too long" in told for told in report.warnings)
    assert (report.mesher, report.ok) == ("stuffing", True)


@pytest.mark.slow
def test_the_time_limit_is_for_all_attempts_together():
    """Once children have taken it no other is begun, and the clock is theirs, not the wall's."""
    ball = trimesh.creation.icosphere(3)
    runner = Runner(1e3)
    run_engine(solids_of(ball), EngineTarget.of(2.0, 0.2, 2e-2), runner)
    assert 0 < runner.clock.seconds < 60
    late = replace(runner, time_limit=runner.clock.seconds)
    with pytest.raises(ChildFailure, match="nothing is left") as failure:
        run_engine(solids_of(ball), EngineTarget.of(2.0, 0.2, 2e-2), late)
    assert failure.value.kind == "time"
