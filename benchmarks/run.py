"""Whole `run` commands as a user types them, cold: seconds by stage, wall and CPU.

    python benchmarks/run.py --json

``demo`` is the bonsai of ``make demo``, ``kept`` the same with its mesh kept of an earlier run,
``lattice`` by isosurface stuffing, ``scan`` the head of 117,694 triangles that Debian's occt-misc
has, ``splats`` 100,000 Gaussians on the bonsai's skin.
Each is a fresh process with all its imports, and what it writes is thrown away; the figures are the
medians of ``--repeats``. Threads are as a user has them.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

from corpora import fetch_package
from driven_picture import splats
from real_meshes import DEMO_TEXT, cache_folder

SCAN = "usr/share/opencascade/data/stl/head.stl"
CASES = ("demo", "kept", "lattice", "scan", "splats")
TOTAL = 100_000  # Gaussians


def assets(names: list[str], folder: Path) -> dict[str, list[str]]:
    """What follows `run` of each case; files are made, or fetched, where they are not there."""
    from autophyx_tet.toolkit.asset.bonsai import write_bonsai
    from autophyx_tet.toolkit.asset.load import load_asset

    folder.mkdir(parents=True, exist_ok=True)
    bonsai = write_bonsai(folder / "bonsai.glb")
    kept = [str(bonsai), "--text", DEMO_TEXT]
    found = {"demo": [*kept, "--no-cache"], "kept": kept}
    found["lattice"] = [*found["demo"], "--mesher", "stuffing"]
    if "scan" in names:
        scan = fetch_package("occt-misc", folder / "occt-misc") / SCAN
        found["scan"] = [str(scan), "--units", "mm", "--text", "marble", "--no-cache"]
    if "splats" in names:
        carrier = splats(load_asset(bonsai), folder / "splats.ply", total=TOTAL)
        found["splats"] = [str(carrier), "--size", "0.4", "--text", "oak", "--no-cache"]
    return {name: found[name] for name in names}


def once(words: list[str]) -> dict:
    """Wall and CPU seconds of one process, by stage as its run.json has them."""
    with tempfile.TemporaryDirectory() as folder:
        call = [sys.executable, "-m", "autophyx_tet", "run", *words, "-o", folder, "-q"]
        before, wall = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        subprocess.run(call, check=True, stdout=subprocess.DEVNULL)
        wall, after = time.perf_counter() - wall, resource.getrusage(resource.RUSAGE_CHILDREN)
        made = json.loads((Path(folder) / "run.json").read_text())
        written = sum(path.stat().st_size for path in Path(folder).iterdir())
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    stages = {"tets": made["tets"], "seconds": made["seconds"], "cpu_seconds": made["cpu_seconds"]}
    return {"wall_s": wall, "cpu_s": cpu, "written_mb": written / 1e6, **stages}


def main() -> None:
    """Print a row a case."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", nargs="+", default=list(CASES))
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--cache", type=Path, default=cache_folder(), help="folder of the assets")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # users have their modules compiled
    rows = []
    for name, words in assets(options.cases, options.cache).items():
        if name == "kept":
            once(words)
        runs = sorted((once(words) for _ in range(options.repeats)), key=lambda run: run["wall_s"])
        middle = runs[len(runs) // 2]
        cpu = median(run["cpu_s"] for run in runs)
        rows.append({"case": name, **middle, "cpu_s": cpu})
        if not options.json:
            stages = ", ".join(f"{stage} {s:.1f}" for stage, s in middle["seconds"].items())
            print(
                f"{name}: {middle['wall_s']:.1f} s wall, {cpu:.1f} CPU s ({stages}), "
                f"{middle['tets']} tets, {middle['written_mb']:.0f} MB",
                flush=True,
            )
    if options.json:
        print(json.dumps(rows))


if __name__ == "__main__":
    main()
