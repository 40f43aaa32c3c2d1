"""Batch under faults, with real runs: processes killed, a disk full, a worker of a cluster lost."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import trimesh

from .test_batch import make_manifest

pytestmark = pytest.mark.long
COARSE = {"edge_length_rel": "0.3", "order": "1", "cells": "16", "predictor": "retrieval"}
DEADLINE = 600.0  # s that a batch of a few boxes may take on the busiest machine
PIPES = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
FULL_DISK = """
set -e
mount -t tmpfs -o size=300k tmpfs "$1"
code=0; {batch} > "$2/first.json" 2> "$2/first.txt" || code=$?
echo $code > "$2/code"
(cd "$1"; find . -type f) > "$2/left"
cp -a "$1" "$2/kept" # a larger disk with the same files: only root may enlarge this one
mount -t tmpfs -o size=200m tmpfs "$1"
cp -a "$2/kept/." "$1"
{batch} > "$2/second.json"
cp -r "$1" "$2/out"
"""
LIMITED_FILES = """
code=0; (ulimit -f 300; {batch} > "$2/first.json" 2> "$2/first.txt") || code=$?
echo $code > "$2/code"
(cd "$1"; find . -type f) > "$2/left"
set -e
{batch} > "$2/second.json"
cp -r "$1" "$2/out"
"""
GUARD = b"autophyx_tet.toolkit.asset.guard"  # its first argument is the process that asked


def boxes(folder, count):
    """A manifest of ``count`` boxes of oak, no two alike."""
    for i in range(count):
        trimesh.creation.box((0.1, 0.1, 0.1 + 0.01 * i)).export(folder / f"box{i}.stl")
    rows = ({"asset": f"box{i}.stl", "text": "oak", "no_cache": "yes"} for i in range(count))
    return make_manifest(folder, *(row | COARSE for row in rows))


def start(manifest, output, *options):
    """A batch as a user starts it, in a process of its own."""
    command = [sys.executable, "-m", "autophyx_tet", "batch", str(manifest)]
    return subprocess.Popen(
        [*command, "-o", str(output), "--json", *options], preexec_fn=_hear_interrupts, **PIPES
    )


def _hear_interrupts():
    """Ctrl-C reaches the child even where the tests run in the background, which ignores it."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def document_of(driver):
    out, err = driver.communicate(timeout=DEADLINE)
    assert driver.returncode == 0, err
    return json.loads(out)


def children(pid):
    with contextlib.suppress(FileNotFoundError, ProcessLookupError):
        tasks = list(Path(f"/proc/{pid}/task").glob("*/children"))
        return [int(child) for path in tasks for child in path.read_text().split()]
    return []


def workers_of(driver):
    """Processes of the rows: the driver is a supervisor, whose only child does the work."""
    return [worker for command in children(driver.pid) for worker in children(command)]


def wait_for(condition):
    deadline = time.monotonic() + DEADLINE
    while not (found := condition()):
        assert time.monotonic() < deadline, "waited too long"
        time.sleep(0.02)
    return found


def all_done_once(document, output, count):
    """Every row has its whole result, nothing else lies about."""
    assert (document["assets"], document["done"], document["failed"]) == (count, count, 0)
    names = {row["id"] for row in document["rows"]}
    assert len(names) == count
    assert {path.name for path in output.iterdir() if path.is_dir()} == names | {".batch"}
    for name in names:
        record = json.loads((output / name / "run.json").read_text())
        assert all((output / file).stat().st_size for file in record["files"])
    assert not list(output.glob(".batch/work/*"))
    assert not list(output.rglob(".tmp-*"))


def test_a_killed_worker_is_replaced(tmp_path):
    """SIGKILL to one process at work: all rows are done, one of them at the second attempt."""
    output = tmp_path / "out"
    driver = start(boxes(tmp_path, 2), output, "--workers", "2")
    os.kill(wait_for(lambda: workers_of(driver))[0], signal.SIGKILL)
    document = document_of(driver)
    all_done_once(document, output, 2)
    assert sorted(row["attempts"] for row in document["rows"]) == [1, 2]
    page = (output / "index.html").read_text()
    assert page.count("data:image/webp;base64,") == 2
    again = document_of(start(tmp_path / "m.csv", output))
    assert again["new"] == 0
    (tmp_path / "m.csv").write_text((tmp_path / "m.csv").read_text().replace("oak", "foam", 1))
    changed = document_of(start(tmp_path / "m.csv", output))
    assert changed["new"] == 1  # a row that asks for something else is done again


