"""Batch on real furniture with a worker and the driver killed, and how two workers scale.

python benchmarks/batch.py furniture --count 50 --time-limit 240 -o out/batch
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
import time
from pathlib import Path

from autophyx_tet.research.datasets.sweethome3d import SOURCES, catalog, extract

# Coarse, so that fifty objects fit into minutes; the scenario is the default, sag.
COARSE = {"edge_length_rel": 0.1, "epsilon_rel": 0.01, "max_tets": 4000, "order": 1, "cells": 24}
KEPT = ("id", "asset", "text", "code", "reason", "attempts", "seconds", "tets", "mass")  # of a row
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


def call(manifest: Path, output: Path, options: argparse.Namespace, workers: int):
    """Start the batch as a user would."""
    command = [sys.executable, "-m", "autophyx_tet", "batch", str(manifest), "--json"]
    command += ["-o", str(output), "--workers", str(workers), "--time-limit", options.time_limit]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def results(output: Path) -> dict[str, int]:
    """Finished rows and when they were finished."""
    return {path.parent.name: path.stat().st_mtime_ns for path in output.glob("*/batch.json")}


def wait(driver: subprocess.Popen, output: Path, count: int) -> None:
    """Return when ``count`` rows are finished, or the driver has ended."""
    while len(results(output)) < count and driver.poll() is None:
        time.sleep(0.2)


def children(pid: int) -> list[int]:
    """Processes that any thread of ``pid`` started."""
    tasks = Path(f"/proc/{pid}/task").glob("*/children")
    return [int(child) for task in tasks for child in task.read_text().split()]


def kill_worker(driver: subprocess.Popen) -> None:
    """SIGKILL one process that the driver started."""
    while driver.poll() is None:
        if found := children(driver.pid):
            os.kill(found[0], signal.SIGKILL)
            return
        time.sleep(0.05)


def furniture(folder: Path, output: Path, options: argparse.Namespace) -> dict:
    """A third done: a worker is killed; two thirds: the driver, and the same command goes on."""
    manifest = furniture_manifest(folder, options.count)
    started = time.perf_counter()
    driver = call(manifest, output, options, options.workers)
    wait(driver, output, options.count // 3)
    kill_worker(driver)
    wait(driver, output, 2 * options.count // 3)
    driver.kill()
    driver.communicate()
    before = results(output)
    driver = call(manifest, output, options, options.workers)
    document = json.loads(driver.communicate()[0])
    after = results(output)
    return {
        "rows": [{name: row[name] for name in KEPT} for row in document["rows"]],
        "done": document["done"],
        "failed": document["failed"],
        "done_before_the_driver_was_killed": len(before),
        "done_twice": sum(after.get(name) != when for name, when in before.items()),
        "seconds": round(time.perf_counter() - started, 1),
    }


def scaling(folder: Path, output: Path, options: argparse.Namespace) -> dict:
    """The same boxes with one worker, then with two."""
    manifest, rows = box_manifest(folder, options.count), []
    for workers in (1, 2):
        started = time.perf_counter()
        driver = call(manifest, output / str(workers), options, workers)
        done = json.loads(driver.communicate()[0])["done"]
        rows.append({"workers": workers, "done": done, "seconds": time.perf_counter() - started})
    return {"rows": [row | {"speedup": rows[0]["seconds"] / row["seconds"]} for row in rows]}


def told(found: dict) -> str:
    """What a person wants to know."""
    lines = [
        f"{name.replace('_', ' ')}: {value}" for name, value in found.items() if name != "rows"
    ]
    for row in found["rows"]:
        if "workers" in row:
            lines.append("{workers} workers: {seconds:.1f} s, {speedup:.2f} x".format(**row))
        elif row["code"] or row["attempts"] > 1:
            lines.append("{id}: exit {code} after {attempts} attempts: {reason}".format(**row))
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("furniture", "scaling"))
    parser.add_argument("--count", type=int, default=8)
    parser.add_argument("--workers", type=int, default=2, help="of furniture")
    parser.add_argument("--time-limit", default="240", help="seconds of one asset")
    parser.add_argument("-o", "--output", type=Path, default=None, help="folder to keep")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        measure = {"furniture": furniture, "scaling": scaling}[options.what]
        found = measure(folder, options.output or folder / "out", options)
    print(json.dumps(found, indent=1) if options.json else told(found))


if __name__ == "__main__":
    main()
