"""The cache on disk: unfinished files are left alone, the oldest go first, races are no errors."""

import os
import threading
import time
from pathlib import Path

import numpy as np
from autophyx_tet.toolkit.asset import cache
from autophyx_tet.toolkit.asset.cache import recalled, remember

KILOBYTE = {"values": np.random.default_rng(0).integers(0, 256, 1000, dtype=np.uint8)}


def names(folder):
    return {path.name for path in folder.iterdir()}


def aged(path, seconds):
    """A file of one kilobyte, last used so long ago."""
    path.write_bytes(bytes(1000))
    os.utime(path, (time.time() - seconds,) * 2)
    return path


def test_what_was_not_used_for_longest_goes_first(tmp_path, monkeypatch):
    """Room for three of about 1.2 kB: of four the one that was not recalled since is forgotten."""
    monkeypatch.setattr(cache, "MOST_BYTES", 4000)
    for i in range(3):
        remember(tmp_path / f"{i}.npz", KILOBYTE)
        os.utime(tmp_path / f"{i}.npz", (i, i))
    assert recalled(tmp_path / "0.npz") is not None
    remember(tmp_path / "3.npz", KILOBYTE)
    assert names(tmp_path) == {"0.npz", "2.npz", "3.npz"}


def test_a_file_that_another_process_is_writing_stays(tmp_path, monkeypatch):
    """Its name begins with ours for temporaries; one of a process that was killed goes in time."""
    monkeypatch.setattr(cache, "MOST_BYTES", 2000)
    fresh = aged(tmp_path / ".tmp-0123456789ab.npz", 60)
    dead = aged(tmp_path / ".tmp-ba9876543210.npz", 2 * cache.ABANDONED)
    foreign = aged(tmp_path / "notes.txt", 2 * cache.ABANDONED)
    old = aged(tmp_path / "old.npz", 3600)
    remember(tmp_path / "new.npz", KILOBYTE)
    assert fresh.exists()
    assert foreign.exists()
    assert not dead.exists()
    assert not old.exists()


def test_a_result_that_vanishes_meanwhile_is_no_error(tmp_path, monkeypatch):
    """Another process forgets a file between our listing and our look at it."""
    gone = aged(tmp_path / "gone.npz", 60)
    stat = Path.stat

    def vanishing(path, **options):
        if path == gone:
            gone.unlink(missing_ok=True)
        return stat(path, **options)

    monkeypatch.setattr(Path, "stat", vanishing)
    remember(tmp_path / "new.npz", KILOBYTE)
    assert names(tmp_path) == {"new.npz"}


def test_many_writers_of_one_folder(tmp_path, monkeypatch):
    """Four threads write and forget in a folder that holds three results: nobody is disturbed."""
    monkeypatch.setattr(cache, "MOST_BYTES", 4000)
    errors = []

    def work(number):
        try:
            for i in range(25):
                remember(tmp_path / f"{number}-{i % 5}.npz", KILOBYTE)
                found = recalled(tmp_path / f"{(number + 1) % 4}-{i % 5}.npz")
                assert found is None or (found["values"] == KILOBYTE["values"]).all()
        except Exception as error:
            errors.append(error)

    threads = [threading.Thread(target=work, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not errors
    assert not list(tmp_path.glob(".tmp-*"))
    assert sum(path.stat().st_size for path in tmp_path.iterdir()) < 6000


def test_a_cache_that_cannot_be_written_costs_nothing_but_time(tmp_path):
    """A file where the folder should be: the result is not kept, and that is all."""
    (tmp_path / "cache").write_text("a file")
    remember(tmp_path / "cache" / "a.npz", KILOBYTE)
    assert recalled(tmp_path / "cache" / "a.npz") is None
