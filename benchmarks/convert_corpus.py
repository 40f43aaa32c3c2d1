"""Convert whole corpora beside other tools: every input and tool in a fresh, guarded process.

    python benchmarks/convert_corpus.py --corpus cgal --peers pytetwild --limit 60 --rows rows.jsonl

One JSON row per input and tool is appended to ``--rows``; a second run skips what is there.
``--json`` prints the document ``{"schema": 1, "rows": [...], "summary": {...}}``. The wall and
processor times of a row are those of the tool's whole process; the measuring of a peer's mesh is
not in them, ours measures itself.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tarfile
import tempfile
import time
from pathlib import Path

import numpy as np
from convert_table import OURS, read_rows, summary, table

SAMPLE = 60  # inputs that the peers are run on, evenly spread over the corpus
HERE = Path(__file__).resolve()


def main() -> None:
    args = _arguments()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that what runs is ended too
    if args.one:
        _child(args)
        return
    root = _root(args.corpus, Path(args.folder).resolve())
    inputs = corpus(args.corpus, root, args.limit)
    done = read_rows(args.rows)
    known = {(row["input"], row["tool"]) for row in done}
    peers = [peer for peer in args.peers.split(",") if peer]
    sample = set(inputs[:: max(1, -(-len(inputs) // SAMPLE))])
    # In random order, so that a run that is interrupted has seen a fair sample.
    for path in np.random.default_rng(0).permutation(np.array(inputs, dtype=object)):
        for tool in [OURS, *(peers if path in sample else [])]:
            name = path.relative_to(root).as_posix()
            if (name, tool) in known:
                continue
            row = {"input": name} | run_one(path, tool, args)
            done.append(row)
            with args.rows.open("a") as rows:
                rows.write(json.dumps(row) + "\n")
            print(json.dumps(row), file=sys.stderr, flush=True)
    document = {"schema": 1, "rows": done, "summary": summary(done)}
    if args.json:
        print(json.dumps(document))
    else:
        print(table(document["summary"]))


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--corpus", default="cgal", help="cgal, sweethome3d or a folder")
    parser.add_argument("--folder", default=".cache/corpora", help="where corpora are unpacked")
    parser.add_argument("--peers", default="", help="comma-separated: pytetwild,tetgen,gmsh")
    parser.add_argument("--limit", type=int, default=None)
    parser.add_argument("--rows", type=Path, default=Path("convert_corpus.jsonl"))
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--edge-length-rel", type=float, default=0.05)
    parser.add_argument("--epsilon-rel", type=float, default=2e-3)
    parser.add_argument("--stop-energy", type=float, default=20.0)
    parser.add_argument("--time-limit", type=float, default=300.0)
    parser.add_argument("--one", nargs=3, metavar=("TOOL", "INPUT", "OUT"), help=argparse.SUPPRESS)
    return parser.parse_args()


def _root(name: str, folder: Path) -> Path:
    """Folder that the inputs of a corpus are named in: ours for the known ones, else itself."""
    return folder / name if name in ("cgal", "sweethome3d") else Path(name).resolve()


def corpus(name: str, root: Path, limit: int | None) -> list[Path]:
    """Surface files of a corpus in a fixed order, evenly thinned to ``limit``."""
    if name == "cgal":
        _fetch_cgal(root)
        files = sorted(p for p in root.rglob("*") if p.suffix in (".off", ".ply", ".stl"))
    elif name == "sweethome3d":
        files = _sweethome3d(root)
    else:
        files = sorted(p for p in root.rglob("*") if p.is_file())
    if limit is not None and limit < len(files):
        files = [files[i] for i in np.linspace(0, len(files) - 1, limit).round().astype(int)]
    return files


def _fetch_cgal(root: Path) -> None:
    """Meshes of Debian's libcgal-demo, fetched once; needs no administrator."""
    if root.exists():
        return
    root.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=root.parent) as work:
        subprocess.run(["apt-get", "download", "libcgal-demo"], cwd=work, check=True)
        (deb,) = Path(work).glob("*.deb")
        subprocess.run(["dpkg", "-x", str(deb), work], check=True)
        with tarfile.open(next(Path(work).rglob("data.tar.gz"))) as archive:
            archive.extractall(Path(work) / "data", filter="data")
        (Path(work) / "data").rename(root)


