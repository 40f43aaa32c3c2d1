"""CPU seconds of `autophyx-tet simulate` on the demo's mesh, all verdicts, by stage.

    python benchmarks/simulate.py --json

Each run is a fresh process, its imports too; the total is the median of ``--repeats`` plain runs.
The stages come from one more run under a profiler: CPU seconds inside the function named.
"""

from __future__ import annotations

import argparse
import cProfile
import json
import os
import pstats
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.update({f"{name}_NUM_THREADS": "1" for name in ("OMP", "MKL", "OPENBLAS", "NUMEXPR")})

import numpy as np
from real_meshes import cache_folder, demo_mesh

# Stage: the functions whose CPU seconds it is, by file and name. "imports" overlaps the others.
STAGES = {
    "imports": [("<frozen importlib._bootstrap>", "_find_and_load")],
    "read the mesh": [("converters/mesh/mesh_file.py", "read_mesh")],
    "supports": [("fem/scene/support_finder.py", "find_supports")],
    "static, P2 and P1": [("fem/solve/statics.py", "solve_static")],
    "of it ordering": [("fem/cholesky/elimination.py", "plan_elimination")],
    "of it factors": [("fem/cholesky/factor.py", "known_factor")],
    "modes": [("fem/solve/modal.py", "natural_modes")],
    "buckling": [("fem/solve/stability.py", "find_load_factor")],
    "ends of the ranges": [("fem/uncertainty/intervals.py", "displacement_interval")],
    "what is likely": [("fem/uncertainty/likely.py", "likely_answers")],
    "write": [("toolkit/results/simulation.py", "write"), ("toolkit/results/settled.py", "write")],
}


def command(mesh: Path, folder: str) -> list[str]:
    return ["simulate", str(mesh), "--scenario", "sag", "-o", str(Path(folder) / "sag.vtu")]


def plain(mesh: Path) -> dict:
    """CPU and wall seconds and memory of one process."""
    with tempfile.TemporaryDirectory() as folder:
        before, wall = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        call = [sys.executable, "-m", "autophyx_tet.toolkit.cli.main", *command(mesh, folder)]
        done = subprocess.run(call, check=True, capture_output=True, text=True)
        wall, after = time.perf_counter() - wall, resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return {"cpu_s": cpu, "wall_s": wall, "rss_mb": after.ru_maxrss / 1024, "said": done.stdout}


def profiled(mesh: Path) -> dict[str, float]:
    """CPU seconds of every stage; run in a process of its own."""
    profile = cProfile.Profile(time.process_time)
    with tempfile.TemporaryDirectory() as folder:
        profile.enable()
        from autophyx_tet.toolkit.cli.main import main as simulate

        sys.argv = ["autophyx-tet", *command(mesh, folder)]
        try:
            simulate()
        except SystemExit:
            pass
        profile.disable()
    stats = pstats.Stats(profile).stats  # type: ignore  (known since Python 1.5)
    return {
        stage: sum(
            entry[3]
            for (file, _, name), entry in stats.items()
            if any(file.endswith(end) and name == wanted for end, wanted in functions)
        )
        for stage, functions in STAGES.items()
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cache", type=Path, default=cache_folder(), help="folder of the mesh")
    parser.add_argument("--mesh", type=Path, help="another mesh with materials")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--stages-only", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    mesh = options.mesh or demo_mesh(options.cache)
    if options.stages_only:
        print(json.dumps(profiled(mesh)))
        return
    runs = [plain(mesh) for _ in range(options.repeats)]
    call = [sys.executable, __file__, "--stages-only", "--mesh", str(mesh)]
    stages = subprocess.run(call, check=True, capture_output=True, text=True).stdout
    document = {
        "schema": 1,
        "cpu_s": float(np.median([r["cpu_s"] for r in runs])),
        "wall_s": float(np.median([r["wall_s"] for r in runs])),
        "rss_mb": max(r["rss_mb"] for r in runs),
        "verdicts": [line for line in runs[-1]["said"].splitlines() if line[:1] in "✓✗i"],
        "rows": [
            {"stage": stage, "cpu_s": seconds}
            for stage, seconds in json.loads(stages.splitlines()[-1]).items()
        ],
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
