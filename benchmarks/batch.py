"""Batch on real furniture with a worker killed halfway, and how two workers scale.

python benchmarks/batch.py furniture --count 50 -o out/batch
python benchmarks/batch.py scaling --count 8
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

from autophyx_tet.toolkit.sweethome3d import SOURCES, catalog, extract

# Coarse, so that fifty objects fit into minutes; the scenario is the default, sag.
COARSE = {"edge_length_rel": 0.1, "epsilon_rel": 0.01, "max_tets": 4000, "order": 1, "cells": 24}
TEXTS = ("oak wood", "steel", "soft foam", "ceramic", "polypropylene plastic")


def furniture_manifest(folder: Path, count: int) -> Path:
    """Unpack ``count`` objects, evenly from the three sources, and list them."""
    rows = []
    lists = [catalog(source) for source in SOURCES]
    for i in range(count):
        items = lists[i % len(lists)]
        item = items[(i // len(lists)) * len(items) // (count // len(lists) + 1)]
        path = extract(item, folder / "assets" / item.source)
        text = TEXTS[i % len(TEXTS)]
        rows.append({"asset": path.relative_to(folder), "text": text, "size": max(item.size)})
    return write_manifest(folder, rows)


def box_manifest(folder: Path, count: int) -> Path:
    """Boxes of different sides, so that no cache can help."""
    import trimesh

    rows = []
    for i in range(count):
        path = folder / f"box{i}.stl"
        trimesh.creation.box((0.1, 0.1, 0.1 + 0.01 * i)).export(path)
        rows.append({"asset": path.name, "text": TEXTS[i % len(TEXTS)], "no_cache": "yes"})
    return write_manifest(folder, rows)


def write_manifest(folder: Path, rows: list[dict]) -> Path:
    path = folder / "manifest.csv"
    with path.open("w", newline="") as lines:
        table = csv.DictWriter(lines, [*rows[0], *COARSE])
        table.writeheader()
        table.writerows(row | COARSE for row in rows)
    return path


def run(manifest: Path, output: Path, workers: int, *, kill_at: int | None = None) -> dict:
    """Run the batch as a user would; kill one worker after ``kill_at`` results."""
    command = [sys.executable, "-m", "autophyx_tet.toolkit.cli", "batch", str(manifest)]
    command += ["-o", str(output), "--workers", str(workers), "--time-limit", "240", "--json"]
    started = time.perf_counter()
    driver = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    if kill_at is not None:
        threading.Thread(target=kill_one, args=(driver.pid, output, kill_at), daemon=True).start()
    document = json.loads(driver.communicate()[0])
    return document | {"seconds": time.perf_counter() - started}


def kill_one(driver: int, output: Path, after: int) -> None:
    """SIGKILL a process of the driver once ``after`` rows have ended."""
    while len(list(output.glob("*/batch.json"))) < after:
        time.sleep(0.2)
    while not (found := children(driver)):
        time.sleep(0.05)
    os.kill(found[0], signal.SIGKILL)
    print(f"killed worker {found[0]} after {after} results", file=sys.stderr)


def children(pid: int) -> list[int]:
    """Processes that any thread of ``pid`` started."""
    tasks = Path(f"/proc/{pid}/task").glob("*/children")
    return [int(child) for task in tasks for child in task.read_text().split()]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("furniture", "scaling"))
    parser.add_argument("--count", type=int, default=8)
    parser.add_argument("-o", "--output", type=Path, default=None)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder, output = Path(name), options.output or Path(name, "out")
        if options.what == "furniture":
            manifest = furniture_manifest(folder, options.count)
            found = run(manifest, output, 2, kill_at=options.count // 2)
            tried = [row["id"] for row in found["rows"] if row["attempts"] > 1]
            print(f"{len(found['rows'])} rows: {found['done']} done, {found['failed']} failed")
            print(f"tried again: {tried}; {found['seconds']:.0f} s", *found["warnings"], sep="\n")
            return
        manifest = box_manifest(folder, options.count)
        times = [run(manifest, output / str(n), n)["seconds"] for n in (1, 2)]
        print(f"1 worker {times[0]:.1f} s, 2 workers {times[1]:.1f} s: {times[0] / times[1]:.2f} x")


if __name__ == "__main__":
    main()
