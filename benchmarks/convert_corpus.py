"""Convert whole corpora beside other tools: every input and tool in a fresh, guarded process.

    python benchmarks/convert_corpus.py --corpus cgal --peers pytetwild --limit 60 --rows rows.jsonl

One JSON row per input and tool is appended to ``--rows``; a second run skips what is there. Inputs
are drawn in a random order of ``--seed``: ``--drawn 0 40`` are the first forty, a fair sample.
``--json`` prints the document ``{"schema": 1, "rows": [...], "summary": {...}}``. The wall and
processor times of a row are those of the tool's whole process; the measuring of a peer's mesh is
not in them, ours measures itself. ``--time-limit`` is in seconds of the processor. With
``--repeats 3`` the tools take turns, three times on every input.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from convert_table import OURS, read_rows, summary, table
from convert_tools import run_tool
from corpora import corpus, root_of

HERE = Path(__file__).resolve()
WAITING = 20.0  # times the limit of processor time that a tool may take by the wall clock


def main() -> None:
    args = _arguments()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that what runs is ended too
    if args.one:
        run_tool(args)
        return
    root = root_of(args.corpus, Path(args.folder).resolve())
    inputs = corpus(args.corpus, root, args.limit)
    done = read_rows(args.rows)
    known = {(row["input"], row["tool"]) for row in done}
    peers = [peer for peer in args.peers.split(",") if peer]
    if missing := [peer for peer in peers if find_spec(peer) is None]:
        sys.exit(f"not installed, so that no row would say anything: {', '.join(missing)}")
    sample = set(inputs[:: max(1, -(-len(inputs) // args.peer_sample))])
    version = _version()
    for path in _drawn(inputs, args):
        name = path.relative_to(root).as_posix()
        tools = [OURS, *(peers if path in sample else [])]
        tools = [tool for tool in tools if (name, tool) not in known]
        turns = [[run_one(path, tool, args) for tool in tools] for _ in range(args.repeats)]
        for runs in zip(*turns, strict=True):
            found = min(runs, key=lambda row: row["cpu_s"])
            row = {"input": name, "version": version} | found
            done.append(row)
            with args.rows.open("a") as rows:
                rows.write(json.dumps(row) + "\n")
            print(json.dumps(row), file=sys.stderr, flush=True)
    document = {"schema": 1, "rows": done, "summary": summary(done)}
    if args.json:
        print(json.dumps(document))
    else:
        print(table(document["summary"]))


def _drawn(inputs: list[Path], args: argparse.Namespace) -> list[Path]:
    """Inputs in random order, so that a run that is interrupted has seen a fair sample."""
    inputs = [path for path in inputs if path.stat().st_size <= args.most_bytes]
    order = np.random.default_rng(args.seed).permutation(np.array(inputs, dtype=object))
    drawn = order[slice(*args.drawn)].tolist()
    return sorted(drawn, key=lambda path: path.stat().st_size) if args.smallest_first else drawn


def _version() -> str:
    """Commit of the code that runs, "" where it is none."""
    command = ["git", "-C", str(HERE.parent), "describe", "--always", "--dirty"]
    return subprocess.run(command, check=False, capture_output=True, text=True).stdout.strip()


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--corpus", default="cgal", help="cgal, sweethome3d or a folder")
    parser.add_argument("--folder", default=".cache/corpora", help="where corpora are unpacked")
    parser.add_argument("--peers", default="", help="comma-separated: pytetwild,tetgen,gmsh")
    parser.add_argument(
        "--peer-sample", type=int, default=60, help="inputs for peers, spread evenly"
    )
    parser.add_argument("--limit", type=int, default=None)
    parser.add_argument("--seed", type=int, default=0, help="of the order that inputs are drawn in")
    parser.add_argument("--drawn", type=int, nargs=2, default=(0, None), metavar=("FROM", "TO"))
    parser.add_argument("--most-bytes", type=int, default=2**40, help="larger files are left out")
    parser.add_argument("--repeats", type=int, default=1, help="turns, of which the fastest counts")
    parser.add_argument("--smallest-first", action="store_true", help="of those that are drawn")
    parser.add_argument("--rows", type=Path, default=Path("convert_corpus.jsonl"))
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--edge-length-rel", type=float, default=0.05)
    parser.add_argument("--epsilon-rel", type=float, default=2e-3)
    parser.add_argument("--stop-energy", type=float, default=20.0)
    parser.add_argument("--time-limit", type=float, default=300.0)
    parser.add_argument("--one", nargs=3, metavar=("TOOL", "INPUT", "OUT"), help=argparse.SUPPRESS)
    return parser.parse_args()


def run_one(path: Path, tool: str, args: argparse.Namespace) -> dict:
    """Run one tool on one input in a fresh process group and measure what it leaves."""
    with tempfile.TemporaryDirectory() as work:
        command = [
            sys.executable, str(HERE), "--one", tool, str(path), work,
            "--edge-length-rel", str(args.edge_length_rel), "--epsilon-rel", str(args.epsilon_rel),
            "--stop-energy", str(args.stop_energy), "--time-limit", str(args.time_limit),
        ]  # fmt: skip
        # Both count their own processor time; by then neither works any more.
        code, wall, cpu, rss = _timed(command, Path(work), WAITING * args.time_limit)
        code = 124 if code == -signal.SIGXCPU else code
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


if __name__ == "__main__":
    main()
