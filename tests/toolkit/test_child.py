"""The guarded child: results come back, and no way of failing reaches us or leaves anything."""

import os
import signal
import tempfile
import threading
from pathlib import Path

import numpy as np
import pytest
from autophyx_tet.toolkit.asset import child
from autophyx_tet.toolkit.asset.child import ChildFailure, run_guarded

CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float) - 0.5
CUBE_FACES = np.array([
    [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
    [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
])  # fmt: skip
OPTIONS = {"edge_length_rel": 0.3, "epsilon_rel": 1e-2, "stop_energy": 10.0, "decimate_rel": 5e-3}
SLOW = {"edge_length_rel": 0.005, "epsilon_rel": 1e-4, "stop_energy": 3.0, "decimate_rel": 5e-5}


def _run(options=OPTIONS, *, points=CUBE, faces=CUBE_FACES, time_limit=60.0, **more):
    arrays = {"points": points, "faces": faces}
    return run_guarded("tetwild", arrays, options, time_limit=time_limit, **more)


@pytest.fixture(autouse=True, params=["a copy of this process", "another Python"])
def nothing_left(tmp_path, monkeypatch, request):
    """No child process of ours and no temporary folder survives a test, however it is started."""
    if request.param == "another Python":
        monkeypatch.setattr(child, "COPIED", set())
    else:  # the threads of the runner of these tests wait for their next one, and hold nothing
        monkeypatch.setattr(threading, "active_count", lambda: 1)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    children = Path(f"/proc/{os.getpid()}/task/{os.getpid()}/children")
    before = set(children.read_text().split())
    yield
    assert set(children.read_text().split()) <= before
    assert not list(tmp_path.glob("autophyx-tet-*"))


@pytest.mark.slow
def test_arrays_come_back_and_progress_is_told():
    told = []
    result = _run(progress=lambda stage, seconds: told.append((stage, seconds)))
    assert set(result) == {"points", "tets"}
    assert result["tets"].shape[1] == 4
    assert told
    assert told == sorted(told, key=lambda item: item[1])


@pytest.mark.slow
def test_time_limit_kills():
    """The engine would take minutes; after a second it is ended, and no process is left of it."""
    with pytest.raises(ChildFailure, match="within 1 s of CPU") as failure:
        _run(SLOW, time_limit=1.0)
    assert failure.value.kind == "time"


@pytest.mark.slow
def test_a_killed_engine_is_a_crash():
    """SIGKILL while it works, as the kernel does for memory: named, and no process is left."""
    ours = Path(f"/proc/{os.getpid()}/task/{threading.get_native_id()}/children")

    def kill(stage, seconds):
        if stage != "working":  # it has begun
            for process in ours.read_text().split():
                os.kill(int(process), signal.SIGKILL)

    with pytest.raises(ChildFailure, match="SIGKILL") as failure:
        _run(SLOW, progress=kill)
    assert failure.value.kind == "crash"


@pytest.mark.slow
def test_a_fault_of_its_start_is_forgiven_once():
    """A segmentation fault of the first child: a second one answers."""
    ours = Path(f"/proc/{os.getpid()}/task/{threading.get_native_id()}/children")
    ended = []

    def fault(stage, seconds):
        if stage != "working" and not ended:
            ended.extend(ours.read_text().split())
            for process in ended:
                os.kill(int(process), signal.SIGSEGV)

    assert len(_run(progress=fault)["tets"])
    assert len(ended) == 1


@pytest.mark.slow
def test_crash_is_told_apart_from_an_error():
    """Negative indices make the engine crash with a signal; an unknown option is an error."""
    with pytest.raises(ChildFailure, match="SIG") as failure:
        _run(faces=CUBE_FACES - len(CUBE))
    assert failure.value.kind == "crash"
    with pytest.raises(ChildFailure, match="sharpness") as failure:
        _run({**OPTIONS, "sharpness": 1})
    assert failure.value.kind == "error"


@pytest.mark.slow
def test_memory_limit_holds():
    """100 MiB do not hold the engine's libraries: it ends at once, and not by the time limit."""
    with pytest.raises(ChildFailure) as failure:
        _run(memory_limit=100 * 2**20)
    assert failure.value.kind != "time"


def test_interrupt_leaves_nothing():
    """Ctrl-C while the child works: the interrupt goes on, the child is gone."""

    def interrupt(stage, seconds):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        _run(SLOW, progress=interrupt)


@pytest.mark.slow
def test_works_from_a_thread():
    results = []
    thread = threading.Thread(target=lambda: results.append(_run()))
    thread.start()
    thread.join()
    assert len(results[0]["tets"]) > 0


def test_a_process_with_threads_or_much_memory_is_not_copied(monkeypatch):
    """Another thread may hold a lock that the copy would wait for; the limit counts what it has."""
    started = []
    monkeypatch.setattr(child, "COPIED", {"tetwild"})
    monkeypatch.setattr(child, "_copy", lambda folder: started.append("copy"))
    monkeypatch.setattr(child, "_new", lambda folder: started.append("new"))
    for threads, limit in ((1, 2**40), (2, 2**40), (1, 2**20)):  # whatever these tests hold
        monkeypatch.setattr(threading, "active_count", lambda count=threads: count)
        with pytest.raises(TypeError):  # there is no process to wait for
            _run(memory_limit=limit)
    assert started == ["copy", "new", "new"]
