"""Batch: whatever is killed, full or broken, every row ends once and nothing half-made counts.

The laws are here; the faults, with real runs, are in ``test_batch_faults.py``.
"""

import csv
import html
import json
import re
import signal
import subprocess
from collections import Counter

import pytest
import trimesh
from autophyx_tet.fem.errors import InputError, UsageError
from autophyx_tet.toolkit import batch as task
from autophyx_tet.toolkit.batch import (
    BatchOptions,
    Job,
    Limits,
    Stopped,
    batch,
    index_page,
    perform,
    read_manifest,
    stored,
)
from PIL import Image

LIMITS = Limits(seconds=120, memory=8 * 10**9, threads=1)


def make_manifest(folder, *rows):
    columns = dict.fromkeys(name for row in rows for name in row)
    with (folder / "m.csv").open("w", newline="") as lines:
        table = csv.DictWriter(lines, columns)
        table.writeheader()
        table.writerows(rows)
    return folder / "m.csv"


def test_manifest_rows_become_jobs(tmp_path):
    """Paths are relative to the manifest, columns are options, doubled stems are numbered."""
    manifest = make_manifest(
        tmp_path,
        {"asset": "a/chair.glb", "text": "oak", "edge-length-rel": "0.1", "strict": "yes"},
        {"asset": "b/chair.glb", "text": "foam", "material": "leg=steel; seat=felt"},
        {"asset": "c.glb", "text": "", "id": "chair-2", "strict": "no"},
    )
    first, second, third = read_manifest(manifest, common=["--seed=1"])
    assert (first.id, second.id, third.id) == ("chair", "chair-3", "chair-2")
    assert first.path == str(tmp_path / "a/chair.glb")
    assert first.arguments == ("--seed=1", "--edge-length-rel=0.1", "--strict")
    assert second.arguments[1:] == ("--material=leg=steel", "--material=seat=felt")
    assert third.arguments == ("--seed=1",)


def test_a_wrong_manifest_is_refused_before_the_work(tmp_path):
    wrong = (
        ("asset,text\n", InputError, "no row"),
        ("", InputError, "column names"),
        ("file,text\na,b\n", InputError, "asset"),
        ("asset,text,sizes\na,b,1\n", UsageError, "did you mean size"),
        ("asset,id\na,x\nb,x\n", UsageError, "twice"),
        ("asset,id\na,../x\n", UsageError, "name of a folder"),
        ("asset,id\na,.batch\n", UsageError, "name of a folder"),
        ("asset,text\na,b,c\n", InputError, "row 2"),
        ("asset,text\n,b\n", InputError, "no asset"),
    )
    for text, error, words in wrong:
        (tmp_path / "m.csv").write_text(text)
        with pytest.raises(error) as refused:
            batch(tmp_path / "m.csv", output=tmp_path / "out")
        assert words in str(refused.value), text
        assert not (tmp_path / "out").exists(), text


@pytest.mark.slow
def test_bad_assets_stop_nothing_and_are_named(tmp_path):
    """Missing, empty, flat, a wrong option: one row each, with the exit code of `run`."""
    (tmp_path / "empty.obj").write_text("")
    flat = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 1, 2]])
    flat.export(tmp_path / "<b>flat.stl")
    manifest = make_manifest(
        tmp_path,
        {"asset": "nowhere.glb", "text": "oak"},
        {"asset": "empty.obj", "text": "oak"},
        {"asset": "<b>flat.stl", "text": "<script>alert(1)</script>"},
        {"asset": "empty.obj", "text": "oak", "size": "abc"},
    )
    output = tmp_path / "out"
    document = batch(manifest, output=output, options=BatchOptions(workers=2)).document()
    assert [row["code"] for row in document["rows"]] == [3, 3, 4, 2]
    assert all(row["reason"] for row in document["rows"])
    assert document["done"] == 0
    with (output / "results.csv").open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    assert [row["code"] for row in rows] == ["3", "3", "4", "2"]
    saved = json.loads((output / "results.json").read_text())
    assert Counter(row["status"] for row in saved["rows"]) == {"failed": 4}
    page = (output / "index.html").read_text()
    assert "<b>flat" not in page
    assert not re.search(r"(src|href)=.?https?:|<script", page)
    again = batch(manifest, output=output, options=BatchOptions(workers=2)).document()
    assert again["new"] == 2  # what may be mended outside (exit 3) is tried again, 2 and 4 are kept