def _sweethome3d(root: Path) -> list[Path]:
    from autophyx_tet.toolkit.io.sweethome3d import SOURCES, catalog, extract

    files = []
    for source in SOURCES:
        for item in catalog(source):
            path = root / source / item.model
            files.append(path if path.exists() else extract(item, root / source))
    return sorted(set(files))


def run_one(path: Path, tool: str, args: argparse.Namespace) -> dict:
    """Run one tool on one input in a fresh process group and measure what it leaves."""
    with tempfile.TemporaryDirectory() as work:
        command = [
            sys.executable, str(HERE), "--one", tool, str(path), work,
            "--edge-length-rel", str(args.edge_length_rel), "--epsilon-rel", str(args.epsilon_rel),
            "--stop-energy", str(args.stop_energy), "--time-limit", str(args.time_limit),
        ]  # fmt: skip
        # We may use several attempts, each within the limit; a peer has one.
        limit = args.time_limit * (5 if tool == OURS else 1) + 60
        code, wall, cpu, rss = _timed(command, Path(work), limit)
        row = {"tool": tool, "exit": code}
        row |= {"wall_s": round(wall, 2), "cpu_s": round(cpu, 2), "rss_mb": round(rss)}
        if tool != OURS and code == 0:
            measure = [*command]
            measure[3] = "measure"
            _timed(measure, Path(work), 600)
        found = Path(work) / "row.json"
        blank = {"guarantees": False, "tets": 0, "reason": _last_line(Path(work), code)}
        row |= json.loads(found.read_text()) if found.exists() else blank
        return row | {"reason": row["reason"].replace(f"{path.parent}/", "")}


def _timed(command: list[str], work: Path, limit: float) -> tuple[int, float, float, float]:
    """Exit code (124: time limit, negative: signal), wall and cpu seconds, peak memory [MiB]."""
    started = time.monotonic()
    with (work / "log.txt").open("ab") as log:
        process = subprocess.Popen(
            command, stdout=log, stderr=log, cwd=work, start_new_session=True
        )
    code: int | None = None
    try:
        while code is None:
            pid, status, usage = os.wait4(process.pid, os.WNOHANG)
            if pid:
                code = os.waitstatus_to_exitcode(status)
            elif time.monotonic() - started > limit:
                os.killpg(process.pid, signal.SIGKILL)
                _, _, usage = os.wait4(process.pid, 0)
                code = 124
            else:
                time.sleep(0.02)
    finally:
        if code is None:  # Ctrl-C: nothing is left behind
            os.killpg(process.pid, signal.SIGKILL)
    process.returncode = code
    wall = time.monotonic() - started
    return code, wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def _last_line(work: Path, code: int) -> str:
    lines = [line for line in (work / "log.txt").read_text(errors="replace").splitlines() if line]
    if code < 0:
        return signal.Signals(-code).name
    return "time limit" if code == 124 else (lines[-1][:300] if lines else "")


def _child(args: argparse.Namespace) -> None:
    """One tool on one input; the exit code is its verdict."""
    tool, path, out = args.one[0], Path(args.one[1]), Path(args.one[2])
    if tool == OURS:
        _ours(path, out, args)
    elif tool == "measure":
        _measure(path, out, args)
    else:
        points, tets = PEERS[tool](path, args)
        if not len(tets):
            sys.exit("no tets and no error")
        np.savez(out / "mesh.npz", points=points, tets=tets)


def _ours(path: Path, out: Path, args: argparse.Namespace) -> None:
    from autophyx_tet.fem.errors import AutophyxError
    from autophyx_tet.toolkit.io.load import load_asset
    from autophyx_tet.toolkit.meshing.tetrahedralize import tetrahedralize

    try:
        mesh, report = tetrahedralize(
            load_asset(path),
            edge_length_rel=args.edge_length_rel,
            epsilon_rel=args.epsilon_rel,
            stop_energy=args.stop_energy,
            time_limit=args.time_limit,
        )
    except AutophyxError as error:
        row = {"guarantees": False, "tets": 0, "reason": str(error)}
        (out / "row.json").write_text(json.dumps(row))
        sys.exit(error.exit_code)
    row = {
        "guarantees": report.ok,
        "tets": len(mesh.tets),
        "epsilon_rel": report.epsilon / report.diagonal,  # a coarser attempt keeps a wider one
        "min_dihedral_deg": round(report.quality.dihedral_min, 2),
        "hausdorff_to_rel": report.distances.to_input / report.diagonal,
        "hausdorff_from_rel": report.distances.from_input / report.diagonal,
        "attempts": len(report.attempts),
        "reason": "; ".join(report.failed),
    }
    (out / "row.json").write_text(json.dumps(row))


