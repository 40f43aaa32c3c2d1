"""From a file of Gaussian splats to a moving sequence and a film by the material point method.

    python benchmarks/mpm_splats.py [--piece BlendSwap-CC-0/electricGuitar] [--splats 60000]

Splats lie on the surface of a piece of Debian's sweethome3d-furniture, in its colours. Then the
commands of a user, each its own process: `convert`, `assign "rubber"`, `simulate --solver mpm
--scenario wind --wind-speed 5 --grid 32 --drive`, its lower part held. One line of JSON: wall and
CPU seconds of each, and in total.
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

# Size of a splat as a share of the piece's: of 60,000 every one reaches its neighbours.
SIZE = 0.003
PROGRAM = [sys.executable, "-m", "autophyx_tet"]


def spent(*words: object) -> dict[str, float]:
    """Wall and CPU seconds of a command; it must succeed."""
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run([*PROGRAM, *map(str, words)], check=True, stdout=sys.stderr)
    after, wall = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter() - began
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return {"wall_s": round(wall, 1), "cpu_s": round(cpu, 1)}


def lower_part(path: Path, up: str, share: float) -> str:
    """Place of what lies in the lowest ``share`` of the height of a mesh."""
    from autophyx_tet.converters.mesh.meshdata import read_mesh

    low, high = read_mesh(path).bounds[:, "xyz".index(up)]
    return f"plane:{up}<{low + share * (high - low):.4g}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--piece", default="BlendSwap-CC-0/electricGuitar")
    parser.add_argument("--splats", type=int, default=60_000)
    parser.add_argument("--grid", type=int, default=32)
    parser.add_argument("--text", default="rubber")
    parser.add_argument("--held", type=float, default=0.45, help="share of the height")
    parser.add_argument("--output", type=Path, help="folder for the frames, else thrown away")
    options = parser.parse_args()
    from autophyx_tet.research.datasets import sweethome3d
    from autophyx_tet.toolkit.asset.load import load_asset

    (item,) = (
        i for i in sweethome3d.catalog(options.piece.split("/")[0]) if i.key == options.piece
    )
    asset = load_asset(sweethome3d.extract(item, cache_folder() / "assets"))
    with tempfile.TemporaryDirectory() as folder:
        root = options.output or Path(folder)
        root.mkdir(parents=True, exist_ok=True)
        carrier = splats(asset, root / "splats.ply", total=options.splats, share=SIZE)
        solid, matter = root / "solid.msh", root / "matter.msh"
        row = {
            "convert": spent(
                "convert", carrier, "-o", solid, "--size", max(item.size), "--up", asset.up,
            ),
            "assign": spent("assign", solid, "--text", options.text, "-o", matter),
            "simulate": spent(
                "simulate", matter, "--solver", "mpm", "--scenario", "wind",
                "--wind-speed", 5, "--grid", options.grid, "--drive", carrier,
                "-o", root / "motion", "--fix", lower_part(solid, asset.up, options.held),
            ),
        }  # fmt: skip
        row["total"] = {
            key: round(sum(stage[key] for stage in row.values()), 1) for key in ("wall_s", "cpu_s")
        }
        frames = len(list(root.rglob("*.ply"))) - 1
        films = [path.name for path in root.rglob("*.webp")]
    about = {"piece": options.piece, "splats": options.splats, "grid": options.grid}
    print(json.dumps({**about, "frames": frames, "films": films, "load": os.getloadavg(), **row}))


if __name__ == "__main__":
    main()
