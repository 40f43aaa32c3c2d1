"""CPU seconds of `autophyx-tet simulate` on the demo's mesh, all verdicts, by stage.

    python benchmarks/simulate.py --json

Each run is a fresh process, its imports too; the total is the median of ``--repeats`` runs. The
stages are those of one of as many further runs, ``stage_clock.py``'s, whose own total is said too.
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

os.environ.update({f"{name}_NUM_THREADS": "1" for name in ("OMP", "MKL", "OPENBLAS", "NUMEXPR")})
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # users have their modules compiled

import numpy as np
from real_meshes import cache_folder, demo_mesh

CLOCK = Path(__file__).with_name("stage_clock.py")


def command(mesh: Path, folder: str) -> list[str]:
    return ["simulate", str(mesh), "--scenario", "sag", "-o", str(Path(folder) / "sag.vtu")]


def plain(mesh: Path) -> dict:
    """CPU and wall seconds and memory of one process."""
    with tempfile.TemporaryDirectory() as folder:
        before, wall = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        call = [sys.executable, "-m", "autophyx_tet", *command(mesh, folder)]
        done = subprocess.run(call, check=True, capture_output=True, text=True)
        wall, after = time.perf_counter() - wall, resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return {"cpu_s": cpu, "wall_s": wall, "rss_mb": after.ru_maxrss / 1024, "said": done.stdout}


def staged(mesh: Path) -> dict[str, float]:
    """CPU seconds of every stage of one process; they add up to its total."""
    with tempfile.TemporaryDirectory() as folder:
        call = [sys.executable, str(CLOCK), *command(mesh, folder)]
        done = subprocess.run(call, check=True, capture_output=True, text=True)
    return json.loads(done.stdout)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cache", type=Path, default=cache_folder(), help="folder of the mesh")
    parser.add_argument("--mesh", type=Path, help="another mesh with materials")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    mesh = options.mesh or demo_mesh(options.cache)
    runs = [plain(mesh) for _ in range(options.repeats)]
    clocked = sorted((staged(mesh) for _ in range(options.repeats)), key=lambda s: sum(s.values()))
    stages = clocked[len(clocked) // 2]
    document = {
        "schema": 1,
        "cpu_s": float(np.median([r["cpu_s"] for r in runs])),
        "wall_s": float(np.median([r["wall_s"] for r in runs])),
        "rss_mb": max(r["rss_mb"] for r in runs),
        "staged_cpu_s": sum(stages.values()),
        "verdicts": [line for line in runs[-1]["said"].splitlines() if line[:1] in "✓✗i"],
        "rows": [{"stage": stage, "cpu_s": seconds} for stage, seconds in stages.items()],
    }
    if options.json:
        print(json.dumps(document))
        return
    for row in document.pop("rows"):
        print(f"{row['stage']:20s} {row['cpu_s']:.2f} CPU s")
    print(*document.pop("verdicts"), sep="\n")
    print(", ".join(f"{key} {value:.4g}" for key, value in document.items() if key != "schema"))


if __name__ == "__main__":
    main()