def _measure(path: Path, out: Path, args: argparse.Namespace) -> None:
    """Hold a peer's mesh against the same guarantees."""
    from autophyx_tet.converters.npz import load_npz
    from autophyx_tet.fem.scene.mesh import TetMesh
    from autophyx_tet.toolkit.io.load import load_asset
    from autophyx_tet.toolkit.meshing import conversion_report as conversion
    from autophyx_tet.toolkit.meshing.quality import quality
    from autophyx_tet.toolkit.surfaces.repair import repair
    from autophyx_tet.toolkit.surfaces.solids import Solids

    mesh = load_npz(out / "mesh.npz")
    asset = load_asset(path)
    diagonal = float(np.linalg.norm(asset.size))
    epsilon = args.epsilon_rel * diagonal
    rng = np.random.default_rng(0)
    surface, _ = repair(asset.parts)
    solids = Solids.of(surface, len(asset.parts), thinnest=epsilon)
    volume = conversion.input_volume(solids, len(asset.parts), rng=rng)
    body = TetMesh.oriented(mesh["points"], mesh["tets"])
    gaps = conversion.measure_distances(body, solids, epsilon=epsilon, rng=rng)
    measured = quality(body)
    kept = conversion.guarantees(body, measured, volume, gaps, epsilon)
    row = {
        "guarantees": all(g.ok for g in kept),
        "tets": len(body.tets),
        "min_dihedral_deg": round(measured.dihedral_min, 2),
        "hausdorff_to_rel": gaps.to_input / diagonal,
        "hausdorff_from_rel": gaps.from_input / diagonal,
        "reason": "; ".join(
            f"{g.name}: {g.value:.3g} > {g.threshold:.3g}" for g in kept if not g.ok
        ),
    }
    (out / "row.json").write_text(json.dumps(row))


def _surface(path: Path):
    import trimesh

    mesh = trimesh.load(path, force="mesh")
    return np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int32)


def _pytetwild(path: Path, args: argparse.Namespace):
    import pytetwild
    from autophyx_tet.toolkit.meshing.conversion_report import ENVELOPE_SHARE

    return pytetwild.tetrahedralize(
        *_surface(path),
        edge_length_fac=args.edge_length_rel,
        epsilon=ENVELOPE_SHARE * args.epsilon_rel,
        stop_energy=args.stop_energy,
        vtk_ordering=True,
    )


def _tetgen(path: Path, args: argparse.Namespace):
    import tetgen

    points, faces = _surface(path)
    edge = args.edge_length_rel * float(np.linalg.norm(np.ptp(points, axis=0)))
    generator = tetgen.TetGen(points, faces)
    made = generator.tetrahedralize(order=1, mindihedral=10, minratio=1.5, maxvolume=edge**3 / 6)
    return made[0], made[1]


def _gmsh(path: Path, args: argparse.Namespace):
    import gmsh

    points, _ = _surface(path)
    with tempfile.NamedTemporaryFile(suffix=".stl") as file:
        import trimesh

        trimesh.load(path, force="mesh").export(file.name)
        gmsh.initialize()
        gmsh.option.setNumber("General.Terminal", 0)
        edge = args.edge_length_rel * float(np.linalg.norm(np.ptp(points, axis=0)))
        gmsh.option.setNumber("Mesh.MeshSizeMax", edge)
        gmsh.merge(file.name)
        loop = gmsh.model.geo.addSurfaceLoop([tag for _, tag in gmsh.model.getEntities(2)])
        gmsh.model.geo.addVolume([loop])
        gmsh.model.geo.synchronize()
        gmsh.model.mesh.generate(3)
        tags, coordinates, _ = gmsh.model.mesh.getNodes()
        _, nodes = gmsh.model.mesh.getElementsByType(4)
    order = np.argsort(tags)
    tets = order[np.searchsorted(tags[order], nodes)].reshape(-1, 4)
    return coordinates.reshape(-1, 3), tets


PEERS = {"pytetwild": _pytetwild, "tetgen": _tetgen, "gmsh": _gmsh}


if __name__ == "__main__":
    main()
