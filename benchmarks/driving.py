"""Motion onto splats: CPU seconds of embedding and of every frame, harmonics turned, files written.

``python benchmarks/driving.py [--splats 100000] [--frames 50]`` prints one line of JSON. The splats
have three bands of harmonics, the mesh 34,560 tets, and it bends more from frame to frame.
"""

import argparse
import json
import tempfile
import time
from pathlib import Path

import numpy as np
from autophyx_tet.converters.embedding import Driven
from autophyx_tet.converters.points.gaussians import standard_columns
from autophyx_tet.converters.points.table import PointTable, read_points, write_points
from autophyx_tet.fem import box_mesh

SIZE = (1.0, 0.3, 0.3)


def splats(count: int) -> PointTable:
    rng = np.random.default_rng(0)
    turns = rng.normal(size=(count, 4))
    return PointTable(
        standard_columns(
            rng.uniform((0, 0, 0), SIZE, (count, 3)),
            rng.uniform(-8, -3, (count, 3)),
            turns / np.linalg.norm(turns, axis=1, keepdims=True),
            rng.uniform(0.1, 0.9, count),
            rng.normal(size=(count, 3)),
            rng.normal(size=(count, 3, 15)),
        )
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--splats", type=int, default=100_000)
    parser.add_argument("--frames", type=int, default=50)
    options = parser.parse_args()
    mesh = box_mesh(SIZE, (40, 12, 12))
    bend = np.stack([0 * mesh.points[:, 0], 0 * mesh.points[:, 0], mesh.points[:, 0] ** 2], axis=1)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "splats.ply"
        write_points(path, splats(options.splats))
        began = time.process_time()
        driven = Driven.of(read_points(path), mesh)
        embedded = time.process_time()
        shares = np.linspace(0, 0.3, options.frames)
        for i, table in enumerate(driven.frames(share * bend for share in shares)):
            write_points(Path(folder) / f"{i:05d}.ply", table)
            (Path(folder) / f"{i:05d}.ply").unlink()
        ended = time.process_time()
    row = {
        "splats": options.splats,
        "frames": options.frames,
        "embedding_seconds": round(embedded - began, 2),
        "frame_seconds": round((ended - embedded) / options.frames, 3),
        "cpu_seconds": round(ended - began, 2),
        "outside": driven.outside,
    }
    print(json.dumps(row))


if __name__ == "__main__":
    main()