def test_hostile_words_of_a_result_stay_words(tmp_path):
    """The card of the page shows text and materials as written, and no element of them."""
    (tmp_path / "box").mkdir()
    Image.new("RGB", (8, 8)).save(tmp_path / "box" / "picture.png")
    words = "<script>alert(1)</script>\"' {{ 7 * 7 }}{% raw %} $count"
    row = {"id": "box", "folder": "box", "code": 0, "text": words, "materials": words}
    row |= {"tets": 6, "mass": 1.0, "seconds": 2.0, "warnings": 0}
    page = index_page((row,), tmp_path)
    assert "<script" not in page
    assert html.unescape(page).count(words) == 2
    assert "1 done, 0 failed" in page


def job(tmp_path):
    path = tmp_path / "box.stl"
    trimesh.creation.box((0.1, 0.1, 0.1)).export(path)
    return Job("box", "box.stl", "oak", str(path), ("--no-cache",))


@pytest.mark.slow
def test_limits_of_time_and_memory_hold(tmp_path):
    """A row that takes too long ends with 124; one that wants too much memory fails at once."""
    row = job(tmp_path)
    late = perform(row, str(tmp_path), Limits(0.2, 8 * 10**9, 1))
    assert (late.code, late.attempts) == (task.TIMED_OUT, 1)
    assert "0.2 s" in late.reason
    big = perform(row, str(tmp_path), Limits(60, 150 * 10**6, 1))
    assert big.code not in (0, task.TIMED_OUT)
    assert big.reason
    assert stored(row, tmp_path) is None  # both are worth another try
    assert not (tmp_path / "box").exists()


def test_a_row_whose_process_is_always_killed_is_named(tmp_path, monkeypatch):
    """One replacement is given; then the row is listed as killed, and nothing is left of it."""
    real = subprocess.Popen

    def killed(*arguments, **options):
        child = real(*arguments, **options)
        child.send_signal(signal.SIGKILL)
        return child

    monkeypatch.setattr(subprocess, "Popen", killed)
    ended = perform(job(tmp_path), str(tmp_path), LIMITS)
    assert (ended.code, ended.attempts, ended.reason) == (137, task.ATTEMPTS, "killed by SIGKILL")
    assert not list((tmp_path / ".batch/work").iterdir())


def test_a_stopped_row_is_neither_done_nor_failed(tmp_path):
    with pytest.raises(Stopped):
        perform(job(tmp_path), str(tmp_path), LIMITS, stopped=lambda: True)
    assert not list((tmp_path / ".batch/work").iterdir())
    assert not (tmp_path / ".batch/failed").exists()


def test_two_batches_in_one_folder_are_refused(tmp_path):
    from autophyx_tet.toolkit.batch import _alone

    with _alone(tmp_path), pytest.raises(UsageError, match="another batch"), _alone(tmp_path):
        pass


def test_a_folder_that_no_batch_made_is_never_replaced(tmp_path):
    """A row named like a folder of the user's own is refused before the work; a table too."""
    (tmp_path / "box").mkdir()
    (tmp_path / "box" / "thesis.txt").write_text("five years")
    manifest = make_manifest(tmp_path, {"asset": "box.stl", "text": "oak"})
    with pytest.raises(InputError, match="box is not the result"):
        batch(manifest, output=tmp_path)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "results.json").write_text("[]")
    with pytest.raises(InputError, match=r"results\.json is not ours"):
        batch(manifest, output=tmp_path / "out")
    assert [path.name for path in (tmp_path / "box").iterdir()] == ["thesis.txt"]
