"""The lattice mesher on whole corpora: share converted, inverted tets, angles, volumes, seconds.

    python benchmarks/stuffing.py --corpus cgal --limit 40 --rows stuffing.jsonl

One JSON row an input, appended to ``--rows``; a second run skips what is there. Seconds are those
of the processor for loading, repair, the mesh and its report. Inputs that enclose no volume, by the
mesher's own message, are counted apart. ``--clock 50000 200000`` takes only the mesher's time on
every file of the corpus, kernels warm, the least of ``CLOCKED`` runs.
"""

from __future__ import annotations

import argparse
import json
import time
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
from autophyx_tet.fem.errors import AutophyxError
from autophyx_tet.predictors.asset import Asset
from autophyx_tet.toolkit.asset.cache import Runner
from autophyx_tet.toolkit.asset.load import load_asset
from autophyx_tet.toolkit.meshing.convert import Preparation, tetrahedralize
from autophyx_tet.toolkit.meshing.ftetwild import EngineTarget
from autophyx_tet.toolkit.meshing.guarantees import ENVELOPE_SHARE, ConversionReport
from autophyx_tet.toolkit.meshing.quality import dihedral_angles
from autophyx_tet.toolkit.meshing.stuffing.lattice import SolidField
from autophyx_tet.toolkit.meshing.stuffing.mesher import stuff, stuffed
from corpora import corpus, root_of

CLOCKED = 4  # runs after a first one


def main() -> None:
    args = _arguments()
    root = root_of(args.corpus, Path(args.folder).resolve())
    inputs = corpus(args.corpus, root, args.limit)
    if args.clock:
        for path in inputs:
            print(path.name, json.dumps([clocked(path, tets) for tets in args.clock]), flush=True)
        return
    rows = [json.loads(line) for line in args.rows.open()] if args.rows.exists() else []
    known = {row["input"] for row in rows}
    for path in np.random.default_rng(0).permutation(np.array(inputs, dtype=object)):
        name = path.relative_to(root).as_posix()
        if name in known or path.stat().st_size > args.most_bytes:
            continue
        rows.append({"input": name} | measured(path, args.tets))
        with args.rows.open("a") as out:
            out.write(json.dumps(rows[-1]) + "\n")
        print(json.dumps(rows[-1]), flush=True)
    print(json.dumps(summary(rows), indent=1))


def measured(path: Path, tets: int | None) -> dict:
    """One input, through everything but the file that is written."""
    started = time.process_time()
    try:
        asset = load_asset(path)
        mesh, report = tetrahedralize(asset, mesher="stuffing", max_tets=tets)
    except AutophyxError as error:
        return {"exit": error.exit_code, "reason": str(error)[:300]}
    found, seconds = report.quality, time.process_time() - started
    return {
        "exit": 0,
        "cpu_s": round(seconds, 2),
        "tets": len(mesh.tets),
        "inverted": int((mesh.volumes <= 0).sum()),
        "dihedral": [round(found.dihedral_min, 2), round(found.dihedral_max, 2)],
        **again(asset, report),
        "bad_edges": found.boundary.bad_edges,
        "volume_error": round(mesh.volume / report.input_volume - 1, 4),
        "distances_by_edge": [
            round(d / report.edge_length, 3)
            for d in (report.distances.to_input, report.distances.from_input)
        ],
        "attempts": len(report.attempts),
        "warnings": [w[:160] for w in report.warnings],
    }


def clocked(path: Path, tets: int) -> dict:
    """Least processor seconds of the mesher for so many tets wanted, matched and snapped."""
    asset, epsilon = load_asset(path), 2e-3
    diagonal = float(np.linalg.norm(asset.size))
    target = EngineTarget.of(diagonal, None, epsilon, sharp=not asset.sampled)
    target = replace(target, tets=tets)
    way = Preparation.of(asset, thinnest=target.envelope, thicken=None, walls={})
    seconds, found = [], 0
    for _ in range(1 + CLOCKED):
        solids = way.prepared(epsilon=target.epsilon, rng=np.random.default_rng(0)).solids
        started = time.process_time()
        found = len(stuffed(solids, target, Runner(60.0)).mesh.tets)
        seconds.append(round(time.process_time() - started, 2))
    return {"wanted": tets, "tets": found, "mesher_cpu_s": min(seconds[1:])}


def again(asset: Asset, report: ConversionReport) -> dict:
    """Seconds of the mesher alone; dihedral angles [degrees] of its lattice before it snaps."""
    epsilon = 2e-3 * report.diagonal
    way = Preparation.of(asset, thinnest=ENVELOPE_SHARE * epsilon, thicken=None, walls={})
    solids = way.prepared(epsilon=epsilon, rng=np.random.default_rng(0)).solids
    started = time.process_time()
    edge = report.edge_length / report.diagonal
    target = EngineTarget(report.diagonal, edge, epsilon_rel=2e-3, stop_energy=20.0)
    stuffed(solids, replace(target, sharp=not asset.sampled), Runner(60.0))
    seconds = time.process_time() - started
    field = SolidField(solids, origin=solids.bounds[0], edge=report.edge_length)
    mesh = stuff(field, sharp=False).mesh
    angles = dihedral_angles(mesh.points, mesh.tets)
    return {
        "mesher_cpu_s": round(seconds, 2),
        "dihedral_unsnapped": [round(float(angles.min()), 2), round(float(angles.max()), 2)],
    }


def summary(rows: list[dict]) -> dict:
    """Counts, the worst angles, medians."""
    done = [row for row in rows if row["exit"] == 0]
    empty = [row for row in rows if row["exit"] != 0 and "encloses a volume" in row["reason"]]
    other = [row for row in rows if row["exit"] != 0 and row not in empty]
    return {
        "inputs": len(rows),
        "converted": len(done),
        "without a volume": len(empty),
        "not converted": {row["input"]: row["reason"] for row in other},
        "inverted tets": sum(row["inverted"] for row in done),
        "dihedral": [
            min(row["dihedral"][0] for row in done),
            max(row["dihedral"][1] for row in done),
        ],
        "dihedral before snapping": [
            min(row["dihedral_unsnapped"][0] for row in done),
            max(row["dihedral_unsnapped"][1] for row in done),
        ],
        "tets, 10 %, median, 90 %": np.quantile(
            [r["tets"] for r in done], [0.1, 0.5, 0.9]
        ).tolist(),
        "volume within 1 %": sum(abs(row["volume_error"]) <= 0.01 for row in done),
        "volume error, largest": max(abs(row["volume_error"]) for row in done),
        "distance / edge, medians": np.median(
            [row["distances_by_edge"] for row in done], axis=0
        ).tolist(),
        "mesher_cpu_s, median and largest": [
            float(np.median([row["mesher_cpu_s"] for row in done])),
            max(row["mesher_cpu_s"] for row in done),
        ],
        "cpu_s, median and largest": [
            float(np.median([row["cpu_s"] for row in done])),
            max(row["cpu_s"] for row in done),
        ],
    }


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--corpus", default="cgal", help="cgal, sweethome3d or a folder")
    parser.add_argument("--folder", default=".cache/corpora", help="where corpora are unpacked")
    parser.add_argument("--limit", type=int, default=None)
    parser.add_argument("--tets", type=int, default=None, help="at most; default 50,000 wanted")
    parser.add_argument("--clock", type=int, nargs="+", default=None, help="tets wanted")
    parser.add_argument("--most-bytes", type=int, default=2**25, help="larger files are left out")
    parser.add_argument("--rows", type=Path, default=Path("stuffing.jsonl"))
    return parser.parse_args()


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    main()
