"""From a file of Gaussian splats to a moving sequence and a GIF by the material point method.

    python benchmarks/mpm_splats.py [--piece BlendSwap-CC-0/electricGuitar] [--splats 60000]

Splats lie on the surface of a piece of Debian's sweethome3d-furniture, in its colours. Then the
commands of a user, each its own process: `convert`, `assign "rubber"`, `simulate --solver mpm
--scenario wind --grid 32 --drive`. One line of JSON: wall and CPU seconds of each, and in total.
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

from driven_picture import splats
from real_meshes import cache_folder

PROGRAM = [sys.executable, "-m", "autophyx_tet"]


def spent(*words: object) -> dict[str, float]:
    """Wall and CPU seconds of a command; it must succeed."""
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run([*PROGRAM, *map(str, words)], check=True, stdout=sys.stderr)
    after, wall = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter() - began
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return {"wall_s": round(wall, 1), "cpu_s": round(cpu, 1)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--piece", default="BlendSwap-CC-0/electricGuitar")
    parser.add_argument("--splats", type=int, default=60_000)
    parser.add_argument("--grid", type=int, default=32)
    parser.add_argument("--output", type=Path, help="folder for the frames, else thrown away")
    options = parser.parse_args()
    from autophyx_tet.toolkit.io import sweethome3d
    from autophyx_tet.toolkit.io.load import load_asset

    (item,) = (
        i for i in sweethome3d.catalog(options.piece.split("/")[0]) if i.key == options.piece
    )
    asset = load_asset(sweethome3d.extract(item, cache_folder() / "assets"))
    with tempfile.TemporaryDirectory() as folder:
        root = options.output or Path(folder)
        root.mkdir(parents=True, exist_ok=True)
        carrier = splats(asset, root / "splats.ply", total=options.splats)
        solid, matter = root / "solid.msh", root / "matter.msh"
        row = {
            "convert": spent(
                "convert", carrier, "-o", solid, "--size", max(item.size), "--up", asset.up,
            ),
            "assign": spent("assign", solid, "--text", "rubber", "-o", matter),
            "simulate": spent(
                "simulate", matter, "--solver", "mpm", "--scenario", "wind",
                "--grid", options.grid, "--drive", carrier, "-o", root / "motion",
            ),
        }  # fmt: skip
        row["total"] = {
            key: round(sum(stage[key] for stage in row.values()), 1) for key in ("wall_s", "cpu_s")
        }
        frames = len(list(root.rglob("*.ply"))) - 1
        films = [path.name for path in root.rglob("*.gif")]
    about = {"piece": options.piece, "splats": options.splats, "grid": options.grid}
    print(json.dumps({**about, "frames": frames, "films": films, "load": os.getloadavg(), **row}))


if __name__ == "__main__":
    main()