def test_a_killed_driver_continues_where_it_was(tmp_path):
    """SIGKILL to the driver after the first result: its workers die, the rest is done once."""
    output, manifest = tmp_path / "out", boxes(tmp_path, 2)
    driver = start(manifest, output, "--workers", "1")
    wait_for(lambda: list(output.glob("box*")))
    workers = wait_for(lambda: workers_of(driver))
    driver.kill()
    driver.communicate()
    wait_for(lambda: not any(Path(f"/proc/{pid}/cmdline").exists() for pid in workers))
    done = {path.parent: path.stat().st_mtime_ns for path in output.glob("*/run.json")}
    assert done
    assert not (output / "results.csv").exists()
    document = document_of(start(manifest, output, "--workers", "2"))
    assert document["new"] == 2 - len(done)
    all_done_once(document, output, 2)
    assert all((path / "run.json").stat().st_mtime_ns == when for path, when in done.items())


def test_ctrl_c_ends_the_workers_and_keeps_what_is_done(tmp_path):
    output = tmp_path / "out"
    driver = start(boxes(tmp_path, 2), output, "--workers", "2")
    workers = wait_for(lambda: workers_of(driver))
    time.sleep(1)
    driver.send_signal(signal.SIGINT)
    out, err = driver.communicate(timeout=DEADLINE)
    assert driver.returncode == 130, err
    assert out == ""
    assert not any(Path(f"/proc/{pid}").exists() for pid in workers)
    assert not list((output / ".batch/work").iterdir())


def may_mount(folder):
    command = ["unshare", "-rm", "mount", "-t", "tmpfs", "tmpfs", str(folder)]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


def test_a_full_disk_leaves_no_half_result(tmp_path):
    """300 kB take no report: rows fail or the batch does; with room again all rows get done.

    The disk is a small tmpfs in a name space of the test's own; where the machine forbids that, the
    system's limit on the size of a file takes its place.
    """
    disk = tmp_path / "disk"
    disk.mkdir()
    manifest = boxes(tmp_path, 1)
    command = f'"{sys.executable}" -m autophyx_tet batch "{manifest}" -o "$1" --json'
    if may_mount(disk):
        call = ["unshare", "-rm", "bash", "-c", FULL_DISK.format(batch=command)]
    else:
        call = ["bash", "-c", LIMITED_FILES.format(batch=command)]
    done = subprocess.run(
        [*call, "test", str(disk), str(tmp_path)], capture_output=True, text=True, timeout=DEADLINE
    )
    assert done.returncode == 0, done.stderr
    left = (tmp_path / "left").read_text().splitlines()
    assert not [path for path in left if path.endswith(("run.json", "report.html", "batch.json"))]
    if (tmp_path / "code").read_text().strip() == "0":
        first = json.loads((tmp_path / "first.json").read_text())
        assert {row["code"] for row in first["rows"]} == {3}
    else:
        assert (tmp_path / "code").read_text().strip() == "3", (tmp_path / "first.txt").read_text()
    second = json.loads((tmp_path / "second.json").read_text())
    assert second["new"] == 1
    all_done_once(second, tmp_path / "out", 1)


@pytest.mark.external
def test_ray_loses_a_worker_and_no_row(tmp_path):
    """A local Ray cluster: SIGKILL to a Ray worker that is at work; every row is done once."""
    output = tmp_path / "out"
    driver = start(boxes(tmp_path, 2), output, "--engine", "ray", "--workers", "2")
    os.kill(wait_for(lambda: ray_workers(output)), signal.SIGKILL)
    document_of(driver)
    # What the killed worker left half-made is cleared by the next start.
    document = document_of(start(tmp_path / "m.csv", output))
    assert document["new"] == 0
    all_done_once(document, output, 2)


def ray_workers(output):
    """The Ray worker above a process that works for ``output``, or 0."""
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with contextlib.suppress(OSError):
            words = path.read_bytes().split(b"\0")
            at_work = GUARD in words
            if at_work and os.readlink(path.parent / "cwd").startswith(str(output)):
                return int(words[words.index(GUARD) + 1])
    return 0
